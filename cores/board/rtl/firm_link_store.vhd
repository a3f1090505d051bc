-- SPDX-License-Identifier: Apache-2.0
-- Stores each frame until its checksum is checked; no byte of a broken frame leaves. A frame is id, length (4 bytes,
-- lowest first), payload, and the CRC-32 of these; the checksum does not leave. The ring holds at least one frame of
-- LONGEST bytes of payload besides SPARE bytes, so a frame always finds room once the earlier ones have left. A longer
-- frame is not stored.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_link_store is
  generic (
    LONGEST : integer := 2000;  -- bytes of payload
    SPARE   : integer := 1
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Pulses of firm_cobs_decoder.
    data     : in std_logic_vector(7 downto 0);
    valid    : in std_logic;
    ends     : in std_logic;
    is_wrong : in std_logic;
    is_lost  : in std_logic;

    m_data  : out std_logic_vector(7 downto 0);
    m_last  : out std_logic;
    m_valid : out std_logic;
    m_ready : in  std_logic;

    room : out natural;  -- bytes that can still be stored

    -- Pulses at the end of each frame.
    is_good    : out std_logic;
    is_broken  : out std_logic;  -- code, length or checksum is wrong
    is_missing : out std_logic;  -- bytes were lost before, or found no room here
    is_refused : out std_logic  -- the frame is right, but longer than LONGEST
  );
end entity firm_link_store;

architecture rtl of firm_link_store is

  constant LENGTH_BYTES   : positive := 4;
  constant HEADER_BYTES   : positive := 1 + LENGTH_BYTES;
  constant CHECKSUM_BYTES : positive := 4;
  -- One place is never used, to distinguish a full ring from an empty one.
  constant PLACE_BITS     : positive := clog2(max(LONGEST, 1)+SPARE+HEADER_BYTES+1);
  constant LENGTH_BITS    : positive := clog2(max(LONGEST, 1)+1);

  subtype place_t is unsigned(PLACE_BITS-1 downto 0);
  subtype length_t is unsigned(8*LENGTH_BYTES-1 downto 0);

  type memory_t is array (natural range 0 to 2**PLACE_BITS-1) of std_logic_vector(8 downto 0);
  signal memory : memory_t;

  type part_t is (HEADER, PAYLOAD, CHECKSUM, COMPLETE, EXCESS);
  signal part_r   : part_t;
  signal count_r  : natural range 0 to HEADER_BYTES-1;  -- bytes of the header or the checksum so far
  signal length_r : length_t;                           -- the header's; then, in the low bits, what is still to come
  signal length   : length_t;                           -- the header's, with its last byte
  signal is_long  : std_logic;
  signal long_r   : std_logic;                          -- the frame is too long
  signal full_r   : std_logic;                          -- the ring had no room for it

  signal is_last  : std_logic;  -- the byte is the last of those that leave
  signal is_kept  : std_logic;  -- the byte belongs to those that leave
  signal has_room : std_logic;
  signal store    : std_logic;
  signal is_right : std_logic;
  signal clear    : std_logic;
  signal good     : std_logic;  -- the frame that ends is delivered

  -- Known in simulation before the first reset, for numeric_std would warn.
  signal start_r : place_t := (others => '0');  -- of the incoming frame; all bytes before it can leave
  signal write_r : place_t := (others => '0');
  signal read_r  : place_t := (others => '0');
  signal free    : place_t := (others => '0');
  signal fetch   : std_logic;
  signal word_r  : std_logic_vector(8 downto 0);
  signal valid_r : std_logic;

  -- Bytes that can leave lie between the read place and the incoming frame; writes are beyond.
  attribute syn_ramstyle of memory      : signal is "no_rw_check";
  attribute rw_addr_collision of memory : signal is "no";

