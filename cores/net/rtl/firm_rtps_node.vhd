-- SPDX-License-Identifier: Apache-2.0
-- A node of ROS 2 above UDP: packets of RTPS in, frames `id | length | payload` and jobs for firm_packet_builder out,
-- and vice versa. It announces itself, finds its peers, and matches their readers and writers with its own.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_rtps_pkg.all;

entity firm_rtps_node is
  generic (
    WRITERS : integer := 2;    -- of the node, the one of ros_discovery_info included, 1 to 9
    READERS : integer := 1;    -- 0 to 8
    SOURCES : integer := 8;    -- matched writers of peers, 1 to 64
    SINKS   : integer := 16;   -- matched readers of peers, 1 to 128
    SAMPLE  : integer := 64;   -- bytes of the longest payload that is sent, a power of two, 2 to 65536
    SLOTS   : integer := 16;   -- for the last samples of all writers, a power of two, 2 to 256
    DEPTH   : integer := 2048; -- bytes of waiting discovery, a power of two, 4 to 65536
    BYTES   : integer := 2048; -- of waiting payloads, a power of two, 4 to 131072
    SAMPLES : integer := 16;   -- that wait for the host, a power of two, 2 or more
    -- Bytes of the longest sample in fragments of RTPS, or without room in BYTES: a power of two, 1024 to 65536. 0 if
    -- they are skipped, or dropped.
    ASSEMBLED : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

    -- The prefix of the node; the first byte on the line highest.
    prefix : in std_logic_vector(95 downto 0);
    -- The quality of the readers (lowest), of the writers with frames, and of the writer of ros_discovery_info.
    are_reliable  : in std_logic_vector(READERS+WRITERS-1 downto 0);
    are_transient : in std_logic_vector(READERS+WRITERS-1 downto 0);

    -- The memory created by fusesoc_firm.fabric.control.
    program_enable  : out std_logic;
    program_address : out std_logic_vector(RTPS_CONTROL_BITS-1 downto 0);
    program_word    : in  std_logic_vector(35 downto 0);

    -- Payloads of firm_udp_receiver.
    packet_tdata  : in std_logic_vector(7 downto 0);
    packet_tuser  : in std_logic_vector(0 downto 0);
    packet_tvalid : in std_logic;
    packet_tlast  : in std_logic;
    source_mac    : in std_logic_vector(47 downto 0);

    -- The memory created by fusesoc_firm.fabric.names.
    names_address : out std_logic_vector(9 downto 0);
    names_data    : in  std_logic_vector(8*(READERS+WRITERS)-1 downto 0);

    -- Frames to the host.
    frame_tdata  : out std_logic_vector(7 downto 0);
    frame_tvalid : out std_logic;
    frame_tlast  : out std_logic;
    frame_tready : in  std_logic;

    -- Frames to send; their id is the number of the writer. Payloads have the header of their encoding.
    sample_tdata  : in  std_logic_vector(7 downto 0);
    sample_tuser  : in  std_logic_vector(0 downto 0);
    sample_tvalid : in  std_logic;
    sample_tlast  : in  std_logic;
    sample_tready : out std_logic;

    -- To firm_packet_builder. `packet` is a number of fusesoc_firm.fabric.packets.
    start               : out std_logic;
    packet              : out std_logic_vector(7 downto 0);
    bank                : out std_logic_vector(RTPS_BANK_BITS-1 downto 0);
    payload_bytes       : out std_logic_vector(15 downto 0);
    is_busy             : in  std_logic;
    build_field_valid   : out std_logic;
    build_field_bank    : out std_logic_vector(RTPS_BANK_BITS-1 downto 0);
    build_field_address : out std_logic_vector(6 downto 0);
    build_field_data    : out std_logic_vector(7 downto 0);
    payload_tdata       : out std_logic_vector(7 downto 0);
    payload_tvalid      : out std_logic;
    payload_tready      : in  std_logic;

    -- Entries in use.
    peer_count   : out std_logic_vector(7 downto 0);
    source_count : out std_logic_vector(7 downto 0);
    sink_count   : out std_logic_vector(7 downto 0);
    -- Pulses: valid data without room, or without a place in a table.
    is_discovery_lost   : out std_logic;  -- a packet of discovery
    is_sample_lost      : out std_logic;  -- a sample in a packet
    is_peer_refused     : out std_logic;
    is_endpoint_refused : out std_logic;  -- one that matches
    is_frame_refused    : out std_logic;  -- a frame to send: without a payload, too long, or of another id
    -- Pulses: invalid or mismatching data.
    is_sample_parted    : out std_logic;  -- a packet with a sample that is skipped: in fragments, or too long
    is_packet_broken    : out std_logic;  -- a packet, or the list of parameters in it
    is_endpoint_other   : out std_logic   -- an announcement of one of the node's topics that differs
  );
