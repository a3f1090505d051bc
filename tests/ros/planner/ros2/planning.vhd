-- planning: the messages of test_msgs/Fibonacci around `asking`. Each sequence has one number, or none.
library ieee;
use ieee.std_logic_1164.all;

entity planning is
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;

    -- std_msgs/UInt32
    in0_data                          : in  std_logic_vector(31 downto 0);
    in0_segment_valid                 : in  std_logic_vector(0 downto 0);
    in0_msg_valid                     : in  std_logic;
    in0_msg_ready                     : out std_logic;

    -- test_msgs/Fibonacci_FeedbackMessage
    in1_payload_length                : in  std_logic_vector(31 downto 0);
    in1_feedback_sequence_length      : in  std_logic_vector(31 downto 0);
    in1_feedback_sequence_axis_tdata  : in  std_logic_vector(31 downto 0);
    in1_feedback_sequence_axis_tkeep  : in  std_logic_vector(3 downto 0);
    in1_feedback_sequence_axis_tvalid : in  std_logic;
    in1_feedback_sequence_axis_tlast  : in  std_logic;
    in1_feedback_sequence_axis_tready : out std_logic;
    in1_segment_valid                 : in  std_logic_vector(0 downto 0);
    in1_msg_valid                     : in  std_logic;
    in1_msg_ready                     : out std_logic;

    -- test_msgs/Fibonacci_GetResult_Response
    in2_payload_length                : in  std_logic_vector(31 downto 0);
    in2_status                        : in  std_logic_vector(7 downto 0);
    in2_result_sequence_length        : in  std_logic_vector(31 downto 0);
    in2_result_sequence_axis_tdata    : in  std_logic_vector(31 downto 0);
    in2_result_sequence_axis_tkeep    : in  std_logic_vector(3 downto 0);
    in2_result_sequence_axis_tvalid   : in  std_logic;
    in2_result_sequence_axis_tlast    : in  std_logic;
    in2_result_sequence_axis_tready   : out std_logic;
    in2_segment_valid                 : in  std_logic_vector(0 downto 0);
    in2_msg_valid                     : in  std_logic;
    in2_msg_ready                     : out std_logic;

    -- test_msgs/Fibonacci_SendGoal_Request
    out0_goal_order                   : out std_logic_vector(31 downto 0);
    out0_segment_valid                : out std_logic_vector(0 downto 0);
    out0_msg_ready                    : in  std_logic;

    -- action_msgs/GoalInfo
    out1_stamp_sec                    : out std_logic_vector(31 downto 0);
    out1_stamp_nanosec                : out std_logic_vector(31 downto 0);
    out1_segment_valid                : out std_logic_vector(0 downto 0);
    out1_msg_ready                    : in  std_logic;

    -- std_msgs/UInt64
    out2_data                         : out std_logic_vector(63 downto 0);
    out2_segment_valid                : out std_logic_vector(0 downto 0);
    out2_msg_ready                    : in  std_logic
  );
end entity planning;

architecture rtl of planning is

  signal goal_valid      : std_logic;
  signal cancel_valid    : std_logic;
  signal told_valid      : std_logic;
  signal feedback_ready  : std_logic;
  signal result_ready    : std_logic;
  -- The numbers of the messages that are being received; 0 without a number.
  signal feedback_number : std_logic_vector(31 downto 0);
  signal result_number   : std_logic_vector(31 downto 0);

begin

  u_core : entity work.asking
    port map (
      clk            => clk,
      rst_n          => rst_n,
      order          => in0_data,
      order_valid    => in0_msg_valid,
      order_ready    => in0_msg_ready,
      goal           => out0_goal_order,
      goal_valid     => goal_valid,
      goal_ready     => out0_msg_ready,
      cancel_valid   => cancel_valid,
      cancel_ready   => out1_msg_ready,
      feedback       => feedback_number,
      feedback_valid => in1_msg_valid,
      feedback_ready => feedback_ready,
      result         => result_number,
      result_state   => in2_status,
      result_valid   => in2_msg_valid,
      result_ready   => result_ready,
      told           => out2_data,
      told_valid     => told_valid,
      told_ready     => out2_msg_ready
    );

  in1_msg_ready                     <= feedback_ready;
  in2_msg_ready                     <= result_ready;
  in1_feedback_sequence_axis_tready <= '1';
  in2_result_sequence_axis_tready   <= '1';

  out0_segment_valid <= (others => goal_valid);
  -- Without an id and a time, it concerns all goals.
  out1_stamp_sec     <= (others => '0');
  out1_stamp_nanosec <= (others => '0');
  out1_segment_valid <= (others => cancel_valid);
  out2_segment_valid <= (others => told_valid);

  remember_numbers : process (clk)
  begin
    if rising_edge(clk) then
      if in1_feedback_sequence_axis_tvalid = '1' then
        feedback_number <= in1_feedback_sequence_axis_tdata;
      elsif rst_n = '0' or (in1_msg_valid = '1' and feedback_ready = '1') then
        feedback_number <= (others => '0');
      end if;
      if in2_result_sequence_axis_tvalid = '1' then
        result_number <= in2_result_sequence_axis_tdata;
      elsif rst_n = '0' or (in2_msg_valid = '1' and result_ready = '1') then
        result_number <= (others => '0');
      end if;
    end if;
  end process remember_numbers;

end architecture rtl;
