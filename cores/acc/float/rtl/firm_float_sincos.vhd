-- SPDX-License-Identifier: Apache-2.0
-- Sine and cosine of a floating-point angle in rad, for any finite angle.
--
-- The mantissa is multiplied by the digits of 2/pi that matter for the exponent, the highest first. The product is the
-- angle in quarter turns; all but the last two integer bits leave the register. Digits follow until the distance from
-- the nearest multiple of a quarter turn has enough bits, however near it is: it is z * 2**-s quarter turns. As in
-- CORDIC, the angles atan(2**-i), i = s, s+1, ..., are subtracted from it or added. What remains is so small that it is
-- its own sine; it is multiplied by pi/2, for rad, and by the gain's inverse, as sums and differences of shifted
-- numbers. The vector is then turned by the same angles in the reverse order, so that the sine grows as the shifts
-- become shorter, and small sines have as many digits as others.
-- The sine of an angle below 2**-LAST is the angle itself. One digit, angle or term takes one cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;
use firm.firm_float_turn_table.all;

entity firm_float_sincos is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32; 8 to 11 and 8 to 52.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_ready   : out std_logic;
    in_angle   : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    -- NaN if the angle is not finite.
    out_sine   : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    out_cosine : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_sincos;

architecture rtl of firm_float_sincos is

  -- Fraction bits of z, of the sine and of the cosine, an even number. The errors of all steps stay below these bits.
  constant FRACTION      : positive := (MANTISSA_BITS + 8) / 2 * 2;
  -- With the sign and two integer bits.
  constant WIDTH         : positive := FRACTION + 3;
  -- The last angle; the square of what remains is below the last bit of a cosine.
  constant LAST          : positive := (MANTISSA_BITS + 3) / 2;
  -- Bits of the product below z.
  constant LOW           : positive := MANTISSA_BITS + 3;
  -- The digits of 2/pi begin with this one before the exponent, counted in digits: those before are whole turns.
  constant WHOLE         : positive := (MANTISSA_BITS + 1) / 2;
  -- Fraction bits of z when the quadrant is taken. Further digits move z by less than a unit of them, so that the first
  -- angle still reaches it.
  constant SPLIT         : positive := 5;
  -- z has enough bits if its magnitude is at least 1/4, so 2**-MARGIN before its last digit.
  constant MARGIN        : positive := 4;
  -- Cycles that bring the mantissa of a small angle to the place of z.
  constant MOVES         : positive := FRACTION / 2 + 1;
  constant BIAS          : natural  := bias_of(EXPONENT_BITS);
  constant RANGE_BITS    : positive := levels_for(2**EXPONENT_BITS+2*FRACTION) + 1;
  constant INDEX_BITS    : positive := levels_for(2**(EXPONENT_BITS-2)+FRACTION+4);
  -- Digits of 2/pi that are read at once.
  constant WORD_DIGITS   : positive := 8;
  constant WORD_BITS     : positive := 3;
  -- Bits of the number of an angle; all ones are beyond the last one.
  constant TURN_BITS     : positive := 5;
  constant NO_TURN       : positive := 2**TURN_BITS - 1;
  constant DISTANCE_BITS : positive := 6;
  -- Of a distance, those that shift on the path to the sum.
  constant NEAR_BITS     : positive := 4;
  constant FAR_SHIFTS    : positive := 2**(DISTANCE_BITS-NEAR_BITS) - 1;
  constant TERM_BITS     : positive := 8;
  -- Terms below this part of the last bit of the sine are omitted.
  constant OMITTED       : positive := 2;

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  subtype inner_t is signed(WIDTH-1 downto 0);
  subtype product_t is signed(LOW+1 downto 0);
  subtype exponent_t is signed(RANGE_BITS-1 downto 0);
  subtype distance_t is unsigned(DISTANCE_BITS-1 downto 0);
  subtype pointer_t is unsigned(TERM_BITS-1 downto 0);
  subtype word_t is unsigned(2*WORD_DIGITS-1 downto 0);
  -- Whether it is the last one of a sum, whether it is subtracted, and its shift.
  subtype term_t is std_logic_vector(DISTANCE_BITS+1 downto 0);
  -- Descending, since an ascending index costs a subtraction in GHDL's netlist.
  type words_t is array (natural range 2**(INDEX_BITS-WORD_BITS)-1 downto 0) of word_t;
  type constants_t is array (natural range 2**(TURN_BITS+1)-1 downto 0) of inner_t;
  type terms_t is array (natural range 2**TERM_BITS-1 downto 0) of term_t;
  type pointers_t is array (natural range 2**(TURN_BITS-1)-1 downto 0) of pointer_t;
  type state_t is (IDLE, PREPARE, FETCH, REDUCE, MEASURE, LOOK_UP, SCALE, EXCHANGE, TURN, ROUND);

  -- The first digit is the lowest one of a word.
  function all_words return words_t is
    constant DIGITS : pi_digits_t := two_over_pi;
    variable result : words_t     := (others => (others => '0'));
    variable place  : natural;
  begin
    for k in 1 to PI_DIGITS loop
      if k < 2**INDEX_BITS then
        place := k mod WORD_DIGITS * 2;

        result(k / WORD_DIGITS)(place+1 downto place) := unsigned(DIGITS(k));
      end if;
    end loop;
    return result;
  end function all_words;

  -- Twice the angles, each times 2**i, in quarter turns; then the cosine before all turns from an angle on.
  function all_constants return constants_t is
    variable result : constants_t := (others => (others => '0'));
  begin
    -- Illegal generics must reach the asserts below, not fail a bound check here.
    if FRACTION < 95 and LAST < NO_TURN then
      for i in 1 to LAST loop
        result(i) := signed(shift_left(resize(quarter_turns(i, FRACTION), WIDTH), 1));
      end loop;
      for i in 1 to NO_TURN loop
        if i > LAST then
          result(2**TURN_BITS+i)(FRACTION) := '1';
        elsif i mod 2 = 1 then
          result(2**TURN_BITS+i) := signed(resize(inverse_gain_from(i, FRACTION), WIDTH));
        end if;
      end loop;
    end if;
    return result;
  end function all_constants;

  -- For each number of a first angle, the factor of what remains, less 1, as a sum of powers of two: the digits of its
  -- non-adjacent form. They are the differences of the bits of three times the number and those of the number.
  function all_terms return terms_t is
    variable result : terms_t := (others => (others => '0'));
    variable count  : natural;
    variable first  : positive;
    variable least  : natural;
    variable single : unsigned(TURN_TABLE_FRACTION+1 downto 0);
    variable triple : unsigned(TURN_TABLE_FRACTION+1 downto 0);
    variable place  : natural;
  begin
    count := 0;
    for k in 0 to (LAST+1)/2 loop
      first := 2*k + 1;
      least := FRACTION - OMITTED;
      if first > LAST then
        first := TURN_TABLE_LAST;
      else
        least := least - (LAST + 1 - first);
      end if;
      single := resize(rad_of_quarter_turns(first), single'length);
      triple := single + shift_left(single, 1);
      for distance in 1 to least loop
        place := TURN_TABLE_FRACTION + 1 - distance;
        if single(place) /= triple(place) and count < 2**TERM_BITS then
          result(count)(DISTANCE_BITS-1 downto 0) := std_logic_vector(to_unsigned(distance, DISTANCE_BITS));
          result(count)(DISTANCE_BITS)            := single(place);
          count                                   := count + 1;
        end if;
      end loop;
      if count > 0 then
        result(count-1)(term_t'left) := '1';
      end if;
    end loop;
    return result;
  end function all_terms;

  -- The first term for each number of a first angle.
  function all_pointers(terms : terms_t) return pointers_t is
    variable result : pointers_t := (others => (others => '0'));
    variable list   : natural;
  begin
    list := 0;
    for k in terms'reverse_range loop
      if terms(k)(term_t'left) = '1' and list < (LAST+1)/2 then
        list := list + 1;
        for other in result'range loop
          if other >= list then
            result(other) := to_unsigned(k+1, TERM_BITS);
          end if;
        end loop;
      end if;
    end loop;
    return result;
  end function all_pointers;

  -- Divided by a power of two for the upper bits of the distance, rounded down. Place by place, as ghdl 2.0 translates
  -- a shift of a signed number to Verilog without its sign.
  function coarse_of(number : inner_t; distance : distance_t) return inner_t is
    variable result : inner_t;
    variable places : natural;
  begin
    result := number;
    for k in 1 to FAR_SHIFTS loop
      if distance(DISTANCE_BITS-1 downto NEAR_BITS) = k then
        places := 2**NEAR_BITS * k;
        result := (others => number(WIDTH-1));
        for place in 0 to WIDTH-1-places loop
          result(place) := number(place + places);
        end loop;
      end if;
    end loop;
    return result;
  end function coarse_of;

  -- The same for the lower bits.
  function fine_of(number : inner_t; distance : distance_t) return inner_t is
    variable extended : unsigned(WIDTH+2**NEAR_BITS-2 downto 0);
  begin
    extended                   := (others => number(WIDTH-1));
    extended(WIDTH-1 downto 0) := unsigned(number);
    extended                   := shift_right(extended, to_integer(distance(NEAR_BITS-1 downto 0)));
    return signed(extended(WIDTH-1 downto 0));
  end function fine_of;

  -- a + b, or a - b if `is_negative` is high, with one adder.
  function summed(a : signed; b : signed; is_negative : std_logic) return signed is
    variable inverting : signed(b'range);
    variable sum       : signed(a'length downto 0);
  begin
    inverting := (others => is_negative);
    sum       := (a & '1') + ((b xor inverting) & is_negative);
    return sum(a'length downto 1);
  end function summed;

  constant WORDS     : words_t     := all_words;
  constant CONSTANTS : constants_t := all_constants;
  constant TERMS     : terms_t     := all_terms;
  constant POINTERS  : pointers_t  := all_pointers(TERMS);

  signal advance        : std_logic;
  signal valid          : std_logic;
  signal rounded        : number_t;

  signal state_r        : state_t;
  -- How the next sine_r is computed. They repeat the state, so that no logic precedes the sum.
  signal is_reducing_r  : std_logic;
  signal is_measuring_r : std_logic;
  signal is_turning_r   : std_logic;
  signal adds_cosine_r  : std_logic;
  signal is_negative_r  : std_logic;
  signal kind_r         : kind_t;
  -- The first digit is not the first one of 2/pi, so that its word is still to be read.
  signal is_far_r       : std_logic;
  -- The sine is the angle.
  signal is_small_r     : std_logic;

  -- Of the product: the factors, the part below z, and a carry into z that is still to be added, from -1 to 1.
  signal mantissa_r     : unsigned(MANTISSA_BITS+1 downto 0);
  signal index_r        : unsigned(INDEX_BITS-1 downto 0);
  signal word_r         : word_t;
  signal digit_r        : pi_digit_t;
  signal low_r          : unsigned(LOW-1 downto 0);
  signal carry_r        : signed(1 downto 0);
  -- The exponent of z, and in the end of the sine.
  signal exponent_r     : exponent_t;
  -- The integer bits are complete; z may be complete.
  signal is_split_r     : std_logic;
  signal is_late_r      : std_logic;
  signal quadrant_r     : unsigned(1 downto 0);

  -- The angle z that is still to be subtracted, then the sine of the angle so far times a power of two.
  signal sine_r         : inner_t;
  signal cosine_r       : inner_t;
  -- That of this cycle, and what the next one is: an angle, or the first cosine.
  signal constant_r     : inner_t;
  signal is_scaling_r   : std_logic;
  signal turn_r         : unsigned(TURN_BITS-1 downto 0);
  -- The first angle, s.
  signal first_r        : unsigned(TURN_BITS-1 downto 0);
  -- Whether each angle was added to z; that of the last one is the lowest.
  signal signs_r        : std_logic_vector(LAST-1 downto 0);
  -- sine_r, moved for the upper bits of the distance.
  signal coarse_r       : inner_t;
  signal distance_r     : distance_t;
  signal pointer_r      : pointer_t;
  -- The next term; then the sign of this one, and whether it is the last one.
  signal term_r         : term_t;
  signal is_minus_r     : std_logic;
  signal is_last_r      : std_logic;

  -- Of rounding: the sine first.
  signal is_cosine_r    : std_logic;
  signal takes_sine     : std_logic;
  signal round_valid    : std_logic;
  signal round_sign     : std_logic;
  signal round_exp      : exponent_t;
  signal round_bits     : unsigned(FRACTION downto 0);
  signal has_sine_r     : std_logic;
  signal rounded_r      : number_t;

begin

  assert EXPONENT_BITS >= 8 and EXPONENT_BITS <= 11
    report "firm_float_sincos: EXPONENT_BITS is " & integer'image(EXPONENT_BITS) & ", legal: 8 to 11"
    severity failure;
  assert MANTISSA_BITS >= 8 and MANTISSA_BITS <= 52
    report "firm_float_sincos: MANTISSA_BITS is " & integer'image(MANTISSA_BITS) & ", legal: 8 to 52"
    severity failure;

  advance     <= out_ready or not (valid and has_sine_r);
  in_ready    <= '1' when state_r = IDLE else '0';
  out_valid   <= valid and has_sine_r;
  out_sine    <= rounded_r;
  out_cosine  <= rounded;

  round_valid <= '1' when state_r = ROUND else '0';
  takes_sine  <= quadrant_r(0) xnor is_cosine_r;
  round_sign  <= (takes_sine and sine_r(WIDTH-1)) xor quadrant_r(1) xor
                 ((is_cosine_r and quadrant_r(0)) or (is_negative_r and not is_cosine_r));
  round_exp   <= exponent_r when takes_sine = '1' else to_signed(BIAS, RANGE_BITS);

  magnitudes : for k in 0 to FRACTION generate
    -- That of a negative sine is one less.
    round_bits(k) <= sine_r(k) xor sine_r(WIDTH-1) when takes_sine = '1' else cosine_r(k);
  end generate magnitudes;

  control : process (clk)
    variable start         : exponent_t;
    variable far           : exponent_t;
    variable next_exponent : exponent_t;
    variable next_index    : unsigned(INDEX_BITS-1 downto 0);
    variable rest          : word_t;
    variable multiple      : product_t;
    variable product       : product_t;
    variable base          : inner_t;
    variable operand       : inner_t;
    variable subtracts     : std_logic;
    variable sum           : inner_t;
    variable last_exp      : exponent_t;
    variable candidate     : unsigned(TURN_BITS-1 downto 0);
    variable next_distance : distance_t;
    variable is_known      : std_logic;
    variable next_state    : state_t;
  begin
    if rising_edge(clk) then
      -- The product of the mantissa and a digit, from -1 to 2.
      multiple := signed(resize(mantissa_r, product_t'length));
      if digit_r = "10" then
        multiple := shift_left(multiple, 1);
      elsif digit_r = "00" then
        multiple := (others => '0');
      end if;
      product       := summed(signed(shift_left(resize(low_r(LOW-3 downto 0), LOW+2), 2)), multiple,
                              digit_r(1) and digit_r(0));
      next_exponent := exponent_r - 2;
      next_index    := index_r;

      -- z and the sine.
      operand   := resize(carry_r & "00", WIDTH);
      subtracts := '0';
      if is_measuring_r = '1' then
        operand   := constant_r;
        subtracts := not sine_r(WIDTH-1);
      elsif adds_cosine_r = '1' then
        operand   := cosine_r;
        subtracts := is_turning_r and signs_r(0);
      end if;
      base := sine_r;
      if is_reducing_r = '1' then
        base := sine_r(WIDTH-3 downto 0) & signed(low_r(LOW-1 downto LOW-2));
        if is_split_r = '1' then
          base(WIDTH-1 downto SPLIT+1) := (others => sine_r(SPLIT-1));
        end if;
      elsif is_measuring_r = '1' then
        base := sine_r(WIDTH-2 downto 0) & '0';
      elsif is_turning_r = '1' then
        base := sine_r(WIDTH-1) & sine_r(WIDTH-1 downto 1);
      end if;
      sum    := summed(base, operand, subtracts);
      sine_r <= sum;

      -- s, which is odd, if the product ends with the next digit.
      last_exp  := exponent_r - 4;
      candidate := (others => '1');
      if last_exp(RANGE_BITS-1 downto TURN_BITS) = BIAS / 2**TURN_BITS then
        candidate := not unsigned(last_exp(TURN_BITS-1 downto 0));
      end if;
      next_distance := (others => '0');

      next_state := state_r;
      if state_r = IDLE then
        index_r       <= to_unsigned(1, INDEX_BITS);
        is_far_r      <= '0';
        is_negative_r <= in_angle(in_angle'left);
        mantissa_r    <= resize(mantissa_of(in_angle, EXPONENT_BITS), MANTISSA_BITS+2);
        exponent_r    <= exponent_of(in_angle, EXPONENT_BITS, RANGE_BITS);
        kind_r        <= FINITE;
        if kind_of(in_angle, EXPONENT_BITS) /= FINITE then
          kind_r <= UNDEFINED;
        end if;
        if in_valid = '1' then
          next_state := PREPARE;
        end if;

      elsif state_r = PREPARE then
        -- If the exponent without its bias is odd, the mantissa has one bit more.
        if exponent_r(0) = '0' then
          mantissa_r <= shift_left(mantissa_r, 1);
        end if;
        is_small_r <= '0';
        if exponent_r < BIAS - LAST then
          is_small_r <= '1';
        end if;
        start      := exponent_r + (FRACTION + 5);
        exponent_r <= start(RANGE_BITS-1 downto 1) & '0';
        far        := exponent_r - (BIAS + 2*WHOLE);
        if far > 1 then
          exponent_r <= to_signed(BIAS+2*WHOLE+FRACTION+7, RANGE_BITS);
          index_r    <= unsigned(far(INDEX_BITS downto 1));
          is_far_r   <= '1';
        end if;
        low_r      <= (others => '0');
        carry_r    <= (others => '0');
        cosine_r   <= (others => '0');
        quadrant_r <= "00";
        is_split_r <= '0';
        is_late_r  <= '0';
        next_state := FETCH;

      elsif state_r = FETCH and is_far_r = '1' then
        is_far_r <= '0';

      elsif state_r = FETCH or state_r = REDUCE then
        next_index := index_r + 1;
        rest       := shift_right(word_r, to_integer(index_r(WORD_BITS-1 downto 0) & '0'));
        digit_r    <= std_logic_vector(rest(1 downto 0));
        index_r    <= next_index;
        if is_small_r = '1' then
          digit_r <= "00";
        end if;
        if state_r = FETCH then
          sine_r     <= (others => '0');
          exponent_r <= next_exponent;
          if is_small_r = '1' then
            exponent_r <= exponent_r;
            digit_r    <= "01";
          end if;
          next_state := REDUCE;
        else
          low_r      <= unsigned(product(LOW-1 downto 0));
          carry_r    <= product(LOW+1 downto LOW);
          exponent_r <= next_exponent;
          is_split_r <= '0';
          if next_exponent = BIAS + FRACTION - SPLIT then
            is_split_r <= '1';
          end if;
          if is_split_r = '1' then
            quadrant_r <= unsigned(sine_r(SPLIT+1 downto SPLIT)) + unsigned(sine_r(SPLIT-1 downto SPLIT-1));
          end if;
          is_late_r <= '0';
          if next_exponent <= BIAS + 1 then
            is_late_r <= '1';
          end if;
          first_r      <= turn_r;
          pointer_r    <= POINTERS(to_integer(turn_r(TURN_BITS-1 downto 1)));
          is_scaling_r <= '0';
          turn_r       <= candidate;
          is_known     := '0';
          if is_small_r = '1' then
            if index_r = MOVES + 2 then
              is_known := '1';
            end if;
          elsif is_late_r = '1' and sine_r(WIDTH-1 downto FRACTION-MARGIN) /= 0 and
                (not sine_r(WIDTH-1 downto FRACTION-MARGIN)) /= 0 then
            is_known := '1';
          end if;
          is_minus_r <= '0';
          is_last_r  <= '0';
          if is_known = '1' then
            carry_r <= "00";
            if is_small_r = '1' then
              cosine_r(FRACTION) <= '1';
              next_state         := ROUND;
            elsif turn_r <= LAST then
              turn_r     <= turn_r + 1;
              next_state := MEASURE;
            else
              next_state := LOOK_UP;
            end if;
          end if;
        end if;

      elsif state_r = MEASURE then
        signs_r <= signs_r(LAST-2 downto 0) & sine_r(WIDTH-1);
        turn_r  <= turn_r + 1;
        if turn_r = LAST + 1 then
          pointer_r    <= pointer_r + 1;
          turn_r       <= first_r;
          is_scaling_r <= '1';
          next_state   := SCALE;
        end if;

      elsif state_r = LOOK_UP then
        pointer_r    <= pointer_r + 1;
        turn_r       <= first_r;
        is_scaling_r <= '1';
        next_state   := SCALE;

      elsif state_r = SCALE then
        cosine_r      <= summed(cosine_r, fine_of(coarse_r, distance_r), is_minus_r);
        next_distance := unsigned(term_r(DISTANCE_BITS-1 downto 0));
        is_minus_r    <= term_r(DISTANCE_BITS);
        is_last_r     <= term_r(DISTANCE_BITS+1);
        pointer_r     <= pointer_r + 1;
        if is_last_r = '1' then
          sine_r     <= (others => '0');
          next_state := EXCHANGE;
        end if;

      elsif state_r = EXCHANGE then
        cosine_r      <= constant_r;
        turn_r        <= to_unsigned(LAST, TURN_BITS);
        next_distance := to_unsigned(2*LAST+1, DISTANCE_BITS);
        next_state    := TURN;
        if first_r > LAST then
          next_state := ROUND;
        end if;

      elsif state_r = TURN then
        cosine_r      <= summed(cosine_r, fine_of(coarse_r, distance_r), not signs_r(0));
        signs_r       <= '0' & signs_r(LAST-1 downto 1);
        turn_r        <= turn_r - 1;
        next_distance := distance_r - 2;
        if turn_r = first_r then
          next_state := ROUND;
        end if;

      elsif advance = '1' then
        is_cosine_r <= not is_cosine_r;
        if is_cosine_r = '1' then
          next_state := IDLE;
        end if;
      end if;

      state_r        <= next_state;
      is_reducing_r  <= '0';
      is_measuring_r <= '0';
      is_turning_r   <= '0';
      adds_cosine_r  <= '0';
      if next_state = REDUCE then
        is_reducing_r <= '1';
      elsif next_state = MEASURE then
        is_measuring_r <= '1';
      elsif next_state = EXCHANGE then
        adds_cosine_r <= '1';
      elsif next_state = TURN then
        is_turning_r  <= '1';
        adds_cosine_r <= '1';
      end if;

      term_r     <= TERMS(to_integer(pointer_r));
      word_r     <= WORDS(to_integer(next_index(INDEX_BITS-1 downto WORD_BITS)));
      distance_r <= next_distance;
      coarse_r   <= coarse_of(sum, next_distance);
      constant_r <= CONSTANTS(to_integer(is_scaling_r & turn_r));

      if advance = '1' then
        has_sine_r <= valid and not has_sine_r;
        rounded_r  <= rounded;
      end if;

      if rst_n = '0' then
        state_r     <= IDLE;
        is_cosine_r <= '0';
        has_sine_r  <= '0';
      end if;
    end if;
  end process control;

  u_round : entity firm.firm_float_round
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      WIDTH         => FRACTION+1,
      MAX_LEFT      => 2,
      HAS_UNDERFLOW => false
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => round_valid,
      in_sign      => round_sign,
      in_kind      => kind_r,
      in_exponent  => round_exp,
      in_magnitude => round_bits,
      out_valid    => valid,
      out_number   => rounded
    );

end architecture rtl;
