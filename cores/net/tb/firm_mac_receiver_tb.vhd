-- SPDX-License-Identifier: Apache-2.0
-- Plays bursts of bytes on the line of a GMII to the receiver, which passes its frames to the store. A row of the file
-- is a burst: the idle bytes before it, the byte at which the PHY reports an error or -1, the number of bytes, and the
-- bytes. The outputs of the receiver and of the store are written to one file each: see firm_sim_record.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_random_pkg.all;

entity firm_mac_receiver_tb is
  generic (
    LONGEST         : integer := 1514;
    DEPTH           : integer := 4096;
    LINE_FILE       : string  := "line.txt";
    RESULT_FILE     : string  := "received.txt";
    EXPECTED_FILE   : string  := "";
    STORED_FILE     : string  := "stored.txt";
    EXPECTED_STORED : string  := "";
    SEED            : integer := 1;
    -- The chances per cycle that the line does not count, and that the store's reader takes nothing.
    SLOW_PERCENT    : integer := 0;
    STALL_PERCENT   : integer := 0
  );
end entity firm_mac_receiver_tb;

architecture simulation of firm_mac_receiver_tb is

  -- Cycles for the store's reader after the last burst.
  constant LAST_CYCLES : positive := 4 * DEPTH;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal over  : boolean   := false;

  signal rx_step : std_logic                    := '0';
  signal rx_dv   : std_logic                    := '0';
  signal rx_er   : std_logic                    := '0';
  signal rxd     : std_logic_vector(7 downto 0) := (others => '0');

  signal received_tdata  : std_logic_vector(7 downto 0);
  signal received_tuser  : std_logic_vector(0 downto 0);
  signal received_tvalid : std_logic;
  signal received_tlast  : std_logic;
  signal is_good         : std_logic;
  signal is_broken       : std_logic;
  signal is_long         : std_logic;
  signal is_lost         : std_logic;

  signal stored_tdata  : std_logic_vector(7 downto 0);
  signal stored_tvalid : std_logic;
  signal stored_tlast  : std_logic;
  signal stored_tready : std_logic;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_receiver : entity firm.firm_mac_receiver
    generic map (
      LONGEST => LONGEST
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rx_step       => rx_step,
      rx_dv         => rx_dv,
      rx_er         => rx_er,
      rxd           => rxd,
      m_axis_tdata  => received_tdata,
      m_axis_tuser  => received_tuser,
      m_axis_tvalid => received_tvalid,
      m_axis_tlast  => received_tlast,
      is_good       => is_good,
      is_broken     => is_broken,
      is_long       => is_long
    );

  u_store : entity firm.firm_mac_store
    generic map (
      DEPTH => DEPTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => received_tdata,
      s_axis_tuser  => received_tuser,
      s_axis_tvalid => received_tvalid,
      s_axis_tlast  => received_tlast,
      m_axis_tdata  => stored_tdata,
      m_axis_tvalid => stored_tvalid,
      m_axis_tlast  => stored_tlast,
      m_axis_tready => stored_tready,
      is_lost       => is_lost
    );

  play : process
    file bursts     : text open read_mode is LINE_FILE;
    variable row    : line;
    variable idle   : integer;
    variable fault  : integer;
    variable size   : integer;
    variable byte   : integer;
    variable random : random_t := seeded(SEED, 3);

    procedure show(dv : in std_logic; er : in std_logic; value : in natural) is
    begin
      loop
        rx_dv   <= dv;
        rx_er   <= er;
        rxd     <= std_logic_vector(to_unsigned(value, 8));
        draw_ready(random, SLOW_PERCENT, rx_step);
        wait until rising_edge(clk);
        exit when rx_step = '1';
      end loop;
    end procedure show;

  begin
    end_reset(clk, '1', rst_n);
    while not endfile(bursts) loop
      readline(bursts, row);
      read(row, idle);
      read(row, fault);
      read(row, size);
      for place in 1 to idle loop
        show('0', '0', 0);
      end loop;
      for place in 0 to size-1 loop
        read(row, byte);
        if place = fault then
          show('1', '1', byte);
        else
          show('1', '0', byte);
        end if;
      end loop;
    end loop;
    for cycle in 1 to LAST_CYCLES loop
      show('0', '0', 0);
    end loop;
    over <= true;
    wait;
  end process play;

  u_received : entity firm.firm_sim_record
    generic map (
      RESULT_FILE   => RESULT_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SHOWS_USER    => true
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      over          => over,
      s_axis_tdata  => received_tdata,
      s_axis_tuser  => received_tuser,
      s_axis_tvalid => received_tvalid,
      s_axis_tlast  => received_tlast,
      s_axis_tready => open,
      is_good       => is_good,
      is_broken     => is_broken,
      is_long       => is_long
    );

  u_stored : entity firm.firm_sim_record
    generic map (
      RESULT_FILE   => STORED_FILE,
      EXPECTED_FILE => EXPECTED_STORED,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      over          => over,
      s_axis_tdata  => stored_tdata,
      s_axis_tvalid => stored_tvalid,
      s_axis_tlast  => stored_tlast,
      s_axis_tready => stored_tready,
      is_lost       => is_lost
    );

end architecture simulation;
