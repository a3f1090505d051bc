-- SPDX-License-Identifier: Apache-2.0
-- A link's bytes from the host, without pins: a file has a number in each line, a byte, or -1 where bytes were lost, or
-- -2 for a cut. The frames that reach the system, which stalls at random, are printed in hexadecimal, one per line;
-- then the link's counts, and the number of its errors with code 12 and with code 7.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

entity link_faults is
  generic (
    WIDTH         : integer := 8;
    LONGEST       : integer := 100;
    BYTES_FILE    : string  := "bytes.txt";
    SEED          : integer := 1;
    STALL_PERCENT : integer := 30;
    -- The host observes the room.
    HAS_FLOW_CONTROL : boolean := true
  );
end entity link_faults;

architecture simulation of link_faults is

  constant PERIOD : time := 10 ns;

  signal clk     : std_logic := '0';
  signal rst_n   : std_logic := '0';
  signal is_over : boolean   := false;

  signal rx_data  : std_logic_vector(7 downto 0);
  signal rx_valid : std_logic := '0';
  signal rx_cut   : std_logic := '0';
  signal rx_lost  : std_logic := '0';
  signal room     : natural;

  signal tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;
  signal tready : std_logic := '0';

  signal link_error      : std_logic;
  signal link_error_code : std_logic_vector(3 downto 0);
  signal good_frames     : std_logic_vector(31 downto 0);
  signal broken_frames   : std_logic_vector(31 downto 0);
  signal lost_frames     : std_logic_vector(31 downto 0);
  signal refused_frames  : std_logic_vector(31 downto 0);

begin

  clk   <= not clk after PERIOD/2 when not is_over;
  rst_n <= '1' after 10*PERIOD;

  play : process
    file bytes      : text open read_mode is BYTES_FILE;
    variable row    : line;
    variable number : integer;
  begin
    wait for 20*PERIOD;
    while not endfile(bytes) loop
      readline(bytes, row);
      read(row, number);
      wait until falling_edge(clk) and (room > 2 or not HAS_FLOW_CONTROL);
      rx_valid <= '0';
      rx_lost  <= '0';
      rx_cut   <= '0';
      if number = -1 then
        rx_lost <= '1';
      elsif number = -2 then
        rx_cut <= '1';
      else
        rx_valid <= '1';
        rx_data  <= std_logic_vector(to_unsigned(number, 8));
      end if;
      wait until falling_edge(clk);
      rx_valid <= '0';
      rx_lost  <= '0';
      rx_cut   <= '0';
    end loop;
    wait for 5000*PERIOD;
    print("good " & integer'image(to_integer(unsigned(good_frames))));
    print("broken " & integer'image(to_integer(unsigned(broken_frames))));
    print("lost " & integer'image(to_integer(unsigned(lost_frames))));
    print("refused " & integer'image(to_integer(unsigned(refused_frames))));
    is_over <= true;
    wait;
  end process play;

  stall : process (clk)
    variable random_1 : positive := SEED;
    variable random_2 : positive := 17;
    variable draw     : real;
  begin
    if falling_edge(clk) then
      uniform(random_1, random_2, draw);
      tready <= '1';
      if 100.0 * draw < real(STALL_PERCENT) then
        tready <= '0';
      end if;
    end if;
  end process stall;

  show : process (clk, is_over)
    variable row      : line;
    variable checksum : natural := 0;
    variable too_long : natural := 0;
  begin
    if rising_edge(clk) and rst_n = '1' then
      if link_error = '1' and link_error_code = "1100" then
        checksum := checksum + 1;
      elsif link_error = '1' and link_error_code = "0111" then
        too_long := too_long + 1;
      end if;
      if tvalid = '1' and tready = '1' then
        for lane in 0 to WIDTH/8-1 loop
          if tkeep(lane) = '1' then
            write(row, to_hex(tdata(8*lane+7 downto 8*lane)));
          end if;
        end loop;
        if tlast = '1' then
          writeline(output, row);
        end if;
      end if;
    end if;
    if is_over'event and is_over then
      print("code_12 " & integer'image(checksum));
      print("code_7 " & integer'image(too_long));
    end if;
  end process show;

  u_streams : entity firm.firm_link_streams
    generic map (
      WIDTH   => WIDTH,
      LONGEST => LONGEST
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      rx_data         => rx_data,
      rx_valid        => rx_valid,
      rx_cut          => rx_cut,
      rx_lost         => rx_lost,
      room            => room,
      tx_data         => open,
      tx_valid        => open,
      tx_ready        => '1',
      tx_waiting      => open,
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
      good_frames     => good_frames,
      broken_frames   => broken_frames,
      lost_frames     => lost_frames,
      refused_frames  => refused_frames
    );

end architecture simulation;
