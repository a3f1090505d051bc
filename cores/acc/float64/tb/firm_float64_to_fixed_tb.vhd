-- SPDX-License-Identifier: Apache-2.0
-- Feeds firm_float64_to_fixed from a file and writes its results.
--
-- As binary digits: a line of VECTORS is in_number, of RESULTS out_number out_overflow out_undefined. The numbers
-- follow each other without a gap, except every fifth.

library ieee;
use ieee.std_logic_1164.all;

library std;
use std.textio.all;

library firm;
use firm.firm_sim_pkg.all;

entity firm_float64_to_fixed_tb is
  generic (
    VECTORS  : string   := "vectors.txt";
    RESULTS  : string   := "results.txt";
    EXPECTED : string   := "";
    WIDTH    : positive := 32;
    FRACTION : natural  := 29
  );
end entity firm_float64_to_fixed_tb;

architecture test of firm_float64_to_fixed_tb is

  constant PERIOD : time := 10 ns;

  signal clk           : std_logic := '0';
  signal rst_n         : std_logic := '0';
  signal is_done       : boolean   := false;
  signal received      : natural := 0;
  signal in_valid      : std_logic := '0';
  signal in_number     : std_logic_vector(63 downto 0) := (others => '0');
  signal out_valid     : std_logic;
  signal out_number    : std_logic_vector(WIDTH-1 downto 0);
  signal out_overflow  : std_logic;
  signal out_undefined : std_logic;

begin

  u_dut : entity firm.firm_float64_to_fixed
    generic map (
      WIDTH    => WIDTH,
      FRACTION => FRACTION
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => in_valid,
      in_number     => in_number,
      out_valid     => out_valid,
      out_number    => out_number,
      out_overflow  => out_overflow,
      out_undefined => out_undefined
    );

  clk   <= not clk after PERIOD / 2 when not is_done else '0';
  rst_n <= '1' after 4 * PERIOD;

  source : process
    file     vector_file : text open read_mode is VECTORS;
    variable vector      : line;
    variable number      : bit_vector(63 downto 0);
    variable sent        : natural := 0;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      read(vector, number);
      in_number <= to_stdlogicvector(number);
      in_valid  <= '1';
      sent      := sent + 1;
      wait until rising_edge(clk);
      in_valid  <= '0';
      if sent mod 5 = 0 then
        in_number <= (others => '1');
        wait until rising_edge(clk);
      end if;
    end loop;
    for drain in 1 to 5 loop
      wait until rising_edge(clk);
    end loop;
    assert received = sent
      report "firm_float64_to_fixed_tb: " & integer'image(received) & " results of " & integer'image(sent) & " numbers"
      severity failure;
    is_done <= true;
    wait;
  end process source;

  sink : process
    file     result_file : text open write_mode is RESULTS;
    file     wanted_file : text open read_mode is existing(EXPECTED);
    variable result      : line;
  begin
    wait until rising_edge(clk) and out_valid = '1';
    write(result, to_bitvector(out_number));
    write(result, ' ');
    write(result, to_bit(out_overflow));
    write(result, ' ');
    write(result, to_bit(out_undefined));
    write_result(result_file, wanted_file, EXPECTED, result);
    received <= received + 1;
  end process sink;

end architecture test;
