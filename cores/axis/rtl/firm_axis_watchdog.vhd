-- SPDX-License-Identifier: Apache-2.0
-- Frees a stream of whole frames from a source that stops in the middle of a frame. After LIMIT cycles in which the
-- receiver is ready and the source offers nothing, the frame ends with an abort (`tuser`) instead of its next beat, and
-- its end is reported to the scheduler. The source's late beats up to its `tlast` are taken and dropped; if
-- the source stops among them, its grant ends after LIMIT cycles as well. Then its next frame is forwarded. Only cycles
-- with `tick` count, so that many watchdogs can share a timer.
--
-- A memory with one bit per source records which sources are late. It is cleared in the 2**n cycles after reset, for an
-- index of n bits; no beat is taken meanwhile. The paths from input to output are combinational.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_watchdog is
  generic (
    WIDTH   : integer := 8;
    SOURCES : integer := 2;
    -- Cycles with `tick` and without a beat, in the middle of a frame; 1 or more.
    LIMIT : integer := 1024;
    -- The memory is cleared by `clearing` and `cleared`, which several watchdogs share.
    SHARED_CLEARING : boolean := false
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- A cycle that counts.
    tick : in std_logic := '1';
    -- With SHARED_CLEARING: from reset on, until each number of a source has been in `cleared`.
    clearing : in std_logic                                        := '0';
    cleared  : in std_logic_vector(index_bits(SOURCES)-1 downto 0) := (others => '0');

    -- The source of the offered beat; changes between frames only.
    source        : in  std_logic_vector(index_bits(SOURCES)-1 downto 0);
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- The bytes of the beat that aborts a frame are void.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- For the scheduler: the frame ends without a beat of the source.
    cut : out std_logic;
    -- Pulses when the source has stopped, while its tready is high; its frame will be aborted.
    expires : out std_logic;
    -- Pulses for each aborted frame, one bit for each source.
    expired : out std_logic_vector(SOURCES-1 downto 0)
  );
end entity firm_axis_watchdog;

architecture rtl of firm_axis_watchdog is

  constant INDEX_BITS_USED : positive := index_bits(SOURCES);

  type memory_t is array (natural range 0 to 2**INDEX_BITS_USED-1) of std_logic_vector(0 downto 0);
  signal is_late    : memory_t;  -- the rest of a frame of this source is dropped
  signal address    : std_logic_vector(INDEX_BITS_USED-1 downto 0);
  signal write_bit  : std_logic;
  signal late_next  : std_logic_vector(0 downto 0);
  signal late       : std_logic;
  signal clears     : std_logic;
  signal to_clear   : std_logic_vector(INDEX_BITS_USED-1 downto 0);  -- the next bit to clear

  signal inside_r : std_logic;                    -- a frame has begun
  signal waited_r : natural range 0 to LIMIT-1;   -- cycles with tick in a row without a beat
  signal cut_r    : std_logic;                    -- the frame must end
  signal ends     : std_logic;                    -- it ends in this cycle
  signal stops    : std_logic;                    -- the source has been silent for LIMIT cycles with tick

  signal accepted : std_logic;                    -- a beat may leave, or be dropped
  signal ready    : std_logic;
  signal taken    : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_watchdog: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert SOURCES >= 1 and SOURCES <= 256
    report "firm_axis_watchdog: SOURCES is " & integer'image(SOURCES) & "; legal: 1 to 256"
    severity failure;
  assert LIMIT >= 1
    report "firm_axis_watchdog: LIMIT is " & integer'image(LIMIT) & "; legal: 1 or more"
    severity failure;

  late     <= is_late(to_integer(unsigned(address)))(0);
  accepted <= not clears and (m_axis_tready or late);
  ready    <= accepted and not cut_r;
  taken    <= s_axis_tvalid and ready;
  ends     <= cut_r and accepted;

  address      <= to_clear when clears = '1' else source;
  write_bit    <= clears or ends or (taken and s_axis_tlast);
  late_next(0) <= ends and not clears;

  remember_late : process (clk)
  begin
    if rising_edge(clk) then
      if write_bit = '1' then
        is_late(to_integer(unsigned(address))) <= late_next;
      end if;
    end if;
  end process remember_late;

  shares_clearing : if SHARED_CLEARING generate
    clears   <= clearing;
    to_clear <= cleared;
  end generate shares_clearing;

  clears_itself : if not SHARED_CLEARING generate
    signal cleared_r : unsigned(INDEX_BITS_USED downto 0);  -- the highest bit: not all are cleared
  begin
    clear_memory : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          cleared_r <= to_unsigned(2**INDEX_BITS_USED, INDEX_BITS_USED+1);
        elsif clears = '1' then
          cleared_r <= cleared_r + 1;
        end if;
      end if;
    end process clear_memory;

    clears   <= cleared_r(INDEX_BITS_USED);
    to_clear <= std_logic_vector(cleared_r(INDEX_BITS_USED-1 downto 0));
  end generate clears_itself;

  stops <= inside_r and ready and tick and not s_axis_tvalid when waited_r = LIMIT-1 else '0';

  watch : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        inside_r <= '0';
        waited_r <= 0;
        cut_r    <= '0';
      elsif ends = '1' then
        inside_r <= '0';
        cut_r    <= '0';
      elsif taken = '1' then
        inside_r <= not s_axis_tlast;
        waited_r <= 0;
      elsif inside_r = '1' and ready = '1' and tick = '1' then
        if stops = '1' then
          waited_r <= 0;
          cut_r    <= '1';
        else
          waited_r <= waited_r + 1;
        end if;
      end if;
    end if;
  end process watch;

  report_frames : process (clk)
  begin
    if rising_edge(clk) then
      expired <= decode(source, rst_n and ends and not late, SOURCES);
    end if;
  end process report_frames;

  end_frame : process (s_axis_tkeep, s_axis_tuser, s_axis_tlast, cut_r)
  begin
    m_axis_tkeep <= s_axis_tkeep;
    m_axis_tuser <= s_axis_tuser;
    m_axis_tlast <= s_axis_tlast;
    if cut_r = '1' then
      m_axis_tkeep    <= (others => '0');
      m_axis_tkeep(0) <= '1';
      m_axis_tuser    <= "1";
      m_axis_tlast    <= '1';
    end if;
  end process end_frame;

  m_axis_tdata  <= s_axis_tdata;
  m_axis_tvalid <= not clears and not late and (s_axis_tvalid or cut_r);
  s_axis_tready <= ready;
  cut           <= ends;
  expires       <= stops and not late;

end architecture rtl;
