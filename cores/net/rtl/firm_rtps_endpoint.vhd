-- SPDX-License-Identifier: Apache-2.0
-- Reads how a peer announces a writer or a reader (SEDP), and tells which of the node's endpoints of the other kind
-- match it: those with the same topic, type and hash of the type, if what the writer offers is enough for the reader.
--
-- Of several parameters with the same id, the first one counts, as in the reference participant
-- (tests/fabric/participant.py).
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_endpoint is
  generic (
    READERS : integer := 1; -- of the node, 0 to 8
    WRITERS : integer := 1  -- of the node, 1 to 9
  );
  port (
    clk : in std_logic;

    -- Words of firm_rtps_inbox, each of them once, and the parameters in them.
    s_valid   : in std_logic;
    has_field : in std_logic;
    address   : in std_logic_vector(RECORD_BITS-1 downto 0);
    data      : in std_logic_vector(7 downto 0);
    begins    : in std_logic;
    is_value  : in std_logic;
    id        : in std_logic_vector(15 downto 0);
    size      : in std_logic_vector(15 downto 0);
    place     : in std_logic_vector(15 downto 0);
    is_little : in std_logic;
    is_last   : in std_logic;
    is_reader : in std_logic;  -- the peer announces a reader; constant from the payload's first byte on

    -- Of the node's endpoints, of which the readers are the first ones.
    are_reliable  : in std_logic_vector(READERS+WRITERS-1 downto 0);
    are_transient : in std_logic_vector(READERS+WRITERS-1 downto 0);

    -- A memory that fusesoc_firm.fabric.names makes: a byte for each endpoint, one cycle after the address.
    names_address : out std_logic_vector(9 downto 0);
    names_data    : in  std_logic_vector(8*(READERS+WRITERS)-1 downto 0);

    -- From three cycles after the last word on.
    matches      : out std_logic_vector(READERS+WRITERS-1 downto 0);
    differs      : out std_logic;  -- a topic of the node's in another type, hash, quality, partition or encoding
    is_known     : out std_logic;  -- the GUID was told, and is one of the sender
    is_reliable  : out std_logic;  -- the peer's endpoint
    is_transient : out std_logic;
    entity_id    : out std_logic_vector(31 downto 0)  -- the first byte on the line highest
  );
end entity firm_rtps_endpoint;

