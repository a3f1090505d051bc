-- SPDX-License-Identifier: Apache-2.0
-- Sends frames through the transmitter. A row of the file is a frame: the cycles before it, whether it is aborted (0 or
-- 1), the byte before which the source pauses for a while or -1, the number of bytes, and the bytes. The bursts on the
-- line go to a file, a row each, as firm_mac_receiver_tb reads them: the idle bytes before it, the first byte with
-- `tx_er` or -1, the number of bytes, and the bytes.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_mac_transmitter_tb is
  generic (
    LONGEST       : integer := 1514;
    FRAME_FILE    : string  := "frames.txt";
    RESULT_FILE   : string  := "sent.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- The chance per cycle that the line does not count.
    SLOW_PERCENT  : integer := 0
  );
end entity firm_mac_transmitter_tb;

architecture simulation of firm_mac_transmitter_tb is

  -- Of the source, within a frame.
  constant PAUSE_CYCLES : positive := 100;
  -- Idle cycles of the line at the end.
  constant LAST_CYCLES  : positive := 1000;

  signal clk     : std_logic := '0';
  signal rst_n   : std_logic := '0';
  signal is_done : boolean   := false;
  signal over    : boolean   := false;

  signal s_tdata  : std_logic_vector(7 downto 0) := (others => '0');
  signal s_tuser  : std_logic_vector(0 downto 0) := "0";
  signal s_tvalid : std_logic                    := '0';
  signal s_tlast  : std_logic                    := '0';
  signal s_tready : std_logic;

  signal tx_step    : std_logic := '0';
  signal step_r     : std_logic := '0';  -- the line shows a new byte
  signal tx_en      : std_logic;
  signal tx_er      : std_logic;
  signal txd        : std_logic_vector(7 downto 0);
  signal is_sent    : std_logic;
  signal is_spoiled : std_logic;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_transmitter : entity firm.firm_mac_transmitter
    generic map (
      LONGEST => LONGEST
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_tdata,
      s_axis_tuser  => s_tuser,
      s_axis_tvalid => s_tvalid,
      s_axis_tlast  => s_tlast,
      s_axis_tready => s_tready,
      tx_step       => tx_step,
      tx_en         => tx_en,
      tx_er         => tx_er,
      txd           => txd,
      is_sent       => is_sent,
      is_spoiled    => is_spoiled
    );

  stall(clk, SEED, 3, SLOW_PERCENT, tx_step);

  note_step : process (clk)
  begin
    if rising_edge(clk) then
      step_r <= tx_step and rst_n;
    end if;
  end process note_step;

  send : process
    file frames     : text open read_mode is FRAME_FILE;
    variable row    : line;
    variable before : integer;
    variable abort  : integer;
    variable pause  : integer;
    variable size   : integer;
    variable byte   : integer;
    variable quiet  : natural;

    procedure wait_for(cycles : in natural) is
    begin
      for cycle in 1 to cycles loop
        wait until rising_edge(clk);
      end loop;
    end procedure wait_for;

  begin
    end_reset(clk, '1', rst_n);
    while not endfile(frames) loop
      readline(frames, row);
      read(row, before);
      read(row, abort);
      read(row, pause);
      read(row, size);
      wait_for(before);
      for place in 0 to size-1 loop
        if place = pause then
          wait_for(PAUSE_CYCLES);
        end if;
        read(row, byte);
        s_tvalid <= '1';
        s_tdata  <= std_logic_vector(to_unsigned(byte, 8));
        s_tlast  <= '0';
        s_tuser  <= "0";
        if place = size-1 then
          s_tlast <= '1';
          if abort = 1 then
            s_tuser <= "1";
          end if;
        end if;
        loop
          wait until rising_edge(clk);
          exit when s_tready = '1';
        end loop;
        s_tvalid <= '0';
      end loop;
    end loop;
    quiet := 0;
    while quiet < LAST_CYCLES loop
      wait until rising_edge(clk);
      quiet := quiet + 1;
      if tx_en = '1' then
        quiet := 0;
      end if;
    end loop;
    is_done <= true;
    wait;
  end process send;

  record_bursts : process
    file results     : text open write_mode is RESULT_FILE;
    file expected    : text open read_mode is existing(EXPECTED_FILE);
    variable row     : line;
    variable content : line;
    variable idle    : natural := 0;
    variable fault   : integer := -1;
    variable size    : natural := 0;
    variable sent    : natural := 0;
    variable spoiled : natural := 0;
  begin
    while not is_done loop
      wait until rising_edge(clk) or is_done;
      next when is_done or rst_n = '0';
      if is_sent = '1' then
        sent := sent + 1;
      end if;
      if is_spoiled = '1' then
        spoiled := spoiled + 1;
      end if;
      next when step_r = '0';
      if tx_en = '1' then
        write(content, ' ' & integer'image(to_integer(unsigned(txd))));
        if tx_er = '1' and fault = -1 then
          fault := size;
        end if;
        size := size + 1;
      elsif size = 0 then
        idle := idle + 1;
      else
        write(row, integer'image(idle) & ' ' & integer'image(fault) & ' ' & integer'image(size) & content.all);
        write_result(results, expected, EXPECTED_FILE, row);
        deallocate(content);
        size  := 0;
        idle  := 1;
        fault := -1;
      end if;
    end loop;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are bursts" severity failure;
    print("sent " & integer'image(sent) & " spoiled " & integer'image(spoiled));
    print("PASS");
    over <= true;
    wait;
  end process record_bursts;

end architecture simulation;
