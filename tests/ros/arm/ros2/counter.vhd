-- counter: the messages of test_msgs/Fibonacci around `counting`. Each sequence has one number.
library ieee;
use ieee.std_logic_1164.all;

entity counter is
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;

    -- test_msgs/Fibonacci_SendGoal_Request
    in0_goal_order                     : in  std_logic_vector(31 downto 0);
    in0_segment_valid                  : in  std_logic_vector(0 downto 0);
    in0_msg_valid                      : in  std_logic;
    in0_msg_ready                      : out std_logic;

    -- action_msgs/GoalInfo
    in1_stamp_sec                      : in  std_logic_vector(31 downto 0);
    in1_stamp_nanosec                  : in  std_logic_vector(31 downto 0);
    in1_segment_valid                  : in  std_logic_vector(0 downto 0);
    in1_msg_valid                      : in  std_logic;
    in1_msg_ready                      : out std_logic;

    -- test_msgs/Fibonacci_FeedbackMessage
    out0_feedback_sequence_length      : out std_logic_vector(31 downto 0);
    out0_feedback_sequence_axis_tdata  : out std_logic_vector(31 downto 0);
    out0_feedback_sequence_axis_tkeep  : out std_logic_vector(3 downto 0);
    out0_feedback_sequence_axis_tvalid : out std_logic;
    out0_feedback_sequence_axis_tlast  : out std_logic;
    out0_feedback_sequence_axis_tready : in  std_logic;
    out0_segment_valid                 : out std_logic_vector(0 downto 0);
    out0_msg_valid                     : out std_logic;
    out0_msg_ready                     : in  std_logic;

    -- test_msgs/Fibonacci_GetResult_Response
    out1_status                        : out std_logic_vector(7 downto 0);
    out1_result_sequence_length        : out std_logic_vector(31 downto 0);
    out1_result_sequence_axis_tdata    : out std_logic_vector(31 downto 0);
    out1_result_sequence_axis_tkeep    : out std_logic_vector(3 downto 0);
    out1_result_sequence_axis_tvalid   : out std_logic;
    out1_result_sequence_axis_tlast    : out std_logic;
    out1_result_sequence_axis_tready   : in  std_logic;
    out1_segment_valid                 : out std_logic_vector(0 downto 0);
    out1_msg_valid                     : out std_logic;
    out1_msg_ready                     : in  std_logic
  );
end entity counter;

architecture rtl of counter is

  signal feedback_valid : std_logic;
  signal result_valid   : std_logic;
  signal is_canceled    : std_logic;
  -- The number of the message that is being sent has been taken.
  signal is_fed         : std_logic;
  signal is_given       : std_logic;

begin

  u_core : entity work.counting
    port map (
      clk            => clk,
      rst_n          => rst_n,
      goal           => in0_goal_order,
      goal_valid     => in0_msg_valid,
      goal_ready     => in0_msg_ready,
      cancel_valid   => in1_msg_valid,
      cancel_ready   => in1_msg_ready,
      feedback       => out0_feedback_sequence_axis_tdata,
      feedback_valid => feedback_valid,
      feedback_ready => out0_msg_ready,
      result         => out1_result_sequence_axis_tdata,
      is_canceled    => is_canceled,
      result_valid   => result_valid,
      result_ready   => out1_msg_ready
    );

  out0_segment_valid                 <= (others => feedback_valid);
  out0_msg_valid                     <= feedback_valid;
  out0_feedback_sequence_length      <= x"00000001";
  out0_feedback_sequence_axis_tkeep  <= (others => '1');
  out0_feedback_sequence_axis_tlast  <= '1';
  out0_feedback_sequence_axis_tvalid <= feedback_valid and not is_fed;

  out1_segment_valid               <= (others => result_valid);
  out1_msg_valid                   <= result_valid;
  out1_result_sequence_length      <= x"00000001";
  out1_result_sequence_axis_tkeep  <= (others => '1');
  out1_result_sequence_axis_tlast  <= '1';
  out1_result_sequence_axis_tvalid <= result_valid and not is_given;

  -- action_msgs/GoalStatus: STATUS_CANCELED, STATUS_SUCCEEDED.
  out1_status <= x"05" when is_canceled = '1' else x"04";

  remember_numbers : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' or out0_msg_ready = '1' then
        is_fed <= '0';
      elsif feedback_valid = '1' and out0_feedback_sequence_axis_tready = '1' then
        is_fed <= '1';
      end if;
      if rst_n = '0' or out1_msg_ready = '1' then
        is_given <= '0';
      elsif result_valid = '1' and out1_result_sequence_axis_tready = '1' then
        is_given <= '1';
      end if;
    end if;
  end process remember_numbers;

end architecture rtl;
