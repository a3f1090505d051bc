-- A grip goes to two interfaces of one converter, a twist to the converter itself. At 32 bits a publisher's stream fits a
-- subscriber as it is: the lane of the id is the one that is void.
library ieee;
use ieee.std_logic_1164.all;
use work.demo_msgs_grip_pkg.all;

entity loop_tb is
end entity;

architecture tb of loop_tb is

  constant FORCE   : std_logic_vector(63 downto 0) := x"0123456789abcdef";
  constant LINEAR  : std_logic_vector(63 downto 0) := x"3ff0000000000000";
  constant ANGULAR : std_logic_vector(63 downto 0) := x"bff8000000000000";

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal start : std_logic_vector(0 downto 0) := "0";

  signal grip_tdata, twist_tdata   : std_logic_vector(31 downto 0);
  signal grip_tkeep, twist_tkeep   : std_logic_vector(3 downto 0);
  signal grip_tvalid, twist_tvalid : std_logic;
  signal grip_tlast, twist_tlast   : std_logic;
  signal left_tready, right_tready : std_logic;
  signal both_tready, left_tvalid  : std_logic;
  signal right_tvalid              : std_logic;
  signal twist_tready              : std_logic;

  signal left_state, right_state   : std_logic_vector(7 downto 0);
  signal left_force, right_force   : std_logic_vector(63 downto 0);
  signal left_valid, right_valid   : std_logic;
  signal linear_x, angular_z       : std_logic_vector(63 downto 0);
  signal twist_valid               : std_logic;

begin

  clk          <= not clk after 5 ns when now < 2 us else '0';
  both_tready  <= left_tready and right_tready;
  left_tvalid  <= grip_tvalid and right_tready;
  right_tvalid <= grip_tvalid and left_tready;

  u_grip : entity work.Grip2AXIS
    generic map (
      ID => 7
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      state         => CLOSED,
      force_field   => FORCE,
      segment_valid => start,
      msg_ready     => open,
      m_axis_tdata  => grip_tdata,
      m_axis_tkeep  => grip_tkeep,
      m_axis_tvalid => grip_tvalid,
      m_axis_tlast  => grip_tlast,
      m_axis_tready => both_tready
    );

  u_left : entity work.AXIS2Left
    port map (
      clk              => clk,
      rst_n            => rst_n,
      s_axis_tdata     => grip_tdata,
      s_axis_tkeep     => grip_tkeep,
      s_axis_tvalid    => left_tvalid,
      s_axis_tlast     => grip_tlast,
      s_axis_tready    => left_tready,
      state            => left_state,
      force_field      => left_force,
      segment_valid    => open,
      msg_valid        => left_valid,
      msg_ready        => '0',
      frame_error      => open,
      frame_error_code => open
    );

  u_right : entity work.AXIS2Right
    port map (
      clk              => clk,
      rst_n            => rst_n,
      s_axis_tdata     => grip_tdata,
      s_axis_tkeep     => grip_tkeep,
      s_axis_tvalid    => right_tvalid,
      s_axis_tlast     => grip_tlast,
      s_axis_tready    => right_tready,
      state            => right_state,
      force_field      => right_force,
      segment_valid    => open,
      msg_valid        => right_valid,
      msg_ready        => '0',
      frame_error      => open,
      frame_error_code => open
    );

  u_twist : entity work.geometry_msgs_twist_to_axis
    port map (
      clk           => clk,
      rst_n         => rst_n,
      linear_x      => LINEAR,
      linear_y      => LINEAR,
      linear_z      => LINEAR,
      angular_x     => LINEAR,
      angular_y     => LINEAR,
      angular_z     => ANGULAR,
      segment_valid => start,
      msg_ready     => open,
      m_axis_tdata  => twist_tdata,
      m_axis_tkeep  => twist_tkeep,
      m_axis_tvalid => twist_tvalid,
      m_axis_tlast  => twist_tlast,
      m_axis_tready => twist_tready
    );

  u_axis : entity work.axis_to_geometry_msgs_twist
    port map (
      clk              => clk,
      rst_n            => rst_n,
      s_axis_tdata     => twist_tdata,
      s_axis_tkeep     => twist_tkeep,
      s_axis_tvalid    => twist_tvalid,
      s_axis_tlast     => twist_tlast,
      s_axis_tready    => twist_tready,
      linear_x         => linear_x,
      linear_y         => open,
      linear_z         => open,
      angular_x        => open,
      angular_y        => open,
      angular_z        => angular_z,
      segment_valid    => open,
      msg_valid        => twist_valid,
      msg_ready        => '0',
      frame_error      => open,
      frame_error_code => open
    );

  check : process
  begin
    wait for 20 ns;
    rst_n <= '1';
    start <= "1";
    wait for 1 us;
    assert left_valid = '1' and left_state = CLOSED and left_force = FORCE
      report "left did not get the grip" severity failure;
    assert right_valid = '1' and right_state = CLOSED and right_force = FORCE
      report "right did not get the grip" severity failure;
    assert twist_valid = '1' and linear_x = LINEAR and angular_z = ANGULAR
      report "the twist did not come" severity failure;
    report "PASS " & work.geometry_msgs_twist_pkg.SIGNATURE & " " & SIGNATURE;
    wait;
  end process;

end architecture;
