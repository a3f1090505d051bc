-- SPDX-License-Identifier: Apache-2.0
-- Random tasks of random length against a model: the grant goes to the lowest index that asks in the cycle of the
-- choice, stays until the task's last beat even if its requester pauses, and no cycle is lost while somebody is ready.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_sched_fixed_priority_tb is
  generic (
    REQUESTERS : integer := 5;
    SEED       : integer := 1;
    -- For each requester.
    TASKS     : integer := 20;
    MAX_BEATS : integer := 4;
    -- Chances in a cycle: that a requester shows no beat, and that nobody takes the one that is granted.
    PAUSE_PERCENT : integer := 50;
    STALL_PERCENT : integer := 30);
end entity firm_sched_fixed_priority_tb;

architecture simulation of firm_sched_fixed_priority_tb is

  constant NOBODY   : integer  := -1;
  constant WATCHDOG : positive := 1000;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';

  signal request      : std_logic_vector(REQUESTERS-1 downto 0) := (others => '0');
  signal last_of_task : std_logic_vector(REQUESTERS-1 downto 0) := (others => '0');
  signal ready        : std_logic                               := '0';
  signal beat         : std_logic;
  signal last         : std_logic;
  signal grant_valid  : std_logic;
  signal grant_select : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);

begin

  u_scheduler : entity firm.firm_sched_fixed_priority
    generic map (
      REQUESTERS => REQUESTERS)
    port map (
      clk          => clk,
      rst_n        => rst_n,
      request      => request,
      beat         => beat,
      last         => last,
      grant_valid  => grant_valid,
      grant_select => grant_select);

  -- What the Manager does around a scheduler.
  answer_grant : process (request, last_of_task, ready, grant_valid, grant_select)
    variable granted : natural;
  begin
    beat <= '0';
    last <= '0';
    if grant_valid = '1' then
      granted := to_integer(unsigned(grant_select));
      assert granted < REQUESTERS report "grant to a requester that does not exist" severity failure;
      beat <= request(granted) and ready;
      last <= last_of_task(granted);
    end if;
  end process answer_grant;

  check : process

    type count_t is array (0 to REQUESTERS-1) of natural;
    variable tasks_left : count_t := (others => TASKS);
    variable beats_left : count_t := (others => 0);  -- of the task that a requester is in, with the beat on offer

    variable random_1 : positive := SEED;
    variable random_2 : positive := 3;

    variable running     : integer := NOBODY;  -- the task that has begun and is not finished
    variable choice      : integer := NOBODY;  -- whom the model grants next
    variable granted     : integer;
    variable beats       : natural := 0;
    variable cycles      : natural := 0;
    variable idle_cycles : natural := 0;

    procedure draw(below : in positive; value : out natural) is
      variable random : real;
    begin
      uniform(random_1, random_2, random);
      value := integer(floor(random * real(below)));
    end procedure draw;

    procedure judge_cycle is
    begin
      granted := NOBODY;
      if grant_valid = '1' then
        granted := to_integer(unsigned(grant_select));
      end if;
      if running /= NOBODY then
        assert granted = running
          report "task of " & integer'image(running) & " interrupted by " & integer'image(granted) severity failure;
      elsif choice /= NOBODY then
        assert granted = choice
          report "granted " & integer'image(granted) & ", expected " & integer'image(choice) severity failure;
      end if;
      if choice /= NOBODY and running = NOBODY and ready = '1' then
        assert beat = '1' or request(choice) = '0' report "a cycle is lost" severity failure;
      end if;
    end procedure judge_cycle;

    -- Whom to grant in the next cycle: nobody new while a task runs; who finishes now has not asked again yet.
    procedure follow is
      variable finishing : integer := NOBODY;
    begin
      if beat = '1' then
        running := granted;
        if last = '1' then
          finishing := granted;
          running   := NOBODY;
        end if;
      end if;
      if running = NOBODY then
        for requester in REQUESTERS-1 downto 0 loop
          if request(requester) = '1' and requester /= finishing then
            choice := requester;
          end if;
        end loop;
      end if;
    end procedure follow;

    procedure move_requester(requester : in natural) is
      variable number : natural;
    begin
      if beat = '1' and requester = granted then
        beats_left(requester) := beats_left(requester) - 1;
        request(requester)    <= '0' after 1 ns;
      elsif request(requester) = '1' then
        return;
      end if;
      draw(100, number);
      if number >= PAUSE_PERCENT then
        if beats_left(requester) = 0 and tasks_left(requester) > 0 then
          tasks_left(requester) := tasks_left(requester) - 1;
          draw(MAX_BEATS, number);
          beats_left(requester) := number + 1;
        end if;
        if beats_left(requester) > 0 then
          request(requester)      <= '1' after 1 ns;
          last_of_task(requester) <= '0' after 1 ns;
          if beats_left(requester) = 1 then
            last_of_task(requester) <= '1' after 1 ns;
          end if;
        end if;
      end if;
    end procedure move_requester;

    impure function is_over return boolean is
    begin
      for requester in 0 to REQUESTERS-1 loop
        if tasks_left(requester) > 0 or beats_left(requester) > 0 then
          return false;
        end if;
      end loop;
      return true;
    end function is_over;

    variable number : natural;

  begin
    for cycle in 1 to 4 loop
      clk <= '1';
      wait for 5 ns;
      clk <= '0';
      wait for 5 ns;
    end loop;
    rst_n <= '1' after 1 ns;
    while not is_over loop
      clk         <= '1';
      cycles      := cycles + 1;
      idle_cycles := idle_cycles + 1;
      if beat = '1' then
        beats       := beats + 1;
        idle_cycles := 0;
      end if;
      assert idle_cycles < WATCHDOG report "nobody is served" severity failure;
      if rst_n = '1' then
        judge_cycle;
        follow;
      end if;
      for requester in 0 to REQUESTERS-1 loop
        move_requester(requester);
      end loop;
      draw(100, number);
      ready <= '0' after 1 ns;
      if number >= STALL_PERCENT then
        ready <= '1' after 1 ns;
      end if;
      wait for 5 ns;
      clk <= '0';
      wait for 5 ns;
    end loop;
    report "PASS " & integer'image(beats) & " beats in " & integer'image(cycles) & " cycles";
    wait;
  end process check;

end architecture simulation;
