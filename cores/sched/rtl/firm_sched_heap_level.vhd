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
  constant SIDE         : natural  := LOW_BITS;  -- the bit of the index that tells left from right
  -- A node: valid, key, the low bits of its item's index.
  constant NODE_BITS    : positive := 1 + KEY_BITS + LOW_BITS;
  subtype node_t is std_logic_vector(NODE_BITS-1 downto 0);
  -- The compared bits: key, side and low bits of the index.
  subtype rank_t is std_logic_vector(KEY_BITS+LOW_BITS downto 0);

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

  -- The two compared items: INSERT the item with its node, FILL left with right.
  signal first        : node_t;
  signal second       : node_t;
  signal second_right : std_logic;
  signal first_rank   : rank_t;
  signal second_rank  : rank_t;
  signal second_first : std_logic;
  signal takes_second : std_logic;

  function rank(of_node : node_t; is_right : std_logic) return rank_t is
    variable result : rank_t;
  begin
    result(KEY_BITS+LOW_BITS downto LOW_BITS+1) := of_node(KEY_BITS+LOW_BITS-1 downto LOW_BITS);
    result(LOW_BITS)                            := is_right;
    for place in 0 to LOW_BITS-1 loop
      result(place) := of_node(place);
    end loop;
    return result;
  end function rank;

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

  -- A leaf only holds the item of its own index, so an arriving item finds it empty.
  leaves : if LOW_BITS = 0 generate
    first        <= left;
    second       <= right;
    second_right <= '1';
  end generate leaves;
  inner_nodes : if LOW_BITS > 0 generate
    first        <= left when fill_r = '1' else item;
    second       <= right when fill_r = '1' or id_r(SIDE) = '1' else left;
    second_right <= fill_r or id_r(SIDE);
  end generate inner_nodes;
  first_rank   <= rank(first, not fill_r and id_r(SIDE));
  second_rank  <= rank(second, second_right);
  second_first <= is_before(second_rank, first_rank);
  -- The comparison is the last to arrive. An INSERT has an item, so only a FILL may find the first one empty.
  takes_second <= (second_first and second(NODE_BITS-1)) or
                  (fill_r and right(NODE_BITS-1) and not left(NODE_BITS-1));

  hand_up : process (left, right, takes_second, id_r)
    variable smaller : node_t;
  begin
    smaller := left;
    if takes_second = '1' then
      smaller := right;
    end if;
    smaller_valid    <= left(NODE_BITS-1) or right(NODE_BITS-1);
    smaller_key      <= smaller(NODE_BITS-2 downto LOW_BITS);
    smaller_id       <= id_r;
    smaller_id(SIDE) <= takes_second;
    for place in 0 to LOW_BITS-1 loop
      smaller_id(place) <= smaller(place);
    end loop;
  end process hand_up;

  -- Only the path to a FILL's hole continues. After the last level, nothing else remains to be done.
  hand_down : process (item, node, left, right, takes_second, insert_r, fill_r, clear_r, id_r)
    variable larger : node_t;
  begin
    larger := node;
    if takes_second = '1' or clear_r = '1' then
      larger := item;
    end if;
    below_insert <= insert_r and node(NODE_BITS-1);
    below_fill   <= fill_r and (left(NODE_BITS-1) or right(NODE_BITS-1));
    below_clear  <= clear_r;
    below_key    <= larger(NODE_BITS-2 downto LOW_BITS);
    below_id     <= id_r;
    if fill_r = '1' then
      below_id(SIDE) <= takes_second;
    end if;
    for place in 0 to LOW_BITS-1 loop
      below_id(place) <= larger(place);
    end loop;
  end process hand_down;

  -- The comparison is the last to arrive, and an INSERT has an item: its node stays only if it goes first.
  choose_write : process (item, node, insert_r, clear_r, id_r, second_first, hole, hole_right,
                          filler_valid, filler_id, filler_key)
    variable keep_item : std_logic;
  begin
    write_node <= item;
    if hole = '1' then
      write_node(NODE_BITS-1)                 <= filler_valid;
      write_node(NODE_BITS-2 downto LOW_BITS) <= filler_key;
      for place in 0 to LOW_BITS-1 loop
        write_node(place) <= filler_id(place);
      end loop;
    end if;
    keep_item   := not (node(NODE_BITS-1) and second_first);
    write_left  <= (insert_r and not id_r(SIDE) and keep_item) or (clear_r or (hole and not hole_right));
    write_right <= (insert_r and id_r(SIDE) and keep_item) or (clear_r or (hole and hole_right));
  end process choose_write;

end architecture rtl;
