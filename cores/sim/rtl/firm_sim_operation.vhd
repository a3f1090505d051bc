-- SPDX-License-Identifier: Apache-2.0
-- Feeds an operation from a file and writes its results.
--
-- As binary digits: a line of VECTORS has the operands, with or without blanks between them, a line of RESULTS has the
-- result. Both sides of the handshake stall at random. The report at the end has the latency of the first operation in
-- cycles and, if nothing stalls, the cycles of all operations. Simulation only.

library ieee;
use ieee.std_logic_1164.all;

library std;
use std.textio.all;

library firm;
use firm.firm_sim_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_sim_operation is
  generic (
    VECTORS  : string;
    RESULTS  : string;
    -- A file of the expected results, or none.
    EXPECTED : string;
    -- Widths of the operands and of the result.
    IN_BITS  : positive;
    OUT_BITS : positive;
    -- A result has a blank before as many digits; 0: none.
    LAST_BITS : natural := 0;
    SEED      : positive;
    -- Cycles of 100 in which one side of the handshake stalls.
    STALLS   : natural
  );
  port (
    clk       : in  std_logic;
    rst_n     : in  std_logic;
    -- All results have arrived, so the clock may stop.
    is_done   : out boolean;

    in_valid  : out std_logic                            := '0';
    in_ready  : in  std_logic;
    operands  : out std_logic_vector(IN_BITS-1 downto 0) := (others => '0');
    out_valid : in  std_logic;
    out_ready : out std_logic;
    result    : in  std_logic_vector(OUT_BITS-1 downto 0)
  );
end entity firm_sim_operation;

architecture simulation of firm_sim_operation is

  signal cycle    : natural   := 0;
  signal first    : natural   := 0;
  signal sent     : natural   := 0;
  signal all_sent : boolean   := false;
  signal has_all  : boolean   := false;
  signal takes    : std_logic := '0';

begin

  is_done   <= has_all;
  out_ready <= takes;

  count : process
  begin
    wait until rising_edge(clk);
    cycle <= cycle + 1;
  end process count;

  source : process
    file     vector_file : text open read_mode is VECTORS;
    variable vector      : line;
    variable bits        : bit_vector(IN_BITS-1 downto 0);
    variable random      : random_t := seeded(SEED, 1);
  begin
    wait until rising_edge(clk) and rst_n = '1';
    first <= cycle;
    while not endfile(vector_file) loop
      readline(vector_file, vector);
      for place in bits'range loop
        read(vector, bits(place));
      end loop;
      pause(clk, '1', random, STALLS);
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
    variable random      : random_t := seeded(SEED, 2);
    variable received    : natural := 0;
    variable latency     : natural := 0;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    while not (all_sent and received = sent) loop
      draw_ready(random, STALLS, takes);
      wait until rising_edge(clk);
      if out_valid = '1' and takes = '1' then
        write(row, to_bitvector(result(OUT_BITS-1 downto LAST_BITS)));
        if LAST_BITS > 0 then
          write(row, ' ');
          write(row, to_bitvector(result(LAST_BITS-1 downto 0)));
        end if;
        write_result(result_file, wanted_file, EXPECTED, row);
        received := received + 1;
        if received = 1 then
          -- The source shows its first operands in the cycle after `first`.
          latency := cycle - first - 1;
        end if;
      end if;
    end loop;
    print("latency " & integer'image(latency) & ", cycles " & integer'image(cycle - first));
    has_all <= true;
    wait;
  end process sink;

  -- A stalled result does not change.
  hold : process
    variable shown : std_logic_vector(OUT_BITS-1 downto 0);
  begin
    wait until rising_edge(clk) and out_valid = '1' and takes = '0';
    shown := result;
    wait until rising_edge(clk);
    assert out_valid = '1' and result = shown
      report "firm_sim_operation: a result has changed before it was accepted"
      severity failure;
  end process hold;

  watchdog : process
    variable known : natural;
  begin
    while not has_all loop
      known := sent;
      for k in 1 to 2000 loop
        wait until rising_edge(clk) or has_all;
      end loop;
      assert has_all or all_sent or sent /= known
        report "firm_sim_operation: no operands were accepted for 2000 cycles"
        severity failure;
    end loop;
    wait;
  end process watchdog;

end architecture simulation;