end entity firm_rtps_node;

architecture rtl of firm_rtps_node is

  constant FIRST_READER  : positive := 2;  -- 1 is the writer of ros_discovery_info
  constant ENDPOINTS     : positive := READERS+WRITERS;
  constant HAS_FRAGMENTS : boolean  := SAMPLE > RTPS_FRAGMENT_BYTES;

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

  signal take      : std_logic;
  signal is_taken  : std_logic;
  signal has_word  : std_logic;
  signal has_field : std_logic;
  signal address   : std_logic_vector(RECORD_BITS-1 downto 0);
  signal data      : std_logic_vector(7 downto 0);
  signal is_end    : std_logic;
  signal is_mine   : std_logic;
  signal writer    : std_logic_vector(31 downto 0);
  signal is_large  : std_logic;
  signal is_gone   : std_logic;
  signal begins    : std_logic;
  signal is_value  : std_logic;
  signal id        : std_logic_vector(15 downto 0);
  signal size      : std_logic_vector(15 downto 0);
  signal place     : std_logic_vector(15 downto 0);
  signal is_little : std_logic;
  signal is_last   : std_logic;

  signal is_cut          : std_logic;
  signal announced_r     : std_logic_vector(RTPS_JUDGED-1 downto 0);  -- an announcement ended some cycles ago
  signal differs         : std_logic;
  signal is_reader_r     : std_logic;
  signal matches         : std_logic_vector(ENDPOINTS-1 downto 0);
  signal is_known        : std_logic;
  signal is_reliable     : std_logic;
  signal is_transient    : std_logic;
  signal entity_id       : std_logic_vector(31 downto 0);
  signal record_valid    : std_logic;
  signal record_address  : std_logic_vector(RECORD_BITS-1 downto 0);
  signal record_data     : std_logic_vector(7 downto 0);
  signal has_metatraffic : std_logic;
  signal has_default     : std_logic;
  signal has_unicast     : std_logic;
  signal has_lease       : std_logic;

  signal source       : std_logic_vector(5 downto 0);
  signal key_write    : std_logic;
  signal note_write   : std_logic;
  signal number_write : std_logic;
  signal write_place  : std_logic_vector(3 downto 0);
  signal write_data   : std_logic_vector(7 downto 0);
  signal read_place   : std_logic_vector(3 downto 0);
  signal number_byte  : std_logic_vector(7 downto 0);
  signal is_locked    : std_logic;
  signal is_judging   : std_logic;
  signal has_early    : std_logic;
  signal early_source : std_logic_vector(5 downto 0);
  signal early_number : std_logic_vector(31 downto 0);
  signal takes_early  : std_logic;

  signal slot_valid    : std_logic;
  signal slot_writer   : std_logic_vector(2 downto 0);
  signal comes         : std_logic;
  signal comes_long    : std_logic;
  signal is_new_long   : std_logic;
  signal looks         : std_logic;
  signal chooses       : std_logic;
  signal sample_bytes  : unsigned(RTPS_SAMPLE_BITS-1 downto 0);
  signal is_long       : std_logic;
  signal is_last_part  : std_logic;
  signal is_beyond     : std_logic;
  signal has_sample    : std_logic;
  signal sample_writer : std_logic_vector(2 downto 0);  -- of the sample of firm_rtps_history
  signal is_done       : std_logic;
  signal shows         : std_logic;
  signal shows_new     : std_logic;
  signal slot          : std_logic_vector(7 downto 0);
  signal has_payload   : std_logic;
  signal slot_bytes    : std_logic_vector(15 downto 0);

  signal prepare_valid     : std_logic;
  signal chosen_slot_valid : std_logic;
  signal send_valid        : std_logic;
  signal waits             : std_logic;
  signal is_started        : std_logic;

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
      kind          => kind,
      is_submessage => is_submessage,
      is_whole      => is_whole,
      is_faulty     => is_faulty,
      is_foreign    => is_foreign,
      is_aborted    => is_aborted,
      take          => take,
      has_word      => has_word,
      is_end        => is_end,
      is_taken      => is_taken,
      has_field     => has_field,
      address       => address,
      data          => data,
      is_mine       => is_mine,
      writer        => writer,
      is_large      => is_large,
      is_gone       => is_gone,
      begins        => begins,
      is_value      => is_value,
      id            => id,
      size          => size,
      place         => place,
      is_little     => is_little,
      is_last       => is_last,
      is_lost       => is_discovery_lost,
      is_cut        => is_cut
    );

  note_kind : process (clk)
  begin
    if rising_edge(clk) then
      is_reader_r <= '0';
      if writer = RTPS_SUBSCRIPTIONS_WRITER then
        is_reader_r <= '1';
      end if;
    end if;
  end process note_kind;

  is_packet_broken <= is_faulty or is_cut;

  note_announcement : process (clk)
  begin
    if rising_edge(clk) then
      announced_r <= announced_r(RTPS_JUDGED-2 downto 0) & '0';
      if writer = RTPS_PUBLICATIONS_WRITER or writer = RTPS_SUBSCRIPTIONS_WRITER then
        announced_r(0) <= take and has_word and is_end and not is_gone;
      end if;
      if rst_n = '0' then
        announced_r <= (others => '0');
      end if;
    end if;
  end process note_announcement;

  is_endpoint_other <= announced_r(RTPS_JUDGED-1) and differs;

  u_locators : entity firm.firm_rtps_locators
    port map (
      clk             => clk,
      s_valid         => is_taken,
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
      record_valid    => record_valid,
      record_address  => record_address,
      record_data     => record_data,
      has_metatraffic => has_metatraffic,
      has_default     => has_default,
      has_unicast     => has_unicast,
      has_lease       => has_lease
    );

  u_endpoint : entity firm.firm_rtps_endpoint
    generic map (
      READERS => READERS,
      WRITERS => WRITERS
    )
    port map (
      clk           => clk,
      s_valid       => is_taken,
      has_field     => has_field,
      address       => address,
      data          => data,
      begins        => begins,
      is_value      => is_value,
      id            => id,
      size          => size,
      place         => place,
      is_little     => is_little,
      is_last       => is_last,
      is_reader     => is_reader_r,
      are_reliable  => are_reliable,
      are_transient => are_transient,
      names_address => names_address,
      names_data    => names_data,
      matches       => matches,
      differs       => differs,
      is_known      => is_known,
      is_reliable   => is_reliable,
      is_transient  => is_transient,
      entity_id     => entity_id
    );

  u_readers : entity firm.firm_rtps_readers
    generic map (
      READERS   => READERS,
      FIRST     => FIRST_READER,
      SOURCES   => SOURCES,
      BYTES     => BYTES,
      SAMPLES   => SAMPLES,
      ASSEMBLED => ASSEMBLED
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      tick          => tick,
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
      source        => source,
      key_write     => key_write,
      note_write    => note_write,
      number_write  => number_write,
      write_place   => write_place,
      write_data    => write_data,
      read_place    => read_place,
      number_byte   => number_byte,
      is_locked     => is_locked,
      is_judging    => is_judging,
      has_early     => has_early,
      early_source  => early_source,
      early_number  => early_number,
      takes_early   => takes_early,
      m_axis_tdata  => frame_tdata,
      m_axis_tvalid => frame_tvalid,
      m_axis_tlast  => frame_tlast,
      m_axis_tready => frame_tready,
      is_lost       => is_sample_lost,
      is_parted     => is_sample_parted
    );

  u_history : entity firm.firm_rtps_history
    generic map (
      WRITERS => max(1, WRITERS-1),
      SAMPLE  => SAMPLE,
      SLOTS   => SLOTS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => sample_tdata,
      s_axis_tuser  => sample_tuser,
      s_axis_tvalid => sample_tvalid,
      s_axis_tlast  => sample_tlast,
      s_axis_tready => sample_tready,
      slot_valid    => slot_valid,
      slot_writer   => slot_writer,
      slot_next     => write_data,
      comes         => comes,
      is_new_long   => comes_long,
      has_sample    => has_sample,
      writer        => sample_writer,
      is_done       => is_done,
      looks         => looks,
      chooses       => chooses,
      choice        => write_data,
      sample_bytes  => sample_bytes,
      is_long       => is_long,
      is_last_part  => is_last_part,
      is_beyond     => is_beyond,
      shows         => shows,
      shows_new     => shows_new,
      slot          => slot,
      payload_bytes => slot_bytes,
      m_axis_tdata  => payload_tdata,
      m_axis_tready => payload_tready,
      is_refused    => is_frame_refused
    );

  payload_tvalid <= '1';
  payload_bytes  <= gated(slot_bytes, has_payload);

  u_sender : entity firm.firm_rtps_sender
    port map (
      clk               => clk,
      rst_n             => rst_n,
      prepare_valid     => prepare_valid,
      prepare_writer    => slot_writer,
      chosen_slot_valid => chosen_slot_valid,
      send_valid        => send_valid,
      data              => write_data,
      waits             => waits,
      comes             => comes,
      is_new_long       => comes_long,
      writer            => sample_writer,
      is_started        => is_started,
      is_long           => is_new_long,
      shows             => shows,
      shows_new         => shows_new,
      slot              => slot,
      start             => start,
      packet            => packet,
      bank              => bank,
      has_payload       => has_payload,
      is_busy           => is_busy
    );

  u_control : entity firm.firm_rtps_control
    generic map (
      ENDPOINTS     => ENDPOINTS,
      SOURCES       => SOURCES,
      SINKS         => SINKS,
      HAS_FRAGMENTS => HAS_FRAGMENTS
    )
    port map (
      clk                 => clk,
      rst_n               => rst_n,
      tick                => tick,
      program_enable      => program_enable,
      program_address     => program_address,
      program_word        => program_word,
      take                => take,
      has_word            => has_word,
      is_end              => is_end,
      record_valid        => record_valid,
      record_address      => record_address,
      record_data         => record_data,
      is_large            => is_large,
      is_gone             => is_gone,
      has_metatraffic     => has_metatraffic,
      has_default         => has_default,
      has_unicast         => has_unicast,
      has_lease           => has_lease,
      is_known            => is_known,
      is_reliable         => is_reliable,
      is_transient        => is_transient,
      matches             => matches,
      entity_id           => entity_id,
      source              => source,
      key_write           => key_write,
      note_write          => note_write,
      number_write        => number_write,
      write_place         => write_place,
      write_data          => write_data,
      read_place          => read_place,
      number_byte         => number_byte,
      is_locked           => is_locked,
      is_judging          => is_judging,
      has_early           => has_early,
      early_source        => early_source,
      early_number        => early_number,
      takes_early         => takes_early,
      slot_valid          => slot_valid,
      slot_writer         => slot_writer,
      has_sample          => has_sample,
      writer              => sample_writer,
      is_done             => is_done,
      looks               => looks,
      chooses             => chooses,
      sample_bytes        => sample_bytes,
      is_long             => is_long,
      is_last_part        => is_last_part,
      is_beyond           => is_beyond,
      prepare_valid       => prepare_valid,
      chosen_slot_valid   => chosen_slot_valid,
      send_valid          => send_valid,
      waits               => waits,
      is_started          => is_started,
      is_new_long         => is_new_long,
      build_field_valid   => build_field_valid,
      build_field_bank    => build_field_bank,
      build_field_address => build_field_address,
      build_field_data    => build_field_data,
      peer_count          => peer_count,
      source_count        => source_count,
      sink_count          => sink_count,
      is_peer_refused     => is_peer_refused,
      is_endpoint_refused => is_endpoint_refused
    );

end architecture rtl;
