-- SPDX-License-Identifier: Apache-2.0
-- The scheduler of a policy that is a generic. It has the generics of all policies; each takes those that it knows.
-- `make policies` writes this file from by_policy.vhd.mustache and fusesoc_firm/scheduling/policies.py.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_by_policy is
  generic (
    POLICY         : policy_t := FIXED_PRIORITY;
    REQUESTERS     : integer  := 2;
    PERIODS        : times_t  := IMPLICIT;
    TRANSFER_TIMES : times_t  := IMPLICIT;
    DEADLINES      : times_t  := IMPLICIT;
    TIME_BITS      : integer  := 16;
    SHORTEST_RUN   : integer  := 1
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
end entity firm_sched_by_policy;

architecture rtl of firm_sched_by_policy is

begin

  of_fixed_priority : if POLICY = FIXED_PRIORITY generate
    u_scheduler : entity firm.firm_sched_fixed_priority
      generic map (
        REQUESTERS => REQUESTERS
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
  end generate of_fixed_priority;

  of_fixed_priority_preemptive : if POLICY = FIXED_PRIORITY_PREEMPTIVE generate
    u_scheduler : entity firm.firm_sched_fixed_priority
      generic map (
        REQUESTERS   => REQUESTERS,
        PREEMPTIVE   => true,
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
  end generate of_fixed_priority_preemptive;

  of_round_robin : if POLICY = ROUND_ROBIN generate
    u_scheduler : entity firm.firm_sched_round_robin
      generic map (
        REQUESTERS => REQUESTERS
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
  end generate of_round_robin;

  of_lru : if POLICY = LRU generate
    u_scheduler : entity firm.firm_sched_lru
      generic map (
        REQUESTERS => REQUESTERS
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
  end generate of_lru;

  of_edf_resources : if POLICY = EDF_RESOURCES generate
    u_scheduler : entity firm.firm_sched_edf_resources
      generic map (
        REQUESTERS   => REQUESTERS,
        PERIODS      => PERIODS,
        DEADLINES    => DEADLINES,
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
  end generate of_edf_resources;

  of_edf_latency : if POLICY = EDF_LATENCY generate
    u_scheduler : entity firm.firm_sched_edf_latency
      generic map (
        REQUESTERS   => REQUESTERS,
        PERIODS      => PERIODS,
        DEADLINES    => DEADLINES,
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
  end generate of_edf_latency;

  of_lst : if POLICY = LST generate
    u_scheduler : entity firm.firm_sched_lst
      generic map (
        REQUESTERS     => REQUESTERS,
        PERIODS        => PERIODS,
        DEADLINES      => DEADLINES,
        TRANSFER_TIMES => TRANSFER_TIMES,
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
  end generate of_lst;

end architecture rtl;
