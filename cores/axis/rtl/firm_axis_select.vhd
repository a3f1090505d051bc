-- SPDX-License-Identifier: Apache-2.0
-- One word out of many: a tree of multiplexers, two levels of which fit a 6-input LUT a bit. A dynamic array index costs
-- about twice of it through `ghdl --synth`. An index beyond the last word reads any of them.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_select is
  generic (
    WORDS : integer  := 4;  -- 1 and more
    WIDTH : positive := 8);
  port (
    words_in : in  std_logic_vector(WORDS*WIDTH-1 downto 0);  -- word 0 lowest
    index    : in  std_logic_vector(index_bits(WORDS)-1 downto 0);
    word     : out std_logic_vector(WIDTH-1 downto 0));
end entity firm_axis_select;

architecture rtl of firm_axis_select is

  -- Parts the words by the highest bit of the number that tells them apart. Simulation goes only the way to the word, so
  -- thousands of them take no more time than a few.
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

begin

  -- An illegal number is for the entity above to name.
  legal : if WORDS >= 1 generate
    word <= chosen(words_in, index);
  end generate legal;

end architecture rtl;
