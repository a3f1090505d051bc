-- SPDX-License-Identifier: Apache-2.0
-- Returns texts, but takes nothing for the first cycles after reset.
library ieee;
use ieee.std_logic_1164.all;

entity doze is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk                  : in  std_logic;
    rst_n                : in  std_logic;
    in_payload_length    : in  std_logic_vector(31 downto 0);
    in_data_length       : in  std_logic_vector(31 downto 0);
    in_data_axis_tdata   : in  std_logic_vector(WIDTH-1 downto 0);
    in_data_axis_tkeep   : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_data_axis_tvalid  : in  std_logic;
    in_data_axis_tlast   : in  std_logic;
    in_data_axis_tready  : out std_logic;
    in_segment_valid     : in  std_logic_vector(0 downto 0);
    in_msg_valid         : in  std_logic;
    in_msg_ready         : out std_logic;
    out_payload_length   : out std_logic_vector(31 downto 0);
    out_data_length      : out std_logic_vector(31 downto 0);
    out_data_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    out_data_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    out_data_axis_tvalid : out std_logic;
    out_data_axis_tlast  : out std_logic;
    out_data_axis_tready : in  std_logic;
    out_segment_valid    : out std_logic_vector(0 downto 0);
    out_msg_valid        : out std_logic;
    out_msg_ready        : in  std_logic
  );
end entity doze;

architecture rtl of doze is

  constant WAKES : positive := 2000;

  signal slept_r : natural range 0 to WAKES := 0;
  signal awake   : std_logic;

begin

  awake <= '1' when slept_r = WAKES else '0';

  out_payload_length   <= in_payload_length;
  out_data_length      <= in_data_length;
  out_data_axis_tdata  <= in_data_axis_tdata;
  out_data_axis_tkeep  <= in_data_axis_tkeep;
  out_data_axis_tlast  <= in_data_axis_tlast;
  out_data_axis_tvalid <= in_data_axis_tvalid and awake;
  in_data_axis_tready  <= out_data_axis_tready and awake;
  out_segment_valid(0) <= in_segment_valid(0) and awake;
  out_msg_valid        <= in_msg_valid and awake;
  in_msg_ready         <= out_msg_ready and awake;

  sleep : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        slept_r <= 0;
      elsif slept_r < WAKES then
        slept_r <= slept_r + 1;
      end if;
    end if;
  end process sleep;

end architecture rtl;
