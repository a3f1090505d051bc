-- SPDX-License-Identifier: Apache-2.0
-- The control of a node in fabric that publishes one topic, best effort: announces the node (SPDP), notes the peers
-- that it hears of, tells each of them the node's endpoints when it asks (SEDP), and sends each sample to all of them.
--
-- What a packet causes waits until the packet is known to be good. Leases of peers are not watched yet: a peer is
-- forgotten when it says farewell.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_rtps_pkg.all;

entity firm_rtps_control is
  generic (
    PEERS   : integer := 8;   -- 1 to 8
    WRITERS : integer := 2;   -- of the node: the first one is that of ros_discovery_info, the second one sends samples
    READERS : integer := 0;   -- of the node
    SAMPLE  : integer := 64;  -- bytes of the longest payload, a power of two
    DEPTH   : integer := 1024 -- words of waiting packets, a power of two
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

    -- The prefix of the node, and the entity of the writer that sends samples; the first byte on the line highest.
    prefix        : in std_logic_vector(95 downto 0);
    sample_writer : in std_logic_vector(31 downto 0);

    -- From firm_rtps_walker.
    field_valid   : in std_logic;
    field_address : in std_logic_vector(RECORD_BITS-1 downto 0);
    field_data    : in std_logic_vector(7 downto 0);
    payload_valid : in std_logic;
    payload_data  : in std_logic_vector(7 downto 0);
    is_submessage : in std_logic;
    is_whole      : in std_logic;
    is_faulty     : in std_logic;
    is_foreign    : in std_logic;
    is_aborted    : in std_logic;

    -- Samples, with the header of their encoding.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- To firm_packet_builder. `packet` is a number of fusesoc_firm.fabric.packets.
    start               : out std_logic;
    packet              : out std_logic_vector(7 downto 0);
    payload_bytes       : out std_logic_vector(15 downto 0);
    is_busy             : in  std_logic;
    build_field_valid   : out std_logic;
    build_field_address : out std_logic_vector(6 downto 0);
    build_field_data    : out std_logic_vector(7 downto 0);
    m_axis_tdata        : out std_logic_vector(7 downto 0);
    m_axis_tvalid       : out std_logic;
    m_axis_tready       : in  std_logic;

    peers_known : out std_logic_vector(7 downto 0);
    is_full     : out std_logic;  -- a pulse for each announcement of a peer without room
    is_lost     : out std_logic   -- a pulse for each packet without room
  );
end entity firm_rtps_control;

