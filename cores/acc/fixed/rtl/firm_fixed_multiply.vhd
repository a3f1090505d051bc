-- SPDX-License-Identifier: Apache-2.0
-- Multiplies two fixed-point numbers: a * b, rounded to nearest, ties to even, and saturated.
--
-- Numbers are in two's complement; each operand and the result have their own sizes. A pipeline: one result in every
-- cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;

entity firm_fixed_multiply is
  generic (
    -- Bits and fraction bits of the factors: 2 to 127 bits.
    A_WIDTH      : positive := 32;
    A_FRACTION   : natural  := 16;
    B_WIDTH      : positive := 32;
    B_FRACTION   : natural  := 16;
    -- Bits and fraction bits of the result: 2 to 128 bits.
    OUT_WIDTH    : positive := 32;
    OUT_FRACTION : natural  := 16
  );
  port (
    clk          : in  std_logic;
    rst_n        : in  std_logic;

    in_valid     : in  std_logic;
    in_ready     : out std_logic;
    in_a         : in  std_logic_vector(A_WIDTH-1 downto 0);
    in_b         : in  std_logic_vector(B_WIDTH-1 downto 0);

    out_valid    : out std_logic;
    out_ready    : in  std_logic;
    out_number   : out std_logic_vector(OUT_WIDTH-1 downto 0);
    -- The product is out of range: the result is the smallest or largest one.
    out_overflow : out std_logic
  );
end entity firm_fixed_multiply;

architecture rtl of firm_fixed_multiply is

  -- With a sign in front, since ghdl 2.0 omits the highest bit of a product in a VHDL netlist.
  constant PRODUCT : positive := A_WIDTH + B_WIDTH + 2;

  signal advance         : std_logic;
  signal operand_valid_r : std_logic;
  signal a_r             : signed(A_WIDTH downto 0);
  signal b_r             : signed(B_WIDTH downto 0);
  signal product_valid_r : std_logic;
  signal product_r       : signed(PRODUCT-1 downto 0);

begin

  in_ready <= advance;

  multiply : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        operand_valid_r <= in_valid;
        a_r             <= resize(signed(in_a), A_WIDTH+1);
        b_r             <= resize(signed(in_b), B_WIDTH+1);
        product_valid_r <= operand_valid_r;
        product_r       <= a_r * b_r;
      end if;
      if rst_n = '0' then
        operand_valid_r <= '0';
        product_valid_r <= '0';
      end if;
    end if;
  end process multiply;

  u_resize : entity firm.firm_fixed_resize
    generic map (
      IN_WIDTH     => PRODUCT-2,
      IN_FRACTION  => A_FRACTION+B_FRACTION,
      OUT_WIDTH    => OUT_WIDTH,
      OUT_FRACTION => OUT_FRACTION
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      in_valid     => product_valid_r,
      in_ready     => advance,
      in_number    => std_logic_vector(product_r(PRODUCT-3 downto 0)),
      out_valid    => out_valid,
      out_ready    => out_ready,
      out_number   => out_number,
      out_overflow => out_overflow
    );

end architecture rtl;
