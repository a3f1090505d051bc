-- SPDX-License-Identifier: Apache-2.0
-- A scheduler of schedulers: requesters form groups, each with its own scheduler, and one more scheduler chooses among
-- the groups. A group requests if the requester that its scheduler grants does. A group that is not chosen sees no
-- beats, as if the sink were not ready.
-- The index of the granted requester is selected among those of the groups: registers, followed by a multiplexer.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_combined is
  generic (
    REQUESTERS : integer := 2;
    -- For each group: the number of its requesters, the lowest indices first, and its policy.
    SIZES      : times_t    := (1, 1);
    POLICIES   : policies_t := (LRU, LRU);
    -- The policy among the groups; one without deadlines, since a group has none.
    TOP_POLICY : policy_t := LRU;
    -- For the policies that use them; one time for each requester.
    PERIODS        : times_t := IMPLICIT;
    TRANSFER_TIMES : times_t := IMPLICIT;
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
end entity firm_sched_combined;

architecture rtl of firm_sched_combined is

  constant GROUPS      : positive := max(1, SIZES'length);
  constant SELECT_BITS : positive := index_bits(REQUESTERS);

  function found_fault return string is
  begin
    if fault_of_size(REQUESTERS) /= "" then
      return fault_of_size(REQUESTERS);
    elsif fault_of_groups(REQUESTERS, SIZES, POLICIES, TOP_POLICY) /= "" then
      return fault_of_groups(REQUESTERS, SIZES, POLICIES, TOP_POLICY);
    end if;
    return fault_of_group_times(REQUESTERS, POLICIES, PERIODS, TRANSFER_TIMES, DEADLINES, TIME_BITS, SHORTEST_RUN);
  end function found_fault;

  constant FAULT    : string  := found_fault;
  constant IS_LEGAL : boolean := FAULT = "";

  signal group_valid   : std_logic_vector(GROUPS-1 downto 0);
  signal group_request : std_logic_vector(GROUPS-1 downto 0);
  signal group_beat    : std_logic_vector(GROUPS-1 downto 0);
  signal group_choices : std_logic_vector(GROUPS*SELECT_BITS-1 downto 0);  -- of each the index among all requesters

  signal top_select : std_logic_vector(index_bits(GROUPS)-1 downto 0);

begin

  assert FAULT = ""
    report "firm_sched_combined: " & FAULT
    severity failure;

  group_beat <= decode(top_select, beat, GROUPS);

  -- Ranges that do not fit would end the elaboration before an assert can report them.
  each_group : for group_index in 0 to GROUPS-1 generate
    legal : if IS_LEGAL generate
      constant SIZE  : positive := time_of(group_index, SIZES);
      constant FIRST : natural  := sum_of(SIZES, group_index);

      signal choice  : std_logic_vector(index_bits(SIZE)-1 downto 0);
      signal offered : std_logic_vector(0 downto 0);
    begin
      u_group : entity firm.firm_sched_by_policy
        generic map (
          POLICY         => POLICIES(POLICIES'low+group_index),
          REQUESTERS     => SIZE,
          PERIODS        => part_of(PERIODS, FIRST, SIZE),
          TRANSFER_TIMES => part_of(TRANSFER_TIMES, FIRST, SIZE),
          DEADLINES      => part_of(DEADLINES, FIRST, SIZE),
          TIME_BITS      => TIME_BITS,
          SHORTEST_RUN   => SHORTEST_RUN
        )
        port map (
          clk          => clk,
          rst_n        => rst_n,
          request      => request(FIRST+SIZE-1 downto FIRST),
          beat         => group_beat(group_index),
          last         => last,
          grant_valid  => group_valid(group_index),
          grant_select => choice
        );

      u_offered : entity firm.firm_axis_select
        generic map (
          WORDS => SIZE,
          WIDTH => 1
        )
        port map (
          words_in => request(FIRST+SIZE-1 downto FIRST),
          index    => choice,
          word     => offered
        );

      group_request(group_index) <= group_valid(group_index) and offered(0);

      group_choices((group_index+1)*SELECT_BITS-1 downto group_index*SELECT_BITS) <=
        std_logic_vector(resize(unsigned(choice), SELECT_BITS) + FIRST);
    end generate legal;
  end generate each_group;

  among_groups : if IS_LEGAL generate
    u_top : entity firm.firm_sched_by_policy
      generic map (
        POLICY       => TOP_POLICY,
        REQUESTERS   => GROUPS,
        SHORTEST_RUN => SHORTEST_RUN
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        request      => group_request,
        beat         => beat,
        last         => last,
        grant_valid  => grant_valid,
        grant_select => top_select
      );
  end generate among_groups;

  u_choice : entity firm.firm_axis_select
    generic map (
      WORDS => GROUPS,
      WIDTH => SELECT_BITS
    )
    port map (
      words_in => group_choices,
      index    => top_select,
      word     => grant_select
    );

end architecture rtl;
