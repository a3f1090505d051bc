-- SPDX-License-Identifier: Apache-2.0
-- The scheduler of a policy with deadlines for few requesters: the urgency of every task is in a register, and a tree
-- compares all of them in every cycle.
-- A task is accepted in the cycle in which it is first seen, independently of others, and takes part in the choice in
-- the next. The most urgent task has the grant; among equals, the task that has it, otherwise the lowest index. Without
-- an accepted task, the grant stays.
-- Urgency is the time by which a task is past its deadline (EDF) or its latest start (LST), negative before: the
-- order is that of the keys of firm_sched_engine. It begins with a constant of the requester and grows by one per
-- cycle. Each is therefore a counter with a reset, which costs its carry chain and hardly a LUT. No task grows more
-- urgent while one is overdue, so the order is right for any behaviour of the host.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_parallel is
  generic (
    REQUESTERS     : integer := 2;
    SENDS_OWN_TIME : boolean := false;  -- a task does not grow more urgent in the cycles in which it sends
    OFFSETS        : times_t := IMPLICIT;  -- from the cycle in which a task arrives until its urgency is 0
    TIME_BITS      : integer := 16;
    SHORTEST_RUN   : integer := 1
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    request : in std_logic_vector(REQUESTERS-1 downto 0);
    beat    : in std_logic;  -- a beat of the granted requester is taken in this cycle
    last    : in std_logic;  -- and is its task's last; read with `beat` only

    grant_valid  : out std_logic;
    grant_select : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0)
  );
end entity firm_sched_parallel;

architecture rtl of firm_sched_parallel is

  -- No two urgencies differ by half of this range or more: each begins less than a quarter of it below 0, and all stop
  -- growing when one is a quarter of it above 0.
  constant URGENCY_BITS : positive := max(TIME_BITS-1, 2);
  constant LEVELS       : positive := index_bits(REQUESTERS);
  constant LEAVES       : positive := 2**LEVELS;
  subtype urgency_t is std_logic_vector(URGENCY_BITS-1 downto 0);
  subtype id_t is std_logic_vector(LEVELS-1 downto 0);

  -- Node 1 is the root; node n has the children 2n and 2n+1, of which the first has the lower indices.
  -- The bit after the urgency is '1' for the task that has the grant, so that it goes before equal ones.
  type ranks_t is array (1 to 2*LEAVES-1) of std_logic_vector(URGENCY_BITS downto 0);
  type ids_t is array (1 to 2*LEAVES-1) of id_t;
  signal valid : std_logic_vector(1 to 2*LEAVES-1);
  signal rank  : ranks_t;
  signal id    : ids_t;

  signal overdue : std_logic_vector(LEAVES-1 downto 0);  -- urgent by a quarter of the range
  signal advance : std_logic;

  signal idle_r   : std_logic_vector(LEAVES-1 downto 0);  -- no task is accepted
  signal current  : std_logic_vector(LEAVES-1 downto 0);
  signal finished : std_logic;
  signal kept     : std_logic;

  signal grant_valid_r  : std_logic;
  signal grant_select_r : id_t;

begin

  finished <= beat and last;
  current  <= decode(grant_select_r, '1', LEAVES);
  advance  <= not any_of(overdue);

  leaves_of_tree : for leaf in 0 to LEAVES-1 generate
    used : if leaf < REQUESTERS generate
      constant FIRST_URGENCY : urgency_t := std_logic_vector(to_signed(-time_of(leaf, OFFSETS), URGENCY_BITS));

      signal urgency_r : urgency_t;
      signal grows     : std_logic;
    begin
      grows <= advance and not (current(leaf) and beat) when SENDS_OWN_TIME else advance;

      hold_task : process (clk)
      begin
        if rising_edge(clk) then
          if rst_n = '0' then
            idle_r(leaf) <= '1';
          else
            idle_r(leaf) <= (idle_r(leaf) and not request(leaf)) or (current(leaf) and finished);
          end if;
          if idle_r(leaf) = '1' then
            urgency_r <= FIRST_URGENCY;
          elsif grows = '1' then
            urgency_r <= std_logic_vector(unsigned(urgency_r) + 1);
          end if;
        end if;
      end process hold_task;

      overdue(leaf)      <= urgency_r(URGENCY_BITS-2) and not urgency_r(URGENCY_BITS-1);
      valid(LEAVES+leaf) <= not idle_r(leaf) and not (current(leaf) and finished);
      rank(LEAVES+leaf)  <= urgency_r & current(leaf);
    end generate used;

    unused : if leaf >= REQUESTERS generate
      idle_r(leaf)       <= '1';
      overdue(leaf)      <= '0';
      valid(LEAVES+leaf) <= '0';
      rank(LEAVES+leaf)  <= (others => '0');
    end generate unused;

    id(LEAVES+leaf) <= (others => '0');
  end generate leaves_of_tree;

  levels_of_tree : for level in 0 to LEVELS-1 generate
    nodes : for node in natural range 2**level to 2**(level+1)-1 generate
      signal takes_right : std_logic;
    begin
      takes_right <= valid(2*node+1) and (not valid(2*node) or is_before(rank(2*node), rank(2*node+1)));

      valid(node) <= valid(2*node) or valid(2*node+1);
      rank(node)  <= rank(2*node+1) when takes_right = '1' else rank(2*node);

      hand_up : process (takes_right, id)
      begin
        id(node) <= id(2*node);
        if takes_right = '1' then
          id(node) <= id(2*node+1);
        end if;
        id(node)(LEVELS-1-level) <= takes_right;
      end process hand_up;
    end generate nodes;
  end generate levels_of_tree;

  runs_of_one : if SHORTEST_RUN <= 1 generate
    kept <= '0';
  end generate runs_of_one;
  longer_runs : if SHORTEST_RUN > 1 generate
    signal beats_r : natural range 0 to SHORTEST_RUN;  -- of the run, saturating at the shortest run
    signal beats   : natural range 0 to SHORTEST_RUN;  -- including that of this cycle
  begin
    beats <= beats_r + 1 when beat = '1' and beats_r < SHORTEST_RUN else beats_r;
    kept  <= any_of(request and current(REQUESTERS-1 downto 0)) and not finished
             when beats > 0 and beats < SHORTEST_RUN else
             '0';

    count_beats : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' or finished = '1' or (valid(1) = '1' and kept = '0' and id(1) /= grant_select_r) then
          beats_r <= 0;
        else
          beats_r <= beats;
        end if;
      end if;
    end process count_beats;
  end generate longer_runs;

  grant : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        grant_valid_r  <= '0';
        grant_select_r <= (others => '0');
      elsif valid(1) = '1' and kept = '0' then
        grant_valid_r  <= '1';
        grant_select_r <= id(1);
      end if;
    end if;
  end process grant;

  grant_valid  <= grant_valid_r;
  grant_select <= grant_select_r;

end architecture rtl;
