-- SPDX-License-Identifier: Apache-2.0
-- Feeds an operation on fixed-point numbers from a file and writes its results.
--
-- As binary digits: a line of VECTORS has the operands, the first one in the highest bits; a line of RESULTS has the
-- result, then overflow and whether it is undefined. Both sides of the handshake stall at random. The report at the end
-- has the latency of the first operation in cycles and, if nothing stalls, the cycles of all operations.

library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;

library std;
use std.textio.all;

library firm;
use firm.firm_sim_pkg.all;

entity firm_fixed_tb is
  generic (
    VECTORS           : string   := "vectors.txt";
    RESULTS           : string   := "results.txt";
    EXPECTED          : string   := "";
    -- add, subtract, multiply, divide or resize.
    OPERATION         : string   := "multiply";
    -- Of add and resize, A.
    A_WIDTH           : positive := 32;
    A_FRACTION        : natural  := 16;
    B_WIDTH           : positive := 32;
    B_FRACTION        : natural  := 16;
    OUT_WIDTH         : positive := 32;
    OUT_FRACTION      : natural  := 16;
    SEED              : positive := 1;
    -- Cycles of 100 in which one side of the handshake stalls.
    STALLS            : natural  := 30
  );
end entity firm_fixed_tb;

architecture test of firm_fixed_tb is

  constant PERIOD : time     := 10 ns;

  function in_width return positive is
  begin
    if OPERATION = "resize" then
      return A_WIDTH;
    end if;
    return A_WIDTH + B_WIDTH;
  end function in_width;

  constant IN_BITS  : positive := in_width;
  -- The number, overflow, undefined.
  constant OUT_BITS : positive := OUT_WIDTH + 2;

  signal clk       : std_logic := '0';
  signal rst_n     : std_logic := '0';
  signal is_done   : boolean   := false;
  signal cycle     : natural   := 0;
  signal first     : natural   := 0;
  signal sent      : natural   := 0;
  signal all_sent  : boolean   := false;

  signal in_valid  : std_logic := '0';
  signal in_ready  : std_logic;
  signal operands  : std_logic_vector(IN_BITS-1 downto 0) := (others => '0');
  signal out_valid : std_logic;
  signal out_ready : std_logic := '0';
  signal result    : std_logic_vector(OUT_BITS-1 downto 0);

