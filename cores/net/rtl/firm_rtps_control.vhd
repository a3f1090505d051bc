-- SPDX-License-Identifier: Apache-2.0
-- The control of a node in fabric: announces the node (SPDP), notes the peers that it hears of, tells each of them the
-- node's endpoints when it asks (SEDP), and asks for theirs. It sends the samples of one topic, best effort, to all.
--
-- What peers announce is taken in its order, so that a number for each of their writers is all that is noted. Leases of
-- peers are not watched yet: a peer is forgotten when it says farewell.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_rtps_pkg.all;

entity firm_rtps_control is
  generic (
    PEERS   : integer := 8; -- 1 to 8
    -- Of the node, 2 to 234: the first one is that of ros_discovery_info, the second one sends samples. With more, the
    -- numbers of packets have no room.
    WRITERS : integer := 2;
    READERS : integer := 0; -- of the node, 0 to 8
    SAMPLE  : integer := 64 -- bytes of the longest payload, a power of two, 2 to 128
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

    -- The entity of the writer that sends samples; the first byte on the line highest.
    sample_writer : in std_logic_vector(31 downto 0);

    -- Of firm_rtps_inbox.
    take        : out std_logic;
    has_word    : in  std_logic;
    has_field   : in  std_logic;
    address     : in  std_logic_vector(RECORD_BITS-1 downto 0);
    data        : in  std_logic_vector(7 downto 0);
    is_end      : in  std_logic;
    kind        : in  std_logic_vector(7 downto 0);
    flags       : in  std_logic_vector(7 downto 0);
    writer      : in  std_logic_vector(31 downto 0);
    number      : in  std_logic_vector(31 downto 0);
    second      : in  std_logic_vector(31 downto 0);
    is_large    : in  std_logic;
    is_gone     : in  std_logic;
    begins      : in  std_logic;
    is_value    : in  std_logic;
    id          : in  std_logic_vector(15 downto 0);
    size        : in  std_logic_vector(15 downto 0);
    place       : in  std_logic_vector(15 downto 0);
    is_little   : in  std_logic;
    is_last     : in  std_logic;

    -- To firm_rtps_readers: a peer announced or ended a writer; a peer is forgotten. No word is taken while it is busy.
    is_announced : out std_logic;
    is_left      : out std_logic;
    peer         : out std_logic_vector(2 downto 0);
    readers_busy : in  std_logic;

    -- Samples, with the header of their encoding.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;
    is_long       : out std_logic;  -- a pulse for each sample of more than SAMPLE bytes, which is dropped

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
    is_full     : out std_logic   -- a pulse for each announcement of a peer without room
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
  constant ACKNOWLEDGE       : natural := 12 + WRITERS + READERS;
  constant REQUEST           : natural := 13 + WRITERS + READERS;

  -- The last byte of the entities of discovery's readers.
  constant DISCOVERY_READER : std_logic_vector(7 downto 0) := x"c7";
  constant GRAPH_WRITER     : std_logic_vector(31 downto 0) := x"00000103";

  -- Milliseconds.
  constant AFTER_FAREWELL : natural := 200;
  constant SOON           : natural := 100;
  constant LATER          : natural := 3000;
  constant FIRST_ONES     : natural := 5;

  -- A peer's entry, and the same in the record, from RECORD_SOURCE_MAC on.
  constant ENTRY_BITS      : positive := 5;
  constant AT_GRAPH_PORT   : natural  := 6;   -- of the reader of ros_discovery_info
  constant AT_ADDRESS      : natural  := 8;   -- for discovery
  constant AT_PORT         : natural  := 12;
  constant AT_USER_PORT    : natural  := 14;
  constant AT_PREFIX       : natural  := 16;
  constant AT_USER_ADDRESS : natural  := 28;
  -- Bytes of the entry that become fields of the builder, at the same addresses; addresses of its other fields.
  constant ENTRY_FIELDS : natural := 28;
  constant AT_READER    : natural := 28;
  constant AT_WRITER    : natural := 32;
  constant AT_COUNT     : natural := 36;
  constant AT_NUMBER    : natural := 44;
  constant AT_FIRST     : natural := 52;
  constant AT_LAST      : natural := 60;
  constant AT_SET_SIZE  : natural := 64;
  constant AT_SET       : natural := 68;
  constant FIELDS       : natural := 72;
  constant AT_FLAGS     : natural := 6;
  -- Of a request: little-endian and final.
  constant REQUEST_FLAGS  : std_logic_vector(7 downto 0) := x"03";
  constant MOST_REQUESTED : positive := 32;

  -- "ros_discovery_info", with its NUL.
  constant GRAPH_TOPIC       : std_logic_vector(0 to 151) := x"726f735f646973636f766572795f696e666f00";
  constant GRAPH_TOPIC_BYTES : positive := 19;
  constant NAME_PLACE        : natural  := 4;  -- in the value, after the length
  constant LOCATOR_BYTES     : natural  := 24;

  subtype byte_t is std_logic_vector(7 downto 0);
  type memory_t is array (natural range <>) of byte_t;

  signal record_memory : memory_t(0 to 2**RECORD_BITS-1);
  signal peer_memory   : memory_t(0 to 8*2**ENTRY_BITS-1);
  signal sample_memory : memory_t(0 to SAMPLE-1);

  signal takes : std_logic;
  signal at    : unsigned(15 downto 0);  -- the place in a parameter

  -- ------------------------------------------------------------------ where a participant listens
  signal udp_r      : std_logic;  -- the locator is one for UDP over IPv4, so far
  signal has_meta_r : std_logic;
  signal has_user_r : std_logic;
  signal has_end_r  : std_logic;
  signal is_graph_r : std_logic;  -- the topic is that of the graph
  signal named_r    : std_logic;  -- the same, so far
  signal is_meta    : std_logic;
  signal is_user    : std_logic;
  signal is_point   : std_logic;  -- the locator is that of an endpoint

  -- ------------------------------------------------------------------ what is done
  type state_t is (
    TAKING, DECIDE, FIND, FORGET, EXPECT, JUDGE, TELL, REST, ASK, INSERT, CHOOSE, LOAD, BEGIN_PACKET, WAIT_PACKET
  );
  type job_t is (
    NOTHING, GREETING, ANNOUNCED, TOLD, SKIPPED, GRAPH_PORT, ENDPOINTS, GRAPH_JOB, SAMPLES, TO_GROUP
  );
  signal state_r   : state_t;
  signal job_r     : job_t;
  signal removes_r : std_logic;
  signal slot_r    : unsigned(2 downto 0) := (others => '0');
  signal index_r   : unsigned(6 downto 0) := (others => '0');
  signal second_r  : std_logic;  -- the memories show what index_r selects
  signal packet_r  : unsigned(7 downto 0) := (others => '0');
  signal stop_r    : unsigned(7 downto 0) := (others => '0');
  signal used_r    : std_logic_vector(7 downto 0);
  signal count_r   : unsigned(15 downto 0) := (others => '0');
  signal slot      : std_logic_vector(7 downto 0);
  signal is_used   : std_logic;  -- the entry of slot_r
  signal full      : std_logic;
  signal free      : unsigned(2 downto 0);

  -- The next number of each peer's writers of discovery, of which all before have come. Others are not kept.
  type numbers_t is array (natural range 0 to 15) of unsigned(31 downto 0);
  signal numbers       : numbers_t := (others => (others => '0'));
  signal number_place  : unsigned(3 downto 0);
  signal number_write  : std_logic;
  signal new_number    : unsigned(31 downto 0);
  signal expected_r    : unsigned(31 downto 0) := (others => '0');
  signal is_expected   : std_logic;
  signal is_subscribed : std_logic;  -- the writer is that of subscriptions
  signal lacks         : unsigned(32 downto 0);  -- how many numbers the peer has told of that have not come
  signal set_size_r    : unsigned(5 downto 0) := (others => '0');
  signal set_r         : std_logic_vector(31 downto 0) := (others => '0');

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

  function byte_of(word : std_logic_vector(31 downto 0); where : unsigned(1 downto 0)) return byte_t is
  begin
    if where = 0 then
      return word(31 downto 24);
    elsif where = 1 then
      return word(23 downto 16);
    elsif where = 2 then
      return word(15 downto 8);
    end if;
    return word(7 downto 0);
  end function byte_of;

  -- Whether a byte is that of the topic's name at this place of the value; after the name, any byte is.
  function is_character(char : byte_t; where : unsigned(15 downto 0)) return boolean is
    variable wanted : byte_t := char;
  begin
    for index in 0 to GRAPH_TOPIC_BYTES-1 loop
      if where = NAME_PLACE+index then
        wanted := GRAPH_TOPIC(8*index to 8*index+7);
      end if;
    end loop;
    return char = wanted;
  end function is_character;

  function reversed(word : std_logic_vector(31 downto 0)) return std_logic_vector is
  begin
    return word(7 downto 0) & word(15 downto 8) & word(23 downto 16) & word(31 downto 24);
  end function reversed;

begin

  assert PEERS >= 1 and PEERS <= 8
    report "firm_rtps_control: PEERS is " & integer'image(PEERS) & "; legal: 1 to 8"
    severity failure;
  assert WRITERS >= 2 and WRITERS <= 234
    report "firm_rtps_control: WRITERS is " & integer'image(WRITERS) & "; legal: 2 to 234"
    severity failure;
  assert READERS >= 0 and READERS <= 8
    report "firm_rtps_control: READERS is " & integer'image(READERS) & "; legal: 0 to 8"
    severity failure;
  assert SAMPLE >= 2 and SAMPLE <= 128 and 2**clog2(SAMPLE) = SAMPLE
    report "firm_rtps_control: SAMPLE is " & integer'image(SAMPLE) & "; legal: powers of two, 2 to 128"
    severity failure;

  take  <= '1' when state_r = TAKING and due_r = '0' and leave_r = '0' else '0';
  takes <= has_word when state_r = TAKING and due_r = '0' and leave_r = '0' else '0';
  at    <= unsigned(place);

  -- ------------------------------------------------------------------ where a participant listens

  is_meta  <= '1' when id = RTPS_METATRAFFIC_LOCATOR and unsigned(size) = LOCATOR_BYTES and has_meta_r = '0' else '0';
  is_user  <= '1' when id = RTPS_DEFAULT_LOCATOR and unsigned(size) = LOCATOR_BYTES and has_user_r = '0' else '0';
  is_point <= '1' when id = RTPS_UNICAST_LOCATOR and unsigned(size) = LOCATOR_BYTES and has_end_r = '0' else '0';

  read_parameters : process (clk)
    variable expected : byte_t;
    variable named    : std_logic;
  begin
    if rising_edge(clk) then
      if takes = '1' and is_value = '1' then
        expected := x"00";
        if (at = 0 and is_little = '1') or (at = 3 and is_little = '0') then
          expected := x"01";
        end if;
        if at < 4 then
          udp_r <= '0';
          if data = expected then
            udp_r <= udp_r;
            if at = 0 then
              udp_r <= '1';
            end if;
          end if;
        end if;
        named := named_r;
        if at = 0 then
          named := '1';
        end if;
        if id /= RTPS_TOPIC_NAME or (at >= NAME_PLACE and not is_character(data, at)) then
          named := '0';
        end if;
        named_r <= named;
        if is_last = '1' then
          has_end_r  <= has_end_r or (is_point and udp_r);
          has_meta_r <= has_meta_r or (is_meta and udp_r);
          has_user_r <= has_user_r or (is_user and udp_r);
          if named = '1' and unsigned(size) >= GRAPH_TOPIC_BYTES+NAME_PLACE then
            is_graph_r <= '1';
          end if;
        end if;
      end if;
      if begins = '1' then
        has_meta_r <= '0';
        has_user_r <= '0';
        has_end_r  <= '0';
        is_graph_r <= '0';
      end if;
    end if;
  end process read_parameters;

  -- Fields of the record, and ports and addresses of locators.
  place_words : process (takes, has_field, address, is_value, at, is_little, udp_r, is_meta, is_user, is_point)
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
    elsif is_point = '1' then
      port_place := AT_GRAPH_PORT;
    end if;
    offset := 0;
    found  := '0';
    if at >= 20 and at < 24 then
      found  := not is_point;
      offset := ip_place + to_integer(at(1 downto 0));
    elsif at >= 4 and at < 8 then
      -- Of four bytes, the port is in the lower two.
      found := is_little xor at(1);
      if (at(0) = '0') = (is_little = '0') then
        offset := port_place;
      else
        offset := port_place + 1;
      end if;
    end if;
    if has_field = '1' then
      record_write  <= takes;
      write_address <= unsigned(address);
    else
      record_write  <= takes and is_value and found and udp_r and (is_meta or is_user or is_point);
      write_address <= to_unsigned(RECORD_SOURCE_MAC, RECORD_BITS) + offset;
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
        record_memory(to_integer(write_address)) <= data;
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

  is_subscribed <= '1' when writer = RTPS_SUBSCRIPTIONS_WRITER else '0';
  is_expected   <= '1' when unsigned(number) = expected_r and is_large = '0' else '0';
  number_place  <= slot_r & index_r(0) when state_r = INSERT else slot_r & is_subscribed;

  choose_number : process (state_r, job_r, second_r, is_expected, expected_r, number, second, is_large)
  begin
    number_write <= '0';
    new_number   <= to_unsigned(1, 32);
    if state_r = INSERT and job_r = GREETING then
      number_write <= second_r;
    elsif state_r = JUDGE then
      if job_r = ANNOUNCED then
        number_write <= is_expected;
        new_number   <= expected_r + 1;
      elsif job_r = TOLD then
        if unsigned(number) > expected_r then
          number_write <= not is_large;
        end if;
        new_number <= unsigned(number);
      elsif job_r = SKIPPED then
        if unsigned(number) <= expected_r and unsigned(second) > expected_r then
          number_write <= not is_large;
        end if;
        new_number <= unsigned(second);
      end if;
    end if;
  end process choose_number;

  access_numbers : process (clk)
  begin
    if rising_edge(clk) then
      expected_r <= numbers(to_integer(number_place));
      if number_write = '1' then
        numbers(to_integer(number_place)) <= new_number;
        expected_r                        <= new_number;
      end if;
    end if;
  end process access_numbers;

  lacks <= ('0' & unsigned(second)) + 1 - ('0' & expected_r);

  note_request : process (clk)
  begin
    if rising_edge(clk) then
      if state_r = ASK then
        set_size_r <= lacks(5 downto 0);
        if lacks(32) = '1' then
          set_size_r <= (others => '0');
        elsif lacks > MOST_REQUESTED then
          set_size_r <= to_unsigned(MOST_REQUESTED, 6);
        end if;
      end if;
      for bit_place in set_r'range loop
        set_r(bit_place) <= '0';
        if 31-bit_place < set_size_r then
          set_r(bit_place) <= '1';
        end if;
      end loop;
    end if;
  end process note_request;

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
    for entry in used_r'range loop
      if used_r(entry) = '0' and entry < PEERS then
        free <= to_unsigned(entry, 3);
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
      removes_r <= '0';
      if writer = RTPS_PARTICIPANT_WRITER then
        removes_r <= is_gone;
        if kind = RTPS_DATA and (is_gone = '1' or has_meta_r = '1') then
          find_peer(GREETING, ANNOUNCE, READERS_TOLD);
        end if;
      elsif kind = RTPS_ACKNACK and is_large = '0' then
        if writer = RTPS_PUBLICATIONS_WRITER and (unsigned(number) <= WRITERS or flags(RTPS_FINAL) = '0') then
          find_peer(ENDPOINTS, FIRST_WRITER, WRITERS_TOLD);
        elsif writer = RTPS_SUBSCRIPTIONS_WRITER and (unsigned(number) <= READERS or flags(RTPS_FINAL) = '0') then
          find_peer(ENDPOINTS, FIRST_READER, READERS_TOLD);
        elsif writer = GRAPH_WRITER and unsigned(number) <= 1 then
          find_peer(GRAPH_JOB, HEARTBEAT, GRAPH);
        end if;
      elsif writer = RTPS_PUBLICATIONS_WRITER or writer = RTPS_SUBSCRIPTIONS_WRITER then
        if kind = RTPS_DATA then
          find_peer(ANNOUNCED, GRAPH, GRAPH);
        elsif kind = RTPS_HEARTBEAT and is_large = '0' then
          find_peer(TOLD, ACKNOWLEDGE, ACKNOWLEDGE);
        elsif kind = RTPS_GAP then
          find_peer(SKIPPED, GRAPH, GRAPH);
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
          if is_end = '1' then
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
            if job_r = ANNOUNCED or job_r = TOLD or job_r = SKIPPED then
              state_r <= EXPECT;
            elsif job_r = GREETING then
              state_r <= TAKING;
              if removes_r = '1' then
                state_r <= FORGET;
              end if;
            end if;
          end if;
        end if;
      elsif state_r = FORGET then
        used_r  <= used_r and not slot;
        state_r <= TAKING;
      elsif state_r = EXPECT then
        state_r <= JUDGE;
      elsif state_r = JUDGE then
        second_r <= '0';
        state_r  <= TAKING;
        if job_r = TOLD then
          state_r <= ASK;
        elsif job_r = ANNOUNCED and is_expected = '1' then
          if is_subscribed = '0' then
            state_r <= TELL;
          elsif is_gone = '0' and is_graph_r = '1' and has_end_r = '1' then
            state_r <= INSERT;
            job_r   <= GRAPH_PORT;
            index_r <= to_unsigned(AT_GRAPH_PORT, 7);
          end if;
        end if;
      elsif state_r = TELL then
        state_r <= REST;
      elsif state_r = REST then
        if readers_busy = '0' then
          state_r <= TAKING;
        end if;
      elsif state_r = ASK then
        second_r <= '0';
        state_r  <= TAKING;
        if lacks(32) = '0' and lacks /= 0 then
          state_r  <= LOAD;
          packet_r <= to_unsigned(REQUEST, 8);
          stop_r   <= to_unsigned(REQUEST, 8);
        elsif flags(RTPS_FINAL) = '0' then
          state_r <= LOAD;
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
        index_r  <= (others => '0');
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

  start        <= '1' when state_r = BEGIN_PACKET else '0';
  packet       <= std_logic_vector(packet_r);
  peers_known  <= used_r;
  is_announced <= '1' when state_r = TELL else '0';
  is_left      <= '1' when state_r = FORGET else '0';
  peer         <= std_logic_vector(slot_r);

  -- ------------------------------------------------------------------ fields of packets

  build_field_valid   <= second_r when state_r = LOAD else '0';
  build_field_address <= std_logic_vector(index_r);

  choose_field : process (index_r, job_r, peer_r, record_r, sample_writer, writer, count_r, number_r, expected_r,
                          set_size_r, set_r)
    variable sender : std_logic_vector(31 downto 0);
    variable named  : std_logic_vector(31 downto 0);
    variable shown  : std_logic_vector(31 downto 0);
  begin
    sender := GRAPH_WRITER;
    named  := std_logic_vector(number_r);
    if job_r = SAMPLES then
      sender := sample_writer;
    elsif job_r = TOLD then
      sender := writer;
      named  := std_logic_vector(expected_r);
    end if;
    shown := (others => '0');
    if index_r >= AT_WRITER and index_r < AT_WRITER+4 then
      shown := sender;
    elsif index_r >= AT_COUNT and index_r < AT_COUNT+4 then
      shown := reversed(x"0000" & std_logic_vector(count_r));
    elsif index_r >= AT_NUMBER and index_r < AT_NUMBER+4 then
      shown := reversed(named);
    elsif index_r >= AT_SET then
      shown := reversed(set_r);
    elsif index_r >= AT_SET_SIZE then
      shown := reversed(std_logic_vector(resize(set_size_r, 32)));
    elsif (index_r >= AT_FIRST and index_r < AT_FIRST+4) or index_r >= AT_LAST then
      shown := x"01000000";
    elsif index_r >= AT_READER and index_r < AT_READER+4 and job_r = TOLD then
      shown := writer(31 downto 8) & DISCOVERY_READER;
    end if;
    build_field_data <= byte_of(shown, index_r(1 downto 0));
    if job_r = TOLD and index_r = AT_FLAGS then
      build_field_data <= REQUEST_FLAGS;
    elsif index_r < ENTRY_FIELDS then
      build_field_data <= peer_r;
    elsif index_r < AT_READER+4 and job_r = GRAPH_JOB then
      build_field_data <= record_r;
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
      is_long <= '0';
      if s_axis_tvalid = '1' and has_sample_r = '0' then
        if size_of_sample_r /= SAMPLE then
          size_of_sample_r <= size_of_sample_r + 1;
          if s_axis_tlast = '1' then
            has_sample_r <= '1';
            number_r     <= number_r + 1;
          end if;
        elsif s_axis_tlast = '1' then
          is_long          <= '1';
          size_of_sample_r <= (others => '0');
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
        is_long          <= '0';
        has_sample_r     <= '0';
        size_of_sample_r <= (others => '0');
        number_r         <= (others => '0');
      end if;
    end if;
  end process keep_sample;

end architecture rtl;
