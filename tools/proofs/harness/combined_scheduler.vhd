-- SPDX-License-Identifier: Apache-2.0
-- A scheduler of schedulers to be proved: two groups of half of the requesters each.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity combined_scheduler is
  generic (
    REQUESTERS : integer := 4
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
end entity combined_scheduler;

architecture rtl of combined_scheduler is

  constant SIZES    : times_t(0 to 1)    := (REQUESTERS/2, REQUESTERS - REQUESTERS/2);
  constant POLICIES : policies_t(0 to 1) := (LRU, FIXED_PRIORITY);

begin

  u_scheduler : entity firm.firm_sched_combined
    generic map (
      REQUESTERS => REQUESTERS,
      SIZES      => SIZES,
      POLICIES   => POLICIES,
      TOP_POLICY => ROUND_ROBIN
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
