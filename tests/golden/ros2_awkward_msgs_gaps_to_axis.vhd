-- awkward_msgs_gaps_to_axis: the fields of awkward_msgs/Gaps (ROS 2) to a frame.
--
-- The frame is id (1 byte), length (4 bytes), payload (92 bytes). segment_valid says that the fields hold;
-- they must do so until msg_ready, which comes with the frame's last byte. Nothing is stored but the position.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;

entity awkward_msgs_gaps_to_axis is
  generic (
    -- the id that the host knows this publisher by: 0 to 255
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
    -- the frame
    m_axis_tdata     : out std_logic_vector(7 downto 0);
    m_axis_tkeep     : out std_logic_vector(0 downto 0);
    m_axis_tvalid    : out std_logic;
    m_axis_tlast     : out std_logic;
    m_axis_tready    : in  std_logic
  );
end entity;

architecture rtl of awkward_msgs_gaps_to_axis is

  constant FRAME_BYTES : natural := 97;

  -- The whole frame, its first byte lowest.
  signal frame         : std_logic_vector(775 downto 0);
  -- The byte on m_axis.
  signal position_r    : unsigned(6 downto 0) := (others => '0');
  signal position_last : std_logic;

begin

  assert ID <= 255
    report "awkward_msgs_gaps_to_axis: ID is " & integer'image(ID) & "; legal are 0 to 255"
    severity failure;

  frame(7 downto 0)     <= std_logic_vector(to_unsigned(ID, 8));
  frame(39 downto 8)    <= x"0000005c";
  frame(71 downto 40)   <= x"00000100";
  frame(135 downto 80)  <= x"00000000000000";
  frame(263 downto 216) <= x"000000000000";
  frame(391 downto 344) <= x"000000000000";
  frame(471 downto 464) <= x"00";
  frame(583 downto 528) <= x"00000000000000";
  frame(711 downto 656) <= x"00000000000000";
  frame(79 downto 72)   <= "0000000" & elements_flag(0);
  frame(215 downto 208) <= "0000000" & elements_flag(1);
  frame(343 downto 336) <= "0000000" & elements_flag(2);
  frame(199 downto 136) <= elements_value(63 downto 0);
  frame(327 downto 264) <= elements_value(127 downto 64);
  frame(455 downto 392) <= elements_value(191 downto 128);
  frame(207 downto 200) <= elements_tail(7 downto 0);
  frame(335 downto 328) <= elements_tail(15 downto 8);
  frame(463 downto 456) <= elements_tail(23 downto 16);
  frame(519 downto 472) <= triple;
  frame(527 downto 520) <= "0000000" & single_flag;
  frame(647 downto 584) <= single_value;
  frame(655 downto 648) <= single_tail;
  frame(775 downto 712) <= last;

  position_last <= '1' when position_r = FRAME_BYTES - 1 else '0';

  u_select : entity firm.firm_axis_select
    generic map (
      WORDS => FRAME_BYTES,
      WIDTH => 8
    )
    port map (
      words_in => frame,
      index    => std_logic_vector(position_r),
      word     => m_axis_tdata
    );

  m_axis_tkeep  <= "1";
  m_axis_tvalid <= segment_valid(0);
  m_axis_tlast  <= position_last;
  msg_ready     <= segment_valid(0) and m_axis_tready and position_last;

  send : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        position_r <= (others => '0');
      elsif segment_valid(0) = '1' and m_axis_tready = '1' then
        if position_last = '1' then
          position_r <= (others => '0');
        else
          position_r <= position_r + 1;
        end if;
      end if;
    end if;
  end process;

end architecture;
