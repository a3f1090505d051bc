-- axis_to_awkward_msgs_gaps: a frame of awkward_msgs/Gaps (ROS 2) to its fields.
--
-- s_axis carries the frame without its id: length (4 bytes), payload (92 bytes). msg_valid rises
-- after the last beat and stays high, with the fields stable, until msg_ready.
-- A broken frame causes one cycle of frame_error instead; then the subscriber receives the next frame.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity axis_to_awkward_msgs_gaps is
  port (
    clk              : in  std_logic;
    rst_n            : in  std_logic;
    -- the frame; tkeep is ignored, since every beat of an 8-bit stream holds its byte
    s_axis_tdata     : in  std_logic_vector(7 downto 0);
    s_axis_tkeep     : in  std_logic_vector(0 downto 0);
    s_axis_tvalid    : in  std_logic;
    s_axis_tlast     : in  std_logic;
    s_axis_tready    : out std_logic;
    -- the message
    elements_flag    : out std_logic_vector(2 downto 0);   -- elements[3].flag: bool
    elements_value   : out std_logic_vector(191 downto 0); -- elements[3].value: float64
    elements_tail    : out std_logic_vector(23 downto 0);  -- elements[3].tail: uint8
    triple           : out std_logic_vector(47 downto 0);  -- triple[3]: uint16
    single_flag      : out std_logic;                      -- single.flag: bool
    single_value     : out std_logic_vector(63 downto 0);  -- single.value: float64
    single_tail      : out std_logic_vector(7 downto 0);   -- single.tail: uint8
    last             : out std_logic_vector(63 downto 0);  -- last: int64
    -- its handshake
    segment_valid    : out std_logic_vector(0 downto 0);
    msg_valid        : out std_logic;
    msg_ready        : in  std_logic;
    -- a broken frame: 1 its length is not that of the message, 2 it ended early, 3 it continued after its length,
    -- 4 its encoding is unknown; the code is valid while frame_error is high
    frame_error      : out std_logic;
    frame_error_code : out std_logic_vector(3 downto 0)
  );
end entity;

architecture rtl of axis_to_awkward_msgs_gaps is

  subtype code_t is std_logic_vector(2 downto 0);
  constant NO_FAULT     : code_t := "000";
  constant BAD_LENGTH   : code_t := "001";
  constant SHORT_FRAME  : code_t := "010";
  constant LONG_FRAME   : code_t := "011";
  constant BAD_ENCODING : code_t := "100";
  constant NO_LENGTH    : std_logic_vector(3 downto 0) := (others => '0');

  -- The beat on s_axis, counted from the length's first beat. Values from BROKEN on are states after the last beat:
  -- BROKEN + code    the frame has a fault, and is skipped up to its end
  -- ENDED + code     the frame has ended, and its fault is reported
  -- COMPLETE         the message waits to be accepted; a frame that ended early is not skipped, so this code is free
  -- A code has two bits.
  subtype position_t is unsigned(6 downto 0);
  constant BROKEN       : position_t := "1110000";
  constant ENDED        : position_t := "1110100";
  constant COMPLETE     : position_t := "1110010";
  signal position_r     : position_t := (others => '0');
  signal next_position  : position_t;
  signal beyond         : std_logic;
  signal is_first       : std_logic;
  signal is_waiting     : std_logic;
  signal is_told        : std_logic;

  -- The possible lengths so far: bit k stands for k bytes more than the payload's 92 bytes.
  signal match_r        : std_logic_vector(3 downto 0) := (others => '0');
  signal match          : std_logic_vector(3 downto 0);
  signal fault          : code_t;
  signal ready          : std_logic;
  signal beat           : std_logic;
  -- The bytes of the fields; the bytes of a new beat shift the older ones down.
  signal store    : std_logic;
  signal fields_r : std_logic_vector(431 downto 0);

