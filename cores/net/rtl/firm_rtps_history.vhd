-- SPDX-License-Identifier: Apache-2.0
-- Stores the last samples of a node's writers: writes each frame `id | length | payload` to a slot of its writer, and
-- sends the payload of a slot to firm_packet_builder whenever requested. The program of firm_rtps_sequencer assigns
-- slots to writers, and selects the slot of each writer's next sample. The slot after the last one cannot be requested,
-- so that a sample can arrive while another one leaves. Samples of more than 1344 bytes leave in fragments, which the
-- program selects.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_rtps_pkg.all;

entity firm_rtps_history is
  generic (
    WRITERS : integer := 1;  -- that send frames, 1 to 8
    SAMPLE  : integer := 64; -- bytes of a slot, a power of two, 2 to 65536
    SLOTS   : integer := 16  -- a power of two, 2 to 256; SAMPLE*SLOTS is at most 1048576
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Frames; the id is the number of the writer.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- The slot of the next sample of a writer.
    slot_valid  : in std_logic;
    slot_writer : in std_logic_vector(2 downto 0);
    slot_next   : in std_logic_vector(7 downto 0);

    -- A sample of this writer arrives, and is complete from the next cycle on. The next one is not accepted before
    -- `is_done`. After a reset, a sample seems to have arrived: the program handles it after writing the slots of all
    -- writers, so that no sample arrives earlier.
    comes       : out std_logic;
    is_new_long : out std_logic;  -- it needs fragments
    has_sample  : out std_logic;
    writer      : out std_logic_vector(2 downto 0);
    is_done     : in  std_logic;

    -- The slot whose sample is sent next, unless it is the last received one; and the number of its fragment, from 0
    -- on. firm_rtps_fragment computes the rest.
    looks        : in  std_logic;
    chooses      : in  std_logic;
    choice       : in  std_logic_vector(7 downto 0);
    sample_bytes : out unsigned(RTPS_SAMPLE_BITS-1 downto 0);
    is_long      : out std_logic;
    is_last_part : out std_logic;
    is_beyond    : out std_logic;

    -- Shows the payload of a slot, or of the last received sample: its size from two cycles after `shows` on, its first
    -- byte from three cycles on.
    shows         : in  std_logic;
    shows_new     : in  std_logic;
    slot          : in  std_logic_vector(7 downto 0);
    payload_bytes : out std_logic_vector(15 downto 0);
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tready : in  std_logic;

    is_refused : out std_logic  -- a pulse for a frame without payload, with more than SAMPLE bytes or another id
  );
end entity firm_rtps_history;

architecture rtl of firm_rtps_history is

  constant MOST_WRITERS  : positive := 8;
  constant MOST_BYTES    : positive := 65536;
  constant MOST_SLOTS    : positive := 256;
  constant MOST_MEMORY   : positive := 1048576;
  constant HEAD_BYTES    : positive := 5;
  constant BYTE_BITS     : positive := clog2(SAMPLE);
  constant SLOT_BITS     : positive := clog2(SLOTS);
  constant HAS_FRAGMENTS : boolean  := SAMPLE > RTPS_FRAGMENT_BYTES;

  subtype place_t is unsigned(SLOT_BITS+BYTE_BITS-1 downto 0);
  subtype slot_t is unsigned(SLOT_BITS-1 downto 0);
  type bytes_t is array (natural range <>) of std_logic_vector(7 downto 0);
  type sizes_t is array (natural range 0 to SLOTS-1) of unsigned(BYTE_BITS downto 0);
  type slots_t is array (natural range 0 to MOST_WRITERS-1) of slot_t;

  signal sizes : sizes_t := (others => (others => '0'));
  signal nexts : slots_t := (others => (others => '0'));

  -- The arriving frame.
  signal head_r      : unsigned(2 downto 0);
  signal writer_r    : unsigned(2 downto 0) := (others => '0');
  signal size_r      : unsigned(BYTE_BITS downto 0) := (others => '0');
  signal wrong_r     : std_logic;  -- it is refused
  signal has_r       : std_logic;
  signal moves       : std_logic;
  signal is_head     : std_logic;
  signal is_full     : std_logic;
  signal writes      : std_logic;
  signal new_size    : unsigned(BYTE_BITS downto 0);
  signal next_slot   : slot_t;
  signal write_place : place_t;
  signal is_good     : std_logic;
  signal ends        : std_logic;

  -- The leaving payload.
  signal slot_r     : slot_t := (others => '0');
  signal shown_r    : unsigned(BYTE_BITS downto 0) := (others => '0');    -- the size in the slot
  signal place_r    : unsigned(BYTE_BITS-1 downto 0) := (others => '0');  -- after the byte that is shown
  signal read_place : place_t;
  signal shows_r    : std_logic := '0';
  signal steps      : std_logic;                                          -- to the next byte

  -- The fragment selected by the program.
  signal size       : unsigned(RTPS_SAMPLE_BITS-1 downto 0);  -- of the sample in the slot
  signal start      : unsigned(RTPS_SAMPLE_BITS-1 downto 0);  -- its first byte
  signal part_bytes : unsigned(10 downto 0);                  -- its bytes
  signal is_part_r  : std_logic := '0';                       -- it is shown

