-- SPDX-License-Identifier: Apache-2.0
-- A node of ROS 2 above UDP: packets of RTPS in, frames `id | length | payload` and jobs for firm_packet_builder out.
-- It announces itself, notes its peers, and has readers of several topics and a writer of one, best effort.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_node is
  generic (
    PEERS   : integer := 8;    -- 1 to 8
    WRITERS : integer := 2;    -- 2 to 234: see firm_rtps_control
    READERS : integer := 1;    -- 1 to 8
    SOURCES : integer := 8;    -- matched writers of peers, 1 to 32
    SAMPLE  : integer := 64;   -- bytes of the longest payload that is sent, a power of two, 2 to 128
    DEPTH   : integer := 2048; -- bytes of waiting discovery, and of waiting payloads; a power of two, 4 to 65536
    SAMPLES : integer := 16    -- that wait for the host, a power of two, 2 or more
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

    -- The prefix of the node, and the entity of the writer that sends samples; the first byte on the line highest.
    prefix        : in std_logic_vector(95 downto 0);
    sample_writer : in std_logic_vector(31 downto 0);
    -- What the readers want of a writer.
    wants_reliable  : in std_logic_vector(READERS-1 downto 0);
    wants_transient : in std_logic_vector(READERS-1 downto 0);

    -- Payloads of firm_udp_receiver.
    packet_tdata  : in std_logic_vector(7 downto 0);
    packet_tuser  : in std_logic_vector(0 downto 0);
    packet_tvalid : in std_logic;
    packet_tlast  : in std_logic;
    source_mac    : in std_logic_vector(47 downto 0);

    -- The memory that fusesoc_firm.fabric.names makes.
    names_address : out std_logic_vector(9 downto 0);
    names_data    : in  std_logic_vector(8*READERS-1 downto 0);

    -- Frames to the host.
    frame_tdata  : out std_logic_vector(7 downto 0);
    frame_tvalid : out std_logic;
    frame_tlast  : out std_logic;
    frame_tready : in  std_logic;

    -- Samples, with the header of their encoding.
    sample_tdata  : in  std_logic_vector(7 downto 0);
    sample_tvalid : in  std_logic;
    sample_tlast  : in  std_logic;
    sample_tready : out std_logic;

    -- To firm_packet_builder. `packet` is a number of fusesoc_firm.fabric.packets.
    start               : out std_logic;
    packet              : out std_logic_vector(7 downto 0);
    payload_bytes       : out std_logic_vector(15 downto 0);
    is_busy             : in  std_logic;
    build_field_valid   : out std_logic;
    build_field_address : out std_logic_vector(6 downto 0);
    build_field_data    : out std_logic_vector(7 downto 0);
    payload_tdata       : out std_logic_vector(7 downto 0);
    payload_tvalid      : out std_logic;
    payload_tready      : in  std_logic;

    peers_known   : out std_logic_vector(7 downto 0);
    sources_known : out std_logic_vector(SOURCES-1 downto 0);
    -- Pulses.
    is_lost      : out std_logic;  -- a packet of discovery without room
    is_full      : out std_logic;  -- a peer without room
    is_unmatched : out std_logic;  -- a writer that matches, without room
    is_dropped   : out std_logic;  -- a sample without room, see firm_rtps_readers
    is_long      : out std_logic   -- a sample to send, with more than SAMPLE bytes
  );
end entity firm_rtps_node;

architecture rtl of firm_rtps_node is

  constant FIRST_READER : positive := 2;  -- 1 is the writer of ros_discovery_info

  signal field_valid   : std_logic;
  signal field_address : std_logic_vector(RECORD_BITS-1 downto 0);
  signal field_data    : std_logic_vector(7 downto 0);
  signal payload_valid : std_logic;
  signal payload_data  : std_logic_vector(7 downto 0);
  signal kind          : std_logic_vector(7 downto 0);
  signal flags         : std_logic_vector(7 downto 0);
  signal is_submessage : std_logic;
  signal is_whole      : std_logic;
  signal is_faulty     : std_logic;
  signal is_foreign    : std_logic;
  signal is_aborted    : std_logic;

  signal take       : std_logic;
  signal takes      : std_logic;
  signal has_word   : std_logic;
  signal has_field  : std_logic;
  signal address    : std_logic_vector(RECORD_BITS-1 downto 0);
  signal data       : std_logic_vector(7 downto 0);
  signal is_end     : std_logic;
  signal is_mine    : std_logic;
  signal told_kind  : std_logic_vector(7 downto 0);
  signal told_flags : std_logic_vector(7 downto 0);
  signal writer     : std_logic_vector(31 downto 0);
  signal number     : std_logic_vector(31 downto 0);
  signal second     : std_logic_vector(31 downto 0);
  signal is_large   : std_logic;
  signal is_gone    : std_logic;
  signal begins     : std_logic;
  signal is_value   : std_logic;
  signal id         : std_logic_vector(15 downto 0);
  signal size       : std_logic_vector(15 downto 0);
  signal place      : std_logic_vector(15 downto 0);
  signal is_little  : std_logic;
  signal is_last    : std_logic;

  signal matches       : std_logic_vector(READERS-1 downto 0);
  signal is_known      : std_logic;
  signal guid_place    : std_logic_vector(3 downto 0);
  signal guid_byte     : std_logic_vector(7 downto 0);
  signal entity_valid  : std_logic;
  signal entity_place  : std_logic_vector(1 downto 0);
  signal entity_data   : std_logic_vector(7 downto 0);
  signal is_announced  : std_logic;
  signal is_left       : std_logic;
  signal peer          : std_logic_vector(2 downto 0);
  signal readers_busy  : std_logic;

