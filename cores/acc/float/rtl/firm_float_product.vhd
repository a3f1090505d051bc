-- SPDX-License-Identifier: Apache-2.0
-- Multiplies two floating-point numbers exactly; the product is not normalised.
--
-- The mantissas are multiplied in limbs of 18 bits, the size of the multipliers in FPGAs. The products of one limb do
-- not overlap if every second one is taken, so that one adder makes a row of them. The rows are added in turn. `rest`
-- accompanies the numbers.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_product is
  generic (
    EXPONENT_BITS : positive;
    MANTISSA_BITS : positive;
    -- Bits of the rest.
    REST          : positive;
    -- Subtracted from the exponent.
    LESS          : natural := 0;
    -- All rows are added at once.
    IS_SHORT      : boolean := false
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;
    -- All registers keep their values unless it is high.
    advance       : in  std_logic;

    in_valid      : in  std_logic;
    in_a          : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_b          : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_rest       : in  std_logic_vector(REST-1 downto 0);

    out_valid     : out std_logic;
    out_sign      : out std_logic;
    out_kind      : out std_logic_vector(1 downto 0);
    -- 1 less LESS if the product is zero.
    out_exponent  : out signed(EXPONENT_BITS+1 downto 0);
    out_magnitude : out unsigned(2*MANTISSA_BITS+1 downto 0);
    out_rest      : out std_logic_vector(REST-1 downto 0)
  );
end entity firm_float_product;

architecture rtl of firm_float_product is

  constant RANGE_BITS : positive := EXPONENT_BITS + 2;
  constant LIMB       : positive := 18;
  constant LIMBS      : positive := (MANTISSA_BITS + LIMB) / LIMB;

  -- Registers of the sums: one for each further row, or one for all.
  function sum_stages return natural is
  begin
    if IS_SHORT and LIMBS > 2 then
      return 1;
    end if;
    return LIMBS - 1;
  end function sum_stages;

  -- Decoding, products of limbs, rows; then those of the sums.
  constant STAGES     : positive := sum_stages + 3;
  constant SIDE       : positive := REST + RANGE_BITS + 3;

  subtype mantissa_t is unsigned(LIMBS*LIMB-1 downto 0);
  subtype product_t is unsigned(2*LIMB-1 downto 0);
  subtype row_t is unsigned((LIMBS+1)*LIMB-1 downto 0);
  subtype sum_t is unsigned(2*LIMBS*LIMB-1 downto 0);
  type products_t is array (natural range <>) of product_t;
  type rows_t is array (natural range <>) of row_t;
  type sums_t is array (natural range <>) of sum_t;
  type sides_t is array (natural range <>) of std_logic_vector(SIDE-1 downto 0);

  -- With a zero in front, since ghdl 2.0 omits the highest bit of a product in a VHDL netlist.
  function limb_of(mantissa : mantissa_t; index : natural) return unsigned is
  begin
    return '0' & mantissa(LIMB*index+LIMB-1 downto LIMB*index);
  end function limb_of;

  signal a_r        : mantissa_t;
  signal b_r        : mantissa_t;
  -- The product of limb i of b and limb j of a has the index i*LIMBS + j.
  signal products_r : products_t(LIMBS*LIMBS-1 downto 0);
  -- Row i at the first adder has the index i, one adder later LIMBS + i, and so on.
  signal rows_r     : rows_t(LIMBS*LIMBS-1 downto 0);
  -- Sum k includes the rows 0 to k.
  signal sums       : sums_t(LIMBS-1 downto 0);
  -- Row k, when it is added, in its place.
  signal placed     : sums_t(LIMBS-1 downto 1);
  signal valids_r   : std_logic_vector(STAGES-1 downto 0);
  signal sides_r    : sides_t(STAGES-1 downto 0);