architecture rtl of firm_rtps_control is

  -- Numbers of packets.
  constant ANNOUNCE_TO_GROUP : natural := 0;
  constant ANNOUNCE          : natural := 1;
  constant LEAVE_GROUP       : natural := 2;
  constant FIRST_WRITER      : natural := 4;
  constant WRITERS_TOLD      : natural := 4 + WRITERS;
  constant FIRST_READER      : natural := 5 + WRITERS;
  constant READERS_TOLD      : natural := 5 + WRITERS + READERS;
  constant GRAPH             : natural := 6 + WRITERS + READERS;
  constant PLAIN_SAMPLE      : natural := 7 + WRITERS + READERS;
  constant HEARTBEAT         : natural := 11 + WRITERS + READERS;

  constant PARTICIPANT_WRITER   : std_logic_vector(31 downto 0) := x"000100c2";
  constant PUBLICATIONS_WRITER  : std_logic_vector(31 downto 0) := x"000003c2";
  constant SUBSCRIPTIONS_WRITER : std_logic_vector(31 downto 0) := x"000004c2";
  constant GRAPH_WRITER         : std_logic_vector(31 downto 0) := x"00000103";

  -- Milliseconds.
  constant AFTER_FAREWELL : natural := 200;
  constant SOON           : natural := 100;
  constant LATER          : natural := 3000;
  constant FIRST_ONES     : natural := 5;

  -- A word of a packet: whether it is the submessage's last one, an address of the record, and a byte.
  constant AT_PAYLOAD : natural := 255;
  constant AT_NOTHING : natural := 254;

  -- A peer's entry, and the same in the record, from RECORD_SOURCE_MAC on.
  constant ENTRY_BITS      : positive := 5;
  constant AT_GRAPH_PORT   : natural := 6;  -- of the reader of ros_discovery_info
  constant AT_ADDRESS      : natural  := 8;   -- for discovery
  constant AT_PORT         : natural  := 12;
  constant AT_USER_PORT    : natural := 14;
  constant AT_PREFIX       : natural  := 16;
  constant AT_USER_ADDRESS : natural := 28;
  -- Bytes of the entry that become fields of the builder, at the same addresses; addresses of its other fields.
  constant ENTRY_FIELDS : natural := 28;
  constant AT_READER    : natural := 28;
  constant AT_WRITER    : natural := 32;
  constant AT_COUNT     : natural := 36;
  constant AT_NUMBER    : natural := 44;
  constant AT_FIRST     : natural := 52;
  constant AT_LAST      : natural := 60;
  constant FIELDS       : natural := 64;

  constant METATRAFFIC_LOCATOR : std_logic_vector(15 downto 0) := x"0032";
  constant DEFAULT_LOCATOR     : std_logic_vector(15 downto 0) := x"0031";
  constant ENDPOINT_LOCATOR    : std_logic_vector(15 downto 0) := x"002f";
  constant TOPIC_NAME          : std_logic_vector(15 downto 0) := x"0005";
  -- "ros_discovery_info", with its NUL.
  constant GRAPH_TOPIC         : std_logic_vector(0 to 151) := x"726f735f646973636f766572795f696e666f00";
  constant GRAPH_TOPIC_BYTES   : positive := 19;
  constant NAME_PLACE          : natural := 8;  -- in the parameter, whose header and length have four bytes each
  constant LOCATOR_BYTES       : natural := 24;
  constant SENTINEL            : std_logic_vector(15 downto 0) := x"0001";

  subtype byte_t is std_logic_vector(7 downto 0);
  type memory_t is array (natural range <>) of byte_t;

  signal record_memory : memory_t(0 to 2**RECORD_BITS-1);
  signal peer_memory   : memory_t(0 to 8*2**ENTRY_BITS-1);
  signal sample_memory : memory_t(0 to SAMPLE-1);

  -- ------------------------------------------------------------------ words
  signal writer_r    : std_logic_vector(31 downto 0) := (others => '0');
  signal listens     : std_logic;  -- its payloads are read
  signal word        : std_logic_vector(16 downto 0);
  signal word_valid  : std_logic;
  signal ends_packet : std_logic;
  signal spoils      : std_logic_vector(0 downto 0);
  signal taken       : std_logic_vector(16 downto 0);
  signal taken_valid : std_logic;
  signal take        : std_logic;
  signal takes       : std_logic;
  signal at          : unsigned(7 downto 0);
  signal value       : byte_t;

  -- ------------------------------------------------------------------ the submessage
  signal mine_r        : std_logic;
  signal kind_r        : byte_t := (others => '0');
  signal flags_r       : byte_t := (others => '0');
  signal from_r        : std_logic_vector(31 downto 0) := (others => '0');  -- its writer
  signal base_r        : unsigned(7 downto 0) := (others => '0');
  signal large_r       : std_logic;  -- the number is above 255
  signal is_ours_r     : std_logic;  -- the destination so far
  signal is_all_r      : std_logic;
  signal own_r         : std_logic_vector(95 downto 0) := (others => '0');  -- the prefix, turned
  signal gone_r        : std_logic;  -- the status says that the instance ended

  -- ------------------------------------------------------------------ parameters of a participant
  signal place_r       : unsigned(15 downto 0) := (others => '0');  -- in the parameter, its header included
  signal size_r        : unsigned(15 downto 0) := (others => '0');  -- of its value
  signal id_r          : std_logic_vector(15 downto 0) := (others => '0');
  signal lead_r        : unsigned(2 downto 0) := (others => '0');   -- bytes of the encoding's header so far
  signal little_r      : std_logic;
  signal over_r        : std_logic;
  signal udp_r         : std_logic;  -- the locator is one for UDP over IPv4, so far
  signal has_meta_r    : std_logic;
  signal has_user_r    : std_logic;
  signal has_end_r     : std_logic;
  signal is_graph_r    : std_logic;  -- the topic is that of the graph
  signal named_r       : std_logic;  -- the same, so far
  signal is_end        : std_logic;
  signal is_meta       : std_logic;
  signal is_user       : std_logic;

  -- ------------------------------------------------------------------ what is done
  type state_t is (TAKING, DECIDE, FIND, INSERT, CHOOSE, LOAD, BEGIN_PACKET, WAIT_PACKET);
  type job_t is (NOTHING, GREETING, GRAPH_PORT, ENDPOINTS, GRAPH_JOB, SAMPLES, TO_GROUP);
  signal state_r   : state_t;
  signal job_r     : job_t;
  signal removes_r : std_logic;
  signal slot_r    : unsigned(2 downto 0) := (others => '0');
  signal index_r   : unsigned(5 downto 0) := (others => '0');
  signal second_r  : std_logic;  -- the memories show what index_r selects
  signal packet_r  : unsigned(7 downto 0) := (others => '0');
  signal stop_r    : unsigned(7 downto 0) := (others => '0');
  signal used_r    : std_logic_vector(7 downto 0);
  signal count_r   : unsigned(15 downto 0) := (others => '0');
  signal slot      : std_logic_vector(7 downto 0);
  signal is_used   : std_logic;  -- the entry of slot_r
  signal full      : std_logic;
  signal free      : unsigned(2 downto 0);

  signal record_address : unsigned(RECORD_BITS-1 downto 0);
  signal record_r       : byte_t := (others => '0');
  signal record_write   : std_logic;
  signal write_address  : unsigned(RECORD_BITS-1 downto 0);
  signal peer_place     : unsigned(ENTRY_BITS-1 downto 0);
  signal peer_address   : unsigned(ENTRY_BITS+2 downto 0);
  signal peer_write     : std_logic;
  signal sample_write   : std_logic;
  signal peer_r         : byte_t := (others => '0');

  -- ------------------------------------------------------------------ time, samples
  signal wait_r           : natural range 0 to LATER;
  signal ones_r           : natural range 0 to FIRST_ONES;
  signal due_r            : std_logic;
  signal leave_r          : std_logic;
  signal size_of_sample_r : unsigned(7 downto 0) := (others => '0');
  signal has_sample_r     : std_logic;
  signal read_r           : unsigned(7 downto 0) := (others => '0');
  signal number_r         : unsigned(31 downto 0) := (others => '0');

  function byte_of(number : std_logic_vector(31 downto 0); place : unsigned(1 downto 0)) return byte_t is
  begin
    if place = 0 then
      return number(31 downto 24);
    elsif place = 1 then
      return number(23 downto 16);
    elsif place = 2 then
      return number(15 downto 8);
    end if;
    return number(7 downto 0);
  end function byte_of;

  -- Whether a byte is that of the topic's name at this place of the parameter; after the name, any byte is.
  function is_character(char : byte_t; place : unsigned(15 downto 0)) return boolean is
    variable wanted : byte_t := char;
  begin
    for index in 0 to GRAPH_TOPIC_BYTES-1 loop
      if place = NAME_PLACE+index then
        wanted := GRAPH_TOPIC(8*index to 8*index+7);
      end if;
    end loop;
    return char = wanted;
  end function is_character;

  function reversed(number : std_logic_vector(31 downto 0)) return std_logic_vector is
  begin
    return number(7 downto 0) & number(15 downto 8) & number(23 downto 16) & number(31 downto 24);
  end function reversed;

