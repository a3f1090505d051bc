-- SPDX-License-Identifier: Apache-2.0
-- A priority queue of few cycles: a shift register that is kept sorted, with the ports of firm_sched_heap.
--
-- Each cell compares the new item with its own. Since the cells are sorted, those after the new item's place detect
-- this by their own comparison, and the place itself by that of the cell before: only the new item crosses the whole
-- queue. An insert and a pop take one cycle each, even at the same time, and the next root is valid in the next cycle.
-- `pop` arrives late, so that it only decides on the root, and the other cells move a cycle later. Meanwhile, the first
-- of them still holds the item that has become the root.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_sorted_queue is
  generic (
    ITEMS    : positive;
    KEY_BITS : positive
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- An item that is not in the queue. Keys in the queue are less than half their range apart.
    insert_valid : in  std_logic;  -- an item is offered
    insert_ready : out std_logic;  -- it can enter, even if there is a pop in this cycle
    insert       : in  std_logic;  -- it enters; otherwise, it may stay offered only if there is no root
    insert_id    : in  std_logic_vector(index_bits(ITEMS)-1 downto 0);
    insert_key   : in  std_logic_vector(KEY_BITS-1 downto 0);

    -- The item with the smallest key; among equals, the lowest index.
    root_valid : out std_logic;
    root_id    : out std_logic_vector(index_bits(ITEMS)-1 downto 0);
    root_key   : out std_logic_vector(KEY_BITS-1 downto 0);
    -- The same: the root is always available.
    first_valid : out std_logic;
    first_id    : out std_logic_vector(index_bits(ITEMS)-1 downto 0);
    first_key   : out std_logic_vector(KEY_BITS-1 downto 0);
    pop         : in  std_logic;    -- takes that item; only while it is valid
    empty       : out std_logic     -- the queue is empty; while '0', a root is valid or about to be
  );
end entity firm_sched_sorted_queue;

architecture rtl of firm_sched_sorted_queue is

  constant ID_BITS : positive := index_bits(ITEMS);
  subtype item_t is std_logic_vector(KEY_BITS+ID_BITS-1 downto 0);
  -- Cell 0 is the root. After the last one, there are two more cells, never full, as neighbours.
  type items_t is array (0 to ITEMS+1) of item_t;

  signal valid_r  : std_logic_vector(0 to ITEMS+1);
  signal item_r   : items_t;
  signal popped_r : std_logic;  -- there was a pop in the last cycle: cell 1 holds what is the root

  signal new_item  : item_t;
  signal new_first : std_logic_vector(0 to ITEMS+1);  -- the new item comes before the cell's own

  -- The item behind the root, and the root after a pop.
  signal second_valid : std_logic;
  signal second       : item_t;
  signal new_second   : std_logic;
  signal next_root    : item_t;

begin

  new_item <= insert_key & insert_id;

  new_first(0) <= not valid_r(0) or is_before(new_item, item_r(0));

  neighbours : for cell in ITEMS to ITEMS+1 generate
    valid_r(cell)   <= '0';
    item_r(cell)    <= (others => '0');
    new_first(cell) <= '1';
  end generate neighbours;

  second_valid <= valid_r(2) when popped_r = '1' else valid_r(1);
  second       <= item_r(2) when popped_r = '1' else item_r(1);
  new_second   <= new_first(2) when popped_r = '1' else new_first(1);
  next_root    <= new_item when insert_valid = '1' and new_second = '1' else second;

  hold_root : process (clk)
  begin
    if rising_edge(clk) then
      popped_r <= pop and rst_n;
      if rst_n = '0' then
        valid_r(0) <= '0';
      elsif pop = '1' then
        valid_r(0) <= second_valid or insert;
      elsif insert = '1' then
        valid_r(0) <= '1';
      end if;
      if pop = '1' then
        item_r(0) <= next_root;
      elsif insert_valid = '1' and new_first(0) = '1' then
        item_r(0) <= new_item;
      end if;
    end if;
  end process hold_root;

  -- If the new item comes before the root, the old root follows it, even if it is popped at the same time: as after
  -- every pop, cell 1 then holds what is to be removed.
  cells : for cell in 1 to ITEMS-1 generate
    signal shift_back  : std_logic;  -- away from the root: takes the item of the cell before
    signal shift_front : std_logic;  -- takes that of the next cell
    signal take_new    : std_logic;
    signal from_before : std_logic;
  begin
    new_first(cell) <= not valid_r(cell) or is_before(new_item, item_r(cell));
    from_before     <= insert_valid and new_first(cell-1);

    -- A pop moves all items to the front; a new item moves those after its place back again, so they stay in place.
    first : if cell = 1 generate
      shift_back  <= from_before;
      shift_front <= popped_r;
      take_new    <= insert_valid and new_first(2) and not new_first(0) when popped_r = '1' else
                     insert_valid and new_first(1) and not new_first(0);
    end generate first;
    others_behind : if cell > 1 generate
      shift_back  <= from_before and not popped_r;
      shift_front <= popped_r and not (insert_valid and new_first(cell));
      take_new    <= insert_valid and new_first(cell+1) and not new_first(cell) when popped_r = '1' else
                     insert_valid and new_first(cell) and not new_first(cell-1);
    end generate others_behind;

    hold_item : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          valid_r(cell) <= '0';
        elsif take_new = '1' then
          valid_r(cell) <= '1';
        elsif shift_back = '1' then
          valid_r(cell) <= valid_r(cell-1);
        elsif shift_front = '1' then
          valid_r(cell) <= valid_r(cell+1);
        end if;
        if take_new = '1' then
          item_r(cell) <= new_item;
        elsif shift_back = '1' then
          item_r(cell) <= item_r(cell-1);
        elsif shift_front = '1' then
          item_r(cell) <= item_r(cell+1);
        end if;
      end if;
    end process hold_item;
  end generate cells;

  insert_ready <= '1';
  root_valid   <= valid_r(0);
  root_id      <= item_r(0)(ID_BITS-1 downto 0);
  root_key     <= item_r(0)(item_t'high downto ID_BITS);
  first_valid  <= valid_r(0);
  first_id     <= item_r(0)(ID_BITS-1 downto 0);
  first_key    <= item_r(0)(item_t'high downto ID_BITS);
  empty        <= not valid_r(0);

end architecture rtl;
