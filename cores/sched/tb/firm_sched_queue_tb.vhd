-- SPDX-License-Identifier: Apache-2.0
-- Records random operations on a priority queue for comparison with a model. A line is a cycle: `insert id key` or
-- `-`, `pop` or `-`, then the outputs of the queue: ready, empty, and `id key` of the root or `-`. Keys are drawn near
-- a number that grows and wraps around; it waits while the root lags.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;
use firm.firm_axis_pkg.all;

entity firm_sched_queue_tb is
  generic (
    SORTED         : boolean := false;  -- the sorted queue instead of the heap
    SEGMENT        : integer := 32;     -- items of its segments
    ITEMS          : integer := 8;
    KEY_BITS       : integer := 8;
    SEED           : integer := 1;
    CYCLES         : integer := 1000;
    INSERT_PERCENT : integer := 50;
    POP_PERCENT    : integer := 50;
    BURST          : natural := 0;      -- cycles after which the percents change at random; 0: never
    TRACE          : string  := "queue.txt";
    EXPECTED       : string  := ""
  );
end entity firm_sched_queue_tb;

architecture simulation of firm_sched_queue_tb is

  constant ID_BITS  : positive := index_bits(ITEMS);
  constant RANGE_OF : positive := 2**KEY_BITS;
  -- A second reset in the middle finds the queue full of old items.
  constant RESET_IN : natural  := CYCLES / 2;

  signal clk          : std_logic := '0';
  signal rst_n        : std_logic := '0';
  signal insert_valid : std_logic := '0';
  signal insert_ready : std_logic;
  signal queue_ready  : std_logic;
  signal insert       : std_logic;
  signal insert_id    : std_logic_vector(ID_BITS-1 downto 0)  := (others => '0');
  signal insert_key   : std_logic_vector(KEY_BITS-1 downto 0) := (others => '0');
  signal root_valid   : std_logic;
  signal root_id      : std_logic_vector(ID_BITS-1 downto 0);
  signal root_key     : std_logic_vector(KEY_BITS-1 downto 0);
  signal first_valid  : std_logic;
  signal first_id     : std_logic_vector(ID_BITS-1 downto 0);
  signal first_key    : std_logic_vector(KEY_BITS-1 downto 0);
  signal pop_wanted   : std_logic := '0';
  signal pop          : std_logic;
  signal empty        : std_logic;

