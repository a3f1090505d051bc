-- SPDX-License-Identifier: Apache-2.0
-- A segment of a sorted shift register. In each cycle, its first item may be removed, and a new one enters.
--
-- Each cell compares the new item with its own. Since the cells are sorted, those after the new item's place detect
-- this by their own comparison, and the place itself by that of the cell before: only the new item crosses the whole
-- segment. An item that finds no place moves to the next segment through a register, as does the removal. Whatever
-- enters or leaves here thus happens there a cycle later, in the same order. If the last cell takes an item from the
-- next segment, it takes the first one of the next cycle: a cell's, or the one in the register.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_sorted_cells is
  generic (
    CELLS     : natural;  -- 0 only without a next segment
    ITEM_BITS : positive
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    removed   : in std_logic;  -- the first cell holds an item that has been taken and now leaves
    new_valid : in std_logic;
    new_item  : in std_logic_vector(ITEM_BITS-1 downto 0);

    -- An item before the first cell, which moves there if the new one comes before it.
    before_valid : in std_logic;
    before_item  : in std_logic_vector(ITEM_BITS-1 downto 0);
    before_first : in std_logic;  -- the new item comes before it

    -- The first item in the next cycle, and whether another item would come before it.
    head_valid : out std_logic;
    head_item  : out std_logic_vector(ITEM_BITS-1 downto 0);
    other_item : in  std_logic_vector(ITEM_BITS-1 downto 0);
    other_head : out std_logic;

    -- The next segment: its inputs, and its first item, which the new item of this segment may come before.
    after_removed   : out std_logic;
    after_new_valid : out std_logic;
    after_new_item  : out std_logic_vector(ITEM_BITS-1 downto 0);
    after_valid     : in  std_logic;
    after_item      : in  std_logic_vector(ITEM_BITS-1 downto 0);
    after_first     : in  std_logic
  );
end entity firm_sched_sorted_cells;

architecture rtl of firm_sched_sorted_cells is

  -- The cells with one neighbour before them and two after them, of which the last one matters only without cells.
  type items_t is array (0 to CELLS+2) of std_logic_vector(ITEM_BITS-1 downto 0);

  signal valid    : std_logic_vector(0 to CELLS+2);
  signal item     : items_t;
  signal is_first : std_logic_vector(0 to CELLS+2);  -- the new item comes before the cell's own

  -- The first item once `removed` is done, without the new item.
  signal left_valid     : std_logic;
  signal left_item      : std_logic_vector(ITEM_BITS-1 downto 0);
  signal left_after_new : std_logic;

  signal other_before_1    : std_logic;
  signal other_before_2    : std_logic;
  signal other_before_left : std_logic;
  signal other_before_new  : std_logic;

begin

  valid(0)    <= before_valid;
  item(0)     <= before_item;
  is_first(0) <= before_first;

  valid(CELLS+1)    <= after_valid;
  item(CELLS+1)     <= after_item;
  is_first(CELLS+1) <= after_first;

  valid(CELLS+2)    <= '0';
  item(CELLS+2)     <= (others => '0');
  is_first(CELLS+2) <= '1';

  -- If the new item comes before `before_item`, that follows it, even if it is taken at the same time: as after every
  -- removal, cell 1 then holds the item to be removed.
  each_cell : for cell in 1 to CELLS generate
    signal valid_r     : std_logic;
    signal item_r      : std_logic_vector(ITEM_BITS-1 downto 0);
    signal shift_back  : std_logic;  -- away from the root: takes the item of the cell before
    signal shift_front : std_logic;  -- takes that of the next cell
    signal take_new    : std_logic;
    signal from_before : std_logic;
  begin
    valid(cell)    <= valid_r;
    item(cell)     <= item_r;
    is_first(cell) <= not valid_r or is_before(new_item, item_r);
    from_before    <= new_valid and is_first(cell-1);

    -- A removal moves all items to the front; a new item moves those after its place back again, so they stay in place.
    first : if cell = 1 generate
      shift_back  <= from_before;
      shift_front <= removed;
      take_new    <= new_valid and is_first(2) and not is_first(0) when removed = '1' else
                     new_valid and is_first(1) and not is_first(0);
    end generate first;
    others_behind : if cell > 1 generate
      shift_back  <= from_before and not removed;
      shift_front <= removed and not (new_valid and is_first(cell));
      take_new    <= new_valid and is_first(cell+1) and not is_first(cell) when removed = '1' else
                     new_valid and is_first(cell) and not is_first(cell-1);
    end generate others_behind;

    hold_item : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          valid_r <= '0';
        elsif take_new = '1' then
          valid_r <= '1';
        elsif shift_back = '1' then
          valid_r <= valid(cell-1);
        elsif shift_front = '1' then
          valid_r <= valid(cell+1);
        end if;
        if take_new = '1' then
          item_r <= new_item;
        elsif shift_back = '1' then
          item_r <= item(cell-1);
        elsif shift_front = '1' then
          item_r <= item(cell+1);
        end if;
      end if;
    end process hold_item;
  end generate each_cell;

  left_valid     <= valid(2) when removed = '1' else valid(1);
  left_item      <= item(2) when removed = '1' else item(1);
  left_after_new <= is_first(2) when removed = '1' else is_first(1);
  head_valid     <= left_valid or new_valid;
  head_item      <= new_item when new_valid = '1' and left_after_new = '1' else left_item;

  -- The other item is compared with each that may be the first one, as it is not yet known which one is.
  other_before_1    <= not valid(1) or is_before(other_item, item(1));
  other_before_2    <= not valid(2) or is_before(other_item, item(2));
  other_before_left <= other_before_2 when removed = '1' else other_before_1;
  other_before_new  <= is_before(other_item, new_item);
  other_head        <= other_before_new when new_valid = '1' and left_after_new = '1' else other_before_left;

  -- If an item is removed, the new one finds a place here unless it comes after the next segment's first item.
  hold_after : process (clk)
  begin
    if rising_edge(clk) then
      after_new_valid <= new_valid and valid(CELLS) and not (removed and after_first);
      after_removed   <= removed and not (new_valid and after_first);
      after_new_item  <= item(CELLS);
      if is_first(CELLS) = '0' then
        after_new_item <= new_item;
      end if;
      if rst_n = '0' then
        after_new_valid <= '0';
        after_removed   <= '0';
      end if;
    end if;
  end process hold_after;

end architecture rtl;
