-- SPDX-License-Identifier: Apache-2.0
-- Plays the rows of a file as frames: the cycles before the frame, in addition to GAP_CYCLES, whether it is aborted
-- (0 or 1), the number of bytes, and the bytes. Ends the reset before. Without m_axis_tready, there is no
-- back-pressure, as after a MAC's receiver.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_random_pkg.all;

entity firm_sim_rows is
  generic (
    FRAME_FILE   : string;
    SEED         : integer := 1;
    SLOW_PERCENT : integer := 0;  -- the chance, each cycle, that no byte is sent
    GAP_CYCLES   : natural := 6;  -- between two frames, at least
    LAST_CYCLES  : natural := 8   -- after the last frame
  );
  port (
    clk   : in  std_logic;
    rst_n : out std_logic;

    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic := '1';

    over : out boolean
  );
end entity firm_sim_rows;

architecture simulation of firm_sim_rows is

begin

  play : process
    file frames     : text open read_mode is FRAME_FILE;
    variable row    : line;
    variable before : integer;
    variable abort  : integer;
    variable size   : integer;
    variable byte   : integer;
    variable random : random_t := seeded(SEED, 3);

    procedure wait_for(cycles : in natural) is
    begin
      for cycle in 1 to cycles loop
        wait until rising_edge(clk);
      end loop;
    end procedure wait_for;

  begin
    over          <= false;
    rst_n         <= '0';
    m_axis_tdata  <= (others => 'X');
    m_axis_tuser  <= "0";
    m_axis_tvalid <= '0';
    m_axis_tlast  <= '0';
    end_reset(clk, '1', rst_n);
    while not endfile(frames) loop
      readline(frames, row);
      read(row, before);
      read(row, abort);
      read(row, size);
      wait_for(before + GAP_CYCLES);
      for place in 0 to size-1 loop
        read(row, byte);
        pause(clk, '1', random, SLOW_PERCENT);
        m_axis_tvalid <= '1';
        m_axis_tdata  <= std_logic_vector(to_unsigned(byte, 8));
        m_axis_tlast  <= '0';
        m_axis_tuser  <= "0";
        if place = size-1 then
          m_axis_tlast <= '1';
          if abort = 1 then
            m_axis_tuser <= "1";
          end if;
        end if;
        wait until rising_edge(clk) and m_axis_tready = '1';
        m_axis_tvalid <= '0';
        m_axis_tdata  <= (others => 'X');
      end loop;
    end loop;
    wait_for(LAST_CYCLES);
    over <= true;
    wait;
  end process play;

end architecture simulation;
