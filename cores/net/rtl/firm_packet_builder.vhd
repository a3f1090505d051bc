-- SPDX-License-Identifier: Apache-2.0
-- Builds Ethernet frames with UDP datagrams from programs in a memory: constant bytes, bytes of fields that its user
-- wrote earlier, and one payload from a stream. Lengths and the checksum of IPv4 are computed; datagrams have no UDP
-- checksum (permitted by RFC 768). One byte leaves in every cycle.
--
-- A word of a program is one byte of the frame, or the payload: bit 10 marks the last one, bits 9 to 8 are the source,
-- and bits 7 to 0 the argument. A program begins with eight words that are not sent: the sum of the header's constant
-- words, the length of the packet without the payload, both with the high byte first, and the destination's address.
-- With HAS_OWN, four more follow, the address of this host, and bit 7 of a field's address selects a byte that this
-- host obtains at run time, such as one of its address.
--
-- With several banks of fields, a packet may be ready in one bank while others are written and sent.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_packet_builder is
  generic (
    ADDRESS_BITS : integer := 12; -- of the programs' memory
    BANK_BITS    : integer := 4;  -- of the number of a bank, 1 to 8
    HAS_OWN      : boolean := false
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- A packet begins if `start` is high and `is_busy` is low. The payload is padded to a multiple of four bytes. Its
    -- size, from three cycles after the start up to the end, is 0 if the program has no payload, and only then. If it
    -- is 0 with a payload, one byte is sent instead: the frame is wrong, but it has neither a pause nor 64 KiB.
    start         : in  std_logic;
    entry         : in  std_logic_vector(ADDRESS_BITS-1 downto 0);
    bank          : in  std_logic_vector(BANK_BITS-1 downto 0);
    payload_bytes : in  std_logic_vector(15 downto 0);
    is_busy       : out std_logic;

    -- Fields, written while `is_busy` is low.
    field_valid   : in std_logic;
    field_bank    : in std_logic_vector(BANK_BITS-1 downto 0);
    field_address : in std_logic_vector(6 downto 0);
    field_data    : in std_logic_vector(7 downto 0);

    -- With HAS_OWN: the number of a byte of this host, and the byte in the same cycle.
    own_select : out std_logic_vector(6 downto 0);
    own_byte   : in  std_logic_vector(7 downto 0) := x"00";

    -- The programs: a memory that shows the word one cycle after `program_enable`, and keeps it.
    program_enable  : out std_logic;
    program_address : out std_logic_vector(ADDRESS_BITS-1 downto 0);
    program_word    : in  std_logic_vector(10 downto 0);

    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tready : out std_logic;

    -- To firm_mac_transmitter; without a pause unless the payload pauses.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_packet_builder;

architecture rtl of firm_packet_builder is

  constant FIELD_BITS   : positive := 7;
  constant HEADER_BYTES : positive := 20;  -- of IPv4

  function prelude_words_of(is_longer : boolean) return positive is
  begin
    if is_longer then
      return 12;
    end if;
    return 8;
  end function prelude_words_of;

  constant PRELUDE_WORDS : positive := prelude_words_of(HAS_OWN);  -- that are not sent

  subtype source_t is std_logic_vector(1 downto 0);
  constant FROM_WORD    : source_t := "00";  -- the argument itself
  constant FROM_FIELD   : source_t := "01";  -- its address
  constant FROM_PAYLOAD : source_t := "10";
  -- Bits 2 to 1: which number; bit 0: which byte. If it is the length of a submessage, bits 7 to 3 are the words of
  -- four bytes before the payload.
  constant FROM_RESULT  : source_t := "11";

  -- No frame has 2048 bytes.
  constant NUMBER_BITS : positive := 11;
  subtype number_t is unsigned(NUMBER_BITS-1 downto 0);

  type fields_t is array (natural range 0 to 2**(BANK_BITS+FIELD_BITS)-1) of std_logic_vector(7 downto 0);
  signal fields : fields_t;

  signal busy_r    : std_logic;
  signal shown_r   : std_logic;  -- program_word is one of the packet
  signal address_r : unsigned(ADDRESS_BITS-1 downto 0) := (others => '0');
  signal bank_r    : std_logic_vector(BANK_BITS-1 downto 0) := (others => '0');
  signal shows     : unsigned(ADDRESS_BITS-1 downto 0);  -- the address of the next program_word
  signal begins    : std_logic;

  -- The first stage: the word of the program. The word after it is shown by the memory.
  signal word_r     : std_logic_vector(10 downto 0) := (others => '0');
  signal fetched_r  : std_logic;
  signal fetches    : std_logic;
  signal source     : source_t;
  signal argument   : std_logic_vector(7 downto 0);
  signal payload    : std_logic;  -- it is the payload
  signal bytes      : number_t;                                 -- of the payload
  signal real_r     : number_t := (others => '0');              -- the remaining ones of them
  signal spent_r    : std_logic;                                -- none remain
  signal single_r   : std_logic;                                -- at most one remains
  signal phase_r    : unsigned(1 downto 0) := (others => '0');  -- of the payload's byte in a group of four
  signal has_byte   : std_logic;
  signal moves      : std_logic;  -- a byte goes to the second stage
  signal is_final   : std_logic;  -- it is the word's last one
  signal data_bytes : number_t;   -- of the submessage
  signal result     : std_logic_vector(7 downto 0);

  -- The second stage: the byte.
  signal valid_r   : std_logic;
  signal final_r   : std_logic;  -- the last one of the frame
  signal chosen_r  : std_logic;  -- it is a field
  signal field_r   : std_logic_vector(7 downto 0);
  signal value_r   : std_logic_vector(7 downto 0);
  signal byte      : std_logic_vector(7 downto 0);
  signal prelude_r : natural range 0 to PRELUDE_WORDS-1;
  signal sent_r    : std_logic;  -- the prelude is over
  signal closes_r  : std_logic;  -- since this cycle

  -- The third stage: a byte of the prelude. The memory of fields outputs late, so the byte is added one cycle later.
  signal adds_r    : std_logic;
  signal added_r   : std_logic_vector(7 downto 0) := (others => '0');
  signal number_r  : natural range 0 to PRELUDE_WORDS-1;  -- of the word
  signal ends_r    : std_logic;                           -- the prelude was over before
  signal advance   : std_logic;

  -- Numbers of the packet.
  signal extra_r  : number_t := (others => '0');  -- bytes of the payload, with padding
  signal total_r  : number_t := (others => '0');  -- of the packet
  signal udp_r    : number_t := (others => '0');  -- of the datagram
  -- Its highest bit is a carry, which is added with the next word.
  signal sum_r    : unsigned(16 downto 0) := (others => '0');

  function high_byte(number : number_t) return std_logic_vector is
  begin
    return std_logic_vector(resize(number(NUMBER_BITS-1 downto 8), 8));
  end function high_byte;

  -- A packet's fields are not written while it is built. firm_axis_pkg tells about these attributes.
  attribute syn_ramstyle      : string;
  attribute rw_addr_collision : string;
  attribute syn_ramstyle of fields      : signal is "no_rw_check";
  attribute rw_addr_collision of fields : signal is "no";

begin

  assert ADDRESS_BITS >= 4 and ADDRESS_BITS <= 16
    report "firm_packet_builder: ADDRESS_BITS is " & integer'image(ADDRESS_BITS) & "; legal: 4 to 16"
    severity failure;
  assert BANK_BITS >= 1 and BANK_BITS <= 8
    report "firm_packet_builder: BANK_BITS is " & integer'image(BANK_BITS) & "; legal: 1 to 8"
    severity failure;

  is_busy <= busy_r;
  begins  <= start and not busy_r;

  -- ------------------------------------------------------------------ the word

  source   <= word_r(9 downto 8);
  argument <= word_r(7 downto 0);

  shows           <= unsigned(entry) when begins = '1' else address_r;
  program_address <= std_logic_vector(shows);
  program_enable  <= begins or fetches;

  payload  <= '1' when source = FROM_PAYLOAD else '0';
  has_byte <= s_axis_tvalid or spent_r or not payload;
  is_final <= '1' when payload = '0' or (single_r = '1' and phase_r = 3) else '0';
  advance  <= m_axis_tready or not (valid_r and sent_r);
  moves    <= advance and fetched_r and has_byte;
  fetches  <= '1' when shown_r = '1' and (fetched_r = '0' or (moves = '1' and is_final = '1')) else '0';

  s_axis_tready <= advance and fetched_r and payload and not spent_r;

  fetch : process (clk)
  begin
    if rising_edge(clk) then
      if begins = '1' then
        busy_r    <= '1';
        shown_r   <= '1';
        address_r <= shows + 1;
        bank_r    <= bank;
      elsif fetches = '1' then
        word_r    <= program_word;
        fetched_r <= '1';
        shown_r   <= not program_word(10);
        address_r <= shows + 1;
      elsif moves = '1' and is_final = '1' then
        fetched_r <= '0';
      end if;
      if valid_r = '1' and final_r = '1' and advance = '1' then
        busy_r <= '0';
      end if;
      if rst_n = '0' then
        busy_r    <= '0';
        shown_r   <= '0';
        fetched_r <= '0';
      end if;
    end if;
  end process fetch;

  bytes <= unsigned(payload_bytes(NUMBER_BITS-1 downto 0));

  count_payload : process (clk)
  begin
    if rising_edge(clk) then
      if sent_r = '0' then
        real_r   <= bytes;
        spent_r  <= '0';
        single_r <= '0';
        phase_r  <= "00";
        if bytes = 0 then
          -- One byte is sent.
          spent_r <= '1';
          phase_r <= "11";
        end if;
        if bytes(NUMBER_BITS-1 downto 1) = 0 then
          single_r <= '1';
        end if;
      elsif moves = '1' and payload = '1' then
        phase_r <= phase_r + 1;
        if spent_r = '0' then
          real_r <= real_r - 1;
        end if;
        if real_r = 2 then
          single_r <= '1';
        end if;
        spent_r <= single_r;
      end if;
    end if;
  end process count_payload;

  data_bytes <= extra_r + (unsigned(argument(7 downto 3)) & "00");

  result <= high_byte(total_r) when argument(2 downto 0) = "000" else
            std_logic_vector(total_r(7 downto 0)) when argument(2 downto 0) = "001" else
            high_byte(udp_r) when argument(2 downto 0) = "010" else
            std_logic_vector(udp_r(7 downto 0)) when argument(2 downto 0) = "011" else
            not std_logic_vector(sum_r(15 downto 8)) when argument(2 downto 0) = "100" else
            not std_logic_vector(sum_r(7 downto 0)) when argument(2 downto 0) = "101" else
            std_logic_vector(data_bytes(7 downto 0)) when argument(2 downto 0) = "110" else
            high_byte(data_bytes);

  -- ------------------------------------------------------------------ the byte

  own_select <= argument(FIELD_BITS-1 downto 0);

  access_fields : process (clk)
  begin
    if rising_edge(clk) then
      if field_valid = '1' then
        fields(to_integer(unsigned(field_bank) & unsigned(field_address))) <= field_data;
      end if;
      if moves = '1' then
        field_r <= fields(to_integer(unsigned(bank_r) & unsigned(argument(FIELD_BITS-1 downto 0))));
      end if;
    end if;
  end process access_fields;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        valid_r  <= moves;
        final_r  <= word_r(10) and is_final;
        chosen_r <= '0';
        value_r  <= argument;
        if HAS_OWN and source = FROM_FIELD and argument(FIELD_BITS) = '1' then
          value_r <= own_byte;
        elsif source = FROM_FIELD then
          chosen_r <= '1';
        elsif source = FROM_RESULT then
          value_r <= result;
        elsif source = FROM_PAYLOAD then
          value_r <= s_axis_tdata;
          if spent_r = '1' then
            value_r <= (others => '0');
          end if;
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process choose;

  byte <= field_r when chosen_r = '1' else value_r;

  m_axis_tdata  <= byte;
  m_axis_tvalid <= valid_r and sent_r;
  m_axis_tlast  <= final_r;

  -- ------------------------------------------------------------------ the numbers

  compute : process (clk)
    variable word  : unsigned(15 downto 0);
    variable carry : unsigned(0 downto 0);
  begin
    if rising_edge(clk) then
      word     := (others => '0');
      closes_r <= '0';
      if valid_r = '1' and sent_r = '0' then
        if prelude_r = PRELUDE_WORDS-1 then
          sent_r   <= '1';
          closes_r <= '1';
        else
          prelude_r <= prelude_r + 1;
        end if;
      end if;
      adds_r   <= valid_r and not sent_r;
      added_r  <= byte;
      number_r <= prelude_r;
      ends_r   <= closes_r;
      if adds_r = '1' then
        if number_r mod 2 = 0 then
          word(15 downto 8) := unsigned(added_r);
        else
          word(7 downto 0) := unsigned(added_r);
        end if;
        if number_r = 2 or number_r = 3 then
          total_r <= total_r(NUMBER_BITS-9 downto 0) & unsigned(added_r);
        end if;
      elsif ends_r = '1' then
        -- Long before its first use.
        total_r <= total_r + extra_r;
        word    := resize(extra_r, 16);
      end if;
      extra_r             <= bytes + 3;
      extra_r(1 downto 0) <= "00";
      udp_r               <= total_r - HEADER_BYTES;
      carry(0)            := sum_r(16);
      sum_r               <= resize(sum_r(15 downto 0), 17) + word + carry;
      if begins = '1' then
        prelude_r <= 0;
        sent_r    <= '0';
        sum_r     <= (others => '0');
      end if;
    end if;
  end process compute;

end architecture rtl;
