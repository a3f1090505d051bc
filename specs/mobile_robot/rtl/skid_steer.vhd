-- SPDX-License-Identifier: Apache-2.0
-- Converts a twist to the speeds of a skid-steer robot's sides, and the counts of its wheels to a twist.
--
--   left = x - z TRACK_WIDTH/2,  right = x + z TRACK_WIDTH/2,  x = (left + right)/2,  z = (right - left)/TRACK_WIDTH
--
-- Speeds of wheels are encoder counts per period. With the constants X, counts per period at 1 m/s, and Z, at 1 rad/s:
--   left = X x - Z z, right = X x + Z z,   x = (sum of the four wheels' counts)/(4 X), z = (right - left ones)/(4 Z)
--
-- Each side's speed saturates separately at SPEED_LIMIT, so a command beyond it gives another turn than requested. NaN
-- stops the robot.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;

entity skid_steer is
  generic (
    CLOCK_HZ        : positive;
    PERIOD_CYCLES   : positive;
    TRACK_WIDTH_UM  : positive;
    WHEEL_RADIUS_UM : positive;
    COUNTS_PER_TURN : positive;
    -- In counts per period: 1 to 127.
    SPEED_LIMIT     : positive
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;

    -- A command: x in the cycle of in_start, z in the next one. The sides' speeds are stable from in_done on.
    in_start      : in  std_logic;
    in_x          : in  std_logic_vector(63 downto 0);
    in_z          : in  std_logic_vector(63 downto 0);
    in_done       : out std_logic;
    -- In units of 2**-8 counts per period.
    in_left       : out std_logic_vector(15 downto 0);
    in_right      : out std_logic_vector(15 downto 0);

    -- Counts of the wheels: front left, front right, rear left, rear right, the first one lowest. The twist holds
    -- from out_done on, until the next one's.
    out_start     : in  std_logic;
    out_counts    : in  std_logic_vector(31 downto 0);
    out_done      : out std_logic;
    out_x         : out std_logic_vector(63 downto 0);
    out_z         : out std_logic_vector(63 downto 0)
  );
end entity skid_steer;

architecture rtl of skid_steer is

  constant PI             : real     := 3.14159265358979323846;
  -- Up to 64 m/s or rad/s, in units of 2**-16.
  constant TWIST_BITS     : positive := 23;
  constant TWIST_FRACTION : positive := 16;
  constant SPEED_FRACTION : positive := 8;
  -- Fraction bits of the constants.
  constant GAIN_FRACTION  : positive := 16;
  constant BACK_FRACTION  : positive := 32;

  -- Counts per period at 1 m/s and at 1 rad/s.
  constant X : real := real(COUNTS_PER_TURN) * real(PERIOD_CYCLES) * 1.0e6
                       / (2.0 * PI * real(WHEEL_RADIUS_UM) * real(CLOCK_HZ));
  constant Z : real := X * real(TRACK_WIDTH_UM) / 2.0e6;

  -- Saturates at the largest integer, which the assert below reports.
  function scaled(number : real; fraction : natural) return integer is
    variable result : real := number;
  begin
    for k in 1 to fraction loop
      result := result * 2.0;
    end loop;
    if result > 2.0e9 then
      return integer'high;
    end if;
    return integer(result);
  end function scaled;

  constant X_GAIN : integer := scaled(X, GAIN_FRACTION);
  constant Z_GAIN : integer := scaled(Z, GAIN_FRACTION);
  constant X_BACK : integer := scaled(0.25 / X, BACK_FRACTION);
  constant Z_BACK : integer := scaled(0.25 / Z, BACK_FRACTION);

  constant PRODUCT_FRACTION : positive := TWIST_FRACTION + GAIN_FRACTION;
  subtype product_t is signed(TWIST_BITS+31 downto 0);
  -- A number times a part of the bits of a constant, the lower or the upper half.
  constant PART_BITS : positive := 16;
  subtype partial_t is signed(TWIST_BITS+PART_BITS downto 0);
  -- 32 bits: ghdl 2.0 makes netlists that compare wider numbers with a negative integer as if that were positive.
  subtype speed_t is signed(TWIST_BITS+32-PRODUCT_FRACTION+SPEED_FRACTION downto 0);
  subtype back_t is signed(41 downto 0);

  signal asked           : std_logic_vector(63 downto 0);
  signal start_r         : std_logic;
  signal fixed_in_valid  : std_logic;
  signal fixed_valid     : std_logic;
  signal fixed           : std_logic_vector(TWIST_BITS-1 downto 0);
  signal undefined       : std_logic;

  -- Whether the number is z, and its constant; its product, first in parts; then the sides.
  signal is_z_r          : std_logic;
  signal gain_r          : signed(31 downto 0);
  signal low_r           : partial_t;
  signal high_r          : partial_t;
  signal product_r       : product_t;
  -- Of the parts, and of the product.
  signal product_valid_r : std_logic_vector(1 downto 0);
  signal product_is_z_r  : std_logic_vector(1 downto 0);
  signal forward_r       : product_t;
  signal lost_r          : std_logic_vector(2 downto 0);
  signal sides_valid_r   : std_logic;
  signal left_r          : speed_t;
  signal right_r         : speed_t;
  signal done_r          : std_logic;
  signal in_left_r       : std_logic_vector(15 downto 0);
  signal in_right_r      : std_logic_vector(15 downto 0);

  -- Sums of counts, and the product with a constant.
  signal back_step_r     : unsigned(3 downto 0);
  signal sum_r           : signed(9 downto 0);
  signal difference_r    : signed(9 downto 0);
  signal factor_r        : signed(9 downto 0);
  signal back_gain_r     : signed(31 downto 0);
  signal back_r          : back_t;
  signal float_in        : std_logic_vector(63 downto 0);
  signal float_in_valid  : std_logic;
  signal float_valid     : std_logic;
  signal float           : std_logic_vector(63 downto 0);
  signal is_second_r     : std_logic;
  signal out_done_r      : std_logic;
  signal out_x_r         : std_logic_vector(63 downto 0);
  signal out_z_r         : std_logic_vector(63 downto 0);

  -- A product in units of 2**-SPEED_FRACTION, rounded to nearest.
  function rounded(sum : signed(TWIST_BITS+32 downto 0)) return speed_t is
    variable half : signed(1 downto 0);
  begin
    half := '0' & sum(PRODUCT_FRACTION-SPEED_FRACTION-1);
    return resize(sum(sum'left downto PRODUCT_FRACTION-SPEED_FRACTION), speed_t'length) + half;
  end function rounded;

  function limited(speed : speed_t) return std_logic_vector is
    constant LIMIT : integer := SPEED_LIMIT * 2**SPEED_FRACTION;
  begin
    if speed > LIMIT then
      return std_logic_vector(to_signed(LIMIT, 16));
    elsif speed < -LIMIT then
      return std_logic_vector(to_signed(-LIMIT, 16));
    end if;
    return std_logic_vector(speed(15 downto 0));
  end function limited;

begin

  assert SPEED_LIMIT <= 127
    report "skid_steer: SPEED_LIMIT is " & integer'image(SPEED_LIMIT) & ", legal: 1 to 127"
    severity failure;
  assert X_GAIN < integer'high and Z_GAIN < integer'high and X_BACK < integer'high and Z_BACK < integer'high
    and X_GAIN > 1000 and Z_GAIN > 1000 and X_BACK > 1000 and Z_BACK > 1000
    report "skid_steer: 1 m/s or 1 rad/s makes too few or too many counts a period"
    severity failure;

  in_done  <= done_r;
  in_left  <= in_left_r;
  in_right <= in_right_r;
  out_done <= out_done_r;
  out_x    <= out_x_r;
  out_z    <= out_z_r;

  -- Command to speeds -----------------------------------------------------------------------------------------------

  asked          <= in_z when start_r = '1' else in_x;
  fixed_in_valid <= in_start or start_r;

  u_fixed : entity firm.firm_float64_to_fixed
    generic map (
      WIDTH    => TWIST_BITS,
      FRACTION => TWIST_FRACTION
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => fixed_in_valid,
      in_number     => asked,
      out_valid     => fixed_valid,
      out_number    => fixed,
      out_overflow  => open,
      out_undefined => undefined
    );

  to_speeds : process (clk)
    variable left, right : signed(TWIST_BITS+32 downto 0);
  begin
    if rising_edge(clk) then
      start_r <= in_start;

      is_z_r <= fixed_valid and not is_z_r;
      gain_r <= to_signed(X_GAIN, 32);
      if fixed_valid = '1' and is_z_r = '0' then
        gain_r <= to_signed(Z_GAIN, 32);
      end if;

      if fixed_valid = '1' then
        low_r  <= signed(fixed) * signed('0' & gain_r(PART_BITS-1 downto 0));
        high_r <= signed(fixed) * resize(gain_r(31 downto PART_BITS), PART_BITS+1);
      end if;
      product_r       <= (resize(high_r, product_t'length-PART_BITS) & to_signed(0, PART_BITS)) + low_r;
      product_valid_r <= product_valid_r(0) & fixed_valid;
      product_is_z_r  <= product_is_z_r(0) & is_z_r;
      lost_r          <= lost_r(1 downto 0) & undefined;

      forward_r     <= product_r;
      sides_valid_r <= product_valid_r(1) and product_is_z_r(1);
      if product_valid_r(1) = '1' then
        left    := resize(forward_r, left'length) - product_r;
        right   := resize(forward_r, right'length) + product_r;
        left_r  <= rounded(left);
        right_r <= rounded(right);
        -- z, or the preceding x.
        if lost_r(1) = '1' or lost_r(2) = '1' then
          left_r  <= (others => '0');
          right_r <= (others => '0');
        end if;
      end if;

      done_r <= sides_valid_r;
      if sides_valid_r = '1' then
        in_left_r  <= limited(left_r);
        in_right_r <= limited(right_r);
      end if;
      if rst_n = '0' then
        start_r         <= '0';
        is_z_r          <= '0';
        product_valid_r <= "00";
        sides_valid_r   <= '0';
        done_r          <= '0';
      end if;
    end if;
  end process to_speeds;

  -- Counts to twist -------------------------------------------------------------------------------------------------

  back : process (clk)
    variable front_left  : signed(9 downto 0);
    variable front_right : signed(9 downto 0);
    variable rear_left   : signed(9 downto 0);
    variable rear_right  : signed(9 downto 0);
  begin
    if rising_edge(clk) then
      if out_start = '1' then
        front_left   := resize(signed(out_counts(7 downto 0)), 10);
        front_right  := resize(signed(out_counts(15 downto 8)), 10);
        rear_left    := resize(signed(out_counts(23 downto 16)), 10);
        rear_right   := resize(signed(out_counts(31 downto 24)), 10);
        sum_r        <= (front_left + rear_left) + (front_right + rear_right);
        difference_r <= (front_right + rear_right) - (front_left + rear_left);
      end if;
      back_step_r <= back_step_r(2 downto 0) & out_start;
      factor_r    <= sum_r;
      back_gain_r <= to_signed(X_BACK, 32);
      if back_step_r(1) = '1' then
        factor_r    <= difference_r;
        back_gain_r <= to_signed(Z_BACK, 32);
      end if;
      if back_step_r(1) = '1' or back_step_r(2) = '1' then
        back_r <= factor_r * back_gain_r;
      end if;

      out_done_r <= float_valid and is_second_r;
      if float_valid = '1' then
        is_second_r <= not is_second_r;
        out_x_r     <= out_z_r;
        out_z_r     <= float;
      end if;
      if rst_n = '0' then
        back_step_r <= "0000";
        is_second_r <= '0';
        out_done_r  <= '0';
      end if;
    end if;
  end process back;

  float_in_valid <= back_step_r(2) or back_step_r(3);
  float_in       <= std_logic_vector(resize(back_r, 64));

  u_float : entity firm.firm_fixed_to_float64
    generic map (
      FRACTION => BACK_FRACTION
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_valid   => float_in_valid,
      in_number  => float_in,
      out_valid  => float_valid,
      out_number => float
    );

end architecture rtl;
