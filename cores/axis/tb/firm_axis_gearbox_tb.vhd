-- SPDX-License-Identifier: Apache-2.0
-- Tests a window and a packer, which joins its bytes again, between the simulation host's two streams. Without stalls,
-- a whole window is transferred per cycle, and a source that never pauses must cause no gap at the output; otherwise,
-- random numbers of bytes are transferred.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_gearbox_tb is
  generic (
    WIDTH         : integer := 8;
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;
    WATCHDOG      : integer := 1000;
    QUIET         : integer := 100
  );
end entity firm_axis_gearbox_tb;

architecture simulation of firm_axis_gearbox_tb is

  constant LANES : positive := WIDTH/8;

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal window    : std_logic_vector(WIDTH-1 downto 0);
  signal available : std_logic_vector(clog2(LANES+1)-1 downto 0);
  signal is_last   : std_logic;
  signal wanted_r  : natural range 0 to LANES := LANES;
  signal piece     : natural range 0 to LANES;
  signal count     : std_logic_vector(clog2(LANES+1)-1 downto 0);
  signal last      : std_logic;
  signal valid     : std_logic;
  signal ready     : std_logic;
  signal take      : std_logic;

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tid    : std_logic_vector(7 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

  signal has_begun_r : boolean := false;  -- a beat has left

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
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready,
      s_axis_tdata  => out_tdata,
      s_axis_tkeep  => out_tkeep,
      s_axis_tid    => out_tid,
      s_axis_tvalid => out_tvalid,
      s_axis_tlast  => out_tlast,
      s_axis_tready => out_tready
    );

  u_window : entity firm.firm_axis_window
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => in_tdata,
      s_axis_tkeep  => in_tkeep,
      s_axis_tvalid => in_tvalid,
      s_axis_tlast  => in_tlast,
      s_axis_tready => in_tready,
      window        => window,
      available     => available,
      is_last       => is_last,
      take_valid    => take,
      take          => count,
      skip          => '0'
    );

  choose_piece : process (available, is_last, wanted_r, rst_n)
    variable offered : natural;
  begin
    valid <= '0';
    last  <= '0';
    piece <= 0;
    if rst_n = '1' then
      offered := to_integer(unsigned(available));
      piece   <= wanted_r;
      if offered >= wanted_r then
        valid <= '1';
      end if;
      if is_last = '1' and offered <= wanted_r then
        valid <= '1';
        last  <= '1';
        piece <= offered;
      end if;
    end if;
  end process choose_piece;

  count <= std_logic_vector(to_unsigned(piece, clog2(LANES+1)));
  take  <= valid and ready;

  draw_piece : process (clk)
    variable random_1 : positive := SEED;
    variable random_2 : positive := 7;
    variable draw     : real;
  begin
    if rising_edge(clk) and STALL_PERCENT > 0 and take = '1' then
      uniform(random_1, random_2, draw);
      wanted_r <= integer(floor(draw * real(LANES+1)));
    end if;
  end process draw_piece;

  u_pack : entity firm.firm_axis_pack
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      data          => window,
      count         => count,
      last          => last,
      valid         => valid,
      ready         => ready,
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

  find_gaps : process (clk)
  begin
    if rising_edge(clk) and STALL_PERCENT = 0 then
      if out_tvalid = '1' and out_tready = '1' then
        has_begun_r <= true;
      end if;
      assert not (has_begun_r and in_tvalid = '1' and out_tready = '1' and out_tvalid = '0')
        report "a gap although the source never pauses" severity failure;
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

  u_check_out : entity firm.firm_axis_checker
    generic map (
      WIDTH => WIDTH,
      NAME  => "out",
      LEVEL => failure
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => out_tdata,
      axis_tkeep  => out_tkeep,
      axis_tvalid => out_tvalid,
      axis_tlast  => out_tlast,
      axis_tready => out_tready
    );

end architecture simulation;
