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
  signal level_r       : natural range 0 to DEPTH;
  signal ready_r       : std_logic;  -- there is room for a beat
  signal filled_r      : std_logic;  -- the memory holds a beat
  signal word_r        : std_logic_vector(WORD_BITS-1 downto 0);
  signal valid_r       : std_logic;

  signal write_beat : std_logic;
  signal read_beat  : std_logic;

  function next_index(index : natural) return natural is
  begin
    if index = DEPTH-1 then
      return 0;
    end if;
    return index + 1;
  end function next_index;

  -- A write needs room and a read needs a beat, so they never have the same address.
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

  count_beats : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        write_index_r <= 0;
        read_index_r  <= 0;
        level_r       <= 0;
        ready_r       <= '0';
        filled_r      <= '0';
        valid_r       <= '0';
      else
        -- The flags depend on the former level: `m_axis_tready` may be late, so it is not in a path with an adder.
        ready_r  <= '1';
        filled_r <= '1';
        if write_beat = read_beat then
          if level_r = DEPTH then
            ready_r <= '0';
          elsif level_r = 0 then
            filled_r <= '0';
          end if;
        elsif write_beat = '1' then
          level_r <= level_r + 1;
          if level_r = DEPTH-1 then
            ready_r <= '0';
          end if;
        else
          level_r <= level_r - 1;
          if level_r = 1 then
            filled_r <= '0';
          end if;
        end if;
        if write_beat = '1' then
          write_index_r <= next_index(write_index_r);
        end if;
        if read_beat = '1' then
          read_index_r <= next_index(read_index_r);
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
