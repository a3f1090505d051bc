-- SPDX-License-Identifier: Apache-2.0
-- Generates a motor driver's inputs: a direction, and a PWM that is high for |duty| cycles of its period.
--
-- Both take a new duty only at the start of a period, so no period mixes two duties, and the direction changes only
-- while the PWM is low or restarts.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity pwm_driver is
  port (
    clk      : in  std_logic;
    rst_n    : in  std_logic;

    -- The cycle's number in its period, and whether it is the last one; all wheels share the counter.
    position : in  std_logic_vector(14 downto 0);
    is_last  : in  std_logic;
    -- Two's complement, at most a period.
    duty     : in  std_logic_vector(15 downto 0);

    pwm      : out std_logic;
    -- '1' is forward.
    dir      : out std_logic
  );
end entity pwm_driver;

architecture rtl of pwm_driver is

  signal on_r      : natural range 0 to 32768;
  signal forward_r : std_logic;
  signal pwm_r     : std_logic;
  signal dir_r     : std_logic;

begin

  pwm <= pwm_r;
  dir <= dir_r;

  drive : process (clk)
  begin
    if rising_edge(clk) then
      pwm_r <= '0';
      if unsigned(position) < on_r then
        pwm_r <= '1';
      end if;
      dir_r <= forward_r;
      if is_last = '1' then
        on_r      <= to_integer(unsigned(duty(14 downto 0)));
        forward_r <= '1';
        if duty(15) = '1' then
          on_r      <= to_integer(unsigned(-signed(duty)));
          forward_r <= '0';
        end if;
      end if;
      if rst_n = '0' then
        on_r      <= 0;
        forward_r <= '1';
        pwm_r     <= '0';
        dir_r     <= '1';
      end if;
    end if;
  end process drive;

end architecture rtl;
