-- SPDX-License-Identifier: Apache-2.0
-- Sends the frames of two sources through firm_net_merge. A row of a file, and of the results, is a frame: the number
-- of bytes, and the bytes.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_net_merge_tb is
  generic (
    FIRST_FILE    : string  := "first.txt";
    SECOND_FILE   : string  := "second.txt";
    RESULT_FILE   : string  := "merged.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- The chances, each cycle, that no byte comes, and that the reader takes nothing.
    SLOW_PERCENT  : integer := 0;
    STALL_PERCENT : integer := 0
  );
end entity firm_net_merge_tb;

architecture simulation of firm_net_merge_tb is

  constant LAST_CYCLES : positive := 8;

  signal clk    : std_logic := '0';
  signal rst_n  : std_logic := '0';
  signal done   : std_logic_vector(1 downto 0) := "00";
  signal over   : boolean   := false;

  signal s_tdata  : std_logic_vector(15 downto 0);
  signal s_tvalid : std_logic_vector(1 downto 0) := "00";
  signal s_tlast  : std_logic_vector(1 downto 0) := "00";
  signal s_tready : std_logic_vector(1 downto 0);

  signal tdata  : std_logic_vector(7 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;
  signal tready : std_logic := '0';

  function file_of(stream : natural) return string is
  begin
    if stream = 0 then
      return FIRST_FILE;
    end if;
    return SECOND_FILE;
  end function file_of;

begin

  clk <= not clk after 4 ns when not over else '0';

  streams : for stream in 0 to 1 generate

    play : process
      file frames       : text open read_mode is file_of(stream);
      variable row      : line;
      variable size     : integer;
      variable byte     : integer;
      variable random_1 : positive := SEED;
      variable random_2 : positive := 3 + stream;
      variable draw     : real;
    begin
      wait until rising_edge(clk) and rst_n = '1';
      while not endfile(frames) loop
        readline(frames, row);
        read(row, size);
        for place in 1 to size loop
          read(row, byte);
          uniform(random_1, random_2, draw);
          while 100.0 * draw < real(SLOW_PERCENT) loop
            wait until rising_edge(clk);
            uniform(random_1, random_2, draw);
          end loop;
          s_tdata(8*stream+7 downto 8*stream) <= std_logic_vector(to_unsigned(byte, 8));
          s_tvalid(stream) <= '1';
          if place = size then
            s_tlast(stream) <= '1';
          end if;
          wait until rising_edge(clk) and s_tready(stream) = '1';
          s_tvalid(stream) <= '0';
          s_tlast(stream)  <= '0';
        end loop;
      end loop;
      done(stream) <= '1';
      wait;
    end process play;

  end generate streams;

  u_merge : entity firm.firm_net_merge
    generic map (
      SOURCES => 2
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_tdata,
      s_axis_tvalid => s_tvalid,
      s_axis_tlast  => s_tlast,
      s_axis_tready => s_tready,
      m_axis_tdata  => tdata,
      m_axis_tvalid => tvalid,
      m_axis_tlast  => tlast,
      m_axis_tready => tready
    );

  take : process (clk)
    variable random_1 : positive := SEED;
    variable random_2 : positive := 7;
    variable draw     : real;
  begin
    if rising_edge(clk) then
      uniform(random_1, random_2, draw);
      tready <= '1';
      if 100.0 * draw < real(STALL_PERCENT) then
        tready <= '0';
      end if;
    end if;
  end process take;

  run : process
  begin
    for cycle in 1 to 4 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    wait until done = "11";
    for cycle in 1 to LAST_CYCLES loop
      wait until rising_edge(clk);
    end loop;
    over <= true;
    wait;
  end process run;

  record_frames : process
    file results     : text open write_mode is RESULT_FILE;
    file expected    : text open read_mode is existing(EXPECTED_FILE);
    variable row     : line;
    variable content : line;
    variable size    : natural := 0;
  begin
    while not over loop
      wait until rising_edge(clk) or over;
      next when over or rst_n = '0';
      next when tvalid = '0' or tready = '0';
      size := size + 1;
      write(content, ' ' & integer'image(to_integer(unsigned(tdata))));
      if tlast = '1' then
        write(row, integer'image(size) & content.all);
        write_result(results, expected, EXPECTED_FILE, row);
        deallocate(content);
        size := 0;
      end if;
    end loop;
    assert size = 0
      report "a frame without an end" severity failure;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are frames" severity failure;
    print("PASS");
    wait;
  end process record_frames;

end architecture simulation;
