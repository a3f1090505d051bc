-- SPDX-License-Identifier: Apache-2.0
-- The exponential function of a floating-point number.
--
-- With x = k * ln(2) + r, the result is exp(r) * 2**k. The digits of k are found by subtractions of ln(2) * 2**j. The
-- same register then loses ln(1 + 2**-i), i = 1, 2, ..., where this is possible. What remains is so small that its
-- exponential is 1 plus itself. This is multiplied by all 1 + 2**-i that were subtracted. One adder and one shifter
-- serve all steps, one step a cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_log_table.all;
use firm.firm_float_pkg.all;

entity firm_float_exp is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32; 5 to 15 and 8 to 54.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_ready   : out std_logic;
    in_number  : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_exp;

architecture rtl of firm_float_exp is

  -- Fraction bits of the computation: the rounding errors of all steps together stay below these eight bits.
  constant FRACTION   : positive := MANTISSA_BITS + 8;
  -- Factors 1 + 2**-i. The square of what remains then is below the last bit.
  constant FACTORS    : positive := FRACTION / 2;
  -- Sign, and integer bits for 2**EXPONENT_BITS * ln(2).
  constant WIDTH      : positive := FRACTION + EXPONENT_BITS + 2;
  -- Moves of 31 places that bring the mantissa to any place: at most 3. Two bring a result to the smallest exponent.
  constant FURTHEST   : positive := 31;
  constant ALIGNMENTS : positive := WIDTH / FURTHEST + 1;
  constant BIAS       : natural  := bias_of(EXPONENT_BITS);
  constant RANGE_BITS : positive := EXPONENT_BITS + 2;
  constant REST_BITS  : positive := 7;
  -- In the table, ln(2) * 2**j follows 32 other logarithms.
  constant POWERS     : positive := 32;

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  subtype inner_t is unsigned(WIDTH-1 downto 0);
  -- Descending, since an ascending index costs a subtraction in GHDL's netlist.
  type logarithms_t is array (natural range 2*POWERS-1 downto 0) of inner_t;
  type state_t is (IDLE, ALIGN, RAISE, REDUCE, DIVIDE, REMAIN, MULTIPLY, SCALE, LOWER, ROUND);

  function all_logarithms return logarithms_t is
    variable result : logarithms_t := (others => (others => '0'));
  begin
    -- Illegal generics must reach the asserts below, not fail a bound check here.
    if FACTORS < POWERS and EXPONENT_BITS < 16 then
      for i in 1 to FACTORS loop
        result(i) := resize(logarithm(i, FRACTION), WIDTH);
      end loop;
      for j in 0 to EXPONENT_BITS loop
        result(POWERS+j) := resize(logarithm(0, FRACTION+j), WIDTH);
      end loop;
    end if;
    return result;
  end function all_logarithms;

  constant LOGARITHMS : logarithms_t := all_logarithms;

  signal advance      : std_logic;
  signal valid        : std_logic;

  signal state_r      : state_t;
  -- Further cycles of ALIGN or LOWER.
  signal passes_r     : natural range 0 to 3;
  -- Of the table, or places of the shifter.
  signal index_r      : unsigned(5 downto 0);
  -- Places by which the number is still to be moved.
  signal rest_r       : unsigned(REST_BITS-1 downto 0);

  signal number_r     : inner_t;
  signal power_r      : unsigned(EXPONENT_BITS downto 0);
  -- Whether each factor is part of the result; that of the next one is the lowest.
  signal factors_r    : std_logic_vector(FACTORS-1 downto 0);
  signal kind_r       : kind_t;
  -- The result is 0.
  signal is_nothing_r : std_logic;
  signal exponent_r   : signed(RANGE_BITS-1 downto 0);

  signal round_valid  : std_logic;

