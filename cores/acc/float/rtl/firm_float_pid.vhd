-- SPDX-License-Identifier: Apache-2.0
-- A PID controller: one output for each setpoint and measured value.
--
--   e = setpoint - measured,  i = i before + ki * e,  output = kp * e + i + kd * (measured before - measured)
--
-- The output stays between `low` and `high`. If it would exceed a limit, and i has increased the excess, i keeps its
-- value, which prevents wind-up. The derivative is that of the measured value, so a new setpoint gives no kick. The
-- periods between two samples are part of ki and kd. One multiply-add serves all steps, each rounded once; one sample
-- is computed at a time.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_pid is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52
  );
  port (
    clk         : in  std_logic;
    rst_n       : in  std_logic;

    in_valid    : in  std_logic;
    in_ready    : out std_logic;
    in_setpoint : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_measured : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_kp       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_ki       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_kd       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_low      : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_high     : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    -- Restart with i = 0, and without an earlier measured value.
    in_restart  : in  std_logic := '0';

    out_valid   : out std_logic;
    out_ready   : in  std_logic;
    out_number  : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_pid;

architecture rtl of firm_float_pid is

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  type state_t is (IDLE, COMPARE, INTEGRATE, DIFFER, PROPORTION, DERIVE, LIMIT, FINISH);

  signal state_r      : state_t;
  -- The operands of the step are accepted.
  signal is_sent_r    : std_logic;
  signal has_past_r   : std_logic;

  signal setpoint_r   : number_t;
  signal measured_r   : number_t;
  signal kp_r         : number_t;
  signal ki_r         : number_t;
  signal kd_r         : number_t;
  signal low_r        : number_t;
  signal high_r       : number_t;

  -- Of the previous sample.
  signal integral_r   : number_t;
  signal before_r     : number_t;

  signal error_r      : number_t;
  signal increased_r  : number_t;
  signal slowing_r    : number_t;
  -- The proportional part and i, and then all.
  signal sum_r        : number_t;

  signal one          : number_t;
  signal send         : std_logic;
  signal factor_a     : number_t;
  signal factor_b     : number_t;
  signal summand      : number_t;
  signal result_done  : std_logic;
  signal result       : number_t;

  signal limits       : std_logic;
  signal limited_done : std_logic;

begin

  in_ready  <= '1' when state_r = IDLE else '0';
  limits    <= '1' when state_r = LIMIT else '0';
  out_valid <= limited_done;

  one(number_t'left downto number_t'left-1) <= "00";
  one(number_t'left-2 downto MANTISSA_BITS) <= (others => '1');
  one(MANTISSA_BITS-1 downto 0)             <= (others => '0');

  choose : process (state_r, is_sent_r, one, setpoint_r, measured_r, before_r, error_r, slowing_r, sum_r, kp_r, ki_r,
                    kd_r, integral_r, increased_r)
  begin
    send     <= not is_sent_r;
    factor_a <= one;
    factor_b <= setpoint_r;
    summand  <= negated(measured_r);
    if state_r = INTEGRATE then
      factor_a <= ki_r;
      factor_b <= error_r;
      summand  <= integral_r;

    elsif state_r = DIFFER then
      factor_b <= before_r;

    elsif state_r = PROPORTION then
      factor_a <= kp_r;
      factor_b <= error_r;
      summand  <= increased_r;

    elsif state_r = DERIVE then
      factor_a <= kd_r;
      factor_b <= slowing_r;
      summand  <= sum_r;

    elsif state_r /= COMPARE then
      send <= '0';
    end if;
  end process choose;

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

  u_clamp : entity firm.firm_float_clamp
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_valid   => limits,
      in_ready   => open,
      in_number  => sum_r,
      in_low     => low_r,
      in_high    => high_r,
      out_valid  => limited_done,
      out_ready  => out_ready,
      out_number => out_number
    );

  control : process (clk)
    variable winds_up : boolean;
  begin
    if rising_edge(clk) then
      is_sent_r <= send or is_sent_r;
      if result_done = '1' then
        is_sent_r <= '0';
      end if;
      if state_r = IDLE then
        setpoint_r <= in_setpoint;
        measured_r <= in_measured;
        kp_r       <= in_kp;
        ki_r       <= in_ki;
        kd_r       <= in_kd;
        low_r      <= in_low;
        high_r     <= in_high;
        is_sent_r  <= '0';
        if in_valid = '1' then
          state_r    <= COMPARE;
          has_past_r <= '1';
          if in_restart = '1' or has_past_r = '0' then
            integral_r <= (others => '0');
            before_r   <= in_measured;
          end if;
        end if;

      elsif state_r = COMPARE then
        error_r <= result;
        if result_done = '1' then
          state_r <= INTEGRATE;
        end if;

      elsif state_r = INTEGRATE then
        increased_r <= result;
        if result_done = '1' then
          state_r <= DIFFER;
        end if;

      elsif state_r = DIFFER then
        slowing_r <= result;
        if result_done = '1' then
          state_r <= PROPORTION;
        end if;

      elsif state_r = PROPORTION then
        sum_r <= result;
        if result_done = '1' then
          state_r <= DERIVE;
        end if;

      elsif state_r = DERIVE then
        if result_done = '1' then
          sum_r   <= result;
          state_r <= LIMIT;
        end if;

      elsif state_r = LIMIT then
        -- NaN is above all numbers here, so that an undefined i is not kept.
        winds_up := (order_of(sum_r) > order_of(high_r) and order_of(increased_r) > order_of(integral_r)) or
                    (order_of(sum_r) < order_of(low_r) and order_of(increased_r) < order_of(integral_r));
        if not winds_up then
          integral_r <= increased_r;
        end if;
        before_r <= measured_r;
        state_r  <= FINISH;

      elsif limited_done = '1' and out_ready = '1' then
        state_r <= IDLE;
      end if;

      if rst_n = '0' then
        state_r    <= IDLE;
        has_past_r <= '0';
      end if;
    end if;
  end process control;

end architecture rtl;
