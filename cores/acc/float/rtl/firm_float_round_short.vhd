-- SPDX-License-Identifier: Apache-2.0
-- Converts an exponent and a magnitude to a floating-point number in four cycles: rounded to nearest, ties to even.
--
-- One shifter moves the magnitude in both directions. The magnitude follows RIGHT zeros, and is moved to the left by
-- the number of zeros before its leading one, but at most by RIGHT and the limit: a negative limit leaves the leading
-- one below the highest bit of the result. The distance is found in two steps: first the group of eight bits, then the
-- place in it. The limit is marked as if it were a one, so that no comparison of distances is necessary.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_round_short is
  generic (
    EXPONENT_BITS : positive;
    MANTISSA_BITS : positive;
    -- Bits of the input's limit, which is signed.
    RANGE_BITS    : positive;
    -- Bits of the input's magnitude; at most MANTISSA_BITS + 4 of a normal result are leading zeros.
    WIDTH         : positive;
    -- The limit may be below 0.
    HAS_UNDERFLOW : boolean
  );
  port (
    clk          : in  std_logic;
    rst_n        : in  std_logic;
    -- All registers keep their values unless it is high.
    advance      : in  std_logic;

    in_valid     : in  std_logic;
    in_sign      : in  std_logic;
    in_kind      : in  std_logic_vector(1 downto 0);
    -- Places to the left at which the magnitude would have the smallest exponent: its exponent, less one.
    in_limit     : in  signed(RANGE_BITS-1 downto 0);
    in_magnitude : in  unsigned(WIDTH-1 downto 0);

    -- High 4 cycles after in_valid.
    out_valid    : out std_logic;
    out_number   : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_round_short;

architecture rtl of firm_float_round_short is

  constant FITTED_WIDTH : positive := MANTISSA_BITS + 3;
  constant FINE         : positive := 3;
  constant OCTET        : positive := 2**FINE;
  -- Bits of the distance to one side, which is at most one more than the bits of the result.
  constant SIDE         : positive := levels_for(FITTED_WIDTH+1);
  constant RIGHT        : natural  := 2**SIDE * boolean'pos(HAS_UNDERFLOW);
  constant LEVELS       : positive := SIDE + boolean'pos(HAS_UNDERFLOW);
  constant COARSE       : positive := LEVELS - FINE;
  constant GROUPS       : positive := 2**COARSE;
  -- The result, and all that can still move into it: at first, and after the coarse distance.
  constant REACH        : positive := FITTED_WIDTH + 2**LEVELS - 1;
  constant NARROW       : positive := FITTED_WIDTH + OCTET - 1;

  subtype distance_t is unsigned(LEVELS-1 downto 0);
  subtype exponent_t is signed(RANGE_BITS-1 downto 0);

  -- Moved to the left by a distance in units; the lowest bit keeps whether a one is omitted.
  function moved_left(magnitude : unsigned; distance : unsigned; unit : positive) return unsigned is
    variable result : unsigned(magnitude'length-1 downto 0);
  begin
    result := magnitude;
    for level in distance'range loop
      if distance(level) = '1' then
        result := shift_left(result, unit*2**level);
      end if;
      -- What is further below cannot reach the result any more.
      result := fitted(fitted(result, FITTED_WIDTH + unit*2**level - 1), result'length);
    end loop;
    return fitted(result, FITTED_WIDTH + unit - 1);
  end function moved_left;

  -- The largest distance. The addition of RIGHT inverts the sign of a number in range.
  function limit_of(number : exponent_t) return distance_t is
    variable sign : exponent_t;
  begin
    if not HAS_UNDERFLOW then
      return limited(number, LEVELS);
    end if;
    sign := (others => number(number'left));
    if number(RANGE_BITS-1 downto SIDE) /= sign(RANGE_BITS-1 downto SIDE) then
      return unsigned(not sign(LEVELS-1 downto 0));
    end if;
    return unsigned(not sign(0 downto 0) & number(SIDE-1 downto 0));
  end function limit_of;

  -- The index of the first one from the left, by halves.
  function first_one(bits : unsigned; size : positive) return unsigned is
    variable rest  : unsigned(2**size-1 downto 0);
    variable index : unsigned(size-1 downto 0);
  begin
    rest  := bits;
    index := (others => '0');
    for level in size-1 downto 0 loop
      if rest(2**size-1 downto 2**size-2**level) = 0 then
        index(level) := '1';
        rest         := shift_left(rest, 2**level);
      end if;
    end loop;
    return index;
  end function first_one;

  signal extended        : unsigned(REACH-1 downto 0);
  signal limit           : distance_t;

  signal valids_r        : std_logic_vector(2 downto 0);

  signal sign_r          : std_logic;
  signal kind_r          : kind_t;
  signal magnitude_r     : unsigned(WIDTH-1 downto 0);
  signal limit_r         : distance_t;
  signal groups_r        : unsigned(COARSE-1 downto 0);
  -- Of a number whose leading one needs no move.
  signal exponent_r      : exponent_t;
  signal moved           : unsigned(NARROW-1 downto 0);

  signal near_sign_r     : std_logic;
  signal near_kind_r     : kind_t;
  signal near_r          : unsigned(NARROW-1 downto 0);
  signal near_distance_r : distance_t;
  signal near_exponent_r : exponent_t;

  signal fit_sign_r      : std_logic;
  signal fit_kind_r      : kind_t;
  signal fit_r           : unsigned(FITTED_WIDTH-1 downto 0);
  signal fit_exponent_r  : exponent_t;

begin

  extended <= fitted(to_unsigned(0, RIGHT) & in_magnitude, REACH);
  limit    <= limit_of(in_limit);
  moved    <= moved_left(fitted(to_unsigned(0, RIGHT) & magnitude_r, REACH), groups_r, OCTET);

  shift : process (clk)
    variable marks  : unsigned(GROUPS-1 downto 0);
    variable places : unsigned(OCTET-1 downto 0);
    variable last   : unsigned(FINE-1 downto 0);
  begin
    if rising_edge(clk) then
      if advance = '1' then
        valids_r <= valids_r(1 downto 0) & in_valid;

        for index in 0 to GROUPS-1 loop
          marks(GROUPS-1-index) := '0';
          if extended(REACH-1-OCTET*index downto REACH-OCTET*(index+1)) /= 0 or limit(LEVELS-1 downto FINE) = index then
            marks(GROUPS-1-index) := '1';
          end if;
        end loop;
        sign_r      <= in_sign;
        kind_r      <= in_kind;
        magnitude_r <= in_magnitude;
        limit_r     <= limit;
        groups_r    <= first_one(marks, COARSE);
        exponent_r  <= in_limit + (RIGHT + 1);

        last := (others => '1');
        if limit_r(LEVELS-1 downto FINE) = groups_r then
          last := limit_r(FINE-1 downto 0);
        end if;
        for index in 0 to OCTET-1 loop
          places(OCTET-1-index) := moved(NARROW-1-index);
          if last = index then
            places(OCTET-1-index) := '1';
          end if;
        end loop;
        near_sign_r     <= sign_r;
        near_kind_r     <= kind_r;
        near_r          <= moved;
        near_distance_r <= groups_r & first_one(places, FINE);
        near_exponent_r <= exponent_r;

        fit_sign_r     <= near_sign_r;
        fit_kind_r     <= near_kind_r;
        fit_r          <= moved_left(near_r, near_distance_r(FINE-1 downto 0), 1);
        fit_exponent_r <= near_exponent_r - signed(resize(near_distance_r, RANGE_BITS));
      end if;
      if rst_n = '0' then
        valids_r <= (others => '0');
      end if;
    end if;
  end process shift;

  u_pack : entity firm.firm_float_pack
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      IS_SHORT      => true
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => valids_r(2),
      in_sign      => fit_sign_r,
      in_kind      => fit_kind_r,
      in_exponent  => fit_exponent_r,
      in_magnitude => fit_r,
      out_valid    => out_valid,
      out_number   => out_number
    );

end architecture rtl;
