-- awkward_msgs_gaps_to_axis: the fields of awkward_msgs/Gaps (ROS 2) to a frame.
--
-- The frame is id (1 byte), length (4 bytes), payload (92 bytes). segment_valid signals valid fields, which
-- must be stable until msg_ready in the cycle of the frame's last beat. The publisher stores only its position.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;

entity awkward_msgs_gaps_to_axis is
  generic (
    -- the publisher's id at the host: 0 to 255
    ID : natural := 0
  );
  port (
    clk              : in  std_logic;
    rst_n            : in  std_logic;
    -- the message
    elements_flag    : in  std_logic_vector(2 downto 0);   -- elements[3].flag: bool
    elements_value   : in  std_logic_vector(191 downto 0); -- elements[3].value: float64
    elements_tail    : in  std_logic_vector(23 downto 0);  -- elements[3].tail: uint8
    triple           : in  std_logic_vector(47 downto 0);  -- triple[3]: uint16
    single_flag      : in  std_logic;                      -- single.flag: bool
    single_value     : in  std_logic_vector(63 downto 0);  -- single.value: float64
    single_tail      : in  std_logic_vector(7 downto 0);   -- single.tail: uint8
    last             : in  std_logic_vector(63 downto 0);  -- last: int64
    -- its handshake
    segment_valid    : in  std_logic_vector(0 downto 0);
    msg_ready        : out std_logic;
    -- the frame; tuser aborts it if segment_valid falls before its last beat
    m_axis_tdata     : out std_logic_vector(7 downto 0);
    m_axis_tkeep     : out std_logic_vector(0 downto 0);
    m_axis_tuser     : out std_logic_vector(0 downto 0);
    m_axis_tvalid    : out std_logic;
    m_axis_tlast     : out std_logic;
    m_axis_tready    : in  std_logic
  );
end entity;

architecture rtl of awkward_msgs_gaps_to_axis is

  constant FIRST_POSITION : natural := 3;
  constant LAST_POSITION  : natural := 99;

  -- The whole frame, with its first byte lowest; the first beat has the number FIRST_POSITION.
  signal frame         : std_logic_vector(799 downto 0);
  -- The beat on m_axis.
  signal position_r    : unsigned(6 downto 0) := to_unsigned(FIRST_POSITION, 7);
  signal position_last : std_logic;
  signal withdrawn     : std_logic;

begin

  assert ID <= 255
    report "awkward_msgs_gaps_to_axis: ID is " & integer'image(ID) & "; legal: 0 to 255"
    severity failure;

  frame(23 downto 0)    <= x"000000";
  frame(31 downto 24)   <= std_logic_vector(to_unsigned(ID, 8));
  frame(63 downto 32)   <= x"0000005c";
  frame(95 downto 64)   <= x"00000100";
  frame(159 downto 104) <= x"00000000000000";
  frame(287 downto 240) <= x"000000000000";
  frame(415 downto 368) <= x"000000000000";
  frame(495 downto 488) <= x"00";
  frame(607 downto 552) <= x"00000000000000";
  frame(735 downto 680) <= x"00000000000000";
  frame(103 downto 96)  <= "0000000" & elements_flag(0);
  frame(239 downto 232) <= "0000000" & elements_flag(1);
  frame(367 downto 360) <= "0000000" & elements_flag(2);
  frame(223 downto 160) <= elements_value(63 downto 0);
  frame(351 downto 288) <= elements_value(127 downto 64);
  frame(479 downto 416) <= elements_value(191 downto 128);
  frame(231 downto 224) <= elements_tail(7 downto 0);
  frame(359 downto 352) <= elements_tail(15 downto 8);
  frame(487 downto 480) <= elements_tail(23 downto 16);
  frame(543 downto 496) <= triple;
  frame(551 downto 544) <= "0000000" & single_flag;
  frame(671 downto 608) <= single_value;
  frame(679 downto 672) <= single_tail;
  frame(799 downto 736) <= last;

  position_last <= '1' when position_r = LAST_POSITION else '0';
  withdrawn     <= '1' when position_r /= FIRST_POSITION and segment_valid(0) = '0' else '0';

  u_select : entity firm.firm_axis_select
    generic map (
      WORDS => LAST_POSITION + 1,
      WIDTH => 8
    )
    port map (
      words_in => frame,
      index    => std_logic_vector(position_r),
      word     => m_axis_tdata
    );

  m_axis_tkeep    <= (others => '1');
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
