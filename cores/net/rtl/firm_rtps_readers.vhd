-- SPDX-License-Identifier: Apache-2.0
-- The readers of a node in fabric, best effort: notes the writers of peers that match them, and gives each sample of
-- these writers as a frame `id | length | payload`, once and in order. The id is the number of the reader.
--
-- The writer of a sample is looked up while the packet arrives. The sample then waits until the packet is known to be
-- good, and only then its number is compared with that of the last one.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_rtps_pkg.all;

entity firm_rtps_readers is
  generic (
    READERS : integer := 1;    -- of the node, 1 to 8
    FIRST   : integer := 2;    -- the number in the entity id of the first one; those of the others follow
    SOURCES : integer := 8;    -- matched writers, 1 to 32
    BYTES   : integer := 2048; -- of payloads that wait, a power of two, 4 to 65536
    SAMPLES : integer := 16    -- that wait, a power of two, 2 or more
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- From firm_rtps_walker.
    field_valid   : in std_logic;
    field_address : in std_logic_vector(RECORD_BITS-1 downto 0);
    field_data    : in std_logic_vector(7 downto 0);
    payload_valid : in std_logic;
    payload_data  : in std_logic_vector(7 downto 0);
    kind          : in std_logic_vector(7 downto 0);
    flags         : in std_logic_vector(7 downto 0);
    is_submessage : in std_logic;
    is_whole      : in std_logic;
    is_faulty     : in std_logic;
    is_foreign    : in std_logic;
    is_aborted    : in std_logic;
    -- From firm_rtps_inbox: the submessage is for this node.
    is_mine : in std_logic;

    -- From firm_rtps_endpoint.
    matches      : in  std_logic_vector(READERS-1 downto 0);
    is_known     : in  std_logic;
    guid_place   : out std_logic_vector(3 downto 0);
    guid_byte    : in  std_logic_vector(7 downto 0);
    entity_valid : in  std_logic;
    entity_place : in  std_logic_vector(1 downto 0);
    entity_data  : in  std_logic_vector(7 downto 0);

    -- A pulse: the peer with this number announced the writer that firm_rtps_endpoint shows, or ended it.
    is_announced : in std_logic;
    is_gone      : in std_logic;
    peer         : in std_logic_vector(2 downto 0);
    -- A pulse: the peer with this number is forgotten.
    is_left : in std_logic;

    is_busy : out std_logic;  -- notes a writer; no word may come

    -- Frames.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    sources_known : out std_logic_vector(SOURCES-1 downto 0);
    is_full       : out std_logic;  -- a pulse for each matching writer without room
    -- A pulse for each sample without room, also one that is repeated or whose packet is aborted later.
    is_lost : out std_logic
  );
end entity firm_rtps_readers;

