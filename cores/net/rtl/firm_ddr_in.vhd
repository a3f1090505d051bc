-- SPDX-License-Identifier: Apache-2.0
-- A pin that receives a bit at each edge of a clock, for simulation: the cells of an FPGA's family have the same ports
-- and latency. Both bits of a cycle, from its rising edge on, are shown at the next rising edge.
library ieee;
use ieee.std_logic_1164.all;

entity firm_ddr_in is
  port (
    clk    : in  std_logic;
    pin    : in  std_logic;
    first  : out std_logic;  -- at the rising edge
    second : out std_logic   -- at the falling edge after it
  );
end entity firm_ddr_in;

architecture rtl of firm_ddr_in is

  signal first_r  : std_logic;
  signal second_r : std_logic;

begin

  sample_rising : process (clk)
  begin
    if rising_edge(clk) then
      first_r <= pin;
      first   <= first_r;
      second  <= second_r;
    end if;
  end process sample_rising;

  sample_falling : process (clk)
  begin
    if falling_edge(clk) then
      second_r <= pin;
    end if;
  end process sample_falling;

end architecture rtl;
