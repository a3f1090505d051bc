-- SPDX-License-Identifier: Apache-2.0
-- Computes the poses of seven joints from their angles, and the error of a given pose of the end effector.
--
-- One multiplier computes all products. CORDIC computes cosine and sine of a joint's angle while the previous joint is
-- processed. A turn by ALPHA, a multiple of a quarter turn, exchanges the columns y and z of a pose, with a sign, s:
--   x' = x cos + s z sin, y' = s z cos - x sin, z' = -s y, p' = p + A x - D s y       where ALPHA is s quarter turns
--   x' = x cos + y sin,   y' = y cos - x sin,   z' = z,    p' = p + A x + D z         where ALPHA is 0
-- These are six products per row, in six slots. While a row is processed, the four numbers of the previous row leave
-- as float64. After the hand, the eighth step, the multiplier squares the differences of the two poses.
--
-- If an angle is NaN, or of 16 rad and more, all poses from its joint on and the error are NaN. If an element of the
-- given pose is NaN, or of 4 and more, the error is NaN.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_cordic_table.all;

use work.panda_pkg.all;

entity arm_chain is
  port (
    clk       : in  std_logic;
    rst_n     : in  std_logic;

    -- float64, joint 0 and element 0 lowest; must be stable until in_ready, one cycle at the end.
    in_valid  : in  std_logic;
    in_ready  : out std_logic;
    in_angles : in  std_logic_vector(JOINTS*64-1 downto 0);
    in_pose   : in  std_logic_vector(16*64-1 downto 0);

    -- They are stable until out_ready.
    out_valid : out std_logic;
    out_ready : in  std_logic;
    out_poses : out std_logic_vector(JOINTS*16*64-1 downto 0);
    out_error : out std_logic_vector(63 downto 0)
  );
end entity arm_chain;

