-- SPDX-License-Identifier: Apache-2.0
-- A board at a GMII that is found by ARP and answers echo requests: 192.0.2.2, 02:00:00:00:00:02.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity net_board is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    rx_dv : in  std_logic;
    rxd   : in  std_logic_vector(7 downto 0);
    tx_en : out std_logic;
    txd   : out std_logic_vector(7 downto 0)
  );
end entity net_board;

architecture rtl of net_board is

  signal received_tdata  : std_logic_vector(7 downto 0);
  signal received_tuser  : std_logic_vector(0 downto 0);
  signal received_tvalid : std_logic;
  signal received_tlast  : std_logic;

  signal reply_tdata  : std_logic_vector(7 downto 0);
  signal reply_tvalid : std_logic;
  signal reply_tlast  : std_logic;
  signal reply_tready : std_logic;

begin

  u_receiver : entity firm.firm_mac_receiver
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rx_dv         => rx_dv,
      rxd           => rxd,
      m_axis_tdata  => received_tdata,
      m_axis_tuser  => received_tuser,
      m_axis_tvalid => received_tvalid,
      m_axis_tlast  => received_tlast,
      is_good       => open,
      is_broken     => open,
      is_long       => open
    );

  u_responder : entity firm.firm_net_responder
    port map (
      clk           => clk,
      rst_n         => rst_n,
      mac           => x"020000000002",
      address       => x"c0000202",
      s_axis_tdata  => received_tdata,
      s_axis_tuser  => received_tuser,
      s_axis_tvalid => received_tvalid,
      s_axis_tlast  => received_tlast,
      m_axis_tdata  => reply_tdata,
      m_axis_tvalid => reply_tvalid,
      m_axis_tlast  => reply_tlast,
      m_axis_tready => reply_tready,
      is_lost       => open
    );

  u_transmitter : entity firm.firm_mac_transmitter
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => reply_tdata,
      s_axis_tvalid => reply_tvalid,
      s_axis_tlast  => reply_tlast,
      s_axis_tready => reply_tready,
      tx_en         => tx_en,
      tx_er         => open,
      txd           => txd,
      is_sent       => open,
      is_spoiled    => open
    );

end architecture rtl;
