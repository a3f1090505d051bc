-- SPDX-License-Identifier: Apache-2.0
-- Runs random tasks on the scheduler of any policy, and writes its ports in every cycle to a file, which
-- tests/cores/sched_trace.py compares with the policy's model in Python.
-- The behaviour of requesters and sink is drawn for each stretch of cycles: all requesters or a single one have tasks,
-- of one beat or many, at once, in bursts or now and then, with or without pauses and stalls.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_trace_tb is
  generic (
    -- A name of policy_t; with groups, the policy among them.
    POLICY     : string  := "fixed_priority";
    REQUESTERS : integer := 5;
    -- One digit per group: the place of its policy in policy_t. Empty: no groups, no combined scheduler.
    GROUP_POLICIES : string  := "";
    TIME_BITS      : integer := 16;
    SHORTEST_RUN   : integer := 1;
    LONGEST_PERIOD : integer := 1000;  -- 8 and more, within the horizon of the time

    SEED     : integer := 1;  -- 1 and more
    SEGMENTS : integer := 4;  -- each begins with a reset
    CYCLES   : integer := 1000;  -- of a segment
    -- No pauses and no stalls, and every requester always has a task.
    SATURATED : boolean := false;
    -- Beats of each task, 0: drawn.
    TASK_BEATS : integer := 0;
    -- Cycles of a stretch in addition to the drawn ones.
    STRETCH : integer := 0;
    -- The longest stall of the sink at the beginning of a stretch, in cycles.
    LONGEST_STALL : integer := 0;
    TRACE         : string  := "trace.txt";
    EXPECTED      : string  := ""
  );
end entity firm_sched_trace_tb;

