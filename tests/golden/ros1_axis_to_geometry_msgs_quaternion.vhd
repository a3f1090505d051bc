-- axis_to_geometry_msgs_quaternion: a frame of geometry_msgs/Quaternion (ROS 1) to its fields.
--
-- s_axis carries the frame behind its id: length (4 bytes), payload (32 bytes). msg_valid rises
-- behind the last byte and stays, with the fields, until msg_ready; the next frame's length may come meanwhile.
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
    -- the frame: tkeep is not read, every beat of a stream of 8 bits holds its byte
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

  -- One behind the last byte that a frame must have, counted from the length's first byte.
  constant END_POSITION : natural := 36;

  -- The byte on s_axis; rests at END_POSITION until tlast.
  signal position_r : unsigned(5 downto 0) := (others => '0');

  signal ready, beat   : std_logic;
  -- The fault of this beat, and the frame's first fault so far.
  signal beat_fault    : code_t;
  signal fault         : code_t;
  signal fault_r       : code_t := NO_FAULT;
  signal msg_valid_r   : std_logic := '0';
  signal store         : std_logic;
  -- The bytes of the fields; every new one pushes the others down.
  signal fields_r      : std_logic_vector(255 downto 0);

begin

  -- A message that waits to be taken stops the next one's payload, not its length.
  ready         <= '0' when msg_valid_r = '1' and position_r >= 4 else '1';
  beat          <= s_axis_tvalid and ready;
  s_axis_tready <= ready;

  store <= '1' when
      (position_r >= 4 and position_r < 36) else '0';

  -- Each field as it lies among the bytes that were stored.
  x <= fields_r(63 downto 0);
  y <= fields_r(127 downto 64);
  z <= fields_r(191 downto 128);
  w <= fields_r(255 downto 192);

  segment_valid <= (others => msg_valid_r);
  msg_valid     <= msg_valid_r;

  check : process (position_r, s_axis_tdata, s_axis_tlast, fault_r, beat_fault)
  begin
    beat_fault <= NO_FAULT;
    if position_r = 0
       and s_axis_tdata /= x"20"
    then
      beat_fault <= BAD_LENGTH;
    elsif position_r = 1 and s_axis_tdata /= x"00" then
      beat_fault <= BAD_LENGTH;
    elsif position_r = 2 and s_axis_tdata /= x"00" then
      beat_fault <= BAD_LENGTH;
    elsif position_r = 3 and s_axis_tdata /= x"00" then
      beat_fault <= BAD_LENGTH;
    elsif position_r = END_POSITION then
      beat_fault <= LONG_FRAME;
    elsif s_axis_tlast = '1' and position_r /= END_POSITION - 1 then
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
          if position_r /= END_POSITION then
            position_r <= position_r + 1;
          end if;
        end if;

        if store = '1' then
          fields_r <= s_axis_tdata & fields_r(255 downto 8);
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
