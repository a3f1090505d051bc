-- SPDX-License-Identifier: Apache-2.0
-- The natural logarithm of a floating-point number.
--
-- With x = m * 2**e and m about 1, the result is e * ln(2) + ln(m). The smaller one of 1 and m is multiplied by all
-- 1 + 2**-i, i = 1, 2, ..., that leave it below the other one; what is missing is multiplied by 2 with each i. The sum
-- of their logarithms is computed in two parts: that of 2**-i is written as digits; that of 2**-i - ln(1 + 2**-i) is
-- summed from a table, and subtracted. After half of the digits, the rest is a quotient. If e is 0, the first i is that
-- of the first digit, so that small logarithms have as many digits as others.
-- One digit takes one cycle, and so does one leading zero of a subnormal number, or of m - 1 if e is 0.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_log_table.all;
use firm.firm_float_pkg.all;

entity firm_float_log is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32; 5 to 15 and 8 to 57.
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
end entity firm_float_log;

architecture rtl of firm_float_log is

  -- Digits of the logarithm of m.
  constant DIGITS     : positive := MANTISSA_BITS + 5;
  -- The last factor whose logarithm needs the table.
  constant LAST       : positive := DIGITS / 2;
  -- In the table, ln(2) * 2**j follows this number of differences.
  constant POWER_BITS : positive := levels_for(LAST+1);
  constant POWERS     : positive := 2**POWER_BITS;
  constant INDEX_BITS : positive := levels_for(POWERS+EXPONENT_BITS-1);
  -- Of the index, those whose shift is on the path from the shifted number to the sum.
  constant NEAR_BITS  : positive := 3;
  -- Fraction bits of the sum of differences.
  constant FINE       : positive := DIGITS + LAST;
  -- Fraction bits of the factors.
  constant INNER      : positive := MANTISSA_BITS + 7;
  constant BIAS       : natural  := bias_of(EXPONENT_BITS);
  constant RANGE_BITS : positive := EXPONENT_BITS + 2;

  -- Two integer bits and a sign.
  subtype inner_t is unsigned(INNER+2 downto 0);
  subtype difference_t is unsigned(FINE+EXPONENT_BITS downto 0);
  subtype index_t is unsigned(INDEX_BITS-1 downto 0);
  -- Descending, since an ascending index costs a subtraction in GHDL's netlist.
  type differences_t is array (natural range 2**INDEX_BITS-1 downto 0) of difference_t;
  type state_t is (IDLE, NORMALISE, CENTRE, SEEK, DIVIDE, UNITE, ROUND);

  -- 2**-i - ln(1 + 2**-i), and twice ln(2) * 2**j.
  function all_differences return differences_t is
    variable result : differences_t := (others => (others => '0'));
    variable power  : unsigned(FINE downto 0);
  begin
    -- Illegal generics must reach the asserts below, not fail a bound check here.
    if FINE < 95 and EXPONENT_BITS < 16 then
      for i in 1 to LAST loop
        power         := (others => '0');
        power(FINE-i) := '1';
        result(i)     := resize(power - logarithm(i, FINE), difference_t'length);
      end loop;
      for j in 0 to EXPONENT_BITS-1 loop
        if POWERS + j < 2**INDEX_BITS then
          result(POWERS+j) := shift_left(resize(logarithm(0, FINE+1), difference_t'length), j);
        end if;
      end loop;
    end if;
    return result;
  end function all_differences;

  constant DIFFERENCES : differences_t := all_differences;

  signal advance       : std_logic;
  signal valid         : std_logic;

  signal state_r       : state_t;
  signal count_r       : natural range 0 to DIGITS-1;

  signal kind_r        : kind_t;
  -- The result is 0 or not finite.
  signal is_known_r    : std_logic;
  signal is_negative_r : std_logic;
  -- m is below 1, and e is 0.
  signal is_below_r    : std_logic;
  signal is_near_r     : std_logic;
  -- e, and then its magnitude, whose lowest digit leaves with its multiple of ln(2).
  signal exponent_r    : signed(RANGE_BITS-1 downto 0);

  -- At first the mantissa; then the product so far.
  signal product_r     : inner_t;
  -- The product, moved for the upper bits of the index.
  signal coarse_r      : inner_t;
  -- What the product lacks, times 2**index.
  signal lack_r        : inner_t;
  -- The product includes half of what it lacks, so that the rest is a quotient.
  signal is_bent_r     : std_logic;
  signal index_r       : index_t;
  -- Places by which the differences are still to be moved to the left.
  signal places_r      : index_t;
  signal digits_r      : unsigned(DIGITS-1 downto 0);
  signal differences_r : difference_t;
  -- The result, and the exponent of its highest bit.
  signal sum_r         : unsigned(DIGITS+EXPONENT_BITS-1 downto 0);
  signal place_r       : signed(RANGE_BITS-1 downto 0);

  -- The logarithm of m and that of 2**e have different signs.
  signal is_opposed    : std_logic;
  signal round_valid   : std_logic;

begin

  assert EXPONENT_BITS >= 5 and EXPONENT_BITS <= 15
    report "firm_float_log: EXPONENT_BITS is " & integer'image(EXPONENT_BITS) & ", legal: 5 to 15"
    severity failure;
  assert MANTISSA_BITS <= 57 and DIGITS >= POWERS + EXPONENT_BITS - 1
    report "firm_float_log: MANTISSA_BITS is " & integer'image(MANTISSA_BITS)
      & ", legal: at most 57, and so many that " & integer'image(POWERS+EXPONENT_BITS-1) & " digits are computed"
    severity failure;

  advance     <= out_ready or not valid;
  in_ready    <= '1' when state_r = IDLE else '0';
  out_valid   <= valid;
  round_valid <= '1' when state_r = ROUND else '0';
  is_opposed  <= (is_negative_r xor is_below_r) and not is_near_r;

  control : process (clk)
    variable difference   : inner_t;
    variable is_taken     : std_logic;
    variable added        : inner_t;
    variable next_product : inner_t;
    variable next_index   : index_t;
    variable step         : difference_t;
    variable is_minus     : std_logic;
    variable mask         : difference_t;
    variable extended     : unsigned(difference_t'length downto 0);
    variable sum          : difference_t;
    variable tail         : difference_t;
    variable far          : natural range 0 to POWERS-1;
  begin
    if rising_edge(clk) then
      difference := lack_r - product_r;
      is_taken   := not difference(difference'left);
      added      := shift_right(coarse_r, to_integer(index_r(NEAR_BITS-1 downto 0)));
      if state_r = SEEK then
        added := shift_right(lack_r, 2);
      elsif index_r > LAST then
        added := shift_right(lack_r, LAST+2);
      end if;
      next_product := product_r;
      next_index   := index_r;

      -- A difference of the table, a multiple of ln(2), or the sum itself, which is doubled.
      step     := DIFFERENCES(to_integer(index_r));
      is_minus := not is_opposed;
      if index_r > LAST then
        is_minus := '0';
        if places_r /= 0 then
          step := differences_r;
        elsif exponent_r(0) = '0' then
          step := (others => '0');
        end if;
      elsif is_taken = '0' then
        step     := (others => '0');
        is_minus := '0';
      end if;
      mask     := (others => is_minus);
      extended := (differences_r & '1') + ((step xor mask) & is_minus);
      sum      := extended(difference_t'length downto 1);

      if state_r = IDLE then
        next_product  := shift_left(resize(mantissa_of(in_number, EXPONENT_BITS), inner_t'length),
                                    INNER-MANTISSA_BITS);
        exponent_r    <= exponent_of(in_number, EXPONENT_BITS, RANGE_BITS) - BIAS;
        next_index    := to_unsigned(1, INDEX_BITS);
        is_bent_r     <= '0';
        is_known_r    <= '0';
        is_negative_r <= '0';
        kind_r        <= kind_of(in_number, EXPONENT_BITS);
        if is_zero(in_number) then
          is_known_r    <= '1';
          is_negative_r <= '1';
          kind_r        <= INFINITE;
        elsif in_number(in_number'left) = '1' or kind_of(in_number, EXPONENT_BITS) /= FINITE then
          is_known_r <= '1';
          if in_number(in_number'left) = '1' then
            kind_r <= UNDEFINED;
          end if;
        end if;
        if in_valid = '1' then
          state_r <= NORMALISE;
        end if;

      elsif state_r = NORMALISE then
        if is_known_r = '1' or product_r(INNER) = '1' then
          is_below_r <= '0';
          -- From 23/16, about the root of 2, m is halved.
          if product_r(INNER-1 downto INNER-4) >= 7 then
            is_below_r   <= '1';
            next_product := shift_right(product_r, 1);
            exponent_r   <= exponent_r + 1;
          end if;
          state_r <= CENTRE;
        else
          next_product := shift_left(product_r, 1);
          exponent_r   <= exponent_r - 1;
        end if;

      elsif state_r = CENTRE then
        lack_r <= shift_left(resize(product_r(INNER-1 downto 0), inner_t'length), 1);
        if is_below_r = '1' then
          lack_r <= shift_left(resize(not product_r(INNER-1 downto 0) + 1, inner_t'length), 1);
        else
          next_product        := (others => '0');
          next_product(INNER) := '1';
        end if;
        is_near_r <= '0';
        if exponent_r = 0 then
          is_near_r <= not is_known_r;
        end if;
        state_r <= SEEK;

      elsif state_r = SEEK then
        differences_r <= (others => '0');
        count_r       <= DIGITS - 1;
        places_r      <= index_r;
        -- The highest bit of the sum has the weight 2**(EXPONENT_BITS-1-index).
        place_r <= to_signed(BIAS+EXPONENT_BITS-1, RANGE_BITS) - signed(resize(index_r, RANGE_BITS));
        if is_near_r = '0' then
          if is_known_r = '0' then
            is_negative_r <= exponent_r(RANGE_BITS-1);
          end if;
          if exponent_r(RANGE_BITS-1) = '1' then
            exponent_r <= -exponent_r;
          end if;
          state_r <= DIVIDE;
        else
          is_negative_r <= is_below_r;
          if lack_r(INNER+2 downto INNER-LAST) = 0 and lack_r /= 0 and is_bent_r = '0' then
            next_product := product_r + added;
            is_bent_r    <= '1';
          end if;
          if lack_r = 0 then
            is_known_r    <= '1';
            is_negative_r <= '0';
            state_r       <= DIVIDE;
          elsif lack_r(INNER-1) = '1' then
            state_r <= DIVIDE;
          else
            lack_r     <= shift_left(lack_r, 1);
            next_index := index_r + 1;
          end if;
        end if;

      elsif state_r = DIVIDE then
        if index_r > LAST and is_bent_r = '0' then
          next_product := product_r + added;
          is_bent_r    <= '1';
        else
          lack_r <= shift_left(lack_r, 1);
          if is_taken = '1' then
            lack_r <= shift_left(difference, 1);
            if index_r <= LAST then
              next_product := product_r + added;
            end if;
          end if;
          digits_r      <= digits_r(DIGITS-2 downto 0) & is_taken;
          differences_r <= sum;
          if index_r > LAST and places_r /= 0 then
            places_r <= places_r - 1;
          end if;
          if index_r >= POWERS then
            exponent_r <= '0' & exponent_r(RANGE_BITS-1 downto 1);
          end if;
          if index_r /= 2**INDEX_BITS-1 then
            next_index := index_r + 1;
          end if;
          if count_r = 0 then
            state_r <= UNITE;
          else
            count_r <= count_r - 1;
          end if;
        end if;

      elsif state_r = UNITE then
        -- The last one is the middle of the digits that remain.
        tail  := resize(digits_r & '1', difference_t'length);
        sum_r <= resize(shift_right(differences_r, LAST) + tail, sum_r'length);
        if is_opposed = '1' then
          sum_r <= resize(shift_right(differences_r, LAST) - tail, sum_r'length);
        end if;
        if is_known_r = '1' then
          sum_r <= (others => '0');
        end if;
        state_r <= ROUND;

      elsif advance = '1' then
        state_r <= IDLE;
      end if;

      far       := to_integer(next_index(POWER_BITS-1 downto NEAR_BITS)) * 2**NEAR_BITS;
      product_r <= next_product;
      index_r   <= next_index;
      coarse_r  <= shift_right(next_product, far);

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
      WIDTH         => DIGITS+EXPONENT_BITS,
      MAX_LEFT      => EXPONENT_BITS+1,
      HAS_UNDERFLOW => false
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => round_valid,
      in_sign      => is_negative_r,
      in_kind      => kind_r,
      in_exponent  => place_r,
      in_magnitude => sum_r,
      out_valid    => valid,
      out_number   => out_number
    );

end architecture rtl;
