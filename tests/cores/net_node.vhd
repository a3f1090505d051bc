-- SPDX-License-Identifier: Apache-2.0
-- A node in fabric at a GMII: found by ARP, pings and ROS 2, in the domain 0, at 192.0.2.9 and 02:00:00:00:00:02.
-- Frames of the host are samples to send, and samples of peers leave as frames.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity net_node is
  generic (
    WRITERS   : integer := 4;
    READERS   : integer := 3;
    SOURCES   : integer := 8;
    SINKS     : integer := 16;
    SAMPLE    : integer := 256; -- see firm_rtps_node
    SLOTS     : integer := 256;
    RELIABLE  : integer := 0;   -- a bit for each endpoint
    TRANSIENT : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;

    rx_dv : in  std_logic;
    rxd   : in  std_logic_vector(7 downto 0);
    tx_en : out std_logic;
    txd   : out std_logic_vector(7 downto 0);

    -- Frames of the host.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- Frames to the host.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    peer_count   : out std_logic_vector(7 downto 0);
    source_count : out std_logic_vector(7 downto 0);
    sink_count   : out std_logic_vector(7 downto 0)
  );
end entity net_node;

architecture rtl of net_node is

  constant MAC         : std_logic_vector(47 downto 0) := x"020000000002";
  constant ADDRESS     : std_logic_vector(31 downto 0) := x"c0000209";
  constant ENDPOINTS   : positive := READERS+WRITERS;
  constant NODE_PREFIX : std_logic_vector(95 downto 0) := x"0000" & MAC & x"00000000";

  signal received_tdata  : std_logic_vector(7 downto 0);
  signal received_tuser  : std_logic_vector(0 downto 0);
  signal received_tvalid : std_logic;
  signal received_tlast  : std_logic;

  signal udp_tdata  : std_logic_vector(7 downto 0);
  signal udp_tuser  : std_logic_vector(0 downto 0);
  signal udp_tvalid : std_logic;
  signal udp_tlast  : std_logic;
  signal source_mac : std_logic_vector(47 downto 0);

  signal names_address : std_logic_vector(9 downto 0);
  signal names_data    : std_logic_vector(8*ENDPOINTS-1 downto 0);

  signal control_enable  : std_logic;
  signal control_address : std_logic_vector(RTPS_CONTROL_BITS-1 downto 0);
  signal control_word    : std_logic_vector(35 downto 0);

  signal start           : std_logic;
  signal packet          : std_logic_vector(7 downto 0);
  signal entry           : std_logic_vector(12 downto 0);
  signal payload_bytes   : std_logic_vector(15 downto 0);
  signal is_busy         : std_logic;
  signal bank            : std_logic_vector(RTPS_BANK_BITS-1 downto 0);
  signal build_valid     : std_logic;
  signal build_bank      : std_logic_vector(RTPS_BANK_BITS-1 downto 0);
  signal build_address   : std_logic_vector(6 downto 0);
  signal build_data      : std_logic_vector(7 downto 0);
  signal program_enable  : std_logic;
  signal program_address : std_logic_vector(12 downto 0);
  signal program_word    : std_logic_vector(10 downto 0);

  signal payload_tdata  : std_logic_vector(7 downto 0);
  signal payload_tvalid : std_logic;
  signal payload_tready : std_logic;

  -- Replies, then packets.
  signal sources_tdata  : std_logic_vector(15 downto 0);
  signal sources_tvalid : std_logic_vector(1 downto 0);
  signal sources_tlast  : std_logic_vector(1 downto 0);
  signal sources_tready : std_logic_vector(1 downto 0);
  signal sent_tdata     : std_logic_vector(7 downto 0);
  signal sent_tvalid    : std_logic;
  signal sent_tlast     : std_logic;
  signal sent_tready    : std_logic;

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
      mac           => MAC,
      address       => ADDRESS,
      s_axis_tdata  => received_tdata,
      s_axis_tuser  => received_tuser,
      s_axis_tvalid => received_tvalid,
      s_axis_tlast  => received_tlast,
      m_axis_tdata  => sources_tdata(7 downto 0),
      m_axis_tvalid => sources_tvalid(0),
      m_axis_tlast  => sources_tlast(0),
      m_axis_tready => sources_tready(0),
      is_lost       => open
    );

  u_udp : entity firm.firm_udp_receiver
    generic map (
      PORTS => 3
    )
    port map (
      clk            => clk,
      rst_n          => rst_n,
      mac            => MAC,
      address        => ADDRESS,
      group_ip       => x"efff0001",
      udp_ports      => x"1cf31cf21ce8",
      s_axis_tdata   => received_tdata,
      s_axis_tuser   => received_tuser,
      s_axis_tvalid  => received_tvalid,
      s_axis_tlast   => received_tlast,
      m_axis_tdata   => udp_tdata,
      m_axis_tuser   => udp_tuser,
      m_axis_tvalid  => udp_tvalid,
      m_axis_tlast   => udp_tlast,
      source_mac     => source_mac,
      source_address => open,
      source_port    => open,
      port_match     => open,
      is_fragment    => open,
      is_broken      => open
    );

  u_names : entity work.net_node_names
    port map (
      clk     => clk,
      address => names_address,
      data    => names_data
    );

  u_control : entity work.net_node_control
    generic map (
      WRITERS => WRITERS,
      READERS => READERS,
      SOURCES => SOURCES,
      SINKS   => SINKS,
      SLOTS   => SLOTS
    )
    port map (
      clk     => clk,
      enable  => control_enable,
      address => control_address,
      word    => control_word
    );

  u_node : entity firm.firm_rtps_node
    generic map (
      WRITERS => WRITERS,
      READERS => READERS,
      SOURCES => SOURCES,
      SINKS   => SINKS,
      SAMPLE  => SAMPLE,
      SLOTS   => SLOTS,
      DEPTH   => 4096,
      BYTES   => 4096
    )
    port map (
      clk                 => clk,
      rst_n               => rst_n,
      tick                => tick,
      prefix              => NODE_PREFIX,
      are_reliable        => std_logic_vector(to_unsigned(RELIABLE, ENDPOINTS)),
      are_transient       => std_logic_vector(to_unsigned(TRANSIENT, ENDPOINTS)),
      program_enable      => control_enable,
      program_address     => control_address,
      program_word        => control_word,
      packet_tdata        => udp_tdata,
      packet_tuser        => udp_tuser,
      packet_tvalid       => udp_tvalid,
      packet_tlast        => udp_tlast,
      source_mac          => source_mac,
      names_address       => names_address,
      names_data          => names_data,
      frame_tdata         => m_axis_tdata,
      frame_tvalid        => m_axis_tvalid,
      frame_tlast         => m_axis_tlast,
      frame_tready        => m_axis_tready,
      sample_tdata        => s_axis_tdata,
      sample_tuser        => "0",
      sample_tvalid       => s_axis_tvalid,
      sample_tlast        => s_axis_tlast,
      sample_tready       => s_axis_tready,
      start               => start,
      packet              => packet,
      bank                => bank,
      payload_bytes       => payload_bytes,
      is_busy             => is_busy,
      build_field_valid   => build_valid,
      build_field_bank    => build_bank,
      build_field_address => build_address,
      build_field_data    => build_data,
      payload_tdata       => payload_tdata,
      payload_tvalid      => payload_tvalid,
      payload_tready      => payload_tready,
      peer_count          => peer_count,
      source_count        => source_count,
      sink_count          => sink_count,
      is_discovery_lost   => open,
      is_sample_lost      => open,
      is_peer_refused     => open,
      is_endpoint_refused => open,
      is_frame_refused    => open,
      is_sample_parted    => open,
      is_packet_broken    => open,
      is_endpoint_other   => open
    );

  u_packets : entity work.net_node_packets
    port map (
      clk     => clk,
      packet  => packet,
      entry   => entry,
      enable  => program_enable,
      address => program_address,
      word    => program_word
    );

  u_builder : entity firm.firm_packet_builder
    generic map (
      ADDRESS_BITS => 13
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      start           => start,
      entry           => entry,
      bank            => bank,
      payload_bytes   => payload_bytes,
      is_busy         => is_busy,
      field_valid     => build_valid,
      field_bank      => build_bank,
      field_address   => build_address,
      field_data      => build_data,
      program_enable  => program_enable,
      program_address => program_address,
      program_word    => program_word,
      s_axis_tdata    => payload_tdata,
      s_axis_tvalid   => payload_tvalid,
      s_axis_tready   => payload_tready,
      m_axis_tdata    => sources_tdata(15 downto 8),
      m_axis_tvalid   => sources_tvalid(1),
      m_axis_tlast    => sources_tlast(1),
      m_axis_tready   => sources_tready(1)
    );

  -- ------------------------------------------------------------------ frames of two sources

  u_merge : entity firm.firm_net_merge
    generic map (
      SOURCES => 2
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => sources_tdata,
      s_axis_tvalid => sources_tvalid,
      s_axis_tlast  => sources_tlast,
      s_axis_tready => sources_tready,
      m_axis_tdata  => sent_tdata,
      m_axis_tvalid => sent_tvalid,
      m_axis_tlast  => sent_tlast,
      m_axis_tready => sent_tready
    );

  u_transmitter : entity firm.firm_mac_transmitter
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => sent_tdata,
      s_axis_tvalid => sent_tvalid,
      s_axis_tlast  => sent_tlast,
      s_axis_tready => sent_tready,
      tx_en         => tx_en,
      tx_er         => open,
      txd           => txd,
      is_sent       => open,
      is_spoiled    => open
    );

end architecture rtl;
