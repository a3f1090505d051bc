-- planning: the messages of actionlib/Test around `asking`.
library ieee;
use ieee.std_logic_1164.all;

entity planning is
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;

    -- std_msgs/UInt32
    in0_data              : in  std_logic_vector(31 downto 0);
    in0_segment_valid     : in  std_logic_vector(0 downto 0);
    in0_msg_valid         : in  std_logic;
    in0_msg_ready         : out std_logic;

    -- actionlib/TestActionFeedback
    in1_payload_length    : in  std_logic_vector(31 downto 0);
    in1_feedback_feedback : in  std_logic_vector(31 downto 0);
    in1_segment_valid     : in  std_logic_vector(0 downto 0);
    in1_msg_valid         : in  std_logic;
    in1_msg_ready         : out std_logic;

    -- actionlib/TestActionResult
    in2_payload_length    : in  std_logic_vector(31 downto 0);
    in2_status_status     : in  std_logic_vector(7 downto 0);
    in2_result_result     : in  std_logic_vector(31 downto 0);
    in2_segment_valid     : in  std_logic_vector(0 downto 0);
    in2_msg_valid         : in  std_logic;
    in2_msg_ready         : out std_logic;

    -- actionlib/TestActionGoal
    out0_goal_goal        : out std_logic_vector(31 downto 0);
    out0_segment_valid    : out std_logic_vector(0 downto 0);
    out0_msg_valid        : out std_logic;
    out0_msg_ready        : in  std_logic;

    -- actionlib_msgs/GoalID
    out1_stamp_sec        : out std_logic_vector(31 downto 0);
    out1_stamp_nsec       : out std_logic_vector(31 downto 0);
    out1_segment_valid    : out std_logic_vector(0 downto 0);
    out1_msg_valid        : out std_logic;
    out1_msg_ready        : in  std_logic;

    -- std_msgs/UInt64
    out2_data             : out std_logic_vector(63 downto 0);
    out2_segment_valid    : out std_logic_vector(0 downto 0);
    out2_msg_ready        : in  std_logic
  );
end entity planning;

architecture rtl of planning is

  signal goal_valid   : std_logic;
  signal cancel_valid : std_logic;
  signal told_valid   : std_logic;

begin

  u_core : entity work.asking
    port map (
      clk            => clk,
      rst_n          => rst_n,
      order          => in0_data,
      order_valid    => in0_msg_valid,
      order_ready    => in0_msg_ready,
      goal           => out0_goal_goal,
      goal_valid     => goal_valid,
      goal_ready     => out0_msg_ready,
      cancel_valid   => cancel_valid,
      cancel_ready   => out1_msg_ready,
      feedback       => in1_feedback_feedback,
      feedback_valid => in1_msg_valid,
      feedback_ready => in1_msg_ready,
      result         => in2_result_result,
      result_state   => in2_status_status,
      result_valid   => in2_msg_valid,
      result_ready   => in2_msg_ready,
      told           => out2_data,
      told_valid     => told_valid,
      told_ready     => out2_msg_ready
    );

  out0_segment_valid <= (others => goal_valid);
  out0_msg_valid     <= goal_valid;
  -- Without an id and a time, it concerns all goals.
  out1_stamp_sec     <= (others => '0');
  out1_stamp_nsec    <= (others => '0');
  out1_segment_valid <= (others => cancel_valid);
  out1_msg_valid     <= cancel_valid;
  out2_segment_valid <= (others => told_valid);

end architecture rtl;
