-- geometry_msgs_quaternion_to_axis: the fields of geometry_msgs/Quaternion (ROS 2) to a frame.
--
-- The frame is id (1 byte), length (4 bytes), payload (36 bytes). segment_valid signals valid fields, which
-- must be stable until msg_ready in the cycle of the frame's last beat. The publisher stores only its position.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;

entity geometry_msgs_quaternion_to_axis is
  generic (
    -- the publisher's id at the host: 0 to 255
    ID : natural := 0
  );
  port (
    clk              : in  std_logic;
    rst_n            : in  std_logic;
    -- the message
    x                : in  std_logic_vector(63 downto 0); -- x: float64
    y                : in  std_logic_vector(63 downto 0); -- y: float64
    z                : in  std_logic_vector(63 downto 0); -- z: float64
    w                : in  std_logic_vector(63 downto 0); -- w: float64
    -- its handshake
    segment_valid    : in  std_logic_vector(0 downto 0);
    msg_ready        : out std_logic;
    -- the frame; tuser aborts it if segment_valid falls before its last beat
    m_axis_tdata     : out std_logic_vector(63 downto 0);
    m_axis_tkeep     : out std_logic_vector(7 downto 0);
    m_axis_tuser     : out std_logic_vector(0 downto 0);
    m_axis_tvalid    : out std_logic;
    m_axis_tlast     : out std_logic;
    m_axis_tready    : in  std_logic
  );
end entity;

architecture rtl of geometry_msgs_quaternion_to_axis is

  constant FIRST_POSITION : natural := 0;
  constant LAST_POSITION  : natural := 5;

  -- The whole frame, with its first byte lowest; the first beat has the number FIRST_POSITION.
  signal frame         : std_logic_vector(383 downto 0);
  -- The beat on m_axis.
  signal position_r    : unsigned(2 downto 0) := to_unsigned(FIRST_POSITION, 3);
  signal position_last : std_logic;
  signal withdrawn     : std_logic;

begin

  assert ID <= 255
    report "geometry_msgs_quaternion_to_axis: ID is " & integer'image(ID) & "; legal: 0 to 255"
    severity failure;

  frame(7 downto 0)     <= std_logic_vector(to_unsigned(ID, 8));
  frame(39 downto 8)    <= x"00000024";
  frame(71 downto 40)   <= x"00000100";
  frame(135 downto 72)  <= x;
  frame(199 downto 136) <= y;
  frame(263 downto 200) <= z;
  frame(327 downto 264) <= w;
  frame(383 downto 328) <= x"00000000000000";

  position_last <= '1' when position_r = LAST_POSITION else '0';
  withdrawn     <= '1' when position_r /= FIRST_POSITION and segment_valid(0) = '0' else '0';

  u_select : entity firm.firm_axis_select
    generic map (
      WORDS => LAST_POSITION + 1,
      WIDTH => 64
    )
    port map (
      words_in => frame,
      index    => std_logic_vector(position_r),
      word     => m_axis_tdata
    );

  m_axis_tkeep    <= "00000001" when position_last = '1' else (others => '1');
  m_axis_tuser(0) <= withdrawn;
  m_axis_tvalid   <= segment_valid(0) or withdrawn;
  m_axis_tlast    <= position_last or withdrawn;
  msg_ready       <= segment_valid(0) and m_axis_tready and position_last;

  send : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        position_r <= to_unsigned(FIRST_POSITION, position_r'length);
      elsif (segment_valid(0) = '1' or withdrawn = '1') and m_axis_tready = '1' then
        if position_last = '1' or withdrawn = '1' then
          position_r <= to_unsigned(FIRST_POSITION, position_r'length);
        else
          position_r <= position_r + 1;
        end if;
      end if;
    end if;
  end process;

end architecture;
