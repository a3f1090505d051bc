-- SPDX-License-Identifier: Apache-2.0
-- Fills in a frame's length once the whole frame has arrived: it stores frames, counts their bytes, and sends each
-- after its length.
--
-- The store is a ring of DEPTH beats; a frame leaves it while others enter. A frame of more than DEPTH beats
-- cannot be stored. By the time it is detected, the ring holds only its beats and has wrapped to the first one. To drop
-- the frame, the level is cleared and the remaining beats are discarded. A queue holds the lengths of complete frames.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_fault_pkg.all;

entity firm_axis_length_buffer is
  generic (
    WIDTH : integer := 8;
    -- Beats of memory, 2 or more: the longest frame, id and length included.
    DEPTH : integer := 64
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Frames of five bytes or more: id, four ignored bytes, payload. An aborted frame is dropped.
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
    m_axis_tready : in  std_logic;

    -- Errors of the publisher in front, and of this entity: code 6 if a frame was too long and is dropped.
    s_frame_error      : in  std_logic                    := '0';
    s_frame_error_code : in  std_logic_vector(3 downto 0) := (others => '0');
    frame_error        : out std_logic;
    frame_error_code   : out std_logic_vector(3 downto 0)
  );
end entity firm_axis_length_buffer;

architecture rtl of firm_axis_length_buffer is

  constant LANES        : positive := WIDTH/8;
  constant WORD_BITS    : positive := WIDTH + LANES + 1;
  constant ID_BYTES     : positive := 1;
  constant LENGTH_BYTES : positive := 4;
  constant HEADER_BYTES : positive := ID_BYTES + LENGTH_BYTES;
  -- The beat after those that contain bytes of the length, counted from 0.
  constant PAST_LENGTH  : positive := (HEADER_BYTES - 1) / LANES + 1;
  constant QUEUE_DEPTH  : positive := 16;

  type memory_t is array (natural range 0 to DEPTH-1) of std_logic_vector(WORD_BITS-1 downto 0);
  signal memory        : memory_t;
  signal write_index_r : natural range 0 to DEPTH-1;
  signal read_index_r  : natural range 0 to DEPTH-1;
  signal level_r       : natural range 0 to DEPTH;
  signal room_r        : std_logic;                 -- there is room for a beat
  signal beats_r       : natural range 0 to DEPTH;  -- of the entering frame
  signal dropping_r    : std_logic;                 -- the entering frame is too long
  signal begin_index_r : natural range 0 to DEPTH-1;  -- its first beat

  signal take_beat : std_logic;
  signal aborted   : std_logic;  -- the entering beat aborts its frame
  signal too_long  : std_logic;  -- the entering beat fills the memory, and is not the frame's last

  -- A frame that has just arrived, for one cycle or until the queue takes its length.
  signal ended_r      : std_logic;
  signal end_beats_r  : natural range 0 to DEPTH;                       -- its beats but the last
  signal end_bytes_r  : std_logic_vector(clog2(LANES+1)-1 downto 0);    -- bytes of the last one
  signal ended_length : std_logic_vector(31 downto 0);
  signal queue_ready  : std_logic;
  signal enter        : std_logic;                                      -- beats may enter

  -- The next frame to send.
  signal next_length : std_logic_vector(31 downto 0);
  signal next_valid  : std_logic;
  signal start       : std_logic;

  -- The beat that is sent.
  signal read_beat  : std_logic;
  signal between    : std_logic;                     -- no frame continues after it
  signal word_r     : std_logic_vector(WORD_BITS-1 downto 0);
  signal valid_r    : std_logic;
  signal length_r   : std_logic_vector(31 downto 0);
  signal position_r : natural range 0 to PAST_LENGTH;  -- its number in the frame, as far as the length reaches

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
    report "firm_axis_length_buffer: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert DEPTH >= 2
    report "firm_axis_length_buffer: DEPTH is " & integer'image(DEPTH) & "; legal: 2 or more"
    severity failure;

  -- In --------------------------------------------------------------------------------------------------------------

  enter         <= (room_r or dropping_r) and (queue_ready or not ended_r);
  s_axis_tready <= enter;
  take_beat     <= s_axis_tvalid and enter and not dropping_r;
  aborted       <= take_beat and s_axis_tlast and s_axis_tuser(0);
  too_long      <= '1' when take_beat = '1' and s_axis_tlast = '0' and beats_r = DEPTH-1 else '0';

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if take_beat = '1' then
        memory(write_index_r) <= s_axis_tlast & s_axis_tkeep & s_axis_tdata;
      end if;
      if read_beat = '1' then
        word_r <= memory(read_index_r);
      end if;
    end if;
  end process access_memory;

  count_beats : process (clk)
    variable level : natural range 0 to DEPTH;
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        write_index_r <= 0;
        begin_index_r <= 0;
        read_index_r  <= 0;
        level_r       <= 0;
        room_r        <= '0';
        beats_r       <= 0;
        dropping_r    <= '0';
      else
        level := level_r;
        if too_long = '1' then
          level := 0;
        elsif aborted = '1' and read_beat = '0' then
          level := level_r - beats_r;
        elsif aborted = '1' then
          level := level_r - beats_r - 1;
        elsif take_beat = '1' and read_beat = '0' then
          level := level_r + 1;
        elsif take_beat = '0' and read_beat = '1' then
          level := level_r - 1;
        end if;
        level_r <= level;
        room_r  <= '1';
        if level = DEPTH then
          room_r <= '0';
        end if;

        if take_beat = '1' then
          write_index_r <= next_index(write_index_r);
          beats_r       <= beats_r + 1;
          if s_axis_tlast = '1' or too_long = '1' then
            beats_r       <= 0;
            begin_index_r <= next_index(write_index_r);
          end if;
          if aborted = '1' then
            write_index_r <= begin_index_r;
            begin_index_r <= begin_index_r;
          end if;
        end if;
        if too_long = '1' then
          dropping_r <= '1';
        elsif s_axis_tvalid = '1' and enter = '1' and s_axis_tlast = '1' then
          dropping_r <= '0';
        end if;

        if read_beat = '1' then
          read_index_r <= next_index(read_index_r);
        end if;
      end if;
    end if;
  end process count_beats;

  report_errors : process (clk)
  begin
    if rising_edge(clk) then
      frame_error <= rst_n and (too_long or s_frame_error);
      if too_long = '1' then
        frame_error_code <= OVER_BUFFER;
      elsif s_frame_error = '1' then
        frame_error_code <= s_frame_error_code;
      end if;
    end if;
  end process report_errors;

  end_frame : process (clk)
  begin
    if rising_edge(clk) then
      if take_beat = '1' then
        end_beats_r <= beats_r;
        end_bytes_r <= lanes_kept(s_axis_tkeep);
      end if;
      if rst_n = '0' then
        ended_r <= '0';
      elsif ended_r = '0' or queue_ready = '1' then
        ended_r <= take_beat and s_axis_tlast and not aborted;
      end if;
    end if;
  end process end_frame;

  ended_length <= std_logic_vector(shift_left(to_unsigned(end_beats_r, 32), clog2(LANES)) +
                                   unsigned(end_bytes_r) - HEADER_BYTES);

  u_queue : entity firm.firm_axis_fifo
    generic map (
      WIDTH => 32,
      DEPTH => QUEUE_DEPTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => ended_length,
      s_axis_tkeep  => "1111",
      s_axis_tvalid => ended_r,
      s_axis_tlast  => '1',
      s_axis_tready => queue_ready,
      m_axis_tdata  => next_length,
      m_axis_tkeep  => open,
      m_axis_tvalid => next_valid,
      m_axis_tlast  => open,
      m_axis_tready => start
    );

  -- Out -------------------------------------------------------------------------------------------------------------

  -- When the length of a frame is stored, so are all its beats.
  between   <= not valid_r or word_r(WORD_BITS-1);
  start     <= next_valid and between and (m_axis_tready or not valid_r);
  read_beat <= start or (not between and m_axis_tready);

  send : process (clk)
  begin
    if rising_edge(clk) then
      if start = '1' then
        length_r   <= next_length;
        position_r <= 0;
      elsif read_beat = '1' and position_r < PAST_LENGTH then
        position_r <= position_r + 1;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      else
        valid_r <= read_beat or (valid_r and not m_axis_tready);
      end if;
    end if;
  end process send;

  fill_in : process (word_r, length_r, position_r)
    variable place : natural;
  begin
    m_axis_tdata <= word_r(WIDTH-1 downto 0);
    for byte in 0 to LENGTH_BYTES-1 loop
      place := ID_BYTES + byte;
      if position_r = place / LANES then
        m_axis_tdata(8*(place mod LANES)+7 downto 8*(place mod LANES)) <= length_r(8*byte+7 downto 8*byte);
      end if;
    end loop;
  end process fill_in;

  m_axis_tkeep  <= word_r(WIDTH+LANES-1 downto WIDTH);
  m_axis_tuser  <= "0";
  m_axis_tlast  <= word_r(WORD_BITS-1);
  m_axis_tvalid <= valid_r;

end architecture rtl;
