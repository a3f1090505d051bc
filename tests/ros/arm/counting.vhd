-- counting: the goals of an action, without the forms of their messages.
--
-- A goal g leads to g mod 4 numbers as feedback, g + 1, g + 2 and so on, and to the result g. If bits 4 to 6 of g are
-- set, there is one number of feedback, and the result follows a cancellation.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity counting is
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;

    goal         : in  std_logic_vector(31 downto 0);
    goal_valid   : in  std_logic;
    goal_ready   : out std_logic;

    cancel_valid : in  std_logic;
    cancel_ready : out std_logic;

    feedback       : out std_logic_vector(31 downto 0);
    feedback_valid : out std_logic;
    feedback_ready : in  std_logic;

    result       : out std_logic_vector(31 downto 0);
    is_canceled  : out std_logic;
    result_valid : out std_logic;
    result_ready : in  std_logic
  );
end entity counting;

architecture rtl of counting is

  type state_t is (IDLE, TELLS, WAITS, ENDS);

  signal state    : state_t;
  signal goal_r   : unsigned(31 downto 0);
  signal number   : unsigned(31 downto 0);
  signal left     : unsigned(1 downto 0);
  signal canceled : std_logic;
  signal is_held  : std_logic;

begin

  -- A cancellation may come after its goal has ended, so it is taken before the next goal.
  cancel_ready <= '1' when state = IDLE or state = WAITS else '0';
  goal_ready   <= not cancel_valid when state = IDLE else '0';

  is_held <= '1' when goal(6 downto 4) = "111" else '0';

  feedback       <= std_logic_vector(number);
  feedback_valid <= '1' when state = TELLS else '0';
  result         <= std_logic_vector(goal_r);
  result_valid   <= '1' when state = ENDS else '0';
  is_canceled    <= canceled;

  pursue : process (clk)
  begin
    if rising_edge(clk) then
      case state is
        when IDLE =>

          canceled <= '0';
          goal_r   <= unsigned(goal);
          number   <= unsigned(goal) + 1;
          if goal_valid = '1' and cancel_valid = '0' then
            if is_held = '1' then
              left  <= "01";
              state <= TELLS;
            elsif unsigned(goal(1 downto 0)) = 0 then
              state <= ENDS;
            else
              left  <= unsigned(goal(1 downto 0));
              state <= TELLS;
            end if;
          end if;
        when TELLS =>

          if feedback_ready = '1' then
            number <= number + 1;
            left   <= left - 1;
            if left = 1 and goal_r(6 downto 4) = "111" then
              state <= WAITS;
            elsif left = 1 then
              state <= ENDS;
            end if;
          end if;
        when WAITS =>

          if cancel_valid = '1' then
            canceled <= '1';
            state    <= ENDS;
          end if;
        when ENDS =>

          if result_ready = '1' then
            state <= IDLE;
          end if;
      end case;
      if rst_n = '0' then
        state <= IDLE;
      end if;
    end if;
  end process pursue;

end architecture rtl;
