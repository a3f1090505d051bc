-- SPDX-License-Identifier: Apache-2.0
-- Fixed priority, non-preemptive: the lowest index goes first, and a task that has begun is never interrupted.
-- The next task is chosen in the cycle of the last beat, so that ready requesters follow each other without a gap. The
-- request that the granted one shows in that cycle is its last beat's, not a new task's: it is left out. If nobody
-- else asks, the grant stays where it is, which costs nothing and serves a lone requester without a gap as well.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_sched_fixed_priority is
  generic (
    REQUESTERS : integer := 2);
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    request : in std_logic_vector(REQUESTERS-1 downto 0);
    beat    : in std_logic;  -- a beat of the granted requester is taken in this cycle
    last    : in std_logic;  -- and is its task's last; read with `beat` only

    grant_valid  : out std_logic;
    grant_select : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0));
end entity firm_sched_fixed_priority;

architecture rtl of firm_sched_fixed_priority is

  constant LEVELS : natural  := clog2(REQUESTERS);
  constant LEAVES : positive := 2**LEVELS;

  -- A binary tree as a heap: node 1 is the root, node n has the children 2n (the higher priority) and 2n+1.
  -- Of the indices, node n of level l (from the root) uses the lowest LEVELS-l bits.
  type index_tree_t is array (1 to 2*LEAVES-1) of std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
  signal any   : std_logic_vector(1 to 2*LEAVES-1);
  signal index : index_tree_t;

  signal finished : std_logic;
  signal spent    : std_logic_vector(REQUESTERS-1 downto 0);  -- the requester whose task ends in this cycle

  signal grant_valid_r  : std_logic;
  signal grant_select_r : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
  signal started_r      : std_logic;  -- the granted task has had a beat and needs more

begin

  assert REQUESTERS >= 1 and REQUESTERS <= 256
    report "firm_sched_fixed_priority: REQUESTERS is " & integer'image(REQUESTERS) & "; legal: 1 to 256"
    severity failure;

  finished <= beat and last;
  spent    <= decode(grant_select_r, finished, REQUESTERS);

  leaves_of_tree : for leaf in 0 to LEAVES-1 generate
    used : if leaf < REQUESTERS generate
      any(LEAVES+leaf) <= request(leaf) and not spent(leaf);
    end generate used;
    unused : if leaf >= REQUESTERS generate
      any(LEAVES+leaf) <= '0';
    end generate unused;
    index(LEAVES+leaf) <= (others => '0');
  end generate leaves_of_tree;

  levels_of_tree : for level in 0 to LEVELS-1 generate
    nodes : for node in natural range 2**level to 2**(level+1)-1 generate
      constant BIT_OF_LEVEL : natural := LEVELS-1-level;
    begin
      any(node) <= any(2*node) or any(2*node+1);

      below : if BIT_OF_LEVEL > 0 generate
        index(node)(BIT_OF_LEVEL-1 downto 0) <= index(2*node)(BIT_OF_LEVEL-1 downto 0) when any(2*node) = '1' else
                                                index(2*node+1)(BIT_OF_LEVEL-1 downto 0);
      end generate below;
      index(node)(BIT_OF_LEVEL) <= not any(2*node);
      above : if level > 0 generate
        index(node)(LEVELS-1 downto BIT_OF_LEVEL+1) <= (others => '0');
      end generate above;
    end generate nodes;
  end generate levels_of_tree;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        grant_valid_r  <= '0';
        grant_select_r <= (others => '0');
        started_r      <= '0';
      elsif finished = '1' or (started_r = '0' and beat = '0') then
        started_r     <= '0';
        grant_valid_r <= grant_valid_r or any(1);
        if any(1) = '1' then
          grant_select_r <= index(1);
        end if;
      else
        started_r <= '1';
      end if;
    end if;
  end process choose;

  grant_valid  <= grant_valid_r;
  grant_select <= grant_select_r;

end architecture rtl;
