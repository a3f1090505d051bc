-- SPDX-License-Identifier: Apache-2.0
-- Tests the fork with sinks that are ready at random. Each sink must see every message once and in order, no offer may
-- be withdrawn, a sink must not wait for another one, and without stalls, a message must pass in every cycle.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sim_random_pkg.all;

entity firm_message_fork_tb is
  generic (
    SINKS    : integer := 3;
    MESSAGES : integer := 1000;
    SEED     : integer := 1;
    -- The chance per cycle that the source has no message or a sink takes none.
    STALL_PERCENT : integer := 0;
    -- The chance per cycle that a message is withdrawn, then at all sinks.
    WITHDRAW_PERCENT : integer := 0;
    -- Cycles at the start in which the last sink takes nothing; the others must receive the first message at once.
    BLOCKED : integer := 0
  );
end entity firm_message_fork_tb;

architecture simulation of firm_message_fork_tb is

  constant SEGMENTS : positive := 3;

  type count_t is array (natural range <>) of natural;

  signal clk      : std_logic := '0';
  signal rst_n    : std_logic := '0';
  signal finished : boolean   := false;

  signal source_valid : std_logic := '0';
  signal source_ready : std_logic;
  signal sink_valid   : std_logic_vector(SINKS-1 downto 0);
  signal sink_ready   : std_logic_vector(SINKS-1 downto 0) := (others => '0');

  signal source_segment_valid : std_logic_vector(SEGMENTS-1 downto 0) := (others => '0');
  signal sink_segment_valid   : std_logic_vector(SINKS*SEGMENTS-1 downto 0);

begin

  clk   <= not clk after 5 ns when not finished else '0';
  rst_n <= '1' after 32 ns;

  u_fork : entity firm.firm_message_fork
    generic map (
      SINKS    => SINKS,
      SEGMENTS => SEGMENTS
    )
    port map (
      clk                  => clk,
      rst_n                => rst_n,
      source_valid         => source_valid,
      source_ready         => source_ready,
      source_segment_valid => source_segment_valid,
      sink_valid           => sink_valid,
      sink_ready           => sink_ready,
      sink_segment_valid   => sink_segment_valid
    );

  -- Inputs change shortly after the edge, outputs are read at the next.
  run : process
    variable random     : random_t := seeded(SEED, SEED + 1);
    variable released   : natural  := 0;
    variable cycles     : natural  := 0;
    variable taken      : count_t(SINKS-1 downto 0) := (others => 0);
    variable was_valid  : std_logic_vector(SINKS-1 downto 0) := (others => '0');
    variable was_ready  : std_logic_vector(SINKS-1 downto 0) := (others => '0');

    variable stalls   : boolean;
    variable is_shown : boolean;
    variable is_over  : boolean := false;  -- a message was withdrawn in this cycle
    variable shown    : std_logic_vector(SEGMENTS-1 downto 0);
  begin
    wait until rst_n = '1';
    wait until rising_edge(clk);
    while released < MESSAGES loop
      -- An offer remains until it is taken.
      wait for 1 ns;
      draw_chance(random, STALL_PERCENT, stalls);
      if source_valid = '0' and not stalls and not is_over then
        source_valid <= '1';
      end if;
      for segment in source_segment_valid'range loop
        draw_chance(random, 50, is_shown);
        source_segment_valid(segment) <= '0';
        if is_shown and not is_over then
          source_segment_valid(segment) <= '1';
        end if;
      end loop;
      is_over := false;
      for sink in sink_ready'range loop
        draw_chance(random, STALL_PERCENT, stalls);
        sink_ready(sink) <= '1';
        if stalls or (sink = SINKS-1 and cycles < BLOCKED) then
          sink_ready(sink) <= '0';
        end if;
      end loop;

      wait until rising_edge(clk);
      cycles := cycles + 1;
      for sink in taken'range loop
        assert sink_valid(sink) = '0' or sink_valid(sink) = '1'
          report "sink_valid is undefined" severity failure;
        assert sink_valid(sink) = '0' or source_valid = '1'
          report "a sink is offered a message that is not there" severity failure;
        assert was_valid(sink) = '0' or was_ready(sink) = '1' or sink_valid(sink) = '1'
          report "an offer was withdrawn" severity failure;
        shown := source_segment_valid;
        if taken(sink) > released then
          shown := (others => '0');
        end if;
        assert sink_segment_valid(SEGMENTS*(sink+1)-1 downto SEGMENTS*sink) = shown
          report "sink " & integer'image(sink) & " sees other segments" severity failure;
        if sink_valid(sink) = '1' and sink_ready(sink) = '1' then
          assert taken(sink) = released
            report "sink " & integer'image(sink) & " is given message " & integer'image(released) & " as its "
                   & integer'image(taken(sink)) severity failure;
          taken(sink) := taken(sink) + 1;
        end if;
        -- Independent of the other sinks.
        assert source_valid = '0' or taken(sink) > released or sink_valid(sink) = '1'
          report "a sink waits for another one" severity failure;
      end loop;
      was_valid := sink_valid;
      was_ready := sink_ready;

      assert source_ready = '0' or source_valid = '1'
        report "a message is released that is not there" severity failure;
      if source_valid = '1' and source_ready = '1' then
        released := released + 1;
        for sink in taken'range loop
          assert taken(sink) = released
            report "released before sink " & integer'image(sink) & " had it" severity failure;
        end loop;
        source_valid <= '0';
        draw_chance(random, STALL_PERCENT, stalls);
        if not stalls then
          source_valid <= '1' after 1 ns;
        end if;
      elsif source_valid = '1' then
        assert taken /= (taken'range => released + 1)
          report "every sink has the message, but it is not released" severity failure;
        draw_chance(random, WITHDRAW_PERCENT, is_over);
        if is_over then
          source_valid <= '0' after 1 ns;
          taken        := (others => released);
          was_valid    := (others => '0');
        end if;
      end if;
    end loop;

    assert STALL_PERCENT > 0 or cycles = MESSAGES + BLOCKED
      report integer'image(MESSAGES) & " messages took " & integer'image(cycles) & " cycles" severity failure;
    report "PASS " & integer'image(released) & " messages in " & integer'image(cycles) & " cycles";
    finished <= true;
    wait;
  end process run;

  watchdog : process
  begin
    wait for 10 ms;
    assert finished report "no end after a million cycles" severity failure;
    wait;
  end process watchdog;

end architecture simulation;
