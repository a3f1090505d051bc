-- SPDX-License-Identifier: Apache-2.0
-- Assembles a sample from fragments of RTPS (OMG DDSI-RTPS 2.5, section 8.3.8.3): one sample at a time.
--
-- Fragments of one writer must arrive in order, as sent by hosts and preserved by Ethernet. The state of a sample is
-- therefore just the number of its next fragment; after a lost fragment, the following ones are requested again.
-- Meanwhile, fragments of another sample are dropped. A sample that its reader no longer wants is replaced by its
-- successor; a sample without new fragments for a while is dropped.
--
-- A fragment is accepted when its submessage ends with a complete fragment, and its packet is good. Until then, its
-- bytes follow the accepted ones, where they can be overwritten.
--
-- A DATA without room in the queue of payloads is also a sample. Since this is known only at its end, each DATA uses
-- the assembly if it is free, and releases it if there was room. It also replaces an older sample of its writer, which
-- will receive no more fragments.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_rtps_pkg.all;

entity firm_rtps_assembly is
  generic (
    BYTES       : integer := 4096; -- of the longest sample, a power of two, 1024 to 65536; of these, 65535 are used
    SOURCE_BITS : integer := 3;    -- of the number of a writer
    TICKS       : integer := 1000  -- without a fragment, after which a sample is dropped, 1 to 65535
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

    -- Of the submessage that arrives, from the first byte of its payload on.
    is_wanted : in std_logic;  -- it is a sample for a reader of the node
    -- At least from one cycle later on; of a fragment, from its first byte on.
    is_next   : in std_logic;  -- the reader accepts a sample with this number
    is_new    : in std_logic;  -- it has not accepted this sample or a later one
    source    : in unsigned(SOURCE_BITS-1 downto 0);
    number    : in std_logic_vector(47 downto 0);

    -- One cycle after a submessage, and after the last one of a packet, which is ignored if it is broken.
    submessage  : in  std_logic;
    ends        : in  std_logic;
    spoils      : in  std_logic;
    has_place   : in  std_logic;                      -- for a sample in the queue
    has_room    : in  std_logic;                      -- the payload also has room, and waits there
    is_complete : out std_logic;                      -- with `submessage`: it ends the sample
    is_long     : out std_logic;                      -- with `submessage`: it belongs to a sample that is too long
    is_dropped  : out std_logic;                      -- with `submessage`: it belongs to a sample without room
    size        : out std_logic_vector(15 downto 0);  -- of the sample that ends

    -- The sample leaves byte by byte from its first one; then there is room for another sample.
    is_sending : in  std_logic;
    moves      : in  std_logic;
    data       : out std_logic_vector(7 downto 0);
    is_left    : in  std_logic;
    is_whole   : out std_logic;                       -- until then

    -- The writer of this source is another one from now on.
    renews  : in std_logic;
    renewed : in unsigned(SOURCE_BITS-1 downto 0);

    -- The received part of the incomplete sample.
    is_open        : out std_logic;
    open_source    : out unsigned(SOURCE_BITS-1 downto 0);
    open_number    : out std_logic_vector(47 downto 0);
    next_fragment  : out std_logic_vector(15 downto 0);
    left_bytes     : out std_logic_vector(15 downto 0);
    fragment_bytes : out std_logic_vector(15 downto 0)
  );
end entity firm_rtps_assembly;

