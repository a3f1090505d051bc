-- SPDX-License-Identifier: Apache-2.0
-- Controls the speed of a wheel (PID): computes the duty from the setpoint of the speed, once per period.
--
--   e = setpoint - speed,  duty = KP e + I + KD (speed before - speed),  I = I before + KI e
--
-- The derivative is that of the speed, so a new setpoint gives no kick. The duty stays within LIMIT. If it would not,
-- and e would drive it further, I is unchanged, which prevents wind-up. A wheel that should stand still, and does
-- except for one count, is released: no duty, and I restarts at 0. Otherwise it would oscillate about an edge of its
-- encoder. One multiplier serves the three products.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity wheel_pid is
  generic (
    -- The maximum duty in cycles of the PWM, and the periods at it without a count until a stall is reported.
    LIMIT         : positive;
    STALL_PERIODS : positive;
    -- Cycles of duty for one count per period, in units of 2**-8: 0 to 131071.
    KP            : natural;
    KI            : natural;
    KD            : natural
  );
  port (
    clk      : in  std_logic;
    rst_n    : in  std_logic;

    -- One cycle; the speeds must be stable for eight, then the next start may follow.
    start    : in  std_logic;
    -- The setpoint in units of 2**-8 counts per period, the speed in counts per period.
    setpoint : in  std_logic_vector(15 downto 0);
    speed    : in  std_logic_vector(7 downto 0);

    -- From -LIMIT to LIMIT, seven cycles after start.
    duty     : out std_logic_vector(15 downto 0);
    stalled  : out std_logic
  );
end entity wheel_pid;

architecture rtl of wheel_pid is

  constant SPEED_FRACTION : positive := 8;
  constant GAIN_BITS      : positive := 18;
  -- Fraction bits of a product.
  constant SUM_FRACTION   : positive := 16;

  subtype error_t is signed(16 downto 0);
  subtype product_t is signed(16+GAIN_BITS downto 0);
  -- Three products, and an integral that stops at most a product beyond LIMIT.
  subtype sum_t is signed(39 downto 0);
  -- Without fraction.
  subtype whole_t is signed(39-SUM_FRACTION downto 0);

  signal step_r      : natural range 0 to 6;
  signal error_r     : error_t;
  signal slowing_r   : error_t;
  signal before_r    : signed(7 downto 0);
  signal factor_r    : error_t;
  signal gain_r      : signed(GAIN_BITS-1 downto 0);
  signal product_r   : product_t;
  -- P, then P + I, then the sum of all three.
  signal sum_r       : sum_t;
  signal integral_r  : sum_t;
  signal increased_r : sum_t;
  signal duty_r      : signed(15 downto 0);
  signal standing_r  : natural range 0 to STALL_PERIODS;

begin

  assert LIMIT <= 32767
    report "wheel_pid: LIMIT is " & integer'image(LIMIT) & ", legal: 1 to 32767"
    severity failure;
  assert KP < 2**(GAIN_BITS-1) and KI < 2**(GAIN_BITS-1) and KD < 2**(GAIN_BITS-1)
    report "wheel_pid: KP, KI, KD are " & integer'image(KP) & ", " & integer'image(KI) & ", " & integer'image(KD)
      & ", legal: 0 to 131071"
    severity failure;

  duty    <= std_logic_vector(duty_r);
  stalled <= '1' when standing_r = STALL_PERIODS else '0';

  multiply : process (clk)
    variable fixed  : error_t;
    variable slower : signed(8 downto 0);
  begin
    if rising_edge(clk) then
      if start = '1' then
        fixed     := resize(signed(speed) & to_signed(0, SPEED_FRACTION), error_t'length);
        error_r   <= resize(signed(setpoint), error_t'length) - fixed;
        slower    := resize(before_r, 9) - resize(signed(speed), 9);
        slowing_r <= slower & to_signed(0, SPEED_FRACTION);
        before_r  <= signed(speed);
      end if;

      factor_r <= error_r;
      gain_r   <= to_signed(KP, GAIN_BITS);
      if step_r = 2 then
        gain_r <= to_signed(KI, GAIN_BITS);
      elsif step_r = 3 then
        factor_r <= slowing_r;
        gain_r   <= to_signed(KD, GAIN_BITS);
      end if;
      if step_r /= 0 then
        product_r <= factor_r * gain_r;
      end if;
      if rst_n = '0' then
        before_r <= (others => '0');
      end if;
    end if;
  end process multiply;

  -- Step 1 to 3 choose factors, 2 to 4 multiply, 3 to 5 add, 6 decides.
  control : process (clk)
    variable whole     : whole_t;
    variable is_beyond : boolean;
  begin
    if rising_edge(clk) then
      if start = '1' then
        step_r <= 1;
      elsif step_r = 6 then
        step_r <= 0;
      elsif step_r /= 0 then
        step_r <= step_r + 1;
      end if;

      if step_r = 3 then
        sum_r <= resize(product_r, sum_t'length);
      elsif step_r = 4 then
        increased_r <= integral_r + product_r;
        sum_r       <= sum_r + integral_r + product_r;
      elsif step_r = 5 then
        sum_r <= sum_r + product_r;
      elsif step_r = 6 then
        whole     := sum_r(sum_t'left downto SUM_FRACTION);
        is_beyond := false;
        duty_r    <= whole(15 downto 0);
        if whole >= LIMIT then
          duty_r    <= to_signed(LIMIT, 16);
          is_beyond := error_r(error_t'left) = '0';
        elsif whole < -LIMIT then
          duty_r    <= to_signed(-LIMIT, 16);
          is_beyond := error_r(error_t'left) = '1';
        end if;
        if not is_beyond then
          integral_r <= increased_r;
        end if;
        if signed(setpoint) = 0 and signed(speed) >= -1 and signed(speed) <= 1 then
          integral_r <= (others => '0');
          duty_r     <= (others => '0');
        end if;
        if signed(speed) = 0 and (whole >= LIMIT or whole < -LIMIT) then
          if standing_r /= STALL_PERIODS then
            standing_r <= standing_r + 1;
          end if;
        else
          standing_r <= 0;
        end if;
      end if;

      if rst_n = '0' then
        step_r     <= 0;
        integral_r <= (others => '0');
        duty_r     <= (others => '0');
        standing_r <= 0;
      end if;
    end if;
  end process control;

end architecture rtl;