begin

  out_valid     <= valids_r(STAGES-1);
  out_sign      <= sides_r(STAGES-1)(SIDE-1);
  out_kind      <= sides_r(STAGES-1)(SIDE-2 downto SIDE-3);
  out_exponent  <= signed(sides_r(STAGES-1)(SIDE-4 downto REST));
  out_rest      <= sides_r(STAGES-1)(REST-1 downto 0);
  out_magnitude <= sums(LIMBS-1)(2*MANTISSA_BITS+1 downto 0);

  read : process (clk)
    variable kind     : kind_t;
    variable exponent : signed(RANGE_BITS-1 downto 0);
    variable a_kind   : kind_t;
    variable b_kind   : kind_t;
  begin
    if rising_edge(clk) then
      if advance = '1' then
        a_r      <= resize(mantissa_of(in_a, EXPONENT_BITS), LIMBS*LIMB);
        b_r      <= resize(mantissa_of(in_b, EXPONENT_BITS), LIMBS*LIMB);
        a_kind   := kind_of(in_a, EXPONENT_BITS);
        b_kind   := kind_of(in_b, EXPONENT_BITS);
        kind     := FINITE;
        exponent := exponent_of(in_a, EXPONENT_BITS, RANGE_BITS) + exponent_of(in_b, EXPONENT_BITS, RANGE_BITS)
                    - (bias_of(EXPONENT_BITS) - 1 + LESS);
        if a_kind = UNDEFINED or b_kind = UNDEFINED then
          kind := UNDEFINED;
        elsif a_kind = INFINITE or b_kind = INFINITE then
          kind := INFINITE;
          if is_zero(in_a) or is_zero(in_b) then
            kind := UNDEFINED;
          end if;
        elsif is_zero(in_a) or is_zero(in_b) then
          exponent := to_signed(1 - LESS, RANGE_BITS);
        end if;
        valids_r   <= valids_r(STAGES-2 downto 0) & in_valid;
        sides_r(0) <= (in_a(in_a'left) xor in_b(in_b'left)) & kind & std_logic_vector(exponent) & in_rest;
        for k in 1 to STAGES-1 loop
          sides_r(k) <= sides_r(k-1);
        end loop;
      end if;
      if rst_n = '0' then
        valids_r <= (others => '0');
      end if;
    end if;
  end process read;

  multiply : process (clk)
    variable evens : row_t;
    variable odds  : row_t;
  begin
    if rising_edge(clk) then
      if advance = '1' then
        for i in 0 to LIMBS-1 loop
          for j in 0 to LIMBS-1 loop
            products_r(i*LIMBS+j) <= resize(limb_of(b_r, i) * limb_of(a_r, j), 2*LIMB);
          end loop;
        end loop;

        for i in 0 to LIMBS-1 loop
          evens := (others => '0');
          odds  := (others => '0');
          for j in 0 to LIMBS-1 loop
            if j mod 2 = 0 then
              evens(LIMB*(j+2)-1 downto LIMB*j) := products_r(i*LIMBS+j);
            else
              odds(LIMB*(j+2)-1 downto LIMB*j) := products_r(i*LIMBS+j);
            end if;
          end loop;
          rows_r(i) <= evens + odds;
        end loop;

        for k in 1 to LIMBS-1 loop
          for i in 0 to LIMBS-1 loop
            rows_r(k*LIMBS+i) <= rows_r((k-1)*LIMBS+i);
          end loop;
        end loop;
      end if;
    end if;
  end process multiply;

  sums(0) <= resize(rows_r(0), 2*LIMBS*LIMB);

  each_row : for k in 1 to LIMBS-1 generate

    in_turn : if not IS_SHORT or k = LIMBS-1 generate
      add : process (clk)
      begin
        if rising_edge(clk) then
          if advance = '1' then
            sums(k) <= sums(k-1) + placed(k);
          end if;
        end if;
      end process add;
    end generate in_turn;

    at_once : if IS_SHORT and k < LIMBS-1 generate
      sums(k) <= sums(k-1) + placed(k);
    end generate at_once;

    waiting : if not IS_SHORT generate
      placed(k) <= shift_left(resize(rows_r((k-1)*LIMBS+k), 2*LIMBS*LIMB), LIMB*k);
    end generate waiting;

    ready : if IS_SHORT generate
      placed(k) <= shift_left(resize(rows_r(k), 2*LIMBS*LIMB), LIMB*k);
    end generate ready;

  end generate each_row;

end architecture rtl;
