-- SPDX-License-Identifier: Apache-2.0
-- Feeds firm_float64_to_block and firm_fixed_to_float64 from one file each and writes their results.
--
-- As binary digits: a line of BLOCK_VECTORS is in_numbers, of BLOCK_RESULTS out_numbers out_exponent
-- out_undefined out_zero; a line of FIXED_VECTORS is in_number, of FIXED_RESULTS out_number. The fixed-point
-- numbers follow each other without a gap, except every fifth.

library ieee;
use ieee.std_logic_1164.all;

library std;
use std.textio.all;

library firm;
use firm.firm_sim_pkg.all;

entity firm_float64_tb is
  generic (
    BLOCK_VECTORS  : string   := "block_vectors.txt";
    BLOCK_RESULTS  : string   := "block_results.txt";
    BLOCK_EXPECTED : string   := "";
    FIXED_VECTORS  : string   := "fixed_vectors.txt";
    FIXED_RESULTS  : string   := "fixed_results.txt";
    FIXED_EXPECTED : string   := "";
    COUNT          : positive := 4;
    BLOCK_FRACTION : positive := 60;
    FIXED_FRACTION : natural  := 60
  );
end entity firm_float64_tb;

architecture test of firm_float64_tb is

  constant PERIOD : time := 10 ns;

  signal clk              : std_logic := '0';
  signal rst_n            : std_logic := '0';
  signal is_block_done    : boolean   := false;
  signal is_fixed_done    : boolean   := false;
  signal received         : natural := 0;

  signal block_in_valid   : std_logic := '0';
  signal block_in_ready   : std_logic;
  signal block_in_numbers : std_logic_vector(64*COUNT-1 downto 0) := (others => '0');
  signal block_valid      : std_logic;
  signal block_ready      : std_logic := '0';
  signal block_numbers    : std_logic_vector((BLOCK_FRACTION+1)*COUNT-1 downto 0);
  signal block_exponent   : std_logic_vector(10 downto 0);
  signal block_undefined  : std_logic;
  signal block_zero       : std_logic;

  signal fixed_in_valid   : std_logic := '0';
  signal fixed_in_number  : std_logic_vector(63 downto 0) := (others => '0');
  signal fixed_valid      : std_logic;
  signal fixed_number     : std_logic_vector(63 downto 0);

begin

  u_block : entity firm.firm_float64_to_block
    generic map (
      COUNT    => COUNT,
      FRACTION => BLOCK_FRACTION
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => block_in_valid,
      in_ready      => block_in_ready,
      in_numbers    => block_in_numbers,
      out_valid     => block_valid,
      out_ready     => block_ready,
      out_numbers   => block_numbers,
      out_exponent  => block_exponent,
      out_undefined => block_undefined,
      out_zero      => block_zero
    );

  u_fixed : entity firm.firm_fixed_to_float64
    generic map (
      FRACTION => FIXED_FRACTION
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_valid   => fixed_in_valid,
      in_number  => fixed_in_number,
      out_valid  => fixed_valid,
      out_number => fixed_number
    );

  clk   <= not clk after PERIOD / 2 when not (is_block_done and is_fixed_done) else '0';
  rst_n <= '1' after 4 * PERIOD;

  blocks : process
    file     vector_file : text open read_mode is BLOCK_VECTORS;
    file     result_file : text open write_mode is BLOCK_RESULTS;
    file     wanted_file : text open read_mode is existing(BLOCK_EXPECTED);
    variable vector      : line;
    variable result      : line;
    variable numbers     : bit_vector(64*COUNT-1 downto 0);
    variable cycles      : natural;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      read(vector, numbers);
      block_in_numbers <= to_stdlogicvector(numbers);
      block_in_valid   <= '1';
      wait until rising_edge(clk) and block_in_ready = '1';
      block_in_valid   <= '0';
      block_in_numbers <= (others => '1');
      cycles           := 0;
      while cycles = 0 or block_valid = '0' loop
        wait until rising_edge(clk);
        cycles := cycles + 1;
      end loop;
      assert cycles = 2 * COUNT + 2
        report "firm_float64_tb: a block took " & integer'image(cycles) & " cycles"
        severity failure;
      block_ready <= '1';
      wait until rising_edge(clk);
      block_ready <= '0';
      write(result, to_bitvector(block_numbers));
      write(result, ' ');
      write(result, to_bitvector(block_exponent));
      write(result, ' ');
      write(result, to_bit(block_undefined));
      write(result, ' ');
      write(result, to_bit(block_zero));
      write_result(result_file, wanted_file, BLOCK_EXPECTED, result);
    end loop;
    is_block_done <= true;
    wait;
  end process blocks;

  fixed_source : process
    file     vector_file : text open read_mode is FIXED_VECTORS;
    variable vector      : line;
    variable number      : bit_vector(63 downto 0);
    variable sent        : natural := 0;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      read(vector, number);
      fixed_in_number <= to_stdlogicvector(number);
      fixed_in_valid  <= '1';
      sent            := sent + 1;
      wait until rising_edge(clk);
      fixed_in_valid  <= '0';
      if sent mod 5 = 0 then
        wait until rising_edge(clk);
      end if;
    end loop;
    for drain in 1 to 7 loop
      wait until rising_edge(clk);
    end loop;
    assert received = sent
      report "firm_float64_tb: " & integer'image(received) & " results of " & integer'image(sent) & " numbers"
      severity failure;
    is_fixed_done <= true;
    wait;
  end process fixed_source;

  fixed_sink : process
    file     result_file : text open write_mode is FIXED_RESULTS;
    file     wanted_file : text open read_mode is existing(FIXED_EXPECTED);
    variable result      : line;
  begin
    wait until rising_edge(clk) and fixed_valid = '1';
    write(result, to_bitvector(fixed_number));
    write_result(result_file, wanted_file, FIXED_EXPECTED, result);
    received <= received + 1;
  end process fixed_sink;

end architecture test;
