-- SPDX-License-Identifier: Apache-2.0
-- Sends frames to the board 192.0.2.2, 02:00:00:00:00:02, of which MAC_END is the last byte. A row of the file is a
-- frame: the cycles before it, whether it is aborted (0 or 1), the number of bytes, and the bytes. A row of the results
-- is a millisecond, and its request or event: `report`, `probe` or `taken`. A packet is sent up to four cycles after
-- its request.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_net_presence_tb is
  generic (
    FRAME_FILE    : string  := "frames.txt";
    RESULT_FILE   : string  := "presence.txt";
    EXPECTED_FILE : string  := "";
    MAC_END       : integer := 2;
    SEED          : integer := 1;
    SLOW_PERCENT  : integer := 0;    -- the chance per cycle of no byte
    TICK_CYCLES   : integer := 8;    -- of a millisecond
    LAST_TICKS    : integer := 1100; -- after the last frame
    IN_USE        : boolean := true  -- the board uses its address
  );
end entity firm_net_presence_tb;

architecture simulation of firm_net_presence_tb is

  constant LONGEST_DELAY : real := 4.0;
  constant MAC           : std_logic_vector(47 downto 0) := x"0200000000" & std_logic_vector(to_unsigned(MAC_END, 8));

  signal clk   : std_logic := '0';
  signal rst_n : std_logic;
  signal over  : boolean;
  signal tick  : std_logic := '0';
  signal ms    : natural   := 0;

  signal tdata  : std_logic_vector(7 downto 0);
  signal tuser  : std_logic_vector(0 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;

  signal wants_report : std_logic;
  signal wants_probe  : std_logic;
  signal is_sent      : std_logic := '0';
  signal is_taken     : std_logic;
  signal is_in_use    : std_logic;

begin

  clk       <= not clk after 4 ns when not over else '0';
  is_in_use <= '1' when IN_USE else '0';

  u_presence : entity firm.firm_net_presence
    port map (
      clk           => clk,
      rst_n         => rst_n,
      tick          => tick,
      mac           => MAC,
      address       => x"c0000202",
      is_in_use     => is_in_use,
      group_ip      => x"efff0001",
      s_axis_tdata  => tdata,
      s_axis_tuser  => tuser,
      s_axis_tvalid => tvalid,
      s_axis_tlast  => tlast,
      wants_report  => wants_report,
      wants_probe   => wants_probe,
      is_sent       => is_sent,
      is_taken      => is_taken
    );

  u_rows : entity firm.firm_sim_rows
    generic map (
      FRAME_FILE   => FRAME_FILE,
      SEED         => SEED,
      SLOW_PERCENT => SLOW_PERCENT,
      LAST_CYCLES  => LAST_TICKS * TICK_CYCLES
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => tdata,
      m_axis_tuser  => tuser,
      m_axis_tvalid => tvalid,
      m_axis_tlast  => tlast,
      over          => over
    );

  keep_time(clk, rst_n, TICK_CYCLES, tick, ms);

  record_presence : process
    file results      : text open write_mode is RESULT_FILE;
    file expected     : text open read_mode is existing(EXPECTED_FILE);
    variable row      : line;
    variable random_1 : positive := SEED;
    variable random_2 : positive := 5;
    variable draw     : real;
    variable delay    : natural := 0;

    procedure note(what : in string) is
    begin
      write(row, integer'image(ms) & ' ' & what);
      write_result(results, expected, EXPECTED_FILE, row);
    end procedure note;

  begin
    while not over loop
      wait until rising_edge(clk) or over;
      next when over or rst_n = '0';
      if is_taken = '1' then
        note("taken");
      end if;
      if is_sent = '1' then
        is_sent <= '0';
      elsif delay /= 0 then
        delay := delay - 1;
        if delay = 0 then
          is_sent <= '1';
        end if;
      elsif wants_report = '1' or wants_probe = '1' then
        assert (wants_report and wants_probe) = '0'
          report "two packets at once" severity failure;
        if wants_report = '1' then
          note("report");
        else
          note("probe");
        end if;
        uniform(random_1, random_2, draw);
        delay := 1 + integer(trunc(LONGEST_DELAY * draw));
      end if;
    end loop;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are events" severity failure;
    print("PASS");
    wait;
  end process record_presence;

end architecture simulation;
