-- SPDX-License-Identifier: Apache-2.0
-- A Point and a Vector3 in; out go the Point with the Vector3's y, and the Point with the Vector3's x and z. Without a
-- register: both inputs are held until both outputs have been taken.
library ieee;
use ieee.std_logic_1164.all;

entity merge is
  port (
    clk                : in  std_logic;
    rst_n              : in  std_logic;
    in0_x              : in  std_logic_vector(63 downto 0);
    in0_y              : in  std_logic_vector(63 downto 0);
    in0_z              : in  std_logic_vector(63 downto 0);
    in0_segment_valid  : in  std_logic_vector(0 downto 0);
    in0_msg_valid      : in  std_logic;
    in0_msg_ready      : out std_logic;
    in1_x              : in  std_logic_vector(63 downto 0);
    in1_y              : in  std_logic_vector(63 downto 0);
    in1_z              : in  std_logic_vector(63 downto 0);
    in1_segment_valid  : in  std_logic_vector(0 downto 0);
    in1_msg_valid      : in  std_logic;
    in1_msg_ready      : out std_logic;
    out0_x             : out std_logic_vector(63 downto 0);
    out0_y             : out std_logic_vector(63 downto 0);
    out0_z             : out std_logic_vector(63 downto 0);
    out0_segment_valid : out std_logic_vector(0 downto 0);
    out0_msg_ready     : in  std_logic;
    out1_x             : out std_logic_vector(63 downto 0);
    out1_y             : out std_logic_vector(63 downto 0);
    out1_z             : out std_logic_vector(63 downto 0);
    out1_segment_valid : out std_logic_vector(0 downto 0);
    out1_msg_ready     : in  std_logic
  );
end entity merge;

architecture rtl of merge is

  signal both   : std_logic;
  signal done   : std_logic;
  signal sent_r : std_logic_vector(1 downto 0) := "00";
  signal taken  : std_logic_vector(1 downto 0);

begin

  both <= in0_msg_valid and in1_msg_valid;

  out0_x <= in0_x;
  out0_y <= in1_y;
  out0_z <= in0_z;
  out1_x <= in1_x;
  out1_y <= in0_y;
  out1_z <= in1_z;

  out0_segment_valid(0) <= both and not sent_r(0);
  out1_segment_valid(0) <= both and not sent_r(1);

  taken(0) <= both and (sent_r(0) or out0_msg_ready);
  taken(1) <= both and (sent_r(1) or out1_msg_ready);

  done          <= taken(0) and taken(1);
  in0_msg_ready <= done;
  in1_msg_ready <= done;

  remember : process (clk)
  begin
    if rising_edge(clk) then
      sent_r <= taken;
      if rst_n = '0' or done = '1' then
        sent_r <= "00";
      end if;
    end if;
  end process remember;

end architecture rtl;
