-- SPDX-License-Identifier: Apache-2.0
-- Least slack time first, preemptive: the task with the earliest latest start goes first. Up to 8 requesters are
-- compared in parallel; more requesters wait in a heap in distributed RAM.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_lst is
  generic (
    REQUESTERS     : integer := 2;
    PERIODS        : times_t;
    TRANSFER_TIMES : times_t;  -- beats of a task
    DEADLINES      : times_t := IMPLICIT;
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
end entity firm_sched_lst;

architecture rtl of firm_sched_lst is

  constant FEW : positive := 8;

  constant FAULT          : string := fault_of_deadlines(REQUESTERS, PERIODS, DEADLINES, TIME_BITS, SHORTEST_RUN);
  constant TRANSFER_FAULT : string := fault_of_transfer(TRANSFER_TIMES, REQUESTERS, TIME_BITS);

  -- A task's slack: the time left until its deadline if it is sent at once.
  constant OFFSETS : times_t :=
    slacks_of(REQUESTERS, deadlines_of(REQUESTERS, PERIODS, DEADLINES), TRANSFER_TIMES);

begin

  assert FAULT = ""
    report "firm_sched_lst: " & FAULT
    severity failure;

  assert FAULT /= "" or TRANSFER_FAULT = ""
    report "firm_sched_lst: " & TRANSFER_FAULT
    severity failure;

  of_few : if REQUESTERS >= 1 and REQUESTERS <= FEW generate
    u_parallel : entity firm.firm_sched_parallel
      generic map (
        REQUESTERS     => REQUESTERS,
        SENDS_OWN_TIME => true,
        OFFSETS        => OFFSETS,
        TIME_BITS      => TIME_BITS,
        SHORTEST_RUN   => SHORTEST_RUN
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        request      => request,
        beat         => beat,
        last         => last,
        grant_valid  => grant_valid,
        grant_select => grant_select
      );
  end generate of_few;

  of_many : if REQUESTERS > FEW generate
    u_engine : entity firm.firm_sched_engine
      generic map (
        REQUESTERS   => REQUESTERS,
        POLICY       => LST,
        OFFSETS      => OFFSETS,
        TIME_BITS    => TIME_BITS,
        SHORTEST_RUN => SHORTEST_RUN
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        request      => request,
        beat         => beat,
        last         => last,
        grant_valid  => grant_valid,
        grant_select => grant_select
      );
  end generate of_many;

end architecture rtl;
