-- SPDX-License-Identifier: Apache-2.0
-- Tests the length buffer between the simulation host's two streams. The buffer itself must not pause within a frame.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;

entity firm_axis_length_buffer_tb is
  generic (
    WIDTH         : integer := 8;
    DEPTH         : integer := 64;
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    SEED          : integer := 1;
    -- The host's stalls, and stalls of the sink only.
    STALL_PERCENT      : integer := 0;
    SINK_STALL_PERCENT : integer := 0;
    -- The number of publisher errors at the beginning.
    PUBLISHER_ERRORS : integer := 0;
    WATCHDOG         : integer := 2000;
    QUIET            : integer := 200
  );
end entity firm_axis_length_buffer_tb;

architecture simulation of firm_axis_length_buffer_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tuser  : std_logic_vector(0 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal sent_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal sent_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal sent_tvalid : std_logic;
  signal sent_tlast  : std_logic;
  signal sent_tready : std_logic;

  signal is_within_r : boolean := false;  -- a frame is being sent

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tid    : std_logic_vector(7 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

  signal s_frame_error    : std_logic := '0';
  signal frame_error      : std_logic_vector(0 downto 0);
  signal frame_error_code : std_logic_vector(3 downto 0);

begin

  u_host : entity firm.firm_sim_host
    generic map (
      WIDTH         => WIDTH,
      STIMULUS_FILE => STIMULUS_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      SHOWN         => 0,
      WATCHDOG      => WATCHDOG,
      QUIET         => QUIET
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => in_tdata,
      m_axis_tkeep  => in_tkeep,
      m_axis_tuser  => in_tuser,
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready,
      s_axis_tdata  => out_tdata,
      s_axis_tkeep  => out_tkeep,
      s_axis_tid    => out_tid,
      s_axis_tvalid => out_tvalid,
      s_axis_tlast  => out_tlast,
      s_axis_tready => out_tready,
      frame_error   => frame_error
    );

  u_part : entity firm.firm_axis_length_buffer
    generic map (
      WIDTH => WIDTH,
      DEPTH => DEPTH
    )
    port map (
      clk                => clk,
      rst_n              => rst_n,
      s_axis_tdata       => in_tdata,
      s_axis_tkeep       => in_tkeep,
      s_axis_tuser       => in_tuser,
      s_axis_tvalid      => in_tvalid,
      s_axis_tlast       => in_tlast,
      s_axis_tready      => in_tready,
      m_axis_tdata       => sent_tdata,
      m_axis_tkeep       => sent_tkeep,
      m_axis_tvalid      => sent_tvalid,
      m_axis_tlast       => sent_tlast,
      m_axis_tready      => sent_tready,
      s_frame_error      => s_frame_error,
      s_frame_error_code => "0010",
      frame_error        => frame_error(0),
      frame_error_code   => frame_error_code
    );

  u_stall : entity firm.firm_sim_stall
    generic map (
      WIDTH         => WIDTH,
      SEED          => SEED,
      STALL_PERCENT => SINK_STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => sent_tdata,
      s_axis_tkeep  => sent_tkeep,
      s_axis_tvalid => sent_tvalid,
      s_axis_tlast  => sent_tlast,
      s_axis_tready => sent_tready,
      m_axis_tdata  => out_tdata,
      m_axis_tkeep  => out_tkeep,
      m_axis_tvalid => out_tvalid,
      m_axis_tlast  => out_tlast,
      m_axis_tready => out_tready
    );

  u_tid : entity firm.firm_sim_tid
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => out_tdata,
      axis_tvalid => out_tvalid,
      axis_tlast  => out_tlast,
      axis_tready => out_tready,
      axis_tid    => out_tid
    );

  publisher : process (clk)
    variable count : natural := 0;
  begin
    if rising_edge(clk) and rst_n = '1' then
      s_frame_error <= '0';
      if count < PUBLISHER_ERRORS and s_frame_error = '0' then
        s_frame_error <= '1';
        count         := count + 1;
      end if;
      if frame_error(0) = '1' then
        report "code " & integer'image(to_integer(unsigned(frame_error_code)));
      end if;
    end if;
  end process publisher;

  find_gaps : process (clk)
  begin
    if rising_edge(clk) then
      assert sent_tvalid = '1' or not is_within_r
        report "a gap within a frame" severity failure;
      if sent_tvalid = '1' and sent_tready = '1' then
        is_within_r <= sent_tlast = '0';
      end if;
    end if;
  end process find_gaps;

  u_check_in : entity firm.firm_axis_checker
    generic map (
      WIDTH => WIDTH,
      NAME  => "in",
      LEVEL => failure
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => in_tdata,
      axis_tkeep  => in_tkeep,
      axis_tvalid => in_tvalid,
      axis_tlast  => in_tlast,
      axis_tready => in_tready
    );

  u_check_sent : entity firm.firm_axis_checker
    generic map (
      WIDTH => WIDTH,
      NAME  => "sent",
      LEVEL => failure
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => sent_tdata,
      axis_tkeep  => sent_tkeep,
      axis_tvalid => sent_tvalid,
      axis_tlast  => sent_tlast,
      axis_tready => sent_tready
    );

end architecture simulation;
