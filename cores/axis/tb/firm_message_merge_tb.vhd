-- SPDX-License-Identifier: Apache-2.0
-- Tests the merge with sources and a sink that act at random. The sink must see every message of each source once,
-- whole and in order; an offer must stay until it is taken or withdrawn; no source may wait for more than one message
-- of each other source; and without stalls, a message must pass in every cycle.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_sim_random_pkg.all;

entity firm_message_merge_tb is
  generic (
    SOURCES  : integer := 3;
    MESSAGES : integer := 1000;
    SEED     : integer := 1;
    -- The chance per cycle that a source has no message, that an open one is not complete, or that the sink takes none.
    STALL_PERCENT : integer := 0;
    -- The chance per cycle that an open message is withdrawn.
    WITHDRAW_PERCENT : integer := 0;
    -- Only the first source sends.
    IS_ALONE : boolean := false
  );
end entity firm_message_merge_tb;

architecture simulation of firm_message_merge_tb is

  constant FIELD_BITS : positive := 24;  -- the source, and the number of its message
  constant OFFERS     : positive := 2;   -- open, complete
  constant TAKES      : positive := 2;   -- the message, and a part that the sink may take at any time

  type count_t is array (natural range <>) of natural;

  signal clk      : std_logic := '0';
  signal rst_n    : std_logic := '0';
  signal finished : boolean   := false;

  signal source_fields : std_logic_vector(SOURCES*FIELD_BITS-1 downto 0) := (others => '0');
  signal source_offers : std_logic_vector(SOURCES*OFFERS-1 downto 0)     := (others => '0');
  signal source_takes  : std_logic_vector(SOURCES*TAKES-1 downto 0);
  signal sink_fields   : std_logic_vector(FIELD_BITS-1 downto 0);
  signal sink_offers   : std_logic_vector(OFFERS-1 downto 0);
  signal sink_takes    : std_logic_vector(TAKES-1 downto 0) := (others => '0');

begin

  clk   <= not clk after 5 ns when not finished else '0';
  rst_n <= '1' after 32 ns;

  u_merge : entity firm.firm_message_merge
    generic map (
      SOURCES    => SOURCES,
      FIELD_BITS => FIELD_BITS,
      OFFERS     => OFFERS,
      TAKES      => TAKES
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      source_fields => source_fields,
      source_offers => source_offers,
      source_takes  => source_takes,
      sink_fields   => sink_fields,
      sink_offers   => sink_offers,
      sink_takes    => sink_takes
    );

  -- Inputs change shortly after the edge, outputs are read at the next.
  run : process
    variable random   : random_t := seeded(SEED, SEED + 1);
    variable passed   : natural  := 0;
    variable cycles   : natural  := 0;
    variable sent     : count_t(SOURCES-1 downto 0) := (others => 0);
    variable waited   : count_t(SOURCES-1 downto 0) := (others => 0);  -- messages of others since it is open
    variable open_v   : std_logic_vector(SOURCES-1 downto 0) := (others => '0');
    variable whole_v  : std_logic_vector(SOURCES-1 downto 0) := (others => '0');
    variable is_gone  : boolean := false;  -- the message at the sink was withdrawn
    variable was_open : boolean := false;  -- the sink was offered a message that it did not take
    variable source   : natural;
    variable last     : natural := 0;
    variable happens  : boolean;
  begin
    wait until rst_n = '1';
    wait until rising_edge(clk);
    while passed < MESSAGES loop
      wait for 1 ns;
      is_gone := false;
      for place in 0 to SOURCES-1 loop
        draw_chance(random, WITHDRAW_PERCENT, happens);
        if open_v(place) = '1' and happens then
          open_v(place)  := '0';
          whole_v(place) := '0';
          waited(place)  := 0;
          is_gone        := is_gone or place = last;
        elsif place = 0 or not IS_ALONE then
          draw_chance(random, STALL_PERCENT, happens);
          if not happens then
            open_v(place) := '1';
          end if;
          draw_chance(random, STALL_PERCENT, happens);
          if open_v(place) = '1' and not happens then
            whole_v(place) := '1';
          end if;
        end if;
        source_offers(OFFERS*place)   <= open_v(place);
        source_offers(OFFERS*place+1) <= whole_v(place);
        source_fields(FIELD_BITS*(place+1)-1 downto FIELD_BITS*place) <= (others => 'X');
        if open_v(place) = '1' then
          source_fields(FIELD_BITS*(place+1)-1 downto FIELD_BITS*place)
            <= std_logic_vector(to_unsigned(place, 8)) & std_logic_vector(to_unsigned(sent(place), 16));
        end if;
      end loop;
      for place in sink_takes'range loop
        draw_chance(random, STALL_PERCENT, happens);
        sink_takes(place) <= '1';
        if happens then
          sink_takes(place) <= '0';
        end if;
      end loop;

      wait until rising_edge(clk);
      cycles := cycles + 1;
      assert not was_open or is_gone or sink_offers(0) = '1'
        report "an offer was withdrawn" severity failure;
      assert sink_offers(0) = '1' or sink_offers(1) = '0'
        report "a message that is not open is complete" severity failure;
      for place in 0 to SOURCES-1 loop
        assert sink_offers(0) = '1' or source_takes(TAKES*place) = '0' or open_v(place) = '0'
          report "a message is taken that the sink does not see" severity failure;
      end loop;
      if sink_offers(0) = '1' then
        source := to_integer(unsigned(sink_fields(23 downto 16)));
        assert open_v(source) = '1' and whole_v(source) = sink_offers(1)
          report "the sink sees a message that source " & integer'image(source) & " does not offer" severity failure;
        assert to_integer(unsigned(sink_fields(15 downto 0))) = sent(source)
          report "source " & integer'image(source) & " sends another message" severity failure;
        assert not was_open or is_gone or source = last
          report "the source changes within a message" severity failure;
        for place in 0 to SOURCES-1 loop
          if place = source then
            assert source_takes(TAKES*(place+1)-1 downto TAKES*place) = sink_takes
              report "the source sees other takes than those of the sink" severity failure;
          else
            assert source_takes(TAKES*(place+1)-1 downto TAKES*place) = "00"
              report "a source without its turn is taken" severity failure;
          end if;
        end loop;
        last     := source;
        was_open := true;
        if sink_offers(1) = '1' and sink_takes(0) = '1' then
          passed          := passed + 1;
          sent(source)    := (sent(source) + 1) mod 65536;
          open_v(source)  := '0';
          whole_v(source) := '0';
          was_open        := false;
          for place in 0 to SOURCES-1 loop
            if place = source or open_v(place) = '0' then
              waited(place) := 0;
            else
              waited(place) := waited(place) + 1;
            end if;
            assert waited(place) <= SOURCES
              report "source " & integer'image(place) & " waits for too many messages" severity failure;
          end loop;
        end if;
      else
        was_open := false;
      end if;
    end loop;

    assert STALL_PERCENT > 0 or WITHDRAW_PERCENT > 0 or cycles = MESSAGES
      report integer'image(MESSAGES) & " messages took " & integer'image(cycles) & " cycles" severity failure;
    report "PASS " & integer'image(passed) & " messages in " & integer'image(cycles) & " cycles";
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
