-- SPDX-License-Identifier: Apache-2.0
-- The angle of the vector (x, y) in rad: atan2(y, x), from -pi to pi.
--
-- The vector is mirrored so that 0 <= y <= x, and turned towards the x axis by atan(2**-i), as in CORDIC. The sum of
-- the angles is computed in two parts: that of 2**-i is the signs of all turns, written as digits; that of
-- 2**-i - atan(2**-i) is summed from a table, and subtracted in the end. If the angle itself is the result, the turns
-- begin with the first i that it needs, so that small angles have as many digits as others. If it is added to a
-- multiple of pi/2, or if the result is subnormal, zeros precede the digits.
-- One digit takes one cycle, and so does one leading zero of a subnormal number.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_cordic_table.all;
use firm.firm_float_pkg.all;

entity firm_float_atan2 is
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
    in_y       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_x       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_atan2;

architecture rtl of firm_float_atan2 is

  -- Digits of the angle. With these five further ones, the error is below a quarter of a unit before rounding.
  constant DIGITS     : positive := MANTISSA_BITS + 5;
  -- The last turn whose angle differs from 2**-i, in view of the smallest angle that begins with it.
  constant LAST       : positive := DIGITS / 2;
  constant INDEX_BITS : positive := levels_for(LAST+1);
  -- Of the index, those whose shift is on the path from the shifted number to the sum.
  constant NEAR_BITS  : positive := 3;
  constant FAR_SHIFTS : natural  := 2**(INDEX_BITS-NEAR_BITS) - 1;
  -- Fraction bits of the sum of differences.
  constant FINE       : positive := DIGITS + LAST;
  -- Fraction bits of x and y, and bits with the sign and the growth of the vector.
  constant INNER      : positive := MANTISSA_BITS + 5;
  constant WIDTH      : positive := INNER + 5;
  constant BIAS       : natural  := bias_of(EXPONENT_BITS);
  constant RANGE_BITS : positive := levels_for(2**EXPONENT_BITS+MANTISSA_BITS) + 1;

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  subtype inner_t is signed(WIDTH-1 downto 0);
  subtype difference_t is signed(FINE+1 downto 0);
  subtype angle_t is unsigned(DIGITS+1 downto 0);
  -- Descending, since an ascending index costs a subtraction in GHDL's netlist.
  type differences_t is array (natural range 2**INDEX_BITS-1 downto 0) of difference_t;
  type state_t is (IDLE, ORDER, NORMALISE, PREPARE, BEGIN_TURNS, TURN, SUBTRACT, UNFOLD, ROUND);

  -- 2**-i - atan(2**-i).
  function all_differences return differences_t is
    variable result : differences_t := (others => (others => '0'));
    variable power  : unsigned(FINE downto 0);
  begin
    for i in result'range loop
      -- Illegal generics must reach the asserts below, not fail a bound check here.
      if i <= LAST and FINE < 96 then
        power         := (others => '0');
        power(FINE-i) := '1';
        result(i)     := signed('0' & (power - arctangent(i, FINE)));
      end if;
    end loop;
    return result;
  end function all_differences;

  -- The mantissa as x or y.
  function inner_of(number : number_t) return inner_t is
  begin
    return signed(resize(mantissa_of(number, EXPONENT_BITS), WIDTH)) sll (INNER - MANTISSA_BITS);
  end function inner_of;

  -- Divided by 4**index for the upper bits of the index, rounded down. Place by place, as ghdl 2.0 translates a shift
  -- of a signed number to Verilog without its sign.
  function coarse_of(number : inner_t; index : unsigned) return inner_t is
    variable result : inner_t;
    variable places : natural;
  begin
    result := number;
    for k in 1 to FAR_SHIFTS loop
      if index(INDEX_BITS-1 downto NEAR_BITS) = k then
        places := 2**(NEAR_BITS+1) * k;
        result := (others => number(WIDTH-1));
        for place in 0 to WIDTH-1-places loop
          result(place) := number(place + places);
        end loop;
      end if;
    end loop;
    return result;
  end function coarse_of;

  -- a + b, or a - b if `is_negative` is high, with one adder.
  function summed(a : signed; b : signed; is_negative : std_logic) return signed is
    variable inverting : signed(b'range);
    variable sum       : signed(a'length downto 0);
  begin
    inverting := (others => is_negative);
    sum       := (a & '1') + ((b xor inverting) & is_negative);
    return sum(a'length downto 1);
  end function summed;

  constant DIFFERENCES : differences_t := all_differences;
  constant HALF_PI     : angle_t       := resize(arctangent(0, DIGITS+1), DIGITS+2);

  signal advance       : std_logic;
  signal valid         : std_logic;

  signal state_r       : state_t;
  signal count_r       : natural range 0 to DIGITS-1;

  signal y_r           : number_t;
  signal x_r           : number_t;
  -- The larger magnitude is that of y.
  signal is_steep_r    : std_logic;
  -- The angle of the mirrored vector is 0.
  signal is_flat_r     : std_logic;
  signal kind_r        : kind_t;

  -- Of the mirrored vector; y is multiplied by a power of two with each turn.
  signal long_r        : inner_t;
  signal short_r       : inner_t;
  -- y, moved for the upper bits of the index.
  signal coarse_r      : inner_t;
  -- The difference of their exponents.
  signal distance_r    : signed(RANGE_BITS-1 downto 0);
  -- Zeros before the first turn, and whether the vector is turned in this cycle.
  signal zeros_r       : unsigned(levels_for(DIGITS)-1 downto 0);
  signal is_turning_r  : std_logic;
  -- Whether this cycle increments the index: if it turns the vector, or if the zeros are those before the first turn.
  signal is_counting_r : std_logic;
  -- Of the first turn, and of the turn; it does not overflow.
  signal first_r       : unsigned(INDEX_BITS-1 downto 0);
  signal index_r       : unsigned(INDEX_BITS-1 downto 0);
  -- Places by which the differences are still to be moved to the left, and whether this cycle moves them.
  signal places_r      : unsigned(INDEX_BITS-1 downto 0);
  signal is_doubling_r : std_logic;
  signal digits_r      : unsigned(DIGITS-1 downto 0);
  signal differences_r : difference_t;
  signal angle_r       : angle_t;
  signal exponent_r    : signed(RANGE_BITS-1 downto 0);

  -- The angle is added to a multiple of pi/2.
  signal is_offset     : std_logic;
  signal offset        : angle_t;
  signal round_valid   : std_logic;

begin

  assert EXPONENT_BITS >= 5 and EXPONENT_BITS <= 15
    report "firm_float_atan2: EXPONENT_BITS is " & integer'image(EXPONENT_BITS) & ", legal: 5 to 15"
    severity failure;
  assert MANTISSA_BITS >= 8 and MANTISSA_BITS <= 57 and BIAS > LAST
    report "firm_float_atan2: MANTISSA_BITS is " & integer'image(MANTISSA_BITS)
      & ", legal: 8 to 57, and less than 2**EXPONENT_BITS - 6"
    severity failure;

  advance     <= out_ready or not valid;
  in_ready    <= '1' when state_r = IDLE else '0';
  out_valid   <= valid;
  round_valid <= '1' when state_r = ROUND else '0';
  is_offset   <= is_steep_r or x_r(x_r'left);

  -- Set bit by bit: ghdl 2.0 translates a constant of more than 32 bits to a Verilog string.
  offset(0) <= is_steep_r and HALF_PI(0);
  offsets : for k in 1 to DIGITS+1 generate
    offset(k) <= HALF_PI(k) when is_steep_r = '1' else x_r(x_r'left) and HALF_PI(k-1);
  end generate offsets;

  control : process (clk)
    variable long       : number_t;
    variable short      : number_t;
    variable below      : signed(RANGE_BITS-1 downto 0);
    variable is_below   : std_logic;
    variable mask       : inner_t;
    variable places     : natural range 0 to 2**(NEAR_BITS+1)-1;
    variable tilted     : inner_t;
    variable turned     : inner_t;
    variable step       : difference_t;
    variable is_minus   : std_logic;
    variable next_short : inner_t;
    variable next_index : unsigned(INDEX_BITS-1 downto 0);
    variable left       : unsigned(INDEX_BITS-1 downto 0);
  begin
    if rising_edge(clk) then
      is_below := short_r(WIDTH-1);
      -- A number that is not turned is not changed.
      mask := (others => '0');
      if is_turning_r = '1' then
        mask := long_r;
      end if;
      turned     := summed(short_r, mask, not is_below);
      -- The sum is on the longest path, so that few choices follow it.
      next_short := turned;
      if is_turning_r = '1' or (state_r = NORMALISE and short_r(INNER) = '0') then
        next_short := shift_left(turned, 1);
      end if;
      next_index := index_r;
      if is_counting_r = '1' and index_r /= 2**INDEX_BITS-1 then
        next_index := index_r + 1;
      end if;
      left := places_r;

      if state_r = IDLE then
        y_r        <= in_y;
        x_r        <= in_x;
        is_steep_r <= '0';
        if unsigned(in_x(in_x'left-1 downto 0)) < unsigned(in_y(in_y'left-1 downto 0)) then
          is_steep_r <= '1';
        end if;
        if in_valid = '1' then
          state_r <= ORDER;
        end if;

      elsif state_r = ORDER then
        long  := x_r;
        short := y_r;
        if is_steep_r = '1' then
          long  := y_r;
          short := x_r;
        end if;
        long_r     <= inner_of(long);
        next_short := inner_of(short);
        distance_r <= exponent_of(long, EXPONENT_BITS, RANGE_BITS) - exponent_of(short, EXPONENT_BITS, RANGE_BITS);
        is_flat_r  <= '0';
        if is_zero(short) or
           (kind_of(long, EXPONENT_BITS) = INFINITE and kind_of(short, EXPONENT_BITS) = FINITE) then
          is_flat_r <= '1';
        end if;
        kind_r <= FINITE;
        if kind_of(long, EXPONENT_BITS) = UNDEFINED or kind_of(short, EXPONENT_BITS) = UNDEFINED then
          kind_r <= UNDEFINED;
        end if;
        state_r <= NORMALISE;

      elsif state_r = NORMALISE then
        if is_flat_r = '1' or (long_r(INNER) = '1' and short_r(INNER) = '1') then
          state_r <= PREPARE;
        elsif long_r(INNER) = '1' then
          distance_r <= distance_r + 1;
        elsif short_r(INNER) = '1' then
          distance_r <= distance_r - 1;
        end if;
        if long_r(INNER) = '0' then
          long_r <= shift_left(long_r, 1);
        end if;

      elsif state_r = PREPARE then
        -- The place of the first digit, above the smallest exponent.
        below         := to_signed(BIAS+1, RANGE_BITS) - distance_r;
        exponent_r    <= below;
        zeros_r       <= (others => '0');
        first_r       <= limited(distance_r, INDEX_BITS);
        if is_offset = '1' then
          exponent_r <= to_signed(BIAS+1, RANGE_BITS);
          zeros_r    <= limited(distance_r, zeros_r'length);
          first_r    <= (others => '0');
        elsif below < 1 then
          exponent_r <= to_signed(1, RANGE_BITS);
          zeros_r    <= limited(to_signed(1, RANGE_BITS) - below, zeros_r'length);
        end if;
        if is_flat_r = '1' then
          zeros_r <= (others => '1');
          if is_offset = '0' then
            exponent_r <= to_signed(1, RANGE_BITS);
          end if;
        end if;
        differences_r <= (others => '0');
        count_r       <= DIGITS - 1;
        state_r       <= BEGIN_TURNS;

      elsif state_r = BEGIN_TURNS then
        next_index := first_r;
        left       := first_r;
        is_counting_r <= is_offset;
        if zeros_r = 0 then
          is_turning_r  <= '1';
          is_counting_r <= '1';
        end if;
        state_r <= TURN;

      elsif state_r = TURN then
        if is_turning_r = '0' then
          zeros_r <= zeros_r - 1;
          if zeros_r = 1 then
            is_turning_r  <= '1';
            is_counting_r <= '1';
          end if;
        end if;

        step     := DIFFERENCES(to_integer(index_r));
        is_minus := is_below;
        if is_doubling_r = '1' then
          step     := differences_r;
          is_minus := '0';
          left     := places_r - 1;
        end if;
        digits_r <= digits_r(DIGITS-2 downto 0) & '0';
        if is_turning_r = '1' then
          -- The magnitude of y, or one less.
          mask          := (others => is_below);
          places        := to_integer(index_r(NEAR_BITS-1 downto 0) & '0');
          tilted        := signed(shift_right(unsigned(coarse_r xor mask), places));
          long_r        <= long_r + tilted;
          differences_r <= summed(differences_r, step, is_minus);
          digits_r(0)   <= not turned(WIDTH-1);
        end if;

        if count_r = 0 then
          is_turning_r  <= '0';
          is_counting_r <= '0';
          state_r       <= SUBTRACT;
        else
          count_r <= count_r - 1;
        end if;

      elsif state_r = SUBTRACT then
        -- The last one is the middle of the digits that remain.
        angle_r <= ('0' & digits_r & '1') - unsigned(differences_r(FINE+1 downto FINE-DIGITS));
        state_r <= UNFOLD;

      elsif state_r = UNFOLD then
        angle_r <= unsigned(summed(signed(offset), signed(angle_r), is_steep_r xor x_r(x_r'left)));
        state_r <= ROUND;

      elsif advance = '1' then
        state_r <= IDLE;
      end if;

      short_r       <= next_short;
      index_r       <= next_index;
      coarse_r      <= coarse_of(next_short, next_index);
      places_r      <= left;
      is_doubling_r <= '0';
      if next_index > LAST and left /= 0 then
        is_doubling_r <= '1';
      end if;

      if rst_n = '0' then
        state_r       <= IDLE;
        is_turning_r  <= '0';
        is_counting_r <= '0';
      end if;
    end if;
  end process control;

  u_round : entity firm.firm_float_round
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      WIDTH         => DIGITS+2,
      MAX_LEFT      => 3,
      HAS_UNDERFLOW => false
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => round_valid,
      in_sign      => y_r(y_r'left),
      in_kind      => kind_r,
      in_exponent  => exponent_r,
      in_magnitude => angle_r,
      out_valid    => valid,
      out_number   => out_number
    );

end architecture rtl;
