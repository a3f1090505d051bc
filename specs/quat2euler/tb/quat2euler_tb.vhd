-- SPDX-License-Identifier: Apache-2.0
-- Feeds quat2euler from a file, stalls both sides at random, writes its results and measures its cycles.
--
-- A line of VECTORS is x, y, z, w; a line of RESULTS is roll, pitch, yaw: 16 hexadecimal digits each, no
-- blanks. Latency counts from the cycle that takes a message to the first one that offers its result, the
-- interval from taking a message to taking the next. The reader of RESULTS checks the values; stable
-- outputs, latency, interval and the watchdog are checked here.

library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;

library std;
use std.textio.all;

entity quat2euler_tb is
  generic (
    VECTORS      : string   := "vectors.txt";
    RESULTS      : string   := "results.txt";
    SEED         : positive := 1;
    -- Chance in percent that the source is silent, or the sink not ready, in a cycle: 0 to 99.
    STALL_IN     : natural := 0;
    STALL_OUT    : natural := 0;
    -- Fewest cycles from taking a message to offering the next.
    SPACING      : positive := 1;
    -- Bounds in cycles; 0: measured only.
    MAX_LATENCY  : natural := 0;
    MAX_INTERVAL : natural := 0
  );
end entity quat2euler_tb;

architecture test of quat2euler_tb is

  constant PERIOD   : time     := 10 ns;
  -- More messages than the accelerator can hold at once.
  constant DEPTH    : positive := 16;
  -- Cycles without a result after which the accelerator counts as hung.
  constant PATIENCE : positive := 20000;

  subtype number_t is std_logic_vector(63 downto 0);
  subtype message_t is std_logic_vector(3*64-1 downto 0);
  type cycles_t is array (natural range 0 to DEPTH-1) of natural;

  constant DIGITS : string(1 to 16) := "0123456789ABCDEF";

  procedure read_number(text_line : inout line; number : out number_t) is
    variable digit : character;
    variable bits  : number_t := (others => '0');
  begin
    for position in 15 downto 0 loop
      read(text_line, digit);
      for value in 0 to 15 loop
        if DIGITS(value+1) = digit then
          for k in 0 to 3 loop
            if (value / 2**k) mod 2 = 1 then
              bits(4*position+k) := '1';
            end if;
          end loop;
        end if;
      end loop;
    end loop;
    number := bits;
  end procedure read_number;

  procedure write_number(text_line : inout line; number : in number_t) is
    variable value : natural;
  begin
    for position in 15 downto 0 loop
      value := 0;
      for k in 0 to 3 loop
        assert number(4*position+k) = '0' or number(4*position+k) = '1'
          report "quat2euler_tb: an output bit is neither 0 nor 1"
          severity failure;
        if number(4*position+k) = '1' then
          value := value + 2**k;
        end if;
      end loop;
      write(text_line, DIGITS(value+1));
    end loop;
  end procedure write_number;

  procedure stall(
    seed1   : inout positive;
    seed2   : inout positive;
    percent : in    natural;
    result  : out   boolean
  ) is
    variable chance : real;
  begin
    uniform(seed1, seed2, chance);
    result := chance * 100.0 < real(percent);
  end procedure stall;

  signal clk               : std_logic := '0';
  signal rst_n             : std_logic := '0';
  signal cycle             : natural   := 0;
  signal finished          : boolean   := false;

  signal in_x              : number_t := (others => '1');
  signal in_y              : number_t := (others => '1');
  signal in_z              : number_t := (others => '1');
  signal in_w              : number_t := (others => '1');
  signal in_segment_valid  : std_logic_vector(0 downto 0);
  signal in_msg_valid      : std_logic := '0';
  signal in_msg_ready      : std_logic;
  signal out_x             : number_t;
  signal out_y             : number_t;
  signal out_z             : number_t;
  signal out_segment_valid : std_logic_vector(0 downto 0);
  signal out_msg_ready     : std_logic := '0';

  signal taken             : natural  := 0;
  signal taken_at          : cycles_t := (others => 0);
  signal is_source_empty   : boolean  := false;

