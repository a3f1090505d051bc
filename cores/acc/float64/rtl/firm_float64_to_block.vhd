-- SPDX-License-Identifier: Apache-2.0
-- Converts COUNT float64 numbers to two's complement with one common exponent (block floating point).
--
-- The numbers are in a ring. It first turns past one comparator, which finds the largest exponent, and then past one
-- shifter, which aligns each number to it: 2*COUNT + 2 cycles from input to output. The comparator begins with the
-- first number as it arrives, so that the ring need not turn past it, and the shift of a number is known a cycle
-- earlier. The largest number is exact; the others are rounded to the nearest unit, ties away from zero.
-- In a block with a normal number, denormal numbers are aligned and rounded like the others.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_float64_to_block is
  generic (
    COUNT    : positive := 4;
    -- Fraction bits of a result: 53 to 62. All results are between -1 and 1, the largest is 1/2 or more.
    FRACTION : positive := 60
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;

    in_valid      : in  std_logic;
    in_ready      : out std_logic;
    -- Number 0 is in the lowest bits.
    in_numbers    : in  std_logic_vector(64*COUNT-1 downto 0);

    out_valid     : out std_logic;
    out_ready     : in  std_logic;
    -- The input value is number k times 2**(out_exponent - 1022).
    out_numbers   : out std_logic_vector((FRACTION+1)*COUNT-1 downto 0);
    out_exponent  : out std_logic_vector(10 downto 0);
    -- A number is infinite or NaN: the results are meaningless.
    out_undefined : out std_logic;
    -- All numbers taken are zero or denormal: all results are zero.
    out_zero      : out std_logic
  );
end entity firm_float64_to_block;

architecture rtl of firm_float64_to_block is

  constant MANTISSA_WIDTH : positive := 53;
  constant SHIFT_WIDTH    : positive := 6;
  -- The slot of a ring holds a float64 number first and its result later.
  constant SLOT_WIDTH     : positive := 64;

  subtype slot_t is std_logic_vector(SLOT_WIDTH-1 downto 0);
  type ring_t is array (natural range 0 to COUNT-1) of slot_t;
  -- A result's magnitude and, below it, the bit that rounds it.
  subtype shifted_t is unsigned(FRACTION downto 0);
  subtype exponent_t is unsigned(10 downto 0);
  type step_t is (IDLE, SEARCH, MEASURE, ALIGN, DRAIN, OFFER);

  -- The number that the ring shows next.
  constant SECOND : natural := 1 mod COUNT;

  function exponent_of(number : slot_t) return unsigned is
  begin
    return unsigned(number(62 downto 52));
  end function exponent_of;

  signal step_r      : step_t;
  signal position_r  : natural range 0 to COUNT-1;
  signal ring_r      : ring_t     := (others => (others => '0'));
  signal largest_r   : exponent_t := (others => '0');
  signal undefined_r : std_logic;
  signal zero_r      : std_logic;
  -- The shift of the number in the ring's first slot in places, and whether it shifts out all bits.
  signal distance_r  : unsigned(SHIFT_WIDTH-1 downto 0);
  signal vanishes_r  : std_logic;
  -- The number between shifting and rounding.
  signal shifted_r   : shifted_t := (others => '0');
  signal negative_r  : std_logic := '0';

