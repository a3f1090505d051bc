-- SPDX-License-Identifier: Apache-2.0
-- The lowest index of those that ask, one of which may be left out. No registers.
-- A leaf is a pair: both requests, whether its row and its column are those of the index that is left out, and the
-- lowest bit of it are five inputs of one LUT. Pairs lie in rows. The first row that has one is found, then of it
-- only the first pair, then whether it is the even request of it. If the pair lost one of its two, it is the other.
-- A tree that hands indices up takes half as many LUTs again.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_lowest is
  generic (
    REQUESTERS : integer := 2);
  port (
    request   : in  std_logic_vector(REQUESTERS-1 downto 0);
    index     : in  std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
    leave_out : in  std_logic;  -- the requester `index`
    found     : out std_logic;
    lowest    : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0));  -- any if none is found
end entity firm_sched_lowest;

architecture rtl of firm_sched_lowest is

  constant BITS : positive := index_bits(REQUESTERS);
  -- Up to it, rows and pairs are not worth their effort.
  constant FEW : positive := 8;

  -- The bit of `values` where the first '1' of `marks` is.
  function at_first(marks, values : std_logic_vector) return std_logic is
    constant COUNT : positive := marks'length;
    constant HALF  : natural  := COUNT / 2;
    alias mark  : std_logic_vector(COUNT-1 downto 0) is marks;
    alias value : std_logic_vector(COUNT-1 downto 0) is values;
  begin
    if COUNT = 1 then
      return value(0);
    elsif any_of(mark(HALF-1 downto 0)) = '1' then
      return at_first(mark(HALF-1 downto 0), value(HALF-1 downto 0));
    end if;
    return at_first(mark(COUNT-1 downto HALF), value(COUNT-1 downto HALF));
  end function at_first;

  -- The word of a number, found from its highest bit on, which is there first.
  function word_at(words, number : std_logic_vector) return std_logic_vector is
    constant HALF : positive := words'length / 2;
    alias numbered : std_logic_vector(2*HALF-1 downto 0) is words;
    alias bits     : std_logic_vector(number'length-1 downto 0) is number;
    variable half_of_word : std_logic_vector(HALF-1 downto 0);
  begin
    if bits(bits'high) = '1' then
      half_of_word := numbered(2*HALF-1 downto HALF);
    else
      half_of_word := numbered(HALF-1 downto 0);
    end if;
    if bits'length = 1 then
      return half_of_word;
    end if;
    return word_at(half_of_word, bits(bits'high-1 downto 0));
  end function word_at;

begin

  flat : if REQUESTERS >= 1 and REQUESTERS <= FEW generate
    signal eligible : std_logic_vector(REQUESTERS-1 downto 0);
  begin
    eligible <= request and not decode(index, leave_out, REQUESTERS);
    found    <= any_of(eligible);
    lowest   <= first_of(eligible);
  end generate flat;

  in_rows : if REQUESTERS > FEW generate
    -- From the highest bit: the row, the pair in it, the request in that.
    constant ROW_BITS  : positive := (BITS-1) / 2;
    constant PAIR_BITS : positive := BITS - ROW_BITS - 1;
    constant ROWS      : positive := 2**ROW_BITS;
    constant PAIRS     : positive := 2**PAIR_BITS;  -- in a row

    subtype row_bits_t is natural range BITS-1 downto PAIR_BITS+1;
    subtype pair_bits_t is natural range PAIR_BITS downto 1;

    signal padded : std_logic_vector(2**BITS-1 downto 0);
    signal row    : std_logic_vector(ROW_BITS-1 downto 0);  -- the first one that asks

    signal is_row  : std_logic_vector(ROWS-1 downto 0);   -- where one is left out
    signal is_pair : std_logic_vector(PAIRS-1 downto 0);  -- in each row

    signal row_asks   : std_logic_vector(ROWS-1 downto 0);
    signal pair_asks  : std_logic_vector(ROWS*PAIRS-1 downto 0);
    signal even_asks  : std_logic_vector(ROWS*PAIRS-1 downto 0);  -- nothing left out
    signal pairs_left : std_logic_vector(PAIRS-1 downto 0);       -- of the first row
    signal evens_left : std_logic_vector(PAIRS-1 downto 0);
    signal lost_evens : std_logic_vector(PAIRS-1 downto 0);
    signal is_first   : std_logic;  -- the first row is that where one is left out
  begin
    pad : process (request)
    begin
      padded                        <= (others => '0');
      padded(REQUESTERS-1 downto 0) <= request;
    end process pad;

    is_row  <= decode(index(row_bits_t), leave_out, ROWS);
    is_pair <= decode(index(pair_bits_t), '1', PAIRS);

    each_row : for row_index in 0 to ROWS-1 generate
      each_pair : for pair_index in row_index*PAIRS to (row_index+1)*PAIRS-1 generate
        signal is_left_out : std_logic;
      begin
        is_left_out <= is_row(row_index) and is_pair(pair_index - row_index*PAIRS);

        even_asks(pair_index) <= padded(2*pair_index);
        pair_asks(pair_index) <= (padded(2*pair_index) and not (is_left_out and not index(0))) or
                                 (padded(2*pair_index+1) and not (is_left_out and index(0)));
      end generate each_pair;

      row_asks(row_index) <= any_of(pair_asks((row_index+1)*PAIRS-1 downto row_index*PAIRS));
    end generate each_row;

    pairs_left <= word_at(pair_asks, row);
    evens_left <= word_at(even_asks, row);
    row        <= first_of(row_asks);
    is_first   <= '1' when leave_out = '1' and row = index(row_bits_t) else '0';
    lost_evens <= decode(index(pair_bits_t), is_first and not index(0), PAIRS);

    found  <= any_of(row_asks);
    lowest <= row & first_of(pairs_left) & not at_first(pairs_left, evens_left and not lost_evens);
  end generate in_rows;

end architecture rtl;
