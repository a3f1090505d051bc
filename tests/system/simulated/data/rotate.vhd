-- SPDX-License-Identifier: Apache-2.0
-- A Vector3 with its components moved on by one place. It keeps one message, so that both neighbours can go on.
library ieee;
use ieee.std_logic_1164.all;

entity rotate is
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
end entity rotate;

architecture rtl of rotate is

  signal full_r : std_logic := '0';
  signal take   : std_logic;

begin

  take                 <= in_msg_valid and (not full_r or out_msg_ready);
  in_msg_ready         <= take;
  out_segment_valid(0) <= full_r;

  keep : process (clk)
  begin
    if rising_edge(clk) then
      if take = '1' then
        out_x  <= in_z;
        out_y  <= in_x;
        out_z  <= in_y;
        full_r <= '1';
      elsif out_msg_ready = '1' then
        full_r <= '0';
      end if;
      if rst_n = '0' then
        full_r <= '0';
      end if;
    end if;
  end process keep;

end architecture rtl;