begin

  u_walker : entity firm.firm_rtps_walker
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => packet_tdata,
      s_axis_tuser  => packet_tuser,
      s_axis_tvalid => packet_tvalid,
      s_axis_tlast  => packet_tlast,
      source_mac    => source_mac,
      field_valid   => field_valid,
      field_address => field_address,
      field_data    => field_data,
      payload_valid => payload_valid,
      payload_data  => payload_data,
      kind          => kind,
      flags         => flags,
      has_key       => open,
      has_status    => open,
      is_submessage => is_submessage,
      is_whole      => is_whole,
      is_faulty     => is_faulty,
      is_foreign    => is_foreign,
      is_aborted    => is_aborted
    );

  u_inbox : entity firm.firm_rtps_inbox
    generic map (
      DEPTH => DEPTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      prefix        => prefix,
      field_valid   => field_valid,
      field_address => field_address,
      field_data    => field_data,
      payload_valid => payload_valid,
      payload_data  => payload_data,
      is_submessage => is_submessage,
      is_whole      => is_whole,
      is_faulty     => is_faulty,
      is_foreign    => is_foreign,
      is_aborted    => is_aborted,
      take          => take,
      has_word      => has_word,
      has_field     => has_field,
      address       => address,
      data          => data,
      is_end        => is_end,
      is_mine       => is_mine,
      kind          => told_kind,
      flags         => told_flags,
      writer        => writer,
      number        => number,
      second        => second,
      is_large      => is_large,
      is_gone       => is_gone,
      begins        => begins,
      is_value      => is_value,
      id            => id,
      size          => size,
      place         => place,
      is_little     => is_little,
      is_last       => is_last,
      is_lost       => is_lost
    );

  takes <= take and has_word;

  u_endpoint : entity firm.firm_rtps_endpoint
    generic map (
      READERS => READERS
    )
    port map (
      clk             => clk,
      s_valid         => takes,
      has_field       => has_field,
      address         => address,
      data            => data,
      begins          => begins,
      is_value        => is_value,
      id              => id,
      size            => size,
      place           => place,
      is_little       => is_little,
      is_last         => is_last,
      wants_reliable  => wants_reliable,
      wants_transient => wants_transient,
      names_address   => names_address,
      names_data      => names_data,
      matches         => matches,
      is_known        => is_known,
      guid_place      => guid_place,
      guid_byte       => guid_byte,
      entity_valid    => entity_valid,
      entity_place    => entity_place,
      entity_data     => entity_data
    );

  u_readers : entity firm.firm_rtps_readers
    generic map (
      READERS => READERS,
      FIRST   => FIRST_READER,
      SOURCES => SOURCES,
      BYTES   => DEPTH,
      SAMPLES => SAMPLES
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      field_valid   => field_valid,
      field_address => field_address,
      field_data    => field_data,
      payload_valid => payload_valid,
      payload_data  => payload_data,
      kind          => kind,
      flags         => flags,
      is_submessage => is_submessage,
      is_whole      => is_whole,
      is_faulty     => is_faulty,
      is_foreign    => is_foreign,
      is_aborted    => is_aborted,
      is_mine       => is_mine,
      matches       => matches,
      is_known      => is_known,
      guid_place    => guid_place,
      guid_byte     => guid_byte,
      entity_valid  => entity_valid,
      entity_place  => entity_place,
      entity_data   => entity_data,
      is_announced  => is_announced,
      is_gone       => is_gone,
      peer          => peer,
      is_left       => is_left,
      is_busy       => readers_busy,
      m_axis_tdata  => frame_tdata,
      m_axis_tvalid => frame_tvalid,
      m_axis_tlast  => frame_tlast,
      m_axis_tready => frame_tready,
      sources_known => sources_known,
      is_full       => is_unmatched,
      is_lost       => is_dropped
    );

  u_control : entity firm.firm_rtps_control
    generic map (
      PEERS   => PEERS,
      WRITERS => WRITERS,
      READERS => READERS,
      SAMPLE  => SAMPLE
    )
    port map (
      clk                 => clk,
      rst_n               => rst_n,
      tick                => tick,
      sample_writer       => sample_writer,
      take                => take,
      has_word            => has_word,
      has_field           => has_field,
      address             => address,
      data                => data,
      is_end              => is_end,
      kind                => told_kind,
      flags               => told_flags,
      writer              => writer,
      number              => number,
      second              => second,
      is_large            => is_large,
      is_gone             => is_gone,
      begins              => begins,
      is_value            => is_value,
      id                  => id,
      size                => size,
      place               => place,
      is_little           => is_little,
      is_last             => is_last,
      is_announced        => is_announced,
      is_left             => is_left,
      peer                => peer,
      readers_busy        => readers_busy,
      s_axis_tdata        => sample_tdata,
      s_axis_tvalid       => sample_tvalid,
      s_axis_tlast        => sample_tlast,
      s_axis_tready       => sample_tready,
      is_long             => is_long,
      start               => start,
      packet              => packet,
      payload_bytes       => payload_bytes,
      is_busy             => is_busy,
      build_field_valid   => build_field_valid,
      build_field_address => build_field_address,
      build_field_data    => build_field_data,
      m_axis_tdata        => payload_tdata,
      m_axis_tvalid       => payload_tvalid,
      m_axis_tready       => payload_tready,
      peers_known         => peers_known,
      is_full             => is_full
    );

end architecture rtl;
