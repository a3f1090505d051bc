-- SPDX-License-Identifier: Apache-2.0
-- A synchronous FIFO for a stream. The memory is written and read at the clock, without reset and with a registered
-- output, as block RAM offers; a beat is never read in the cycle in which it is written.
-- The output register holds one beat in addition to DEPTH.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_fifo is
  generic (
    WIDTH : integer := 8;
    -- Beats of memory, 2 or more; a power of two wastes none.
    DEPTH : integer := 16
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_axis_fifo;

architecture rtl of firm_axis_fifo is

  constant KEEP_BITS : positive := WIDTH/8;
  constant WORD_BITS : positive := WIDTH + KEEP_BITS + 2;

  type memory_t is array (natural range 0 to DEPTH-1) of std_logic_vector(WORD_BITS-1 downto 0);
  signal memory        : memory_t;
  signal write_index_r : natural range 0 to DEPTH-1;
  signal read_index_r  : natural range 0 to DEPTH-1;
  signal ready_r       : std_logic;  -- there is room for a beat
  signal filled_r      : std_logic;  -- the memory holds a beat
  signal word_r        : std_logic_vector(WORD_BITS-1 downto 0);
  signal valid_r       : std_logic;

  signal write_beat : std_logic;
  signal read_beat  : std_logic;
  signal write_next : natural range 0 to DEPTH-1;
  signal read_next  : natural range 0 to DEPTH-1;
  signal fills      : std_logic;  -- a write without a read fills the memory
  signal empties    : std_logic;  -- a read without a write empties it

  -- A counter of bits wraps by itself; any other `mod` would be a divider.
  function next_index(index : natural) return natural is
  begin
    if 2**clog2(DEPTH) = DEPTH then
      return (index + 1) mod DEPTH;
    elsif index = DEPTH-1 then
      return 0;
    end if;
    return index + 1;
  end function next_index;

  -- With equal indices, the memory is full or empty, so there is no write or no read.
  attribute syn_ramstyle of memory      : signal is "no_rw_check";
  attribute rw_addr_collision of memory : signal is "no";

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_fifo: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert DEPTH >= 2
    report "firm_axis_fifo: DEPTH is " & integer'image(DEPTH) & "; legal: 2 or more"
    severity failure;

  write_beat <= s_axis_tvalid and ready_r;
  read_beat  <= filled_r and (m_axis_tready or not valid_r);

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if write_beat = '1' then
        memory(write_index_r) <= s_axis_tlast & s_axis_tuser & s_axis_tkeep & s_axis_tdata;
      end if;
      if read_beat = '1' then
        word_r <= memory(read_index_r);
      end if;
    end if;
  end process access_memory;

  write_next <= next_index(write_index_r);
  read_next  <= next_index(read_index_r);
  fills      <= '1' when write_next = read_index_r else '0';
  empties    <= '1' when read_next = write_index_r else '0';

  count_beats : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        write_index_r <= 0;
        read_index_r  <= 0;
        ready_r       <= '0';
        filled_r      <= '0';
        valid_r       <= '0';
      else
        -- `m_axis_tready` may be late, so it is not in a path with an adder.
        if write_beat = read_beat then
          ready_r <= ready_r or not filled_r;  -- rises after reset
        elsif write_beat = '1' then
          ready_r  <= not fills;
          filled_r <= '1';
        else
          ready_r  <= '1';
          filled_r <= not empties;
        end if;
        if write_beat = '1' then
          write_index_r <= write_next;
        end if;
        if read_beat = '1' then
          read_index_r <= read_next;
        end if;
        valid_r <= read_beat or (valid_r and not m_axis_tready);
      end if;
    end if;
  end process count_beats;

  s_axis_tready <= ready_r;
  m_axis_tdata  <= word_r(WIDTH-1 downto 0);
  m_axis_tkeep  <= word_r(WIDTH+KEEP_BITS-1 downto WIDTH);
  m_axis_tuser  <= word_r(WIDTH+KEEP_BITS downto WIDTH+KEEP_BITS);
  m_axis_tlast  <= word_r(WORD_BITS-1);
  m_axis_tvalid <= valid_r;

end architecture rtl;
