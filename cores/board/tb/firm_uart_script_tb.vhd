-- SPDX-License-Identifier: Apache-2.0
-- Drives a serial line by a script, and writes the resulting frames, one per line, in hexadecimal. Each line of the
-- script has a word of six characters and a number: `byte   171` sends a byte, `wrong  171` one with a low stop bit,
-- `break  0` a break, `glitch 0` a pulse too short for a start bit; `pause  40` leaves the line idle for 40 bits;
-- `system 0` stalls the system until `system 1`.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_uart_script_tb is
  generic (
    WIDTH       : integer := 8;
    LONGEST     : integer := 64;
    SCRIPT_FILE : string  := "script.txt";
    -- The expected output without `no room`; empty: not compared.
    EXPECTED_FILE : string := ""
  );
end entity firm_uart_script_tb;

architecture simulation of firm_uart_script_tb is

  constant CLOCK_HZ : integer := 1000000;
  constant BAUD     : integer := 125000;
  constant PERIOD   : time    := 1 us;
  constant BIT_TIME : time    := 8 us;

  signal clk     : std_logic := '0';
  signal rst_n   : std_logic := '0';
  signal is_over : boolean   := false;

  signal rxd   : std_logic := '1';
  signal rts_n : std_logic;

  signal tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;
  signal tready : std_logic := '1';

  signal link_error      : std_logic;
  signal link_error_code : std_logic_vector(3 downto 0);

begin

  clk   <= not clk after PERIOD/2 when not is_over;
  rst_n <= '1' after 10*PERIOD;

  play : process
    file script      : text open read_mode is SCRIPT_FILE;
    variable row     : line;
    variable word    : string(1 to 6);
    variable number  : integer;
    variable data    : std_logic_vector(7 downto 0);
    variable stop    : std_logic;
  begin
    wait for 20*PERIOD;
    while not endfile(script) loop
      readline(script, row);
      read(row, word);
      read(row, number);
      if word = "byte  " or word = "wrong " then
        data := std_logic_vector(to_unsigned(number, 8));
        stop := '1';
        if word = "wrong " then
          stop := '0';
        end if;
        rxd <= '0';
        wait for BIT_TIME;
        for place in 0 to 7 loop
          rxd <= data(place);
          wait for BIT_TIME;
        end loop;
        rxd <= stop;
        wait for BIT_TIME;
        rxd <= '1';
        -- Without it, the byte after a low stop bit would have no start bit.
        if stop = '0' then
          wait for BIT_TIME;
        end if;
      elsif word = "break " then
        rxd <= '0';
        wait for 12*BIT_TIME;
        rxd <= '1';
        wait for BIT_TIME;
      elsif word = "glitch" then
        rxd <= '0';
        wait for BIT_TIME/4;
        rxd <= '1';
        wait for BIT_TIME;
      elsif word = "pause " then
        wait for number*BIT_TIME;
      elsif word = "system" then
        wait until falling_edge(clk);
        tready <= '0';
        if number = 1 then
          tready <= '1';
        end if;
      else
        report "unknown word " & word severity failure;
      end if;
    end loop;
    wait for 40*BIT_TIME;
    is_over <= true;
    wait;
  end process play;

  show : process (clk, is_over)
    file wanted_file : text open read_mode is existing(EXPECTED_FILE);
    variable row     : line;
    variable said    : line;
  begin
    assert not is_over or endfile(wanted_file) report "results are missing" severity failure;
    if rising_edge(clk) and rst_n = '1' then
      if link_error = '1' then
        write(said, "error " & integer'image(to_integer(unsigned(link_error_code))));
        write_result(output, wanted_file, EXPECTED_FILE, said);
      end if;
      if tvalid = '1' and tready = '1' then
        for lane in 0 to WIDTH/8-1 loop
          if tkeep(lane) = '1' then
            write(row, to_hex(tdata(8*lane+7 downto 8*lane)));
          end if;
        end loop;
        if tlast = '1' then
          write_result(output, wanted_file, EXPECTED_FILE, row);
        end if;
      end if;
    end if;
  end process show;

  watch_room : process (rts_n)
  begin
    if rising_edge(rts_n) and rst_n = '1' then
      print("no room");
    end if;
  end process watch_room;

  u_link : entity firm.firm_uart_link
    generic map (
      WIDTH    => WIDTH,
      CLOCK_HZ => CLOCK_HZ,
      BAUD     => BAUD,
      LONGEST  => LONGEST
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      uart_rxd        => rxd,
      uart_txd        => open,
      uart_rts_n      => rts_n,
      uart_cts_n      => '0',
      m_axis_tdata    => tdata,
      m_axis_tkeep    => tkeep,
      m_axis_tvalid   => tvalid,
      m_axis_tlast    => tlast,
      m_axis_tready   => tready,
      s_axis_tdata    => (others => '0'),
      s_axis_tkeep    => (others => '0'),
      s_axis_tvalid   => '0',
      s_axis_tlast    => '0',
      s_axis_tready   => open,
      link_error      => link_error,
      link_error_code => link_error_code,
      good_frames     => open,
      broken_frames   => open,
      lost_frames     => open,
      refused_frames  => open
    );

end architecture simulation;
