-- SPDX-License-Identifier: Apache-2.0
-- A system that is a wire, for benches of simulated hosts: its input is its output. FAULT makes it violate the protocol
-- in one way, so that a test can check that the host detects it.
library ieee;
use ieee.std_logic_1164.all;

entity firm_sim_wire is
  generic (
    WIDTH : integer := 8;
    -- The way to break the stream, or "none". The process `spoil` lists all ways.
    FAULT : string := "none"
  );
  port (
    clk : in std_logic;

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tid    : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    id_error    : out std_logic;
    frame_error : out std_logic_vector(0 downto 0)
  );
end entity firm_sim_wire;

architecture simulation of firm_sim_wire is

  signal tready  : std_logic;
  signal first_r : std_logic := '1';
  signal id_r    : std_logic_vector(7 downto 0);
  signal beats_r : natural := 0;
  signal idle_r  : natural := 0;  -- cycles since the last beat
  signal held_r  : boolean := false;  -- a beat has waited for a cycle

begin

  s_axis_tready <= tready;

  watch_frames : process (clk)
  begin
    if rising_edge(clk) then
      held_r <= s_axis_tvalid = '1' and tready = '0';
      idle_r <= idle_r + 1;
      if s_axis_tvalid = '1' and tready = '1' then
        idle_r  <= 0;
        beats_r <= beats_r + 1;
        first_r <= s_axis_tlast;
        if first_r = '1' then
          id_r <= s_axis_tdata(7 downto 0);
        end if;
      end if;
    end if;
  end process watch_frames;

  m_axis_tuser <= s_axis_tuser;

  spoil : process (s_axis_tdata, s_axis_tkeep, s_axis_tvalid, s_axis_tlast, m_axis_tready,
                   first_r, id_r, beats_r, idle_r, held_r)
    variable is_third  : boolean;
    variable is_fourth : boolean;
  begin
    is_third  := beats_r = 2 and s_axis_tvalid = '1';
    is_fourth := beats_r = 3 and s_axis_tvalid = '1';

    tready <= m_axis_tready;
    m_axis_tdata   <= s_axis_tdata;
    m_axis_tkeep   <= s_axis_tkeep;
    m_axis_tvalid  <= s_axis_tvalid;
    m_axis_tlast   <= s_axis_tlast;
    m_axis_tid     <= id_r;
    if first_r = '1' then
      m_axis_tid <= s_axis_tdata(7 downto 0);
    end if;
    id_error       <= '0';
    frame_error(0) <= '0';

    if FAULT = "unstable" and held_r then
      m_axis_tdata <= not s_axis_tdata;
    elsif FAULT = "withdrawn" and held_r then
      m_axis_tvalid  <= '0';
      tready <= '0';
    elsif FAULT = "undefined" and is_third then
      m_axis_tdata(3) <= 'U';
    elsif FAULT = "unknown_valid" and is_third then
      m_axis_tvalid <= 'X';
    elsif FAULT = "sparse" and is_third then
      m_axis_tkeep(0) <= '0';
    elsif FAULT = "partial" and is_third then
      m_axis_tkeep(WIDTH/8-1) <= '0';
    elsif FAULT = "empty" and is_third then
      m_axis_tkeep <= (m_axis_tkeep'range => '0');
    elsif FAULT = "wrong_tid" and is_third then
      m_axis_tid <= x"a5";
    elsif FAULT = "unknown_last" and is_third then
      m_axis_tlast <= 'X';
    elsif FAULT = "early_last" and is_third then
      m_axis_tlast <= '1';
    elsif FAULT = "late_last" and is_fourth then
      m_axis_tlast <= '0';
    elsif FAULT = "unknown_ready" and is_third then
      tready <= 'X';
    elsif FAULT = "stuck" and beats_r >= 2 then
      tready <= '0';
      m_axis_tvalid  <= '0';
    elsif FAULT = "mute" then
      tready <= '1';
      m_axis_tvalid  <= '0';
    elsif FAULT = "late_surplus" and beats_r > 0 and idle_r = 30 then
      m_axis_tvalid <= '1';
      m_axis_tdata  <= (m_axis_tdata'range => '0');
      m_axis_tkeep  <= (m_axis_tkeep'range => '1');
      m_axis_tid    <= x"00";
      m_axis_tlast  <= '1';
    elsif FAULT = "endless" and beats_r >= 2 then
      m_axis_tvalid <= '1';
      m_axis_tdata  <= (m_axis_tdata'range => '0');
      m_axis_tkeep  <= (m_axis_tkeep'range => '1');
      m_axis_tlast  <= '0';
    elsif FAULT = "id_pulse" and is_third then
      id_error <= '1';
    elsif FAULT = "frame_pulse" and is_third then
      frame_error(0) <= '1';
    elsif FAULT = "unknown_pulse" and is_third then
      id_error <= 'U';
    end if;
  end process spoil;

end architecture simulation;
