-- SPDX-License-Identifier: Apache-2.0
-- A FIFO of words that a subscriber has read ahead of its message side. Memory and output register are as in
-- firm_axis_fifo, so that a word needs two cycles. `has_room` is early enough for a writer with up to two registers
-- before `push`. A low `rst_n` drops all words.
library ieee;
use ieee.std_logic_1164.all;

entity firm_axis_ahead is
  generic (
    BITS : integer := 8;
    -- Words of memory; a power of two wastes none.
    DEPTH : integer := 16
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Any number of words may be pushed while `has_room` is high, and four after it has fallen.
    push     : in  std_logic;
    word_in  : in  std_logic_vector(BITS-1 downto 0);
    has_room : out std_logic;

    -- The oldest word is shown until it is popped.
    word     : out std_logic_vector(BITS-1 downto 0);
    valid    : out std_logic;
    pop      : in  std_logic;
    -- Neither the memory nor the output holds a word.
    is_empty : out std_logic
  );
end entity firm_axis_ahead;

architecture rtl of firm_axis_ahead is

  -- The pushes that `level_r` does not include when a writer with two registers decides.
  constant LATE_WORDS : natural := 4;

  type memory_t is array (natural range 0 to DEPTH-1) of std_logic_vector(BITS-1 downto 0);
  signal memory        : memory_t;
  signal write_index_r : natural range 0 to DEPTH-1;
  signal read_index_r  : natural range 0 to DEPTH-1;
  signal level_r       : natural range 0 to DEPTH;
  signal filled_r      : std_logic := '0';  -- the memory holds a word
  signal room_r        : std_logic := '0';
  signal valid_r       : std_logic := '0';
  signal word_r        : std_logic_vector(BITS-1 downto 0);
  signal read_word     : std_logic;

  function next_index(index : natural) return natural is
  begin
    if index = DEPTH-1 then
      return 0;
    end if;
    return index + 1;
  end function next_index;

begin

  assert BITS >= 1
    report "firm_axis_ahead: BITS is " & integer'image(BITS) & "; legal: 1 or more"
    severity failure;
  assert DEPTH > LATE_WORDS
    report "firm_axis_ahead: DEPTH is " & integer'image(DEPTH) & "; legal: 5 or more"
    severity failure;

  read_word <= filled_r and (pop or not valid_r);

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if push = '1' then
        memory(write_index_r) <= word_in;
      end if;
      if read_word = '1' then
        word_r <= memory(read_index_r);
      end if;
    end if;
  end process access_memory;

  count_words : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        write_index_r <= 0;
        read_index_r  <= 0;
        level_r       <= 0;
        filled_r      <= '0';
        room_r        <= '0';
        valid_r       <= '0';
      else
        room_r <= '0';
        if level_r <= DEPTH-LATE_WORDS then
          room_r <= '1';
        end if;
        if push = '1' and read_word = '0' then
          level_r  <= level_r + 1;
          filled_r <= '1';
        elsif push = '0' and read_word = '1' then
          level_r <= level_r - 1;
          if level_r = 1 then
            filled_r <= '0';
          end if;
        end if;
        if push = '1' then
          write_index_r <= next_index(write_index_r);
        end if;
        if read_word = '1' then
          read_index_r <= next_index(read_index_r);
        end if;
        valid_r <= read_word or (valid_r and not pop);
      end if;
    end if;
  end process count_words;

  has_room <= room_r;
  word     <= word_r;
  valid    <= valid_r;
  is_empty <= not (filled_r or valid_r);

end architecture rtl;
