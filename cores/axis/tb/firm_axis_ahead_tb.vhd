-- SPDX-License-Identifier: Apache-2.0
-- Tests the queue of a subscriber with a writer that decides by `has_room` and has two registers before `push`. Numbers
-- must arrive in order, none may be lost, and without stalls, a word must pass in every cycle.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_sim_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_axis_ahead_tb is
  generic (
    DEPTH : integer := 16;
    WORDS : integer := 3000;
    SEED  : integer := 1;
    -- The chance per cycle that the writer has no word, and that the reader pops none.
    WRITER_STALL_PERCENT : integer := 0;
    READER_STALL_PERCENT : integer := 0;
    -- The chance per cycle that all words are dropped.
    DROP_PERCENT : integer := 0
  );
end entity firm_axis_ahead_tb;

architecture simulation of firm_axis_ahead_tb is

  constant BITS : positive := 16;

  subtype word_t is std_logic_vector(BITS-1 downto 0);
  type words_t is array (natural range 0 to 2) of word_t;

  signal clk      : std_logic := '0';
  signal rst_n    : std_logic := '0';
  signal finished : boolean   := false;

  -- The writer's registers: the last one is at the queue.
  signal pushes   : std_logic_vector(2 downto 0) := "000";
  signal words_in : words_t := (others => (others => '0'));

  signal has_room : std_logic;
  signal word     : word_t;
  signal valid    : std_logic;
  signal pop      : std_logic := '0';
  signal is_empty : std_logic;

begin

  clk <= not clk after 5 ns when not finished else '0';

  u_ahead : entity firm.firm_axis_ahead
    generic map (
      BITS  => BITS,
      DEPTH => DEPTH
    )
    port map (
      clk      => clk,
      rst_n    => rst_n,
      push     => pushes(2),
      word_in  => words_in(2),
      has_room => has_room,
      word     => word,
      valid    => valid,
      pop      => pop,
      is_empty => is_empty
    );

  -- Inputs change shortly after the edge, outputs are read at the next.
  run : process
    variable random  : random_t := seeded(SEED, SEED + 1);
    variable sent    : natural  := 0;
    variable taken   : natural  := 0;
    variable inside  : natural  := 0;
    variable cycles  : natural  := 0;
    variable stalls  : boolean;
    variable is_over : boolean;
  begin
    wait until rising_edge(clk);
    wait for 1 ns;
    rst_n <= '1';
    while taken < WORDS loop
      wait until rising_edge(clk);
      cycles := cycles + 1;
      assert (is_empty = '1') = (inside = 0) report "is_empty is wrong" severity failure;
      assert valid = '0' or inside > 0 report "a word that was not pushed is valid" severity failure;
      if rst_n = '1' then
        if pop = '1' and valid = '1' then
          assert unsigned(word) = taken mod 2**BITS
            report "word " & integer'image(to_integer(unsigned(word))) & " in place of " & integer'image(taken)
            severity failure;
          taken  := taken + 1;
          inside := inside - 1;
        end if;
        if pushes(2) = '1' then
          inside := inside + 1;
        end if;
      end if;
      draw_chance(random, WRITER_STALL_PERCENT, stalls);
      wait for 1 ns;
      pushes   <= pushes(1 downto 0) & '0';
      words_in <= words_t'(std_logic_vector(to_unsigned(sent, BITS)), words_in(0), words_in(1));
      if has_room = '1' and rst_n = '1' and not stalls then
        pushes(0) <= '1';
        sent      := sent + 1;
      end if;
      draw_chance(random, READER_STALL_PERCENT, stalls);
      pop <= '1';
      if stalls then
        pop <= '0';
      end if;
      draw_chance(random, DROP_PERCENT, is_over);
      rst_n <= '1';
      if is_over then
        rst_n  <= '0';
        pushes <= "000";
        taken  := sent;
        inside := 0;
        wait until rising_edge(clk);
        wait for 1 ns;
        rst_n <= '1';
      end if;
    end loop;
    print("PASS " & integer'image(WORDS) & " words in " & integer'image(cycles) & " cycles");
    finished <= true;
    wait;
  end process run;

end architecture simulation;
