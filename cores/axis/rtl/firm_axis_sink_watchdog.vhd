-- SPDX-License-Identifier: Apache-2.0
-- Frees a stream of whole frames from a sink that accepts nothing. After LIMIT cycles in which the source offers a beat
-- and the sink does not take the previous one, the rest of the arriving frame is dropped, and so are further frames
-- until the sink takes a beat again. If a part of the first of them has left, an abort (`tuser`) then ends it, and the
-- sink receives the next frame from its first beat.
--
-- The beat at the output stays until the sink takes it. All outputs but `s_axis_tready` are registers.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_fault_pkg.all;

entity firm_axis_sink_watchdog is
  generic (
    WIDTH : integer := 8;
    -- Cycles without a beat, 1 or more.
    LIMIT : integer := 1024
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

    -- The byte of the beat that aborts a frame is void.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- Errors of the sink, and of this entity: code 9 for each frame that did not leave as a whole. The sink's own
    -- report of an aborted frame is omitted.
    s_frame_error      : in  std_logic                    := '0';
    s_frame_error_code : in  fault_t                      := NO_FAULT;
    frame_error        : out std_logic;
    frame_error_code   : out fault_t
  );
end entity firm_axis_sink_watchdog;

architecture rtl of firm_axis_sink_watchdog is

  -- Frames in a sink whose errors it has not reported yet.
  constant REPORTS : positive := 16;

  -- The beat at the output.
  signal tdata_r : std_logic_vector(WIDTH-1 downto 0);
  signal tkeep_r : std_logic_vector(WIDTH/8-1 downto 0);
  signal tuser_r : std_logic_vector(0 downto 0);
  signal tlast_r : std_logic;
  signal valid_r : std_logic;

  signal arriving_r : std_logic;                      -- a frame has begun at the input
  signal dropping_r : std_logic;                      -- its remaining beats, or the next frame, are dropped
  signal stuck_r    : std_logic;                      -- the sink has taken nothing since the limit
  signal waited_r   : natural range 0 to LIMIT-1;     -- cycles in which the source waited for the sink

  signal free    : std_logic;  -- there is room for a beat at the output
  signal expires : std_logic;
  signal refuse  : std_logic;  -- an offered frame begins, and is dropped
  signal drop    : std_logic;  -- an offered beat is dropped
  signal ready   : std_logic;
  signal taken   : std_logic;
  signal is_open : std_logic;  -- the frame at the output has not ended

  signal hidden_r : natural range 0 to REPORTS;       -- aborts that the sink has not reported yet
  signal due_r    : natural range 0 to REPORTS;       -- frames that are not reported yet
  signal lost     : std_logic;
  signal told     : std_logic;                        -- an error of the sink

  function counted(count : natural; enters, leaves : std_logic) return natural is
  begin
    if enters = '1' and leaves = '0' and count < REPORTS then
      return count + 1;
    elsif enters = '0' and leaves = '1' and count > 0 then
      return count - 1;
    end if;
    return count;
  end function counted;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_sink_watchdog: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert LIMIT >= 1
    report "firm_axis_sink_watchdog: LIMIT is " & integer'image(LIMIT) & "; legal: 1 or more"
    severity failure;

  free    <= m_axis_tready or not valid_r;
  refuse  <= stuck_r and not arriving_r and not dropping_r;
  drop    <= dropping_r or refuse;
  ready   <= free or drop;
  taken   <= s_axis_tvalid and ready;
  is_open <= valid_r and not tlast_r;
  expires <= '1' when s_axis_tvalid = '1' and ready = '0' and waited_r = LIMIT-1 else '0';

  receive : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        arriving_r <= '0';
        dropping_r <= '0';
        stuck_r    <= '0';
        waited_r   <= 0;
      else
        if taken = '1' then
          arriving_r <= not s_axis_tlast;
          dropping_r <= drop and not s_axis_tlast;
        elsif expires = '1' then
          dropping_r <= '1';
        end if;
        stuck_r <= expires or (stuck_r and not free);
        if free = '1' or expires = '1' then
          waited_r <= 0;
        elsif s_axis_tvalid = '1' and ready = '0' then
          waited_r <= waited_r + 1;
        end if;
      end if;
    end if;
  end process receive;

  -- While the sink is stuck, no beat enters the register, so that an open frame at the output is the one to abort.
  send : process (clk)
  begin
    if rising_edge(clk) then
      if free = '1' then
        if stuck_r = '1' then
          tkeep_r    <= (others => '0');
          tkeep_r(0) <= '1';
          tuser_r    <= "1";
          tlast_r    <= '1';
        elsif taken = '1' and drop = '0' then
          tdata_r <= s_axis_tdata;
          tkeep_r <= s_axis_tkeep;
          tuser_r <= s_axis_tuser;
          tlast_r <= s_axis_tlast;
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      elsif free = '1' then
        valid_r <= (stuck_r and is_open) or (taken and not drop);
      end if;
    end if;
  end process send;

  -- Errors ----------------------------------------------------------------------------------------------------------

  lost <= expires or (s_axis_tvalid and refuse);
  told <= '1' when s_frame_error = '1' and hidden_r = 0 else '0';

  -- In a cycle with an error of the sink, a frame of this entity waits for its report.
  report_errors : process (clk)
  begin
    if rising_edge(clk) then
      frame_error      <= '0';
      frame_error_code <= WATCHDOG;
      if rst_n = '0' then
        hidden_r <= 0;
        due_r    <= 0;
      else
        hidden_r <= counted(hidden_r, expires and is_open, s_frame_error);
        if told = '1' then
          frame_error      <= '1';
          frame_error_code <= s_frame_error_code;
          due_r            <= counted(due_r, lost, '0');
        elsif lost = '1' or due_r /= 0 then
          frame_error <= '1';
          due_r       <= counted(due_r, lost, '1');
        end if;
      end if;
    end if;
  end process report_errors;

  s_axis_tready <= ready;
  m_axis_tdata  <= tdata_r;
  m_axis_tkeep  <= tkeep_r;
  m_axis_tuser  <= tuser_r;
  m_axis_tlast  <= tlast_r;
  m_axis_tvalid <= valid_r;

end architecture rtl;
