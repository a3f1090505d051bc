-- SPDX-License-Identifier: Apache-2.0
-- A clock unrelated to another one: it has a given average ratio of edges, begins at any phase, and deviates by up to a
-- thousandth, so that its edges drift along the other's. Simulation only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;

entity firm_sim_clock is
  generic (
    -- Period in picoseconds, 2 and more.
    PERIOD_PS : integer := 10000;
    -- Different for each instance, 1 and more: the phase and the deviation of the period.
    SEED : integer := 1
  );
  port (
    -- The clock stops after this one has stopped for some of the longer periods, so that the simulation can end.
    reference : in  std_logic;
    clk       : out std_logic
  );
end entity firm_sim_clock;

architecture simulation of firm_sim_clock is

  constant DRIFT       : real     := 0.001;
  -- Half periods without an edge of the reference, counted after half a microsecond without one.
  constant LAST_EDGES  : positive := 20;
  constant LONGEST_GAP : time     := 500 ns;

begin

  assert PERIOD_PS >= 2
    report "firm_sim_clock: PERIOD_PS is " & integer'image(PERIOD_PS) & "; legal: 2 or more"
    severity failure;
  assert SEED >= 1
    report "firm_sim_clock: SEED is " & integer'image(SEED) & "; legal: 1 or more"
    severity failure;

  tick : process
    variable random_1 : positive := SEED;
    variable random_2 : positive := 3;
    variable draw     : real;
    variable half     : time;
    variable level    : std_logic := '0';
    variable edges    : natural   := 0;  -- since the reference stopped
  begin
    clk <= '0';
    uniform(random_1, random_2, draw);  -- neighbouring seeds give similar first numbers
    uniform(random_1, random_2, draw);
    half := 500.0 * real(PERIOD_PS) * (1.0 + DRIFT * (2.0 * draw - 1.0)) * 1 fs;
    uniform(random_1, random_2, draw);
    wait for 1000.0 * draw * real(PERIOD_PS) * 1 fs;
    while edges < LAST_EDGES loop
      level := not level;
      clk   <= level;
      wait for half;
      edges := edges + 1;
      if reference'last_event < LONGEST_GAP then
        edges := 0;
      end if;
    end loop;
    wait;
  end process tick;

end architecture simulation;
