-- SPDX-License-Identifier: Apache-2.0
-- A level of firm_sched_heap below the root: 2**LEVEL nodes, and the operation that is at this level in this cycle.
--
-- A node is the left or right one of a pair. A pair is stored at the address of its common parent node, so that both
-- are read at once. That address is the highest LEVEL-1 bits of the operation's index.
-- INSERT compares its item with the node on the item's path: the one that goes first is stored in the node, and the
-- other continues to the level below. FILL finds the smaller one of a pair, which the level above takes in the
-- same cycle, and continues to the level below to fill the resulting hole. CLEAR empties the pair.
-- No operation may arrive in the cycle after a FILL, because the level below then writes to the pair. The pair's
-- address is still here, since the index changes only with an operation.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_heap_level is
  generic (
    LEVEL    : positive;   -- 1 to ID_BITS
    ID_BITS  : positive;
    KEY_BITS : positive
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The operation from the level above, at most one, and its item; for a FILL, the index identifies the hole.
    insert : in std_logic;
    fill   : in std_logic;
    clear  : in std_logic;
    id     : in std_logic_vector(ID_BITS-1 downto 0);
    key    : in std_logic_vector(KEY_BITS-1 downto 0);

    -- FILL: the item that the level above takes.
    smaller_valid : out std_logic;
    smaller_id    : out std_logic_vector(ID_BITS-1 downto 0);
    smaller_key   : out std_logic_vector(KEY_BITS-1 downto 0);

    -- The operation for the level below.
    below_insert : out std_logic;
    below_fill   : out std_logic;
    below_clear  : out std_logic;
    below_id     : out std_logic_vector(ID_BITS-1 downto 0);
    below_key    : out std_logic_vector(KEY_BITS-1 downto 0);

    -- The level below fills the left or right hole here with its item.
    hole         : in std_logic;
    hole_right   : in std_logic;
    filler_valid : in std_logic;
    filler_id    : in std_logic_vector(ID_BITS-1 downto 0);
    filler_key   : in std_logic_vector(KEY_BITS-1 downto 0)
  );
end entity firm_sched_heap_level;

architecture rtl of firm_sched_heap_level is

  -- The highest LEVEL bits of an item's index are the node's address; the node stores only the others.
  constant LOW_BITS     : natural  := ID_BITS - LEVEL;
  constant SIDE         : natural  := LOW_BITS;  -- the bit of the index that distinguishes left and right
  -- A node: valid, key, the low bits of its item's index.
  constant NODE_BITS    : positive := 1 + KEY_BITS + LOW_BITS;
  subtype node_t is std_logic_vector(NODE_BITS-1 downto 0);
  -- The compared bits of items on one path: key and low bits of the index.
  subtype rank_t is std_logic_vector(NODE_BITS-2 downto 0);
  subtype key_of_node_t is std_logic_vector(NODE_BITS-2 downto LOW_BITS);

  signal insert_r : std_logic;
  signal fill_r   : std_logic;
  signal clear_r  : std_logic;
  signal id_r     : std_logic_vector(ID_BITS-1 downto 0);
  signal key_r    : std_logic_vector(KEY_BITS-1 downto 0);

  signal left        : node_t;
  signal right       : node_t;
  signal item        : node_t;
  signal node        : node_t;  -- on the item's path
  signal write_node  : node_t;
  signal write_left  : std_logic;
  signal write_right : std_logic;

  signal right_key_first : std_logic;
  signal takes_right     : std_logic;  -- FILL: the right one of the pair goes first
  signal node_first      : std_logic;  -- INSERT: the node goes before the item, if there is one

