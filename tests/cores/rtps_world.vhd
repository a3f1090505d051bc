-- SPDX-License-Identifier: Apache-2.0
-- A node with firm_packet_builder and its memories, for events from outside: see firm_rtps_node_tb.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity rtps_world is
  generic (
    WRITERS      : integer := 4; -- see firm_rtps_node
    READERS      : integer := 3;
    SOURCES      : integer := 8;
    SINKS        : integer := 8;
    SAMPLE       : integer := 64;
    SLOTS        : integer := 16;
    RELIABLE     : integer := 0; -- a bit for each endpoint
    TRANSIENT    : integer := 0;
    BYTES        : integer := 4096;
    ASSEMBLED    : integer := 0;
    PROGRAM_BITS : integer := 13 -- of an address in the memory of packets
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;

    packet_tdata  : in std_logic_vector(7 downto 0);
    packet_tuser  : in std_logic_vector(0 downto 0);
    packet_tvalid : in std_logic;
    packet_tlast  : in std_logic;

    sample_tdata  : in  std_logic_vector(7 downto 0);
    sample_tuser  : in  std_logic_vector(0 downto 0);
    sample_tvalid : in  std_logic;
    sample_tlast  : in  std_logic;
    sample_tready : out std_logic;

    frame_tdata  : out std_logic_vector(7 downto 0);
    frame_tvalid : out std_logic;
    frame_tlast  : out std_logic;
    frame_tready : in  std_logic;

    sent_tdata  : out std_logic_vector(7 downto 0);
    sent_tvalid : out std_logic;
    sent_tlast  : out std_logic;

    is_busy         : out std_logic;
    program_enable  : out std_logic;
    program_address : out std_logic_vector(RTPS_CONTROL_BITS-1 downto 0);

    peer_count   : out std_logic_vector(7 downto 0);
    source_count : out std_logic_vector(7 downto 0);
    sink_count   : out std_logic_vector(7 downto 0);

    is_discovery_lost   : out std_logic;
    is_sample_lost      : out std_logic;
    is_peer_refused     : out std_logic;
    is_endpoint_refused : out std_logic;
    is_frame_refused    : out std_logic;
    is_sample_parted    : out std_logic
  );
end entity rtps_world;

architecture rtl of rtps_world is

  constant ENDPOINTS : positive := READERS+WRITERS;

  signal names_address   : std_logic_vector(9 downto 0);
  signal names_data      : std_logic_vector(8*ENDPOINTS-1 downto 0);
  signal control_enable  : std_logic;
  signal control_address : std_logic_vector(RTPS_CONTROL_BITS-1 downto 0);
  signal control_word    : std_logic_vector(35 downto 0);
  signal packets_enable  : std_logic;
  signal packets_address : std_logic_vector(PROGRAM_BITS-1 downto 0);
  signal packets_word    : std_logic_vector(10 downto 0);

  signal start          : std_logic;
  signal bank           : std_logic_vector(RTPS_BANK_BITS-1 downto 0);
  signal packet         : std_logic_vector(7 downto 0);
  signal entry          : std_logic_vector(PROGRAM_BITS-1 downto 0);
  signal busy           : std_logic;
  signal build_valid    : std_logic;
  signal build_bank     : std_logic_vector(RTPS_BANK_BITS-1 downto 0);
  signal build_address  : std_logic_vector(6 downto 0);
  signal build_data     : std_logic_vector(7 downto 0);
  signal payload_bytes  : std_logic_vector(15 downto 0);
  signal payload_tdata  : std_logic_vector(7 downto 0);
  signal payload_tvalid : std_logic;
  signal payload_tready : std_logic;

begin

  u_names : entity work.rtps_world_names
    port map (
      clk     => clk,
      address => names_address,
      data    => names_data
    );

  u_control : entity work.rtps_world_control
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

  u_packets : entity work.rtps_world_packets
    port map (
      clk     => clk,
      packet  => packet,
      entry   => entry,
      enable  => packets_enable,
      address => packets_address,
      word    => packets_word
    );

  u_node : entity firm.firm_rtps_node
    generic map (
      WRITERS   => WRITERS,
      READERS   => READERS,
      SOURCES   => SOURCES,
      SINKS     => SINKS,
      SAMPLE    => SAMPLE,
      SLOTS     => SLOTS,
      DEPTH     => 4096,
      BYTES     => BYTES,
      SAMPLES   => 16,
      ASSEMBLED => ASSEMBLED
    )
    port map (
      clk                 => clk,
      rst_n               => rst_n,
      tick                => tick,
      prefix              => x"000002000000000200000000",
      are_reliable        => std_logic_vector(to_unsigned(RELIABLE, ENDPOINTS)),
      are_transient       => std_logic_vector(to_unsigned(TRANSIENT, ENDPOINTS)),
      program_enable      => control_enable,
      program_address     => control_address,
      program_word        => control_word,
      packet_tdata        => packet_tdata,
      packet_tuser        => packet_tuser,
      packet_tvalid       => packet_tvalid,
      packet_tlast        => packet_tlast,
      source_mac          => x"020000000001",
      names_address       => names_address,
      names_data          => names_data,
      frame_tdata         => frame_tdata,
      frame_tvalid        => frame_tvalid,
      frame_tlast         => frame_tlast,
      frame_tready        => frame_tready,
      sample_tdata        => sample_tdata,
      sample_tuser        => sample_tuser,
      sample_tvalid       => sample_tvalid,
      sample_tlast        => sample_tlast,
      sample_tready       => sample_tready,
      start               => start,
      packet              => packet,
      bank                => bank,
      payload_bytes       => payload_bytes,
      is_busy             => busy,
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
      is_discovery_lost   => is_discovery_lost,
      is_sample_lost      => is_sample_lost,
      is_peer_refused     => is_peer_refused,
      is_endpoint_refused => is_endpoint_refused,
      is_frame_refused    => is_frame_refused,
      is_sample_parted    => is_sample_parted,
      is_packet_broken    => open,
      is_endpoint_other   => open
    );

  u_builder : entity firm.firm_packet_builder
    generic map (
      ADDRESS_BITS => PROGRAM_BITS,
      BANK_BITS    => RTPS_BANK_BITS
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      start           => start,
      entry           => entry,
      bank            => bank,
      payload_bytes   => payload_bytes,
      is_busy         => busy,
      field_valid     => build_valid,
      field_bank      => build_bank,
      field_address   => build_address,
      field_data      => build_data,
      program_enable  => packets_enable,
      program_address => packets_address,
      program_word    => packets_word,
      s_axis_tdata    => payload_tdata,
      s_axis_tvalid   => payload_tvalid,
      s_axis_tready   => payload_tready,
      m_axis_tdata    => sent_tdata,
      m_axis_tvalid   => sent_tvalid,
      m_axis_tlast    => sent_tlast,
      m_axis_tready   => '1'
    );

  is_busy         <= busy;
  program_enable  <= control_enable;
  program_address <= control_address;

end architecture rtl;