architecture rtl of firm_rtps_readers is

  constant MOST_READERS : positive := 8;
  constant GUID_BYTES   : positive := 16;
  constant TAIL         : positive := 12;  -- of a GUID: the entity
  constant NUMBER_BITS  : positive := 48;  -- of a sample; those of one with more are refused
  constant SIZE_BITS    : positive := 16;
  constant MARK_BITS    : positive := 4;
  constant HEAD_BYTES   : positive := 5;   -- of a frame
  constant READER_KIND  : std_logic_vector(7 downto 0) := x"04";
  constant ID_BITS      : positive := 3;
  constant PEER_BITS    : positive := 3;
  constant SOURCE_BITS  : positive := max(1, clog2(SOURCES));
  constant PLACE_BITS   : positive := max(1, clog2(BYTES));
  constant QUEUE_BITS   : positive := max(1, clog2(SAMPLES));
  constant SAMPLE_BITS  : positive := SOURCE_BITS+MARK_BITS+NUMBER_BITS+SIZE_BITS;

  subtype sources_t is std_logic_vector(SOURCES-1 downto 0);
  subtype source_t is unsigned(SOURCE_BITS-1 downto 0);
  subtype number_t is unsigned(NUMBER_BITS-1 downto 0);
  subtype size_t is unsigned(SIZE_BITS-1 downto 0);
  subtype place_t is unsigned(PLACE_BITS downto 0);  -- one bit more than an address, so that full differs from empty
  subtype count_t is unsigned(QUEUE_BITS downto 0);

  type payloads_t is array (natural range 0 to BYTES-1) of std_logic_vector(7 downto 0);
  type samples_t is array (natural range 0 to SAMPLES-1) of std_logic_vector(SAMPLE_BITS-1 downto 0);
  type numbers_t is array (natural range 0 to 2**SOURCE_BITS-1) of number_t;
  type ids_t is array (natural range 0 to 2**SOURCE_BITS-1) of unsigned(ID_BITS-1 downto 0);
  type peers_t is array (natural range 0 to SOURCES-1) of unsigned(PEER_BITS-1 downto 0);
  type marks_t is array (natural range 0 to 2**SOURCE_BITS-1) of unsigned(MARK_BITS-1 downto 0);

  signal payloads : payloads_t;
  signal entries  : samples_t := (others => (others => '0'));
  signal numbers  : numbers_t := (others => (others => '0'));  -- the next number of each source
  signal ids      : ids_t := (others => (others => '0'));      -- the reader of each source
  -- Changes when a source's place gets another writer, whose numbers begin anew: samples of the one before may wait.
  signal marks    : marks_t := (others => (others => '0'));

  -- ------------------------------------------------------------------ the sample that arrives
  signal key_valid : std_logic;
  signal key_place : std_logic_vector(3 downto 0);
  signal found     : sources_t;
  signal source    : source_t;
  signal number_r  : std_logic_vector(NUMBER_BITS-1 downto 0) := (others => '0');
  signal large_r   : std_logic;
  signal reader_r  : std_logic_vector(31 downto 0) := (others => '0');
  signal full_r    : std_logic;  -- its payload found no room

  signal start_r   : place_t := (others => '0');  -- of the packet's payloads
  signal sample_r  : place_t := (others => '0');  -- of the sample's payload
  signal write_r   : place_t := (others => '0');
  signal read_r    : place_t := (others => '0');
  signal end_place : place_t;                     -- after the byte that comes
  signal used      : place_t;
  signal has_room  : std_logic;
  signal is_over   : std_logic;
  signal ends      : std_logic;
  signal spoils    : std_logic;
  signal is_sample : std_logic;
  signal is_for_it : std_logic;  -- the submessage names no other reader
  signal pushes    : std_logic;
  signal spare     : std_logic;
  signal first_r   : count_t := (others => '0');  -- of the packet's samples
  signal last_r    : count_t := (others => '0');  -- after those that arrived
  signal waiting   : count_t;
  signal oldest_r  : count_t := (others => '0');

  -- ------------------------------------------------------------------ the sample that leaves
  type state_t is (IDLE, JUDGING, HEADING, SENDING);
  signal state_r   : state_t;
  signal shown     : std_logic_vector(SAMPLE_BITS-1 downto 0);
  signal from_r    : source_t := (others => '0');
  signal is_new_r  : std_logic;
  signal size_r    : size_t := (others => '0');
  signal left_r    : size_t := (others => '0');
  signal id_r      : unsigned(ID_BITS-1 downto 0) := (others => '0');
  signal next_r    : number_t := (others => '0');
  signal place_r   : unsigned(2 downto 0) := (others => '0');
  signal read_next : place_t;
  signal payload_r : std_logic_vector(7 downto 0) := (others => '0');
  signal moves     : std_logic;

  -- ------------------------------------------------------------------ writers
  signal sources_r : sources_t;
  signal peers_r   : peers_t := (others => (others => '0'));
  signal known     : sources_t;  -- with the entity that is announced
  signal same      : sources_t;  -- the same, of the same peer
  signal free      : source_t;
  signal has_free  : std_logic;
  signal reader    : unsigned(ID_BITS-1 downto 0);
  signal notes_r   : std_logic;
  signal index_r   : unsigned(3 downto 0) := (others => '0');
  signal to_r      : source_t := (others => '0');
  signal writes    : sources_t;

  signal number_place : source_t;
  signal number_write : std_logic;
  signal new_number   : number_t;

  signal all_ones  : sources_t;

  -- The lowest bit that is set.
  function lowest(mask : std_logic_vector; bits : positive) return unsigned is
    -- An operator's result has indices of its own.
    variable numbered : std_logic_vector(mask'length-1 downto 0) := mask;
    variable result   : unsigned(bits-1 downto 0) := (others => '0');
  begin
    for index in numbered'range loop
      if numbered(index) = '1' then
        result := to_unsigned(index, bits);
      end if;
    end loop;
    return result;
  end function lowest;

  function any(mask : std_logic_vector) return std_logic is
  begin
    if unsigned(mask) = 0 then
      return '0';
    end if;
    return '1';
  end function any;

begin

  assert READERS >= 1 and READERS <= MOST_READERS
    report "firm_rtps_readers: READERS is " & integer'image(READERS) & "; legal: 1 to " & integer'image(MOST_READERS)
    severity failure;
  assert FIRST >= 0 and FIRST + READERS <= 256
    report "firm_rtps_readers: FIRST is " & integer'image(FIRST) & "; legal: 0 to 256-READERS"
    severity failure;
  assert BYTES >= 4 and BYTES <= 65536 and 2**clog2(BYTES) = BYTES
    report "firm_rtps_readers: BYTES is " & integer'image(BYTES) & "; legal: powers of two, 4 to 65536"
    severity failure;
  assert SAMPLES >= 2 and 2**clog2(SAMPLES) = SAMPLES
    report "firm_rtps_readers: SAMPLES is " & integer'image(SAMPLES) & "; legal: powers of two, 2 or more"
    severity failure;

  -- ------------------------------------------------------------------ samples that arrive

  find_key : process (field_valid, field_address)
  begin
    key_valid <= '0';
    key_place <= field_address(3 downto 0);
    if unsigned(field_address) >= RECORD_SOURCE and unsigned(field_address) < RECORD_SOURCE+TAIL then
      key_valid <= field_valid;
    elsif unsigned(field_address) >= RECORD_WRITER and unsigned(field_address) < RECORD_WRITER+4 then
      key_valid <= field_valid;
      key_place <= "11" & field_address(1 downto 0);
    end if;
  end process find_key;

  u_sources : entity firm.firm_net_keys
    generic map (
      ENTRIES   => SOURCES,
      KEY_BYTES => GUID_BYTES,
      TAIL      => TAIL
    )
    port map (
      clk         => clk,
      s_valid     => key_valid,
      s_place     => key_place,
      s_data      => field_data,
      used        => sources_r,
      matches     => found,
      writes      => writes,
      write_place => std_logic_vector(index_r),
      write_data  => guid_byte
    );

  source <= lowest(found, SOURCE_BITS);

  note_sample : process (clk)
  begin
    if rising_edge(clk) and field_valid = '1' then
      if unsigned(field_address) = RECORD_KIND then
        large_r <= '0';
      elsif unsigned(field_address) >= RECORD_READER and unsigned(field_address) < RECORD_READER+4 then
        reader_r <= reader_r(23 downto 0) & field_data;
      end if;
      for index in 0 to 7 loop
        if unsigned(field_address) = RECORD_NUMBER+index then
          if index < NUMBER_BITS/8 then
            number_r(8*index+7 downto 8*index) <= field_data;
          else
            large_r <= large_r or any(field_data);
          end if;
        end if;
      end loop;
    end if;
  end process note_sample;

  used      <= write_r - read_r;
  has_room  <= not used(PLACE_BITS);
  end_place <= write_r + 1 when payload_valid = '1' and has_room = '1' else write_r;
  is_over   <= full_r or (payload_valid and not has_room);
  ends      <= is_whole or is_faulty or is_foreign or is_aborted;
  spoils    <= is_foreign or is_aborted;
  waiting   <= last_r - oldest_r;
  spare     <= not waiting(QUEUE_BITS);
  is_for_it <= '1' when unsigned(reader_r) = 0 else
               '1' when reader_r = x"0000" & std_logic_vector(to_unsigned(FIRST, 8) + ids(to_integer(source)))
                        & READER_KIND else
               '0';
  is_sample <= is_submessage and is_mine and any(found) and is_for_it and not large_r and flags(RTPS_PAYLOAD)
               when kind = RTPS_DATA else
               '0';
  pushes    <= is_sample and spare and not is_over;

  write_payload : process (clk)
  begin
    if rising_edge(clk) then
      if payload_valid = '1' and has_room = '1' then
        payloads(to_integer(write_r(PLACE_BITS-1 downto 0))) <= payload_data;
      end if;
      payload_r <= payloads(to_integer(read_next(PLACE_BITS-1 downto 0)));
    end if;
  end process write_payload;

  write_sample : process (clk)
  begin
    if rising_edge(clk) then
      if pushes = '1' then
        entries(to_integer(last_r(QUEUE_BITS-1 downto 0)))
          <= std_logic_vector(source) & std_logic_vector(marks(to_integer(source))) & number_r
             & std_logic_vector(resize(end_place - sample_r, SIZE_BITS));
      end if;
    end if;
  end process write_sample;

  gather : process (clk)
    variable place : place_t;
    variable last  : count_t;
  begin
    if rising_edge(clk) then
      is_lost <= '0';
      place   := sample_r;
      last    := last_r;
      write_r <= end_place;
      full_r  <= is_over;
      if pushes = '1' then
        place := end_place;
        last  := last_r + 1;
      end if;
      if is_submessage = '1' then
        write_r <= place;
        full_r  <= '0';
        is_lost <= is_sample and not pushes;
      end if;
      if ends = '1' then
        if spoils = '1' then
          place := start_r;
          last  := first_r;
        end if;
        write_r <= place;
        full_r  <= '0';
        start_r <= place;
        first_r <= last;
      end if;
      sample_r <= place;
      last_r   <= last;
      if rst_n = '0' then
        write_r  <= (others => '0');
        start_r  <= (others => '0');
        sample_r <= (others => '0');
        first_r  <= (others => '0');
        last_r   <= (others => '0');
        full_r   <= '0';
        is_lost  <= '0';
      end if;
    end if;
  end process gather;

  -- ------------------------------------------------------------------ samples that leave

  shown     <= entries(to_integer(oldest_r(QUEUE_BITS-1 downto 0)));
  moves     <= m_axis_tready when state_r = HEADING or state_r = SENDING else '0';
  read_next <= read_r + resize(size_r, PLACE_BITS+1) when state_r = JUDGING and is_new_r = '0' and notes_r = '0' else
               read_r + 1 when state_r = SENDING and moves = '1' else
               read_r;

  leave : process (clk)
    variable source_of : source_t;
    variable number    : number_t;

    procedure finish is
    begin
      state_r  <= IDLE;
      oldest_r <= oldest_r + 1;
    end procedure finish;

  begin
    if rising_edge(clk) then
      read_r <= read_next;
      if state_r = IDLE then
        source_of := unsigned(shown(SAMPLE_BITS-1 downto SAMPLE_BITS-SOURCE_BITS));
        number    := unsigned(shown(SIZE_BITS+NUMBER_BITS-1 downto SIZE_BITS));
        from_r    <= source_of;
        size_r    <= unsigned(shown(SIZE_BITS-1 downto 0));
        left_r    <= unsigned(shown(SIZE_BITS-1 downto 0));
        id_r      <= ids(to_integer(source_of));
        next_r    <= number + 1;
        place_r   <= (others => '0');
        is_new_r  <= '0';
        if number >= numbers(to_integer(source_of))
           and unsigned(shown(SIZE_BITS+NUMBER_BITS+MARK_BITS-1 downto SIZE_BITS+NUMBER_BITS))
               = marks(to_integer(source_of)) then
          is_new_r <= '1';
        end if;
        if oldest_r /= first_r then
          state_r <= JUDGING;
        end if;
      elsif state_r = JUDGING then
        -- The source's place may be getting another writer, so the sample is judged again.
        if notes_r = '1' then
          state_r <= IDLE;
        elsif is_new_r = '1' then
          state_r <= HEADING;
        else
          finish;
        end if;
      elsif state_r = HEADING then
        if moves = '1' then
          place_r <= place_r + 1;
          if place_r = HEAD_BYTES-1 then
            state_r <= SENDING;
            if left_r = 0 then
              finish;
            end if;
          end if;
        end if;
      elsif moves = '1' then
        left_r <= left_r - 1;
        if left_r = 1 then
          finish;
        end if;
      end if;
      if rst_n = '0' then
        state_r  <= IDLE;
        read_r   <= (others => '0');
        oldest_r <= (others => '0');
      end if;
    end if;
  end process leave;

  m_axis_tvalid <= '1' when state_r = HEADING or state_r = SENDING else '0';
  m_axis_tlast  <= '1' when (state_r = SENDING and left_r = 1)
                            or (state_r = HEADING and place_r = HEAD_BYTES-1 and left_r = 0) else
                   '0';
  m_axis_tdata  <= payload_r when state_r = SENDING else
                   std_logic_vector(resize(id_r, 8)) when place_r = 0 else
                   std_logic_vector(size_r(7 downto 0)) when place_r = 1 else
                   std_logic_vector(size_r(15 downto 8)) when place_r = 2 else
                   x"00";

  -- ------------------------------------------------------------------ writers

  all_ones <= (others => '1');

  u_entities : entity firm.firm_net_keys
    generic map (
      ENTRIES   => SOURCES,
      KEY_BYTES => 4,
      TAIL      => 1
    )
    port map (
      clk                     => clk,
      s_valid                 => entity_valid,
      s_place(3 downto 2)     => "00",
      s_place(1 downto 0)     => entity_place,
      s_data                  => entity_data,
      used                    => all_ones,
      matches                 => known,
      writes                  => writes,
      write_place(3 downto 2) => "00",
      write_place(1 downto 0) => std_logic_vector(index_r(1 downto 0)),
      write_data              => guid_byte
    );

  compare : for entry in 0 to SOURCES-1 generate
    same(entry)   <= known(entry) and sources_r(entry) when peers_r(entry) = unsigned(peer) else '0';
    writes(entry) <= notes_r when to_r = entry else '0';
  end generate compare;

  has_free   <= any(not sources_r);
  free       <= lowest(not sources_r, SOURCE_BITS);
  -- Of several readers of one topic, only the first gets the samples.
  reader     <= lowest(matches, ID_BITS);
  guid_place <= std_logic_vector(index_r);
  is_busy    <= notes_r;

  note_writers : process (clk)
    variable left : sources_t;
  begin
    if rising_edge(clk) then
      is_full <= '0';
      left    := sources_r;
      if notes_r = '1' then
        index_r <= index_r + 1;
        if index_r = GUID_BYTES-1 then
          notes_r <= '0';
          left    := left or writes;
        end if;
      elsif is_announced = '1' and is_known = '1' then
        if is_gone = '1' then
          left := left and not same;
        elsif any(same) = '0' and any(matches) = '1' then
          is_full <= not has_free;
          if has_free = '1' then
            notes_r                 <= '1';
            to_r                    <= free;
            index_r                 <= (others => '0');
            ids(to_integer(free))   <= reader;
            marks(to_integer(free)) <= marks(to_integer(free)) + 1;
            for entry in peers_r'range loop
              if free = entry then
                peers_r(entry) <= unsigned(peer);
              end if;
            end loop;
          end if;
        end if;
      end if;
      if is_left = '1' then
        for entry in left'range loop
          if peers_r(entry) = unsigned(peer) then
            left(entry) := '0';
          end if;
        end loop;
      end if;
      sources_r <= left;
      if rst_n = '0' then
        sources_r <= (others => '0');
        notes_r   <= '0';
        is_full   <= '0';
      end if;
    end if;
  end process note_writers;

  -- A new writer begins with 1; after a sample, the next one follows. The memory has one write port.
  number_place <= to_r when notes_r = '1' else from_r;
  number_write <= '1' when notes_r = '1' or (state_r = JUDGING and is_new_r = '1') else '0';
  new_number   <= to_unsigned(1, NUMBER_BITS) when notes_r = '1' else next_r;

  note_numbers : process (clk)
  begin
    if rising_edge(clk) then
      if number_write = '1' then
        numbers(to_integer(number_place)) <= new_number;
      end if;
    end if;
  end process note_numbers;

  sources_known <= sources_r;

end architecture rtl;
