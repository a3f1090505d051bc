-- SPDX-License-Identifier: Apache-2.0
-- The readers of a node in fabric: outputs each sample of the peers' matching writers as a frame
-- `id | length | payload`, once and in order. The id is the number of the reader. The program of firm_rtps_sequencer
-- finds the matching writers, and requests missing samples.
--
-- The writer of a sample is looked up while the packet arrives. When the packet is known to be good, the sample's
-- number is compared with the next one of its writer: a reliable reader accepts only that one, a best-effort reader any
-- later one as well. An accepted sample waits for the host. A sample in fragments, or without room in the queue, is
-- assembled elsewhere (firm_rtps_assembly), and joins the others when it is complete.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_rtps_pkg.all;

entity firm_rtps_readers is
  generic (
    READERS : integer := 1;    -- of the node, 0 to 8
    FIRST   : integer := 2;    -- the number in the entity id of the first one; those of the others follow
    SOURCES : integer := 8;    -- matched writers, 1 to 64
    BYTES   : integer := 2048; -- of payloads that wait, a power of two, 4 to 131072
    SAMPLES : integer := 16;   -- that wait, a power of two, 2 or more
    -- Bytes of the longest sample in fragments, or without room among those; see firm_rtps_assembly. 0 if all of them
    -- are skipped, or dropped.
    ASSEMBLED : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

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

    -- The program's data about the writer with number `source`: a byte of its GUID; whether it exists (bit 7), its
    -- reader's reliability (bit 6) and number (bits 2 to 0); a byte of its next sample's number, the lowest
    -- first.
    source       : in  std_logic_vector(5 downto 0);
    key_write    : in  std_logic;
    note_write   : in  std_logic;
    number_write : in  std_logic;
    write_place  : in  std_logic_vector(3 downto 0);
    write_data   : in  std_logic_vector(7 downto 0);
    -- A byte of the next number; from place 8 on, of a sample in fragments that is not whole: its next fragment (two
    -- bytes), the remaining bytes (two), those of a fragment (two), and whether it is the writer's next sample.
    read_place  : in  std_logic_vector(3 downto 0);
    number_byte : out std_logic_vector(7 downto 0);
    -- While `is_locked` is high, only the program changes numbers. It may rise while `is_judging` is low. `number_byte`
    -- is valid and stable from three cycles later on.
    is_locked  : in  std_logic;
    is_judging : out std_logic;

    -- A sample that a reliable reader cannot yet accept.
    has_early    : out std_logic;
    early_source : out std_logic_vector(5 downto 0);
    early_number : out std_logic_vector(31 downto 0);
    takes_early  : in  std_logic;

    -- Frames.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- A pulse for each good packet with a sample:
    is_lost   : out std_logic; -- without room
    is_parted : out std_logic  -- that is skipped: in fragments, or too long
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
  constant NUMBER_BYTES : positive := NUMBER_BITS/8;
  constant EARLY_BITS   : positive := 4;
  constant SOURCE_BITS  : positive := max(1, clog2(SOURCES));
  constant PLACE_BITS   : positive := max(1, clog2(BYTES));
  constant QUEUE_BITS   : positive := max(1, clog2(SAMPLES));
  -- A sample that waits: size of its payload, number, mark and number of its source, reader, whether it has a payload.
  constant AT_NUMBER    : positive := SIZE_BITS;
  constant AT_MARK      : positive := AT_NUMBER+NUMBER_BITS;
  constant AT_SOURCE    : positive := AT_MARK+MARK_BITS;
  constant AT_ID        : positive := AT_SOURCE+SOURCE_BITS;
  constant SAMPLE_BITS  : positive := AT_ID+ID_BITS+1;

  subtype sources_t is std_logic_vector(SOURCES-1 downto 0);
  subtype source_t is unsigned(SOURCE_BITS-1 downto 0);
  subtype number_t is unsigned(NUMBER_BITS-1 downto 0);
  subtype size_t is unsigned(SIZE_BITS-1 downto 0);
  subtype place_t is unsigned(PLACE_BITS downto 0);  -- one bit more than an address, so that full differs from empty
  subtype count_t is unsigned(QUEUE_BITS downto 0);

  type payloads_t is array (natural range 0 to BYTES-1) of std_logic_vector(7 downto 0);
  type samples_t is array (natural range 0 to SAMPLES-1) of std_logic_vector(SAMPLE_BITS-1 downto 0);
  type number_bytes_t is array (natural range 0 to 2**SOURCE_BITS-1) of std_logic_vector(7 downto 0);
  type ids_t is array (natural range 0 to 2**SOURCE_BITS-1) of unsigned(ID_BITS-1 downto 0);
  type flags_t is array (natural range 0 to SAMPLES-1) of std_logic_vector(0 downto 0);
  type early_t is array (natural range 0 to 2**EARLY_BITS-1) of std_logic_vector(SOURCE_BITS+MARK_BITS+31 downto 0);
  type marks_t is array (natural range 0 to 2**SOURCE_BITS-1) of unsigned(MARK_BITS-1 downto 0);

  signal payloads : payloads_t;
  signal entries  : samples_t := (others => (others => '0'));
  signal kept     : flags_t := (others => "0");                -- samples that the host receives
  signal ids      : ids_t := (others => (others => '0'));      -- the reader of each source
  -- Changes when another writer takes a source's place, since samples of the previous writer may still wait.
  signal marks      : marks_t := (others => (others => '0'));
  signal sources_r  : sources_t := (others => '0');
  signal reliable_r : sources_t;

  -- ------------------------------------------------------------------ the sample that arrives
  signal key_valid : std_logic;
  signal key_place : std_logic_vector(3 downto 0);
  signal found     : sources_t;
  -- The writer is known eight bytes before the end of its submessage: there is time for these.
  signal found_r   : sources_t;
  signal known_r   : std_logic;
  signal sender_r  : source_t := (others => '0');
  signal id_r      : unsigned(ID_BITS-1 downto 0) := (others => '0');
  signal for_it_r  : std_logic;  -- the submessage names no other reader
  signal number_r  : std_logic_vector(NUMBER_BITS-1 downto 0) := (others => '0');
  signal large_r   : std_logic;
  signal reader_r  : std_logic_vector(31 downto 0) := (others => '0');
  signal full_r    : std_logic;  -- its payload has no room

  -- One cycle later, when the number is complete.
  signal submessage_r : std_logic;
  signal data_r       : std_logic;  -- it is a sample for this node
  signal filled_r     : std_logic;  -- with a payload that is whole
  signal fragment_r   : std_logic;  -- with a part of one
  -- Of the assembly.
  signal is_complete  : std_logic;  -- the part completes a sample, or is a sample without room elsewhere
  signal is_long      : std_logic;  -- the part is skipped with its sample
  signal is_unplaced  : std_logic;  -- the part is dropped
  signal whole_size   : std_logic_vector(SIZE_BITS-1 downto 0);
  signal has_whole    : std_logic;  -- an assembled sample waits
  signal whole_r      : count_t := (others => '0');  -- which one
  signal whole_data   : std_logic_vector(7 downto 0);
  signal part_byte    : std_logic_vector(7 downto 0);
  signal wanted       : number_t;   -- the next number of its writer
  signal ends_r       : std_logic;
  signal spoils_r     : std_logic;

  signal start_r   : place_t := (others => '0');  -- of the packet's payloads
  signal sample_r  : place_t := (others => '0');  -- of the sample's payload
  signal write_r   : place_t := (others => '0');
  signal read_r    : place_t := (others => '0');
  signal has_room  : std_logic;
  signal is_wanted : std_logic;  -- the submessage that arrives is of a writer that matches
  signal is_sample : std_logic;
  signal misses_r  : std_logic;  -- a sample of the packet had no room
  signal skips_r   : std_logic;  -- a sample of the packet is a fragment that is skipped
  signal pushes    : std_logic;
  signal fills     : std_logic;  -- with a payload that waits
  signal size      : size_t;
  signal spare_r   : std_logic;
  signal first_r   : count_t := (others => '0');  -- of the packet's samples
  signal last_r    : count_t := (others => '0');  -- after those that arrived
  signal oldest_r  : count_t := (others => '0');

  -- ------------------------------------------------------------------ the sample that is judged
  type judge_t is (WAITING, COMPARING, JUDGING, LOADING);
  signal judge_r     : judge_t;
  signal judged_r    : count_t := (others => '0');
  signal queued_r    : std_logic;  -- a sample is to be judged; one cycle late
  signal candidate_r : std_logic_vector(SAMPLE_BITS-1 downto 0) := (others => '0');
  signal from        : source_t;
  signal new_number  : number_t;
  signal judge_place : source_t;
  signal number      : number_t;  -- the next one of that source
  signal next_r      : number_t := (others => '0');
  signal after_r     : number_t := (others => '0');
  signal same_r      : std_logic;  -- the source is that of the sample
  signal equal_r     : std_logic;
  signal later_r     : std_logic;
  signal shows       : std_logic;
  signal strict_r    : std_logic;
  signal is_taken    : std_logic;
  signal writes      : sources_t;
  signal chosen      : source_t;

  signal early       : early_t := (others => (others => '0'));
  signal early_r     : unsigned(EARLY_BITS downto 0) := (others => '0');  -- after the received ones
  signal told_r      : unsigned(EARLY_BITS downto 0) := (others => '0');  -- after the processed ones
  signal early_full  : std_logic;
  signal early_write : std_logic;
  -- The oldest one: source, mark, and number.
  signal early_entry_r : std_logic_vector(SOURCE_BITS+MARK_BITS+31 downto 0) := (others => '0');
  signal waits_r       : std_logic;
  signal has_early_r   : std_logic;
  signal early_from    : source_t;
  signal same_early    : std_logic;  -- the source is that of the sample

  -- ------------------------------------------------------------------ the sample that leaves
  type state_t is (IDLE, HEADING, SENDING);
  signal state_r   : state_t;
  signal shown     : std_logic_vector(SAMPLE_BITS-1 downto 0);
  signal keeps_r   : std_logic;
  signal parts_r   : std_logic;  -- it was assembled
  signal is_left   : std_logic;  -- an assembled one has left
  signal size_r    : size_t := (others => '0');
  signal left_r    : size_t := (others => '0');
  signal host_id_r : unsigned(ID_BITS-1 downto 0) := (others => '0');
  signal place_r   : unsigned(2 downto 0) := (others => '0');
  signal read_next : place_t;
  signal payload_r : std_logic_vector(7 downto 0) := (others => '0');
  signal moves     : std_logic;

  -- The lowest bit that is set.
  function lowest(mask : std_logic_vector; bits : positive) return unsigned is
    -- An operator's result has separate indices.
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

  assert READERS >= 0 and READERS <= MOST_READERS
    report "firm_rtps_readers: READERS is " & integer'image(READERS) & "; legal: 0 to " & integer'image(MOST_READERS)
    severity failure;
  assert FIRST >= 0 and FIRST + READERS <= 256
    report "firm_rtps_readers: FIRST is " & integer'image(FIRST) & "; legal: 0 to 256-READERS"
    severity failure;
  assert BYTES >= 4 and BYTES <= 131072 and 2**clog2(BYTES) = BYTES
    report "firm_rtps_readers: BYTES is " & integer'image(BYTES) & "; legal: powers of two, 4 to 131072"
    severity failure;
  assert SAMPLES >= 2 and 2**clog2(SAMPLES) = SAMPLES
    report "firm_rtps_readers: SAMPLES is " & integer'image(SAMPLES) & "; legal: powers of two, 2 or more"
    severity failure;

  -- ------------------------------------------------------------------ samples that arrive

  find_key : process (field_valid, field_address)
  begin
    key_valid <= '0';
    key_place <= field_address(3 downto 0);
    if is_in(field_address, RECORD_SOURCE, TAIL) = '1' then
      key_valid <= field_valid;
    elsif is_in(field_address, RECORD_WRITER, 4) = '1' then
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
      write_place => write_place,
      write_data  => write_data
    );

  find_sender : process (clk)
  begin
    if rising_edge(clk) then
      spare_r <= '1';
      if last_r(QUEUE_BITS) /= oldest_r(QUEUE_BITS)
         and last_r(QUEUE_BITS-1 downto 0) = oldest_r(QUEUE_BITS-1 downto 0) then
        spare_r <= '0';
      end if;
      found_r  <= found;
      known_r  <= any(found_r);
      sender_r <= lowest(found_r, SOURCE_BITS);
      id_r     <= ids(to_integer(sender_r));
      for_it_r <= '0';
      if unsigned(reader_r) = 0
         or reader_r = x"0000" & std_logic_vector(to_unsigned(FIRST, 8) + id_r) & READER_KIND then
        for_it_r <= '1';
      end if;
    end if;
  end process find_sender;

  note_sample : process (clk)
  begin
    if rising_edge(clk) and field_valid = '1' then
      if unsigned(field_address) = RECORD_KIND then
        large_r <= '0';
      elsif is_in(field_address, RECORD_READER, 4) = '1' then
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

  -- A sample without a payload, or in fragments that are skipped, is only counted.
  delay : process (clk)
  begin
    if rising_edge(clk) then
      submessage_r <= is_submessage;
      data_r       <= '0';
      if kind = RTPS_DATA then
        data_r <= is_submessage and is_mine;
      end if;
      fragment_r <= '0';
      if kind = RTPS_DATA_FRAG then
        fragment_r <= is_mine and not flags(RTPS_FRAGMENT_KEY);
      end if;
      filled_r <= '0';
      if kind = RTPS_DATA then
        filled_r <= flags(RTPS_PAYLOAD);
      end if;
      if ASSEMBLED /= 0 and (full_r = '1' or (payload_valid = '1' and has_room = '0')) then
        filled_r <= '0';
      end if;
      ends_r   <= is_whole or is_faulty or is_foreign or is_aborted;
      spoils_r <= is_foreign or is_aborted;
      if rst_n = '0' then
        submessage_r <= '0';
        data_r       <= '0';
        ends_r       <= '0';
      end if;
    end if;
  end process delay;

  has_room  <= '0' when write_r(PLACE_BITS) /= read_r(PLACE_BITS)
                        and write_r(PLACE_BITS-1 downto 0) = read_r(PLACE_BITS-1 downto 0) else
               '1';
  is_wanted <= known_r and for_it_r and not large_r;

  all_samples : if ASSEMBLED = 0 generate
    is_sample <= is_wanted and (data_r or (fragment_r and (is_complete or is_long)));
  end generate all_samples;

  -- The payload's last byte arrived earlier, since the next submessage begins with a head.
  size <= unsigned(whole_size) when is_complete = '1' else
          resize(write_r - sample_r, SIZE_BITS) when filled_r = '1' else
          (others => '0');

  all_pushes : if ASSEMBLED = 0 generate
    pushes <= is_sample and spare_r and not (full_r and filled_r);
    fills  <= pushes and filled_r;
  end generate all_pushes;

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
          <= (filled_r or is_complete) & std_logic_vector(id_r) & std_logic_vector(sender_r)
             & std_logic_vector(marks(to_integer(sender_r))) & number_r & std_logic_vector(size);
      end if;
    end if;
  end process write_sample;

  gather : process (clk)
    variable place  : place_t;
    variable last   : count_t;
    variable misses : std_logic;
    variable skips  : std_logic;
  begin
    if rising_edge(clk) then
      is_lost   <= '0';
      is_parted <= '0';
      place     := sample_r;
      last      := last_r;
      misses    := misses_r;
      skips     := skips_r;
      if payload_valid = '1' then
        full_r <= full_r or not has_room;
        if has_room = '1' then
          write_r <= write_r + 1;
        end if;
      end if;
      if pushes = '1' then
        last := last_r + 1;
      end if;
      if fills = '1' then
        place := write_r;
      end if;
      if submessage_r = '1' then
        write_r <= place;
        full_r  <= '0';
        misses  := misses_r or (is_sample and not pushes)
                   or (is_wanted and (data_r or fragment_r) and is_unplaced);
        skips   := skips_r or (is_sample and fragment_r and is_long);
        if ASSEMBLED /= 0 and is_sample = '1' and data_r = '1' and is_long = '1' then
          skips := '1';
        end if;
      end if;
      if ends_r = '1' then
        -- The packet may end with the submessage.
        is_lost   <= misses and not spoils_r;
        is_parted <= skips and not spoils_r;
        misses    := '0';
        skips     := '0';
        if spoils_r = '1' then
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
      misses_r <= misses;
      skips_r  <= skips;
      if rst_n = '0' then
        write_r   <= (others => '0');
        start_r   <= (others => '0');
        sample_r  <= (others => '0');
        first_r   <= (others => '0');
        last_r    <= (others => '0');
        full_r    <= '0';
        misses_r  <= '0';
        skips_r   <= '0';
        is_lost   <= '0';
        is_parted <= '0';
      end if;
    end if;
  end process gather;

  -- ------------------------------------------------------------------ samples in fragments

  without_assembly : if ASSEMBLED = 0 generate
    is_complete <= '0';
    is_unplaced <= '0';
    is_long     <= submessage_r;
    whole_size  <= (others => '0');
    has_whole   <= '0';
    whole_data  <= x"00";
    part_byte   <= x"00";
  end generate without_assembly;

  with_assembly : if ASSEMBLED /= 0 generate

    signal is_mine_too    : std_logic;
    signal has_payload_r  : std_logic;  -- it is DATA, and not of a key
    signal is_new_r       : std_logic;
    signal wanted_r       : number_t := (others => '0');
    signal is_strict_r    : std_logic;
    signal is_next_r      : std_logic;
    signal is_sending     : std_logic;
    signal is_open        : std_logic;
    signal open_source    : source_t;
    signal open_number    : std_logic_vector(NUMBER_BITS-1 downto 0);
    signal next_fragment  : std_logic_vector(15 downto 0);
    signal left_bytes     : std_logic_vector(15 downto 0);
    signal fragment_bytes : std_logic_vector(15 downto 0);
    -- The program's view, which is stable while the program reads it.
    signal next_fragment_r  : std_logic_vector(15 downto 0);
    signal left_bytes_r     : std_logic_vector(15 downto 0);
    signal fragment_bytes_r : std_logic_vector(15 downto 0);
    signal is_open_r        : std_logic;
    signal open_source_r    : source_t;
    signal open_number_r    : std_logic_vector(NUMBER_BITS-1 downto 0);
    signal is_its_r         : std_logic;

  begin

    -- An old sample without room for its payload is not counted, since the reader already has it.
    is_sample <= is_wanted and ((data_r and (filled_r or not has_payload_r))
                                or ((data_r or fragment_r) and (is_complete or is_long)));
    pushes    <= is_sample and spare_r;
    fills     <= is_wanted and data_r and filled_r and spare_r;

    -- Bytes of a fragment follow its number by twelve or more others, and those of DATA may follow at once.
    compare_number : process (clk)
    begin
      if rising_edge(clk) then
        has_payload_r <= '0';
        if kind = RTPS_DATA then
          has_payload_r <= flags(RTPS_PAYLOAD);
        end if;
        wanted_r    <= wanted;
        is_strict_r <= reliable_r(to_integer(sender_r));
        is_next_r   <= '0';
        is_new_r    <= '0';
        if unsigned(number_r) = wanted_r then
          is_next_r <= '1';
          is_new_r  <= '1';
        elsif unsigned(number_r) > wanted_r then
          is_next_r <= not is_strict_r;
          is_new_r  <= '1';
        end if;
      end if;
    end process compare_number;

    is_mine_too <= is_wanted and is_mine;
    is_sending  <= parts_r when state_r = SENDING else '0';

    u_assembly : entity firm.firm_rtps_assembly
      generic map (
        BYTES       => ASSEMBLED,
        SOURCE_BITS => SOURCE_BITS
      )
      port map (
        clk            => clk,
        rst_n          => rst_n,
        tick           => tick,
        field_valid    => field_valid,
        field_address  => field_address,
        field_data     => field_data,
        payload_valid  => payload_valid,
        payload_data   => payload_data,
        kind           => kind,
        flags          => flags,
        is_wanted      => is_mine_too,
        is_next        => is_next_r,
        is_new         => is_new_r,
        source         => sender_r,
        number         => number_r,
        submessage     => submessage_r,
        ends           => ends_r,
        spoils         => spoils_r,
        has_place      => spare_r,
        has_room       => filled_r,
        is_complete    => is_complete,
        is_long        => is_long,
        is_dropped     => is_unplaced,
        size           => whole_size,
        is_sending     => is_sending,
        moves          => moves,
        data           => whole_data,
        is_left        => is_left,
        is_whole       => has_whole,
        renews         => note_write,
        renewed        => chosen,
        is_open        => is_open,
        open_source    => open_source,
        open_number    => open_number,
        next_fragment  => next_fragment,
        left_bytes     => left_bytes,
        fragment_bytes => fragment_bytes
      );

    note_whole : process (clk)
    begin
      if rising_edge(clk) then
        if is_complete = '1' and pushes = '1' then
          whole_r <= last_r;
        end if;
      end if;
    end process note_whole;

    show_part : process (clk)
    begin
      if rising_edge(clk) then
        if is_locked = '0' then
          next_fragment_r  <= next_fragment;
          left_bytes_r     <= left_bytes;
          fragment_bytes_r <= fragment_bytes;
          is_open_r        <= is_open;
          open_source_r    <= open_source;
          open_number_r    <= open_number;
        end if;
        is_its_r <= '0';
        if open_source_r = chosen and unsigned(open_number_r) = next_r then
          is_its_r <= is_open_r;
        end if;
      end if;
    end process show_part;

    part_byte <= next_fragment_r(7 downto 0) when read_place(2 downto 0) = "000" else
                 next_fragment_r(15 downto 8) when read_place(2 downto 0) = "001" else
                 left_bytes_r(7 downto 0) when read_place(2 downto 0) = "010" else
                 left_bytes_r(15 downto 8) when read_place(2 downto 0) = "011" else
                 fragment_bytes_r(7 downto 0) when read_place(2 downto 0) = "100" else
                 fragment_bytes_r(15 downto 8) when read_place(2 downto 0) = "101" else
                 "0000000" & is_its_r;

  end generate with_assembly;

  -- ------------------------------------------------------------------ samples that are judged

  chosen      <= unsigned(source(SOURCE_BITS-1 downto 0));
  from        <= unsigned(candidate_r(AT_ID-1 downto AT_SOURCE));
  new_number  <= unsigned(candidate_r(AT_MARK-1 downto AT_NUMBER));
  shows       <= candidate_r(SAMPLE_BITS-1);
  judge_place <= chosen when is_locked = '1' else from;
  is_taken    <= same_r and (equal_r or (later_r and not strict_r)) when judge_r = JUDGING else '0';
  is_judging  <= queued_r when judge_r = WAITING else '1';

  judge : process (clk)
  begin
    if rising_edge(clk) then
      next_r   <= number;
      queued_r <= '1';
      if judged_r = first_r then
        queued_r <= '0';
      end if;
      if judge_r = WAITING or judge_r = LOADING then
        candidate_r <= entries(to_integer(judged_r(QUEUE_BITS-1 downto 0)));
      end if;
      if judge_r = WAITING then
        strict_r <= reliable_r(to_integer(from));
        same_r   <= '0';
        if unsigned(candidate_r(AT_SOURCE-1 downto AT_MARK)) = marks(to_integer(from)) then
          same_r <= '1';
        end if;
        if is_locked = '0' and queued_r = '1' then
          judge_r <= COMPARING;
        end if;
      elsif judge_r = COMPARING then
        judge_r <= JUDGING;
        after_r <= new_number + 1;
        equal_r <= '0';
        later_r <= '0';
        if new_number = next_r then
          equal_r <= '1';
        end if;
        if new_number > next_r then
          later_r <= '1';
        end if;
      elsif judge_r = JUDGING then
        judge_r  <= LOADING;
        judged_r <= judged_r + 1;
      else
        judge_r <= WAITING;
      end if;
      if rst_n = '0' then
        judge_r  <= WAITING;
        judged_r <= (others => '0');
        queued_r <= '0';
      end if;
    end if;
  end process judge;

  keep_sample : process (clk)
  begin
    if rising_edge(clk) then
      if judge_r = JUDGING then
        kept(to_integer(judged_r(QUEUE_BITS-1 downto 0)))(0) <= is_taken and shows;
      end if;
    end if;
  end process keep_sample;

  all_bytes : for index in 0 to NUMBER_BYTES-1 generate

    signal digits : number_bytes_t := (others => (others => '0'));
    signal takes  : std_logic;
    signal digit  : std_logic_vector(7 downto 0);

  begin

    takes <= '1' when is_taken = '1' or (number_write = '1' and unsigned(write_place(2 downto 0)) = index) else '0';
    digit <= std_logic_vector(after_r(8*index+7 downto 8*index)) when is_taken = '1' else write_data;

    write_number : process (clk)
    begin
      if rising_edge(clk) then
        if takes = '1' then
          digits(to_integer(judge_place)) <= digit;
        end if;
      end if;
    end process write_number;

    number(8*index+7 downto 8*index) <= unsigned(digits(to_integer(judge_place)));
    wanted(8*index+7 downto 8*index) <= unsigned(digits(to_integer(sender_r)));

  end generate all_bytes;

  show_number : process (next_r, read_place, part_byte)
  begin
    number_byte <= (others => '0');
    for index in 0 to NUMBER_BYTES-1 loop
      if unsigned(read_place(2 downto 0)) = index then
        number_byte <= std_logic_vector(next_r(8*index+7 downto 8*index));
      end if;
    end loop;
    if ASSEMBLED /= 0 and read_place(3) = '1' then
      number_byte <= part_byte;
    end if;
  end process show_number;

  -- ------------------------------------------------------------------ samples that come too early

  early_full   <= '1' when early_r(EARLY_BITS) /= told_r(EARLY_BITS)
                           and early_r(EARLY_BITS-1 downto 0) = told_r(EARLY_BITS-1 downto 0) else
                  '0';
  early_write  <= same_r and strict_r and later_r and not early_full when judge_r = JUDGING else '0';
  early_from   <= unsigned(early_entry_r(SOURCE_BITS+MARK_BITS+31 downto MARK_BITS+32));
  same_early   <= '1' when unsigned(early_entry_r(MARK_BITS+31 downto 32)) = marks(to_integer(early_from)) else '0';
  has_early    <= has_early_r;
  early_source <= std_logic_vector(resize(early_from, 6));
  early_number <= early_entry_r(31 downto 0);

  note_early : process (clk)
  begin
    if rising_edge(clk) then
      if early_write = '1' then
        early(to_integer(early_r(EARLY_BITS-1 downto 0)))
          <= candidate_r(AT_ID-1 downto AT_MARK) & std_logic_vector(new_number(31 downto 0));
        early_r <= early_r + 1;
      end if;
      has_early_r <= waits_r and same_early and not takes_early;
      if waits_r = '0' then
        early_entry_r <= early(to_integer(told_r(EARLY_BITS-1 downto 0)));
        if early_r /= told_r then
          waits_r <= '1';
          told_r  <= told_r + 1;
        end if;
      elsif takes_early = '1' or same_early = '0' then
        waits_r <= '0';
      end if;
      if rst_n = '0' then
        early_r     <= (others => '0');
        told_r      <= (others => '0');
        waits_r     <= '0';
        has_early_r <= '0';
      end if;
    end if;
  end process note_early;

  -- ------------------------------------------------------------------ samples that leave

  shown     <= entries(to_integer(oldest_r(QUEUE_BITS-1 downto 0)));
  moves     <= m_axis_tready when state_r /= IDLE else '0';
  -- A dropped one is skipped.
  read_next <= read_r when parts_r = '1' else
               read_r + resize(size_r, PLACE_BITS+1) when state_r = HEADING and keeps_r = '0' else
               read_r + 1 when state_r = SENDING and moves = '1' else
               read_r;

  leave : process (clk)

    procedure finish is
    begin
      state_r  <= IDLE;
      oldest_r <= oldest_r + 1;
      is_left  <= parts_r;
    end procedure finish;

  begin
    if rising_edge(clk) then
      read_r  <= read_next;
      is_left <= '0';
      if state_r = IDLE then
        size_r    <= unsigned(shown(SIZE_BITS-1 downto 0));
        left_r    <= unsigned(shown(SIZE_BITS-1 downto 0));
        host_id_r <= unsigned(shown(SAMPLE_BITS-2 downto AT_ID));
        keeps_r   <= kept(to_integer(oldest_r(QUEUE_BITS-1 downto 0)))(0);
        if oldest_r = judged_r then
          keeps_r <= is_taken and shows;
        end if;
        parts_r <= '0';
        if oldest_r = whole_r then
          parts_r <= has_whole;
        end if;
        place_r   <= (others => '0');
        -- The oldest one was judged, or is judged now.
        if oldest_r /= judged_r or judge_r = JUDGING then
          state_r <= HEADING;
        end if;
      elsif state_r = HEADING then
        if keeps_r = '0' then
          finish;
        elsif moves = '1' then
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
        parts_r  <= '0';
        is_left  <= '0';
        read_r   <= (others => '0');
        oldest_r <= (others => '0');
      end if;
    end if;
  end process leave;

  m_axis_tvalid <= keeps_r when state_r /= IDLE else '0';
  m_axis_tlast  <= '1' when (state_r = SENDING and left_r = 1)
                            or (state_r = HEADING and place_r = HEAD_BYTES-1 and left_r = 0) else
                   '0';
  m_axis_tdata  <= whole_data when state_r = SENDING and parts_r = '1' else
                   payload_r when state_r = SENDING else
                   std_logic_vector(resize(host_id_r, 8)) when place_r = 0 else
                   std_logic_vector(size_r(7 downto 0)) when place_r = 1 else
                   std_logic_vector(size_r(15 downto 8)) when place_r = 2 else
                   x"00";

  -- ------------------------------------------------------------------ writers

  choose_keys : for entry in 0 to SOURCES-1 generate
    writes(entry) <= key_write when chosen = entry else '0';
  end generate choose_keys;

  note_writer : process (clk)
  begin
    if rising_edge(clk) then
      if note_write = '1' then
        ids(to_integer(chosen)) <= unsigned(write_data(ID_BITS-1 downto 0));
        if write_data(7) = '1' then
          marks(to_integer(chosen)) <= marks(to_integer(chosen)) + 1;
        end if;
        for entry in sources_r'range loop
          if chosen = entry then
            sources_r(entry)  <= write_data(7);
            reliable_r(entry) <= write_data(6);
          end if;
        end loop;
      end if;
      if rst_n = '0' then
        sources_r <= (others => '0');
      end if;
    end if;
  end process note_writer;

end architecture rtl;