begin

  assert LONGEST >= 1 and LONGEST <= 1048576
    report "firm_link_store: LONGEST is " & integer'image(LONGEST) & "; legal: 1 to 1048576"
    severity failure;
  assert SPARE >= 1
    report "firm_link_store: SPARE is " & integer'image(SPARE) & "; legal: 1 or more"
    severity failure;

  clear <= ends or not rst_n;

  u_crc : entity firm.firm_crc32
    port map (
      clk      => clk,
      clear    => clear,
      data     => data,
      valid    => valid,
      value    => open,
      is_right => is_right
    );

  length  <= unsigned(data) & length_r(length_r'high downto 8);
  is_long <= '1' when part_r = HEADER and count_r = HEADER_BYTES-1 and length > LONGEST else '0';

  is_last <= '1' when part_r = PAYLOAD and length_r(LENGTH_BITS-1 downto 0) = 1 else
             '1' when part_r = HEADER and count_r = HEADER_BYTES-1 and length = 0 else
             '0';

  is_kept  <= '1' when valid = '1' and (part_r = HEADER or part_r = PAYLOAD) else '0';
  free     <= read_r - write_r - 1;
  has_room <= '0' when free = 0 else '1';
  store    <= is_kept and has_room;

  divide : process (clk)

    procedure take_byte is
    begin
      if part_r = HEADER then
        length_r <= length;
        if count_r /= HEADER_BYTES-1 then
          count_r <= count_r + 1;
        else
          count_r <= 0;
          part_r  <= PAYLOAD;
          if is_last = '1' then
            part_r <= CHECKSUM;
          elsif is_long = '1' then
            part_r <= EXCESS;
            long_r <= '1';
          end if;
        end if;
      elsif part_r = PAYLOAD then
        length_r(LENGTH_BITS-1 downto 0) <= length_r(LENGTH_BITS-1 downto 0) - 1;
        if is_last = '1' then
          part_r <= CHECKSUM;
        end if;
      elsif part_r = CHECKSUM then
        count_r <= count_r + 1;
        if count_r = CHECKSUM_BYTES-1 then
          part_r <= COMPLETE;
        end if;
      else
        part_r <= EXCESS;
      end if;
      if is_kept = '1' and has_room = '0' then
        part_r <= EXCESS;
        full_r <= '1';
      end if;
    end procedure take_byte;

  begin
    if rising_edge(clk) then
      if valid = '1' then
        take_byte;
      end if;
      if clear = '1' then
        part_r  <= HEADER;
        count_r <= 0;
        long_r  <= '0';
        full_r  <= '0';
      end if;
    end if;
  end process divide;

  good <= is_right and not is_wrong and not is_lost when part_r = COMPLETE else '0';

  -- With a wrong checksum, the length may be wrong, too, so the checksum is checked first.
  judge : process (clk)
  begin
    if rising_edge(clk) then
      is_good    <= '0';
      is_broken  <= '0';
      is_missing <= '0';
      is_refused <= '0';
      if rst_n = '0' or ends = '0' then
        null;
      elsif is_lost = '1' then
        is_missing <= '1';
      elsif is_wrong = '1' or is_right = '0' then
        is_broken <= '1';
      elsif long_r = '1' then
        is_refused <= '1';
      elsif full_r = '1' then
        is_missing <= '1';
      else
        is_good   <= good;
        is_broken <= not good;
      end if;
    end if;
  end process judge;

  fetch <= '1' when read_r /= start_r and (m_ready = '1' or valid_r = '0') else '0';

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if store = '1' then
        memory(to_integer(write_r)) <= is_last & data;
      end if;
      if fetch = '1' then
        word_r <= memory(to_integer(read_r));
      end if;
    end if;
  end process access_memory;

  move : process (clk)
  begin
    if rising_edge(clk) then
      if store = '1' then
        write_r <= write_r + 1;
      elsif ends = '1' and good = '1' then
        start_r <= write_r;
      elsif ends = '1' then
        write_r <= start_r;
      end if;
      if fetch = '1' then
        read_r <= read_r + 1;
      end if;
      valid_r <= fetch or (valid_r and not m_ready);
      if rst_n = '0' then
        start_r <= (others => '0');
        write_r <= (others => '0');
        read_r  <= (others => '0');
        valid_r <= '0';
      end if;
    end if;
  end process move;

  m_data  <= word_r(7 downto 0);
  m_last  <= word_r(8);
  m_valid <= valid_r;
  room    <= to_integer(free);

end architecture rtl;
