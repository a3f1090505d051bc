-- SPDX-License-Identifier: Apache-2.0
-- Measures how long each of many sources waits at most, with two bits of registers and a word of memory for each. The
-- sources are visited in turn, one in a cycle: if a source has waited since its last visit, its wait is longer by a
-- turn, of so many cycles as sources, rounded up to a power of two. So the result is less than two
-- turns too low.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_status_waits is
  generic (
    SOURCES   : integer  := 2;
    WAIT_BITS : positive := 16
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The table is zero; after reset this takes a turn. Until then, reading gives zeros.
    is_clear : out std_logic;

    -- Waits are measured.
    enable : in std_logic;
    -- Whether a source waits in this cycle.
    waits : in std_logic_vector(SOURCES-1 downto 0);

    -- The longest wait in cycles, in the cycle after the index.
    read_index   : in  std_logic_vector(index_bits(SOURCES)-1 downto 0);
    read_longest : out std_logic_vector(WAIT_BITS-1 downto 0)
  );
end entity firm_status_waits;

architecture rtl of firm_status_waits is

  -- A word must be written before its next visit, two cycles after its reading.
  constant TURN_BITS  : positive := max(2, index_bits(SOURCES));
  -- Durations are in turns, and stop at their highest value.
  constant COUNT_BITS : positive := max(1, WAIT_BITS-TURN_BITS);
  constant FULL       : std_logic_vector(COUNT_BITS-1 downto 0) := (others => '1');

  type memory_t is array (natural range 0 to 2**TURN_BITS-1) of std_logic_vector(COUNT_BITS-1 downto 0);
  signal current : memory_t := (others => (others => '0'));  -- of the current waits
  signal longest : memory_t := (others => (others => '0'));

  signal turn_r     : unsigned(TURN_BITS-1 downto 0);
  signal visited    : std_logic_vector(2**TURN_BITS-1 downto 0);
  -- Without a pause since its last visit.
  signal waited_r   : std_logic_vector(2**TURN_BITS-1 downto 0) := (others => '0');
  signal has_waited : std_logic_vector(0 downto 0);

  -- The visit of the last cycle, whose words have been read.
  signal place_r     : unsigned(TURN_BITS-1 downto 0);
  signal goes_on_r   : std_logic;
  signal is_clear_r  : std_logic;  -- a turn has passed since reset
  signal keeps_r     : std_logic;  -- as it was at the visit
  signal current_r   : std_logic_vector(COUNT_BITS-1 downto 0);
  signal longest_r   : std_logic_vector(COUNT_BITS-1 downto 0);
  signal new_current : std_logic_vector(COUNT_BITS-1 downto 0);
  signal new_longest : std_logic_vector(COUNT_BITS-1 downto 0);
  signal read_r      : std_logic_vector(COUNT_BITS-1 downto 0);

begin

  assert SOURCES >= 1
    report "firm_status_waits: SOURCES is " & integer'image(SOURCES) & "; legal: 1 or more"
    severity failure;
  assert WAIT_BITS > TURN_BITS
    report "firm_status_waits: WAIT_BITS is " & integer'image(WAIT_BITS) & "; legal: more than the bits of a turn, " &
    integer'image(TURN_BITS)
    severity failure;

  visited <= decode(std_logic_vector(turn_r), '1', 2**TURN_BITS);

  note_waits : process (clk)
  begin
    if rising_edge(clk) then
      -- Of places without a source, too, so that each bit has an assignment.
      waited_r <= (others => '0');
      for number in 0 to SOURCES-1 loop
        waited_r(number) <= waits(number) and (visited(number) or waited_r(number));
      end loop;
    end if;
  end process note_waits;

  u_select : entity firm.firm_axis_select
    generic map (
      WORDS   => 2**TURN_BITS,
      WIDTH   => 1,
      DECODED => true
    )
    port map (
      words_in => waited_r,
      index    => std_logic_vector(turn_r),
      word     => has_waited
    );

  visit : process (clk)
  begin
    if rising_edge(clk) then
      turn_r    <= turn_r + 1;
      place_r   <= turn_r;
      goes_on_r <= has_waited(0) and enable;
      keeps_r   <= is_clear_r;
      current_r <= current(to_integer(turn_r));
      longest_r <= longest(to_integer(turn_r));
      if turn_r = 2**TURN_BITS-1 then
        is_clear_r <= '1';
      end if;
      if rst_n = '0' then
        turn_r     <= (others => '0');
        is_clear_r <= '0';
        keeps_r    <= '0';
      end if;
    end if;
  end process visit;

  measure : process (current_r, longest_r, goes_on_r, keeps_r)
    variable duration : unsigned(COUNT_BITS-1 downto 0);
  begin
    duration := (others => '0');
    if goes_on_r = '1' and keeps_r = '1' then
      duration := unsigned(current_r);
      if current_r /= FULL then
        duration := duration + 1;
      end if;
    end if;
    new_current <= std_logic_vector(duration);
    new_longest <= longest_r;
    if keeps_r = '0' or duration > unsigned(longest_r) then
      new_longest <= std_logic_vector(duration);
    end if;
  end process measure;

  write_memory : process (clk)
  begin
    if rising_edge(clk) then
      current(to_integer(place_r)) <= new_current;
      longest(to_integer(place_r)) <= new_longest;
      read_r                       <= longest(to_integer(unsigned(read_index)));
      if keeps_r /= '1' then
        read_r <= (others => '0');
      end if;
    end if;
  end process write_memory;

  is_clear <= keeps_r;

  read_longest(WAIT_BITS-1 downto TURN_BITS) <= read_r;
  read_longest(TURN_BITS-1 downto 0)         <= (others => '0');

end architecture rtl;
