-- SPDX-License-Identifier: Apache-2.0
-- Sine and cosine of an angle: CORDIC in rotation mode, one rotation a cycle, no multiplier.
--
-- The unit vector is shortened by the factor by which the rotations lengthen it. It is turned by atan(2**-i), i = 0, 1,
-- ..., towards the angle. All rotations together reach 1.74, so angles of 13/8 and more, or below -13/8, are first
-- folded by half a turn, which negates the vector. A few bits determine the fold, since it follows in the same cycle.
-- All numbers have a few bits more than the result, so that truncation in every rotation leaves the result accurate to
-- about a unit. An angle takes ITERATIONS cycles and one to load; the next one is loaded while the result is taken.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_cordic_table.all;

entity firm_cordic_sincos is
  generic (
    -- Fraction bits of the angle and the results: 8 to 58.
    FRACTION   : positive := 29;
    -- Rotations: 2 to FRACTION.
    ITERATIONS : positive := 29
  );
  port (
    clk       : in  std_logic;
    rst_n     : in  std_logic;

    in_valid  : in  std_logic;
    in_ready  : out std_logic;
    -- In rad, from -4 to 4, two's complement.
    in_angle  : in  std_logic_vector(FRACTION+2 downto 0);

    out_valid : out std_logic;
    out_ready : in  std_logic;
    -- Two's complement, from -1 to 1, with an excess of at most about a unit.
    out_cos   : out std_logic_vector(FRACTION+1 downto 0);
    out_sin   : out std_logic_vector(FRACTION+1 downto 0)
  );
end entity firm_cordic_sincos;

architecture rtl of firm_cordic_sincos is

  -- 58 rotations at most.
  constant COUNT_WIDTH : positive := 6;
  -- The truncation errors of all rotations together stay below these bits.
  constant GUARD       : positive := 6;
  constant INNER       : positive := FRACTION + GUARD;

  -- Sign and one bit before the point: the vector's length is at most 1 plus rounding errors.
  subtype number_t is signed(INNER+1 downto 0);
  subtype angle_t is signed(INNER+2 downto 0);
  -- Descending, since an ascending index costs a subtraction in GHDL's netlist.
  type angles_t is array (natural range 2**COUNT_WIDTH-1 downto 0) of angle_t;

  function all_angles return angles_t is
    variable result : angles_t := (others => (others => '0'));
  begin
    for i in result'range loop
      -- Illegal generics must reach the asserts below, not fail a bound check here.
      if i < ITERATIONS and i <= FRACTION and INNER <= 64 then
        result(i) := signed("000" & arctangent(i, INNER));
      end if;
    end loop;
    return result;
  end function all_angles;

  -- Divided by 2**places, rounded down. Unsigned, because ghdl 2.0 translates a shift of a signed number to Verilog
  -- without its sign.
  function shifted(number : number_t; places : natural) return number_t is
    variable sign      : unsigned(number_t'range);
    variable magnitude : unsigned(number_t'range);
  begin
    sign      := (others => number(number'left));
    magnitude := shift_right(unsigned(number) xor sign, places);
    return signed(magnitude xor sign);
  end function shifted;

  -- Without the guard bits, rounded to nearest.
  function rounded(number : number_t) return std_logic_vector is
    variable half : unsigned(0 downto 0);
  begin
    half(0) := number(GUARD-1);
    return std_logic_vector(unsigned(number(number'left downto GUARD)) + half);
  end function rounded;

  constant ANGLES      : angles_t := all_angles;
  constant LENGTH      : unsigned(INNER-1 downto 0) := inverse_gain(INNER);
  constant FOLDED_FROM : positive := 13;  -- eighths

  -- Signals, set bit by bit: ghdl 2.0 translates a constant of more than 32 bits to a Verilog string.
  signal quarter_pi : angle_t;
  signal pi         : angle_t;
  signal eighths    : signed(5 downto 0);  -- of the arriving angle, rounded down
  signal start      : number_t;

  signal count_r    : unsigned(COUNT_WIDTH-1 downto 0);
  signal busy_r     : std_logic;
  signal done_r     : std_logic;
  signal ready      : std_logic;

  signal cos_r      : number_t;
  signal sin_r      : number_t;
  -- The remaining angle.
  signal angle_r    : angle_t;

begin

  assert FRACTION >= 8 and FRACTION <= 58
    report "firm_cordic_sincos: FRACTION is " & integer'image(FRACTION) & ", legal: 8 to 58"
    severity failure;
  assert ITERATIONS >= 2 and ITERATIONS <= FRACTION
    report "firm_cordic_sincos: ITERATIONS is " & integer'image(ITERATIONS) & ", legal: 2 to FRACTION ("
      & integer'image(FRACTION) & ")"
    severity failure;

  multiples : for k in quarter_pi'range generate
    quarter_pi(k) <= ANGLES(0)(k);
  end generate multiples;
  pi      <= shift_left(quarter_pi, 2);
  eighths <= signed(in_angle(FRACTION+2 downto FRACTION-3));

  lengths : for k in LENGTH'range generate
    start(k) <= LENGTH(k);
  end generate lengths;
  start(number_t'left downto INNER) <= (others => '0');

  ready     <= not busy_r and (not done_r or out_ready);
  in_ready  <= ready;
  out_valid <= done_r;
  out_cos   <= rounded(cos_r);
  out_sin   <= rounded(sin_r);

  control : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        busy_r <= '0';
        done_r <= '0';
      elsif ready = '1' then
        busy_r <= in_valid;
        done_r <= '0';
      elsif busy_r = '1' and count_r = ITERATIONS-1 then
        busy_r <= '0';
        done_r <= '1';
      end if;
    end if;
  end process control;

  -- Without `ready`, which would be on the path to the table of angles: Yosys moves the table's address across it.
  count : process (clk)
  begin
    if rising_edge(clk) then
      count_r <= (others => '0');
      if busy_r = '1' then
        count_r <= count_r + 1;
      end if;
    end if;
  end process count;

  rotate : process (clk)
    variable angle : angle_t;
    variable step  : angle_t;
  begin
    if rising_edge(clk) then
      if ready = '1' and in_valid = '1' then
        angle   := signed(in_angle) & to_signed(0, GUARD);
        cos_r   <= start;
        sin_r   <= (others => '0');
        angle_r <= angle;
        if eighths >= FOLDED_FROM then
          cos_r   <= -start;
          angle_r <= angle - pi;
        elsif eighths < -FOLDED_FROM then
          cos_r   <= -start;
          angle_r <= angle + pi;
        end if;
      elsif busy_r = '1' then
        step := ANGLES(to_integer(count_r));
        if angle_r(angle_r'left) = '1' then
          cos_r   <= cos_r + shifted(sin_r, to_integer(count_r));
          sin_r   <= sin_r - shifted(cos_r, to_integer(count_r));
          angle_r <= angle_r + step;
        else
          cos_r   <= cos_r - shifted(sin_r, to_integer(count_r));
          sin_r   <= sin_r + shifted(cos_r, to_integer(count_r));
          angle_r <= angle_r - step;
        end if;
      end if;
    end if;
  end process rotate;

end architecture rtl;
