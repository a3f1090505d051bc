-- SPDX-License-Identifier: Apache-2.0
-- Drives the decoder's lines from a file: a line of VECTORS is A B N, for N cycles. RESULTS has the sum of all counts
-- and the number of errors. The lines change between clock edges, and samples are taken periodically.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library std;
use std.textio.all;

entity quadrature_decoder_tb is
  generic (
    VECTORS    : string   := "vectors.txt";
    RESULTS    : string   := "results.txt";
    FILTER     : positive := 4;
    COUNT_BITS : positive := 8
  );
end entity quadrature_decoder_tb;

architecture test of quadrature_decoder_tb is

  constant PERIOD : time := 10 ns;

  signal clk     : std_logic := '0';
  signal rst_n   : std_logic := '0';
  signal is_done : boolean   := false;
  signal enc_a   : std_logic := '0';
  signal enc_b   : std_logic := '0';
  signal sample  : std_logic := '0';
  signal count   : std_logic_vector(COUNT_BITS-1 downto 0);
  signal errors  : std_logic_vector(7 downto 0);

begin

  u_dut : entity work.quadrature_decoder
    generic map (
      FILTER     => FILTER,
      COUNT_BITS => COUNT_BITS
    )
    port map (
      clk    => clk,
      rst_n  => rst_n,
      enc_a  => enc_a,
      enc_b  => enc_b,
      sample => sample,
      count  => count,
      errors => errors
    );

  clk <= not clk after PERIOD / 2 when not is_done else '0';

  -- A sample every 64 cycles; the counts between them are added up.
  play : process
    file     vector_file : text open read_mode is VECTORS;
    file     result_file : text open write_mode is RESULTS;
    variable vector      : line;
    variable result      : line;
    variable a, b        : bit;
    variable cycles      : natural;
    variable total       : integer := 0;
    variable position    : natural := 0;

    procedure cycle is
    begin
      wait until falling_edge(clk);
      if sample = '1' then
        sample <= '0';
      end if;
      position := position + 1;
      if position = 64 then
        position := 0;
        sample   <= '1';
        total    := total + to_integer(signed(count));
      end if;
    end procedure cycle;
  begin
    readline(vector_file, vector);
    read(vector, a);
    read(vector, b);
    enc_a <= to_stdulogic(a);
    enc_b <= to_stdulogic(b);
    for k in 1 to 4 loop
      wait until falling_edge(clk);
    end loop;
    rst_n <= '1';
    for k in 1 to FILTER + 6 loop
      cycle;
    end loop;
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      read(vector, a);
      read(vector, b);
      read(vector, cycles);
      enc_a <= to_stdulogic(a);
      enc_b <= to_stdulogic(b);
      for k in 1 to cycles loop
        cycle;
      end loop;
    end loop;
    for k in 1 to FILTER + 6 loop
      cycle;
    end loop;
    -- The counts since the last sample, which may have been in the last cycle.
    wait until falling_edge(clk);
    write(result, total + to_integer(signed(count)));
    write(result, ' ');
    write(result, to_integer(unsigned(errors)));
    writeline(result_file, result);
    is_done <= true;
    wait;
  end process play;

end architecture test;
