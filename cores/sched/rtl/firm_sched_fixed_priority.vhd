-- SPDX-License-Identifier: Apache-2.0
-- Fixed priority: the lowest index goes first. If non-preemptive, a task that has begun is never interrupted. If
-- preemptive, each request of a higher priority interrupts it, but only after SHORTEST_RUN of its beats in a row.
-- The next task is chosen in the cycle of the last beat, so that ready requesters follow each other without a gap. The
-- request of the granted one in that cycle belongs to its last beat, not to a new task, and is ignored. Without other
-- requests, the grant stays where it is, which costs nothing and serves a lone requester without a gap.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_fixed_priority is
  generic (
    REQUESTERS : integer := 2;
    PREEMPTIVE : boolean := false;
    -- In beats; only if preemptive. A requester that pauses may be interrupted earlier.
    SHORTEST_RUN : integer := 1
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
end entity firm_sched_fixed_priority;

architecture rtl of firm_sched_fixed_priority is

  signal finished  : std_logic;
  signal offered   : std_logic;  -- the granted requester's request
  signal found     : std_logic;  -- another requester requests
  signal is_before : std_logic;  -- one of a higher priority requests
  signal choice    : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);  -- of the others
  signal kept      : std_logic;  -- the granted requester keeps the grant until its task is finished
  signal moves     : std_logic;  -- the choice becomes the grant

  signal grant_valid_r  : std_logic;
  signal grant_select_r : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);

begin

  assert fault_of_size(REQUESTERS) = ""
    report "firm_sched_fixed_priority: " & fault_of_size(REQUESTERS)
    severity failure;

  assert fault_of_run(SHORTEST_RUN) = ""
    report "firm_sched_fixed_priority: " & fault_of_run(SHORTEST_RUN)
    severity failure;

  -- The Manager selects `beat` and `last` by the grant, so they arrive late and are kept out of the choice.
  finished <= beat and last;
  moves    <= found and (finished or (not kept and (is_before or not offered)));

  u_choice : entity firm.firm_sched_lowest
    generic map (
      REQUESTERS => REQUESTERS
    )
    port map (
      request     => request,
      index       => grant_select_r,
      index_valid => grant_valid_r,
      asks        => offered,
      found       => found,
      is_before   => is_before,
      lowest      => choice
    );

  whole_tasks : if not PREEMPTIVE generate
    signal started_r : std_logic;  -- the granted task has had a beat and needs more
  begin
    kept <= started_r or beat;

    follow_task : process (clk)
    begin
      if rising_edge(clk) then
        started_r <= kept and not finished and rst_n;
      end if;
    end process follow_task;
  end generate whole_tasks;

  any_beat : if PREEMPTIVE and SHORTEST_RUN <= 1 generate
    kept <= '0';
  end generate any_beat;

  whole_runs : if PREEMPTIVE and SHORTEST_RUN > 1 generate
    subtype beats_t is natural range 0 to SHORTEST_RUN;
    signal beats   : beats_t;
    signal beats_r : beats_t;                       -- of the run, saturating at the shortest run
  begin
    beats <= beats_r + 1 when beat = '1' and beats_r < SHORTEST_RUN else beats_r;
    kept  <= offered when beats > 0 and beats < SHORTEST_RUN else '0';

    follow_run : process (clk)
    begin
      if rising_edge(clk) then
        beats_r <= beats;
        if rst_n = '0' or finished = '1' or moves = '1' then
          beats_r <= 0;
        end if;
      end if;
    end process follow_run;
  end generate whole_runs;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      if moves = '1' then
        grant_valid_r  <= '1';
        grant_select_r <= choice;
      end if;
      if rst_n = '0' then
        grant_valid_r  <= '0';
        grant_select_r <= (others => '0');
      end if;
    end if;
  end process choose;

  grant_valid  <= grant_valid_r;
  grant_select <= grant_select_r;

end architecture rtl;