architecture rtl of firm_rtps_endpoint is

  constant MOST_READERS : positive := 8;
  constant MOST_WRITERS : positive := 9;
  constant ENDPOINTS    : positive := READERS+WRITERS;
  constant PREFIX_BYTES : positive := 12;
  constant GUID_BYTES   : positive := 16;
  constant WORD_BYTES   : positive := 4;
  constant RELIABLE     : positive := 2;
  -- Parts of the memory of names.
  constant TOPICS : std_logic_vector(1 downto 0) := "00";
  constant TYPES  : std_logic_vector(1 downto 0) := "01";
  constant HASHES : std_logic_vector(1 downto 0) := "10";
  -- User data has parts that end with a semicolon. One is "typehash=", then the hash, which may be missing.
  constant SEMICOLON       : std_logic_vector(7 downto 0) := x"3b";
  constant HASH_NAME_BYTES : positive := 9;
  constant HASH_PART_BYTES : positive := 80;
  constant LAST_PLACE      : positive := 255;  -- of a part; a longer one stays there
  constant MOST_ENCODINGS  : positive := 16;

  subtype mask_t is std_logic_vector(ENDPOINTS-1 downto 0);
  constant NO_ENDPOINT : mask_t := (others => '0');
  type memory_t is array (natural range 0 to 15) of std_logic_vector(7 downto 0);

  -- Parameters that came before.
  signal seen_topic_r    : std_logic;
  signal seen_type_r     : std_logic;
  signal seen_reliable_r : std_logic;
  signal seen_durable_r  : std_logic;
  signal seen_parts_r    : std_logic;  -- a partition
  signal seen_user_r     : std_logic;
  signal seen_coding_r   : std_logic;
  signal seen_guid_r     : std_logic;

  -- ------------------------------------------------------------------ a byte of a value
  signal comes      : std_logic;
  signal at         : unsigned(15 downto 0);
  signal byte_place : unsigned(1 downto 0);           -- in a word, if it were little-endian
  signal past       : unsigned(15 downto 0);          -- bytes of the value up to this one, without its first word
  signal inside     : std_logic;                      -- the byte is one of those that the first word counts
  signal number_r   : unsigned(15 downto 0) := (others => '0');  -- the first word: a length or a number
  signal beyond_r   : std_logic;                      -- it is larger
  signal part_r     : unsigned(7 downto 0) := (others => '0');   -- the place in a part of the user data
  signal is_hash    : std_logic;
  signal zero_r     : std_logic;                      -- the byte before this one was zero
  signal found_r    : std_logic;                      -- one of the encodings is XCDR version 1

  -- ------------------------------------------------------------------ one cycle later
  signal value_r    : std_logic_vector(7 downto 0) := (others => '0');
  signal checks_r   : std_logic;  -- it is compared with names
  signal first_r    : std_logic;  -- it is the first one of what is compared
  signal part_ends  : std_logic;
  signal ends_r     : std_logic;  -- it is the last one of its value
  signal hash_r     : std_logic;  -- it is one of a part of the user data
  signal stop_r     : std_logic;  -- a part of the user data ends with it
  signal before_r   : unsigned(7 downto 0) := (others => '0');  -- bytes of that part before it
  signal fits       : std_logic;
  signal count      : unsigned(4 downto 0);  -- of encodings that are looked at
  signal room       : std_logic;  -- the value has as many
  signal part_bytes : unsigned(7 downto 0);  -- of a part that ends
  signal equal      : mask_t;
  signal mask       : mask_t;
  signal mask_r     : mask_t;

  signal topics_r    : mask_t;
  signal types_r     : mask_t;
  signal hashes_r    : mask_t;
  signal has_hash_r  : std_logic;
  signal named_r     : std_logic;  -- the part is that of the hash
  signal given_r     : std_logic := '0';  -- its reliability was told
  signal reliable_r  : std_logic := '0';
  signal offers      : std_logic;
  signal transient_r : std_logic := '0';
  signal divided_r   : std_logic;  -- it is in a partition
  signal encodes_r   : std_logic;

  -- ------------------------------------------------------------------ its GUID
  signal source_memory : memory_t;
  signal guid_valid    : std_logic;
  signal guid_at       : unsigned(3 downto 0);
  signal source_place  : unsigned(3 downto 0);
  signal source_byte   : std_logic_vector(7 downto 0);
  signal entity_r      : std_logic_vector(31 downto 0) := (others => '0');
  signal same_r        : std_logic := '0';
  signal whole_r       : std_logic := '0';

