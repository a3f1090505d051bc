-- asking: a client of an action, without the forms of its messages.
--
-- It sends a goal for each order, tells each number of feedback with the kind 255, and the number of the result with
-- its state as the kind. If bits 4 to 6 of the order are set, it cancels the goal after the first feedback.
library ieee;
use ieee.std_logic_1164.all;

entity asking is
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;

    order       : in  std_logic_vector(31 downto 0);
    order_valid : in  std_logic;
    order_ready : out std_logic;

    goal       : out std_logic_vector(31 downto 0);
    goal_valid : out std_logic;
    goal_ready : in  std_logic;

    cancel_valid : out std_logic;
    cancel_ready : in  std_logic;

    feedback       : in  std_logic_vector(31 downto 0);
    feedback_valid : in  std_logic;
    feedback_ready : out std_logic;

    result       : in  std_logic_vector(31 downto 0);
    result_state : in  std_logic_vector(7 downto 0);
    result_valid : in  std_logic;
    result_ready : out std_logic;

    -- The order in bits 63 to 40, the kind in bits 39 to 32, the number below.
    told       : out std_logic_vector(63 downto 0);
    told_valid : out std_logic;
    told_ready : in  std_logic
  );
end entity asking;

architecture rtl of asking is

  type state_t is (IDLE, ASKS, WAITS, TELLS_FEEDBACK, CANCELS, TELLS_RESULT);

  signal state       : state_t;
  signal order_r     : std_logic_vector(31 downto 0);
  signal told_r      : std_logic_vector(39 downto 0);
  signal is_canceled : std_logic;

begin

  order_ready    <= '1' when state = IDLE else '0';
  feedback_ready <= '1' when state = WAITS else '0';
  result_ready   <= not feedback_valid when state = WAITS else '0';

  goal         <= order_r;
  goal_valid   <= '1' when state = ASKS else '0';
  cancel_valid <= '1' when state = CANCELS else '0';
  told         <= order_r(23 downto 0) & told_r;
  told_valid   <= '1' when state = TELLS_FEEDBACK or state = TELLS_RESULT else '0';

  ask : process (clk)
  begin
    if rising_edge(clk) then
      case state is
        when IDLE =>

          order_r     <= order;
          is_canceled <= '0';
          if order_valid = '1' then
            state <= ASKS;
          end if;
        when ASKS =>

          if goal_ready = '1' then
            state <= WAITS;
          end if;
        when WAITS =>

          if feedback_valid = '1' then
            told_r <= x"ff" & feedback;
            state  <= TELLS_FEEDBACK;
          elsif result_valid = '1' then
            told_r <= result_state & result;
            state  <= TELLS_RESULT;
          end if;
        when TELLS_FEEDBACK =>

          if told_ready = '1' then
            if order_r(6 downto 4) = "111" and is_canceled = '0' then
              state <= CANCELS;
            else
              state <= WAITS;
            end if;
          end if;
        when CANCELS =>

          is_canceled <= '1';
          if cancel_ready = '1' then
            state <= WAITS;
          end if;
        when TELLS_RESULT =>

          if told_ready = '1' then
            state <= IDLE;
          end if;
      end case;
      if rst_n = '0' then
        state <= IDLE;
      end if;
    end if;
  end process ask;

end architecture rtl;
