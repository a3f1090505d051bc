-- SPDX-License-Identifier: Apache-2.0
-- Angle and length of the vector (x, y): CORDIC in vectoring mode, one rotation a cycle, no multiplier.
--
-- The vector is folded into the quadrant x >= 0, y >= 0, so that mirrored vectors give exactly the same length and
-- mirrored angles. It is then turned towards the x axis by atan(2**-i), i = 0, 1, ...
-- `scaled_r` holds y * 2**i: it needs no shifter and loses no bit, so small vectors keep their accuracy. x grows by
-- y * 2**-i, which is `scaled_r` shifted by 2*i places: by a multiple of 16 on the way into `aligned_r`, and by the
-- remaining places after it.
-- As soon as y is 0, the angle is exact and no longer changes: multiples of pi/4 have no error, and
-- (0, 0) has the angle 0. Otherwise the error is at most 2**-(ITERATIONS-1) rad.
-- A vector takes ITERATIONS cycles, one to load and one to fold; the next one is loaded while the result is taken.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_cordic_table.all;

entity firm_cordic_vectoring is
  generic (
    -- Bits of x, y and the length, two's complement. 1.6468 * sqrt(x**2 + y**2) < 2**(WIDTH-1) must hold.
    WIDTH      : positive := 64;
    -- Fraction bits of the angle: 8 to 64. The angle has 3 bits more, sign and integer part up to pi.
    FRACTION   : positive := 60;
    -- Rotations: 2 to FRACTION.
    ITERATIONS : positive := 35
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;

    in_valid      : in  std_logic;
    in_ready      : out std_logic;
    in_x          : in  std_logic_vector(WIDTH-1 downto 0);
    in_y          : in  std_logic_vector(WIDTH-1 downto 0);

    out_valid     : out std_logic;
    out_ready     : in  std_logic;
    -- The length times the product of sqrt(1 + 4**-i) over all rotations (1.6468); never negative.
    out_magnitude : out std_logic_vector(WIDTH-1 downto 0);
    -- atan2(y, x) in rad, from -pi to pi, two's complement.
    out_angle     : out std_logic_vector(FRACTION+2 downto 0)
  );
end entity firm_cordic_vectoring;

