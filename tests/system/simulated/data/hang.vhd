-- SPDX-License-Identifier: Apache-2.0
-- Takes three messages and then no more; gives none.
library ieee;
use ieee.std_logic_1164.all;

entity hang is
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;
    in_x              : in  std_logic_vector(63 downto 0);
    in_y              : in  std_logic_vector(63 downto 0);
    in_z              : in  std_logic_vector(63 downto 0);
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;
    out_x             : out std_logic_vector(63 downto 0);
    out_y             : out std_logic_vector(63 downto 0);
    out_z             : out std_logic_vector(63 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity hang;

architecture rtl of hang is

  signal taken_r : natural range 0 to 3 := 0;
  signal take    : std_logic;

begin

  take              <= in_msg_valid when taken_r < 3 else '0';
  in_msg_ready      <= take;
  out_segment_valid <= "0";

  out_x <= in_x;
  out_y <= in_y;
  out_z <= in_z;

  count : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        taken_r <= 0;
      elsif take = '1' then
        taken_r <= taken_r + 1;
      end if;
    end if;
  end process count;

end architecture rtl;
