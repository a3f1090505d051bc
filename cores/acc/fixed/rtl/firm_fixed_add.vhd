-- SPDX-License-Identifier: Apache-2.0
-- Adds or subtracts two fixed-point numbers of one size: a + b, or a - b if `in_subtract` is high, saturated.
--
-- Numbers are in two's complement, with any fraction. A pipeline: one result in every cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;

entity firm_fixed_add is
  generic (
    -- Bits of the numbers: 2 to 128.
    WIDTH : positive := 32
  );
  port (
    clk          : in  std_logic;
    rst_n        : in  std_logic;

    in_valid     : in  std_logic;
    in_ready     : out std_logic;
    in_a         : in  std_logic_vector(WIDTH-1 downto 0);
    in_b         : in  std_logic_vector(WIDTH-1 downto 0);
    in_subtract  : in  std_logic := '0';

    out_valid    : out std_logic;
    out_ready    : in  std_logic;
    out_number   : out std_logic_vector(WIDTH-1 downto 0);
    -- The sum is out of range: the result is the smallest or largest one.
    out_overflow : out std_logic
  );
end entity firm_fixed_add;

architecture rtl of firm_fixed_add is

  signal advance : std_logic;
  signal valid_r : std_logic;
  signal sum_r   : signed(WIDTH downto 0);

begin

  in_ready <= advance;

  add : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        valid_r <= in_valid;
        sum_r   <= resize(signed(in_a), WIDTH+1) + resize(signed(in_b), WIDTH+1);
        if in_subtract = '1' then
          sum_r <= resize(signed(in_a), WIDTH+1) - resize(signed(in_b), WIDTH+1);
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process add;

  u_resize : entity firm.firm_fixed_resize
    generic map (
      IN_WIDTH     => WIDTH+1,
      IN_FRACTION  => 0,
      OUT_WIDTH    => WIDTH,
      OUT_FRACTION => 0
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      in_valid     => valid_r,
      in_ready     => advance,
      in_number    => std_logic_vector(sum_r),
      out_valid    => out_valid,
      out_ready    => out_ready,
      out_number   => out_number,
      out_overflow => out_overflow
    );

end architecture rtl;
