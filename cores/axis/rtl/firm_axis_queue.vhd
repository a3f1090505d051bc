-- SPDX-License-Identifier: Apache-2.0
-- A queue of whole frames. A frame leaves once all of it has arrived, so it never pauses at the output.
--
-- The memory has a place of BEATS beats for each of FRAMES frames, the arriving and the leaving one included. Two lists
-- hold the first addresses of places: of waiting frames, oldest first, and of free places. Without a free place, an
-- arriving frame waits, or one frame is dropped as a whole: either the arriving frame (DROP_NEWEST), or the oldest
-- waiting one (DROP_OLDEST), whose place the arriving frame takes in the same cycle. A frame that is being sent is not
-- dropped.
--
-- A longer frame is cut after BEATS beats. With one beat above the longest legal frame, the subscriber after the queue
-- therefore reports it.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_fault_pkg.all;

entity firm_axis_queue is
  generic (
    WIDTH : integer := 8;
    -- Frames of memory, 1 or more; with DROP_OLDEST 2 or more.
    FRAMES : integer := 4;
    -- Beats of each of them.
    BEATS       : integer := 64;
    DROP_NEWEST : boolean := false;
    DROP_OLDEST : boolean := false
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
    m_axis_tready : in  std_logic;

    -- Errors of the subscriber after the queue, and of this entity: code 11 for each dropped frame.
    s_frame_error      : in  std_logic                    := '0';
    s_frame_error_code : in  fault_t                      := NO_FAULT;
    frame_error        : out std_logic;
    frame_error_code   : out fault_t
  );
end entity firm_axis_queue;

