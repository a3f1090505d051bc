-- std_msgs_uint16_to_axis: the fields of std_msgs/UInt16 (ROS 1) to a frame.
--
-- The frame is id (1 byte), length (4 bytes), payload (2 bytes). segment_valid signals valid fields, which
-- must be stable until msg_ready. The frame is one beat, so the publisher has no registers.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity std_msgs_uint16_to_axis is
  generic (
    -- the publisher's id at the host: 0 to 255
    ID : natural := 0
  );
  port (
    clk              : in  std_logic;
    rst_n            : in  std_logic;
    -- the message
    data             : in  std_logic_vector(15 downto 0); -- data: uint16
    -- its handshake
    segment_valid    : in  std_logic_vector(0 downto 0);
    msg_ready        : out std_logic;
    -- the frame; tuser is low, since a frame of one beat is never aborted
    m_axis_tdata     : out std_logic_vector(63 downto 0);
    m_axis_tkeep     : out std_logic_vector(7 downto 0);
    m_axis_tuser     : out std_logic_vector(0 downto 0);
    m_axis_tvalid    : out std_logic;
    m_axis_tlast     : out std_logic;
    m_axis_tready    : in  std_logic
  );
end entity;

architecture rtl of std_msgs_uint16_to_axis is

  -- The whole frame, with its first byte lowest.
  signal frame : std_logic_vector(63 downto 0);

begin

  assert ID <= 255
    report "std_msgs_uint16_to_axis: ID is " & integer'image(ID) & "; legal: 0 to 255"
    severity failure;

  frame(7 downto 0)   <= std_logic_vector(to_unsigned(ID, 8));
  frame(39 downto 8)  <= x"00000002";
  frame(55 downto 40) <= data;
  frame(63 downto 56) <= x"00";

  m_axis_tdata    <= frame;
  m_axis_tkeep    <= "01111111";
  m_axis_tuser(0) <= '0';
  m_axis_tvalid   <= segment_valid(0);
  m_axis_tlast    <= '1';
  msg_ready       <= segment_valid(0) and m_axis_tready;

end architecture;