architecture rtl of firm_cordic_vectoring is

  -- The table has 64 rotations, and an angle of 64 fraction bits cannot use more.
  constant COUNT_WIDTH  : positive := 6;
  -- The number of rotations with a common coarse shift, of 2*FINE_STEPS places each, and the number of such shifts.
  constant FINE_WIDTH   : positive := 3;
  constant FINE_STEPS   : positive := 2**FINE_WIDTH;
  constant LAST_COARSE  : natural  := (ITERATIONS-1) / FINE_STEPS;

  subtype magnitude_t is signed(WIDTH-1 downto 0);
  -- After rotation i, y <= x * 2**-i: so y * 2**(i+1) needs one bit more than x.
  subtype scaled_t is signed(WIDTH downto 0);
  subtype count_t is unsigned(COUNT_WIDTH-1 downto 0);
  subtype angle_t is signed(FRACTION+2 downto 0);
  -- Descending, since an ascending index costs a subtraction in GHDL's netlist.
  type angles_t is array (natural range 2**COUNT_WIDTH-1 downto 0) of angle_t;

  function all_angles return angles_t is
    variable result : angles_t := (others => (others => '0'));
  begin
    for i in result'range loop
      -- Illegal generics must reach the asserts below, not fail a bound check here.
      if i < ITERATIONS and i <= FRACTION and FRACTION <= 64 then
        result(i) := signed("000" & arctangent(i, FRACTION));
      end if;
    end loop;
    return result;
  end function all_angles;

  -- Replaces numeric_std's abs, which ghdl 2.0 leaves unchanged when it translates to Verilog.
  function absolute(number : std_logic_vector) return magnitude_t is
  begin
    if number(number'left) = '1' then
      return -signed(number);
    end if;
    return signed(number);
  end function absolute;

  -- Moved by the coarse part of a rotation's shift. Place by place, as ghdl 2.0 translates a shift of a signed number
  -- to Verilog without its sign.
  function aligned(scaled : scaled_t; count : count_t) return scaled_t is
    variable result : scaled_t;
  begin
    result := scaled;
    for k in 1 to LAST_COARSE loop
      if count(COUNT_WIDTH-1 downto FINE_WIDTH) = k then
        result := (others => scaled(WIDTH));
        for place in 0 to WIDTH-2*FINE_STEPS*k loop
          result(place) := scaled(place + 2*FINE_STEPS*k);
        end loop;
      end if;
    end loop;
    return result;
  end function aligned;

  constant ANGLES : angles_t := all_angles;

  -- Multiples of the first angle, so that folding and rotating agree to the bit. Signals, set bit by bit:
  -- ghdl 2.0 translates a constant of more than 32 bits to a Verilog string.
  signal quarter_pi  : angle_t;
  signal pi          : angle_t;

  signal count_r      : count_t;
  signal turn_r       : count_t;    -- the angle of this rotation: the count, or one less for a vector on the y axis
  signal busy_r       : std_logic;
  signal folding_r    : std_logic;  -- the vector was loaded in the cycle before
  signal done_r       : std_logic;
  signal ready        : std_logic;

  signal magnitude_r  : magnitude_t;
  signal scaled_r     : scaled_t;
  signal aligned_r    : scaled_t;
  signal angle_r      : angle_t;
  -- The signs of x and y. If they differ, the folded vector is mirrored: its angle counts backwards.
  signal x_negative_r : std_logic;
  signal y_negative_r : std_logic;
  -- y has been 0, so the angle no longer changes.
  signal exact_r      : std_logic;
  -- The vector is on the y axis: in its first rotation, and in all others, in which `scaled_r` is the one's complement.
  signal on_axis_r    : std_logic;
  signal inverted_r   : std_logic;

begin

  assert FRACTION >= 8 and FRACTION <= 64
    report "firm_cordic_vectoring: FRACTION is " & integer'image(FRACTION) & ", legal: 8 to 64"
    severity failure;
  assert ITERATIONS >= 2 and ITERATIONS <= FRACTION
    report "firm_cordic_vectoring: ITERATIONS is " & integer'image(ITERATIONS) & ", legal: 2 to FRACTION ("
      & integer'image(FRACTION) & ")"
    severity failure;
  assert WIDTH >= 4
    report "firm_cordic_vectoring: WIDTH is " & integer'image(WIDTH) & ", legal: 4 or more"
    severity failure;

  multiples : for k in quarter_pi'range generate
    quarter_pi(k) <= ANGLES(0)(k);
  end generate multiples;
  pi <= shift_left(quarter_pi, 2);

  ready         <= not busy_r and (not done_r or out_ready);
  in_ready      <= ready;
  out_valid     <= done_r;
  out_magnitude <= std_logic_vector(magnitude_r);
  out_angle     <= std_logic_vector(angle_r);

  control : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        busy_r <= '0';
        done_r <= '0';
      elsif ready = '1' then
        busy_r    <= in_valid;
        folding_r <= in_valid;
        done_r    <= '0';
      elsif folding_r = '1' then
        folding_r <= '0';
      elsif busy_r = '1' and count_r = ITERATIONS-1 then
        busy_r <= '0';
        done_r <= '1';
      end if;
      -- A comparison of many bits, so its result is used a cycle later.
      on_axis_r <= '0';
      if folding_r = '1' and magnitude_r = 0 then
        on_axis_r <= '1';
      end if;
      -- Without `ready`, which arrives late: the table of angles comes after the count.
      if folding_r = '1' then
        count_r <= (others => '0');
        turn_r  <= (others => '0');
      elsif busy_r = '1' then
        count_r <= count_r + 1;
        if on_axis_r = '0' then
          turn_r <= turn_r + 1;
        end if;
      end if;
    end if;
  end process control;

  rotate : process (clk)
    variable below    : boolean;
    variable sum      : signed(WIDTH+1 downto 0);
    variable scaled   : scaled_t;
    variable step     : angle_t;
  begin
    if rising_edge(clk) then
      if ready = '1' and in_valid = '1' then
        x_negative_r <= in_x(WIDTH-1);
        y_negative_r <= in_y(WIDTH-1);
        exact_r      <= '0';
        inverted_r   <= '0';
        scaled_r     <= resize(absolute(in_y), WIDTH+1);
        angle_r      <= (others => '0');
      elsif folding_r = '1' then
        -- A separate cycle, since the input may arrive late and is compared with 0 here.
        aligned_r <= scaled_r;
        if x_negative_r = '1' then
          angle_r <= pi;
          if y_negative_r = '1' then
            angle_r <= -pi;
          end if;
        end if;
      elsif busy_r = '1' then
        -- A vector on the y axis turns by the first angle twice, which is exact. Its length is that of a vector on the
        -- x axis: the first rotation makes x of |y|, and -2 * |y| of y. The one's complement of that is 2 * |y| - 1; it
        -- turns like a y of the other sign, and gets a '1' from the right.
        below := scaled_r(WIDTH) = '1';
        sum   := (scaled_r & inverted_r) - (magnitude_r & on_axis_r);
        if below then
          sum := (scaled_r & inverted_r) + (magnitude_r & '0');
        end if;
        scaled    := sum(WIDTH downto 0);
        scaled_r  <= scaled;
        aligned_r <= aligned(scaled, count_r + 1);

        inverted_r <= inverted_r or on_axis_r;

        step := ANGLES(to_integer(turn_r));
        if scaled_r = 0 or inverted_r = '1' then
          exact_r <= '1';
        end if;
        if scaled_r /= 0 and exact_r = '0' then
          if below xor (x_negative_r /= y_negative_r) then
            angle_r <= angle_r - step;
          else
            angle_r <= angle_r + step;
          end if;
        end if;
      end if;
    end if;
  end process rotate;

  -- The length. Its sum comes last, and only registers decide when it is taken: one multiplexer is left after it.
  lengthen : process (clk)
    variable sign     : unsigned(WIDTH downto 0);
    variable distance : unsigned(WIDTH downto 0);
  begin
    if rising_edge(clk) then
      if busy_r = '1' and folding_r = '0' then
        -- |y| * 2**i reaches x as |y| * 2**-i. The one's complement approximates |y|: it is at most one unit short, and
        -- saves the carry.
        sign        := (others => scaled_r(WIDTH));
        distance    := shift_right(unsigned(aligned_r) xor sign, to_integer(count_r(FINE_WIDTH-1 downto 0) & '0'));
        magnitude_r <= magnitude_r + signed(distance(WIDTH-1 downto 0));
      elsif ready = '1' and in_valid = '1' then
        magnitude_r <= absolute(in_x);
      end if;
    end if;
  end process lengthen;

end architecture rtl;
