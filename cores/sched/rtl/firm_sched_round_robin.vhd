-- SPDX-License-Identifier: Apache-2.0
-- Round robin, non-preemptive: the next index after the one that has the grant, cyclically.
-- The next task is chosen in the cycle of the last beat. The finishing requester needs no exclusion: it is the last in
-- the round, so it is chosen only if there are no other requests, which leaves the grant where it is. A granted request
-- keeps the grant until its task is finished, so the search always begins at the grant. The Manager selects `beat` and
-- `last` by the grant. They arrive late, and only decide whether the choice becomes the grant.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_round_robin is
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
end entity firm_sched_round_robin;

architecture rtl of firm_sched_round_robin is

  signal finished : std_logic;
  signal offered  : std_logic;  -- the granted requester's request
  signal found    : std_logic;
  signal choice   : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
  signal moves    : std_logic;  -- the choice becomes the grant

  signal grant_valid_r  : std_logic;
  signal grant_select_r : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
  signal started_r      : std_logic;  -- the granted task has had a beat and needs more

begin

  assert fault_of_size(REQUESTERS) = ""
    report "firm_sched_round_robin: " & fault_of_size(REQUESTERS)
    severity failure;

  finished <= beat and last;
  moves    <= found and (finished or not (started_r or (grant_valid_r and offered)));

  u_choice : entity firm.firm_sched_following
    generic map (
      REQUESTERS => REQUESTERS
    )
    port map (
      request   => request,
      index     => grant_select_r,
      asks      => offered,
      found     => found,
      following => choice
    );

  choose : process (clk)
  begin
    if rising_edge(clk) then
      started_r <= (started_r or beat) and not finished;
      if moves = '1' then
        grant_valid_r  <= '1';
        grant_select_r <= choice;
      end if;
      if rst_n = '0' then
        started_r      <= '0';
        grant_valid_r  <= '0';
        -- Index 0 comes first.
        grant_select_r <= std_logic_vector(to_unsigned(REQUESTERS-1, grant_select_r'length));
      end if;
    end if;
  end process choose;

  grant_valid  <= grant_valid_r;
  grant_select <= grant_select_r;

end architecture rtl;
