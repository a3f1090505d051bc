-- SPDX-License-Identifier: Apache-2.0
-- Stores each frame until its last beat, and drops an aborted one: no byte of a broken frame leaves, and a good frame
-- leaves without a pause. The source is not stalled; a frame without room is dropped completely. The first beat of a
-- frame leaves two cycles after its last one arrived.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_mac_store is
  generic (
    DEPTH     : integer := 2048;  -- beats, a power of two; one of them is never used
    DATA_BITS : integer := 8      -- of a beat, 1 to 64
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in std_logic_vector(DATA_BITS-1 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;

    m_axis_tdata  : out std_logic_vector(DATA_BITS-1 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    is_lost : out std_logic  -- a pulse for each good frame without room
  );
end entity firm_mac_store;

architecture rtl of firm_mac_store is

  constant PLACE_BITS : positive := clog2(max(DEPTH, 2));

  subtype place_t is unsigned(PLACE_BITS-1 downto 0);

  type memory_t is array (natural range 0 to 2**PLACE_BITS-1) of std_logic_vector(DATA_BITS downto 0);
  signal memory : memory_t;

  -- Known in simulation before the first reset, for numeric_std would warn.
  signal start_r : place_t := (others => '0');  -- of the incoming frame; all bytes before it can leave
  signal write_r : place_t := (others => '0');
  signal next_r  : place_t := (others => '0');  -- write_r + 1
  signal read_r  : place_t := (others => '0');
  signal full_r  : std_logic;                   -- the incoming frame has no room

  signal has_room : std_logic;
  signal ends     : std_logic;
  signal commit   : std_logic;
  signal fetch    : std_logic;
  signal word_r   : std_logic_vector(DATA_BITS downto 0);
  signal valid_r  : std_logic;

  -- Bytes that can leave lie between the read place and the incoming frame; writes are beyond.
  attribute syn_ramstyle of memory      : signal is "no_rw_check";
  attribute rw_addr_collision of memory : signal is "no";

begin

  assert DEPTH >= 4 and 2**clog2(DEPTH) = DEPTH
    report "firm_mac_store: DEPTH is " & integer'image(DEPTH) & "; legal: powers of two, 4 or more"
    severity failure;
  assert DATA_BITS >= 1 and DATA_BITS <= 64
    report "firm_mac_store: DATA_BITS is " & integer'image(DATA_BITS) & "; legal: 1 to 64"
    severity failure;

  has_room <= '0' when next_r = read_r else not full_r;
  ends     <= s_axis_tvalid and s_axis_tlast;
  commit   <= ends and has_room and not s_axis_tuser(0);
  fetch    <= '1' when read_r /= start_r and (m_axis_tready = '1' or valid_r = '0') else '0';

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if s_axis_tvalid = '1' then
        memory(to_integer(write_r)) <= s_axis_tlast & s_axis_tdata;
      end if;
      if fetch = '1' then
        word_r <= memory(to_integer(read_r));
      end if;
    end if;
  end process access_memory;

  move : process (clk)
  begin
    if rising_edge(clk) then
      is_lost <= ends and not has_room and not s_axis_tuser(0);
      if ends = '1' then
        full_r <= '0';
        if commit = '1' then
          start_r <= next_r;
          write_r <= next_r;
          next_r  <= next_r + 1;
        else
          write_r <= start_r;
          next_r  <= start_r + 1;
        end if;
      elsif s_axis_tvalid = '1' then
        full_r <= not has_room;
        if has_room = '1' then
          write_r <= next_r;
          next_r  <= next_r + 1;
        end if;
      end if;
      if fetch = '1' then
        read_r <= read_r + 1;
      end if;
      valid_r <= fetch or (valid_r and not m_axis_tready);
      if rst_n = '0' then
        start_r <= (others => '0');
        write_r <= (others => '0');
        next_r  <= to_unsigned(1, PLACE_BITS);
        read_r  <= (others => '0');
        full_r  <= '0';
        valid_r <= '0';
        is_lost <= '0';
      end if;
    end if;
  end process move;

  m_axis_tdata  <= word_r(DATA_BITS-1 downto 0);
  m_axis_tlast  <= word_r(DATA_BITS);
  m_axis_tvalid <= valid_r;

end architecture rtl;
