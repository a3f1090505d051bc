-- SPDX-License-Identifier: Apache-2.0
-- The simulation host against a system that is a wire: what it sends comes straight back. FAULT makes the wire break
-- the stream in one way, so that a test can see that the host finds it.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_sim_host_tb is
  generic (
    WIDTH         : integer := 8;
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    RECEIVED_FILE : string  := "received.txt";
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;
    SHOWN         : integer := 10;
    WATCHDOG      : integer := 200;
    QUIET         : integer := 50;
    -- The way to break the stream; "none" for none. The process `spoil` shows them all.
    FAULT : string := "none");
end entity firm_sim_host_tb;

architecture simulation of firm_sim_host_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tid    : std_logic_vector(7 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal id_error    : std_logic := '0';
  signal frame_error : std_logic_vector(0 downto 0) := "0";

  signal first_r : std_logic := '1';
  signal id_r    : std_logic_vector(7 downto 0);
  signal beats_r : natural := 0;
  signal idle_r  : natural := 0;  -- cycles since the last beat
  signal held_r  : boolean := false;  -- a beat has waited for a cycle

begin

  u_host : entity firm.firm_sim_host
    generic map (
      WIDTH         => WIDTH,
      ERRORS        => 1,
      STIMULUS_FILE => STIMULUS_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      RECEIVED_FILE => RECEIVED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      SHOWN         => SHOWN,
      WATCHDOG      => WATCHDOG,
      QUIET         => QUIET)
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => out_tdata,
      m_axis_tkeep  => out_tkeep,
      m_axis_tvalid => out_tvalid,
      m_axis_tlast  => out_tlast,
      m_axis_tready => out_tready,
      s_axis_tdata  => in_tdata,
      s_axis_tkeep  => in_tkeep,
      s_axis_tid    => in_tid,
      s_axis_tvalid => in_tvalid,
      s_axis_tlast  => in_tlast,
      s_axis_tready => in_tready,
      id_error      => id_error,
      frame_error   => frame_error);

  watch_frames : process (clk)
  begin
    if rising_edge(clk) then
      held_r <= out_tvalid = '1' and out_tready = '0';
      idle_r <= idle_r + 1;
      if out_tvalid = '1' and out_tready = '1' then
        idle_r  <= 0;
        beats_r <= beats_r + 1;
        first_r <= out_tlast;
        if first_r = '1' then
          id_r <= out_tdata(7 downto 0);
        end if;
      end if;
    end if;
  end process watch_frames;

  spoil : process (out_tdata, out_tkeep, out_tvalid, out_tlast, in_tready, first_r, id_r, beats_r, idle_r, held_r)
    variable is_third  : boolean;
    variable is_fourth : boolean;
  begin
    is_third  := beats_r = 2 and out_tvalid = '1';
    is_fourth := beats_r = 3 and out_tvalid = '1';

    out_tready <= in_tready;
    in_tdata   <= out_tdata;
    in_tkeep   <= out_tkeep;
    in_tvalid  <= out_tvalid;
    in_tlast   <= out_tlast;
    in_tid     <= id_r;
    if first_r = '1' then
      in_tid <= out_tdata(7 downto 0);
    end if;
    id_error       <= '0';
    frame_error(0) <= '0';

    if FAULT = "unstable" and held_r then
      in_tdata <= not out_tdata;
    elsif FAULT = "withdrawn" and held_r then
      in_tvalid  <= '0';
      out_tready <= '0';
    elsif FAULT = "undefined" and is_third then
      in_tdata(3) <= 'U';
    elsif FAULT = "unknown_valid" and is_third then
      in_tvalid <= 'X';
    elsif FAULT = "sparse" and is_third then
      in_tkeep(0) <= '0';
    elsif FAULT = "partial" and is_third then
      in_tkeep(WIDTH/8-1) <= '0';
    elsif FAULT = "empty" and is_third then
      in_tkeep <= (in_tkeep'range => '0');
    elsif FAULT = "wrong_tid" and is_third then
      in_tid <= x"a5";
    elsif FAULT = "unknown_last" and is_third then
      in_tlast <= 'X';
    elsif FAULT = "early_last" and is_third then
      in_tlast <= '1';
    elsif FAULT = "late_last" and is_fourth then
      in_tlast <= '0';
    elsif FAULT = "unknown_ready" and is_third then
      out_tready <= 'X';
    elsif FAULT = "stuck" and beats_r >= 2 then
      out_tready <= '0';
      in_tvalid  <= '0';
    elsif FAULT = "mute" then
      out_tready <= '1';
      in_tvalid  <= '0';
    elsif FAULT = "late_surplus" and beats_r > 0 and idle_r = 30 then
      in_tvalid <= '1';
      in_tdata  <= (in_tdata'range => '0');
      in_tkeep  <= (in_tkeep'range => '1');
      in_tid    <= x"00";
      in_tlast  <= '1';
    elsif FAULT = "endless" and beats_r >= 2 then
      in_tvalid <= '1';
      in_tdata  <= (in_tdata'range => '0');
      in_tkeep  <= (in_tkeep'range => '1');
      in_tlast  <= '0';
    elsif FAULT = "id_pulse" and is_third then
      id_error <= '1';
    elsif FAULT = "frame_pulse" and is_third then
      frame_error(0) <= '1';
    elsif FAULT = "unknown_pulse" and is_third then
      id_error <= 'U';
    end if;
  end process spoil;

end architecture simulation;
