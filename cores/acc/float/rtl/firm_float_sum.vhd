-- SPDX-License-Identifier: Apache-2.0
-- Adds two numbers whose exponents are 1 or more; the sum is not normalised.
--
-- The number with the smaller exponent is aligned to the other one. If the exponents differ by 2 or more, a difference
-- has at most one leading zero more than the larger number. So WIDTH needs three bits beyond the mantissa, of which the
-- lowest keeps whether a one is omitted.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_sum is
  generic (
    -- Bits of the exponents, which are signed. The difference of two exponents fits, too.
    RANGE_BITS : positive;
    -- Bits of the magnitudes.
    WIDTH      : positive
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;
    -- All registers keep their values unless it is high.
    advance       : in  std_logic;

    in_valid      : in  std_logic;
    a_sign        : in  std_logic;
    a_kind        : in  std_logic_vector(1 downto 0);
    a_exponent    : in  signed(RANGE_BITS-1 downto 0);
    a_magnitude   : in  unsigned(WIDTH-1 downto 0);
    b_sign        : in  std_logic;
    b_kind        : in  std_logic_vector(1 downto 0);
    b_exponent    : in  signed(RANGE_BITS-1 downto 0);
    b_magnitude   : in  unsigned(WIDTH-1 downto 0);

    out_valid     : out std_logic;
    out_sign      : out std_logic;
    out_kind      : out std_logic_vector(1 downto 0);
    out_exponent  : out signed(RANGE_BITS-1 downto 0);
    -- One bit more, for the carry.
    out_magnitude : out unsigned(WIDTH downto 0)
  );
end entity firm_float_sum;

architecture rtl of firm_float_sum is

  constant LEVELS : positive := levels_for(WIDTH);
  -- Both signs, kind, exponent, the magnitude that is not shifted.
  constant REST   : positive := 4 + RANGE_BITS + WIDTH;

  subtype exponent_t is signed(RANGE_BITS-1 downto 0);
  subtype magnitude_t is unsigned(WIDTH-1 downto 0);

  signal read_valid_r    : std_logic;
  signal a_sign_r        : std_logic;
  signal b_sign_r        : std_logic;
  signal kind_r          : kind_t;
  signal a_exponent_r    : exponent_t;
  signal b_exponent_r    : exponent_t;
  signal a_magnitude_r   : magnitude_t;
  signal b_magnitude_r   : magnitude_t;
  signal a_above_r       : exponent_t;
  signal b_above_r       : exponent_t;

  signal order_valid_r   : std_logic;
  signal small_r         : magnitude_t;
  signal distance_r      : unsigned(LEVELS-1 downto 0);
  signal rest_r          : std_logic_vector(REST-1 downto 0);

  signal aligned_valid   : std_logic;
  signal aligned         : magnitude_t;
  signal aligned_rest    : std_logic_vector(REST-1 downto 0);

  signal added_valid_r   : std_logic;
  signal added_rest_r    : std_logic_vector(REST-WIDTH-1 downto 0);
  signal subtracts_r     : std_logic;
  -- The sum or the difference, and the difference in the other order.
  signal forward_r       : unsigned(WIDTH downto 0);
  signal backward_r      : unsigned(WIDTH downto 0);

  signal sum_valid_r     : std_logic;
  signal sum_sign_r      : std_logic;
  signal sum_kind_r      : kind_t;
  signal sum_exponent_r  : exponent_t;
  signal sum_magnitude_r : unsigned(WIDTH downto 0);

begin

  out_valid     <= sum_valid_r;
  out_sign      <= sum_sign_r;
  out_kind      <= sum_kind_r;
  out_exponent  <= sum_exponent_r;
  out_magnitude <= sum_magnitude_r;

  -- An infinite number gives both numbers its sign, so that nothing is subtracted.
  compare : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        read_valid_r  <= in_valid;
        a_sign_r      <= a_sign;
        b_sign_r      <= b_sign;
        kind_r        <= FINITE;
        a_exponent_r  <= a_exponent;
        b_exponent_r  <= b_exponent;
        a_magnitude_r <= a_magnitude;
        b_magnitude_r <= b_magnitude;
        a_above_r     <= a_exponent - b_exponent;
        b_above_r     <= b_exponent - a_exponent;
        if a_kind = UNDEFINED or b_kind = UNDEFINED then
          kind_r <= UNDEFINED;
        elsif a_kind = INFINITE then
          kind_r   <= INFINITE;
          b_sign_r <= a_sign;
          if b_kind = INFINITE and a_sign /= b_sign then
            kind_r <= UNDEFINED;
          end if;
        elsif b_kind = INFINITE then
          kind_r   <= INFINITE;
          a_sign_r <= b_sign;
        end if;
      end if;
      if rst_n = '0' then
        read_valid_r <= '0';
      end if;
    end if;
  end process compare;

  order : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        order_valid_r <= read_valid_r;
        if a_above_r < 0 then
          small_r    <= a_magnitude_r;
          distance_r <= limited(b_above_r, LEVELS);
          rest_r     <= b_sign_r & a_sign_r & kind_r & std_logic_vector(b_exponent_r) & std_logic_vector(b_magnitude_r);
        else
          small_r    <= b_magnitude_r;
          distance_r <= limited(a_above_r, LEVELS);
          rest_r     <= a_sign_r & b_sign_r & kind_r & std_logic_vector(a_exponent_r) & std_logic_vector(a_magnitude_r);
        end if;
      end if;
      if rst_n = '0' then
        order_valid_r <= '0';
      end if;
    end if;
  end process order;

  u_align : entity firm.firm_float_shift_right
    generic map (
      WIDTH  => WIDTH,
      LEVELS => LEVELS,
      REST   => REST
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      advance       => advance,
      in_valid      => order_valid_r,
      in_magnitude  => small_r,
      in_distance   => distance_r,
      in_rest       => rest_r,
      out_valid     => aligned_valid,
      out_magnitude => aligned,
      out_rest      => aligned_rest
    );

  add : process (clk)
    variable big : unsigned(WIDTH downto 0);
  begin
    if rising_edge(clk) then
      if advance = '1' then
        big           := unsigned('0' & aligned_rest(WIDTH-1 downto 0));
        added_valid_r <= aligned_valid;
        added_rest_r  <= aligned_rest(REST-1 downto WIDTH);
        subtracts_r   <= aligned_rest(REST-1) xor aligned_rest(REST-2);
        backward_r    <= aligned - big;
        if aligned_rest(REST-1) = aligned_rest(REST-2) then
          forward_r <= big + aligned;
        else
          forward_r <= big - aligned;
        end if;
      end if;
      if rst_n = '0' then
        added_valid_r <= '0';
      end if;
    end if;
  end process add;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        sum_valid_r     <= added_valid_r;
        sum_sign_r      <= added_rest_r(RANGE_BITS+3);
        sum_kind_r      <= added_rest_r(RANGE_BITS+1 downto RANGE_BITS);
        sum_exponent_r  <= signed(added_rest_r(RANGE_BITS-1 downto 0)) + 1;
        sum_magnitude_r <= forward_r;
        if subtracts_r = '1' then
          if forward_r(WIDTH) = '1' then
            sum_sign_r      <= added_rest_r(RANGE_BITS+2);
            sum_magnitude_r <= backward_r;
          elsif backward_r(WIDTH) = '0' then
            -- Neither difference is negative: the sum is zero, and +0.
            sum_sign_r <= '0';
          end if;
        end if;
      end if;
      if rst_n = '0' then
        sum_valid_r <= '0';
      end if;
    end if;
  end process choose;

end architecture rtl;