begin

  assert READERS >= 0 and READERS <= MOST_READERS
    report "firm_rtps_endpoint: READERS is " & integer'image(READERS) & "; legal: 0 to " & integer'image(MOST_READERS)
    severity failure;
  assert WRITERS >= 1 and WRITERS <= MOST_WRITERS
    report "firm_rtps_endpoint: WRITERS is " & integer'image(WRITERS) & "; legal: 1 to " & integer'image(MOST_WRITERS)
    severity failure;

  comes      <= s_valid and is_value;
  at         <= unsigned(place);
  byte_place <= at(1 downto 0) when is_little = '1' else not at(1 downto 0);
  past       <= at - (WORD_BYTES-1);
  inside     <= '1' when at >= WORD_BYTES and (past <= number_r or beyond_r = '1') else '0';
  is_hash    <= '1' when id = RTPS_USER_DATA else '0';

  choose_name : process (id, at, byte_place, part_r)
  begin
    if id = RTPS_USER_DATA then
      names_address <= HASHES & std_logic_vector(part_r);
    else
      names_address <= TYPES & std_logic_vector(at(7 downto 0));
      if id = RTPS_TOPIC_NAME then
        names_address(9 downto 8) <= TOPICS;
      end if;
      if at < WORD_BYTES then
        names_address(1 downto 0) <= std_logic_vector(byte_place);
      end if;
    end if;
  end process choose_name;

  part_ends <= '1' when data = SEMICOLON or past = number_r else '0';

  read_value : process (clk)
  begin
    if rising_edge(clk) then
      value_r  <= data;
      ends_r   <= comes and is_last;
      first_r  <= '0';
      checks_r <= '0';
      hash_r   <= '0';
      stop_r   <= '0';
      before_r <= part_r;
      if comes = '1' then
        if is_hash = '1' then
          if at = 0 then
            part_r <= (others => '0');
          elsif inside = '1' then
            hash_r   <= '1';
            checks_r <= '1';
            stop_r   <= part_ends;
            if part_r = 0 then
              first_r <= '1';
            end if;
            if part_ends = '1' then
              part_r <= (others => '0');
            elsif part_r /= LAST_PLACE then
              part_r <= part_r + 1;
            end if;
          end if;
        elsif at < WORD_BYTES or inside = '1' then
          checks_r <= '1';
          if at = 0 then
            first_r <= '1';
          end if;
        end if;
        if at < WORD_BYTES then
          if byte_place = 0 then
            number_r(7 downto 0) <= unsigned(data);
          elsif byte_place = 1 then
            number_r(15 downto 8) <= unsigned(data);
          elsif data /= x"00" then
            beyond_r <= '1';
          end if;
          if at = 0 and (data = x"00" or is_little = '1') then
            beyond_r <= '0';
          end if;
        end if;
        zero_r <= '0';
        if data = x"00" then
          zero_r <= '1';
        end if;
        if at = 0 then
          found_r <= '0';
        elsif at(0) = '1' and (past(15 downto 1) <= number_r or beyond_r = '1') and past(15 downto 1) <= MOST_ENCODINGS
              and at > WORD_BYTES and zero_r = '1' and data = x"00" then
          found_r <= '1';
        end if;
      end if;
    end if;
  end process read_value;

  -- ------------------------------------------------------------------ what it was

  fits <= '0' when unsigned(size) < WORD_BYTES or beyond_r = '1' else
          '1' when number_r <= unsigned(size) - WORD_BYTES else
          '0';

  count <= to_unsigned(MOST_ENCODINGS, 5) when beyond_r = '1' or number_r > MOST_ENCODINGS else number_r(4 downto 0);
  room  <= '1' when (count & '0') <= unsigned(size) - WORD_BYTES else '0';

  part_bytes <= before_r when value_r = SEMICOLON else before_r + 1;

  compare : for index in 0 to ENDPOINTS-1 generate
    equal(index) <= '1' when names_data(8*index+7 downto 8*index) = value_r else '0';
  end generate compare;

  mask <= mask_r when checks_r = '0' else
          equal when first_r = '1' else
          mask_r and equal;

  note_value : process (clk)
  begin
    if rising_edge(clk) then
      mask_r <= mask;
      if hash_r = '1' then
        -- The part begins with "typehash=", which is the same for all endpoints.
        if before_r = HASH_NAME_BYTES-1 then
          named_r <= mask(0);
        end if;
        if stop_r = '1' and seen_user_r = '0' and has_hash_r = '0' and named_r = '1' then
          has_hash_r <= '1';
          hashes_r   <= (others => '0');
          if part_bytes = HASH_PART_BYTES then
            hashes_r <= mask;
          elsif part_bytes = HASH_NAME_BYTES then
            -- No hash is told.
            hashes_r <= (others => '1');
          end if;
        end if;
        if stop_r = '1' then
          named_r <= '0';
        end if;
      end if;
      if ends_r = '1' then
        if id = RTPS_TOPIC_NAME then
          seen_topic_r <= '1';
          if seen_topic_r = '0' and fits = '1' then
            topics_r <= mask;
          end if;
        elsif id = RTPS_TYPE_NAME then
          seen_type_r <= '1';
          if seen_type_r = '0' and fits = '1' then
            types_r <= mask;
          end if;
        elsif id = RTPS_USER_DATA then
          seen_user_r <= '1';
          if seen_user_r = '0' and fits = '0' then
            has_hash_r <= '0';
          end if;
        elsif id = RTPS_RELIABILITY then
          seen_reliable_r <= '1';
          if seen_reliable_r = '0' and unsigned(size) >= WORD_BYTES then
            given_r    <= '1';
            reliable_r <= '0';
            if beyond_r = '0' and number_r = RELIABLE then
              reliable_r <= '1';
            end if;
          end if;
        elsif id = RTPS_DURABILITY then
          seen_durable_r <= '1';
          if seen_durable_r = '0' and unsigned(size) >= WORD_BYTES then
            transient_r <= beyond_r;
            if number_r /= 0 then
              transient_r <= '1';
            end if;
          end if;
        elsif id = RTPS_PARTITION then
          seen_parts_r <= '1';
          if seen_parts_r = '0' and unsigned(size) >= WORD_BYTES and (beyond_r = '1' or number_r /= 0) then
            divided_r <= '1';
          end if;
        elsif id = RTPS_REPRESENTATION then
          seen_coding_r <= '1';
          if seen_coding_r = '0' and unsigned(size) >= WORD_BYTES and room = '1'
             and (beyond_r = '1' or number_r /= 0) then
            encodes_r <= found_r;
          end if;
        elsif id = RTPS_ENDPOINT_GUID then
          seen_guid_r <= '1';
        end if;
      end if;
      if begins = '1' then
        seen_topic_r    <= '0';
        seen_type_r     <= '0';
        seen_user_r     <= '0';
        seen_reliable_r <= '0';
        seen_durable_r  <= '0';
        seen_parts_r    <= '0';
        seen_coding_r   <= '0';
        seen_guid_r     <= '0';
        topics_r        <= (others => '0');
        types_r         <= (others => '0');
        has_hash_r      <= '0';
        named_r         <= '0';
        given_r         <= '0';
        transient_r     <= '0';
        divided_r       <= '0';
        encodes_r       <= '1';
      end if;
    end if;
  end process note_value;

  -- Each kind of endpoint has a default of its own.
  offers <= reliable_r when given_r = '1' else not is_reader;

  tell : process (topics_r, types_r, hashes_r, has_hash_r, offers, transient_r, divided_r, encodes_r, is_reader,
                  are_reliable, are_transient)
    variable found     : mask_t;
    variable is_enough : boolean;
    variable towards   : mask_t;  -- the node's readers for a writer, and its writers for a reader
  begin
    found := topics_r and types_r;
    if has_hash_r = '1' then
      found := found and hashes_r;
    end if;
    if divided_r = '1' or encodes_r = '0' then
      found := (others => '0');
    end if;
    for index in found'range loop
      -- What is wanted has to be offered, by the peer's writer or by the node's.
      if index < READERS then
        towards(index) := not is_reader;
        is_enough := is_reader = '0' and (are_reliable(index) and not offers) = '0'
                     and (are_transient(index) and not transient_r) = '0';
      else
        towards(index) := is_reader;
        is_enough := is_reader = '1' and (offers and not are_reliable(index)) = '0'
                     and (transient_r and not are_transient(index)) = '0';
      end if;
      if not is_enough then
        found(index) := '0';
      end if;
    end loop;
    matches <= found;
    differs <= '0';
    if (topics_r and towards and not found) /= NO_ENDPOINT then
      differs <= '1';
    end if;
  end process tell;

  is_reliable  <= offers;
  is_transient <= transient_r;

  -- ------------------------------------------------------------------ its GUID

  guid_valid <= '1' when s_valid = '1' and has_field = '1' and unsigned(address) >= RECORD_KEY_HASH
                         and unsigned(address) < RECORD_KEY_HASH+GUID_BYTES else
                '1' when comes = '1' and id = RTPS_ENDPOINT_GUID and seen_guid_r = '0' else
                '0';
  guid_at    <= unsigned(address(3 downto 0)) when has_field = '1' else at(3 downto 0);

  source_place <= guid_at when guid_valid = '1' else (others => '0');
  source_byte  <= source_memory(to_integer(source_place));

  read_guid : process (clk)
  begin
    if rising_edge(clk) then
      if s_valid = '1' and has_field = '1' and unsigned(address) >= RECORD_SOURCE
         and unsigned(address) < RECORD_SOURCE+PREFIX_BYTES then
        source_memory(to_integer(unsigned(address(3 downto 0)))) <= data;
      end if;
      if guid_valid = '1' then
        if guid_at = 0 then
          whole_r <= '0';
          same_r  <= '1';
        elsif guid_at = GUID_BYTES-1 then
          whole_r <= '1';
        end if;
        if guid_at < PREFIX_BYTES then
          if source_byte /= data then
            same_r <= '0';
          end if;
        else
          entity_r <= entity_r(23 downto 0) & data;
        end if;
        if has_field = '0' and unsigned(size) /= GUID_BYTES then
          same_r <= '0';
        end if;
      end if;
      if begins = '1' then
        whole_r <= '0';
      end if;
    end if;
  end process read_guid;

  is_known  <= whole_r and same_r;
  entity_id <= entity_r;

end architecture rtl;