begin

  hold_operation : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        insert_r <= '0';
        fill_r   <= '0';
        clear_r  <= '0';
      else
        insert_r <= insert;
        fill_r   <= fill;
        clear_r  <= clear;
      end if;
      -- Operations arrive late at the highest level, whose pair needs no address.
      if LEVEL = 1 or insert = '1' or fill = '1' or clear = '1' then
        id_r  <= id;
        key_r <= key;
      end if;
    end if;
  end process hold_operation;

  only_pair : if LEVEL = 1 generate
    hold_pair : process (clk)
    begin
      if rising_edge(clk) then
        if write_left = '1' then
          left <= write_node;
        end if;
        if write_right = '1' then
          right <= write_node;
        end if;
      end if;
    end process hold_pair;
  end generate only_pair;

  pairs : if LEVEL > 1 generate
    constant ADDRESS_BITS : positive := LEVEL - 1;
    signal address        : std_logic_vector(ADDRESS_BITS-1 downto 0);
  begin
    address <= id_r(ID_BITS-1 downto LOW_BITS+1);

    u_left : entity firm.firm_sched_ram
      generic map (
        ADDRESS_BITS => ADDRESS_BITS,
        WORD_BITS    => NODE_BITS
      )
      port map (
        clk          => clk,
        address      => address,
        read_word    => left,
        write_enable => write_left,
        write_word   => write_node
      );

    u_right : entity firm.firm_sched_ram
      generic map (
        ADDRESS_BITS => ADDRESS_BITS,
        WORD_BITS    => NODE_BITS
      )
      port map (
        clk          => clk,
        address      => address,
        read_word    => right,
        write_enable => write_right,
        write_word   => write_node
      );
  end generate pairs;

  item(NODE_BITS-1)                 <= insert_r;
  item(NODE_BITS-2 downto LOW_BITS) <= key_r;
  low_bits_of_item : for place in 0 to LOW_BITS-1 generate
    item(place) <= id_r(place);
  end generate low_bits_of_item;

  node <= right when id_r(SIDE) = '1' else left;

  -- FILL compares left with right, INSERT its item with the node. These are two comparisons, since one would need
  -- multiplexers between the memories and its carry chain. If the keys of a pair are equal, the left one goes first.
  right_key_first <= is_before(right(key_of_node_t'range), left(key_of_node_t'range));
  takes_right     <= right(NODE_BITS-1) and (right_key_first or not left(NODE_BITS-1));

  -- A leaf only holds the item of its own index, so an arriving item finds it empty.
  leaves : if LOW_BITS = 0 generate
    node_first <= '0';
  end generate leaves;
  inner_nodes : if LOW_BITS > 0 generate
    node_first <= not is_before(item(rank_t'range), node(rank_t'range));
  end generate inner_nodes;

  hand_up : process (left, right, takes_right, id_r)
    variable smaller : node_t;
  begin
    smaller := left;
    if takes_right = '1' then
      smaller := right;
    end if;
    smaller_valid    <= left(NODE_BITS-1) or right(NODE_BITS-1);
    smaller_key      <= smaller(NODE_BITS-2 downto LOW_BITS);
    smaller_id       <= id_r;
    smaller_id(SIDE) <= takes_right;
    for place in 0 to LOW_BITS-1 loop
      smaller_id(place) <= smaller(place);
    end loop;
  end process hand_up;

  -- Only the path to a FILL's hole continues. After the last level, nothing else remains to be done.
  -- The item matters for an INSERT that finds one, and for a CLEAR, which hands down its index.
  hand_down : process (item, node, left, right, takes_right, node_first, insert_r, fill_r, clear_r, id_r)
    variable larger : node_t;
  begin
    larger := node;
    if node_first = '1' or clear_r = '1' then
      larger := item;
    end if;
    below_insert <= insert_r and node(NODE_BITS-1);
    below_fill   <= fill_r and (left(NODE_BITS-1) or right(NODE_BITS-1));
    below_clear  <= clear_r;
    below_key    <= larger(NODE_BITS-2 downto LOW_BITS);
    below_id     <= id_r;
    if fill_r = '1' then
      below_id(SIDE) <= takes_right;
    end if;
    for place in 0 to LOW_BITS-1 loop
      below_id(place) <= larger(place);
    end loop;
  end process hand_down;

  -- The comparison is the last to arrive. An item is stored in an empty node, or in the place of one that it precedes.
  choose_write : process (item, node, insert_r, clear_r, id_r, node_first, hole, hole_right,
                          filler_valid, filler_id, filler_key)
    variable stores : std_logic;  -- the node is empty
  begin
    write_node <= item;
    if hole = '1' then
      write_node(NODE_BITS-1)                 <= filler_valid;
      write_node(NODE_BITS-2 downto LOW_BITS) <= filler_key;
      for place in 0 to LOW_BITS-1 loop
        write_node(place) <= filler_id(place);
      end loop;
    end if;
    stores      := insert_r and not node(NODE_BITS-1);
    write_left  <= ((stores and not id_r(SIDE)) or clear_r or (hole and not hole_right)) or
                   ((insert_r and not id_r(SIDE)) and not node_first);
    write_right <= ((stores and id_r(SIDE)) or clear_r or (hole and hole_right)) or
                   ((insert_r and id_r(SIDE)) and not node_first);
  end process choose_write;

end architecture rtl;