begin

  u_dut : entity work.quat2euler
    port map (
      clk               => clk,
      rst_n             => rst_n,
      in_x              => in_x,
      in_y              => in_y,
      in_z              => in_z,
      in_w              => in_w,
      in_segment_valid  => in_segment_valid,
      in_msg_valid      => in_msg_valid,
      in_msg_ready      => in_msg_ready,
      out_x             => out_x,
      out_y             => out_y,
      out_z             => out_z,
      out_segment_valid => out_segment_valid,
      out_msg_ready     => out_msg_ready
    );

  in_segment_valid(0) <= in_msg_valid;

  clk <= not clk after PERIOD / 2 when not finished else '0';

  count : process (clk)
  begin
    if rising_edge(clk) then
      cycle <= cycle + 1;
      if cycle = 3 then
        rst_n <= '1';
      end if;
    end if;
  end process count;

  -- Between messages the fields hold a NaN, so that a field read too early or too late shows.
  source : process
    file     vector_file : text open read_mode is VECTORS;
    variable vector      : line;
    variable seed1       : positive := SEED;
    variable seed2       : positive := 20011;
    variable stalled     : boolean;
    variable x           : number_t;
    variable y           : number_t;
    variable z           : number_t;
    variable w           : number_t;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      read_number(vector, x);
      read_number(vector, y);
      read_number(vector, z);
      read_number(vector, w);
      stall(seed1, seed2, STALL_IN, stalled);
      while stalled loop
        wait until rising_edge(clk);
        stall(seed1, seed2, STALL_IN, stalled);
      end loop;
      in_x         <= x;
      in_y         <= y;
      in_z         <= z;
      in_w         <= w;
      in_msg_valid <= '1';
      wait until rising_edge(clk) and in_msg_ready = '1';
      taken                     <= taken + 1;
      taken_at(taken mod DEPTH) <= cycle;
      in_msg_valid              <= '0';
      in_x                      <= (others => '1');
      in_y                      <= (others => '1');
      in_z                      <= (others => '1');
      in_w                      <= (others => '1');
      for k in 2 to SPACING loop
        wait until rising_edge(clk);
      end loop;
    end loop;
    is_source_empty <= true;
    wait;
  end process source;

  sink : process
    file     result_file  : text open write_mode is RESULTS;
    variable result       : line;
    variable seed1        : positive := SEED;
    variable seed2        : positive := 30011;
    variable stalled      : boolean;
    variable received     : natural := 0;
    variable is_offered   : boolean := false;
    variable offered      : message_t;
    variable at           : natural := 0;
    variable before       : natural := 0;
    variable progress     : natural := 0;
    variable least        : natural := natural'high;
    variable most         : natural := 0;
    variable interval     : natural := 0;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    while not (is_source_empty and received = taken) loop
      wait until rising_edge(clk);
      assert cycle < progress + PATIENCE
        report "quat2euler_tb: no result for " & integer'image(PATIENCE) & " cycles"
        severity failure;
      assert out_segment_valid(0) = '1' or not is_offered
        report "quat2euler_tb: out_segment_valid fell before out_msg_ready"
        severity failure;
      if out_segment_valid(0) = '1' and not is_offered then
        assert received < taken
          report "quat2euler_tb: more results than messages"
          severity failure;
        is_offered := true;
        offered    := out_x & out_y & out_z;
        at         := taken_at(received mod DEPTH);
        if cycle - at < least then
          least := cycle - at;
        end if;
        if cycle - at > most then
          most := cycle - at;
        end if;
        if received > 0 and at - before > interval then
          interval := at - before;
        end if;
        before := at;
      end if;
      if out_segment_valid(0) = '1' then
        assert offered = out_x & out_y & out_z
          report "quat2euler_tb: a field changed before out_msg_ready"
          severity failure;
        if out_msg_ready = '1' then
          write_number(result, out_x);
          write_number(result, out_y);
          write_number(result, out_z);
          writeline(result_file, result);
          received   := received + 1;
          is_offered := false;
          progress   := cycle;
        end if;
      end if;
      stall(seed1, seed2, STALL_OUT, stalled);
      out_msg_ready <= '1';
      if stalled then
        out_msg_ready <= '0';
      end if;
    end loop;

    write(result, "quat2euler_tb: seed " & integer'image(SEED) & ", messages " & integer'image(received)
      & ", latency " & integer'image(least) & " to " & integer'image(most)
      & ", longest interval " & integer'image(interval) & " cycles");
    writeline(output, result);
    assert MAX_LATENCY = 0 or most <= MAX_LATENCY
      report "quat2euler_tb: latency " & integer'image(most) & " exceeds " & integer'image(MAX_LATENCY)
      severity failure;
    assert MAX_INTERVAL = 0 or interval <= MAX_INTERVAL
      report "quat2euler_tb: interval " & integer'image(interval) & " exceeds " & integer'image(MAX_INTERVAL)
      severity failure;
    finished <= true;
    wait;
  end process sink;

end architecture test;
