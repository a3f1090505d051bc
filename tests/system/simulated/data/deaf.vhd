-- SPDX-License-Identifier: Apache-2.0
-- Never takes a message.
library ieee;
use ieee.std_logic_1164.all;

entity deaf is
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
end entity deaf;

architecture rtl of deaf is
begin

  in_msg_ready      <= '0';
  out_x             <= in_x;
  out_y             <= in_y;
  out_z             <= in_z;
  out_segment_valid <= "0";

end architecture rtl;
