-- SPDX-License-Identifier: Apache-2.0
-- Simulates a DC motor with a quadrature encoder, driven by a PWM and a direction.
--
-- Without inductance and load torque, J d(speed)/dt = k (voltage - k speed)/R: the speed follows the mean voltage with
-- one time constant, and the back-EMF limits it. The mean is that of a PWM period. All values are whole numbers, so
-- that a model in another language is exact in each cycle. A held shaft does not turn.

library ieee;
use ieee.std_logic_1164.all;

entity motor is
  generic (
    -- Cycles of a period of the PWM, which begins a cycle after the reset.
    PWM_CYCLES    : positive;
    -- Of the shaft, in units of 2**-24 counts a cycle, without load at full duty.
    FULL_SPEED    : positive;
    -- In periods of the PWM.
    TIME_CONSTANT : positive
  );
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;
    pwm   : in  std_logic;
    -- '1' is forward.
    dir   : in  std_logic;
    held  : in  std_logic;
    -- A leads B when the shaft turns forward.
    enc_a : out std_logic;
    enc_b : out std_logic
  );
end entity motor;

architecture behaviour of motor is

  -- A turn of the encoder's disc by one line, four counts.
  constant LINE_STEPS  : integer := 4 * 2**24;
  constant COUNT_STEPS : integer := 2**24;
  constant DELAY       : time    := 1 ns;

begin

  turn : process (clk)
    variable is_running : boolean := false;
    variable position   : natural := 0;
    -- Cycles of this period in which the motor is driven forward, minus those backward.
    variable driven     : integer := 0;
    variable speed      : integer := 0;
    variable change     : integer := 0;
    variable angle      : integer := 0;
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        is_running := false;
      elsif not is_running then
        is_running := true;
      else
        if pwm = '1' and dir = '1' then
          driven := driven + 1;
        elsif pwm = '1' then
          driven := driven - 1;
        end if;
        if held = '0' then
          angle := angle + speed;
          if angle >= LINE_STEPS then
            angle := angle - LINE_STEPS;
          elsif angle < 0 then
            angle := angle + LINE_STEPS;
          end if;
        end if;
        position := position + 1;
        if position = PWM_CYCLES then
          change   := driven * (FULL_SPEED / PWM_CYCLES) - speed;
          -- Rounded away from zero; otherwise, a speed would never decay to zero.
          if change > 0 then
            speed := speed + (change + TIME_CONSTANT - 1) / TIME_CONSTANT;
          else
            speed := speed - (TIME_CONSTANT - 1 - change) / TIME_CONSTANT;
          end if;
          position := 0;
          driven   := 0;
          if held = '1' then
            speed := 0;
          end if;
        end if;
      end if;
      -- After the edge, as a netlist sees its clock some delta cycles late.
      enc_a <= '0' after DELAY;
      if angle >= COUNT_STEPS and angle < 3 * COUNT_STEPS then
        enc_a <= '1' after DELAY;
      end if;
      enc_b <= '0' after DELAY;
      if angle >= 2 * COUNT_STEPS then
        enc_b <= '1' after DELAY;
      end if;
    end if;
  end process turn;

end architecture behaviour;
