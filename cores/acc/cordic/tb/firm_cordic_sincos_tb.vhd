-- SPDX-License-Identifier: Apache-2.0
-- Feeds firm_cordic_sincos from a file and writes its results; both sides stall now and then.
--
-- A line of VECTORS is an angle, a line of RESULTS is cosine and sine, as binary digits. The reader of RESULTS checks
-- the values; the bench checks that each vector gives one stable result.

library ieee;
use ieee.std_logic_1164.all;

library std;
use std.textio.all;

library firm;
use firm.firm_sim_pkg.all;

entity firm_cordic_sincos_tb is
  generic (
    VECTORS    : string   := "vectors.txt";
    RESULTS    : string   := "results.txt";
    EXPECTED   : string   := "";
    FRACTION   : positive := 29;
    ITERATIONS : positive := 29
  );
end entity firm_cordic_sincos_tb;

architecture test of firm_cordic_sincos_tb is

  constant PERIOD : time := 10 ns;

  signal clk           : std_logic := '0';
  signal rst_n         : std_logic := '0';
  signal in_valid      : std_logic := '0';
  signal in_ready      : std_logic;
  signal in_angle      : std_logic_vector(FRACTION+2 downto 0) := (others => '0');
  signal out_valid     : std_logic;
  signal out_ready     : std_logic := '0';
  signal out_cos       : std_logic_vector(FRACTION+1 downto 0);
  signal out_sin       : std_logic_vector(FRACTION+1 downto 0);

  signal sent          : natural := 0;
  signal received      : natural := 0;
  signal is_empty      : boolean := false;
  signal finished      : boolean := false;

begin

  u_dut : entity firm.firm_cordic_sincos
    generic map (
      FRACTION   => FRACTION,
      ITERATIONS => ITERATIONS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => in_valid,
      in_ready      => in_ready,
      in_angle      => in_angle,
      out_valid     => out_valid,
      out_ready     => out_ready,
      out_cos       => out_cos,
      out_sin       => out_sin
    );

  finished <= is_empty and received = sent;

  clk <= not clk after PERIOD / 2 when not finished else '0';

  source : process
    file     vector_file : text open read_mode is VECTORS;
    variable vector      : line;
    variable angle       : bit_vector(FRACTION+2 downto 0);
  begin
    wait for 3 * PERIOD;
    wait until rising_edge(clk);
    rst_n <= '1';
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      read(vector, angle);
      for idle in 1 to (sent mod 5) * 20 loop
        wait until rising_edge(clk);
      end loop;
      in_angle <= to_stdlogicvector(angle);
      in_valid <= '1';
      wait until rising_edge(clk) and in_ready = '1';
      in_valid <= '0';
      sent     <= sent + 1;
    end loop;
    is_empty <= true;
    wait;
  end process source;

  sink : process
    file     result_file : text open write_mode is RESULTS;
    file     wanted_file : text open read_mode is existing(EXPECTED);
    variable result      : line;
    variable cos         : std_logic_vector(FRACTION+1 downto 0);
    variable sin         : std_logic_vector(FRACTION+1 downto 0);
  begin
    wait until rising_edge(clk) and out_valid = '1';
    assert received < sent
      report "firm_cordic_sincos_tb: more results than angles"
      severity failure;
    cos := out_cos;
    sin := out_sin;
    for idle in 1 to (received mod 7) * 15 loop
      wait until rising_edge(clk);
    end loop;
    out_ready <= '1';
    wait until rising_edge(clk);
    assert out_valid = '1' and out_cos = cos and out_sin = sin
      report "firm_cordic_sincos_tb: a waiting result changed"
      severity failure;
    out_ready <= '0';
    write(result, to_bitvector(out_cos));
    write(result, ' ');
    write(result, to_bitvector(out_sin));
    write_result(result_file, wanted_file, EXPECTED, result);
    received <= received + 1;
  end process sink;

  watchdog : process
  begin
    wait on received, finished for 2000 * PERIOD;
    assert received'active or finished'active or finished
      report "firm_cordic_sincos_tb: no result for 2000 cycles"
      severity failure;
    if finished then
      wait;
    end if;
  end process watchdog;

end architecture test;
