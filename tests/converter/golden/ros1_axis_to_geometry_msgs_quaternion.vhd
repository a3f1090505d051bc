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
    s_axis_tuser     : in  std_logic_vector(0 downto 0) := "0";  -- on the last beat: the sender aborted the frame
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
    -- 4 its encoding is unknown,
    -- 10 its sender aborted it; the code is valid while frame_error is high
    frame_error      : out std_logic;
    frame_error_code : out std_logic_vector(3 downto 0)
  );
end entity;

architecture rtl of axis_to_geometry_msgs_quaternion is

  subtype code_t is std_logic_vector(3 downto 0);
  constant NO_FAULT     : code_t := "0000";
  constant BAD_LENGTH   : code_t := "0001";
  constant SHORT_FRAME  : code_t := "0010";
  constant LONG_FRAME   : code_t := "0011";
  constant ABORTED      : code_t := "1010";
  constant NO_LENGTH    : std_logic_vector(0 downto 0) := (others => '0');

  -- The beat on s_axis, counted from the length's first beat. After a fault, its low bits are the code.
  -- Then stores may change, since their frame is lost.
  subtype position_t is unsigned(5 downto 0);
  signal position_r     : position_t := (others => '0');
  signal next_position  : position_t;
  signal is_first       : std_logic;

  -- The state is one-hot, so that s_axis_tready is one LUT.
  signal broken_r       : std_logic := '0';  -- the frame has a fault, and is skipped up to its end
  signal ended_r        : std_logic := '0';  -- the frame has ended, and its fault is reported
  signal complete_r     : std_logic := '0';  -- the message waits to be accepted
  signal next_broken    : std_logic;
  signal next_ended     : std_logic;
  signal next_complete  : std_logic;

  -- Whether the length's bytes in this beat are correct.
  signal match          : std_logic_vector(0 downto 0);
  signal fault          : code_t;
  signal ready          : std_logic;
  signal beat           : std_logic;
  -- The bytes of the fields; the bytes of a new beat shift the older ones down.
  signal store    : std_logic;
  signal fields_r : std_logic_vector(255 downto 0);

begin

  is_first <= '1' when position_r = 0 else '0';

  -- The next frame starts in the cycle in which the message is accepted, but not in the one that reports a fault.
  ready         <= not ended_r and (msg_ready or not complete_r);
  beat          <= s_axis_tvalid and ready;
  s_axis_tready <= ready;

  store <= '1';

  -- Each field from its bytes in the stores.
  x <= fields_r(63 downto 0);
  y <= fields_r(127 downto 64);
  z <= fields_r(191 downto 128);
  w <= fields_r(255 downto 192);

  segment_valid    <= (others => complete_r);
  msg_valid        <= complete_r;
  frame_error      <= ended_r;
  frame_error_code <= std_logic_vector(position_r(code_t'range));

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

  check : process (position_r, is_first, s_axis_tdata, s_axis_tuser, s_axis_tlast, match)
  begin
    fault <= NO_FAULT;
    if match = NO_LENGTH then
      fault <= BAD_LENGTH;
    elsif s_axis_tlast = '1' and s_axis_tuser = "1" then
      fault <= ABORTED;
    elsif position_r = 35 then
      if s_axis_tlast = '0' then
        fault <= LONG_FRAME;
      end if;
    elsif s_axis_tlast = '1' then
      fault <= SHORT_FRAME;
    end if;
  end process;

  follow : process (position_r, broken_r, s_axis_tlast, fault)
  begin
    next_position <= position_r + 1;
    next_broken   <= '0';
    next_ended    <= '0';
    next_complete <= '0';
    if broken_r = '1' or fault /= NO_FAULT then
      -- The first fault of a frame is the one reported.
      next_position <= position_r;
      if broken_r = '0' then
        next_position <= resize(unsigned(fault), position_t'length);
      end if;
      next_broken <= not s_axis_tlast;
      next_ended  <= s_axis_tlast;
    elsif s_axis_tlast = '1' then
      next_position <= (others => '0');
      next_complete <= '1';
    end if;
  end process;

  receive : process (clk)
  begin
    if rising_edge(clk) then
      if beat = '1' then
        position_r <= next_position;
        broken_r   <= next_broken;
        ended_r    <= next_ended;
        complete_r <= next_complete;
        if store = '1' then
          fields_r <=
              s_axis_tdata(7 downto 0) &
              fields_r(255 downto 8);
        end if;
      elsif ended_r = '1' or msg_ready = '1' then
        ended_r    <= '0';
        complete_r <= '0';
      end if;
      if rst_n = '0' or ended_r = '1' then
        position_r <= (others => '0');
      end if;
      if rst_n = '0' then
        broken_r   <= '0';
        ended_r    <= '0';
        complete_r <= '0';
      end if;
    end if;
  end process;

end architecture;
