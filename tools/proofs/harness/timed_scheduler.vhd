-- SPDX-License-Identifier: Apache-2.0
-- A scheduler with deadlines to be proved: GHDL's command line has no generics that are arrays or of an enumeration type.
-- Deadlines are short, so that tasks preempt each other within few cycles.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity timed_scheduler is
  generic (
    POLICY       : integer := 4;  -- its place in policy_t
    REQUESTERS   : integer := 2;
    SHORTEST_RUN : integer := 1
  );
  port (
    clk          : in  std_logic;
    rst_n        : in  std_logic;
    request      : in  std_logic_vector(REQUESTERS-1 downto 0);
    beat         : in  std_logic;
    last         : in  std_logic;
    grant_valid  : out std_logic;
    grant_select : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0)
  );
end entity timed_scheduler;

architecture rtl of timed_scheduler is

  function falling_from(first : positive) return times_t is
    variable times : times_t(0 to REQUESTERS-1);
  begin
    for requester in times'range loop
      times(requester) := first - 2*requester;
    end loop;
    return times;
  end function falling_from;

begin

  u_scheduler : entity firm.firm_sched_by_policy
    generic map (
      POLICY         => policy_t'val(POLICY),
      REQUESTERS     => REQUESTERS,
      PERIODS        => falling_from(12),
      TRANSFER_TIMES => falling_from(9),
      TIME_BITS      => 8,
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

end architecture rtl;
