-- axis_to_awkward_msgs_gaps: a frame of awkward_msgs/Gaps (ROS 2) to its fields.
--
-- s_axis carries the frame behind its id: length (4 bytes), payload (92 bytes). msg_valid rises
-- behind the last byte and stays, with the fields, until msg_ready; the next frame's length may come meanwhile.
-- A broken frame gives one cycle of frame_error instead, and the next frame is received as usual.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity axis_to_awkward_msgs_gaps is
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
    -- a broken frame: 1 its length is not that of the message, 2 it ended early, 3 it went on behind its length,
    -- 4 its encoding is unknown
    frame_error      : out std_logic;
    frame_error_code : out std_logic_vector(3 downto 0)
  );
end entity;

architecture rtl of axis_to_awkward_msgs_gaps is

  subtype code_t is std_logic_vector(3 downto 0);
  constant NO_FAULT     : code_t := "0000";
  constant BAD_LENGTH   : code_t := "0001";
  constant SHORT_FRAME  : code_t := "0010";
  constant LONG_FRAME   : code_t := "0011";
  constant BAD_ENCODING : code_t := "0100";

  -- One behind the last byte that a frame must have, counted from the length's first byte.
  constant END_POSITION : natural := 96;

  -- The byte on s_axis; rests at END_POSITION until tlast.
  signal position_r : unsigned(6 downto 0) := (others => '0');
  -- Bytes behind the last field that the frame announced and that are still to come.
  signal trailing_r : unsigned(1 downto 0) := (others => '0');

  signal ready, beat   : std_logic;
  -- The fault of this beat, and the frame's first fault so far.
  signal beat_fault    : code_t;
  signal fault         : code_t;
  signal fault_r       : code_t := NO_FAULT;
  signal msg_valid_r   : std_logic := '0';
  signal store         : std_logic;
  -- The bytes of the fields; every new one pushes the others down.
  signal fields_r      : std_logic_vector(431 downto 0);

begin

  -- A message that waits to be taken stops the next one's payload, not its length.
  ready         <= '0' when msg_valid_r = '1' and position_r >= 4 else '1';
  beat          <= s_axis_tvalid and ready;
  s_axis_tready <= ready;

  store <= '1' when
      (position_r >= 8 and position_r < 9) or
      (position_r >= 16 and position_r < 26) or
      (position_r >= 32 and position_r < 42) or
      (position_r >= 48 and position_r < 57) or
      (position_r >= 58 and position_r < 65) or
      (position_r >= 72 and position_r < 81) or
      (position_r >= 88 and position_r < 96) else '0';

  -- Each field as it lies among the bytes that were stored.
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

  segment_valid <= (others => msg_valid_r);
  msg_valid     <= msg_valid_r;

  check : process (position_r, s_axis_tdata, s_axis_tlast, fault_r, beat_fault, trailing_r)
  begin
    beat_fault <= NO_FAULT;
    -- The payload's 92 bytes, or up to 3 more that its writer appended.
    if position_r = 0
       and s_axis_tdata /= x"5c"
       and s_axis_tdata /= x"5d"
       and s_axis_tdata /= x"5e"
       and s_axis_tdata /= x"5f"
    then
      beat_fault <= BAD_LENGTH;
    elsif position_r = 1 and s_axis_tdata /= x"00" then
      beat_fault <= BAD_LENGTH;
    elsif position_r = 2 and s_axis_tdata /= x"00" then
      beat_fault <= BAD_LENGTH;
    elsif position_r = 3 and s_axis_tdata /= x"00" then
      beat_fault <= BAD_LENGTH;
    elsif position_r = 4 and s_axis_tdata /= x"00" then
      beat_fault <= BAD_ENCODING;
    elsif position_r = 5 and s_axis_tdata /= x"01" then
      beat_fault <= BAD_ENCODING;
    elsif position_r = END_POSITION and trailing_r = 0 then
      beat_fault <= LONG_FRAME;
    elsif s_axis_tlast = '1' and not ((position_r = END_POSITION - 1 and trailing_r = 0)
                                      or (position_r = END_POSITION and trailing_r = 1)) then
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

        if position_r = 0 then
          -- Of a right length only these two bits are not known beforehand.
          trailing_r <= resize(unsigned(s_axis_tdata) - 92, 2);
        elsif position_r = END_POSITION then
          trailing_r <= trailing_r - 1;
        end if;

        if store = '1' then
          fields_r <= s_axis_tdata & fields_r(431 downto 8);
        end if;
      end if;

      if rst_n = '0' then
        position_r       <= (others => '0');
        fault_r          <= NO_FAULT;
        msg_valid_r      <= '0';
        frame_error      <= '0';
        frame_error_code <= NO_FAULT;
        trailing_r       <= (others => '0');
      end if;
    end if;
  end process;

end architecture;