architecture rtl of firm_rtps_assembly is

  constant PLACE_BITS   : positive := max(1, clog2(BYTES));
  constant MOST_BYTES   : positive := 65536;
  -- In the field with the numbers of fragments and sizes.
  constant FIRST_PLACE  : natural  := RECORD_FRAGMENTS;
  constant COUNT_PLACE  : natural  := RECORD_FRAGMENTS+4;
  constant EACH_PLACE   : natural  := RECORD_FRAGMENTS+6;
  constant SIZE_PLACE   : natural  := RECORD_FRAGMENTS+8;

  subtype half_t is unsigned(15 downto 0);
  subtype place_t is unsigned(16 downto 0);
  -- The next byte, and the number of the next fragment.
  type spot_t is record
    place    : place_t;
    fragment : half_t;
  end record spot_t;
  constant BEGINNING : spot_t := ((others => '0'), to_unsigned(1, 16));

  type memory_t is array (natural range 0 to BYTES-1) of std_logic_vector(7 downto 0);
  signal memory : memory_t;

  -- ------------------------------------------------------------------ the fragment that arrives
  signal kind_r      : std_logic;                     -- it is one, and not of a key
  signal data_r      : std_logic;                     -- it is a payload of DATA
  signal other_r     : std_logic;                     -- the sample's number differs from that of the assembly
  signal compares_r  : std_logic;                     -- the last byte of a field is one of a size or of that number
  signal field_r     : std_logic_vector(7 downto 0) := (others => '0');
  signal wanted_r    : std_logic_vector(7 downto 0) := (others => '0');  -- the required value
  signal differs     : std_logic;                     -- a size differs, or the number of the next fragment
  signal differs_r   : std_logic;
  signal later_r     : std_logic;                     -- it is not the first one of its sample
  signal size_r      : half_t := (others => '0');
  signal high_r      : std_logic;                     -- the size has more than 16 bits
  signal each_r      : half_t := (others => '0');
  signal count_r     : half_t := (others => '0');
  signal fits        : std_logic;
  signal has_bytes   : std_logic;                     -- neither a size nor the number of fragments is zero
  signal has_parts_r : std_logic;                     -- except for that of the sample
  signal is_holder   : std_logic;                     -- its writer is that of the assembly
  signal is_same     : std_logic;                     -- and so is its sample
  signal is_free     : std_logic;                     -- the assembly is not whole
  signal continues   : std_logic;
  signal begins      : std_logic;
  signal inside_r    : std_logic;                     -- a byte of the payload has arrived
  signal is_first    : std_logic;                     -- this is the first one
  signal taken_r     : std_logic;                     -- its bytes are accepted
  signal closed_r    : std_logic;                     -- its sample, or the count of fragments, is full
  signal between_r   : std_logic;                     -- the bytes so far are whole fragments
  signal byte_r      : std_logic_vector(7 downto 0) := (others => '0');
  signal valid_r     : std_logic;
  signal continued   : std_logic;                     -- a byte of a sample that has begun
  signal writes      : std_logic;
  signal begins_r    : std_logic;                     -- this is the first byte of a fragment, and of its sample
  signal first_r     : std_logic;                     -- this is the first byte of DATA, and there may be room
  signal succeeds_r  : std_logic;                     -- if its sample takes the place of an older one
  signal takes       : std_logic;                     -- its bytes are taken from this one on
  signal taken       : std_logic;                     -- the bytes so far are taken
  signal came_r      : place_t := (others => '0');    -- bytes of the payload
  signal over_r      : std_logic;                     -- these are too many
  signal is_placed   : std_logic;                     -- a DATA that ends is the sample, if there is a place for it
  signal ends_part   : std_logic;                     -- this is the last byte of a fragment
  signal is_end      : std_logic;                     -- the sample is complete
  -- Remaining bytes of the fragment, fragments, and bytes of the sample; and whether one or none remains.
  signal part_r      : half_t := (others => '0');
  signal parts_r     : half_t := (others => '0');
  signal left_r      : half_t := (others => '0');
  signal one_part_r  : std_logic;
  signal one_parts_r : std_logic;
  signal one_left_r  : std_logic;
  signal none_left_r : std_logic;
  -- The same before the first byte.
  signal rest_r      : half_t := (others => '0');
  signal one_each_r  : std_logic;
  signal one_count_r : std_logic;
  signal one_rest_r  : std_logic;

  -- The end of a submessage or a packet; its effects follow one cycle later.
  signal keeps       : std_logic;                     -- its bytes are accepted
  signal completes   : std_logic;                     -- the sample is complete, and has a place
  signal keeps_r     : std_logic;
  signal completes_r : std_logic;
  signal fails_r     : std_logic;                     -- the sample is dropped
  signal ends_r      : std_logic;
  signal spoils_r    : std_logic;

  -- ------------------------------------------------------------------ the sample
  signal used_r   : std_logic;
  signal began_r  : std_logic;                        -- in this packet
  signal ended_r  : std_logic;                        -- in this packet
  signal whole_r  : std_logic;
  signal fed_r    : std_logic;                        -- it received a fragment in this packet
  signal source_r : unsigned(SOURCE_BITS-1 downto 0) := (others => '0');
  signal number_r : std_logic_vector(47 downto 0) := (others => '0');
  signal bytes_r  : half_t := (others => '0');
  signal length_r : half_t := (others => '0');        -- of each fragment
  signal spot_r   : spot_t := BEGINNING;              -- of the received bytes
  signal counts_r : spot_t := BEGINNING;              -- with the last submessage
  signal kept_r   : spot_t := BEGINNING;              -- with the last packet
  signal age_r    : natural range 0 to 65535;

  signal read_r : unsigned(PLACE_BITS-1 downto 0) := (others => '0');
  signal read   : unsigned(PLACE_BITS-1 downto 0);

  function equals(value : half_t; other : natural) return std_logic is
  begin
    if value = other then
      return '1';
    end if;
    return '0';
  end function equals;

  -- A byte of a number, the lowest at place 0.
  function byte_of(value : unsigned; place : natural) return std_logic_vector is
  begin
    return std_logic_vector(value(8*place+7 downto 8*place));
  end function byte_of;