architecture rtl of firm_axis_queue is

  constant LANES     : positive := WIDTH/8;
  constant WORD_BITS : positive := WIDTH + LANES + 2;
  constant DEPTH     : positive := FRAMES * BEATS;
  -- Items of a list; an additional, unused one avoids a memory of one word.
  constant ITEMS : positive := max(2, FRAMES);
  -- Errors that a subscriber may report of frames that have left.
  constant REPORTS : positive := 16;

  subtype address_t is natural range 0 to DEPTH-1;
  type memory_t is array (natural range 0 to DEPTH-1) of std_logic_vector(WORD_BITS-1 downto 0);
  type list_t is array (natural range 0 to ITEMS-1) of address_t;

  signal memory : memory_t;

  -- Places of waiting frames, and places that have become free.
  signal waiting         : list_t;
  signal waiting_first_r : natural range 0 to ITEMS-1;
  signal waiting_end_r   : natural range 0 to ITEMS-1;
  signal waiting_count_r : natural range 0 to FRAMES;
  signal oldest          : address_t;
  signal free            : list_t;
  signal free_first_r    : natural range 0 to ITEMS-1;
  signal free_end_r      : natural range 0 to ITEMS-1;
  signal free_count_r    : natural range 0 to FRAMES;
  signal unused_r        : natural range 0 to DEPTH;    -- places from here on have never been used

  -- The arriving frame, or the next one.
  signal place_r     : address_t;                       -- its place, if it has one
  signal has_place_r : std_logic;
  signal write_r     : address_t;                       -- the address of its next beat, once it has a place
  signal position_r  : natural range 0 to BEATS-1;      -- the number of its next beat
  signal skipping_r  : std_logic;                       -- its remaining beats are discarded
  signal running_r   : std_logic;

  signal place      : address_t;  -- of the frame whose beat arrives
  signal write      : address_t;  -- the address of this beat
  signal ready      : std_logic;
  signal keep_beat  : std_logic;
  signal is_end     : std_logic;  -- this beat is the last one that is kept
  signal arrived    : std_logic;
  signal refuse     : std_logic;  -- the arriving frame is dropped
  signal replaces   : std_logic;  -- a new frame drops the oldest waiting one
  signal replace    : std_logic;  -- it does so now
  signal need       : std_logic;  -- the next frame has no place yet
  signal is_unused  : std_logic;  -- a place has never been used
  signal is_free    : std_logic;  -- a place has become free
  signal is_waiting : std_logic;  -- a frame waits
  signal take_free  : std_logic;

  -- The leaving frame.
  signal leaving_r    : address_t;                      -- its place
  signal read_r       : address_t;                      -- the address of its next beat
  signal read_address : address_t;
  signal word_r       : std_logic_vector(WORD_BITS-1 downto 0);
  signal valid_r      : std_logic;
  signal between      : std_logic;                      -- no frame continues after the beat at the output
  signal start        : std_logic;
  signal left         : std_logic;
  signal read_beat    : std_logic;

  signal drop      : std_logic;
  signal dropped_r : natural range 0 to FRAMES+REPORTS; -- dropped frames that are not reported yet

  function next_item(item : natural) return natural is
  begin
    if item = ITEMS-1 then
      return 0;
    end if;
    return item + 1;
  end function next_item;

  function next_address(address : natural) return natural is
  begin
    if address = DEPTH-1 then
      return 0;
    end if;
    return address + 1;
  end function next_address;

  function counted(count : natural; enters, leaves : std_logic) return natural is
  begin
    if enters = '1' and leaves = '0' then
      return count + 1;
    elsif enters = '0' and leaves = '1' then
      return count - 1;
    end if;
    return count;
  end function counted;

  -- A frame leaves after it has arrived, from a place that no other frame has.
  attribute syn_ramstyle of memory      : signal is "no_rw_check";
  attribute rw_addr_collision of memory : signal is "no";

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_queue: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert FRAMES >= 2 or (FRAMES = 1 and not DROP_OLDEST)
    report "firm_axis_queue: FRAMES is " & integer'image(FRAMES) & "; legal: 1 or more, with DROP_OLDEST 2 or more"
    severity failure;
  assert BEATS >= 2
    report "firm_axis_queue: BEATS is " & integer'image(BEATS) & "; legal: 2 or more"
    severity failure;
  assert not (DROP_NEWEST and DROP_OLDEST)
    report "firm_axis_queue: DROP_NEWEST and DROP_OLDEST are both true; legal: one at most"
    severity failure;

  -- In --------------------------------------------------------------------------------------------------------------

  keep_beat <= s_axis_tvalid and (has_place_r or replaces) and not skipping_r;
  is_end    <= '1' when s_axis_tlast = '1' or position_r = BEATS-1 else '0';
  arrived   <= keep_beat and is_end;

  is_unused  <= '1' when unused_r /= DEPTH else '0';
  is_free    <= '1' when free_count_r /= 0 else '0';
  is_waiting <= '1' when waiting_count_r /= 0 else '0';
  need       <= arrived or not has_place_r;
  take_free  <= need and is_free and not is_unused;

  -- While a beat is at the output. Without one, the oldest frame begins to leave.
  drop_oldest_frame : if DROP_OLDEST generate
    replaces <= is_waiting and valid_r and not (has_place_r or skipping_r or is_unused or is_free);
    replace  <= s_axis_tvalid and replaces;
    place    <= oldest when replaces = '1' else place_r;
    write    <= oldest when replaces = '1' else write_r;
  end generate drop_oldest_frame;

  keep_waiting_frames : if not DROP_OLDEST generate
    replaces <= '0';
    replace  <= '0';
    place    <= place_r;
    write    <= write_r;
  end generate keep_waiting_frames;

  drop_newest_frame : if DROP_NEWEST generate
    ready  <= running_r;
    refuse <= s_axis_tvalid and running_r and not (has_place_r or skipping_r);
  end generate drop_newest_frame;

  keep_newest_frame : if not DROP_NEWEST generate
    ready  <= has_place_r or skipping_r or replaces;
    refuse <= '0';
  end generate keep_newest_frame;

  receive : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        running_r   <= '0';
        has_place_r <= '0';
        skipping_r  <= '0';
        position_r  <= 0;
        unused_r    <= 0;
      else
        running_r <= '1';
        if need = '1' then
          has_place_r <= is_unused or is_free or (replace and not arrived);
        end if;
        if need = '1' and is_unused = '1' then
          unused_r <= unused_r + BEATS;
        end if;
        if arrived = '1' then
          position_r <= 0;
        elsif keep_beat = '1' then
          position_r <= position_r + 1;
        end if;
        if s_axis_tvalid = '1' and ready = '1' then
          skipping_r <= (skipping_r or arrived or refuse) and not s_axis_tlast;
        end if;
      end if;
      if need = '1' and is_unused = '1' then
        place_r <= unused_r;
        write_r <= unused_r;
      elsif need = '1' and is_free = '1' then
        place_r <= free(free_first_r);
        write_r <= free(free_first_r);
      elsif keep_beat = '1' then
        place_r <= place;
        write_r <= next_address(write);
      end if;
    end if;
  end process receive;

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if keep_beat = '1' then
        memory(write) <= is_end & s_axis_tuser & s_axis_tkeep & s_axis_tdata;
      end if;
      if read_beat = '1' then
        word_r <= memory(read_address);
      end if;
    end if;
  end process access_memory;

  -- Places ----------------------------------------------------------------------------------------------------------

  oldest <= waiting(waiting_first_r);

  access_lists : process (clk)
  begin
    if rising_edge(clk) then
      if arrived = '1' then
        waiting(waiting_end_r) <= place;
      end if;
      if left = '1' then
        free(free_end_r) <= leaving_r;
      end if;
    end if;
  end process access_lists;

  keep_lists : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        waiting_first_r <= 0;
        waiting_end_r   <= 0;
        waiting_count_r <= 0;
        free_first_r    <= 0;
        free_end_r      <= 0;
        free_count_r    <= 0;
      else
        waiting_count_r <= counted(waiting_count_r, arrived, start or replace);
        free_count_r    <= counted(free_count_r, left, take_free);
        if arrived = '1' then
          waiting_end_r <= next_item(waiting_end_r);
        end if;
        if start = '1' or replace = '1' then
          waiting_first_r <= next_item(waiting_first_r);
        end if;
        if left = '1' then
          free_end_r <= next_item(free_end_r);
        end if;
        if take_free = '1' then
          free_first_r <= next_item(free_first_r);
        end if;
      end if;
    end if;
  end process keep_lists;

  -- Out -------------------------------------------------------------------------------------------------------------

  between      <= not valid_r or word_r(WORD_BITS-1);
  start        <= is_waiting and between and (m_axis_tready or not valid_r) and not replace;
  left         <= valid_r and word_r(WORD_BITS-1) and m_axis_tready;
  read_beat    <= start or (not between and m_axis_tready);
  read_address <= oldest when between = '1' else read_r;

  send : process (clk)
  begin
    if rising_edge(clk) then
      if read_beat = '1' then
        read_r <= next_address(read_address);
      end if;
      if start = '1' then
        leaving_r <= oldest;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      else
        valid_r <= read_beat or (valid_r and not m_axis_tready);
      end if;
    end if;
  end process send;

  -- Errors ----------------------------------------------------------------------------------------------------------

  drop <= refuse or replace;

  -- In a cycle with an error of the subscriber, a dropped frame waits for its report.
  report_errors : process (clk)
  begin
    if rising_edge(clk) then
      frame_error      <= '0';
      frame_error_code <= DROPPED;
      if rst_n = '0' then
        dropped_r <= 0;
      elsif s_frame_error = '1' then
        frame_error      <= '1';
        frame_error_code <= s_frame_error_code;
        dropped_r        <= counted(dropped_r, drop, '0');
      elsif drop = '1' or dropped_r /= 0 then
        frame_error <= '1';
        dropped_r   <= counted(dropped_r, drop, '1');
      end if;
    end if;
  end process report_errors;

  s_axis_tready <= ready;
  m_axis_tdata  <= word_r(WIDTH-1 downto 0);
  m_axis_tkeep  <= word_r(WIDTH+LANES-1 downto WIDTH);
  m_axis_tuser  <= word_r(WIDTH+LANES downto WIDTH+LANES);
  m_axis_tlast  <= word_r(WORD_BITS-1);
  m_axis_tvalid <= valid_r;

end architecture rtl;