begin

  heap : if not SORTED generate
    u_queue : entity firm.firm_sched_heap
      generic map (
        ITEMS    => ITEMS,
        KEY_BITS => KEY_BITS
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        insert_valid => insert_valid,
        insert_ready => queue_ready,
        insert       => insert,
        insert_id    => insert_id,
        insert_key   => insert_key,
        root_valid   => root_valid,
        root_id      => root_id,
        root_key     => root_key,
        first_valid  => first_valid,
        first_id     => first_id,
        first_key    => first_key,
        pop          => pop,
        empty        => empty
      );
  end generate heap;

  sorted_queue : if SORTED generate
    u_queue : entity firm.firm_sched_sorted_queue
      generic map (
        ITEMS    => ITEMS,
        KEY_BITS => KEY_BITS,
        SEGMENT  => SEGMENT
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        insert_valid => insert_valid,
        insert_ready => queue_ready,
        insert       => insert,
        insert_id    => insert_id,
        insert_key   => insert_key,
        root_valid   => root_valid,
        root_id      => root_id,
        root_key     => root_key,
        first_valid  => first_valid,
        first_id     => first_id,
        first_key    => first_key,
        pop          => pop,
        empty        => empty
      );
  end generate sorted_queue;

  pop          <= pop_wanted and first_valid;
  insert_ready <= queue_ready when SORTED else queue_ready and not pop;
  insert       <= insert_valid and insert_ready;

  drive : process

    file trace_file     : text open write_mode is TRACE;
    file wanted_file    : text open read_mode is existing(EXPECTED);
    variable trace_line : line;

    variable random_1 : positive := SEED;
    variable random_2 : positive := 3;

    type flags_t is array (0 to ITEMS-1) of boolean;
    variable inside : flags_t := (others => false);
    variable base   : natural := 0;
    variable item   : natural;
    variable number : natural;

    variable inserts : natural := INSERT_PERCENT;
    variable pops    : natural := POP_PERCENT;

    procedure draw(below : in positive; value : out natural) is
      variable random : real;
    begin
      uniform(random_1, random_2, random);
      value := integer(floor(random * real(below)));
    end procedure draw;

    function number_of(vector : std_logic_vector) return natural is
    begin
      return to_integer(unsigned(vector));
    end function number_of;

    procedure write_cycle is
    begin
      if rst_n = '0' then
        write(trace_line, string'("reset"));
      else
        if insert_valid = '1' then
          write(trace_line, "insert " & integer'image(number_of(insert_id)) & " " &
            integer'image(number_of(insert_key)));
        else
          write(trace_line, string'("-"));
        end if;
        if pop = '1' then
          write(trace_line, string'(" pop "));
        else
          write(trace_line, string'(" - "));
        end if;
        write(trace_line, std_logic'image(insert_ready)(2) & " " & std_logic'image(empty)(2) & " " &
          std_logic'image(root_valid)(2));
        if first_valid = '1' then
          write(trace_line, " " & integer'image(number_of(first_id)) & " " & integer'image(number_of(first_key)));
        else
          write(trace_line, string'(" -"));
        end if;
      end if;
      write_result(trace_file, wanted_file, EXPECTED, trace_line);
    end procedure write_cycle;

    -- The next item from a random index on that is not in the queue; none if all are.
    procedure offer_item is
    begin
      insert_valid <= '0' after 1 ns;
      draw(100, number);
      if number >= inserts then
        return;
      end if;
      draw(ITEMS, item);
      for step in 1 to ITEMS loop
        if not inside(item) then
          draw(RANGE_OF/8, number);
          insert_valid <= '1' after 1 ns;
          insert_id    <= std_logic_vector(to_unsigned(item, ID_BITS)) after 1 ns;
          insert_key   <= std_logic_vector(to_unsigned((base + number) mod RANGE_OF, KEY_BITS)) after 1 ns;
          return;
        end if;
        item := (item + 1) mod ITEMS;
      end loop;
    end procedure offer_item;

  begin
    for cycle in 0 to CYCLES-1 loop
      if BURST > 0 and cycle mod max(BURST, 1) = 0 then
        draw(3, inserts);
        draw(3, pops);
        inserts := 50 * inserts;
        pops    := 50 * pops;
      end if;
      clk <= '1';
      write_cycle;
      if insert_valid = '1' and insert_ready = '1' then
        inside(number_of(insert_id)) := true;
      end if;
      if pop = '1' then
        inside(number_of(first_id)) := false;
      end if;
      assert rst_n = '0' or root_valid = '0' or
        (first_valid = '1' and first_id = root_id and first_key = root_key)
        report "the root is not the first item" severity failure;
      if cycle = 3 or cycle = RESET_IN + 1 then
        rst_n  <= '1' after 1 ns;
        inside := (others => false);
      elsif cycle = RESET_IN then
        rst_n        <= '0' after 1 ns;
        insert_valid <= '0' after 1 ns;
        inside       := (others => false);
      elsif rst_n = '1' and (insert_valid = '0' or insert_ready = '1') then
        offer_item;
      end if;
      if first_valid /= '1' or (base - number_of(first_key)) mod RANGE_OF < RANGE_OF/4 or
        (base - number_of(first_key)) mod RANGE_OF > RANGE_OF/2
      then
        draw(2, number);
        base := (base + number) mod RANGE_OF;
      end if;
      draw(100, number);
      pop_wanted <= '0' after 1 ns;
      if number < pops and rst_n = '1' then
        pop_wanted <= '1' after 1 ns;
      end if;
      wait for 5 ns;
      clk <= '0';
      wait for 5 ns;
    end loop;
    assert endfile(wanted_file) report "results are missing" severity failure;
    report "PASS";
    wait;
  end process drive;

end architecture simulation;
