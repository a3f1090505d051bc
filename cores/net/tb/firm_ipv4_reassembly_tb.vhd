-- SPDX-License-Identifier: Apache-2.0
-- Sends frames to the host 192.0.2.2, 02:00:00:00:00:02. A row of the file is a frame: the cycles before it, whether
-- it is aborted (0 or 1), the number of bytes, and the bytes. A row of the results is an output frame in the same
-- form without the cycles; or `dropped`, or `lost`. After a long packet, the user is busy for some cycles; the next
-- one begins after them, or when its time is over.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_ipv4_reassembly_tb is
  generic (
    PACKETS       : integer := 2;
    BYTES         : integer := 2048;
    DEPTH         : integer := 4096;
    TICKS         : integer := 1000;
    LONG          : integer := 4096;
    HOLD_TICKS    : integer := 300;
    BUSY_CYCLES   : integer := 0;     -- after a long packet
    FRAME_FILE    : string  := "frames.txt";
    RESULT_FILE   : string  := "packets.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    SLOW_PERCENT  : integer := 0;     -- the chance per cycle of no byte
    TICK_CYCLES   : integer := 1000;  -- of a millisecond
    LAST_CYCLES   : integer := 20000  -- after the last frame
  );
end entity firm_ipv4_reassembly_tb;

architecture simulation of firm_ipv4_reassembly_tb is

  constant GAP  : positive := 6;   -- cycles between frames, at least
  constant HEAD : positive := 34;  -- header bytes, which LONG does not count
  constant REST : positive := 20;  -- cycles until the user begins

  signal clk   : std_logic := '0';
  signal rst_n : std_logic;
  signal over  : boolean;
  signal tick  : std_logic := '0';
  signal ms    : natural   := 0;

  signal sent       : bytes_t;
  signal received   : bytes_t;
  signal rests      : std_logic := '1';
  signal is_dropped : std_logic;
  signal is_lost    : std_logic;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_reassembly : entity firm.firm_ipv4_reassembly
    generic map (
      PACKETS    => PACKETS,
      BYTES      => BYTES,
      DEPTH      => DEPTH,
      TICKS      => TICKS,
      LONG       => LONG,
      HOLD_TICKS => HOLD_TICKS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      tick          => tick,
      mac           => x"020000000002",
      address       => x"c0000202",
      s_axis_tdata  => sent.tdata,
      s_axis_tuser  => sent.tuser,
      s_axis_tvalid => sent.tvalid,
      s_axis_tlast  => sent.tlast,
      m_axis_tdata  => received.tdata,
      m_axis_tuser  => received.tuser,
      m_axis_tvalid => received.tvalid,
      m_axis_tlast  => received.tlast,
      rests         => rests,
      is_dropped    => is_dropped,
      is_lost       => is_lost
    );

  keep_time(clk, rst_n, TICK_CYCLES, tick, ms);

  u_exchange : entity firm.firm_sim_exchange
    generic map (
      FRAME_FILE    => FRAME_FILE,
      RESULT_FILE   => RESULT_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      SLOW_PERCENT  => SLOW_PERCENT,
      LAST_CYCLES   => LAST_CYCLES,
      SHOWS_USER    => true
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      over       => over,
      sent       => sent,
      received   => received,
      ready      => open,
      is_dropped => is_dropped,
      is_lost    => is_lost
    );

  check_gaps : process (clk)
    variable is_open : boolean := false;
    variable idle    : natural := GAP;
  begin
    if rising_edge(clk) and rst_n = '1' then
      idle := idle + 1;
      if received.tvalid = '1' then
        assert is_open or idle > GAP
          report "two frames without a gap" severity failure;
        idle    := 0;
        is_open := received.tlast = '0';
      end if;
    end if;
  end process check_gaps;

  be_busy : process (clk)
    variable count   : natural := 0;
    variable left    : natural := 0;  -- cycles until the user has taken all of a long packet
    variable since   : natural := 0;  -- the millisecond of its arrival
    variable is_late : boolean := false;
  begin
    if rising_edge(clk) and rst_n = '1' then
      if left /= 0 then
        left := left - 1;
      end if;
      if received.tvalid = '1' then
        if count = 0 then
          is_late := left = 0 or ms - since >= HOLD_TICKS-1;
        end if;
        count := count + 1;
        if received.tlast = '1' then
          if count >= HEAD+LONG and received.tuser = "0" then
            assert is_late
              report "a long packet begins while the user is busy" severity failure;
            left  := REST+BUSY_CYCLES;
            since := ms;
          end if;
          count := 0;
        end if;
      end if;
      rests <= '1';
      if left /= 0 and left <= BUSY_CYCLES then
        rests <= '0';
      end if;
    end if;
  end process be_busy;

end architecture simulation;
