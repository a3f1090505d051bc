-- SPDX-License-Identifier: Apache-2.0
-- The digest of a text: each character is added to 31 times the digest before it.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity digest is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- std_msgs/String
    in_payload_length   : in  std_logic_vector(31 downto 0);
    in_data_length      : in  std_logic_vector(31 downto 0);
    in_data_axis_tdata  : in  std_logic_vector(7 downto 0);
    in_data_axis_tkeep  : in  std_logic_vector(0 downto 0);
    in_data_axis_tvalid : in  std_logic;
    in_data_axis_tlast  : in  std_logic;
    in_data_axis_tready : out std_logic;
    in_segment_valid    : in  std_logic_vector(0 downto 0);
    in_msg_valid        : in  std_logic;
    in_msg_ready        : out std_logic;

    -- std_msgs/UInt32
    out_data          : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity digest;

architecture rtl of digest is

  signal digest_r : unsigned(31 downto 0);
  signal done_r   : std_logic;
  signal is_there : std_logic;

begin

  is_there             <= done_r and in_msg_valid;
  in_data_axis_tready  <= not done_r;
  in_msg_ready         <= is_there and out_msg_ready;
  out_data             <= std_logic_vector(digest_r);
  out_segment_valid(0) <= is_there;

  add : process (clk)
  begin
    if rising_edge(clk) then
      if in_data_axis_tvalid = '1' and done_r = '0' then
        digest_r <= shift_left(digest_r, 5) - digest_r + unsigned(in_data_axis_tdata);
        done_r   <= in_data_axis_tlast;
      elsif is_there = '1' and out_msg_ready = '1' then
        digest_r <= (others => '0');
        done_r   <= '0';
      end if;
      if rst_n = '0' then
        digest_r <= (others => '0');
        done_r   <= '0';
      end if;
    end if;
  end process add;

end architecture rtl;
