-- axis_to_geometry_msgs_quaternion: a frame of geometry_msgs/Quaternion (ROS 2) to its fields.
--
-- s_axis carries the frame behind its id: length (4 bytes), payload (36 bytes). msg_valid rises
-- behind the last beat and stays, with the fields, until msg_ready.
-- A broken frame gives one cycle of frame_error instead, and the next frame is received as usual.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity axis_to_geometry_msgs_quaternion is
  port (
    clk              : in  std_logic;
    rst_n            : in  std_logic;
    -- the frame: the lowest lane of its first beat held the id and is void
    s_axis_tdata     : in  std_logic_vector(63 downto 0);
    s_axis_tkeep     : in  std_logic_vector(7 downto 0);
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
    -- a broken frame: 1 its length is not that of the message, 2 it ended early, 3 it went on behind its length,
    -- 4 its encoding is unknown
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
  constant BAD_ENCODING : code_t := "0100";

  -- The beat with the last byte that a frame may have, counted from the length's.
  constant LAST_POSITION : natural := 5;
  constant NO_LENGTH     : std_logic_vector(3 downto 0) := (others => '0');

  -- The beat on s_axis; rests at LAST_POSITION until tlast.
  signal position_r : unsigned(2 downto 0) := (others => '0');
  -- Which length the bytes so far can be: bit k that of the payload's 36 bytes and k that its writer appended.
  signal match      : std_logic_vector(3 downto 0);
  signal match_r    : std_logic_vector(3 downto 0) := (others => '0');

  signal ready, beat   : std_logic;
  -- The fault of this beat, and the frame's first fault so far.
  signal beat_fault    : code_t;
  signal fault         : code_t;
  signal fault_r       : code_t := NO_FAULT;
  signal msg_valid_r   : std_logic := '0';
  -- The bytes of the fields; those of a new beat push the others down.
  signal store_0    : std_logic;
  signal fields_0_r : std_logic_vector(31 downto 0);
  signal store_1    : std_logic;
  signal fields_1_r : std_logic_vector(223 downto 0);

begin

  -- The first beat brings payload already, so the next frame starts in the cycle in which the message is taken.
  ready         <= msg_ready or not msg_valid_r;
  beat          <= s_axis_tvalid and ready;
  s_axis_tready <= ready;

  store_0 <= '1' when
      (position_r >= 2 and position_r <= 5) else '0';

  store_1 <= '1' when
      (position_r >= 1 and position_r <= 4) else '0';

  -- Each field as it lies among the bytes that were stored.
  x(55 downto 0)  <= fields_1_r(55 downto 0);
  x(63 downto 56) <= fields_0_r(7 downto 0);
  y(55 downto 0)  <= fields_1_r(111 downto 56);
  y(63 downto 56) <= fields_0_r(15 downto 8);
  z(55 downto 0)  <= fields_1_r(167 downto 112);
  z(63 downto 56) <= fields_0_r(23 downto 16);
  w(55 downto 0)  <= fields_1_r(223 downto 168);
  w(63 downto 56) <= fields_0_r(31 downto 24);

  segment_valid <= (others => msg_valid_r);
  msg_valid     <= msg_valid_r;

  compare : process (position_r, s_axis_tdata, s_axis_tkeep, match_r)
  begin
    match <= match_r;
    if position_r = 0 then
      match <= (others => '1');
      if
          (s_axis_tkeep(1) = '1' and s_axis_tdata(15 downto 8) /= x"24") or
          (s_axis_tkeep(2) = '1' and s_axis_tdata(23 downto 16) /= x"00") or
          (s_axis_tkeep(3) = '1' and s_axis_tdata(31 downto 24) /= x"00") or
          (s_axis_tkeep(4) = '1' and s_axis_tdata(39 downto 32) /= x"00")
      then
        match(0) <= '0';
      end if;
      if
          (s_axis_tkeep(1) = '1' and s_axis_tdata(15 downto 8) /= x"25") or
          (s_axis_tkeep(2) = '1' and s_axis_tdata(23 downto 16) /= x"00") or
          (s_axis_tkeep(3) = '1' and s_axis_tdata(31 downto 24) /= x"00") or
          (s_axis_tkeep(4) = '1' and s_axis_tdata(39 downto 32) /= x"00")
      then
        match(1) <= '0';
      end if;
      if
          (s_axis_tkeep(1) = '1' and s_axis_tdata(15 downto 8) /= x"26") or
          (s_axis_tkeep(2) = '1' and s_axis_tdata(23 downto 16) /= x"00") or
          (s_axis_tkeep(3) = '1' and s_axis_tdata(31 downto 24) /= x"00") or
          (s_axis_tkeep(4) = '1' and s_axis_tdata(39 downto 32) /= x"00")
      then
        match(2) <= '0';
      end if;
      if
          (s_axis_tkeep(1) = '1' and s_axis_tdata(15 downto 8) /= x"27") or
          (s_axis_tkeep(2) = '1' and s_axis_tdata(23 downto 16) /= x"00") or
          (s_axis_tkeep(3) = '1' and s_axis_tdata(31 downto 24) /= x"00") or
          (s_axis_tkeep(4) = '1' and s_axis_tdata(39 downto 32) /= x"00")
      then
        match(3) <= '0';
      end if;
    end if;
  end process;

  check : process (position_r, s_axis_tdata, s_axis_tkeep, s_axis_tlast, match, fault_r, beat_fault)
  begin
    beat_fault <= NO_FAULT;
    if match = NO_LENGTH then
      beat_fault <= BAD_LENGTH;
    elsif position_r = 0 and s_axis_tkeep(5) = '1' and s_axis_tdata(47 downto 40) /= x"00" then
      beat_fault <= BAD_ENCODING;
    elsif position_r = 0 and s_axis_tkeep(6) = '1' and s_axis_tdata(55 downto 48) /= x"01" then
      beat_fault <= BAD_ENCODING;
    elsif match(0) = '1' and position_r = 5 then
      if s_axis_tlast = '0' or s_axis_tkeep(1) = '1' then
        beat_fault <= LONG_FRAME;
      elsif s_axis_tkeep(0) = '0' then
        beat_fault <= SHORT_FRAME;
      end if;
    elsif match(1) = '1' and position_r = 5 then
      if s_axis_tlast = '0' or s_axis_tkeep(2) = '1' then
        beat_fault <= LONG_FRAME;
      elsif s_axis_tkeep(1) = '0' then
        beat_fault <= SHORT_FRAME;
      end if;
    elsif match(2) = '1' and position_r = 5 then
      if s_axis_tlast = '0' or s_axis_tkeep(3) = '1' then
        beat_fault <= LONG_FRAME;
      elsif s_axis_tkeep(2) = '0' then
        beat_fault <= SHORT_FRAME;
      end if;
    elsif match(3) = '1' and position_r = 5 then
      if s_axis_tlast = '0' or s_axis_tkeep(4) = '1' then
        beat_fault <= LONG_FRAME;
      elsif s_axis_tkeep(3) = '0' then
        beat_fault <= SHORT_FRAME;
      end if;
    elsif s_axis_tlast = '1' then
      beat_fault <= SHORT_FRAME;
    end if;

    -- The first fault of a frame is the one that is told.
    fault <= fault_r;
    if fault_r = NO_FAULT then
      fault <= beat_fault;
    end if;
  end process;

  receive : process (clk)
  begin
    if rising_edge(clk) then
      frame_error <= '0';
      if msg_ready = '1' then
        msg_valid_r <= '0';
      end if;

      if beat = '1' then
        if s_axis_tlast = '1' then
          position_r <= (others => '0');
          fault_r    <= NO_FAULT;
          if fault = NO_FAULT then
            msg_valid_r <= '1';
          else
            frame_error      <= '1';
            frame_error_code <= fault;
          end if;
        else
          fault_r <= fault;
          if position_r /= LAST_POSITION then
            position_r <= position_r + 1;
          end if;
        end if;
        match_r <= match;

        if store_0 = '1' then
          fields_0_r <=
              s_axis_tdata(7 downto 0) &
              fields_0_r(31 downto 8);
        end if;

        if store_1 = '1' then
          fields_1_r <=
              s_axis_tdata(63 downto 8) &
              fields_1_r(223 downto 56);
        end if;
      end if;

      if rst_n = '0' then
        position_r       <= (others => '0');
        fault_r          <= NO_FAULT;
        msg_valid_r      <= '0';
        frame_error      <= '0';
        frame_error_code <= NO_FAULT;
      end if;
    end if;
  end process;

end architecture;
