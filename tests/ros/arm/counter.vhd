-- counter: the messages of actionlib/Test around `counting`.
library ieee;
use ieee.std_logic_1164.all;

entity counter is
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;

    -- actionlib/TestActionGoal
    in0_payload_length     : in  std_logic_vector(31 downto 0);
    in0_goal_goal          : in  std_logic_vector(31 downto 0);
    in0_segment_valid      : in  std_logic_vector(0 downto 0);
    in0_msg_valid          : in  std_logic;
    in0_msg_ready          : out std_logic;

    -- actionlib_msgs/GoalID
    in1_payload_length     : in  std_logic_vector(31 downto 0);
    in1_stamp_sec          : in  std_logic_vector(31 downto 0);
    in1_stamp_nsec         : in  std_logic_vector(31 downto 0);
    in1_segment_valid      : in  std_logic_vector(0 downto 0);
    in1_msg_valid          : in  std_logic;
    in1_msg_ready          : out std_logic;

    -- actionlib/TestActionFeedback
    out0_feedback_feedback : out std_logic_vector(31 downto 0);
    out0_segment_valid     : out std_logic_vector(0 downto 0);
    out0_msg_valid         : out std_logic;
    out0_msg_ready         : in  std_logic;

    -- actionlib/TestActionResult
    out1_status_status     : out std_logic_vector(7 downto 0);
    out1_result_result     : out std_logic_vector(31 downto 0);
    out1_segment_valid     : out std_logic_vector(0 downto 0);
    out1_msg_valid         : out std_logic;
    out1_msg_ready         : in  std_logic
  );
end entity counter;

architecture rtl of counter is

  signal feedback_valid : std_logic;
  signal result_valid   : std_logic;
  signal is_canceled    : std_logic;

begin

  u_core : entity work.counting
    port map (
      clk            => clk,
      rst_n          => rst_n,
      goal           => in0_goal_goal,
      goal_valid     => in0_msg_valid,
      goal_ready     => in0_msg_ready,
      cancel_valid   => in1_msg_valid,
      cancel_ready   => in1_msg_ready,
      feedback       => out0_feedback_feedback,
      feedback_valid => feedback_valid,
      feedback_ready => out0_msg_ready,
      result         => out1_result_result,
      is_canceled    => is_canceled,
      result_valid   => result_valid,
      result_ready   => out1_msg_ready
    );

  out0_segment_valid <= (others => feedback_valid);
  out0_msg_valid     <= feedback_valid;
  out1_segment_valid <= (others => result_valid);
  out1_msg_valid     <= result_valid;

  -- actionlib_msgs/GoalStatus: PREEMPTED, SUCCEEDED.
  out1_status_status <= x"02" when is_canceled = '1' else x"03";

end architecture rtl;
