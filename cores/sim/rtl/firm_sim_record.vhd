-- SPDX-License-Identifier: Apache-2.0
-- Takes a stream of bytes with random stalls and writes it to a file. A row is a frame: the number of bytes, and the
-- bytes; with SHOWS_USER, tuser of the last byte before them. Each cycle of a pulse is a separate row, its name:
-- `dropped`. The rows are compared with those of EXPECTED_FILE, if it has a name. Prints PASS when `over` ends the run.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_sim_record is
  generic (
    RESULT_FILE   : string;
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;  -- the chance, each cycle, that nothing is taken
    SHOWS_USER    : boolean := false
  );
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;
    over  : in  boolean;

    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    is_dropped : in  std_logic := '0';
    is_lost    : in  std_logic := '0';
    is_good    : in  std_logic := '0';
    is_broken  : in  std_logic := '0';
    is_long    : in  std_logic := '0'
  );
end entity firm_sim_record;

architecture simulation of firm_sim_record is

  signal ready_r : std_logic := '0';

begin

  s_axis_tready <= ready_r;

  stall(clk, SEED, 5, STALL_PERCENT, ready_r);

  take : process
    file results     : text open write_mode is RESULT_FILE;
    file expected    : text open read_mode is existing(EXPECTED_FILE);
    variable row     : line;
    variable content : line;
    variable size    : natural := 0;

    procedure note(what : in string) is
    begin
      write(row, what);
      write_result(results, expected, EXPECTED_FILE, row);
    end procedure note;

    procedure note_pulse(pulse : in std_logic; name : in string) is
    begin
      if pulse = '1' then
        note(name);
      end if;
    end procedure note_pulse;

  begin
    while not over loop
      wait until rising_edge(clk) or over;
      next when over or rst_n = '0';
      note_pulse(is_dropped, "dropped");
      note_pulse(is_lost, "lost");
      note_pulse(is_good, "good");
      note_pulse(is_broken, "broken");
      note_pulse(is_long, "long");
      next when s_axis_tvalid = '0' or ready_r = '0';
      size := size + 1;
      write(content, ' ' & integer'image(to_integer(unsigned(s_axis_tdata))));
      if s_axis_tlast = '1' then
        if SHOWS_USER then
          write(row, integer'image(to_integer(unsigned(s_axis_tuser))) & ' ');
        end if;
        note(integer'image(size) & content.all);
        deallocate(content);
        size := 0;
      end if;
    end loop;
    assert size = 0
      report "a frame without an end" severity failure;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are rows" severity failure;
    print("PASS");
    wait;
  end process take;

end architecture simulation;
