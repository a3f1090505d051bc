-- SPDX-License-Identifier: Apache-2.0
-- Tests the debouncer with a button that bounces for random times: the output must change once for each press and
-- release, neither too early nor too late.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;
library firm;

entity firm_debounce_tb is
  generic (
    CYCLES  : integer := 20;
    PRESSES : integer := 50;
    SEED    : integer := 1
  );
end entity firm_debounce_tb;

architecture simulation of firm_debounce_tb is

  constant PERIOD : time := 10 ns;
  -- Two stages of the synchroniser, one more in which a change may be missed, the register of the output, and the rest
  -- of the cycle in which the pin changed.
  constant LATENCY : positive := 5;

  signal clk        : std_logic := '0';
  signal pin        : std_logic := '0';
  signal debounced  : std_logic;
  signal is_done    : boolean   := false;
  signal changes    : natural   := 0;

begin

  clk <= not clk after PERIOD/2 when not is_done else '0';

  u_dut : entity firm.firm_debounce
    generic map (
      CYCLES => CYCLES
    )
    port map (
      clk       => clk,
      pin       => pin,
      debounced => debounced
    );

  press : process
    variable random_1 : positive := SEED;
    variable random_2 : positive := 31;
    variable level    : std_logic := '0';

    impure function drawn(lowest, highest : positive) return time is
      variable part : real;
    begin
      uniform(random_1, random_2, part);
      return lowest * 1 ns + part * real(highest - lowest) * 1 ns;
    end function drawn;

    procedure bounce is
      variable part : real;
    begin
      uniform(random_1, random_2, part);
      for change in 1 to 2 * integer(trunc(part * 8.0)) loop
        pin <= not pin;
        -- Always sampled, but too short.
        wait for drawn(20, (CYCLES - 4) * 10);
      end loop;
    end procedure bounce;

  begin
    report "SEED is " & integer'image(SEED);
    wait for (CYCLES + LATENCY) * PERIOD;
    for number in 1 to 2 * PRESSES loop
      bounce;
      level      := not level;
      pin        <= level;
      wait for (CYCLES - 2) * PERIOD;
      assert debounced = not level
        report "the output follows too early" severity failure;
      wait for (LATENCY + 2) * PERIOD;
      assert debounced = level
        report "the output does not follow" severity failure;
      assert changes = number
        report integer'image(changes) & " changes, expected " & integer'image(number) severity failure;
      wait for drawn(1, 1000);
    end loop;
    report "PASS " & integer'image(changes) & " changes";
    is_done <= true;
    wait;
  end process press;

  count : process (debounced)
  begin
    if debounced'event and now > 0 ns then
      changes <= changes + 1;
    end if;
  end process count;

end architecture simulation;