begin

  zero : if OPERATION /= "divide" generate
    result(0) <= '0';
  end generate zero;

  adds : if OPERATION = "add" or OPERATION = "subtract" generate
    signal subtracts : std_logic;
  begin

    subtracts <= '1' when OPERATION = "subtract" else '0';

    u_dut : entity firm.firm_fixed_add
      generic map (
        WIDTH => A_WIDTH
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        in_valid     => in_valid,
        in_ready     => in_ready,
        in_a         => operands(A_WIDTH+B_WIDTH-1 downto B_WIDTH),
        in_b         => operands(B_WIDTH-1 downto 0),
        in_subtract  => subtracts,
        out_valid    => out_valid,
        out_ready    => out_ready,
        out_number   => result(OUT_BITS-1 downto 2),
        out_overflow => result(1)
      );

  end generate adds;

  multiplies : if OPERATION = "multiply" generate

    u_dut : entity firm.firm_fixed_multiply
      generic map (
        A_WIDTH      => A_WIDTH,
        A_FRACTION   => A_FRACTION,
        B_WIDTH      => B_WIDTH,
        B_FRACTION   => B_FRACTION,
        OUT_WIDTH    => OUT_WIDTH,
        OUT_FRACTION => OUT_FRACTION
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        in_valid     => in_valid,
        in_ready     => in_ready,
        in_a         => operands(A_WIDTH+B_WIDTH-1 downto B_WIDTH),
        in_b         => operands(B_WIDTH-1 downto 0),
        out_valid    => out_valid,
        out_ready    => out_ready,
        out_number   => result(OUT_BITS-1 downto 2),
        out_overflow => result(1)
      );

  end generate multiplies;

  divides : if OPERATION = "divide" generate

    u_dut : entity firm.firm_fixed_divide
      generic map (
        A_WIDTH      => A_WIDTH,
        A_FRACTION   => A_FRACTION,
        B_WIDTH      => B_WIDTH,
        B_FRACTION   => B_FRACTION,
        OUT_WIDTH    => OUT_WIDTH,
        OUT_FRACTION => OUT_FRACTION
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        in_valid      => in_valid,
        in_ready      => in_ready,
        in_a          => operands(A_WIDTH+B_WIDTH-1 downto B_WIDTH),
        in_b          => operands(B_WIDTH-1 downto 0),
        out_valid     => out_valid,
        out_ready     => out_ready,
        out_number    => result(OUT_BITS-1 downto 2),
        out_overflow  => result(1),
        out_undefined => result(0)
      );

  end generate divides;

  resizes : if OPERATION = "resize" generate

    u_dut : entity firm.firm_fixed_resize
      generic map (
        IN_WIDTH     => A_WIDTH,
        IN_FRACTION  => A_FRACTION,
        OUT_WIDTH    => OUT_WIDTH,
        OUT_FRACTION => OUT_FRACTION
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        in_valid     => in_valid,
        in_ready     => in_ready,
        in_number    => operands,
        out_valid    => out_valid,
        out_ready    => out_ready,
        out_number   => result(OUT_BITS-1 downto 2),
        out_overflow => result(1)
      );

  end generate resizes;

  clock : process
  begin
    while not is_done loop
      clk <= '0';
      wait for PERIOD / 2;
      clk   <= '1';
      cycle <= cycle + 1;
      wait for PERIOD / 2;
    end loop;
    wait;
  end process clock;

  rst_n <= '1' after 4 * PERIOD;

  source : process
    file     vector_file : text open read_mode is VECTORS;
    variable vector      : line;
    variable bits        : bit_vector(IN_BITS-1 downto 0);
    variable seed_1      : positive := SEED;
    variable seed_2      : positive := 1;
    variable chance      : real;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    first <= cycle;
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      read(vector, bits);
      uniform(seed_1, seed_2, chance);
      while chance * 100.0 < real(STALLS) loop
        wait until rising_edge(clk);
        uniform(seed_1, seed_2, chance);
      end loop;
      operands <= to_stdlogicvector(bits);
      in_valid <= '1';
      wait until rising_edge(clk) and in_ready = '1';
      sent     <= sent + 1;
      in_valid <= '0';
      operands <= (others => '1');
    end loop;
    all_sent <= true;
    wait;
  end process source;

  sink : process
    file     result_file : text open write_mode is RESULTS;
    file     wanted_file : text open read_mode is existing(EXPECTED);
    variable row         : line;
    variable seed_1      : positive := SEED;
    variable seed_2      : positive := 2;
    variable chance      : real;
    variable received    : natural := 0;
    variable latency     : natural := 0;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    while not (all_sent and received = sent) loop
      uniform(seed_1, seed_2, chance);
      out_ready <= '1';
      if chance * 100.0 < real(STALLS) then
        out_ready <= '0';
      end if;
      wait until rising_edge(clk);
      if out_valid = '1' and out_ready = '1' then
        write(row, to_bitvector(result));
        write_result(result_file, wanted_file, EXPECTED, row);
        received := received + 1;
        if received = 1 then
          -- The source shows its first operands in the cycle after `first`.
          latency := cycle - first - 1;
        end if;
      end if;
    end loop;
    print("latency " & integer'image(latency) & ", cycles " & integer'image(cycle - first));
    is_done <= true;
    wait;
  end process sink;

  -- A stalled result does not change.
  hold : process
    variable shown : std_logic_vector(OUT_BITS-1 downto 0);
  begin
    wait until rising_edge(clk) and out_valid = '1' and out_ready = '0';
    shown := result;
    wait until rising_edge(clk);
    assert out_valid = '1' and result = shown
      report "firm_fixed_tb: a result has changed before it was accepted"
      severity failure;
  end process hold;

  watchdog : process
    variable known : natural;
  begin
    while not is_done loop
      known := sent;
      for k in 1 to 2000 loop
        wait until rising_edge(clk) or is_done;
      end loop;
      assert is_done or all_sent or sent /= known
        report "firm_fixed_tb: no operands were accepted for 2000 cycles"
        severity failure;
    end loop;
    wait;
  end process watchdog;

end architecture test;
