-- SPDX-License-Identifier: Apache-2.0
-- Least recently used, non-preemptive: of those that request, the one whose last task ended the longest time ago.
-- Up to 16 requesters are compared in parallel; more requesters wait in a heap in distributed RAM.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_lru is
  generic (
    REQUESTERS : integer := 2
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
end entity firm_sched_lru;

architecture rtl of firm_sched_lru is

  constant FEW : positive := 16;

begin

  assert fault_of_size(REQUESTERS) = ""
    report "firm_sched_lru: " & fault_of_size(REQUESTERS)
    severity failure;

  of_few : if REQUESTERS >= 1 and REQUESTERS <= FEW generate
    u_matrix : entity firm.firm_sched_age_matrix
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
  end generate of_few;

  of_many : if REQUESTERS > FEW generate
    u_engine : entity firm.firm_sched_engine
      generic map (
        REQUESTERS => REQUESTERS,
        POLICY     => LRU
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
