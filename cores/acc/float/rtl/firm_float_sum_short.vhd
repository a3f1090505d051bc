-- SPDX-License-Identifier: Apache-2.0
-- Adds two floating-point numbers in four cycles; the sum is not normalised.
--
-- The number with the larger magnitude comes first, so that one subtraction serves all differences. The other one is
-- aligned to it. The lowest bit keeps whether a one is omitted.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_sum_short is
  generic (
    EXPONENT_BITS : positive;
    MANTISSA_BITS : positive
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;
    -- All registers keep their values unless it is high.
    advance       : in  std_logic;

    in_valid      : in  std_logic;
    in_a          : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_b          : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid     : out std_logic;
    out_sign      : out std_logic;
    out_kind      : out std_logic_vector(1 downto 0);
    -- The exponent of the larger number.
    out_exponent  : out unsigned(EXPONENT_BITS-1 downto 0);
    -- With three bits below the mantissa, and one above for the carry.
    out_magnitude : out unsigned(MANTISSA_BITS+4 downto 0)
  );
end entity firm_float_sum_short;

architecture rtl of firm_float_sum_short is

  constant WIDTH  : positive := MANTISSA_BITS + 4;
  constant LEVELS : positive := levels_for(WIDTH);
  -- Whether numbers are subtracted, sign, kind, exponent, the magnitude that is not shifted.
  constant REST   : positive := 4 + EXPONENT_BITS + WIDTH;

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  -- The largest part of the distance first, so that the omitted bits are known early.
  function moved_right(magnitude : unsigned; distance : unsigned) return unsigned is
    variable result     : unsigned(magnitude'range);
    variable is_omitted : std_logic;
  begin
    result     := magnitude;
    is_omitted := '0';
    for level in distance'range loop
      if distance(level) = '1' then
        if result(2**level-1 downto 0) /= 0 then
          is_omitted := '1';
        end if;
        result := shift_right(result, 2**level);
      end if;
    end loop;
    result(0) := result(0) or is_omitted;
    return result;
  end function moved_right;

  subtype rest_t is std_logic_vector(REST-1 downto 0);

  signal read_valid_r    : std_logic;
  signal a_r             : number_t;
  signal b_r             : number_t;
  signal a_above_r       : signed(EXPONENT_BITS downto 0);
  signal b_above_r       : signed(EXPONENT_BITS downto 0);
  signal is_swapped_r    : std_logic;

  signal order_valid_r   : std_logic;
  signal small_r         : unsigned(WIDTH-1 downto 0);
  signal distance_r      : unsigned(LEVELS-1 downto 0);
  signal rest_r          : rest_t;

  signal aligned_valid_r : std_logic;
  signal aligned_r       : unsigned(WIDTH-1 downto 0);
  signal aligned_rest_r  : rest_t;

  signal sum_valid_r     : std_logic;
  signal sum_r           : unsigned(WIDTH downto 0);
  signal sum_rest_r      : std_logic_vector(REST-WIDTH-2 downto 0);

begin

  out_valid     <= sum_valid_r;
  out_sign      <= sum_rest_r(EXPONENT_BITS+2);
  out_kind      <= sum_rest_r(EXPONENT_BITS+1 downto EXPONENT_BITS);
  out_exponent  <= unsigned(sum_rest_r(EXPONENT_BITS-1 downto 0));
  out_magnitude <= sum_r;

  compare : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        read_valid_r <= in_valid;
        a_r          <= in_a;
        b_r          <= in_b;
        a_above_r    <= exponent_of(in_a, EXPONENT_BITS, EXPONENT_BITS+1)
                        - exponent_of(in_b, EXPONENT_BITS, EXPONENT_BITS+1);
        b_above_r    <= exponent_of(in_b, EXPONENT_BITS, EXPONENT_BITS+1)
                        - exponent_of(in_a, EXPONENT_BITS, EXPONENT_BITS+1);
        is_swapped_r <= '0';
        -- Of numbers that differ in their signs only, the positive one comes first: their sum is +0.
        if unsigned(in_a(in_a'left-1 downto 0) & '0') < unsigned(in_b(in_b'left-1 downto 0) & in_a(in_a'left)) then
          is_swapped_r <= '1';
        end if;
      end if;
      if rst_n = '0' then
        read_valid_r <= '0';
      end if;
    end if;
  end process compare;

  order : process (clk)
    variable big       : number_t;
    variable small     : number_t;
    variable distance  : signed(EXPONENT_BITS downto 0);
    variable subtracts : std_logic;
    variable kind      : kind_t;
  begin
    if rising_edge(clk) then
      if advance = '1' then
        big      := a_r;
        small    := b_r;
        distance := a_above_r;
        if is_swapped_r = '1' then
          big      := b_r;
          small    := a_r;
          distance := b_above_r;
        end if;
        subtracts := big(big'left) xor small(small'left);
        kind      := kind_of(big, EXPONENT_BITS);
        if kind = INFINITE and subtracts = '1' and kind_of(small, EXPONENT_BITS) = INFINITE then
          kind := UNDEFINED;
        end if;
        order_valid_r <= read_valid_r;
        small_r       <= fitted(mantissa_of(small, EXPONENT_BITS), WIDTH);
        distance_r    <= limited(distance, LEVELS);
        rest_r        <= subtracts & big(big'left) & kind
                         & std_logic_vector(exponent_of(big, EXPONENT_BITS, EXPONENT_BITS))
                         & std_logic_vector(fitted(mantissa_of(big, EXPONENT_BITS), WIDTH));
      end if;
      if rst_n = '0' then
        order_valid_r <= '0';
      end if;
    end if;
  end process order;

  -- For a difference, the magnitude is inverted, and the carry of the sum is one.
  align : process (clk)
    variable subtracts : unsigned(WIDTH-1 downto 0);
  begin
    if rising_edge(clk) then
      if advance = '1' then
        aligned_valid_r <= order_valid_r;
        subtracts       := (others => rest_r(REST-1));
        aligned_r       <= moved_right(small_r, distance_r) xor subtracts;
        aligned_rest_r  <= rest_r;
      end if;
      if rst_n = '0' then
        aligned_valid_r <= '0';
      end if;
    end if;
  end process align;

  add : process (clk)
    variable sum : unsigned(WIDTH+1 downto 0);
  begin
    if rising_edge(clk) then
      if advance = '1' then
        sum         := unsigned('0' & aligned_rest_r(WIDTH-1 downto 0) & '1')
                       + (aligned_rest_r(REST-1) & aligned_r & aligned_rest_r(REST-1));
        sum_valid_r <= aligned_valid_r;
        sum_rest_r  <= aligned_rest_r(REST-2 downto WIDTH);
        sum_r       <= sum(WIDTH+1 downto 1);
      end if;
      if rst_n = '0' then
        sum_valid_r <= '0';
      end if;
    end if;
  end process add;

end architecture rtl;
