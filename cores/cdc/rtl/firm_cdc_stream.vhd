-- SPDX-License-Identifier: Apache-2.0
-- Transfers a stream of a message between two clock domains, and between two widths if they differ. It is a FIFO in
-- distributed RAM, as wide as the wider end, whose pointers cross in Gray code, one bit at a time. It accepts and
-- outputs a beat per cycle; the slower clock, or the narrower end, limits the throughput.
--
-- The last beat of a stream is taken from the source only when the sink has it. Later events at the source, such as the
-- completion of the message, therefore never overtake the stream at the sink.
--
-- Constraint: RAM to `m_axis_*` is written at least two cycles of `m_clk` before it is read; limit its delay to one.
-- The skew between the bits of a pointer must be less than a cycle of their source clock.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_cdc_stream is
  generic (
    S_WIDTH : integer := 8;
    M_WIDTH : integer := 8;
    -- Beats, a power of two, at least 4. A round trip of the pointers takes some nine cycles, so 16 never stall the
    -- stream.
    DEPTH : integer := 16
  );
  port (
    s_clk   : in std_logic;
    s_rst_n : in std_logic;

    -- The message that contains the stream, as its source shows it. When it falls, the received part of the stream is
    -- dropped.
    s_open   : in  std_logic := '1';
    -- The sink sees this message, so beats may follow.
    s_enable : in  std_logic := '1';
    -- No data is in transit.
    s_idle   : out std_logic;

    s_axis_tdata  : in  std_logic_vector(S_WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(S_WIDTH/8-1 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_clk   : in std_logic;
    m_rst_n : in std_logic;

    -- The message as the sink sees it. While it is low, all data is dropped.
    m_open : in std_logic := '1';

    m_axis_tdata  : out std_logic_vector(M_WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(M_WIDTH/8-1 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_cdc_stream;

architecture rtl of firm_cdc_stream is

  constant WIDTH        : positive := max(S_WIDTH, M_WIDTH);
  constant WORD_BITS    : positive := WIDTH + WIDTH/8 + 1;
  constant INDEX_BITS   : positive := clog2(DEPTH);
  -- A pointer has one bit more than an index, to distinguish a full FIFO from an empty one.
  constant POINTER_BITS : positive := INDEX_BITS + 1;

  subtype index_t is unsigned(INDEX_BITS-1 downto 0);
  subtype pointer_t is unsigned(POINTER_BITS-1 downto 0);
  subtype gray_t is std_logic_vector(POINTER_BITS-1 downto 0);
  type memory_t is array (0 to DEPTH-1) of std_logic_vector(WORD_BITS-1 downto 0);

  -- Successive values differ in one bit, as do the highest and zero.
  function gray_of(pointer : pointer_t) return std_logic_vector is
  begin
    return std_logic_vector(pointer xor ('0' & pointer(POINTER_BITS-1 downto 1)));
  end function gray_of;

  -- The pointer after one that is stored as its index and in Gray code, whose highest bit is that of the pointer. Two
  -- registers of this bit would be equal, and synthesis might then drop the one that crosses.
  function next_of(index : index_t; gray : gray_t) return unsigned is
  begin
    return (gray(POINTER_BITS-1) & index) + 1;
  end function next_of;

  signal memory : memory_t;

  -- Of the source's domain
  signal wide_tdata   : std_logic_vector(WIDTH-1 downto 0);
  signal wide_tkeep   : std_logic_vector(WIDTH/8-1 downto 0);
  signal wide_tvalid  : std_logic;
  signal wide_tlast   : std_logic;
  signal wide_tready  : std_logic;
  signal enabled      : std_logic;  -- a beat of the source, once the sink is ready for it
  signal narrow_ready : std_logic;
  signal write        : std_logic;
  signal write_r      : index_t := (others => '0');
  signal write_gray_r : gray_t;
  signal read_seen    : gray_t;
  signal is_full      : std_logic;
  signal is_drained   : std_logic;
  signal last_r       : std_logic;  -- the last beat is written, but not taken from the source

  -- Of the sink's domain
  signal read         : std_logic;
  signal read_r       : index_t := (others => '0');
  signal read_gray_r  : gray_t;
  signal write_seen   : gray_t;
  signal has_beat     : std_logic;
  signal word         : std_logic_vector(WORD_BITS-1 downto 0);
  signal word_tvalid  : std_logic;
  signal word_tready  : std_logic;

  -- Constraints name these registers, so no tool may merge, duplicate or move them.
  attribute dont_touch   : string;
  attribute preserve     : boolean;
  attribute dont_merge   : boolean;
  attribute syn_preserve : boolean;
  attribute dont_touch of write_gray_r, read_gray_r   : signal is "true";
  attribute preserve of write_gray_r, read_gray_r     : signal is true;
  attribute dont_merge of write_gray_r, read_gray_r   : signal is true;
  attribute syn_preserve of write_gray_r, read_gray_r : signal is true;

begin

  assert is_stream_width(S_WIDTH) and is_stream_width(M_WIDTH)
    report "firm_cdc_stream: S_WIDTH is " & integer'image(S_WIDTH) & " and M_WIDTH is " & integer'image(M_WIDTH)
           & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert DEPTH >= 4 and 2**clog2(DEPTH) = DEPTH
    report "firm_cdc_stream: DEPTH is " & integer'image(DEPTH) & "; legal: powers of two, 4 or more"
    severity failure;

  -- The source's domain

  enabled       <= s_axis_tvalid and (s_enable or last_r);
  s_axis_tready <= narrow_ready and (s_enable or last_r);

  u_widen : entity firm.firm_axis_resize
    generic map (
      S_WIDTH => S_WIDTH,
      M_WIDTH => WIDTH
    )
    port map (
      clk           => s_clk,
      rst_n         => s_rst_n,
      is_open       => s_open,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tkeep  => s_axis_tkeep,
      s_axis_tvalid => enabled,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => narrow_ready,
      m_axis_tdata  => wide_tdata,
      m_axis_tkeep  => wide_tkeep,
      m_axis_tvalid => wide_tvalid,
      m_axis_tlast  => wide_tlast,
      m_axis_tready => wide_tready
    );

  u_read_seen : entity firm.firm_cdc_sync
    generic map (
      BITS => POINTER_BITS
    )
    port map (
      clk    => s_clk,
      level  => read_gray_r,
      synced => read_seen
    );

  -- A pointer is DEPTH ahead of another if its two highest bits in Gray code are the other's, inverted.
  is_full     <= '1' when write_gray_r = (not read_seen(POINTER_BITS-1 downto POINTER_BITS-2))
                          & read_seen(POINTER_BITS-3 downto 0) else
                 '0';
  is_drained  <= '1' when write_gray_r = read_seen else '0';
  write       <= wide_tvalid and not is_full and not last_r;
  wide_tready <= is_drained when last_r = '1' else not is_full and not wide_tlast;
  s_idle      <= is_drained and not last_r;

  remember : process (s_clk)
  begin
    if rising_edge(s_clk) and write = '1' then
      memory(to_integer(write_r)) <= wide_tlast & wide_tkeep & wide_tdata;
    end if;
  end process remember;

  advance_write : process (s_clk)
    variable next_write : pointer_t;
  begin
    if rising_edge(s_clk) then
      if s_rst_n = '0' then
        write_r      <= (others => '0');
        write_gray_r <= (others => '0');
        last_r       <= '0';
      else
        if write = '1' then
          next_write   := next_of(write_r, write_gray_r);
          write_r      <= next_write(INDEX_BITS-1 downto 0);
          write_gray_r <= gray_of(next_write);
        end if;
        -- A beat that is no longer offered was withdrawn with its message.
        last_r <= (write and wide_tlast) or (last_r and wide_tvalid and not is_drained);
      end if;
    end if;
  end process advance_write;

  -- The sink's domain

  u_write_seen : entity firm.firm_cdc_sync
    generic map (
      BITS => POINTER_BITS
    )
    port map (
      clk    => m_clk,
      level  => write_gray_r,
      synced => write_seen
    );

  has_beat    <= '1' when read_gray_r /= write_seen else '0';
  word        <= memory(to_integer(read_r));
  word_tvalid <= has_beat and m_open and m_rst_n;
  read        <= has_beat and (word_tready or not m_open);

  advance_read : process (m_clk)
    variable next_read : pointer_t;
  begin
    if rising_edge(m_clk) then
      if m_rst_n = '0' then
        read_r      <= (others => '0');
        read_gray_r <= (others => '0');
      elsif read = '1' then
        next_read   := next_of(read_r, read_gray_r);
        read_r      <= next_read(INDEX_BITS-1 downto 0);
        read_gray_r <= gray_of(next_read);
      end if;
    end if;
  end process advance_read;

  u_narrow : entity firm.firm_axis_resize
    generic map (
      S_WIDTH => WIDTH,
      M_WIDTH => M_WIDTH
    )
    port map (
      clk           => m_clk,
      rst_n         => m_rst_n,
      is_open       => m_open,
      s_axis_tdata  => word(WIDTH-1 downto 0),
      s_axis_tkeep  => word(WORD_BITS-2 downto WIDTH),
      s_axis_tvalid => word_tvalid,
      s_axis_tlast  => word(WORD_BITS-1),
      s_axis_tready => word_tready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

end architecture rtl;
