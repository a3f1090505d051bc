-- axis_to_geometry_msgs_quaternion: a frame of geometry_msgs/Quaternion (ROS 1) to its fields.
--
-- s_axis carries the frame without its id: length (4 bytes), payload (32 bytes). msg_valid rises
-- after the last beat and stays high, with the fields stable, until msg_ready.
-- A broken frame causes one cycle of frame_error instead; then the subscriber receives the next frame.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity axis_to_geometry_msgs_quaternion is
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
    x                : out std_logic_vector(63 downto 0); -- x: float64
    y                : out std_logic_vector(63 downto 0); -- y: float64
    z                : out std_logic_vector(63 downto 0); -- z: float64
    w                : out std_logic_vector(63 downto 0); -- w: float64
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

architecture rtl of axis_to_geometry_msgs_quaternion is

  subtype code_t is std_logic_vector(2 downto 0);
  constant NO_FAULT     : code_t := "000";
  constant BAD_LENGTH   : code_t := "001";
  constant SHORT_FRAME  : code_t := "010";
  constant LONG_FRAME   : code_t := "011";
  constant NO_LENGTH    : std_logic_vector(0 downto 0) := (others => '0');

  -- The beat on s_axis, counted from the length's first beat. Values from BROKEN on are states after the last beat:
  -- BROKEN + code    the frame has a fault, and is skipped up to its end
  -- ENDED + code     the frame has ended, and its fault is reported
  -- COMPLETE         the message waits to be accepted; a frame that ended early is not skipped, so this code is free
  -- A code has two bits.
  subtype position_t is unsigned(5 downto 0);
  constant BROKEN       : position_t := "110000";
  constant ENDED        : position_t := "110100";
  constant COMPLETE     : position_t := "110010";
  signal position_r     : position_t := (others => '0');
  signal next_position  : position_t;
  signal beyond         : std_logic;
  signal is_first       : std_logic;
  signal is_waiting     : std_logic;
  signal is_told        : std_logic;

  -- Whether the length's bytes in this beat are correct.
  signal match          : std_logic_vector(0 downto 0);
  signal fault          : code_t;
  signal ready          : std_logic;
  signal beat           : std_logic;
  -- The bytes of the fields; the bytes of a new beat shift the older ones down.
  signal store    : std_logic;
  signal fields_r : std_logic_vector(255 downto 0);

begin

  beyond     <= '1' when position_r(5 downto 4) = "11" else '0';
  is_waiting <= '1' when beyond = '1' and position_r(2 downto 0) = COMPLETE(2 downto 0) else '0';
  is_told    <= beyond and position_r(2);
  is_first   <= '1' when position_r = 0 or is_waiting = '1' else '0';

  -- The next frame starts in the cycle in which the message is accepted, but not in the one that reports a fault.
  ready         <= not is_told and (msg_ready or not is_waiting);
  beat          <= s_axis_tvalid and ready;
  s_axis_tready <= ready;

  store <= '1' when
      (position_r >= 4 and position_r <= 35) else '0';

  -- Each field from its bytes in the stores.
  x <= fields_r(63 downto 0);
  y <= fields_r(127 downto 64);
  z <= fields_r(191 downto 128);
  w <= fields_r(255 downto 192);

  segment_valid    <= (others => is_waiting);
  msg_valid        <= is_waiting;
  frame_error      <= is_told;
  frame_error_code <= "00" & std_logic_vector(position_r(1 downto 0));

  compare : process (position_r, is_first, s_axis_tdata)
  begin
    match <= (others => '1');
    if is_first = '1' then
      if
          s_axis_tdata /= x"20"
      then
        match(0) <= '0';
      end if;
    elsif position_r = 1 then
      if
          s_axis_tdata /= x"00"
      then
        match(0) <= '0';
      end if;
    elsif position_r = 2 then
      if
          s_axis_tdata /= x"00"
      then
        match(0) <= '0';
      end if;
    elsif position_r = 3 then
      if
          s_axis_tdata /= x"00"
      then
        match(0) <= '0';
      end if;
    end if;
  end process;

  check : process (position_r, is_first, s_axis_tdata, s_axis_tlast, match)
  begin
    fault <= NO_FAULT;
    if match = NO_LENGTH then
      fault <= BAD_LENGTH;
    elsif position_r = 35 then
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
        if store = '1' then
          fields_r <=
              s_axis_tdata(7 downto 0) &
              fields_r(255 downto 8);
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