begin

  assert FRACTION >= MANTISSA_WIDTH and FRACTION <= 62
    report "firm_float64_to_block: FRACTION is " & integer'image(FRACTION) & ", legal: 53 to 62"
    severity failure;

  in_ready      <= '1' when step_r = IDLE else '0';
  out_valid     <= '1' when step_r = OFFER else '0';
  out_exponent  <= std_logic_vector(largest_r);
  out_undefined <= undefined_r;
  out_zero      <= zero_r;

  numbers : for k in 0 to COUNT-1 generate
    out_numbers((k+1)*(FRACTION+1)-1 downto k*(FRACTION+1)) <= ring_r(k)(FRACTION downto 0);
  end generate numbers;

  control : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        step_r <= IDLE;
      elsif step_r = IDLE then
        position_r <= SECOND;
        if in_valid = '1' then
          step_r <= SEARCH;
          if COUNT = 1 then
            step_r <= MEASURE;
          end if;
        end if;
      elsif step_r = MEASURE then
        step_r <= ALIGN;
      elsif step_r = DRAIN then
        step_r <= OFFER;
      elsif step_r = OFFER then
        if out_ready = '1' then
          step_r <= IDLE;
        end if;
      elsif position_r = COUNT-1 then
        position_r <= 0;
        if step_r = SEARCH then
          step_r <= MEASURE;
        else
          step_r <= DRAIN;
        end if;
      else
        position_r <= position_r + 1;
      end if;
    end if;
  end process control;

  find : process (clk)
    variable exponent : exponent_t;
  begin
    if rising_edge(clk) then
      if step_r = IDLE and in_valid = '1' then
        exponent    := exponent_of(in_numbers(63 downto 0));
        largest_r   <= exponent;
        undefined_r <= '0';
        zero_r      <= '0';
        if exponent = 0 then
          zero_r <= '1';
        elsif exponent = 2047 then
          undefined_r <= '1';
        end if;
      elsif step_r = SEARCH then
        exponent := exponent_of(ring_r(0));
        if exponent > largest_r then
          largest_r <= exponent;
          zero_r    <= '0';
        end if;
        if exponent = 2047 then
          undefined_r <= '1';
        end if;
      end if;
    end if;
  end process find;

  -- The first number is measured at rest; each other one as it enters the first slot.
  gauge : process (clk)
    variable exponent : exponent_t;
    variable distance : exponent_t;
  begin
    if rising_edge(clk) then
      exponent := exponent_of(ring_r(SECOND));
      if step_r = MEASURE then
        exponent := exponent_of(ring_r(0));
      end if;
      distance := largest_r - exponent;
      -- A denormal number has the exponent 1.
      if exponent = 0 then
        distance := largest_r - 1;
      end if;
      distance_r <= distance(SHIFT_WIDTH-1 downto 0);
      vanishes_r <= '0';
      if distance >= 2**SHIFT_WIDTH then
        vanishes_r <= '1';
      end if;
    end if;
  end process gauge;

  shift : process (clk)
    variable mantissa : shifted_t;
  begin
    if rising_edge(clk) then
      if step_r = ALIGN then
        mantissa := (others => '0');
        mantissa(FRACTION downto FRACTION-MANTISSA_WIDTH+1) := unsigned('1' & ring_r(0)(51 downto 0));
        -- A denormal number has no leading one.
        if exponent_of(ring_r(0)) = 0 then
          mantissa(FRACTION) := '0';
        end if;
        shifted_r  <= shift_right(mantissa, to_integer(distance_r));
        negative_r <= ring_r(0)(63);
        if vanishes_r = '1' then
          shifted_r <= (others => '0');
        end if;
      end if;
    end if;
  end process shift;

  turn : process (clk)
    variable sign  : signed(FRACTION downto 0);
    variable back  : signed(FRACTION downto 0);
    variable carry : unsigned(0 downto 0);
  begin
    if rising_edge(clk) then
      if step_r = IDLE and in_valid = '1' then
        -- Number 0 comes last: it has already been measured.
        for k in ring_r'range loop
          ring_r((k + COUNT-1) mod COUNT) <= in_numbers(64*k+63 downto 64*k);
        end loop;
      elsif step_r = SEARCH or step_r = ALIGN or step_r = DRAIN then
        -- (m + r) and -(m + r) = not m + (1 - r): rounding and sign share one carry chain.
        sign     := (others => negative_r);
        back     := signed('0' & shifted_r(FRACTION downto 1)) xor sign;
        carry(0) := shifted_r(0) xor negative_r;
        back     := back + signed('0' & carry);
        for k in 0 to COUNT-2 loop
          ring_r(k) <= ring_r(k+1);
        end loop;
        ring_r(COUNT-1) <= std_logic_vector(resize(back, SLOT_WIDTH));
        if step_r = SEARCH then
          ring_r(COUNT-1) <= ring_r(0);
        end if;
      end if;
    end if;
  end process turn;

end architecture rtl;
