-- SPDX-License-Identifier: Apache-2.0
-- Reads a peer's announcement of a writer or a reader (SEDP), and finds the matching endpoints of the other kind in the
-- node: those with the same topic, type and type hash, if the writer's quality suffices for the reader.
--
-- Of several parameters with the same id, the first one is used, as in the reference participant
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

    -- A memory created by fusesoc_firm.fabric.names: a byte for each endpoint, one cycle after the address.
    names_address : out std_logic_vector(9 downto 0);
    names_data    : in  std_logic_vector(8*(READERS+WRITERS)-1 downto 0);

    -- From RTPS_JUDGED cycles after the last word on.
    matches      : out std_logic_vector(READERS+WRITERS-1 downto 0);
    differs      : out std_logic;  -- a topic of the node's in another type, hash, quality, partition or encoding
    is_known     : out std_logic;  -- the GUID is present, and belongs to the sender
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

  -- ------------------------------------------------------------------ a byte of a value
  signal comes      : std_logic;
  signal at         : unsigned(15 downto 0);
  signal byte_place : unsigned(1 downto 0);           -- in a word, if it were little-endian
  signal past_r     : unsigned(15 downto 0) := (others => '0');  -- its bytes up to this one, without the first word
  signal number_r   : unsigned(15 downto 0) := (others => '0');  -- the first word: a length or a number
  signal beyond_r   : std_logic;                      -- it is larger

  -- Parameters that are evaluated.
  constant OF_TOPIC    : natural := 0;
  constant OF_TYPE     : natural := 1;
  constant OF_USER     : natural := 2;
  constant OF_RELIABLE : natural := 3;
  constant OF_DURABLE  : natural := 4;
  constant OF_PARTS    : natural := 5;
  constant OF_CODING   : natural := 6;
  constant OF_GUID     : natural := 7;
  subtype ids_t is std_logic_vector(OF_GUID downto 0);

  -- ------------------------------------------------------------------ one cycle later
  signal comes_r  : std_logic;
  signal data_r   : std_logic_vector(7 downto 0) := (others => '0');
  signal at_r     : unsigned(15 downto 0) := (others => '0');
  signal last_r   : std_logic;
  signal place_r  : unsigned(1 downto 0) := (others => '0');
  signal of_r     : ids_t;  -- the parameter of the arriving byte
  signal of_2_r   : ids_t;  -- and this one
  signal over_r   : std_logic;  -- the byte follows those that the first word counts
  signal final_r  : std_logic;  -- it is the last one of them
  signal in_word  : std_logic;  -- it is in the first word
  signal inside   : std_logic;  -- it is one of them
  signal coding_r : std_logic;  -- it is one of the evaluated encodings
  signal part_r   : unsigned(7 downto 0) := (others => '0');  -- the place in a part of the user data
  signal is_hash  : std_logic;
  signal zero_r   : std_logic;  -- the previous byte was zero
  signal found_r  : std_logic;  -- one of the encodings is XCDR version 1

  -- ------------------------------------------------------------------ two cycles later, while its names are read
  signal read_value_r  : std_logic_vector(7 downto 0) := (others => '0');
  signal read_checks_r : std_logic;  -- it is compared with names
  signal read_first_r  : std_logic;  -- it is the first compared one
  signal part_ends     : std_logic;
  signal read_ends_r   : std_logic;  -- it is the last one of its value
  signal read_hash_r   : std_logic;  -- it is one of a part of the user data
  signal read_stop_r   : std_logic;  -- a part of the user data ends with it
  signal read_before_r : unsigned(7 downto 0) := (others => '0');  -- bytes of that part before it
  signal read_ids_r    : ids_t;      -- its parameter

  -- ------------------------------------------------------------------ three cycles later
  signal value_r    : std_logic_vector(7 downto 0) := (others => '0');
  signal names_r    : std_logic_vector(8*ENDPOINTS-1 downto 0) := (others => '0');
  signal begins_r   : std_logic_vector(2 downto 0);  -- before it; the youngest one lowest
  signal checks_r   : std_logic;
  signal first_r    : std_logic;
  signal ends_r     : std_logic;
  signal hash_r     : std_logic;
  signal stop_r     : std_logic;
  signal names_it_r : std_logic;     -- the part's name ends with the byte
  signal whole_it_r : std_logic;     -- the part has the length of a hash, if it ends with the byte
  signal bare_it_r  : std_logic;     -- it has the length of its name
  signal ids_r      : ids_t;
  signal seen_r     : ids_t;         -- earlier parameters
  signal is_new     : ids_t;
  signal coded_r    : std_logic;     -- found_r
  signal some_r     : std_logic;     -- the value has its first word
  signal counts_r   : std_logic;     -- which is not zero
  signal is_two_r   : std_logic;     -- which is RELIABLE
  signal fits_r     : std_logic;
  signal room_r     : std_logic;     -- the value has at least the evaluated encodings
  signal count      : unsigned(4 downto 0);
  signal part_bytes : unsigned(7 downto 0);  -- of a part that ends
  signal equal      : mask_t;
  signal mask       : mask_t;
  signal mask_r     : mask_t;

  signal topics_r    : mask_t;
  signal types_r     : mask_t;
  signal hashes_r    : mask_t;
  signal has_hash_r  : std_logic;
  signal named_r     : std_logic;  -- the part is that of the hash
  signal given_r     : std_logic := '0';  -- its reliability is present
  signal reliable_r  : std_logic := '0';
  signal offers      : std_logic;
  signal transient_r : std_logic := '0';
  signal divided_r   : std_logic;  -- it is in a partition
  signal encodes_r   : std_logic;

  -- ------------------------------------------------------------------ its GUID
  signal source_memory : memory_t;
  signal guid_r        : std_logic;
  signal guid_at_r     : unsigned(3 downto 0) := (others => '0');
  signal guid_wrong_r  : std_logic;  -- its parameter has another size
  signal source_byte   : std_logic_vector(7 downto 0);
  signal entity_r      : std_logic_vector(31 downto 0) := (others => '0');
  signal same_r        : std_logic := '0';
  signal whole_r       : std_logic := '0';

  -- The number of a parameter.
  function ids_of(name : std_logic_vector(15 downto 0)) return ids_t is
    variable found : ids_t := (others => '0');
  begin
    if name = RTPS_TOPIC_NAME then
      found(OF_TOPIC) := '1';
    end if;
    if name = RTPS_TYPE_NAME then
      found(OF_TYPE) := '1';
    end if;
    if name = RTPS_USER_DATA then
      found(OF_USER) := '1';
    end if;
    if name = RTPS_RELIABILITY then
      found(OF_RELIABLE) := '1';
    end if;
    if name = RTPS_DURABILITY then
      found(OF_DURABLE) := '1';
    end if;
    if name = RTPS_PARTITION then
      found(OF_PARTS) := '1';
    end if;
    if name = RTPS_DATA_REPRESENTATION then
      found(OF_CODING) := '1';
    end if;
    if name = RTPS_ENDPOINT_GUID then
      found(OF_GUID) := '1';
    end if;
    return found;
  end function ids_of;

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
  take_byte : process (clk)
  begin
    if rising_edge(clk) then
      comes_r  <= comes;
      data_r   <= data;
      at_r     <= at;
      last_r   <= is_last;
      place_r  <= byte_place;
      over_r   <= '0';
      final_r  <= '0';
      coding_r <= '0';
      if past_r > number_r and beyond_r = '0' then
        over_r <= '1';
      end if;
      if past_r = number_r then
        final_r <= '1';
      end if;
      if (past_r(15 downto 1) <= number_r or beyond_r = '1')
         and (past_r(15 downto 5) = 0 or past_r(15 downto 1) = MOST_ENCODINGS) then
        coding_r <= '1';
      end if;
      -- The id is valid before the first byte of the value.
      of_r   <= ids_of(id);
      of_2_r <= of_r;
      if comes = '1' then
        past_r <= at - (WORD_BYTES-2);
        if unsigned(place(15 downto 2)) = 0 then
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
      end if;
    end if;
  end process take_byte;

  inside  <= '1' when in_word = '0' and over_r = '0' else '0';
  in_word <= '1' when at_r(15 downto 2) = 0 else '0';
  is_hash <= of_2_r(OF_USER);

  choose_name : process (of_2_r, at_r, in_word, place_r, part_r)
  begin
    if of_2_r(OF_USER) = '1' then
      names_address <= HASHES & std_logic_vector(part_r);
    else
      names_address <= TYPES & std_logic_vector(at_r(7 downto 0));
      if of_2_r(OF_TOPIC) = '1' then
        names_address(9 downto 8) <= TOPICS;
      end if;
      if in_word = '1' then
        names_address(1 downto 0) <= std_logic_vector(place_r);
      end if;
    end if;
  end process choose_name;

  part_ends <= '1' when data_r = SEMICOLON or final_r = '1' else '0';

  read_value : process (clk)
  begin
    if rising_edge(clk) then
      read_value_r  <= data_r;
      read_ends_r   <= comes_r and last_r;
      read_first_r  <= '0';
      read_checks_r <= '0';
      read_hash_r   <= '0';
      read_stop_r   <= '0';
      read_before_r <= part_r;
      read_ids_r    <= of_2_r;
      if comes_r = '1' then
        if is_hash = '1' then
          if at_r = 0 then
            part_r <= (others => '0');
          elsif inside = '1' then
            read_hash_r   <= '1';
            read_checks_r <= '1';
            read_stop_r   <= part_ends;
            if part_r = 0 then
              read_first_r <= '1';
            end if;
            if part_ends = '1' then
              part_r <= (others => '0');
            elsif part_r /= LAST_PLACE then
              part_r <= part_r + 1;
            end if;
          end if;
        elsif in_word = '1' or inside = '1' then
          read_checks_r <= '1';
          if at_r = 0 then
            read_first_r <= '1';
          end if;
        end if;
        zero_r <= '0';
        if data_r = x"00" then
          zero_r <= '1';
        end if;
        if at_r = 0 then
          found_r <= '0';
        elsif at_r(0) = '1' and in_word = '0' and coding_r = '1' and zero_r = '1' and data_r = x"00" then
          found_r <= '1';
        end if;
      end if;
    end if;
  end process read_value;

  -- ------------------------------------------------------------------ what it was

  count <= to_unsigned(MOST_ENCODINGS, 5) when beyond_r = '1' or number_r(15 downto 4) /= 0 else number_r(4 downto 0);

  part_bytes <= read_before_r when read_value_r = SEMICOLON else read_before_r + 1;

  read_names : process (clk)
    variable after_word : unsigned(15 downto 0);
  begin
    if rising_edge(clk) then
      value_r    <= read_value_r;
      names_r    <= names_data;
      begins_r   <= begins_r(1 downto 0) & begins;
      checks_r   <= read_checks_r;
      first_r    <= read_first_r;
      ends_r     <= read_ends_r;
      hash_r     <= read_hash_r;
      stop_r     <= read_stop_r;
      ids_r      <= read_ids_r;
      names_it_r <= '0';
      if read_before_r = HASH_NAME_BYTES-1 then
        names_it_r <= '1';
      end if;
      whole_it_r <= '0';
      if part_bytes = HASH_PART_BYTES then
        whole_it_r <= '1';
      end if;
      bare_it_r <= '0';
      if part_bytes = HASH_NAME_BYTES then
        bare_it_r <= '1';
      end if;
      after_word := unsigned(size) - WORD_BYTES;
      coded_r    <= found_r;
      some_r     <= '0';
      if unsigned(size(15 downto 2)) /= 0 then
        some_r <= '1';
      end if;
      counts_r <= beyond_r;
      is_two_r <= '0';
      if number_r /= 0 then
        counts_r <= '1';
      end if;
      if beyond_r = '0' and number_r = RELIABLE then
        is_two_r <= '1';
      end if;
      fits_r <= '0';
      if beyond_r = '0' and number_r <= after_word then
        fits_r <= '1';
      end if;
      room_r <= '0';
      if (count & '0') <= after_word then
        room_r <= '1';
      end if;
    end if;
  end process read_names;

  compare : for index in 0 to ENDPOINTS-1 generate
    equal(index) <= '1' when names_r(8*index+7 downto 8*index) = value_r else '0';
  end generate compare;

  mask <= mask_r when checks_r = '0' else
          equal when first_r = '1' else
          mask_r and equal;

  is_new <= ids_r and not seen_r;

  note_value : process (clk)
  begin
    if rising_edge(clk) then
      mask_r <= mask;
      if hash_r = '1' then
        -- The part begins with "typehash=", which is the same for all endpoints.
        if names_it_r = '1' then
          named_r <= mask(0);
        end if;
        if stop_r = '1' and seen_r(OF_USER) = '0' and has_hash_r = '0' and named_r = '1' then
          has_hash_r <= '1';
          hashes_r   <= (others => '0');
          if whole_it_r = '1' then
            hashes_r <= mask;
          elsif bare_it_r = '1' then
            -- The hash is missing.
            hashes_r <= (others => '1');
          end if;
        end if;
        if stop_r = '1' then
          named_r <= '0';
        end if;
      end if;
      if ends_r = '1' then
        seen_r <= seen_r or ids_r;
        if is_new(OF_TOPIC) = '1' and some_r = '1' and fits_r = '1' then
          topics_r <= mask;
        end if;
        if is_new(OF_TYPE) = '1' and some_r = '1' and fits_r = '1' then
          types_r <= mask;
        end if;
        if is_new(OF_USER) = '1' and (some_r = '0' or fits_r = '0') then
          has_hash_r <= '0';
        end if;
        if is_new(OF_RELIABLE) = '1' and some_r = '1' then
          given_r    <= '1';
          reliable_r <= is_two_r;
        end if;
        if is_new(OF_DURABLE) = '1' and some_r = '1' then
          transient_r <= counts_r;
        end if;
        if is_new(OF_PARTS) = '1' and some_r = '1' and counts_r = '1' then
          divided_r <= '1';
        end if;
        if is_new(OF_CODING) = '1' and some_r = '1' and counts_r = '1' and room_r = '1' then
          encodes_r <= coded_r;
        end if;
      end if;
      if begins_r(2) = '1' then
        seen_r      <= (others => '0');
        topics_r    <= (others => '0');
        types_r     <= (others => '0');
        has_hash_r  <= '0';
        named_r     <= '0';
        given_r     <= '0';
        transient_r <= '0';
        divided_r   <= '0';
        encodes_r   <= '1';
      end if;
    end if;
  end process note_value;

  -- Each kind of endpoint has a separate default.
  offers <= reliable_r when given_r = '1' else not is_reader;

  tell : process (clk)
    variable found     : mask_t;
    variable is_enough : boolean;
    variable towards   : mask_t;  -- the node's readers for a writer, and its writers for a reader
  begin
    if rising_edge(clk) then
      found := topics_r and types_r;
      if has_hash_r = '1' then
        found := found and hashes_r;
      end if;
      if divided_r = '1' or encodes_r = '0' then
        found := (others => '0');
      end if;
      for index in found'range loop
        -- The writer, of the peer or of the node, must offer the requested quality.
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
    end if;
  end process tell;

  is_reliable  <= offers;
  is_transient <= transient_r;

  -- ------------------------------------------------------------------ its GUID

  choose_guid : process (clk)
  begin
    if rising_edge(clk) then
      guid_r       <= '0';
      guid_at_r    <= at(3 downto 0);
      guid_wrong_r <= '0';
      if has_field = '1' then
        guid_at_r <= unsigned(address(3 downto 0));
        if is_in(address, RECORD_KEY_HASH, GUID_BYTES) = '1' then
          guid_r <= s_valid;
        end if;
      else
        if of_r(OF_GUID) = '1' and seen_r(OF_GUID) = '0' then
          guid_r <= comes;
        end if;
        if unsigned(size) /= GUID_BYTES then
          guid_wrong_r <= '1';
        end if;
      end if;
    end if;
  end process choose_guid;

  source_byte <= source_memory(to_integer(guid_at_r));

  read_guid : process (clk)
  begin
    if rising_edge(clk) then
      if s_valid = '1' and has_field = '1' and is_in(address, RECORD_SOURCE, PREFIX_BYTES) = '1' then
        source_memory(to_integer(unsigned(address(3 downto 0)))) <= data;
      end if;
      if guid_r = '1' then
        if guid_at_r = 0 then
          whole_r <= '0';
          same_r  <= '1';
        elsif guid_at_r = GUID_BYTES-1 then
          whole_r <= '1';
        end if;
        if guid_at_r < PREFIX_BYTES then
          if source_byte /= data_r then
            same_r <= '0';
          end if;
        else
          entity_r <= entity_r(23 downto 0) & data_r;
        end if;
        if guid_wrong_r = '1' then
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
