-- SPDX-License-Identifier: Apache-2.0
-- Chance in test benches: numbers that a seed decides, stalls of both sides of a handshake, and the end of a reset.
-- Simulation only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;

package firm_sim_random_pkg is

  -- The state of a generator. Each process has its own, of the bench's seed and a number that differs.
  type random_t is record
    first  : positive;
    second : positive;
  end record random_t;

  function seeded(seed : positive; process_number : positive) return random_t;

  -- A number from 0 to `highest`, and an event of this chance.
  procedure draw(random : inout random_t; highest : in natural; number : out natural);
  procedure draw_chance(random : inout random_t; percent : in natural; happens : out boolean);

  -- As a source: waits while it pauses. `edge` is the one at which it acts.
  procedure pause(signal clk : in std_logic; edge : in std_logic; random : inout random_t; percent : in natural);

  -- As a sink: whether it takes a beat in the next cycle.
  procedure draw_ready(random : inout random_t; percent : in natural; signal ready : out std_logic);

  -- A concurrent call: `ready` is drawn at each rising edge.
  procedure stall(
    signal   clk            : in std_logic;
    constant seed           : in positive;
    constant process_number : in positive;
    constant percent        : in natural;
    signal   ready          : out std_logic
  );

  -- Ends the reset after some edges of the clock.
  procedure end_reset(signal clk : in std_logic; edge : in std_logic; signal rst_n : out std_logic);

end package firm_sim_random_pkg;

package body firm_sim_random_pkg is

  constant RESET_CYCLES : positive := 4;

  function seeded(seed : positive; process_number : positive) return random_t is
  begin
    return (seed, process_number);
  end function seeded;

  procedure draw(random : inout random_t; highest : in natural; number : out natural) is
    variable part : real;
  begin
    uniform(random.first, random.second, part);
    number := integer(floor(part * real(highest + 1)));
  end procedure draw;

  procedure draw_chance(random : inout random_t; percent : in natural; happens : out boolean) is
    variable part : real;
  begin
    uniform(random.first, random.second, part);
    happens := 100.0 * part < real(percent);
  end procedure draw_chance;

  procedure wait_for_edge(signal clk : in std_logic; edge : in std_logic) is
  begin
    wait until clk'event and clk = edge;
  end procedure wait_for_edge;

  procedure pause(signal clk : in std_logic; edge : in std_logic; random : inout random_t; percent : in natural) is
    variable pauses : boolean;
  begin
    loop
      draw_chance(random, percent, pauses);
      exit when not pauses;
      wait_for_edge(clk, edge);
    end loop;
  end procedure pause;

  procedure draw_ready(random : inout random_t; percent : in natural; signal ready : out std_logic) is
    variable stalls : boolean;
  begin
    draw_chance(random, percent, stalls);
    ready <= '1';
    if stalls then
      ready <= '0';
    end if;
  end procedure draw_ready;

  procedure stall(
    signal   clk            : in std_logic;
    constant seed           : in positive;
    constant process_number : in positive;
    constant percent        : in natural;
    signal   ready          : out std_logic
  ) is
    variable random : random_t := seeded(seed, process_number);
  begin
    loop
      wait_for_edge(clk, '1');
      draw_ready(random, percent, ready);
    end loop;
  end procedure stall;

  procedure end_reset(signal clk : in std_logic; edge : in std_logic; signal rst_n : out std_logic) is
  begin
    for cycle in 1 to RESET_CYCLES loop
      wait_for_edge(clk, edge);
    end loop;
    rst_n <= '1';
  end procedure end_reset;

end package body firm_sim_random_pkg;
