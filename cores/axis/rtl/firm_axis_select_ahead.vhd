-- SPDX-License-Identifier: Apache-2.0
-- Selects one of many consecutive words a cycle before it is needed. A single tree of multiplexers would be slow, and
-- so would an index that others use, too: each group of words has a tree and a register, and the index is counted here.
-- All registers but that of the selected word are zero, so an OR finds it.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_select_ahead is
  generic (
    WORDS : integer  := 128;  -- 1 and more
    WIDTH : positive := 8;
    -- A group has 2**GROUP_BITS words: larger groups need fewer registers and deeper trees.
    GROUP_BITS : natural := 6
  );
  port (
    clk : in std_logic;

    words_in : in  std_logic_vector(WORDS*WIDTH-1 downto 0);  -- word 0 lowest
    run      : in  std_logic;                                 -- '0' sets the index to 0
    advance  : in  std_logic;                                 -- the index steps to the next word
    load     : in  std_logic;                                 -- `word` becomes the word with the index
    word     : out std_logic_vector(WIDTH-1 downto 0)
  );
end entity firm_axis_select_ahead;

architecture rtl of firm_axis_select_ahead is

  constant SPAN   : positive := 2**GROUP_BITS;
  constant GROUPS : integer  := (WORDS+SPAN-1) / SPAN;
  constant HIGH   : natural  := index_bits(WORDS) - 1;

  type words_t is array (natural range <>) of std_logic_vector(WIDTH-1 downto 0);

  signal index_r  : unsigned(HIGH downto 0) := (others => '0');
  signal index    : std_logic_vector(HIGH downto 0);
  signal selected : words_t(0 to GROUPS-1);
  signal is_group : std_logic_vector(0 to GROUPS-1);  -- the index is in the group
  signal group_r  : words_t(0 to GROUPS-1) := (others => (others => '0'));

begin

  index <= std_logic_vector(index_r);

  select_words : for number in 0 to GROUPS-1 generate

    constant FIRST : natural  := number*SPAN;
    constant COUNT : positive := WORDS - FIRST - max(0, WORDS-FIRST-SPAN);

  begin

    single : if GROUPS = 1 generate
      is_group(number) <= '1';
    end generate single;

    several : if GROUPS > 1 generate
      is_group(number) <= is_equal(index(HIGH downto GROUP_BITS), number);
    end generate several;

    u_select : entity firm.firm_axis_select
      generic map (
        WORDS => COUNT,
        WIDTH => WIDTH
      )
      port map (
        words_in => words_in((FIRST+COUNT)*WIDTH-1 downto FIRST*WIDTH),
        index    => index(index_bits(COUNT)-1 downto 0),
        word     => selected(number)
      );

  end generate select_words;

  count_words : process (clk)
  begin
    if rising_edge(clk) then
      if run = '0' then
        index_r <= (others => '0');
      elsif advance = '1' then
        index_r <= index_r + 1;
      end if;
    end if;
  end process count_words;

  hold_words : process (clk)
  begin
    if rising_edge(clk) and load = '1' then
      for number in 0 to GROUPS-1 loop
        group_r(number) <= selected(number);
        if is_group(number) = '0' then
          group_r(number) <= (others => '0');
        end if;
      end loop;
    end if;
  end process hold_words;

  find_word : process (group_r)
    variable found : std_logic_vector(WIDTH-1 downto 0);
  begin
    found := (others => '0');
    for number in 0 to GROUPS-1 loop
      found := found or group_r(number);
    end loop;
    word <= found;
  end process find_word;

end architecture rtl;