begin

  assert BYTES >= 1024 and BYTES <= MOST_BYTES and 2**clog2(BYTES) = BYTES
    report "firm_rtps_assembly: BYTES is " & integer'image(BYTES) & "; legal: powers of two, 1024 to 65536"
    severity failure;
  assert TICKS >= 1 and TICKS <= 65535
    report "firm_rtps_assembly: TICKS is " & integer'image(TICKS) & "; legal: 1 to 65535"
    severity failure;

  -- ------------------------------------------------------------------ the fields

  read_fields : process (clk)
  begin
    if rising_edge(clk) then
      field_r    <= field_data;
      compares_r <= '0';
      differs_r  <= differs;
      kind_r     <= '0';
      if kind = RTPS_DATA_FRAG then
        kind_r <= not flags(RTPS_FRAGMENT_KEY);
      end if;
      data_r <= '0';
      if kind = RTPS_DATA then
        data_r <= flags(RTPS_PAYLOAD);
      end if;
      if field_valid = '1' then
        if unsigned(field_address) = RECORD_KIND then
          other_r   <= '0';
          differs_r <= '0';
          later_r   <= '0';
          high_r    <= '0';
        end if;
        for place in 0 to 5 loop
          if unsigned(field_address) = RECORD_NUMBER+place and field_data /= byte_of(unsigned(number_r), place) then
            other_r <= '1';
          end if;
        end loop;
        for place in 0 to 1 loop
          if unsigned(field_address) = COUNT_PLACE+place then
            count_r(8*place+7 downto 8*place) <= unsigned(field_data);
          elsif unsigned(field_address) = EACH_PLACE+place then
            each_r(8*place+7 downto 8*place) <= unsigned(field_data);
          elsif unsigned(field_address) = SIZE_PLACE+place then
            size_r(8*place+7 downto 8*place) <= unsigned(field_data);
          end if;
        end loop;
        if is_in(field_address, SIZE_PLACE, 4) = '1' and field_address(1) = '1' and field_data /= x"00" then
          high_r <= '1';
        end if;
        if unsigned(field_address) = FIRST_PLACE and field_data /= x"01" then
          later_r <= '1';
        elsif is_in(field_address, FIRST_PLACE, 4) = '1' and field_address(1 downto 0) /= "00"
              and field_data /= x"00" then
          later_r <= '1';
        end if;
        wanted_r <= x"00";
        for place in 0 to 1 loop
          if unsigned(field_address) = FIRST_PLACE+place then
            wanted_r <= byte_of(counts_r.fragment, place);
          elsif unsigned(field_address) = EACH_PLACE+place then
            wanted_r <= byte_of(length_r, place);
          elsif unsigned(field_address) = SIZE_PLACE+place then
            wanted_r <= byte_of(bytes_r, place);
          end if;
        end loop;
        if is_in(field_address, RECORD_FRAGMENTS, 12) = '1' and unsigned(field_address) /= COUNT_PLACE
           and unsigned(field_address) /= COUNT_PLACE+1 then
          compares_r <= '1';
        end if;
      end if;
    end if;
  end process read_fields;

  differs   <= '1' when compares_r = '1' and field_r /= wanted_r else differs_r;
  fits      <= '1' when high_r = '0' and size_r <= BYTES else '0';
  has_bytes <= has_parts_r when size_r /= 0 else '0';
  is_holder <= '1' when source = source_r else '0';
  is_free   <= not (whole_r or ended_r);
  is_same   <= used_r and is_holder and not other_r;
  continues <= is_free and is_same and has_bytes and not differs;
  begins    <= is_free and is_next and fits and has_bytes and not later_r and (not used_r or (is_holder and other_r));

  -- ------------------------------------------------------------------ the bytes

  -- The number of DATA may be compared one cycle after its payload begins.
  takes     <= first_r and (is_next or (is_new and not succeeds_r));
  taken     <= taken_r or takes;
  is_first  <= payload_valid and not inside_r;
  continued <= valid_r and taken_r and not closed_r;
  writes    <= continued or takes;
  ends_part <= kind_r and continued and (one_part_r or one_left_r);
  is_end    <= kind_r and ((continued and one_left_r) or (taken_r and none_left_r and between_r));
  is_placed <= data_r and taken and not has_room and not over_r;

  -- These numbers are complete at least four cycles before the first byte.
  look_ahead : process (clk)
  begin
    if rising_edge(clk) then
      rest_r      <= bytes_r - counts_r.place(15 downto 0);
      one_each_r  <= equals(each_r, 1);
      one_count_r <= equals(count_r, 1);
      one_rest_r  <= equals(rest_r, 1);
      has_parts_r <= not (equals(each_r, 0) or equals(count_r, 0));
    end if;
  end process look_ahead;

  count_bytes : process (clk)
  begin
    if rising_edge(clk) then
      came_r <= came_r + 1;
      if payload_valid = '0' then
        came_r <= came_r;
      elsif came_r(PLACE_BITS) = '1' then
        over_r <= '1';
      end if;
      if writes = '1' then
        between_r   <= ends_part;
        closed_r    <= kind_r and (one_left_r or (one_part_r and one_parts_r));
        none_left_r <= one_left_r;
        one_left_r  <= equals(left_r, 2);
        one_part_r  <= equals(part_r, 2);
        left_r      <= left_r - 1;
        part_r      <= part_r - 1;
        if ends_part = '1' then
          one_part_r  <= one_each_r;
          one_parts_r <= equals(parts_r, 2);
          part_r      <= each_r;
          parts_r     <= parts_r - 1;
        end if;
      elsif inside_r = '0' then
        between_r   <= '1';
        closed_r    <= '0';
        none_left_r <= '0';
        one_left_r  <= one_rest_r;
        one_part_r  <= one_each_r;
        one_parts_r <= one_count_r;
        left_r      <= rest_r;
        part_r      <= each_r;
        parts_r     <= count_r;
        -- If the bytes are accepted, they begin a sample.
        if is_same = '0' then
          one_left_r <= equals(size_r, 1);
          left_r     <= size_r;
        end if;
      end if;
      if is_first = '1' then
        came_r <= to_unsigned(1, 17);
        over_r <= '0';
      end if;
    end if;
  end process count_bytes;

  keeps     <= submessage and taken and (data_r or ends_part or (between_r and not writes));
  completes <= submessage and has_place and (is_placed or is_end);

  note_ends : process (clk)
  begin
    if rising_edge(clk) then
      keeps_r     <= keeps;
      completes_r <= completes;
      fails_r     <= keeps and not completes and (data_r or is_end);
      ends_r      <= ends;
      spoils_r    <= spoils;
      if rst_n = '0' then
        keeps_r <= '0';
        fails_r <= '0';
        ends_r  <= '0';
      end if;
    end if;
  end process note_ends;

  write_byte : process (clk)
  begin
    if rising_edge(clk) then
      if writes = '1' then
        memory(to_integer(spot_r.place(PLACE_BITS-1 downto 0))) <= byte_r;
      end if;
      data <= memory(to_integer(read));
    end if;
  end process write_byte;

  read <= (others => '0') when is_sending = '0' else
          read_r + 1 when moves = '1' else
          read_r;

  take_fragment : process (clk)
    variable counts : spot_t;
    variable gives  : std_logic;  -- the sample is dropped
    variable used   : std_logic;
    variable began  : std_logic;
    variable fed    : std_logic;
    variable ended  : std_logic;
  begin
    if rising_edge(clk) then
      read_r  <= read;
      byte_r  <= payload_data;
      valid_r <= payload_valid;
      counts  := counts_r;
      used    := used_r;
      began   := began_r;
      fed     := fed_r;
      ended   := ended_r;
      gives   := '0';
      taken_r <= taken;

      -- A byte.
      if writes = '1' then
        spot_r.place <= spot_r.place + 1;
        if ends_part = '1' then
          spot_r.fragment <= spot_r.fragment + 1;
        end if;
      end if;

      -- The end of a submessage.
      if submessage = '1' or ends = '1' then
        taken_r  <= '0';
        inside_r <= '0';
      end if;
      if keeps_r = '1' then
        counts := spot_r;
        fed    := '1';
        ended  := completes_r;
        gives  := fails_r;
      end if;

      -- A complete sample is known to belong to the previous writer.
      if renews = '1' and renewed = source_r and whole_r = '0' then
        began := began or ended or completes;
        gives := gives or not (ended or completes);
      end if;

      -- The end of a packet.
      if ends_r = '1' then
        if spoils_r = '1' then
          counts := kept_r;
          gives  := gives or began;
        elsif began = '1' and fed = '0' then
          -- The first fragment was cut.
          gives := '1';
        else
          whole_r <= whole_r or ended;
          if fed = '1' then
            age_r <= 0;
          end if;
        end if;
        kept_r <= counts;
        ended  := '0';
        began  := '0';
        fed    := '0';
      elsif tick = '1' and used_r = '1' and is_free = '1' then
        if age_r /= TICKS-1 then
          age_r <= age_r + 1;
        elsif (taken or began_r or fed_r or keeps_r or is_first) = '0' then
          gives := '1';
        end if;
      end if;
      if is_left = '1' then
        whole_r <= '0';
        gives   := '1';
      end if;

      -- The first byte of a payload.
      begins_r <= '0';
      first_r  <= '0';
      if is_first = '1' then
        inside_r   <= '1';
        taken_r    <= kind_r and is_wanted and (continues or begins);
        begins_r   <= kind_r and is_wanted and begins;
        first_r    <= data_r and is_wanted and is_free and (not used_r or (is_holder and other_r));
        succeeds_r <= used_r;
        spot_r     <= counts_r;
        if data_r = '1' or is_same = '0' then
          spot_r <= BEGINNING;
        end if;
      end if;
      if begins_r = '1' or takes = '1' then
        used     := '1';
        began    := '1';
        fed      := '0';
        source_r <= source;
        number_r <= number;
        bytes_r  <= size_r;
        length_r <= each_r;
        counts   := BEGINNING;
      end if;

      if gives = '1' then
        used    := '0';
        began   := '0';
        taken_r <= '0';
      end if;
      if used_r = '0' then
        age_r <= 0;
      end if;
      counts_r <= counts;
      used_r   <= used;
      began_r  <= began;
      fed_r    <= fed;
      ended_r  <= ended;
      if rst_n = '0' then
        valid_r  <= '0';
        inside_r <= '0';
        begins_r <= '0';
        first_r  <= '0';
        taken_r  <= '0';
        used_r   <= '0';
        began_r  <= '0';
        ended_r  <= '0';
        whole_r  <= '0';
        fed_r    <= '0';
        age_r    <= 0;
      end if;
    end if;
  end process take_fragment;

  is_complete <= submessage and (is_placed or is_end);
  is_long     <= submessage and ((kind_r and not fits) or (data_r and taken and over_r and not has_room));
  is_dropped  <= submessage and ((kind_r and is_next and fits and not (taken_r or is_same))
                                 or (data_r and is_new and not (taken or has_room)));
  size        <= std_logic_vector(came_r(15 downto 0)) when data_r = '1' else std_logic_vector(size_r);
  is_whole    <= whole_r;

  is_open        <= used_r and is_free and not began_r;
  open_source    <= source_r;
  open_number    <= number_r;
  next_fragment  <= std_logic_vector(kept_r.fragment);
  left_bytes     <= std_logic_vector(bytes_r - kept_r.place(15 downto 0));
  fragment_bytes <= std_logic_vector(length_r);

end architecture rtl;
