-- SPDX-License-Identifier: Apache-2.0
-- A pin that sends two bits in each cycle of a clock, for simulation: the cells of an FPGA's family have the same
-- ports. Both bits are taken at a rising edge; the second one is shown from the falling edge on.
library ieee;
use ieee.std_logic_1164.all;

entity firm_ddr_out is
  port (
    clk    : in  std_logic;
    first  : in  std_logic;
    second : in  std_logic;
    pin    : out std_logic
  );
end entity firm_ddr_out;

architecture rtl of firm_ddr_out is

  signal first_r  : std_logic;
  signal second_r : std_logic;

begin

  take : process (clk)
  begin
    if rising_edge(clk) then
      first_r  <= first;
      second_r <= second;
    end if;
  end process take;

  pin <= first_r when clk = '1' else second_r;

end architecture rtl;