architecture rtl of arm_chain is

  -- Rotations of an angle: 2**-28 rad are left over.
  constant ITERATIONS : positive := FRACTION;
  -- Six products a row.
  constant LAST_SLOT  : natural  := 5;
  -- Three rows, and one in which the last one leaves.
  constant LAST_ROW   : natural  := 3;
  -- Cycles from the request of a number to its fixed-point form: one to choose it, three to convert it.
  constant CONVERSION : positive := 4;
  -- Sixteen elements through conversion, difference, product in two steps, and sum.
  constant LAST_TURN  : natural  := 15 + CONVERSION + 4;
  -- Cycles of firm_fixed_to_float64.
  constant TO_FLOAT   : positive := 5;
  -- Lower bits of a product that the sum of squares drops.
  constant SQUARE_CUT : positive := 8;
  -- Zeros after the last bit of a pose's number in firm_fixed_to_float64, whose format also has three more bits before
  -- the point, so that a mean of squares fits. The float64 of a pose therefore has only 43 bits that may be nonzero.
  constant ZEROS      : positive := 64 - FRACTION - 6;
  constant ENTRY      : positive := 43;
  -- The computed numbers of the poses: four per row, three rows per joint.
  constant ENTRIES    : positive := JOINTS*12;

  -- A fixed-point number of the input, up to 16, and a difference of two, up to 8.
  subtype wide_t is signed(FRACTION+4 downto 0);
  subtype operand_t is signed(FRACTION+3 downto 0);
  subtype product_t is signed(2*FRACTION+7 downto 0);
  -- An operand is multiplied by the lower bits of the other one, and by its remaining bits.
  constant LOWER : positive := 17;
  subtype partial_t is signed(FRACTION+4+LOWER downto 0);
  subtype column_index_t is natural range 0 to 2;
  type column_t is array (column_index_t) of number_t;
  type entries_t is array (natural range 0 to ENTRIES-1) of std_logic_vector(ENTRY-1 downto 0);
  type phase_t is (IDLE, FETCH, TURN, COMPARE, CONVERT, OFFER);

  constant ONE : integer := 2**FRACTION;

  -- An element of a column, smaller than a dynamic index.
  function row_of(column : column_t; row : natural) return number_t is
  begin
    if row = 0 then
      return column(0);
    elsif row = 1 then
      return column(1);
    end if;
    return column(2);
  end function row_of;

  -- Of a product with 2*FRACTION fraction bits, rounded to nearest.
  function rounded(product : product_t) return number_t is
    variable half : signed(1 downto 0);
  begin
    half := '0' & product(FRACTION-1);
    return product(2*FRACTION+2 downto FRACTION) + half;
  end function rounded;

  signal phase_r          : phase_t;
  signal step_r           : step_t;
  signal row_r            : natural range 0 to LAST_ROW;
  signal slot_r           : natural range 0 to LAST_SLOT;
  signal turn_r           : natural range 0 to LAST_TURN;
  -- A phase's last cycle.
  signal is_turned        : std_logic;

  -- The next angle on its way to the CORDIC unit.
  signal feed_r           : natural range 0 to STEPS;
  signal feed_busy_r      : std_logic;
  signal feed_start       : std_logic;
  signal ask              : std_logic;
  signal asked            : std_logic_vector(63 downto 0);
  signal ask_r            : std_logic;
  signal asked_r          : std_logic_vector(63 downto 0);
  signal fixed_valid      : std_logic;
  signal fixed            : std_logic_vector(FRACTION+4 downto 0);
  signal fixed_overflow   : std_logic;
  signal fixed_undefined  : std_logic;
  signal folded_valid_r   : std_logic;
  signal folded_r         : wide_t;
  signal folded_unfit_r   : std_logic;
  signal angle_valid_r    : std_logic;
  signal angle_r          : number_t;
  signal angle_unfit_r    : std_logic;
  -- Of the angle that the CORDIC unit works on.
  signal cordic_unfit_r   : std_logic;
  signal cordic_in_ready  : std_logic;
  signal cordic_out_valid : std_logic;
  signal cordic_out_ready : std_logic;
  signal cordic_cos       : std_logic_vector(FRACTION+1 downto 0);
  signal cordic_sin       : std_logic_vector(FRACTION+1 downto 0);
  -- Multiples of pi, and the hand's angle; signals, set bit by bit, as ghdl 2.0 translates a constant of more than 32
  -- bits to a string.
  signal pi               : wide_t;
  signal two_pi           : wide_t;
  signal three_pi         : wide_t;
  signal four_pi          : wide_t;
  signal hand             : wide_t;

  -- The pose, and cosine and sine of the step.
  signal x_r              : column_t;
  signal y_r              : column_t;
  signal z_r              : column_t;
  signal p_r              : column_t;
  signal cos_r            : number_t;
  signal sin_r            : number_t;
  -- This pose, or the given one, is invalid.
  signal unfit_r          : std_logic;
  signal given_unfit_r    : std_logic;

  -- The computed element, whose difference to the given one is squared.
  signal own_r            : number_t;
  -- Two operands and their product, each with the slot and row of the request.
  signal left_r           : operand_t;
  signal right_r          : operand_t;
  signal operands_valid_r : std_logic;
  signal operands_slot_r  : natural range 0 to LAST_SLOT;
  signal operands_row_r   : natural range 0 to LAST_ROW;
  signal low_r            : partial_t;
  signal high_r           : partial_t;
  signal partial_valid_r  : std_logic;
  signal partial_slot_r   : natural range 0 to LAST_SLOT;
  signal partial_row_r    : natural range 0 to LAST_ROW;
  signal product_r        : product_t;
  signal product_valid_r  : std_logic;
  signal product_slot_r   : natural range 0 to LAST_SLOT;
  signal product_row_r    : natural range 0 to LAST_ROW;
  signal rounded_r        : number_t;
  signal rounded_valid_r  : std_logic;
  signal rounded_slot_r   : natural range 0 to LAST_SLOT;
  signal rounded_row_r    : natural range 0 to LAST_ROW;
  -- The first of two products.
  signal part_r           : number_t;
  signal sum_r            : signed(63 downto 0);

  signal emit             : std_logic;
  signal emitted          : number_t;
  signal emit_r           : std_logic;
  signal emitted_r        : number_t;  -- zero if nothing leaves
  signal float_in_valid   : std_logic;
  signal float_in         : std_logic_vector(63 downto 0);
  signal float_valid      : std_logic;
  signal float            : std_logic_vector(63 downto 0);
  -- Whether a number in conversion to float64 is invalid.
  signal float_unfit_r    : std_logic_vector(TO_FLOAT-1 downto 0);

  -- In the order in which they leave: joint, row, column.
  signal entries_r        : entries_t;
  signal entry_r          : natural range 0 to ENTRIES;
  signal error_r          : std_logic_vector(63 downto 0);

