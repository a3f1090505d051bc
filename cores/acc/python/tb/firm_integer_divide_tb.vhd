-- SPDX-License-Identifier: Apache-2.0
-- Tests the division of integers, fed by firm_sim_operation. The dividend is in the highest bits of a line; the
-- remainder follows the quotient.

library ieee;
use ieee.std_logic_1164.all;

library firm;

entity firm_integer_divide_tb is
  generic (
    VECTORS  : string   := "vectors.txt";
    RESULTS  : string   := "results.txt";
    EXPECTED : string   := "";
    WIDTH    : positive := 32;
    SEED     : positive := 1;
    -- Cycles of 100 in which one side of the handshake stalls.
    STALLS   : natural  := 30
  );
end entity firm_integer_divide_tb;

architecture test of firm_integer_divide_tb is

  constant PERIOD : time := 10 ns;

  signal clk       : std_logic := '0';
  signal rst_n     : std_logic := '0';
  signal is_done   : boolean   := false;

  signal in_valid  : std_logic;
  signal in_ready  : std_logic;
  signal operands  : std_logic_vector(2*WIDTH-1 downto 0);
  signal out_valid : std_logic;
  signal out_ready : std_logic;
  signal result    : std_logic_vector(2*WIDTH-1 downto 0);

begin

  clk   <= not clk after PERIOD / 2 when not is_done else '0';
  rst_n <= '1' after 3 * PERIOD;

  u_dut : entity firm.firm_integer_divide
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => in_valid,
      in_ready      => in_ready,
      in_a          => operands(2*WIDTH-1 downto WIDTH),
      in_b          => operands(WIDTH-1 downto 0),
      out_valid     => out_valid,
      out_ready     => out_ready,
      out_quotient  => result(2*WIDTH-1 downto WIDTH),
      out_remainder => result(WIDTH-1 downto 0)
    );

  u_operation : entity firm.firm_sim_operation
    generic map (
      VECTORS  => VECTORS,
      RESULTS  => RESULTS,
      EXPECTED => EXPECTED,
      IN_BITS  => 2*WIDTH,
      OUT_BITS => 2*WIDTH,
      SEED     => SEED,
      STALLS   => STALLS
    )
    port map (
      clk       => clk,
      rst_n     => rst_n,
      is_done   => is_done,
      in_valid  => in_valid,
      in_ready  => in_ready,
      operands  => operands,
      out_valid => out_valid,
      out_ready => out_ready,
      result    => result
    );

end architecture test;
