-- SPDX-License-Identifier: Apache-2.0
-- A low-pass filter of first order: y = previous y + weight * (x - previous y).
--
-- The first result after a reset or a restart is the sample itself. One multiply-add serves both steps, each rounded
-- once; one sample is computed at a time.

library ieee;
use ieee.std_logic_1164.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_low_pass is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_ready   : out std_logic;
    in_number  : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    -- From 0 to 1: T / (T + tau) for the time constant tau and samples every T.
    in_weight  : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    -- Restart without earlier samples.
    in_restart : in  std_logic := '0';

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_low_pass;

architecture rtl of firm_float_low_pass is

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  type state_t is (IDLE, SUBTRACT, ADD, DONE);

  signal state_r     : state_t;
  -- The operands of the step are accepted.
  signal is_sent_r   : std_logic;
  signal has_past_r  : std_logic;

  signal number_r    : number_t;
  signal weight_r    : number_t;
  signal filtered_r  : number_t;

  signal one         : number_t;
  signal send        : std_logic;
  signal factor_a    : number_t;
  signal factor_b    : number_t;
  signal summand     : number_t;
  signal result_done : std_logic;
  signal result      : number_t;

begin

  in_ready   <= '1' when state_r = IDLE else '0';
  out_valid  <= '1' when state_r = DONE else '0';
  out_number <= filtered_r;

  one(number_t'left downto number_t'left-1) <= "00";
  one(number_t'left-2 downto MANTISSA_BITS) <= (others => '1');
  one(MANTISSA_BITS-1 downto 0)             <= (others => '0');

  -- During SUBTRACT, number_r is the sample; after it, the difference.
  send     <= not is_sent_r when state_r = SUBTRACT or state_r = ADD else '0';
  factor_a <= one when state_r = SUBTRACT else weight_r;
  factor_b <= number_r;

  summand  <= negated(filtered_r) when state_r = SUBTRACT else filtered_r;

  u_multiply_add : entity firm.firm_float_multiply_add
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_valid   => send,
      in_ready   => open,
      in_a       => factor_a,
      in_b       => factor_b,
      in_c       => summand,
      out_valid  => result_done,
      out_ready  => '1',
      out_number => result
    );

  control : process (clk)
  begin
    if rising_edge(clk) then
      is_sent_r <= send or is_sent_r;
      if state_r = IDLE then
        number_r  <= in_number;
        weight_r  <= in_weight;
        is_sent_r <= '0';
        if in_valid = '1' then
          state_r    <= SUBTRACT;
          has_past_r <= '1';
          if in_restart = '1' or has_past_r = '0' then
            filtered_r <= in_number;
          end if;
        end if;

      elsif state_r = SUBTRACT then
        if result_done = '1' then
          number_r  <= result;
          is_sent_r <= '0';
          state_r   <= ADD;
        end if;

      elsif state_r = ADD then
        if result_done = '1' then
          filtered_r <= result;
          state_r    <= DONE;
        end if;

      elsif out_ready = '1' then
        state_r <= IDLE;
      end if;

      if rst_n = '0' then
        state_r    <= IDLE;
        has_past_r <= '0';
      end if;
    end if;
  end process control;

end architecture rtl;
