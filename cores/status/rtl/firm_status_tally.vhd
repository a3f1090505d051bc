-- SPDX-License-Identifier: Apache-2.0
-- A table of counters in memory, each with the longest of some durations: an operation adds `op_count` to the counter
-- at `op_index`, and raises the duration there to `op_longest` if this is longer. Both stop at their highest value.
-- There may be an operation in every cycle. The words read follow `read_index` by one cycle. With SHARED_READ, a memory
-- with one port to read suffices: the words follow after a cycle without an operation.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_status_tally is
  generic (
    INDEX_BITS   : positive := 1;
    COUNT_BITS   : positive := 32;
    LONGEST_BITS : positive := 16;
    SHARED_READ  : boolean  := false
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The table is zero; after reset this takes a cycle for each counter. Until then, operations are lost, and reading
    -- gives zeros.
    is_clear : out std_logic;

    op_valid   : in std_logic;
    op_index   : in std_logic_vector(INDEX_BITS-1 downto 0);
    op_count   : in std_logic;
    op_longest : in std_logic_vector(LONGEST_BITS-1 downto 0);

    read_index   : in  std_logic_vector(INDEX_BITS-1 downto 0);
    read_count   : out std_logic_vector(COUNT_BITS-1 downto 0);
    read_longest : out std_logic_vector(LONGEST_BITS-1 downto 0)
  );
end entity firm_status_tally;

architecture rtl of firm_status_tally is

  constant WORD_BITS : positive := COUNT_BITS + LONGEST_BITS;
  -- All ones; VHDL-93 has no aggregate with `others` in a comparison.
  constant FULL : std_logic_vector(COUNT_BITS-1 downto 0) := (others => '1');
  -- The last step of clearing.
  constant LAST_INDEX : std_logic_vector(INDEX_BITS-1 downto 0) := (others => '1');

  type memory_t is array (natural range 0 to 2**INDEX_BITS-1) of std_logic_vector(WORD_BITS-1 downto 0);
  -- Cleared after reset. Initial values as well would slow Yosys down by far if there are thousands of counters.
  signal memory : memory_t;

  -- Clearing after reset.
  signal clear_r       : std_logic_vector(INDEX_BITS-1 downto 0) := (others => '0');
  signal is_clear_r    : std_logic;
  -- The operation whose word was read in the last cycle.
  signal valid_r       : std_logic;
  signal index_r       : std_logic_vector(INDEX_BITS-1 downto 0) := (others => '0');
  signal count_r       : std_logic;
  signal longest_r     : std_logic_vector(LONGEST_BITS-1 downto 0);
  signal word_r        : std_logic_vector(WORD_BITS-1 downto 0);
  -- The operation before it, which wrote its word when this one read.
  signal was_valid_r   : std_logic;
  signal was_index_r   : std_logic_vector(INDEX_BITS-1 downto 0);
  signal was_word_r    : std_logic_vector(WORD_BITS-1 downto 0);
  signal read_word     : std_logic_vector(WORD_BITS-1 downto 0);
  -- The word that was read outside was written in the same cycle.
  signal hit_r         : std_logic;

  signal old_word      : std_logic_vector(WORD_BITS-1 downto 0);
  signal new_word      : std_logic_vector(WORD_BITS-1 downto 0);
  signal write_enable  : std_logic;
  signal write_index   : std_logic_vector(INDEX_BITS-1 downto 0);
  signal write_word    : std_logic_vector(WORD_BITS-1 downto 0);

  -- A word that is read and written in the same cycle is taken from `was_word_r`.
  attribute syn_ramstyle of memory      : signal is "no_rw_check";
  attribute rw_addr_collision of memory : signal is "no";

begin

  old_word <= was_word_r when was_valid_r = '1' and was_index_r = index_r else word_r;

  change_word : process (old_word, count_r, longest_r)
    variable count   : unsigned(COUNT_BITS-1 downto 0);
    variable longest : std_logic_vector(LONGEST_BITS-1 downto 0);
  begin
    count   := unsigned(old_word(WORD_BITS-1 downto LONGEST_BITS));
    longest := old_word(LONGEST_BITS-1 downto 0);
    if count_r = '1' and std_logic_vector(count) /= FULL then
      count := count + 1;
    end if;
    if unsigned(longest_r) > unsigned(longest) then
      longest := longest_r;
    end if;
    new_word <= std_logic_vector(count) & longest;
  end process change_word;

  write_enable <= valid_r or not is_clear_r;
  write_index  <= index_r when is_clear_r = '1' else clear_r;
  write_word   <= new_word when is_clear_r = '1' else (others => '0');

  write_memory : process (clk)
  begin
    if rising_edge(clk) then
      if write_enable = '1' then
        memory(to_integer(unsigned(write_index))) <= write_word;
      end if;
    end if;
  end process write_memory;

  own_port : if not SHARED_READ generate
    signal read_r : std_logic_vector(WORD_BITS-1 downto 0);
  begin
    read_word <= was_word_r when hit_r = '1' else read_r;

    read_memory : process (clk)
    begin
      if rising_edge(clk) then
        word_r <= memory(to_integer(unsigned(op_index)));
        read_r <= memory(to_integer(unsigned(read_index)));
        if is_clear_r /= '1' then
          word_r <= (others => '0');
          read_r <= (others => '0');
        end if;
      end if;
    end process read_memory;
  end generate own_port;

  shared_port : if SHARED_READ generate
    signal index      : std_logic_vector(INDEX_BITS-1 downto 0);
    signal was_read_r : std_logic;  -- the last cycle had no operation
    signal kept_r     : std_logic_vector(WORD_BITS-1 downto 0);
  begin
    index     <= op_index when op_valid = '1' else read_index;
    read_word <= kept_r when was_read_r = '0' else
                 was_word_r when hit_r = '1' else
                 word_r;

    read_memory : process (clk)
    begin
      if rising_edge(clk) then
        word_r     <= memory(to_integer(unsigned(index)));
        was_read_r <= not op_valid;
        kept_r     <= read_word;
        if is_clear_r /= '1' then
          word_r <= (others => '0');
          kept_r <= (others => '0');
        end if;
      end if;
    end process read_memory;
  end generate shared_port;

  step : process (clk)
  begin
    if rising_edge(clk) then
      index_r     <= op_index;
      count_r     <= op_count;
      longest_r   <= op_longest;
      was_index_r <= index_r;
      was_word_r  <= new_word;
      hit_r       <= '0';
      if index_r = read_index then
        hit_r <= valid_r;
      end if;
      valid_r     <= op_valid and is_clear_r;
      was_valid_r <= valid_r;
      if rst_n = '0' then
        valid_r     <= '0';
        was_valid_r <= '0';
        is_clear_r  <= '0';
        clear_r     <= (others => '0');
      elsif is_clear_r = '0' then
        clear_r <= std_logic_vector(unsigned(clear_r) + 1);
        if clear_r = LAST_INDEX then
          is_clear_r <= '1';
        end if;
      end if;
    end if;
  end process step;

  is_clear     <= is_clear_r;
  read_count   <= read_word(WORD_BITS-1 downto LONGEST_BITS);
  read_longest <= read_word(LONGEST_BITS-1 downto 0);

end architecture rtl;
