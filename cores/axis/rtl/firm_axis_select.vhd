-- SPDX-License-Identifier: Apache-2.0
-- Selects one of many words with a tree of multiplexers, two levels of which fit a 6-input LUT per bit. A dynamic array
-- index costs about twice as much with `ghdl --synth`. An index beyond the last word gives any word, or zeros. If
-- DECODED, the tree consists of ANDs of words and decoded pairs of index bits, and ORs. Yosys maps this directly to
-- the 4-to-1 multiplexers that fit a LUT, but decomposes nested multiplexers. That saves a third of the LUTs for
-- many unrelated words, and costs more for words with constants, which nested multiplexers absorb.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_select is
  generic (
    WORDS   : integer  := 4;  -- 1 and more
    WIDTH   : positive := 8;
    DECODED : boolean  := false
  );
  port (
    words_in : in  std_logic_vector(WORDS*WIDTH-1 downto 0);  -- word 0 lowest
    index    : in  std_logic_vector(index_bits(WORDS)-1 downto 0);
    word     : out std_logic_vector(WIDTH-1 downto 0)
  );
end entity firm_axis_select;

architecture rtl of firm_axis_select is

  -- Splits the words by the highest bit of the number that distinguishes them. Simulation follows only the path to the
  -- word, so thousands of words take no more time than a few.
  function chosen(candidates, number : std_logic_vector) return std_logic_vector is
    constant COUNT : positive := candidates'length / WIDTH;
    -- The largest power of two below COUNT; 0 for one word, for which GHDL evaluates it, too.
    constant HALF  : natural  := 2**clog2(COUNT) / 2;
    constant LOW   : natural  := candidates'low;
  begin
    if COUNT = 1 then
      return candidates;
    elsif number(clog2(COUNT)-1) = '0' then
      return chosen(candidates(LOW+HALF*WIDTH-1 downto LOW), number);
    else
      return chosen(candidates(LOW+COUNT*WIDTH-1 downto LOW+HALF*WIDTH), number);
    end if;
  end function chosen;

  -- The same with ANDs and ORs: by the highest two bits, or by one where their number is odd.
  function gathered(candidates, number : std_logic_vector) return std_logic_vector is
    constant COUNT  : positive := candidates'length / WIDTH;
    constant LOW    : natural  := candidates'low;
    constant PLACES : natural  := clog2(COUNT);
    -- The bits that choose a part, and those that choose within it. An empty list of words is never split, but GHDL
    -- evaluates this, too.
    constant HERE   : natural  := 2 - PLACES mod 2;
    constant BELOW  : natural  := max(0, PLACES-HERE);
    variable first  : natural;
    variable beyond : natural;
    variable found  : std_logic_vector(WIDTH-1 downto 0) := (others => '0');
  begin
    if COUNT = 1 then
      return candidates;
    end if;
    for part in natural range 0 to 2**HERE-1 loop
      first  := part * 2**BELOW;
      beyond := COUNT - max(0, COUNT - first - 2**BELOW);
      if first < COUNT then
        if is_equal(number(PLACES-1 downto BELOW), part) = '1' then
          found := found or gathered(candidates(LOW+beyond*WIDTH-1 downto LOW+first*WIDTH), number);
        end if;
      end if;
    end loop;
    return found;
  end function gathered;

begin

  -- The entity above reports an illegal number.
  nested : if WORDS >= 1 and not DECODED generate
    word <= chosen(words_in, index);
  end generate nested;
  decoded_pairs : if WORDS >= 1 and DECODED generate
    word <= gathered(words_in, index);
  end generate decoded_pairs;

end architecture rtl;
