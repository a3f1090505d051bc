-- SPDX-License-Identifier: Apache-2.0
-- Feeds firm_cordic_vectoring from a file and writes its results; both sides stall now and then.
--
-- A line of VECTORS is x y, a line of RESULTS is magnitude angle, as binary digits. The reader of RESULTS checks
-- the values; the bench checks that each vector gives one stable result.

library ieee;
use ieee.std_logic_1164.all;

library std;
use std.textio.all;

library firm;
use firm.firm_sim_pkg.all;

entity firm_cordic_vectoring_tb is
  generic (
    VECTORS    : string   := "vectors.txt";
    RESULTS    : string   := "results.txt";
    EXPECTED   : string   := "";
    WIDTH      : positive := 64;
    FRACTION   : positive := 60;
    ITERATIONS : positive := 35
  );
end entity firm_cordic_vectoring_tb;

architecture test of firm_cordic_vectoring_tb is

  constant PERIOD : time := 10 ns;

  signal clk           : std_logic := '0';
  signal rst_n         : std_logic := '0';
  signal in_valid      : std_logic := '0';
  signal in_ready      : std_logic;
  signal in_x          : std_logic_vector(WIDTH-1 downto 0) := (others => '0');
  signal in_y          : std_logic_vector(WIDTH-1 downto 0) := (others => '0');
  signal out_valid     : std_logic;
  signal out_ready     : std_logic := '0';
  signal out_magnitude : std_logic_vector(WIDTH-1 downto 0);
  signal out_angle     : std_logic_vector(FRACTION+2 downto 0);

  signal sent          : natural := 0;
  signal received      : natural := 0;
  signal is_empty      : boolean := false;
  signal finished      : boolean := false;

begin

  u_dut : entity firm.firm_cordic_vectoring
    generic map (
      WIDTH      => WIDTH,
      FRACTION   => FRACTION,
      ITERATIONS => ITERATIONS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => in_valid,
      in_ready      => in_ready,
      in_x          => in_x,
      in_y          => in_y,
      out_valid     => out_valid,
      out_ready     => out_ready,
      out_magnitude => out_magnitude,
      out_angle     => out_angle
    );

  finished <= is_empty and received = sent;

  clk <= not clk after PERIOD / 2 when not finished else '0';

  source : process
    file     vector_file : text open read_mode is VECTORS;
    variable vector      : line;
    variable x, y        : bit_vector(WIDTH-1 downto 0);
  begin
    wait for 3 * PERIOD;
    wait until rising_edge(clk);
    rst_n <= '1';
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      read(vector, x);
      read(vector, y);
      for idle in 1 to (sent mod 5) * 20 loop
        wait until rising_edge(clk);
      end loop;
      in_x     <= to_stdlogicvector(x);
      in_y     <= to_stdlogicvector(y);
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
    variable magnitude   : std_logic_vector(WIDTH-1 downto 0);
    variable angle       : std_logic_vector(FRACTION+2 downto 0);
  begin
    wait until rising_edge(clk) and out_valid = '1';
    assert received < sent
      report "firm_cordic_vectoring_tb: more results than vectors"
      severity failure;
    magnitude := out_magnitude;
    angle     := out_angle;
    for idle in 1 to (received mod 7) * 15 loop
      wait until rising_edge(clk);
    end loop;
    out_ready <= '1';
    wait until rising_edge(clk);
    assert out_valid = '1' and out_magnitude = magnitude and out_angle = angle
      report "firm_cordic_vectoring_tb: a waiting result changed"
      severity failure;
    out_ready <= '0';
    write(result, to_bitvector(out_magnitude));
    write(result, ' ');
    write(result, to_bitvector(out_angle));
    write_result(result_file, wanted_file, EXPECTED, result);
    received <= received + 1;
  end process sink;

  watchdog : process
  begin
    wait on received, finished for 2000 * PERIOD;
    assert received'active or finished'active or finished
      report "firm_cordic_vectoring_tb: no result for 2000 cycles"
      severity failure;
    if finished then
      wait;
    end if;
  end process watchdog;

end architecture test;
