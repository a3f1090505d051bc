-- SPDX-License-Identifier: Apache-2.0
-- Tests an operation on fixed-point numbers, fed by firm_sim_operation. The first operand is in the highest bits of a
-- line; the flags overflow and undefined follow a result.

library ieee;
use ieee.std_logic_1164.all;

library firm;

entity firm_fixed_tb is
  generic (
    VECTORS           : string   := "vectors.txt";
    RESULTS           : string   := "results.txt";
    EXPECTED          : string   := "";
    -- add, subtract, multiply, divide or resize.
    OPERATION         : string   := "multiply";
    -- Of add and resize, A.
    A_WIDTH           : positive := 32;
    A_FRACTION        : natural  := 16;
    B_WIDTH           : positive := 32;
    B_FRACTION        : natural  := 16;
    OUT_WIDTH         : positive := 32;
    OUT_FRACTION      : natural  := 16;
    SEED              : positive := 1;
    -- Cycles of 100 in which one side of the handshake stalls.
    STALLS            : natural  := 30
  );
end entity firm_fixed_tb;

architecture test of firm_fixed_tb is

  constant PERIOD : time     := 10 ns;

  function in_width return positive is
  begin
    if OPERATION = "resize" then
      return A_WIDTH;
    end if;
    return A_WIDTH + B_WIDTH;
  end function in_width;

  constant IN_BITS  : positive := in_width;
  -- The number, overflow, undefined.
  constant OUT_BITS : positive := OUT_WIDTH + 2;

  signal clk       : std_logic := '0';
  signal rst_n     : std_logic := '0';
  signal is_done   : boolean   := false;

  signal in_valid  : std_logic;
  signal in_ready  : std_logic;
  signal operands  : std_logic_vector(IN_BITS-1 downto 0);
  signal out_valid : std_logic;
  signal out_ready : std_logic;
  signal result    : std_logic_vector(OUT_BITS-1 downto 0);

begin

  zero : if OPERATION /= "divide" generate
    result(0) <= '0';
  end generate zero;

  adds : if OPERATION = "add" or OPERATION = "subtract" generate
    signal subtracts : std_logic;
  begin

    subtracts <= '1' when OPERATION = "subtract" else '0';

    u_dut : entity firm.firm_fixed_add
      generic map (
        WIDTH => A_WIDTH
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        in_valid     => in_valid,
        in_ready     => in_ready,
        in_a         => operands(A_WIDTH+B_WIDTH-1 downto B_WIDTH),
        in_b         => operands(B_WIDTH-1 downto 0),
        in_subtract  => subtracts,
        out_valid    => out_valid,
        out_ready    => out_ready,
        out_number   => result(OUT_BITS-1 downto 2),
        out_overflow => result(1)
      );

  end generate adds;

  multiplies : if OPERATION = "multiply" generate

    u_dut : entity firm.firm_fixed_multiply
      generic map (
        A_WIDTH      => A_WIDTH,
        A_FRACTION   => A_FRACTION,
        B_WIDTH      => B_WIDTH,
        B_FRACTION   => B_FRACTION,
        OUT_WIDTH    => OUT_WIDTH,
        OUT_FRACTION => OUT_FRACTION
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        in_valid     => in_valid,
        in_ready     => in_ready,
        in_a         => operands(A_WIDTH+B_WIDTH-1 downto B_WIDTH),
        in_b         => operands(B_WIDTH-1 downto 0),
        out_valid    => out_valid,
        out_ready    => out_ready,
        out_number   => result(OUT_BITS-1 downto 2),
        out_overflow => result(1)
      );

  end generate multiplies;

  divides : if OPERATION = "divide" generate

    u_dut : entity firm.firm_fixed_divide
      generic map (
        A_WIDTH      => A_WIDTH,
        A_FRACTION   => A_FRACTION,
        B_WIDTH      => B_WIDTH,
        B_FRACTION   => B_FRACTION,
        OUT_WIDTH    => OUT_WIDTH,
        OUT_FRACTION => OUT_FRACTION
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        in_valid      => in_valid,
        in_ready      => in_ready,
        in_a          => operands(A_WIDTH+B_WIDTH-1 downto B_WIDTH),
        in_b          => operands(B_WIDTH-1 downto 0),
        out_valid     => out_valid,
        out_ready     => out_ready,
        out_number    => result(OUT_BITS-1 downto 2),
        out_overflow  => result(1),
        out_undefined => result(0)
      );

  end generate divides;

  resizes : if OPERATION = "resize" generate

    u_dut : entity firm.firm_fixed_resize
      generic map (
        IN_WIDTH     => A_WIDTH,
        IN_FRACTION  => A_FRACTION,
        OUT_WIDTH    => OUT_WIDTH,
        OUT_FRACTION => OUT_FRACTION
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        in_valid     => in_valid,
        in_ready     => in_ready,
        in_number    => operands,
        out_valid    => out_valid,
        out_ready    => out_ready,
        out_number   => result(OUT_BITS-1 downto 2),
        out_overflow => result(1)
      );

  end generate resizes;

  clk   <= not clk after PERIOD / 2 when not is_done else '0';
  rst_n <= '1' after 4 * PERIOD;

  u_operation : entity firm.firm_sim_operation
    generic map (
      VECTORS  => VECTORS,
      RESULTS  => RESULTS,
      EXPECTED => EXPECTED,
      IN_BITS  => IN_BITS,
      OUT_BITS => OUT_BITS,
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
