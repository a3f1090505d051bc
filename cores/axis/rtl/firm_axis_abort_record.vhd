-- SPDX-License-Identifier: Apache-2.0
-- Reports aborted frames to an engine without `tuser`: the burst that aborts a frame ends before its last beat, and a
-- record follows. A record is the id 255, a length of 2**32-1, which no frame has, the aborted id and the code 10.
-- Each beat waits for the next one, or is a last one. An aborted frame therefore never has the length in its header,
-- and a host cannot mistake it for a complete one.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_fault_pkg.all;

entity firm_axis_abort_record is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- From the Manager; `tid` is the id of the frame on every beat.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0);
    s_axis_tid    : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_axis_abort_record;

architecture rtl of firm_axis_abort_record is

  constant LANES        : positive := max(1, WIDTH/8);
  constant RECORD_BYTES : positive := 7;
  -- Beats of a record.
  constant BEATS        : positive := (RECORD_BYTES + LANES - 1) / LANES;
  -- Bytes in the last beat of a record.
  constant LAST_BYTES   : positive := RECORD_BYTES - (BEATS-1)*LANES;
  constant RECORD_BITS  : positive := 8*LANES*BEATS;
  constant FIRST_PLACE  : std_logic_vector(BEATS-1 downto 0) := (0 => '1', others => '0');

  function last_keep return std_logic_vector is
    variable keep : std_logic_vector(LANES-1 downto 0) := (others => '0');
  begin
    keep(LAST_BYTES-1 downto 0) := (others => '1');
    return keep;
  end function last_keep;

  -- The record of a frame, with its first byte lowest.
  function record_of(id : std_logic_vector(7 downto 0)) return std_logic_vector is
    variable bytes : std_logic_vector(RECORD_BITS-1 downto 0) := (others => '0');
  begin
    bytes(39 downto 0)  := (others => '1');
    bytes(47 downto 40) := id;
    bytes(51 downto 48) := ABORTED;
    return bytes;
  end function record_of;

  function next_place(place : std_logic_vector(BEATS-1 downto 0)) return std_logic_vector is
    variable moved : std_logic_vector(BEATS-1 downto 0) := (others => '0');
  begin
    for beat in 1 to BEATS-1 loop
      moved(beat) := place(beat-1);
    end loop;
    return moved;
  end function next_place;

  -- The beat that waits.
  signal held_r  : std_logic;
  signal tdata_r : std_logic_vector(WIDTH-1 downto 0);
  signal tkeep_r : std_logic_vector(WIDTH/8-1 downto 0);
  signal tlast_r : std_logic;

  signal recording_r : std_logic;                                 -- a record is being sent
  signal record_r    : std_logic_vector(RECORD_BITS-1 downto 0);  -- its remaining bytes
  signal place_r     : std_logic_vector(BEATS-1 downto 0);        -- bit k is '1' at its beat k

  signal aborts : std_logic;  -- the arriving beat aborts its frame
  signal closes : std_logic;  -- and the beat that waits is of the same frame
  signal leaves : std_logic;  -- the beat that waits may leave
  signal ready  : std_logic;
  signal taken  : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_abort_record: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  aborts <= s_axis_tvalid and s_axis_tlast and s_axis_tuser(0);
  closes <= aborts and not tlast_r;
  leaves <= held_r and (tlast_r or s_axis_tvalid);
  ready  <= not recording_r and (m_axis_tready or not held_r);
  taken  <= s_axis_tvalid and ready;

  hold_beat : process (clk)
  begin
    if rising_edge(clk) then
      if taken = '1' then
        tdata_r <= s_axis_tdata;
        tkeep_r <= s_axis_tkeep;
        tlast_r <= s_axis_tlast;
      end if;
      if rst_n = '0' then
        held_r <= '0';
      elsif taken = '1' then
        held_r <= not aborts;
      elsif leaves = '1' and m_axis_tready = '1' then
        held_r <= '0';
      end if;
    end if;
  end process hold_beat;

  send_record : process (clk)
  begin
    if rising_edge(clk) then
      if recording_r = '0' then
        record_r <= record_of(s_axis_tid);
        place_r  <= FIRST_PLACE;
      elsif m_axis_tready = '1' then
        record_r <= std_logic_vector(shift_right(unsigned(record_r), WIDTH));
        place_r  <= next_place(place_r);
      end if;
      if rst_n = '0' then
        recording_r <= '0';
      elsif recording_r = '0' then
        recording_r <= taken and aborts;
      elsif m_axis_tready = '1' and place_r(BEATS-1) = '1' then
        recording_r <= '0';
      end if;
    end if;
  end process send_record;

  send : process (recording_r, record_r, place_r, tdata_r, tkeep_r, tlast_r, closes)
  begin
    m_axis_tdata <= tdata_r;
    m_axis_tkeep <= tkeep_r;
    m_axis_tlast <= tlast_r or closes;
    if recording_r = '1' then
      m_axis_tdata <= record_r(WIDTH-1 downto 0);
      m_axis_tkeep <= (others => '1');
      m_axis_tlast <= place_r(BEATS-1);
      if place_r(BEATS-1) = '1' then
        m_axis_tkeep <= last_keep;
      end if;
    end if;
  end process send;

  s_axis_tready <= ready;
  m_axis_tvalid <= recording_r or leaves;

end architecture rtl;