begin

  assert EXPONENT_BITS >= 5 and EXPONENT_BITS <= 15
    report "firm_float_exp: EXPONENT_BITS is " & integer'image(EXPONENT_BITS) & ", legal: 5 to 15"
    severity failure;
  assert MANTISSA_BITS >= 8 and MANTISSA_BITS <= 54
    report "firm_float_exp: MANTISSA_BITS is " & integer'image(MANTISSA_BITS) & ", legal: 8 to 54"
    severity failure;

  advance     <= out_ready or not valid;
  in_ready    <= '1' when state_r = IDLE else '0';
  out_valid   <= valid;
  round_valid <= '1' when state_r = ROUND else '0';

  control : process (clk)
    variable distance  : signed(RANGE_BITS-1 downto 0);
    variable mask      : inner_t;
    variable moved     : inner_t;
    variable operand   : inner_t;
    variable subtracts : std_logic;
    variable extended  : unsigned(WIDTH downto 0);
    variable sum       : inner_t;
    variable taken     : unsigned(REST_BITS-1 downto 0);
  begin
    if rising_edge(clk) then
      mask  := (others => number_r(WIDTH-1));
      moved := shift_right(number_r xor mask, to_integer(index_r(4 downto 0))) xor mask;

      subtracts := '0';
      if state_r = REDUCE or state_r = DIVIDE then
        subtracts := '1';
      end if;
      operand := LOGARITHMS(to_integer(index_r));
      if state_r = MULTIPLY then
        operand := moved;
      end if;
      mask     := (others => subtracts);
      extended := (number_r & '1') + ((operand xor mask) & subtracts);
      sum      := extended(WIDTH downto 1);

      taken := rest_r;
      if rest_r > FURTHEST then
        taken := to_unsigned(FURTHEST, REST_BITS);
      end if;

      if state_r = IDLE then
        -- The leading one has the weight 2**(EXPONENT_BITS-2); -0 and the smallest negative numbers are -2**-FRACTION.
        mask         := (others => in_number(in_number'left));
        number_r     <= shift_left(resize(mantissa_of(in_number, EXPONENT_BITS), WIDTH),
                                   FRACTION+EXPONENT_BITS-2-MANTISSA_BITS) xor mask;
        distance     := to_signed(BIAS+EXPONENT_BITS-2, RANGE_BITS) - exponent_of(in_number, EXPONENT_BITS, RANGE_BITS);
        rest_r       <= limited(distance, REST_BITS);
        index_r      <= (others => '0');
        passes_r     <= ALIGNMENTS;
        is_nothing_r <= '0';
        kind_r       <= FINITE;
        if kind_of(in_number, EXPONENT_BITS) = UNDEFINED then
          kind_r <= UNDEFINED;
        elsif distance < 0 then
          is_nothing_r <= in_number(in_number'left);
          if in_number(in_number'left) = '0' then
            kind_r <= INFINITE;
          end if;
        end if;
        if in_valid = '1' then
          state_r <= ALIGN;
        end if;

      elsif state_r = ALIGN or state_r = LOWER then
        number_r <= moved;
        index_r  <= resize(taken, 6);
        rest_r   <= rest_r - taken;
        if passes_r /= 0 then
          passes_r <= passes_r - 1;
        elsif state_r = LOWER then
          state_r <= ROUND;
        else
          index_r <= to_unsigned(POWERS+EXPONENT_BITS, 6);
          state_r <= RAISE;
        end if;

      elsif state_r = RAISE then
        -- A positive number, whatever the sign.
        number_r <= sum;
        state_r  <= REDUCE;

      elsif state_r = REDUCE then
        power_r <= power_r(EXPONENT_BITS-1 downto 0) & not sum(WIDTH-1);
        if sum(WIDTH-1) = '0' then
          number_r <= sum;
        end if;
        index_r <= index_r - 1;
        if index_r = POWERS then
          index_r <= to_unsigned(1, 6);
          state_r <= DIVIDE;
        end if;

      elsif state_r = DIVIDE then
        factors_r <= factors_r(FACTORS-2 downto 0) & not sum(WIDTH-1);
        if sum(WIDTH-1) = '0' then
          number_r <= sum;
        end if;
        if index_r = FACTORS then
          state_r <= REMAIN;
        else
          index_r <= index_r + 1;
        end if;

      elsif state_r = REMAIN then
        number_r(FRACTION) <= '1';
        state_r            <= MULTIPLY;

      elsif state_r = MULTIPLY then
        factors_r <= '0' & factors_r(FACTORS-1 downto 1);
        if factors_r(0) = '1' then
          number_r <= sum;
        end if;
        index_r <= index_r - 1;
        if index_r = 1 then
          state_r <= SCALE;
        end if;
        -- Of the bit above the leading one; RAISE has added 2**EXPONENT_BITS to the power.
        exponent_r <= signed(resize(power_r, RANGE_BITS)) - 2**(EXPONENT_BITS-1);

      elsif state_r = SCALE then
        rest_r  <= limited(to_signed(2, RANGE_BITS) - exponent_r, REST_BITS);
        index_r <= (others => '0');
        if exponent_r < 2 then
          exponent_r <= to_signed(2, RANGE_BITS);
        end if;
        if is_nothing_r = '1' then
          number_r <= (others => '0');
        end if;
        passes_r <= 2;
        state_r  <= LOWER;

      elsif advance = '1' then
        state_r <= IDLE;
      end if;

      if rst_n = '0' then
        state_r <= IDLE;
      end if;
    end if;
  end process control;

  u_round : entity firm.firm_float_round
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      WIDTH         => FRACTION+2,
      MAX_LEFT      => 1,
      HAS_UNDERFLOW => false
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => round_valid,
      in_sign      => '0',
      in_kind      => kind_r,
      in_exponent  => exponent_r,
      in_magnitude => number_r(FRACTION+1 downto 0),
      out_valid    => valid,
      out_number   => out_number
    );

end architecture rtl;
