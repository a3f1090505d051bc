-- SPDX-License-Identifier: Apache-2.0
-- Tests a host link between the simulation host and a system that returns every frame unchanged.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sim_check_pkg.all;

entity firm_link_tb is
  generic (
    -- uart or spi
    LINK          : string  := "uart";
    WIDTH         : integer := 8;
    LONGEST       : integer := 120;
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    SEED          : integer := 1;
    -- Of the host, of its adapter, and of the system.
    STALL_PERCENT : integer := 0;
    -- The error of the host's clock in thousandths of the bit time.
    CLOCK_ERROR : integer := 0;
    WATCHDOG    : integer := 100000;
    QUIET       : integer := 2000
  );
end entity firm_link_tb;

architecture simulation of firm_link_tb is

  constant CLOCK_HZ : integer := 100000000;
  constant BAUD     : integer := 10000000;
  constant BIT_TIME : time    := 100 ns * (1000 + CLOCK_ERROR) / 1000;

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal host_tdata  : std_logic_vector(7 downto 0);
  signal host_tvalid : std_logic;
  signal host_tlast  : std_logic;
  signal host_tready : std_logic;

  signal back_tdata  : std_logic_vector(7 downto 0);
  signal back_tkeep  : std_logic_vector(0 downto 0);
  signal back_tid    : std_logic_vector(7 downto 0);
  signal back_tvalid : std_logic;
  signal back_tlast  : std_logic;
  signal back_tready : std_logic;

  signal to_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal to_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal to_tvalid : std_logic;
  signal to_tlast  : std_logic;
  signal to_tready : std_logic;

  signal from_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal from_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal from_tvalid : std_logic;
  signal from_tlast  : std_logic;
  signal from_tready : std_logic;

  signal link_error : std_logic;

begin

  u_host : entity firm.firm_sim_host
    generic map (
      STIMULUS_FILE => STIMULUS_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      SHOWN         => 0,
      WATCHDOG      => WATCHDOG,
      QUIET         => QUIET
    )
    port map (
      clk            => clk,
      rst_n          => rst_n,
      m_axis_tdata   => host_tdata,
      m_axis_tkeep   => open,
      m_axis_tvalid  => host_tvalid,
      m_axis_tlast   => host_tlast,
      m_axis_tready  => host_tready,
      s_axis_tdata   => back_tdata,
      s_axis_tkeep   => back_tkeep,
      s_axis_tid     => back_tid,
      s_axis_tvalid  => back_tvalid,
      s_axis_tlast   => back_tlast,
      s_axis_tready  => back_tready,
      frame_error(0) => link_error
    );

  u_system : entity firm.firm_sim_stall
    generic map (
      WIDTH         => WIDTH,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => to_tdata,
      s_axis_tkeep  => to_tkeep,
      s_axis_tvalid => to_tvalid,
      s_axis_tlast  => to_tlast,
      s_axis_tready => to_tready,
      m_axis_tdata  => from_tdata,
      m_axis_tkeep  => from_tkeep,
      m_axis_tvalid => from_tvalid,
      m_axis_tlast  => from_tlast,
      m_axis_tready => from_tready
    );

  uart : if LINK = "uart" generate
    signal rxd   : std_logic;
    signal txd   : std_logic;
    signal rts_n : std_logic;
    signal cts_n : std_logic;
  begin
    u_adapter : entity firm.firm_sim_uart
      generic map (
        BIT_TIME      => BIT_TIME,
        SEED          => SEED,
        STALL_PERCENT => STALL_PERCENT
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => host_tdata,
        s_axis_tvalid => host_tvalid,
        s_axis_tlast  => host_tlast,
        s_axis_tready => host_tready,
        m_axis_tdata  => back_tdata,
        m_axis_tkeep  => back_tkeep,
        m_axis_tid    => back_tid,
        m_axis_tvalid => back_tvalid,
        m_axis_tlast  => back_tlast,
        m_axis_tready => back_tready,
        uart_rxd      => rxd,
        uart_txd      => txd,
        uart_rts_n    => rts_n,
        uart_cts_n    => cts_n
      );

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
        uart_txd        => txd,
        uart_rts_n      => rts_n,
        uart_cts_n      => cts_n,
        m_axis_tdata    => to_tdata,
        m_axis_tkeep    => to_tkeep,
        m_axis_tvalid   => to_tvalid,
        m_axis_tlast    => to_tlast,
        m_axis_tready   => to_tready,
        s_axis_tdata    => from_tdata,
        s_axis_tkeep    => from_tkeep,
        s_axis_tvalid   => from_tvalid,
        s_axis_tlast    => from_tlast,
        s_axis_tready   => from_tready,
        link_error      => link_error,
        link_error_code => open,
        good_frames     => open,
        broken_frames   => open,
        lost_frames     => open,
        refused_frames  => open
      );
  end generate uart;

  spi : if LINK = "spi" generate
    signal sclk : std_logic;
    signal cs_n : std_logic;
    signal mosi : std_logic;
    signal miso : std_logic;
    signal irq  : std_logic;
  begin
    u_master : entity firm.firm_sim_spi
      generic map (
        PERIOD        => BIT_TIME,
        SEED          => SEED,
        STALL_PERCENT => STALL_PERCENT
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => host_tdata,
        s_axis_tvalid => host_tvalid,
        s_axis_tlast  => host_tlast,
        s_axis_tready => host_tready,
        m_axis_tdata  => back_tdata,
        m_axis_tkeep  => back_tkeep,
        m_axis_tid    => back_tid,
        m_axis_tvalid => back_tvalid,
        m_axis_tlast  => back_tlast,
        m_axis_tready => back_tready,
        spi_sclk      => sclk,
        spi_cs_n      => cs_n,
        spi_mosi      => mosi,
        spi_miso      => miso,
        spi_irq       => irq
      );

    u_link : entity firm.firm_spi_link
      generic map (
        WIDTH   => WIDTH,
        LONGEST => LONGEST,
        DEPTH   => 512
      )
      port map (
        clk             => clk,
        rst_n           => rst_n,
        spi_sclk        => sclk,
        spi_cs_n        => cs_n,
        spi_mosi        => mosi,
        spi_miso        => miso,
        spi_irq         => irq,
        m_axis_tdata    => to_tdata,
        m_axis_tkeep    => to_tkeep,
        m_axis_tvalid   => to_tvalid,
        m_axis_tlast    => to_tlast,
        m_axis_tready   => to_tready,
        s_axis_tdata    => from_tdata,
        s_axis_tkeep    => from_tkeep,
        s_axis_tvalid   => from_tvalid,
        s_axis_tlast    => from_tlast,
        s_axis_tready   => from_tready,
        link_error      => link_error,
        link_error_code => open,
        good_frames     => open,
        broken_frames   => open,
        lost_frames     => open,
        refused_frames  => open
      );
  end generate spi;

  check_stream(clk, rst_n, to_tdata, to_tkeep, to_tvalid, to_tlast, to_tready, "to");

  check_stream(clk, rst_n, from_tdata, from_tkeep, from_tvalid, from_tlast, from_tready, "from");

end architecture simulation;
