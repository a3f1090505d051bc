-- SPDX-License-Identifier: Apache-2.0
-- Shows the next bytes of a frame from the end of the last field on, and takes any number of them per cycle. A register
-- slice receives the beats. After it, `tdata_r` holds the beat in which the window begins, and the slice's output the
-- next one. One shifter of radix 4 joins the two: nothing else is between the registers and `window`, and no path leads
-- from the stream to the window or from `take` to `s_axis_tready`. At any offset, a beat enters every cycle as long as
-- all available bytes are taken. At 8 bits there is nothing to shift, and the window is the stream.
-- A broken beat (see is_broken_beat) ends its frame without a byte; the following beats up to `tlast` do not enter. At
-- 8 bits every beat holds its byte, and `tkeep` is ignored.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_window is
  generic (
    WIDTH : integer := 8;
    -- The number of low lanes in a frame's first beat that hold no data, although `tkeep` marks them: 0 to WIDTH/8-1.
    VOID_LANES : integer := 0
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

    -- The next bytes of the frame from lane 0 up; lanes from `available` on are undefined.
    window    : out std_logic_vector(WIDTH-1 downto 0);
    available : out std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    -- The frame ends with the available bytes, which may be none; with it, whether the frame was aborted, or ends there
    -- because of a broken beat.
    is_last    : out std_logic;
    is_aborted : out std_logic;
    is_broken  : out std_logic;
    -- For a reader whose `take` is a register: the first `take` bytes are available; and if so, the frame ends with
    -- them. Both are a cycle late for bytes that reach into the frame's last beat, which keeps the paths short.
    shown : out std_logic;
    ends  : out std_logic;

    -- Takes the first `take` bytes, at most `available`, or any larger number up to WIDTH/8 for all of a frame's last
    -- ones. The frame is over when `is_last` and all were taken.
    take_valid : in std_logic;
    take       : in std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    -- A pulse drops the rest of the frame and overrides `take`; if the window shows no frame, it drops the next one.
    skip : in std_logic
  );
end entity firm_axis_window;