begin

  assert PEERS >= 1 and PEERS <= 8
    report "firm_rtps_control: PEERS is " & integer'image(PEERS) & "; legal: 1 to 8"
    severity failure;

  -- ------------------------------------------------------------------ words of packets

  note_writer : process (clk)
  begin
    if rising_edge(clk) then
      if field_valid = '1' and unsigned(field_address) >= RECORD_WRITER
         and unsigned(field_address) < RECORD_WRITER+4 then
        writer_r <= writer_r(23 downto 0) & field_data;
      end if;
    end if;
  end process note_writer;

  listens <= '1' when writer_r = PARTICIPANT_WRITER or writer_r = SUBSCRIPTIONS_WRITER else '0';

  word(16)          <= is_submessage;
  word(15 downto 8) <= field_address when field_valid = '1' else
                       std_logic_vector(to_unsigned(AT_PAYLOAD, 8))
                       when payload_valid = '1' and listens = '1' else
                       std_logic_vector(to_unsigned(AT_NOTHING, 8));
  word(7 downto 0)  <= field_data when field_valid = '1' else payload_data;
  ends_packet       <= is_whole or is_faulty or is_foreign or is_aborted;
  spoils(0)         <= is_foreign or is_aborted;
  word_valid        <= '1' when field_valid = '1' or is_submessage = '1' or ends_packet = '1' else
                       payload_valid when listens = '1' else
                       '0';

  u_store : entity firm.firm_mac_store
    generic map (
      DEPTH     => DEPTH,
      DATA_BITS => 17
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => word,
      s_axis_tuser  => spoils,
      s_axis_tvalid => word_valid,
      s_axis_tlast  => ends_packet,
      m_axis_tdata  => taken,
      m_axis_tvalid => taken_valid,
      m_axis_tlast  => open,
      m_axis_tready => take,
      is_lost       => is_lost
    );

  take  <= '1' when state_r = TAKING and due_r = '0' and leave_r = '0' else '0';
  takes <= take and taken_valid;
  at    <= unsigned(taken(15 downto 8));
  value <= taken(7 downto 0);

  note_submessage : process (clk)
  begin
    if rising_edge(clk) then
      if takes = '1' then
        if at = RECORD_SOURCE_MAC then
          mine_r <= '1';
        elsif at = RECORD_KIND then
          kind_r     <= value;
          large_r    <= '0';
          gone_r     <= '0';
        elsif at = RECORD_FLAGS then
          flags_r <= value;
        elsif at >= RECORD_WRITER and at < RECORD_WRITER+4 then
          from_r <= from_r(23 downto 0) & value;
        elsif at = RECORD_NUMBER then
          base_r <= unsigned(value);
        elsif at > RECORD_NUMBER and at < RECORD_NUMBER+8 then
          if value /= x"00" then
            large_r <= '1';
          end if;
        elsif at = RECORD_STATUS+3 then
          gone_r <= value(0) or value(1);
        elsif at >= RECORD_DESTINATION and at < RECORD_DESTINATION+12 then
          own_r <= own_r(87 downto 0) & own_r(95 downto 88);
          if at = RECORD_DESTINATION then
            is_ours_r <= '1';
            is_all_r  <= '1';
          end if;
          if value /= own_r(95 downto 88) then
            is_ours_r <= '0';
          end if;
          if value /= x"00" then
            is_all_r <= '0';
          end if;
        end if;
        if at = RECORD_KIND then
          own_r <= prefix;
        end if;
      elsif state_r = DECIDE and kind_r = RTPS_INFO_DESTINATION then
        mine_r <= is_ours_r or is_all_r;
      end if;
    end if;
  end process note_submessage;

  -- ------------------------------------------------------------------ where a participant listens

  is_meta <= '1' when id_r = METATRAFFIC_LOCATOR and size_r = LOCATOR_BYTES and has_meta_r = '0' else '0';
  is_end  <= '1' when id_r = ENDPOINT_LOCATOR and size_r = LOCATOR_BYTES and has_end_r = '0' else '0';
  is_user <= '1' when id_r = DEFAULT_LOCATOR and size_r = LOCATOR_BYTES and has_user_r = '0' else '0';

  read_parameters : process (clk)
    variable expected : byte_t;
    variable last     : boolean;
  begin
    if rising_edge(clk) then
      if takes = '1' and at = RECORD_KIND then
        lead_r     <= (others => '0');
        place_r    <= (others => '0');
        over_r     <= '0';
        has_meta_r <= '0';
        has_user_r <= '0';
        has_end_r  <= '0';
        is_graph_r <= '0';
      elsif takes = '1' and at = AT_PAYLOAD and over_r = '0' then
        if lead_r /= 4 then
          lead_r <= lead_r + 1;
          if lead_r = 1 then
            little_r <= value(0);
          end if;
        else
          place_r <= place_r + 1;
          if place_r = 0 or place_r = 1 then
            id_r <= id_r(7 downto 0) & value;
            if little_r = '1' then
              id_r <= value & id_r(15 downto 8);
            end if;
          elsif place_r = 2 or place_r = 3 then
            size_r <= size_r(7 downto 0) & unsigned(value);
            if little_r = '1' then
              size_r <= unsigned(value) & size_r(15 downto 8);
            end if;
            udp_r   <= '1';
            named_r <= '1';
            if place_r = 3 and id_r = SENTINEL then
              over_r <= '1';
            end if;
            if place_r = 3 and ((little_r = '1' and value = x"00" and size_r(15 downto 8) = 0)
                                or (little_r = '0' and value = x"00" and size_r(7 downto 0) = 0)) then
              place_r <= (others => '0');
            end if;
          else
            expected := x"00";
            if (place_r = 4 and little_r = '1') or (place_r = 7 and little_r = '0') then
              expected := x"01";
            end if;
            if place_r < 8 and value /= expected then
              udp_r <= '0';
            end if;
            if id_r /= TOPIC_NAME or (place_r >= NAME_PLACE and not is_character(value, place_r)) then
              named_r <= '0';
            end if;
            if place_r = size_r + 3 then
              if named_r = '1' and size_r >= GRAPH_TOPIC_BYTES+4 then
                is_graph_r <= '1';
              end if;
              has_end_r  <= has_end_r or (is_end and udp_r);
              place_r    <= (others => '0');
              has_meta_r <= has_meta_r or (is_meta and udp_r);
              has_user_r <= has_user_r or (is_user and udp_r);
            end if;
          end if;
        end if;
      end if;
    end if;
  end process read_parameters;

  -- Fields of the record, and ports and addresses of locators.
  place_words : process (takes, at, place_r, little_r, udp_r, is_meta, is_user, is_end, over_r, lead_r)
    variable port_place : natural range 0 to 31;
    variable ip_place   : natural range 0 to 31;
    variable offset     : natural range 0 to 31;
    variable found      : std_logic;
  begin
    port_place := AT_PORT;
    ip_place   := AT_ADDRESS;
    if is_user = '1' then
      port_place := AT_USER_PORT;
      ip_place   := AT_USER_ADDRESS;
    elsif is_end = '1' then
      port_place := AT_GRAPH_PORT;
    end if;
    offset := 0;
    found  := '0';
    if place_r >= 24 and place_r < 28 then
      found  := not is_end;
      offset := ip_place + to_integer(place_r(1 downto 0));
    elsif place_r >= 8 and place_r < 12 then
      -- Of four bytes, the port is in the lower two.
      found := little_r xor place_r(1);
      if (place_r(0) = '0') = (little_r = '0') then
        offset := port_place;
      else
        offset := port_place + 1;
      end if;
    end if;
    if at = AT_PAYLOAD then
      record_write  <= takes and found and udp_r and (is_meta or is_user or is_end) and not over_r;
      write_address <= to_unsigned(RECORD_SOURCE_MAC, RECORD_BITS) + offset;
      if lead_r /= 4 then
        record_write <= '0';
      end if;
    else
      record_write  <= takes;
      write_address <= at;
    end if;
  end process place_words;

  -- ------------------------------------------------------------------ memories

  choose_places : process (state_r, index_r, job_r, has_user_r)
  begin
    record_address <= resize(index_r, RECORD_BITS) - AT_READER;
    peer_place     <= index_r(ENTRY_BITS-1 downto 0);
    if state_r = FIND then
      record_address <= to_unsigned(RECORD_SOURCE, RECORD_BITS) + index_r;
      peer_place     <= to_unsigned(AT_PREFIX, ENTRY_BITS) + index_r(3 downto 0);
    elsif state_r = INSERT then
      record_address <= to_unsigned(RECORD_SOURCE_MAC, RECORD_BITS) + index_r;
      if job_r = GREETING and (index_r = AT_GRAPH_PORT or index_r = AT_GRAPH_PORT+1) then
        -- The same as that of other readers, if the peer does not tell it.
        record_address <= to_unsigned(RECORD_SOURCE_MAC+AT_USER_PORT-AT_GRAPH_PORT, RECORD_BITS) + index_r;
        if has_user_r = '0' then
          record_address <= to_unsigned(RECORD_SOURCE_MAC+AT_PORT-AT_GRAPH_PORT, RECORD_BITS) + index_r;
        end if;
      elsif has_user_r = '0' and (index_r = AT_USER_PORT or index_r = AT_USER_PORT+1) then
        record_address <= to_unsigned(RECORD_SOURCE_MAC-2, RECORD_BITS) + index_r;
      elsif has_user_r = '0' and index_r >= AT_USER_ADDRESS then
        record_address <= to_unsigned(RECORD_SOURCE_MAC-AT_USER_ADDRESS+AT_ADDRESS, RECORD_BITS) + index_r;
      end if;
    elsif job_r = SAMPLES or job_r = GRAPH_JOB then
      if index_r >= AT_ADDRESS and index_r < AT_PORT then
        peer_place <= index_r(ENTRY_BITS-1 downto 0) + (AT_USER_ADDRESS-AT_ADDRESS);
      elsif index_r >= AT_PORT and index_r < AT_USER_PORT then
        peer_place <= index_r(ENTRY_BITS-1 downto 0) + (AT_USER_PORT-AT_PORT);
        if job_r = GRAPH_JOB then
          peer_place <= index_r(ENTRY_BITS-1 downto 0) - (AT_PORT-AT_GRAPH_PORT);
        end if;
      end if;
    end if;
  end process choose_places;

  access_record : process (clk)
  begin
    if rising_edge(clk) then
      record_r <= record_memory(to_integer(record_address));
      if record_write = '1' then
        record_memory(to_integer(write_address)) <= value;
      end if;
    end if;
  end process access_record;

  peer_address <= slot_r & peer_place;
  peer_write   <= second_r when state_r = INSERT else '0';

  access_peers : process (clk)
  begin
    if rising_edge(clk) then
      peer_r <= peer_memory(to_integer(peer_address));
      if peer_write = '1' then
        peer_memory(to_integer(peer_address)) <= record_r;
      end if;
    end if;
  end process access_peers;

  sample_write <= s_axis_tvalid and not has_sample_r;

  write_sample : process (clk)
  begin
    if rising_edge(clk) then
      if sample_write = '1' then
        sample_memory(to_integer(size_of_sample_r(clog2(SAMPLE)-1 downto 0))) <= s_axis_tdata;
      end if;
    end if;
  end process write_sample;

  -- ------------------------------------------------------------------ the order of things

  slot    <= decode(std_logic_vector(slot_r), '1', 8);
  is_used <= '0' when (used_r and slot) = x"00" else '1';

  find_room : process (used_r)
  begin
    free <= (others => '0');
    full <= '1';
    for number in used_r'range loop
      if used_r(number) = '0' and number < PEERS then
        free <= to_unsigned(number, 3);
        full <= '0';
      end if;
    end loop;
  end process find_room;

  act : process (clk)

    procedure find_peer(job : job_t; first, last : natural) is
    begin
      state_r  <= FIND;
      job_r    <= job;
      packet_r <= to_unsigned(first, 8);
      stop_r   <= to_unsigned(last, 8);
      slot_r   <= (others => '0');
    end procedure find_peer;

    procedure decide_submessage is
    begin
      removes_r <= gone_r;
      if mine_r = '0' then
        null;
      elsif kind_r = RTPS_DATA and from_r = PARTICIPANT_WRITER then
        if gone_r = '1' or has_meta_r = '1' then
          find_peer(GREETING, ANNOUNCE, READERS_TOLD);
        end if;
      elsif kind_r = RTPS_DATA and from_r = SUBSCRIPTIONS_WRITER then
        removes_r <= '0';
        if gone_r = '0' and is_graph_r = '1' and has_end_r = '1' then
          find_peer(GRAPH_PORT, GRAPH, GRAPH);
        end if;
      elsif kind_r = RTPS_ACKNACK and large_r = '0' then
        removes_r <= '0';
        if from_r = PUBLICATIONS_WRITER and (base_r <= WRITERS or flags_r(RTPS_FINAL) = '0') then
          find_peer(ENDPOINTS, FIRST_WRITER, WRITERS_TOLD);
        elsif from_r = SUBSCRIPTIONS_WRITER and (base_r <= READERS or flags_r(RTPS_FINAL) = '0') then
          find_peer(ENDPOINTS, FIRST_READER, READERS_TOLD);
        elsif from_r = GRAPH_WRITER and base_r <= 1 then
          find_peer(GRAPH_JOB, HEARTBEAT, GRAPH);
        end if;
      end if;
    end procedure decide_submessage;

    -- The entry at slot_r is not the peer's.
    procedure pass_by is
    begin
      index_r  <= (others => '0');
      second_r <= '0';
      slot_r   <= slot_r + 1;
      if slot_r = PEERS-1 then
        state_r <= TAKING;
        if job_r = GREETING and removes_r = '0' then
          if full = '0' then
            state_r <= INSERT;
            slot_r  <= free;
          else
            is_full <= '1';
          end if;
        end if;
      end if;
    end procedure pass_by;

    procedure next_packet is
    begin
      state_r <= LOAD;
      if packet_r = stop_r then
        state_r <= TAKING;
        if job_r = SAMPLES and slot_r /= PEERS-1 then
          state_r <= CHOOSE;
          slot_r  <= slot_r + 1;
        end if;
      elsif job_r = GREETING then
        if packet_r = ANNOUNCE then
          packet_r <= to_unsigned(WRITERS_TOLD, 8);
        else
          packet_r <= to_unsigned(READERS_TOLD, 8);
        end if;
      elsif job_r = GRAPH_JOB then
        packet_r <= to_unsigned(GRAPH, 8);
      else
        packet_r <= packet_r + 1;
      end if;
    end procedure next_packet;

  begin
    if rising_edge(clk) then
      is_full  <= '0';
      second_r <= not second_r;
      if state_r = TAKING then
        job_r    <= NOTHING;
        index_r  <= (others => '0');
        second_r <= '0';
        slot_r   <= (others => '0');
        if leave_r = '1' or due_r = '1' then
          job_r    <= TO_GROUP;
          state_r  <= BEGIN_PACKET;
          packet_r <= to_unsigned(ANNOUNCE_TO_GROUP, 8);
          stop_r   <= to_unsigned(ANNOUNCE_TO_GROUP, 8);
          if leave_r = '1' then
            packet_r <= to_unsigned(LEAVE_GROUP, 8);
            stop_r   <= to_unsigned(LEAVE_GROUP, 8);
          end if;
        elsif takes = '1' then
          if taken(16) = '1' then
            state_r <= DECIDE;
          end if;
        elsif has_sample_r = '1' and job_r /= SAMPLES then
          job_r    <= SAMPLES;
          state_r  <= CHOOSE;
          packet_r <= to_unsigned(PLAIN_SAMPLE, 8);
          stop_r   <= to_unsigned(PLAIN_SAMPLE, 8);
        end if;
      elsif state_r = DECIDE then
        state_r  <= TAKING;
        second_r <= '0';
        decide_submessage;
      elsif state_r = FIND then
        if is_used = '0' then
          pass_by;
        elsif second_r = '1' then
          index_r <= index_r + 1;
          if record_r /= peer_r then
            pass_by;
          elsif index_r = 11 then
            index_r <= (others => '0');
            state_r <= LOAD;
            if job_r = GRAPH_PORT then
              state_r <= INSERT;
              index_r <= to_unsigned(AT_GRAPH_PORT, 6);
            elsif job_r = GREETING then
              state_r <= TAKING;
              if removes_r = '1' then
                used_r <= used_r and not slot;
              end if;
            end if;
          end if;
        end if;
      elsif state_r = INSERT then
        if second_r = '1' then
          index_r <= index_r + 1;
          if job_r = GRAPH_PORT and index_r = AT_GRAPH_PORT+1 then
            state_r <= TAKING;
          elsif index_r = 2**ENTRY_BITS-1 then
            used_r  <= used_r or slot;
            index_r <= (others => '0');
            state_r <= LOAD;
          end if;
        end if;
      elsif state_r = CHOOSE then
        second_r <= '0';
        if is_used = '1' then
          state_r <= LOAD;
        elsif slot_r = PEERS-1 then
          state_r <= TAKING;
        else
          slot_r <= slot_r + 1;
        end if;
      elsif state_r = LOAD then
        if second_r = '1' then
          index_r <= index_r + 1;
          if index_r = FIELDS-1 then
            state_r <= BEGIN_PACKET;
          end if;
        end if;
      elsif state_r = BEGIN_PACKET then
        count_r <= count_r + 1;
        state_r <= WAIT_PACKET;
      elsif state_r = WAIT_PACKET then
        second_r <= '0';
        if is_busy = '0' then
          next_packet;
        end if;
      end if;
      if rst_n = '0' then
        state_r  <= TAKING;
        used_r   <= (others => '0');
        is_full  <= '0';
        second_r <= '0';
      end if;
    end if;
  end process act;

  start       <= '1' when state_r = BEGIN_PACKET else '0';
  packet      <= std_logic_vector(packet_r);
  peers_known <= used_r;

  -- ------------------------------------------------------------------ fields of packets

  build_field_valid   <= second_r when state_r = LOAD else '0';
  build_field_address <= std_logic_vector(resize(index_r, 7));

  choose_field : process (index_r, job_r, peer_r, record_r, sample_writer, count_r, number_r)
    variable writer : std_logic_vector(31 downto 0);
    variable shown  : std_logic_vector(31 downto 0);
  begin
    writer := GRAPH_WRITER;
    if job_r = SAMPLES then
      writer := sample_writer;
    end if;
    shown := (others => '0');
    if index_r >= AT_WRITER and index_r < AT_WRITER+4 then
      shown := writer;
    elsif index_r >= AT_COUNT and index_r < AT_COUNT+4 then
      shown := reversed(x"0000" & std_logic_vector(count_r));
    elsif index_r >= AT_NUMBER and index_r < AT_NUMBER+4 then
      shown := reversed(std_logic_vector(number_r));
    elsif (index_r >= AT_FIRST and index_r < AT_FIRST+4) or index_r >= AT_LAST then
      shown := x"01000000";
    end if;
    build_field_data <= byte_of(shown, index_r(1 downto 0));
    if index_r < ENTRY_FIELDS then
      build_field_data <= peer_r;
    elsif index_r < AT_READER+4 then
      build_field_data <= (others => '0');
      if job_r = GRAPH_JOB then
        build_field_data <= record_r;
      end if;
    end if;
  end process choose_field;

  -- ------------------------------------------------------------------ time

  keep_time : process (clk)
  begin
    if rising_edge(clk) then
      if state_r = BEGIN_PACKET and job_r = TO_GROUP then
        due_r   <= '0';
        leave_r <= '0';
      end if;
      if tick = '1' then
        if wait_r /= 0 then
          wait_r <= wait_r - 1;
        else
          due_r  <= '1';
          wait_r <= LATER-1;
          if ones_r /= 0 then
            ones_r <= ones_r - 1;
            wait_r <= SOON-1;
          end if;
        end if;
      end if;
      if rst_n = '0' then
        due_r   <= '0';
        leave_r <= '1';
        wait_r  <= AFTER_FAREWELL;
        ones_r  <= FIRST_ONES-1;
      end if;
    end if;
  end process keep_time;

  -- ------------------------------------------------------------------ samples

  s_axis_tready <= not has_sample_r;
  payload_bytes <= std_logic_vector(resize(size_of_sample_r, 16)) when job_r = SAMPLES else (others => '0');
  m_axis_tdata  <= sample_memory(to_integer(read_r(clog2(SAMPLE)-1 downto 0)));
  m_axis_tvalid <= '1';

  keep_sample : process (clk)
  begin
    if rising_edge(clk) then
      if s_axis_tvalid = '1' and has_sample_r = '0' then
        size_of_sample_r <= size_of_sample_r + 1;
        if s_axis_tlast = '1' then
          has_sample_r <= '1';
          number_r     <= number_r + 1;
        end if;
      end if;
      if state_r = BEGIN_PACKET then
        read_r <= (others => '0');
      elsif m_axis_tready = '1' then
        read_r <= read_r + 1;
      end if;
      if job_r = SAMPLES and state_r = TAKING then
        has_sample_r     <= '0';
        size_of_sample_r <= (others => '0');
      end if;
      if rst_n = '0' then
        has_sample_r     <= '0';
        size_of_sample_r <= (others => '0');
        number_r         <= (others => '0');
      end if;
    end if;
  end process keep_sample;

end architecture rtl;
