-- SPDX-License-Identifier: Apache-2.0
-- Converts robotic_arm/ArmState, or franka_msgs/FrankaState, to robotic_arm/ArmPoses: the poses of an arm's seven
-- joints, measured and desired, and the errors of the end effector's poses in the state.
--
-- Two chains work in lockstep on the measured and the desired angles, so the handshakes of the first apply to both. A
-- message is taken when its result is ready; the next one starts when the result has been sent.

library ieee;
use ieee.std_logic_1164.all;

entity robotic_arm is
  port (
    clk                : in  std_logic;
    rst_n              : in  std_logic;

    -- float64 in rad and m, element 0 lowest; README.md lists the results of infinity and NaN.
    in_q               : in  std_logic_vector(447 downto 0);
    in_q_d             : in  std_logic_vector(447 downto 0);
    in_o_t_ee          : in  std_logic_vector(1023 downto 0);
    in_o_t_ee_d        : in  std_logic_vector(1023 downto 0);
    -- Not read: the fields above are in one segment, which comes with the whole message. A length comes only with
    -- franka_msgs/FrankaState, whose header has a string.
    in_payload_length  : in  std_logic_vector(31 downto 0) := (others => '0');
    in_segment_valid   : in  std_logic_vector(0 downto 0);
    in_msg_valid       : in  std_logic;
    in_msg_ready       : out std_logic;

    out_t1             : out std_logic_vector(1023 downto 0);
    out_t2             : out std_logic_vector(1023 downto 0);
    out_t3             : out std_logic_vector(1023 downto 0);
    out_t4             : out std_logic_vector(1023 downto 0);
    out_t5             : out std_logic_vector(1023 downto 0);
    out_t6             : out std_logic_vector(1023 downto 0);
    out_t7             : out std_logic_vector(1023 downto 0);
    out_t1_d           : out std_logic_vector(1023 downto 0);
    out_t2_d           : out std_logic_vector(1023 downto 0);
    out_t3_d           : out std_logic_vector(1023 downto 0);
    out_t4_d           : out std_logic_vector(1023 downto 0);
    out_t5_d           : out std_logic_vector(1023 downto 0);
    out_t6_d           : out std_logic_vector(1023 downto 0);
    out_t7_d           : out std_logic_vector(1023 downto 0);
    out_t_mse          : out std_logic_vector(63 downto 0);
    out_t_mse_d        : out std_logic_vector(63 downto 0);
    out_segment_valid  : out std_logic_vector(0 downto 0);
    out_msg_ready      : in  std_logic
  );
end entity robotic_arm;

architecture rtl of robotic_arm is

  signal measured_poses : std_logic_vector(7*1024-1 downto 0);
  signal desired_poses  : std_logic_vector(7*1024-1 downto 0);

begin

  u_measured : entity work.arm_chain
    port map (
      clk       => clk,
      rst_n     => rst_n,
      in_valid  => in_msg_valid,
      in_ready  => in_msg_ready,
      in_angles => in_q,
      in_pose   => in_o_t_ee,
      out_valid => out_segment_valid(0),
      out_ready => out_msg_ready,
      out_poses => measured_poses,
      out_error => out_t_mse
    );

  out_t1     <= measured_poses(1023 downto 0);
  out_t2     <= measured_poses(2047 downto 1024);
  out_t3     <= measured_poses(3071 downto 2048);
  out_t4     <= measured_poses(4095 downto 3072);
  out_t5     <= measured_poses(5119 downto 4096);
  out_t6     <= measured_poses(6143 downto 5120);
  out_t7     <= measured_poses(7167 downto 6144);

  u_desired : entity work.arm_chain
    port map (
      clk       => clk,
      rst_n     => rst_n,
      in_valid  => in_msg_valid,
      in_ready  => open,
      in_angles => in_q_d,
      in_pose   => in_o_t_ee_d,
      out_valid => open,
      out_ready => out_msg_ready,
      out_poses => desired_poses,
      out_error => out_t_mse_d
    );

  out_t1_d   <= desired_poses(1023 downto 0);
  out_t2_d   <= desired_poses(2047 downto 1024);
  out_t3_d   <= desired_poses(3071 downto 2048);
  out_t4_d   <= desired_poses(4095 downto 3072);
  out_t5_d   <= desired_poses(5119 downto 4096);
  out_t6_d   <= desired_poses(6143 downto 5120);
  out_t7_d   <= desired_poses(7167 downto 6144);

end architecture rtl;
