-- SPDX-License-Identifier: Apache-2.0
-- Forms bursts after a multiplexer whose source may change between any two beats: each run of beats from one source
-- leaves as a burst that ends with `tlast`. The first burst of a frame starts with the frame's first beat. A resumed
-- burst starts with an extra beat, whose lowest byte is the source's index and whose other bytes are meaningless.
-- Only a beat of another source reveals the end of a run. Each beat is therefore held until the next one arrives, from
-- any source; the last beat of a frame is not held. A held beat never blocks another source, and a run has no gap.
-- A memory with one bit per source records which frames have begun. It is cleared in the 2**n cycles after reset, for
-- an index of n bits; no beat is taken meanwhile.
-- The paths from input to output are combinational, and as at the multiplexer, the offered beat may change with the
-- source until it is taken. A register slice after this entity hides such changes.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_burst is
  generic (
    WIDTH   : integer := 8;
    SOURCES : integer := 2
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The source of the offered beat; may change at any time.
    source        : in  std_logic_vector(index_bits(SOURCES)-1 downto 0);
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
end entity firm_axis_burst;

architecture rtl of firm_axis_burst is

  constant INDEX_BITS_USED : positive := index_bits(SOURCES);

  type memory_t is array (natural range 0 to 2**INDEX_BITS_USED-1) of std_logic_vector(0 downto 0);
  signal is_begun   : memory_t;  -- a frame of this source is incomplete
  signal address    : std_logic_vector(INDEX_BITS_USED-1 downto 0);
  signal write_bit  : std_logic;
  signal begun      : std_logic_vector(0 downto 0);
  signal begun_next : std_logic_vector(0 downto 0);
  signal cleared_r  : unsigned(INDEX_BITS_USED downto 0);  -- the next bit to clear; its highest bit: not all are
  signal clearing   : std_logic;

  signal held_tdata_r  : std_logic_vector(WIDTH-1 downto 0);
  signal held_tkeep_r  : std_logic_vector(WIDTH/8-1 downto 0);
  signal held_tuser_r  : std_logic_vector(0 downto 0);
  signal held_tlast_r  : std_logic;
  signal held_source_r : std_logic_vector(INDEX_BITS_USED-1 downto 0);
  signal held_r        : std_logic;
  signal resume_r      : std_logic;  -- the index precedes the held beat

  signal moved : std_logic;  -- `source` is not the held beat's
  signal ready : std_logic;
  signal taken : std_logic;

  signal m_axis_tvalid_out : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_burst: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert SOURCES >= 1 and SOURCES <= 256
    report "firm_axis_burst: SOURCES is " & integer'image(SOURCES) & "; legal: 1 to 256"
    severity failure;

  moved <= '0' when source = held_source_r else '1';
  ready <= not clearing and (not held_r or (m_axis_tready and not resume_r));
  taken <= s_axis_tvalid and ready;

  clearing      <= cleared_r(INDEX_BITS_USED);
  address       <= std_logic_vector(cleared_r(INDEX_BITS_USED-1 downto 0)) when clearing = '1' else source;
  write_bit     <= clearing or taken;
  begun_next(0) <= not clearing and not s_axis_tlast;
  begun         <= is_begun(to_integer(unsigned(address)));

  remember_frames : process (clk)
  begin
    if rising_edge(clk) then
      if write_bit = '1' then
        is_begun(to_integer(unsigned(address))) <= begun_next;
      end if;
    end if;
  end process remember_frames;

  clear_memory : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        cleared_r <= to_unsigned(2**INDEX_BITS_USED, INDEX_BITS_USED+1);
      elsif clearing = '1' then
        cleared_r <= cleared_r + 1;
      end if;
    end if;
  end process clear_memory;

  hold_beat : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        held_r   <= '0';
        resume_r <= '0';
      elsif taken = '1' then
        held_r <= '1';
        -- Between two beats of a frame, its own beat is held, unless another source's beat has arrived.
        resume_r <= begun(0) and moved;
      elsif m_axis_tvalid_out = '1' and m_axis_tready = '1' then
        -- Without a beat after it, only the last beat of a frame leaves.
        held_r   <= resume_r;
        resume_r <= '0';
      end if;
      if taken = '1' then
        held_tdata_r  <= s_axis_tdata;
        held_tkeep_r  <= s_axis_tkeep;
        held_tuser_r  <= s_axis_tuser;
        held_tlast_r  <= s_axis_tlast;
        held_source_r <= source;
      end if;
    end if;
  end process hold_beat;

  m_axis_tvalid_out <= held_r and (resume_r or held_tlast_r or s_axis_tvalid);

  send : process (held_tdata_r, held_tkeep_r, held_tuser_r, held_source_r, resume_r)
  begin
    m_axis_tdata <= held_tdata_r;
    m_axis_tkeep <= held_tkeep_r;
    m_axis_tuser <= held_tuser_r;
    if resume_r = '1' then
      m_axis_tdata(7 downto 0) <= std_logic_vector(resize(unsigned(held_source_r), 8));
      m_axis_tkeep             <= (others => '1');
      m_axis_tuser             <= "0";
    end if;
  end process send;

  s_axis_tready <= ready;
  m_axis_tvalid <= m_axis_tvalid_out;
  m_axis_tlast  <= not resume_r and (held_tlast_r or moved);

end architecture rtl;