architecture simulation of firm_sched_trace_tb is

  constant NOBODY : integer := -1;

  -- Park and Miller's generator: fast, and the same in every simulator.
  subtype random_t is integer range 1 to 2147483646;

  procedure draw(state : inout random_t; below : in positive; value : out natural) is
    variable following : integer;
  begin
    following := 16807 * (state mod 127773) - 2836 * (state / 127773);
    if following <= 0 then
      following := following + 2147483647;
    end if;
    state := following;
    value := (following / 8) mod below;
  end procedure draw;

  function initial_state(salt : natural) return random_t is
    variable state  : random_t := 1 + SEED mod 2147483646;
    variable number : natural;
  begin
    for round in 0 to salt+8 loop
      draw(state, 2, number);
    end loop;
    return state;
  end function initial_state;

  function drawn_times(salt : natural; shortest, longest : positive) return times_t is
    variable times  : times_t(0 to REQUESTERS-1);
    variable state  : random_t := initial_state(salt);
    variable number : natural;
  begin
    for requester in times'range loop
      draw(state, longest-shortest+1, number);
      times(requester) := shortest + number;
    end loop;
    return times;
  end function drawn_times;

  -- Implicit, constrained or arbitrary.
  function drawn_deadlines return times_t is
    variable state  : random_t := initial_state(3);
    variable number : natural;
  begin
    draw(state, 3, number);
    if number = 0 then
      return IMPLICIT;
    elsif number = 1 then
      return drawn_times(4, 4, 8);
    end if;
    return drawn_times(5, 4, LONGEST_PERIOD);
  end function drawn_deadlines;

  -- Every group has at least one requester; the groups of the others are drawn.
  function drawn_sizes return times_t is
    constant GROUPS : positive := max(1, GROUP_POLICIES'length);
    variable sizes  : times_t(0 to GROUPS-1) := (others => 1);
    variable state  : random_t := initial_state(6);
    variable number : natural;
  begin
    for requester in GROUPS to REQUESTERS-1 loop
      draw(state, GROUPS, number);
      sizes(number) := sizes(number) + 1;
    end loop;
    return sizes;
  end function drawn_sizes;

  function policies_of_digits return policies_t is
    constant GROUPS   : positive := max(1, GROUP_POLICIES'length);
    variable policies : policies_t(0 to GROUPS-1) := (others => FIXED_PRIORITY);
  begin
    for place in natural range 0 to GROUP_POLICIES'length-1 loop
      policies(place) :=
        policy_t'val(character'pos(GROUP_POLICIES(GROUP_POLICIES'low+place)) - character'pos('0'));
    end loop;
    return policies;
  end function policies_of_digits;

  constant IS_COMBINED    : boolean := GROUP_POLICIES'length > 0;
  constant PERIODS        : times_t := drawn_times(1, 8, LONGEST_PERIOD);
  constant TRANSFER_TIMES : times_t := drawn_times(2, 1, 16);
  constant DEADLINES      : times_t := drawn_deadlines;
  constant SIZES          : times_t := drawn_sizes;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';

  signal request      : std_logic_vector(REQUESTERS-1 downto 0) := (others => '0');
  signal beat         : std_logic := '0';
  signal last         : std_logic := '0';
  signal grant_valid  : std_logic;
  signal grant_select : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);

begin

  plain : if not IS_COMBINED generate
    u_scheduler : entity firm.firm_sched_by_policy
      generic map (
        POLICY         => policy_t'value(POLICY),
        REQUESTERS     => REQUESTERS,
        PERIODS        => PERIODS,
        TRANSFER_TIMES => TRANSFER_TIMES,
        DEADLINES      => DEADLINES,
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
  end generate plain;

  of_groups : if IS_COMBINED generate
    u_scheduler : entity firm.firm_sched_combined
      generic map (
        REQUESTERS     => REQUESTERS,
        SIZES          => SIZES,
        POLICIES       => policies_of_digits,
        TOP_POLICY     => policy_t'value(POLICY),
        PERIODS        => PERIODS,
        TRANSFER_TIMES => TRANSFER_TIMES,
        DEADLINES      => DEADLINES,
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
  end generate of_groups;

  drive : process
    file trace_file  : text open write_mode is TRACE;
    file wanted_file : text open read_mode is existing(EXPECTED);

    variable state : random_t := initial_state(0);

    -- The behaviour of requesters and sink in a stretch of cycles. Each `longest` may be 0.
    variable stretch_end   : natural;
    variable lone          : integer;  -- the only one with new tasks, or NOBODY
    variable longest_task  : positive;
    variable longest_gap   : natural;  -- between tasks
    variable burst_period  : positive;  -- tasks begin in multiples of it
    variable pause_percent : natural;  -- of beats within a task after which there is a pause
    variable longest_pause : natural;
    variable stall_percent : natural;
    variable stall_end     : natural;

    type numbers_t is array (0 to REQUESTERS-1) of natural;
    variable wakes      : numbers_t;  -- the next action of an idle requester
    variable beats_left : numbers_t;  -- of the task that a requester is in, with the beat on offer

    variable asks        : std_logic_vector(REQUESTERS-1 downto 0);
    variable asked       : std_logic_vector(REQUESTERS-1 downto 0);  -- in the previous cycle
    variable granted     : integer;
    variable has_beat    : boolean;
    variable is_its_last : boolean;
    variable number      : natural;

    function one_of(place : natural; a, b, c : natural) return natural is
    begin
      if place = 0 then
        return a;
      elsif place = 1 then
        return b;
      end if;
      return c;
    end function one_of;

    procedure draw_stretch(cycle : in natural) is
    begin
      draw(state, 200 + 8*REQUESTERS, number);
      stretch_end := cycle + 50 + number + STRETCH;
      draw(state, 4, number);
      lone := NOBODY;
      if number = 0 then
        draw(state, REQUESTERS, number);
        lone := number;
      end if;
      draw(state, 3, number);
      longest_task := one_of(number, 1, 4, 40);
      draw(state, 3, number);
      longest_gap := one_of(number, 0, 20, 16*REQUESTERS);
      draw(state, 3, number);
      burst_period := one_of(number, 1, 1, 64);
      draw(state, 3, number);
      pause_percent := one_of(number, 0, 20, 70);
      draw(state, 2, number);
      longest_pause := one_of(number, 3, 30, 0);
      draw(state, 3, number);
      stall_percent := one_of(number, 0, 30, 80);
      stall_end := 0;
      if LONGEST_STALL > 0 then
        draw(state, LONGEST_STALL+1, number);
        stall_end   := cycle + number;
        stretch_end := stretch_end + number;
      end if;
      if SATURATED then
        lone          := NOBODY;
        longest_gap   := 0;
        burst_period  := 1;
        pause_percent := 0;
        stall_percent := 0;
      end if;
    end procedure draw_stretch;

    procedure plan_task(requester, cycle : in natural) is
      variable start : natural;
    begin
      draw(state, longest_gap+1, number);
      start := cycle + number;
      if lone /= NOBODY and requester /= lone then
        start := stretch_end + number;
      end if;
      wakes(requester) := (start + burst_period-1) / burst_period * burst_period;
    end procedure plan_task;

    procedure wake(requester : in natural) is
    begin
      asks(requester) := '1';
      if beats_left(requester) = 0 then
        draw(state, longest_task, number);
        beats_left(requester) := 1 + number;
        if TASK_BEATS > 0 then
          beats_left(requester) := TASK_BEATS;
        end if;
      end if;
    end procedure wake;

    -- The beat of the granted requester was taken in the previous cycle.
    procedure take_beat(cycle : in natural) is
    begin
      asks(granted)       := '0';
      wakes(granted)      := cycle;
      beats_left(granted) := beats_left(granted) - 1;
      if beats_left(granted) = 0 then
        plan_task(granted, cycle);
        return;
      end if;
      draw(state, 100, number);
      if number < pause_percent then
        draw(state, longest_pause, number);
        wakes(granted) := cycle + 1 + number;
      end if;
    end procedure take_beat;

    procedure tick is
    begin
      wait for 1 ns;
      clk <= '1';
      wait for 1 ns;
      clk <= '0';
    end procedure tick;

    procedure reset is
    begin
      request <= (others => '0');
      beat    <= '0';
      rst_n   <= '0';
      tick;
      tick;
      rst_n    <= '1';
      asks     := (others => '0');
      asked    := (others => '0');
      has_beat := false;
      draw_stretch(0);
      for requester in 0 to REQUESTERS-1 loop
        beats_left(requester) := 0;
        plan_task(requester, 0);
      end loop;
    end procedure reset;

    -- The grant is valid: find the requester that responds.
    procedure answer(cycle : in natural) is
    begin
      granted     := NOBODY;
      has_beat    := false;
      is_its_last := false;
      draw(state, 100, number);
      if grant_valid = '1' then
        granted := to_integer(unsigned(grant_select));
        assert granted < REQUESTERS report "grant to a requester that does not exist" severity failure;
        has_beat    := asks(granted) = '1' and number >= stall_percent and cycle >= stall_end;
        is_its_last := beats_left(granted) = 1;
      end if;
    end procedure answer;

    function bit_of(value : boolean) return std_logic is
    begin
      if value then
        return '1';
      end if;
      return '0';
    end function bit_of;

    procedure write_times(name : in string; times : in times_t) is
      variable text_line : line;
    begin
      write(text_line, name);
      for place in times'range loop
        write(text_line, ' ');
        write(text_line, times(place));
      end loop;
      write_result(trace_file, wanted_file, EXPECTED, text_line);
    end procedure write_times;

    -- Highest requester first; "." if they are unchanged.
    impure function requests_in_hex return string is
      constant DIGITS  : string(1 to 16) := "0123456789abcdef";
      constant LENGTH  : positive := (REQUESTERS+3) / 4;
      variable nibbles : std_logic_vector(4*LENGTH-1 downto 0) := (others => '0');
      variable digit   : natural;
      variable text    : string(1 to LENGTH);
    begin
      if asks = asked then
        return ".";
      end if;
      nibbles(REQUESTERS-1 downto 0) := asks;
      for place in text'range loop
        digit := 0;
        for position in 3 downto 0 loop
          digit := 2 * digit;
          if nibbles(4*(LENGTH-place)+position) = '1' then
            digit := digit + 1;
          end if;
        end loop;
        text(place) := DIGITS(1+digit);
      end loop;
      return text;
    end function requests_in_hex;

    -- Requests, then beat, last and grant_valid as a number, then grant_select.
    procedure write_cycle is
      variable text_line : line;
    begin
      write(text_line, requests_in_hex);
      write(text_line, ' ');
      write(text_line, 4 * boolean'pos(has_beat) + 2 * boolean'pos(is_its_last) + boolean'pos(granted /= NOBODY));
      write(text_line, ' ');
      write(text_line, to_integer(unsigned(grant_select)));
      write_result(trace_file, wanted_file, EXPECTED, text_line);
    end procedure write_cycle;

  begin
    report "policy " & POLICY & GROUP_POLICIES & ", " & integer'image(REQUESTERS) & " requesters, seed " &
      integer'image(SEED);
    write_times("requesters", (0 => REQUESTERS));
    write_times("cycles", (0 => CYCLES));
    write_times("time_bits", (0 => TIME_BITS));
    write_times("shortest_run", (0 => SHORTEST_RUN));
    write_times("periods", PERIODS);
    write_times("transfer_times", TRANSFER_TIMES);
    write_times("deadlines", DEADLINES);
    write_times("sizes", SIZES);
    for segment in 1 to SEGMENTS loop
      reset;
      for cycle in 0 to CYCLES-1 loop
        if cycle = stretch_end then
          draw_stretch(cycle);
        end if;
        if has_beat then
          take_beat(cycle);
        end if;
        for requester in 0 to REQUESTERS-1 loop
          if asks(requester) = '0' and wakes(requester) <= cycle then
            wake(requester);
          end if;
        end loop;
        request <= asks;
        wait for 1 ns;
        answer(cycle);
        beat <= bit_of(has_beat);
        last <= bit_of(is_its_last);
        write_cycle;
        asked := asks;
        tick;
      end loop;
    end loop;
    assert endfile(wanted_file) report "results are missing" severity failure;
    report "PASS";
    wait;
  end process drive;

end architecture simulation;