architecture rtl of firm_axis_window is

  constant LANES       : natural  := WIDTH/8;
  constant OFFSET_BITS : natural  := clog2(LANES);
  constant COUNT_BITS  : positive := index_bits(LANES+1);

  subtype count_t is unsigned(COUNT_BITS-1 downto 0);

  signal skipping_r : std_logic := '0';  -- the frame in the window is being dropped
  signal dropping   : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_window: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert VOID_LANES >= 0 and VOID_LANES < max(1, LANES)
    report "firm_axis_window: VOID_LANES is " & integer'image(VOID_LANES) & "; legal: 0 to " & integer'image(LANES-1)
    severity failure;

  dropping <= skip or skipping_r;

  byte_wide : if WIDTH = 8 generate

    window        <= s_axis_tdata;
    available(0)  <= s_axis_tvalid and not skipping_r;
    is_last       <= s_axis_tvalid and s_axis_tlast and not skipping_r;
    is_aborted    <= s_axis_tuser(0);
    is_broken     <= '0';
    shown         <= (s_axis_tvalid and not skipping_r) or not take(0);
    ends          <= s_axis_tlast and take(0);
    s_axis_tready <= dropping or (take_valid and take(0));

    remember_skip : process (clk)
    begin
      if rising_edge(clk) then
        skipping_r <= rst_n and dropping and not (s_axis_tvalid and s_axis_tlast);
      end if;
    end process remember_skip;

  end generate byte_wide;

  -- The slice has its own assert, which must not report first.
  wider : if WIDTH > 8 and is_stream_width(WIDTH) generate

    -- Stage n of the shifter moves by 0 to 3 times this number of lanes. The widest step comes first, so that few
    -- lanes reach the next stage.
    function step_of(stage : positive) return positive is
    begin
      return max(1, LANES / 4**stage);
    end function step_of;

    -- The highest bit that stage n passes to the next one.
    function top_of(stage : positive) return natural is
    begin
      return 8 * (LANES + step_of(stage) - 1) - 1;
    end function top_of;

    -- Of two numbers up to LANES, a power of two: the highest bit is set in LANES alone, which keeps the rest short.
    -- Yosys makes a carry chain of `<`, which is slower at so few bits.
    function is_less(number, bound : count_t) return std_logic is
      variable is_so : std_logic := '0';
    begin
      for place in 0 to COUNT_BITS-2 loop
        is_so := (not number(place) and bound(place)) or (not (number(place) xor bound(place)) and is_so);
      end loop;
      return not number(COUNT_BITS-1) and (bound(COUNT_BITS-1) or is_so);
    end function is_less;

    -- LANES bytes from lane `offset` of 2*LANES-1 lanes.
    function bytes_from(lanes_in : std_logic_vector; offset : unsigned) return std_logic_vector is
      variable moved : std_logic_vector(2*WIDTH-9 downto 0);
      variable digit : std_logic_vector(1 downto 0);
    begin
      moved := lanes_in;
      for stage in 1 to OFFSET_BITS/2 loop
        digit := std_logic_vector(offset(OFFSET_BITS-2*stage+1 downto OFFSET_BITS-2*stage));
        if digit = "01" then
          moved(top_of(stage) downto 0) := moved(top_of(stage)+8*step_of(stage) downto 8*step_of(stage));
        elsif digit = "10" then
          moved(top_of(stage) downto 0) := moved(top_of(stage)+16*step_of(stage) downto 16*step_of(stage));
        elsif digit = "11" then
          moved(top_of(stage) downto 0) := moved(top_of(stage)+24*step_of(stage) downto 24*step_of(stage));
        end if;
      end loop;
      if OFFSET_BITS mod 2 = 1 then
        if offset(0) = '1' then
          moved(WIDTH-1 downto 0) := moved(WIDTH+7 downto 8);
        end if;
      end if;
      return moved(WIDTH-1 downto 0);
    end function bytes_from;

    -- A legal number, so that the assert above reports first.
    constant VOID : natural := max(0, VOID_LANES);

    signal starting_r     : std_logic;         -- the next beat to enter is the first of a frame
    signal cutting_r      : std_logic := '0';  -- it follows a broken beat of its frame
    signal entering       : count_t;           -- the bytes of the beat that enters
    signal entering_user  : std_logic_vector(9 downto 0);
    signal entering_valid : std_logic;
    signal entering_last  : std_logic;
    signal breaks         : std_logic;         -- it is broken
    signal slice_ready    : std_logic;

    -- The beat after the window's first one. In `tuser`, the slice carries the number of its bytes, whether it is the
    -- first of a frame, whether it aborts the frame, and whether it is broken.
    signal next_tdata  : std_logic_vector(WIDTH-1 downto 0);
    signal next_user   : std_logic_vector(9 downto 0);
    signal next_tvalid : std_logic;
    signal next_tlast  : std_logic;
    signal next_first  : std_logic;
    signal next_bytes  : count_t;

    -- The beat in which the window begins.
    signal filled_r : std_logic := '0';  -- the beat is valid
    signal tdata_r  : std_logic_vector(WIDTH-1 downto 0);
    signal last_r   : std_logic := '0';
    signal abort_r  : std_logic;         -- it aborts the frame
    signal broken_r : std_logic;         -- a broken beat ended the frame after it
    signal offset_r : unsigned(OFFSET_BITS-1 downto 0) := (others => '0');  -- the window's first lane
    signal left_r   : count_t := (others => '0');                           -- its bytes from there on

    signal both_beats : std_logic_vector(2*WIDTH-9 downto 0);
    signal joined     : unsigned(COUNT_BITS downto 0);  -- the frame's bytes in both beats
    signal overflow   : std_logic;                      -- they are more than the window shows
    signal ends_next  : std_logic;                      -- the frame ends in the next beat, and within the window
    signal wanted     : count_t;
    signal exceeds    : std_logic;                      -- more bytes are wanted than the first beat holds
    signal empties    : std_logic;                      -- all of them are wanted
    signal has_next   : std_logic;                      -- the next beat belongs to the frame
    signal is_empty   : std_logic;                      -- and holds no byte
    signal move       : std_logic;                      -- the next beat becomes the first
    signal uses_up    : std_logic;                      -- its bytes have already been taken
    signal joined_r   : count_t;                        -- `joined` of the cycle before, unless it overflows
    signal overflow_r : std_logic;                      -- `overflow` of the cycle before
    signal is_same_r  : std_logic := '0';               -- no beat has moved since

    signal s_axis_tready_out : std_logic;

  begin

    -- The last beat of an aborted frame may be empty.
    breaks <= is_broken_beat(s_axis_tkeep, s_axis_tlast) and not (s_axis_tlast and s_axis_tuser(0));

    count_entering : process (s_axis_tkeep, starting_r, breaks)
      variable kept : count_t;
    begin
      kept     := unsigned(lanes_kept(s_axis_tkeep));
      entering <= kept;
      if starting_r = '1' and VOID > 0 then
        entering <= kept - VOID;
        if is_below(std_logic_vector(kept), VOID) = '1' then
          entering <= (others => '0');
        end if;
      end if;
      if breaks = '1' then
        entering <= (others => '0');
      end if;
    end process count_entering;

    follow_frame : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          starting_r <= '1';
          cutting_r  <= '0';
        elsif s_axis_tvalid = '1' and s_axis_tready_out = '1' then
          starting_r <= s_axis_tlast;
          cutting_r  <= (cutting_r or breaks) and not s_axis_tlast;
        end if;
      end if;
    end process follow_frame;

    entering_user     <= breaks & s_axis_tuser & starting_r & std_logic_vector(resize(entering, 7));
    entering_valid    <= s_axis_tvalid and not cutting_r;
    entering_last     <= s_axis_tlast or breaks;
    s_axis_tready_out <= slice_ready or cutting_r;
    s_axis_tready     <= s_axis_tready_out;

    u_slice : entity firm.firm_axis_register_slice
      generic map (
        WIDTH     => WIDTH,
        USER_BITS => 10
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => s_axis_tdata,
        s_axis_tkeep  => s_axis_tkeep,
        s_axis_tuser  => entering_user,
        s_axis_tvalid => entering_valid,
        s_axis_tlast  => entering_last,
        s_axis_tready => slice_ready,
        m_axis_tdata  => next_tdata,
        m_axis_tkeep  => open,
        m_axis_tuser  => next_user,
        m_axis_tvalid => next_tvalid,
        m_axis_tlast  => next_tlast,
        m_axis_tready => move
      );

    next_first <= next_user(7);
    -- Without a beat, the number may be unknown in simulation.
    next_bytes <= to_01(resize(unsigned(next_user(6 downto 0)), COUNT_BITS));

    is_aborted <= abort_r when last_r = '1' else next_user(8);
    is_broken  <= broken_r when last_r = '1' else next_user(9);

    both_beats <= next_tdata(WIDTH-9 downto 0) & tdata_r;
    window     <= bytes_from(both_beats, offset_r);

    joined <= resize(left_r, COUNT_BITS+1) + next_bytes when next_tvalid = '1' and last_r = '0' else
              resize(left_r, COUNT_BITS+1);

    overflow  <= not is_below(std_logic_vector(joined), LANES+1);
    ends_next <= next_tvalid and next_tlast and not last_r and not overflow;

    show_count : process (filled_r, skipping_r, joined, overflow, last_r, ends_next)
    begin
      available <= std_logic_vector(joined(COUNT_BITS-1 downto 0));
      is_last   <= last_r or ends_next;
      if overflow = '1' then
        available <= std_logic_vector(to_unsigned(LANES, COUNT_BITS));
      end if;
      if filled_r = '0' or skipping_r = '1' then
        available <= (others => '0');
        is_last   <= '0';
      end if;
    end process show_count;

    wanted   <= unsigned(take);
    exceeds  <= is_less(left_r, wanted);
    empties  <= not is_less(wanted, left_r);
    has_next <= next_tvalid and not last_r;
    is_empty <= is_equal(std_logic_vector(next_bytes), 0);

    -- A frame's beats are full but for the last one.
    shown <= filled_r and not skipping_r
             and (not exceeds
                  or (has_next
                      and (not next_tlast or (is_same_r and (overflow_r or not is_less(joined_r, wanted))))));
    ends  <= empties when last_r = '1' else
             has_next and next_tlast
             and ((is_empty and empties) or (is_same_r and not overflow_r and not is_less(wanted, joined_r)));

    move    <= not filled_r or dropping or (take_valid and empties);
    uses_up <= filled_r and not dropping and ends_next and take_valid
               and not is_less(wanted, joined(COUNT_BITS-1 downto 0));

    move_beat : process (clk)
    begin
      if rising_edge(clk) and move = '1' then
        tdata_r  <= next_tdata;
        abort_r  <= next_user(8);
        broken_r <= next_user(9);
      end if;
    end process move_beat;

    move_window : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          filled_r   <= '0';
          skipping_r <= '0';
          last_r     <= '0';
          offset_r   <= (others => '0');
          left_r     <= (others => '0');
        else
          skipping_r <= dropping and not (filled_r and last_r);
          joined_r   <= joined(COUNT_BITS-1 downto 0);
          overflow_r <= overflow;
          is_same_r  <= next_tvalid and not move and not take_valid;
          if take_valid = '1' then
            offset_r <= offset_r + wanted(OFFSET_BITS-1 downto 0);
            left_r   <= left_r - wanted;
          end if;
          if move = '1' then
            left_r <= next_bytes;
            if filled_r = '1' and next_first = '0' then
              left_r <= left_r - wanted + next_bytes;
            end if;
            if next_tvalid = '1' and next_first = '1' then
              offset_r <= to_unsigned(VOID, OFFSET_BITS);
            end if;
            filled_r <= next_tvalid and not uses_up;
            last_r   <= next_tlast and next_tvalid;
          end if;
        end if;
      end if;
    end process move_window;

  end generate wider;

end architecture rtl;
