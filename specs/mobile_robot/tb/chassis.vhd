-- SPDX-License-Identifier: Apache-2.0
-- The environment of the robot's pins in the simulation of the whole system: four slightly different motors, and
-- glitches on one encoder's lines, which its decoder must ignore.

library ieee;
use ieee.std_logic_1164.all;
library firm;

entity chassis is
  port (
    clk             : in  std_logic;
    rst_n           : in  std_logic;
    base_pwm        : in  std_logic_vector(3 downto 0);
    base_dir        : in  std_logic_vector(3 downto 0);
    base_enc_a      : out std_logic_vector(3 downto 0);
    base_enc_b      : out std_logic_vector(3 downto 0);
    base_enc_errors : in  std_logic_vector(31 downto 0);
    base_stalled    : in  std_logic_vector(3 downto 0)
  );
end entity chassis;

architecture behaviour of chassis is

  -- 45 to 51 counts per control period at full duty, as in model.py.
  type speeds_t is array (0 to 3) of positive;
  constant FULL_SPEEDS : speeds_t := (80_000, 75_000, 85_000, 80_000);

  -- The motors leave the reset together with the system, so that their periods are those of its PWM.
  signal motor_rst_n : std_logic;

  signal enc_a    : std_logic_vector(3 downto 0);
  signal enc_b    : std_logic_vector(3 downto 0);
  signal glitch_r : std_logic := '0';

begin

  u_reset : entity firm.firm_cdc_reset
    port map (
      clk          => clk,
      rst_n        => rst_n,
      synced_rst_n => motor_rst_n
    );

  wheels : for k in 0 to 3 generate
    u_motor : entity work.motor
      generic map (
        PWM_CYCLES    => 5_000,
        FULL_SPEED    => FULL_SPEEDS(k),
        TIME_CONSTANT => 20
      )
      port map (
        clk   => clk,
        rst_n => motor_rst_n,
        pwm   => base_pwm(k),
        dir   => base_dir(k),
        held  => '0',
        enc_a => enc_a(k),
        enc_b => enc_b(k)
      );
  end generate wheels;

  base_enc_a <= enc_a(3) & (enc_a(2) xor glitch_r) & enc_a(1 downto 0);
  base_enc_b <= enc_b;

  -- Two cycles in 97.
  glitches : process (clk)
    variable position : natural := 0;
  begin
    if rising_edge(clk) then
      position := (position + 1) mod 97;
      glitch_r <= '0';
      if position < 2 then
        glitch_r <= '1';
      end if;
    end if;
  end process glitches;

  judge : process (clk)
  begin
    if rising_edge(clk) and rst_n = '1' then
      assert base_enc_errors = (31 downto 0 => '0') and base_stalled = "0000"
        report "chassis: the robot reports an encoder's error or a stalled wheel"
        severity failure;
    end if;
  end process judge;

end architecture behaviour;
