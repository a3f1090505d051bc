-- SPDX-License-Identifier: Apache-2.0
-- Tests the queue of messages against a list: the order of all messages, those that are dropped, the number of places,
-- and the rate. A message at the sink must stay until it is taken.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_sim_random_pkg.all;

entity firm_message_queue_tb is
  generic (
    MESSAGES    : integer := 2;
    DROP_NEWEST : boolean := false;
    DROP_OLDEST : boolean := false;
    CYCLES      : integer := 2000;
    SEED        : integer := 1;
    -- The chance per cycle that the source has no message.
    STALL_PERCENT : integer := 0;
    -- The chance per cycle that the sink takes a message.
    SINK_PERCENT : integer := 100
  );
end entity firm_message_queue_tb;

architecture simulation of firm_message_queue_tb is

  constant FIELD_BITS : positive := 16;

  type list_t is array (natural range <>) of natural;

  signal clk      : std_logic := '0';
  signal rst_n    : std_logic := '0';
  signal finished : boolean   := false;

  signal source_fields : std_logic_vector(FIELD_BITS-1 downto 0) := (others => 'X');
  signal source_valid  : std_logic := '0';
  signal source_ready  : std_logic;
  signal sink_fields   : std_logic_vector(FIELD_BITS-1 downto 0);
  signal sink_valid    : std_logic;
  signal sink_ready    : std_logic := '0';

begin

  clk   <= not clk after 5 ns when not finished else '0';
  rst_n <= '1' after 32 ns;

  u_queue : entity firm.firm_message_queue
    generic map (
      FIELD_BITS  => FIELD_BITS,
      MESSAGES    => MESSAGES,
      DROP_NEWEST => DROP_NEWEST,
      DROP_OLDEST => DROP_OLDEST
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      source_fields => source_fields,
      source_valid  => source_valid,
      source_ready  => source_ready,
      sink_fields   => sink_fields,
      sink_valid    => sink_valid,
      sink_ready    => sink_ready
    );

  -- Inputs change shortly after the edge, outputs are read at the next.
  run : process
    variable random  : random_t := seeded(SEED, SEED + 1);
    variable list    : list_t(0 to MESSAGES) := (others => 0);  -- the messages in the queue, the one at the sink first
    variable held    : natural := 0;
    variable before  : natural;
    variable number  : natural := 0;
    variable taken   : natural := 0;
    variable dropped : natural := 0;
    variable happens : boolean;

    procedure remove(place : in natural) is
    begin
      for item in place to MESSAGES-1 loop
        list(item) := list(item+1);
      end loop;
      held := held - 1;
    end procedure remove;
  begin
    wait until rst_n = '1';
    wait until rising_edge(clk);
    for cycle in 1 to CYCLES loop
      wait for 1 ns;
      if source_valid = '0' then
        draw_chance(random, STALL_PERCENT, happens);
        if not happens then
          source_valid  <= '1';
          source_fields <= std_logic_vector(to_unsigned(number mod 65536, FIELD_BITS));
        end if;
      end if;
      draw_chance(random, SINK_PERCENT, happens);
      sink_ready <= '0';
      if happens then
        sink_ready <= '1';
      end if;

      wait until rising_edge(clk);
      before := held;
      assert (sink_valid = '1') = (held > 0)
        report "the sink is offered " & std_logic'image(sink_valid) & " with " & integer'image(held) & " in the queue"
        severity failure;
      assert sink_valid = '0' or to_integer(unsigned(sink_fields)) = list(0)
        report "the sink is offered another message than " & integer'image(list(0)) severity failure;
      assert (source_ready = '1') = (DROP_NEWEST or DROP_OLDEST or held < MESSAGES)
        report "source_ready is " & std_logic'image(source_ready) & " with " & integer'image(held) & " in the queue"
        severity failure;
      if sink_valid = '1' and sink_ready = '1' then
        remove(0);
        taken := taken + 1;
      end if;
      if source_valid = '1' and source_ready = '1' then
        if DROP_NEWEST and before = MESSAGES then
          dropped := dropped + 1;
        else
          if held = MESSAGES then
            remove(1);
            dropped := dropped + 1;
          end if;
          list(held) := number mod 65536;
          held       := held + 1;
        end if;
        number        := number + 1;
        source_valid  <= '0';
        source_fields <= (others => 'X');
        draw_chance(random, STALL_PERCENT, happens);
        if not happens then
          source_valid  <= '1' after 1 ns;
          source_fields <= std_logic_vector(to_unsigned(number mod 65536, FIELD_BITS)) after 1 ns;
        end if;
      end if;
    end loop;

    assert STALL_PERCENT > 0 or SINK_PERCENT < 100 or MESSAGES < 2 or taken = CYCLES - 1
      report integer'image(taken) & " messages in " & integer'image(CYCLES) & " cycles" severity failure;
    report "PASS " & integer'image(taken) & " messages taken, " & integer'image(dropped) & " dropped, "
           & integer'image(held) & " in the queue";
    finished <= true;
    wait;
  end process run;

end architecture simulation;
