-- SPDX-License-Identifier: Apache-2.0
-- Watches a stream of whole frames and outputs the frame's id on every beat, for parts without `tid`. Simulation only.
library ieee;
use ieee.std_logic_1164.all;

entity firm_sim_tid is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    axis_tvalid : in  std_logic;
    axis_tlast  : in  std_logic;
    axis_tready : in  std_logic;
    axis_tid    : out std_logic_vector(7 downto 0)
  );
end entity firm_sim_tid;

architecture simulation of firm_sim_tid is

  signal first_r : std_logic;  -- the next beat is the first of a frame
  signal id_r    : std_logic_vector(7 downto 0);

begin

  remember_id : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        first_r <= '1';
      elsif axis_tvalid = '1' and axis_tready = '1' then
        first_r <= axis_tlast;
        if first_r = '1' then
          id_r <= axis_tdata(7 downto 0);
        end if;
      end if;
    end if;
  end process remember_id;

  axis_tid <= axis_tdata(7 downto 0) when first_r = '1' else id_r;

end architecture simulation;
