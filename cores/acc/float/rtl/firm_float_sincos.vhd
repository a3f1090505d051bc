-- SPDX-License-Identifier: Apache-2.0
-- Sine and cosine of a floating-point angle in rad.
--
-- The angle becomes a fixed-point number and is folded to half a turn: for each k from ANGLE_BITS-2 to 0, an angle
-- beyond pi * 2**k is moved towards 0 by twice this value. CORDIC computes both results. One angle is computed at a
-- time.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_cordic_table.all;

entity firm_float_sincos is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52;
    -- Fraction bits of the computation: 8 to 58. The error is below 5 * 2**-FRACTION before the last rounding.
    FRACTION      : positive := 58;
    -- Legal angles are below 2**ANGLE_BITS rad: 2 to 24.
    ANGLE_BITS    : positive := 16
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_ready   : out std_logic;
    in_angle   : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    -- NaN if the angle is NaN or not legal.
    out_sine   : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    out_cosine : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_sincos;

architecture rtl of firm_float_sincos is

  -- The errors of all folds together stay below these bits.
  constant GUARD : positive := 6;
  constant INNER : positive := FRACTION + GUARD;
  constant WIDTH : positive := ANGLE_BITS + 1 + INNER;

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  subtype angle_t is signed(WIDTH-1 downto 0);

  -- pi * 2**(ANGLE_BITS-2).
  function largest_step return unsigned is
    constant NOTHING : unsigned(INNER+ANGLE_BITS-1 downto 0) := (others => '0');
  begin
    -- Illegal generics must reach the asserts below, not fail a bound check here.
    if FRACTION > 58 or ANGLE_BITS > 24 then
      return NOTHING;
    end if;
    return arctangent(0, INNER+ANGLE_BITS);
  end function largest_step;

  constant LARGEST : unsigned(INNER+ANGLE_BITS-1 downto 0) := largest_step;

  type state_t is (IDLE, CONVERT, MEASURE, FOLD, ROUND, ROTATE, FINISH);

  signal state_r      : state_t;
  -- Remaining folds.
  signal count_r      : natural range 0 to ANGLE_BITS;
  signal illegal_r    : std_logic;

  -- Set bit by bit: ghdl 2.0 translates a constant of more than 32 bits to a Verilog string.
  signal first_step   : angle_t;
  signal step_r       : angle_t;
  signal angle_r      : angle_t;
  -- The angle, closer to 0 by the step.
  signal closer_r     : angle_t;

  signal start        : std_logic;
  signal fixed_valid  : std_logic;
  signal fixed        : std_logic_vector(WIDTH-1 downto 0);
  signal is_beyond    : std_logic;
  signal is_undefined : std_logic;

  signal half         : signed(1 downto 0);
  signal folded_r     : signed(FRACTION+2 downto 0);
  signal turn_valid   : std_logic;
  signal turn_ready   : std_logic;
  signal turned       : std_logic;
  signal taken        : std_logic;
  signal cosine_fixed : std_logic_vector(FRACTION+1 downto 0);
  signal sine_fixed   : std_logic_vector(FRACTION+1 downto 0);

  signal done         : std_logic;
  signal sine         : number_t;
  signal cosine       : number_t;
  signal quiet        : number_t;

begin

  assert FRACTION >= 8 and FRACTION <= 58
    report "firm_float_sincos: FRACTION is " & integer'image(FRACTION) & ", legal: 8 to 58"
    severity failure;
  assert ANGLE_BITS >= 2 and ANGLE_BITS <= 24
    report "firm_float_sincos: ANGLE_BITS is " & integer'image(ANGLE_BITS) & ", legal: 2 to 24"
    severity failure;

  in_ready   <= '1' when state_r = IDLE else '0';
  start      <= in_valid when state_r = IDLE else '0';
  turn_valid <= '1' when state_r = ROTATE else '0';
  out_valid  <= done;
  out_sine   <= quiet when illegal_r = '1' else sine;
  out_cosine <= quiet when illegal_r = '1' else cosine;

  quiet(number_t'left)                          <= '0';
  quiet(number_t'left-1 downto MANTISSA_BITS-1) <= (others => '1');
  quiet(MANTISSA_BITS-2 downto 0)               <= (others => '0');

  steps : for k in LARGEST'range generate
    first_step(k) <= LARGEST(k);
  end generate steps;
  first_step(WIDTH-1) <= '0';

  half <= '0' & angle_r(GUARD-1);

  u_to_fixed : entity firm.firm_float_to_fixed
    generic map (
      WIDTH         => WIDTH,
      FRACTION      => INNER,
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => start,
      in_ready      => open,
      in_number     => in_angle,
      out_valid     => fixed_valid,
      out_ready     => '1',
      out_number    => fixed,
      out_overflow  => is_beyond,
      out_undefined => is_undefined
    );

  u_sincos : entity firm.firm_cordic_sincos
    generic map (
      FRACTION   => FRACTION,
      ITERATIONS => FRACTION
    )
    port map (
      clk       => clk,
      rst_n     => rst_n,
      in_valid  => turn_valid,
      in_ready  => turn_ready,
      in_angle  => std_logic_vector(folded_r),
      out_valid => turned,
      out_ready => taken,
      out_cos   => cosine_fixed,
      out_sin   => sine_fixed
    );

  u_sine : entity firm.firm_fixed_to_float
    generic map (
      WIDTH         => FRACTION+2,
      FRACTION      => FRACTION,
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_valid   => turned,
      in_ready   => taken,
      in_number  => sine_fixed,
      out_valid  => done,
      out_ready  => out_ready,
      out_number => sine
    );

  -- In step with the sine.
  u_cosine : entity firm.firm_fixed_to_float
    generic map (
      WIDTH         => FRACTION+2,
      FRACTION      => FRACTION,
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_valid   => turned,
      in_ready   => open,
      in_number  => cosine_fixed,
      out_valid  => open,
      out_ready  => out_ready,
      out_number => cosine
    );

  control : process (clk)
  begin
    if rising_edge(clk) then
      -- To nearest.
      folded_r <= angle_r(INNER+2 downto GUARD) + half;

      if state_r = IDLE then
        if in_valid = '1' then
          state_r <= CONVERT;
        end if;

      elsif state_r = CONVERT then
        angle_r   <= signed(fixed);
        illegal_r <= is_beyond or is_undefined;
        step_r    <= first_step;
        count_r   <= ANGLE_BITS - 2;
        if fixed_valid = '1' then
          state_r <= MEASURE;
        end if;

      elsif state_r = MEASURE then
        if angle_r(WIDTH-1) = '1' then
          closer_r <= angle_r + step_r;
        else
          closer_r <= angle_r - step_r;
        end if;
        state_r <= FOLD;

      elsif state_r = FOLD then
        -- The sign is the same: the angle is beyond the step.
        if closer_r(WIDTH-1) = angle_r(WIDTH-1) then
          if angle_r(WIDTH-1) = '1' then
            angle_r <= closer_r + step_r;
          else
            angle_r <= closer_r - step_r;
          end if;
        end if;
        step_r  <= '0' & step_r(WIDTH-1 downto 1);
        state_r <= MEASURE;
        if count_r = 0 then
          state_r <= ROUND;
        else
          count_r <= count_r - 1;
        end if;

      elsif state_r = ROUND then
        state_r <= ROTATE;

      elsif state_r = ROTATE then
        if turn_ready = '1' then
          state_r <= FINISH;
        end if;

      elsif done = '1' and out_ready = '1' then
        state_r <= IDLE;
      end if;

      if rst_n = '0' then
        state_r <= IDLE;
      end if;
    end if;
  end process control;

end architecture rtl;
