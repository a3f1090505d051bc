-- SPDX-License-Identifier: Apache-2.0
-- One word out of many: a tree of 4-to-1 multiplexers, each of which fits a 6-input LUT a bit. A dynamic array
-- index costs about twice of it through `ghdl --synth`. An index beyond the last word reads zero.
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

  -- Levels of multiplexers; each takes two bits of the index, the one at the leaves the lowest.
  constant LEVELS : natural := (clog2(WORDS) + 1) / 2;

  -- The number of the first node of a level of the tree. It is a heap: 0 is the root, node n has the children 4n+1 to 4n+4.
  function first_node(level : natural) return natural is
  begin
    return (4**level - 1) / 3;
  end function first_node;

  constant FIRST_LEAF : natural := first_node(LEVELS);

  type tree_t is array (natural range 0 to first_node(LEVELS+1)-1) of std_logic_vector(WIDTH-1 downto 0);
  signal tree   : tree_t;
  signal digits : std_logic_vector(2*LEVELS+1 downto 0);

begin

  digits(2*LEVELS+1 downto index'length) <= (others => '0');
  digits(index'length-1 downto 0)        <= index;

  leaves : for leaf in natural range 0 to 4**LEVELS-1 generate
    used : if leaf < WORDS generate
      tree(FIRST_LEAF+leaf) <= words_in((leaf+1)*WIDTH-1 downto leaf*WIDTH);
    end generate used;
    unused : if leaf >= WORDS generate
      tree(FIRST_LEAF+leaf) <= (others => '0');
    end generate unused;
  end generate leaves;

  levels_of_tree : for level in 0 to LEVELS-1 generate
    nodes : for node in first_node(level) to first_node(level+1)-1 generate
      constant DIGIT : natural := 2*(LEVELS-1-level);
    begin
      tree(node) <= tree(4*node+1) when digits(DIGIT+1) = '0' and digits(DIGIT) = '0' else
                    tree(4*node+2) when digits(DIGIT+1) = '0' else
                    tree(4*node+3) when digits(DIGIT) = '0' else
                    tree(4*node+4);
    end generate nodes;
  end generate levels_of_tree;

  word <= tree(0);

end architecture rtl;