begin

  beyond     <= '1' when position_r(6 downto 4) = "111" else '0';
  is_waiting <= '1' when beyond = '1' and position_r(2 downto 0) = COMPLETE(2 downto 0) else '0';
  is_told    <= beyond and position_r(2);
  is_first   <= '1' when position_r = 0 or is_waiting = '1' else '0';

  -- The next frame starts in the cycle in which the message is accepted, but not in the one that reports a fault.
  ready         <= not is_told and (msg_ready or not is_waiting);
  beat          <= s_axis_tvalid and ready;
  s_axis_tready <= ready;

  store <= '1' when
      position_r = 8 or
      (position_r >= 16 and position_r <= 25) or
      (position_r >= 32 and position_r <= 41) or
      (position_r >= 48 and position_r <= 56) or
      (position_r >= 58 and position_r <= 64) or
      (position_r >= 72 and position_r <= 80) or
      (position_r >= 88 and position_r <= 95) else '0';

  -- Each field from its bytes in the stores.
  elements_flag(0)               <= '0' when fields_r(7 downto 0) = x"00" else '1';
  elements_flag(1)               <= '0' when fields_r(87 downto 80) = x"00" else '1';
  elements_flag(2)               <= '0' when fields_r(167 downto 160) = x"00" else '1';
  elements_value(63 downto 0)    <= fields_r(71 downto 8);
  elements_value(127 downto 64)  <= fields_r(151 downto 88);
  elements_value(191 downto 128) <= fields_r(231 downto 168);
  elements_tail(7 downto 0)      <= fields_r(79 downto 72);
  elements_tail(15 downto 8)     <= fields_r(159 downto 152);
  elements_tail(23 downto 16)    <= fields_r(239 downto 232);
  triple                         <= fields_r(287 downto 240);
  single_flag                    <= '0' when fields_r(295 downto 288) = x"00" else '1';
  single_value                   <= fields_r(359 downto 296);
  single_tail                    <= fields_r(367 downto 360);
  last                           <= fields_r(431 downto 368);

  segment_valid    <= (others => is_waiting);
  msg_valid        <= is_waiting;
  frame_error      <= is_told;
  frame_error_code <= '0' & BAD_ENCODING when position_r(1 downto 0) = "00"
                      else "00" & std_logic_vector(position_r(1 downto 0));

  compare : process (position_r, is_first, s_axis_tdata, match_r)
  begin
    match <= (others => '1');
    if is_first = '0' then
      match <= match_r;
    end if;
    if is_first = '1' then
      if
          s_axis_tdata /= x"5c"
      then
        match(0) <= '0';
      end if;
      if
          s_axis_tdata /= x"5d"
      then
        match(1) <= '0';
      end if;
      if
          s_axis_tdata /= x"5e"
      then
        match(2) <= '0';
      end if;
      if
          s_axis_tdata /= x"5f"
      then
        match(3) <= '0';
      end if;
    elsif position_r = 1 then
      if
          s_axis_tdata /= x"00"
      then
        match(0) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(1) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(2) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(3) <= '0';
      end if;
    elsif position_r = 2 then
      if
          s_axis_tdata /= x"00"
      then
        match(0) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(1) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(2) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(3) <= '0';
      end if;
    elsif position_r = 3 then
      if
          s_axis_tdata /= x"00"
      then
        match(0) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(1) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(2) <= '0';
      end if;
      if
          s_axis_tdata /= x"00"
      then
        match(3) <= '0';
      end if;
    end if;
  end process;

  check : process (position_r, is_first, s_axis_tdata, s_axis_tlast, match)
  begin
    fault <= NO_FAULT;
    if match = NO_LENGTH then
      fault <= BAD_LENGTH;
    elsif position_r = 4 and s_axis_tdata /= x"00" then
      fault <= BAD_ENCODING;
    elsif position_r = 5 and s_axis_tdata /= x"01" then
      fault <= BAD_ENCODING;
    elsif match(0) = '1' and position_r = 95 then
      if s_axis_tlast = '0' then
        fault <= LONG_FRAME;
      end if;
    elsif match(1) = '1' and position_r = 96 then
      if s_axis_tlast = '0' then
        fault <= LONG_FRAME;
      end if;
    elsif match(2) = '1' and position_r = 97 then
      if s_axis_tlast = '0' then
        fault <= LONG_FRAME;
      end if;
    elsif match(3) = '1' and position_r = 98 then
      if s_axis_tlast = '0' then
        fault <= LONG_FRAME;
      end if;
    elsif s_axis_tlast = '1' then
      fault <= SHORT_FRAME;
    end if;
  end process;

  follow : process (position_r, beyond, is_first, s_axis_tlast, fault)
  begin
    if beyond = '1' and is_first = '0' then
      -- The first fault of a frame is the one reported.
      next_position <= position_r;
      if s_axis_tlast = '1' then
        next_position <= position_r or ENDED;
      end if;
    elsif fault /= NO_FAULT then
      next_position <= BROKEN or resize(unsigned(fault(1 downto 0)), position_t'length);
      if s_axis_tlast = '1' then
        next_position <= ENDED or resize(unsigned(fault(1 downto 0)), position_t'length);
      end if;
    elsif s_axis_tlast = '1' then
      next_position <= COMPLETE;
    elsif is_first = '1' then
      next_position <= to_unsigned(1, position_t'length);
    else
      next_position <= position_r + 1;
    end if;
  end process;

  receive : process (clk)
  begin
    if rising_edge(clk) then
      if beat = '1' then
        position_r <= next_position;
        match_r    <= match;
        if store = '1' then
          fields_r <=
              s_axis_tdata(7 downto 0) &
              fields_r(431 downto 8);
        end if;
      elsif is_told = '1' or (is_waiting = '1' and msg_ready = '1') then
        position_r <= (others => '0');
      end if;
      if rst_n = '0' then
        position_r <= (others => '0');
      end if;
    end if;
  end process;

end architecture;
