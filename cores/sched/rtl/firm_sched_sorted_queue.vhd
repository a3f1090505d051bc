-- SPDX-License-Identifier: Apache-2.0
-- A priority queue of few cycles: a shift register that is kept sorted, with the ports of firm_sched_heap.
--
-- An insert and a pop take one cycle each, even at the same time, and the next root is valid in the next cycle. `pop`
-- arrives late: the root is prepared for both cases, and selected a cycle later, when the other cells move. Until then,
-- the first of them still holds the item that has become the root.
-- Many cells are divided into segments. An item reaches them one after another, a cycle later each, so that it need not
-- cross the whole queue in a cycle (a systolic array of shift registers; S.-W. Moon, J. Rexford, K. G. Shin, "Scalable
-- hardware priority queue architectures for high-speed packet switches", IEEE Transactions on Computers 49 (11), 2000).
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_sorted_queue is
  generic (
    ITEMS    : positive;
    KEY_BITS : positive;
    SEGMENT  : positive := SEGMENT_ITEMS  -- items of a segment, 2 or more; as many as two need no segments
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

  constant ID_BITS   : positive := index_bits(ITEMS);
  constant ITEM_BITS : positive := KEY_BITS + ID_BITS;

  -- The first segment, which the scheduler reads, is short, so that the others need not be near the scheduler.
  constant FIRST : positive := max(SEGMENT / 4, 2);

  function segments_of return positive is
  begin
    if ITEMS <= 2 * SEGMENT then
      return 1;
    end if;
    return 1 + (ITEMS - FIRST + SEGMENT - 1) / SEGMENT;
  end function segments_of;

  constant SEGMENTS : positive := segments_of;

  -- The root is an item of the first segment; the last segment has the rest.
  function cells_of(segment_index : natural) return natural is
  begin
    if SEGMENTS = 1 then
      return ITEMS - 1;
    elsif segment_index = 0 then
      return FIRST - 1;
    elsif segment_index = SEGMENTS-1 then
      return ITEMS - FIRST - (SEGMENTS-2) * SEGMENT;
    end if;
    return SEGMENT;
  end function cells_of;

  type items_t is array (natural range <>) of std_logic_vector(ITEM_BITS-1 downto 0);

  -- The root after a pop, and without one.
  signal popped_r          : std_logic;  -- there was a pop in the last cycle: cell 1 holds the root
  signal valid_if_popped_r : std_logic;
  signal valid_if_kept_r   : std_logic;
  signal item_if_popped_r  : std_logic_vector(ITEM_BITS-1 downto 0);
  signal item_if_kept_r    : std_logic_vector(ITEM_BITS-1 downto 0);

  -- The inputs of each segment: the root is before the first one. The last index belongs to a segment that is never
  -- needed.
  signal before_valid : std_logic_vector(0 to SEGMENTS-1);
  signal before_item  : items_t(0 to SEGMENTS-1);
  signal before_first : std_logic_vector(0 to SEGMENTS-1);
  signal removed      : std_logic_vector(0 to SEGMENTS);
  signal new_valid    : std_logic_vector(0 to SEGMENTS);
  signal new_item     : items_t(0 to SEGMENTS);

  -- Its first item in the next cycle; whether the new item of the segment before comes before that.
  signal head_valid : std_logic_vector(0 to SEGMENTS);
  signal head_item  : items_t(0 to SEGMENTS);
  signal new_head   : std_logic_vector(0 to SEGMENTS);

begin

  before_valid(0) <= valid_if_popped_r when popped_r = '1' else valid_if_kept_r;
  before_item(0)  <= item_if_popped_r when popped_r = '1' else item_if_kept_r;
  before_first(0) <= not before_valid(0) or is_before(new_item(0), before_item(0));
  removed(0)      <= popped_r;
  new_valid(0)    <= insert_valid;
  new_item(0)     <= insert_key & insert_id;

  hold_root : process (clk)
  begin
    if rising_edge(clk) then
      popped_r          <= pop;
      valid_if_popped_r <= head_valid(0);
      valid_if_kept_r   <= before_valid(0) or insert;
      item_if_popped_r  <= head_item(0);
      item_if_kept_r    <= before_item(0);
      if insert_valid = '1' and before_first(0) = '1' then
        item_if_kept_r <= new_item(0);
      end if;
      if rst_n = '0' then
        popped_r        <= '0';
        valid_if_kept_r <= '0';
      end if;
    end if;
  end process hold_root;

  -- An item leaves a segment only if none of its items comes after it, so that it has no neighbour before the next one.
  each_segment : for segment_index in 0 to SEGMENTS-1 generate
    not_first : if segment_index > 0 generate
      before_valid(segment_index) <= '0';
      before_item(segment_index)  <= (others => '0');
      before_first(segment_index) <= '0';
    end generate not_first;

    u_cells : entity firm.firm_sched_sorted_cells
      generic map (
        CELLS     => cells_of(segment_index),
        ITEM_BITS => ITEM_BITS
      )
      port map (
        clk             => clk,
        rst_n           => rst_n,
        removed         => removed(segment_index),
        new_valid       => new_valid(segment_index),
        new_item        => new_item(segment_index),
        before_valid    => before_valid(segment_index),
        before_item     => before_item(segment_index),
        before_first    => before_first(segment_index),
        head_valid      => head_valid(segment_index),
        head_item       => head_item(segment_index),
        other_item      => new_item(max(segment_index-1, 0)),
        other_head      => new_head(segment_index),
        after_removed   => removed(segment_index+1),
        after_new_valid => new_valid(segment_index+1),
        after_new_item  => new_item(segment_index+1),
        after_valid     => head_valid(segment_index+1),
        after_item      => head_item(segment_index+1),
        after_first     => new_head(segment_index+1)
      );
  end generate each_segment;

  head_valid(SEGMENTS) <= '0';
  head_item(SEGMENTS)  <= (others => '0');
  new_head(SEGMENTS)   <= '1';

  insert_ready <= '1';
  root_valid   <= before_valid(0);
  root_id      <= before_item(0)(ID_BITS-1 downto 0);
  root_key     <= before_item(0)(ITEM_BITS-1 downto ID_BITS);
  first_valid  <= before_valid(0);
  first_id     <= before_item(0)(ID_BITS-1 downto 0);
  first_key    <= before_item(0)(ITEM_BITS-1 downto ID_BITS);
  empty        <= not before_valid(0);

end architecture rtl;
