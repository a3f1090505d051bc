-- SPDX-License-Identifier: Apache-2.0
-- Converts an exponent and a magnitude to a floating-point number: rounded to nearest, ties to even.
--
-- The last stages of every operation. A result below the normal numbers is subnormal; beyond the largest number, it is
-- infinite. NaN is always the positive quiet one with no other bit.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_round is
  generic (
    EXPONENT_BITS : positive;
    MANTISSA_BITS : positive;
    -- Bits of the input's exponent, which is signed.
    RANGE_BITS    : positive;
    -- Bits of the input's magnitude.
    WIDTH         : positive;
    -- Leading zeros that the magnitude of a normal result may have.
    MAX_LEFT      : natural;
    -- The exponent may be below 1.
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
    in_exponent  : in  signed(RANGE_BITS-1 downto 0);
    in_magnitude : in  unsigned(WIDTH-1 downto 0);

    out_valid    : out std_logic;
    out_number   : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_round;

architecture rtl of firm_float_round is

  -- The mantissa with its leading bit, the bit that rounds it, and whether anything is below.
  constant FITTED_WIDTH : positive := MANTISSA_BITS + 3;
  constant LEFT_LEVELS  : positive := levels_for(MAX_LEFT);
  constant RIGHT_LEVELS : positive := levels_for(FITTED_WIDTH);
  constant REST         : positive := RANGE_BITS + 3;

  subtype fitted_t is unsigned(FITTED_WIDTH-1 downto 0);

  -- Between the shifts.
  signal moved_valid     : std_logic;
  signal moved_sign      : std_logic;
  signal moved_kind      : kind_t;
  signal moved_exponent  : signed(RANGE_BITS-1 downto 0);
  signal moved_magnitude : unsigned(WIDTH-1 downto 0);

  signal fit_valid_r     : std_logic;
  signal fit_magnitude_r : fitted_t;
  signal fit_distance_r  : unsigned(RIGHT_LEVELS-1 downto 0);
  signal fit_rest_r      : std_logic_vector(REST-1 downto 0);

  signal low_valid       : std_logic;
  signal low_magnitude   : fitted_t;
  signal low_rest        : std_logic_vector(REST-1 downto 0);

begin

  without_left : if MAX_LEFT = 0 generate
    moved_valid     <= in_valid;
    moved_sign      <= in_sign;
    moved_kind      <= in_kind;
    moved_exponent  <= in_exponent;
    moved_magnitude <= in_magnitude;
  end generate without_left;

  with_left : if MAX_LEFT > 0 generate
    signal valid_r     : std_logic;
    signal magnitude_r : unsigned(WIDTH-1 downto 0);
    signal limit_r     : unsigned(LEFT_LEVELS-1 downto 0);
    signal rest_r      : std_logic_vector(REST-1 downto 0);
    signal distance    : unsigned(LEFT_LEVELS-1 downto 0);
    signal moved_rest  : std_logic_vector(REST-1 downto 0);
  begin

    -- The exponent stays at 1 or more.
    limit : process (clk)
    begin
      if rising_edge(clk) then
        if advance = '1' then
          valid_r     <= in_valid;
          magnitude_r <= in_magnitude;
          limit_r     <= limited(in_exponent - 1, LEFT_LEVELS);
          rest_r      <= in_sign & in_kind & std_logic_vector(in_exponent);
        end if;
        if rst_n = '0' then
          valid_r <= '0';
        end if;
      end if;
    end process limit;

    u_left : entity firm.firm_float_shift_left
      generic map (
        WIDTH  => WIDTH,
        LEVELS => LEFT_LEVELS,
        REST   => REST
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        advance       => advance,
        in_valid      => valid_r,
        in_magnitude  => magnitude_r,
        in_limit      => limit_r,
        in_rest       => rest_r,
        out_valid     => moved_valid,
        out_magnitude => moved_magnitude,
        out_distance  => distance,
        out_rest      => moved_rest
      );

    moved_sign     <= moved_rest(REST-1);
    moved_kind     <= moved_rest(REST-2 downto REST-3);
    moved_exponent <= signed(moved_rest(RANGE_BITS-1 downto 0)) - signed(resize(distance, RANGE_BITS));
  end generate with_left;

  fit : process (clk)
    variable exponent : signed(RANGE_BITS-1 downto 0);
  begin
    if rising_edge(clk) then
      if advance = '1' then
        exponent := moved_exponent;
        if HAS_UNDERFLOW then
          fit_distance_r <= limited(to_signed(1, RANGE_BITS) - moved_exponent, RIGHT_LEVELS);
          if moved_exponent < 1 then
            exponent := to_signed(1, RANGE_BITS);
          end if;
        end if;
        fit_valid_r     <= moved_valid;
        fit_magnitude_r <= fitted(moved_magnitude, FITTED_WIDTH);
        fit_rest_r      <= moved_sign & moved_kind & std_logic_vector(exponent);
      end if;
      if rst_n = '0' then
        fit_valid_r <= '0';
      end if;
    end if;
  end process fit;

  without_right : if not HAS_UNDERFLOW generate
    low_valid     <= fit_valid_r;
    low_magnitude <= fit_magnitude_r;
    low_rest      <= fit_rest_r;
  end generate without_right;

  with_right : if HAS_UNDERFLOW generate
    u_right : entity firm.firm_float_shift_right
      generic map (
        WIDTH  => FITTED_WIDTH,
        LEVELS => RIGHT_LEVELS,
        REST   => REST
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        advance       => advance,
        in_valid      => fit_valid_r,
        in_magnitude  => fit_magnitude_r,
        in_distance   => fit_distance_r,
        in_rest       => fit_rest_r,
        out_valid     => low_valid,
        out_magnitude => low_magnitude,
        out_rest      => low_rest
      );
  end generate with_right;

  u_pack : entity firm.firm_float_pack
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      IS_SHORT      => false
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => low_valid,
      in_sign      => low_rest(REST-1),
      in_kind      => low_rest(REST-2 downto REST-3),
      in_exponent  => signed(low_rest(RANGE_BITS-1 downto 0)),
      in_magnitude => low_magnitude,
      out_valid    => out_valid,
      out_number   => out_number
    );

end architecture rtl;
