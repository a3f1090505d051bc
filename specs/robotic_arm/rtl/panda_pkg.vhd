-- SPDX-License-Identifier: Apache-2.0
-- The arm: Franka Emika's Panda with its hand, in Denavit and Hartenberg's parameters after Craig.
--
-- Joint i is a turn by ALPHA about x, a step by A along x, a turn by its angle about z, and a step by D along z:
--   T(i) = T(i-1) * Rx(ALPHA) * Tx(A) * Rz(angle) * Tz(D)
-- The hand at the flange is an eighth joint that does not move. Another arm of seven joints needs other numbers here.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package panda_pkg is

  constant JOINTS   : positive := 7;
  -- Joints and hand.
  constant STEPS    : positive := JOINTS + 1;

  -- Lengths in m, angles in rad and matrices are two's complement of 32 bits, from -4 to 4: more would make constants
  -- that ghdl 2.0 cannot translate to Verilog.
  constant FRACTION : positive := 29;

  subtype number_t is signed(FRACTION+2 downto 0);
  subtype step_t is natural range 0 to STEPS-1;

  -- ALPHA in quarter turns: -1, 0, 1.
  type turns_t is array (step_t) of integer range -1 to 1;
  -- In units of 2**-FRACTION m.
  type lengths_t is array (step_t) of integer;

  constant TURNS      : turns_t   := (0, -1, 1, 1, -1, 1, 1, 0);
  --                                  0          0  0          0.0825 m  -0.0825 m  0  0.088 m   0
  constant A          : lengths_t := (0,         0, 0,         44291850, -44291850, 0, 47244640, 0);
  --                                  0.333 m    0  0.316 m    0         0.384 m    0  0         0.107 + 0.1034 m
  constant D          : lengths_t := (178778014, 0, 169651208, 0,        206158430, 0, 0,        112957640);
  -- Of the hand: an eighth of a turn back.
  constant HAND_ANGLE : integer   := -421657428;

end package panda_pkg;