begin

  assert WRITERS >= 1 and WRITERS <= MOST_WRITERS
    report "firm_rtps_history: WRITERS is " & integer'image(WRITERS) & "; legal: 1 to " & integer'image(MOST_WRITERS)
    severity failure;
  assert SAMPLE >= 2 and SAMPLE <= MOST_BYTES and 2**clog2(SAMPLE) = SAMPLE
    report "firm_rtps_history: SAMPLE is " & integer'image(SAMPLE) & "; legal: powers of two, 2 to "
           & integer'image(MOST_BYTES)
    severity failure;
  assert SLOTS >= 2 and SLOTS <= MOST_SLOTS and 2**clog2(SLOTS) = SLOTS
    report "firm_rtps_history: SLOTS is " & integer'image(SLOTS) & "; legal: powers of two, 2 to "
           & integer'image(MOST_SLOTS)
    severity failure;
  assert SAMPLE <= MOST_MEMORY/SLOTS
    report "firm_rtps_history: SAMPLE is " & integer'image(SAMPLE) & " with " & integer'image(SLOTS)
           & " SLOTS; legal: up to " & integer'image(MOST_MEMORY) & " bytes"
    severity failure;

  -- ------------------------------------------------------------------ frames

  s_axis_tready <= not has_r;
  moves         <= s_axis_tvalid and not has_r;
  is_head       <= '1' when head_r /= HEAD_BYTES else '0';
  is_full       <= size_r(BYTE_BITS);
  writes        <= moves and not (is_head or is_full or wrong_r);
  new_size      <= size_r + 1 when writes = '1' else size_r;
  next_slot     <= nexts(to_integer(writer_r));
  is_good       <= not (is_head or wrong_r or is_full or s_axis_tuser(0));
  ends          <= moves and s_axis_tlast;

  write_size : process (clk)
  begin
    if rising_edge(clk) then
      if writes = '1' then
        sizes(to_integer(next_slot)) <= new_size;
      end if;
    end if;
  end process write_size;

  write_place <= next_slot & size_r(BYTE_BITS-1 downto 0);

  write_slot : process (clk)
  begin
    if rising_edge(clk) then
      if slot_valid = '1' then
        nexts(to_integer(unsigned(slot_writer))) <= unsigned(slot_next(SLOT_BITS-1 downto 0));
      end if;
    end if;
  end process write_slot;

  take_frame : process (clk)
  begin
    if rising_edge(clk) then
      is_refused <= '0';
      if is_done = '1' then
        has_r <= '0';
      end if;
      if moves = '1' then
        size_r <= new_size;
        if is_head = '1' then
          head_r <= head_r + 1;
          if head_r = 0 then
            writer_r <= unsigned(s_axis_tdata(2 downto 0));
            if unsigned(s_axis_tdata) >= WRITERS then
              wrong_r <= '1';
            end if;
          end if;
        end if;
        if ends = '1' then
          head_r     <= (others => '0');
          size_r     <= (others => '0');
          wrong_r    <= '0';
          has_r      <= is_good;
          is_refused <= not is_good and not s_axis_tuser(0);
        end if;
      end if;
      if rst_n = '0' then
        head_r     <= (others => '0');
        size_r     <= (others => '0');
        wrong_r    <= '0';
        has_r      <= '1';
        is_refused <= '0';
      end if;
    end if;
  end process take_frame;

  comes      <= ends and is_good;
  has_sample <= has_r;
  writer     <= std_logic_vector(writer_r);

  -- ------------------------------------------------------------------ payloads

  show_payload : process (clk)
  begin
    if rising_edge(clk) then
      shows_r <= shows;
      shown_r <= sizes(to_integer(slot_r));
      if steps = '1' then
        place_r <= place_r + 1;
      end if;
      if shows = '1' then
        slot_r    <= unsigned(slot(SLOT_BITS-1 downto 0));
        place_r   <= resize(start, BYTE_BITS);
        is_part_r <= '1';
        if shows_new = '1' then
          slot_r    <= next_slot;
          place_r   <= (others => '0');
          is_part_r <= '0';
        end if;
      elsif HAS_FRAGMENTS and looks = '1' then
        slot_r <= unsigned(choice(SLOT_BITS-1 downto 0));
      end if;
    end if;
  end process show_payload;

  read_place <= slot_r & place_r;

  with_fragments : if HAS_FRAGMENTS generate

    -- A memory of many blocks outputs its bytes late in a cycle. Each bank therefore has a register, one of which is
    -- selected.
    constant BANKS     : positive := max(1, SLOTS*SAMPLE/16384);
    constant BANK      : positive := SLOTS*SAMPLE/BANKS;  -- bytes
    constant BANK_BITS : positive := clog2(BANK);

    subtype bank_t is natural range 0 to BANKS-1;
    signal writes_to : bank_t;
    signal bank_r    : bank_t;
    signal bank_2r   : bank_t;
    signal shows_2r  : std_logic := '0';
    signal shown     : bytes_t(0 to BANKS-1) := (others => (others => '0'));

    function bank_of(place : place_t) return bank_t is
    begin
      return to_integer(shift_right(place, BANK_BITS));
    end function bank_of;

  begin

    writes_to <= bank_of(write_place);

    all_banks : for number in 0 to BANKS-1 generate

      signal bytes  : bytes_t(0 to BANK-1);
      signal byte_r : std_logic_vector(7 downto 0) := (others => '0');

    begin

      access_bank : process (clk)
      begin
        if rising_edge(clk) then
          if writes = '1' and writes_to = number then
            bytes(to_integer(resize(write_place, BANK_BITS))) <= s_axis_tdata;
          end if;
          if steps = '1' then
            byte_r        <= bytes(to_integer(resize(read_place, BANK_BITS)));
            shown(number) <= byte_r;
          end if;
        end if;
      end process access_bank;

    end generate all_banks;

    follow_bank : process (clk)
    begin
      if rising_edge(clk) then
        shows_2r <= shows_r;
        if steps = '1' then
          bank_r  <= bank_of(read_place);
          bank_2r <= bank_r;
        end if;
      end if;
    end process follow_bank;

    steps        <= shows_r or shows_2r or m_axis_tready;
    m_axis_tdata <= shown(bank_2r);

    u_fragment : entity firm.firm_rtps_fragment
      port map (
        clk          => clk,
        looks        => looks,
        size         => size,
        number_valid => chooses,
        number       => choice(5 downto 0),
        sample_bytes => sample_bytes,
        is_long      => is_long,
        start        => start,
        bytes        => part_bytes,
        is_last_part => is_last_part,
        is_beyond    => is_beyond
      );

    size          <= resize(shown_r, RTPS_SAMPLE_BITS);
    is_new_long   <= '1' when size_r >= RTPS_FRAGMENT_BYTES else '0';
    payload_bytes <= std_logic_vector(resize(part_bytes, 16)) when is_part_r = '1' else
                     std_logic_vector(resize(shown_r, 16));

  end generate with_fragments;

  without_fragments : if not HAS_FRAGMENTS generate

    signal bytes  : bytes_t(0 to SLOTS*SAMPLE-1);
    signal byte_r : std_logic_vector(7 downto 0) := (others => '0');

  begin

    access_bytes : process (clk)
    begin
      if rising_edge(clk) then
        if writes = '1' then
          bytes(to_integer(write_place)) <= s_axis_tdata;
        end if;
        if steps = '1' then
          byte_r <= bytes(to_integer(read_place));
        end if;
      end if;
    end process access_bytes;

    steps         <= shows_r or m_axis_tready;
    m_axis_tdata  <= byte_r;
    size          <= (others => '0');
    start         <= (others => '0');
    part_bytes    <= (others => '0');
    sample_bytes  <= (others => '0');
    is_long       <= '0';
    is_last_part  <= '0';
    is_beyond     <= '0';
    is_new_long   <= '0';
    payload_bytes <= std_logic_vector(resize(shown_r, 16));

  end generate without_fragments;

end architecture rtl;