begin

  in_ready  <= '1' when phase_r = CONVERT and float_valid = '1' else '0';
  out_valid <= '1' when phase_r = OFFER else '0';
  out_error <= error_r;

  is_turned <= '1' when phase_r = TURN and row_r = LAST_ROW and slot_r = LAST_SLOT else '0';

  control : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        phase_r <= IDLE;
      elsif phase_r = IDLE then
        if in_valid = '1' then
          phase_r <= FETCH;
        end if;
      elsif phase_r = FETCH then
        if cordic_out_valid = '1' then
          phase_r <= TURN;
        end if;
      elsif phase_r = TURN then
        if is_turned = '1' then
          phase_r <= FETCH;
          if step_r = STEPS-1 then
            phase_r <= COMPARE;
          end if;
        end if;
      elsif phase_r = COMPARE then
        if turn_r = LAST_TURN then
          phase_r <= CONVERT;
        end if;
      elsif phase_r = CONVERT then
        if float_valid = '1' then
          phase_r <= OFFER;
        end if;
      elsif out_ready = '1' then
        phase_r <= IDLE;
      end if;
    end if;
  end process control;

  count : process (clk)
  begin
    if rising_edge(clk) then
      if phase_r = IDLE then
        step_r <= 0;
      elsif is_turned = '1' and step_r /= STEPS-1 then
        step_r <= step_r + 1;
      end if;

      if phase_r /= TURN or slot_r = LAST_SLOT then
        slot_r <= 0;
      else
        slot_r <= slot_r + 1;
      end if;
      if phase_r /= TURN then
        row_r <= 0;
      elsif slot_r = LAST_SLOT and row_r /= LAST_ROW then
        row_r <= row_r + 1;
      end if;

      -- One more count in CONVERT, where it marks the sum as sent.
      if phase_r /= COMPARE and phase_r /= CONVERT then
        turn_r <= 0;
      elsif phase_r = COMPARE and turn_r /= LAST_TURN then
        turn_r <= turn_r + 1;
      else
        turn_r <= 0;
      end if;
    end if;
  end process count;

  -- Angles, and elements of the given pose --------------------------------------------------------------------------

  feed_start <= '1' when (phase_r = FETCH or phase_r = TURN) and feed_r /= STEPS and feed_busy_r = '0' else '0';
  ask        <= '1' when feed_start = '1' or (phase_r = COMPARE and turn_r <= 15) else '0';

  choose : process (in_angles, in_pose, phase_r, turn_r, feed_r)
  begin
    asked <= in_pose(63 downto 0);
    if phase_r = COMPARE then
      for k in 1 to 15 loop
        if turn_r = k then
          asked <= in_pose(64*k+63 downto 64*k);
        end if;
      end loop;
    else
      for k in 0 to JOINTS-1 loop
        if feed_r = k then
          asked <= in_angles(64*k+63 downto 64*k);
        end if;
      end loop;
    end if;
  end process choose;

  hold_asked : process (clk)
  begin
    if rising_edge(clk) then
      ask_r   <= ask and rst_n;
      asked_r <= asked;
    end if;
  end process hold_asked;

  u_fixed : entity firm.firm_float64_to_fixed
    generic map (
      WIDTH    => wide_t'length,
      FRACTION => FRACTION
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => ask_r,
      in_number     => asked_r,
      out_valid     => fixed_valid,
      out_number    => fixed,
      out_overflow  => fixed_overflow,
      out_undefined => fixed_undefined
    );

  multiples : block
    -- pi/4 with more fraction bits is a multiple of it with fewer.
    constant PI_BITS      : unsigned(FRACTION+1 downto 0) := arctangent(0, FRACTION+2);
    constant TWO_PI_BITS  : unsigned(FRACTION+2 downto 0) := arctangent(0, FRACTION+3);
    constant FOUR_PI_BITS : unsigned(FRACTION+3 downto 0) := arctangent(0, FRACTION+4);
    constant HAND_BITS    : wide_t                        := to_signed(HAND_ANGLE, wide_t'length);
  begin
    bits : for k in wide_t'range generate
      hand(k) <= HAND_BITS(k);
      one_time : if k <= FRACTION+1 generate
        pi(k) <= PI_BITS(k);
      end generate one_time;
      two_times : if k <= FRACTION+2 generate
        two_pi(k) <= TWO_PI_BITS(k);
      end generate two_times;
      four_times : if k <= FRACTION+3 generate
        four_pi(k) <= FOUR_PI_BITS(k);
      end generate four_times;
    end generate bits;
    pi(wide_t'left downto FRACTION+2)     <= (others => '0');
    two_pi(wide_t'left downto FRACTION+3) <= (others => '0');
    four_pi(wide_t'left)                  <= '0';
    three_pi                              <= two_pi + pi;
  end block multiples;

  -- First into -3 pi to 3 pi, then into -pi to pi.
  feed : process (clk)
    variable angle : wide_t;
  begin
    if rising_edge(clk) then
      folded_valid_r <= fixed_valid and feed_busy_r;
      if fixed_valid = '1' then
        folded_r       <= signed(fixed);
        folded_unfit_r <= fixed_overflow or fixed_undefined;
        if feed_r = STEPS-1 then
          folded_r       <= hand;
          folded_unfit_r <= '0';
        elsif signed(fixed) > three_pi then
          folded_r <= signed(fixed) - four_pi;
        elsif signed(fixed) < -three_pi then
          folded_r <= signed(fixed) + four_pi;
        end if;
      end if;

      if folded_valid_r = '1' then
        angle := folded_r;
        if folded_r > pi then
          angle := folded_r - two_pi;
        elsif folded_r < -pi then
          angle := folded_r + two_pi;
        end if;
        angle_r       <= resize(angle, number_t'length);
        angle_unfit_r <= folded_unfit_r;
        angle_valid_r <= '1';
      end if;

      if feed_start = '1' then
        feed_busy_r <= '1';
      end if;
      if angle_valid_r = '1' and cordic_in_ready = '1' then
        angle_valid_r  <= '0';
        cordic_unfit_r <= angle_unfit_r;
        feed_busy_r    <= '0';
        feed_r         <= feed_r + 1;
      end if;
      if phase_r = IDLE then
        feed_r <= 0;
      end if;
      if rst_n = '0' then
        folded_valid_r <= '0';
        angle_valid_r  <= '0';
        feed_busy_r    <= '0';
      end if;
    end if;
  end process feed;

  cordic_out_ready <= '1' when phase_r = FETCH else '0';

  u_sincos : entity firm.firm_cordic_sincos
    generic map (
      FRACTION   => FRACTION,
      ITERATIONS => ITERATIONS
    )
    port map (
      clk       => clk,
      rst_n     => rst_n,
      in_valid  => angle_valid_r,
      in_ready  => cordic_in_ready,
      in_angle  => std_logic_vector(angle_r),
      out_valid => cordic_out_valid,
      out_ready => cordic_out_ready,
      out_cos   => cordic_cos,
      out_sin   => cordic_sin
    );

  -- Products --------------------------------------------------------------------------------------------------------

  -- The element that was requested CONVERSION cycles ago, in the next cycle.
  hold_own : process (clk)
    variable element : natural range 0 to 15;
  begin
    if rising_edge(clk) then
      element := (turn_r + 16 + 1 - CONVERSION) mod 16;
      own_r   <= (others => '0');
      if element mod 4 /= 3 then
        if element / 4 = 0 then
          own_r <= row_of(x_r, element mod 4);
        elsif element / 4 = 1 then
          own_r <= row_of(y_r, element mod 4);
        elsif element / 4 = 2 then
          own_r <= row_of(z_r, element mod 4);
        else
          own_r <= row_of(p_r, element mod 4);
        end if;
      elsif element = 15 then
        own_r <= to_signed(ONE, number_t'length);
      end if;
    end if;
  end process hold_own;

  operands : process (clk)
    variable x     : number_t;
    variable y     : number_t;
    variable z     : number_t;
    variable along : number_t;
  begin
    if rising_edge(clk) then
      x := row_of(x_r, row_r);
      y := row_of(y_r, row_r);
      z := row_of(z_r, row_r);
      -- The column that the step turns with x, and the one along which it moves, without their signs.
      along := z;
      if TURNS(step_r) /= 0 then
        along := y;
        y     := z;
      end if;

      operands_slot_r <= slot_r;
      operands_row_r  <= row_r;
      left_r          <= resize(x, operand_t'length);
      right_r         <= resize(cos_r, operand_t'length);
      if slot_r = 0 then
        right_r <= to_signed(A(step_r), operand_t'length);
      elsif slot_r = 2 then
        left_r  <= resize(y, operand_t'length);
        right_r <= resize(sin_r, operand_t'length);
      elsif slot_r = 3 then
        right_r <= resize(sin_r, operand_t'length);
      elsif slot_r = 4 then
        left_r <= resize(y, operand_t'length);
      elsif slot_r = 5 then
        left_r  <= resize(along, operand_t'length);
        right_r <= to_signed(D(step_r), operand_t'length);
      end if;

      operands_valid_r <= '0';
      if phase_r = TURN and row_r /= LAST_ROW then
        operands_valid_r <= '1';
      elsif phase_r = COMPARE and fixed_valid = '1' then
        -- The difference to be squared.
        left_r           <= resize(own_r, operand_t'length) - signed(fixed(FRACTION+3 downto 0));
        right_r          <= resize(own_r, operand_t'length) - signed(fixed(FRACTION+3 downto 0));
        operands_valid_r <= '1';
      end if;

      if rst_n = '0' then
        operands_valid_r <= '0';
      end if;
    end if;
  end process operands;

  multiply : process (clk)
  begin
    if rising_edge(clk) then
      low_r           <= left_r * signed('0' & right_r(LOWER-1 downto 0));
      high_r          <= left_r * resize(right_r(operand_t'left downto LOWER), LOWER+1);
      partial_valid_r <= operands_valid_r;
      partial_slot_r  <= operands_slot_r;
      partial_row_r   <= operands_row_r;

      product_r       <= (resize(high_r, product_t'length-LOWER) & to_signed(0, LOWER)) + low_r;
      product_valid_r <= partial_valid_r;
      product_slot_r  <= partial_slot_r;
      product_row_r   <= partial_row_r;

      rounded_r       <= rounded(product_r);
      rounded_valid_r <= product_valid_r;
      rounded_slot_r  <= product_slot_r;
      rounded_row_r   <= product_row_r;
      if rst_n = '0' then
        partial_valid_r <= '0';
        product_valid_r <= '0';
        rounded_valid_r <= '0';
      end if;
    end if;
  end process multiply;

  results : process (clk)
    variable y : number_t;
  begin
    if rising_edge(clk) then
      if phase_r = IDLE then
        for k in column_index_t loop
          x_r(k) <= (others => '0');
          y_r(k) <= (others => '0');
          z_r(k) <= (others => '0');
          p_r(k) <= (others => '0');
        end loop;
        x_r(0) <= to_signed(ONE, number_t'length);
        y_r(1) <= to_signed(ONE, number_t'length);
        z_r(2) <= to_signed(ONE, number_t'length);
      elsif rounded_valid_r = '1' and phase_r = TURN then
        for k in column_index_t loop
          if rounded_row_r = k then
            if rounded_slot_r = 0 then
              p_r(k) <= p_r(k) + rounded_r;
            elsif rounded_slot_r = 2 then
              x_r(k) <= part_r + rounded_r;
              if TURNS(step_r) < 0 then
                x_r(k) <= part_r - rounded_r;
              end if;
            elsif rounded_slot_r = 4 then
              y := rounded_r;
              if TURNS(step_r) < 0 then
                y := -rounded_r;
              end if;
              y_r(k) <= y - part_r;
              if TURNS(step_r) > 0 then
                z_r(k) <= -y_r(k);
              elsif TURNS(step_r) < 0 then
                z_r(k) <= y_r(k);
              end if;
            elsif rounded_slot_r = 5 then
              p_r(k) <= p_r(k) + rounded_r;
              if TURNS(step_r) > 0 then
                p_r(k) <= p_r(k) - rounded_r;
              end if;
            end if;
          end if;
        end loop;
        if rounded_slot_r = 1 or rounded_slot_r = 3 then
          part_r <= rounded_r;
        end if;
      end if;

      if phase_r = FETCH then
        cos_r <= resize(signed(cordic_cos), number_t'length);
        sin_r <= resize(signed(cordic_sin), number_t'length);
      end if;
    end if;
  end process results;

  sum : process (clk)
  begin
    if rising_edge(clk) then
      if phase_r = TURN then
        sum_r <= (others => '0');
      elsif phase_r = COMPARE and product_valid_r = '1' then
        sum_r <= sum_r + product_r(product_t'left downto SQUARE_CUT);
      end if;
    end if;
  end process sum;

  -- The fault of an angle affects all joints after it.
  faults : process (clk)
  begin
    if rising_edge(clk) then
      if phase_r = IDLE then
        unfit_r       <= '0';
        given_unfit_r <= '0';
      elsif phase_r = FETCH and cordic_out_valid = '1' then
        unfit_r <= unfit_r or cordic_unfit_r;
      elsif phase_r = COMPARE and fixed_valid = '1' then
        if fixed_overflow = '1' or fixed_undefined = '1' or fixed(FRACTION+4) /= fixed(FRACTION+3)
          or fixed(FRACTION+3) /= fixed(FRACTION+2) then
          given_unfit_r <= '1';
        end if;
      end if;
    end if;
  end process faults;

  -- To float64 ------------------------------------------------------------------------------------------------------

  -- A row leaves while the next one is processed; each result is ready before its slot.
  emit <= '1' when phase_r = TURN and row_r /= 0 and slot_r >= 2 and step_r /= STEPS-1 else '0';

  select_number : process (x_r, y_r, z_r, p_r, row_r, slot_r)
    variable row : natural range 0 to LAST_ROW;
  begin
    row := (row_r + LAST_ROW) mod (LAST_ROW + 1);
    if slot_r = 2 then
      emitted <= row_of(x_r, row);
    elsif slot_r = 3 then
      emitted <= row_of(y_r, row);
    elsif slot_r = 4 then
      emitted <= row_of(z_r, row);
    else
      emitted <= row_of(p_r, row);
    end if;
  end process select_number;

  hold_number : process (clk)
  begin
    if rising_edge(clk) then
      emit_r    <= emit and rst_n;
      emitted_r <= (others => '0');
      if emit = '1' then
        emitted_r <= emitted;
      end if;
    end if;
  end process hold_number;

  float_in_valid <= '1' when emit_r = '1' or (phase_r = COMPARE and turn_r = LAST_TURN) else '0';

  -- The mean is a sixteenth of the sum. Of the sum and a number that leaves, one is zero.
  gather : process (emitted_r, sum_r)
    variable number : std_logic_vector(63 downto 0);
    variable mean   : std_logic_vector(63 downto 0);
  begin
    number                  := (others => '0');
    number(63 downto ZEROS) := std_logic_vector(resize(emitted_r, 64-ZEROS));
    mean                    := (others => '0');
    mean(63 downto 4)       := std_logic_vector(sum_r(59 downto 0));
    float_in                <= number or mean;
  end process gather;

  u_float : entity firm.firm_fixed_to_float64
    generic map (
      FRACTION => FRACTION + ZEROS
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_valid   => float_in_valid,
      in_number  => float_in,
      out_valid  => float_valid,
      out_number => float
    );

  -- Not a shift register, which would be smaller, as each of its steps would keep a simulator busy with 7,000 bits.
  outputs : process (clk)
    variable number : std_logic_vector(63 downto 0);
  begin
    if rising_edge(clk) then
      float_unfit_r <= float_unfit_r(TO_FLOAT-2 downto 0) & unfit_r;
      if phase_r = COMPARE then
        float_unfit_r(0) <= unfit_r or given_unfit_r;
      end if;
      if float_valid = '1' then
        number := float;
        if float_unfit_r(TO_FLOAT-1) = '1' then
          -- The quiet NaN.
          number               := (others => '0');
          number(62 downto 51) := (others => '1');
        end if;
        if phase_r = CONVERT then
          error_r <= number;
        else
          entry_r <= entry_r + 1;
          for k in entries_r'range loop
            if entry_r = k then
              entries_r(k) <= number(63 downto 64-ENTRY);
            end if;
          end loop;
        end if;
      end if;
      if phase_r = IDLE then
        entry_r <= 0;
      end if;
    end if;
  end process outputs;

  poses : for joint in 0 to JOINTS-1 generate
    columns : for column in 0 to 3 generate
      rows : for row in 0 to 2 generate
        out_poses(64*(16*joint+4*column+row)+63 downto 64*(16*joint+4*column+row))
          <= entries_r(12*joint+4*row+column) & (63-ENTRY downto 0 => '0');
      end generate rows;
    end generate columns;
    no_translation : for column in 0 to 2 generate
      out_poses(64*(16*joint+4*column+3)+63 downto 64*(16*joint+4*column+3)) <= (others => '0');
    end generate no_translation;
    -- 1.0
    out_poses(64*(16*joint+15)+63 downto 64*(16*joint+15)+62) <= "00";
    out_poses(64*(16*joint+15)+61 downto 64*(16*joint+15)+52) <= (others => '1');
    out_poses(64*(16*joint+15)+51 downto 64*(16*joint+15))    <= (others => '0');
  end generate poses;

end architecture rtl;
