-- SPDX-License-Identifier: Apache-2.0
-- A priority queue of few LUTs: a heap in distributed RAM, of items with distinct indices.
--
-- Item i is always on the path from the root to leaf i. A node therefore holds only the bits of the index that are not
-- its own address, and there is always room. INSERT goes down the item's path: at each node the item that goes first
-- stays, and the other continues on its own path. After a pop, the smaller of the two nodes below fills the hole, and
-- its own hole is filled in turn. Each operation is at one level per cycle, and several follow each other
-- down. The root is a register: it is always the item that goes first, except in the cycle after a pop, when it is
-- refilled. The item that fills it can be popped in that cycle, too; then the root is filled two cycles later.
-- The RAM keeps its content during a reset. The nodes are therefore cleared after it, one path to a pair of leaves per
-- cycle.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_heap is
  generic (
    ITEMS    : positive;
    KEY_BITS : positive
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- An item that is not in the queue. Keys in the queue are less than half their range apart.
    insert_valid : in  std_logic;  -- an item is offered
    insert_ready : out std_logic;  -- it can enter, unless there is a pop in this cycle
    insert       : in  std_logic;  -- it enters; otherwise, it may stay offered only if it cannot, or there is no root
    insert_id    : in  std_logic_vector(index_bits(ITEMS)-1 downto 0);
    insert_key   : in  std_logic_vector(KEY_BITS-1 downto 0);

    -- The item with the smallest key; among equals, the lowest index.
    root_valid : out std_logic;
    root_id    : out std_logic_vector(index_bits(ITEMS)-1 downto 0);
    root_key   : out std_logic_vector(KEY_BITS-1 downto 0);
    -- The root if it is valid, otherwise the item that becomes the root in this cycle.
    first_valid : out std_logic;
    first_id    : out std_logic_vector(index_bits(ITEMS)-1 downto 0);
    first_key   : out std_logic_vector(KEY_BITS-1 downto 0);
    pop         : in  std_logic;    -- takes that item; only while it is valid
    empty       : out std_logic     -- the queue is empty; while '0', a root is valid or about to be
  );
end entity firm_sched_heap;

architecture rtl of firm_sched_heap is

  constant LEVELS : positive := index_bits(ITEMS);
  subtype id_t is std_logic_vector(LEVELS-1 downto 0);
  subtype key_t is std_logic_vector(KEY_BITS-1 downto 0);
  type ids_t is array (natural range <>) of id_t;
  type keys_t is array (natural range <>) of key_t;

  signal root_valid_r : std_logic;
  signal root_id_r    : id_t;
  signal root_key_r   : key_t;
  signal filling_r    : std_logic;  -- the level below determines the root of the next cycle
  signal owing_r      : std_logic;  -- that was popped in the last cycle
  signal fill         : std_logic;

  signal cleared_r : unsigned(LEVELS downto 0);  -- the next index whose path is to be cleared; the highest bit: all are
  signal clearing  : std_logic;

  signal root_stays : std_logic;

  -- The operation for level n, and the item with which level n+1 fills a hole of level n; the root is level 0.
  signal down_insert : std_logic_vector(1 to LEVELS+1);
  signal down_fill   : std_logic_vector(1 to LEVELS+1);
  signal down_clear  : std_logic_vector(1 to LEVELS+1);
  signal down_id     : ids_t(1 to LEVELS+1);
  signal down_key    : keys_t(1 to LEVELS+1);
  signal up_valid    : std_logic_vector(0 to LEVELS);
  signal up_id       : ids_t(0 to LEVELS);
  signal up_key      : keys_t(0 to LEVELS);
  signal hole_r      : std_logic_vector(1 to LEVELS);
  signal hole_right  : std_logic_vector(1 to LEVELS);

begin

  clearing     <= not cleared_r(LEVELS);
  insert_ready <= not (filling_r or owing_r or clearing);
  fill         <= (pop and not filling_r) or owing_r;
  root_stays   <= root_valid_r and is_before(root_key_r & root_id_r, insert_key & insert_id);

  hold_root : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        root_valid_r <= '0';
        filling_r    <= '0';
        owing_r      <= '0';
        cleared_r    <= (others => '0');
      else
        filling_r <= fill;
        owing_r   <= pop and filling_r;
        if clearing = '1' then
          cleared_r <= cleared_r + 2;
        end if;
        root_valid_r <= not pop and ((filling_r and up_valid(0)) or (not filling_r and (root_valid_r or insert)));
      end if;
      -- `pop` and `insert` arrive late. Where an offered item does not enter, there is no root in the next cycle, or
      -- it is being filled, so its content does not depend on them.
      if filling_r = '1' then
        root_id_r  <= up_id(0);
        root_key_r <= up_key(0);
      elsif insert_valid = '1' and root_stays = '0' then
        root_id_r  <= insert_id;
        root_key_r <= insert_key;
      end if;
    end if;
  end process hold_root;

  down_insert(1) <= insert and root_valid_r;
  down_fill(1)   <= fill;
  down_clear(1)  <= clearing;
  down_id(1)     <= std_logic_vector(cleared_r(LEVELS-1 downto 0)) when clearing = '1' else
                    insert_id when root_stays = '1' else
                    root_id_r;
  down_key(1)    <= insert_key when root_stays = '1' else root_key_r;

  levels_below : for level in 1 to LEVELS generate
    u_level : entity firm.firm_sched_heap_level
      generic map (
        LEVEL    => level,
        ID_BITS  => LEVELS,
        KEY_BITS => KEY_BITS
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        insert        => down_insert(level),
        fill          => down_fill(level),
        clear         => down_clear(level),
        id            => down_id(level),
        key           => down_key(level),
        smaller_valid => up_valid(level-1),
        smaller_id    => up_id(level-1),
        smaller_key   => up_key(level-1),
        below_insert  => down_insert(level+1),
        below_fill    => down_fill(level+1),
        below_clear   => down_clear(level+1),
        below_id      => down_id(level+1),
        below_key     => down_key(level+1),
        hole          => hole_r(level),
        hole_right    => hole_right(level),
        filler_valid  => up_valid(level),
        filler_id     => up_id(level),
        filler_key    => up_key(level)
      );

    note_hole : process (clk)
    begin
      if rising_edge(clk) then
        hole_r(level)     <= rst_n and down_fill(level+1);
        hole_right(level) <= down_id(level+1)(LEVELS-level);
      end if;
    end process note_hole;
  end generate levels_below;

  -- There is no level below the leaves.
  up_valid(LEVELS) <= '0';
  up_id(LEVELS)    <= (others => '0');
  up_key(LEVELS)   <= (others => '0');

  root_valid <= root_valid_r;
  root_id    <= root_id_r;
  root_key   <= root_key_r;
  first_valid <= root_valid_r or (filling_r and up_valid(0));
  first_id    <= up_id(0) when filling_r = '1' else root_id_r;
  first_key   <= up_key(0) when filling_r = '1' else root_key_r;
  empty      <= not (root_valid_r or filling_r or owing_r);

end architecture rtl;
