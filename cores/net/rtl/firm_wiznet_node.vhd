-- SPDX-License-Identifier: Apache-2.0
-- A node in the sockets of a W5500 or W5200: the sequencer, its way to the chip, and FIFOs, so that it never waits for
-- the Manager while the Manager waits for it. The external ROM defines the node.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_wiznet_node is
  generic (
    -- Those of firm_wiznet_access.
    CHIP       : integer := 5500;
    MODE       : integer := 0;
    HALF_BIT   : integer := 2;
    READ_DELAY : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    ms : in std_logic;  -- a pulse in each millisecond

    -- The data follow the address by one cycle.
    rom_address : out std_logic_vector(15 downto 0);
    rom_data    : in  std_logic_vector(7 downto 0);

    -- Frames from the Manager, and to it.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    spi_sck  : out std_logic;
    spi_cs_n : out std_logic;
    spi_mosi : out std_logic;
    spi_miso : in  std_logic
  );
end entity firm_wiznet_node;

architecture rtl of firm_wiznet_node is

  signal in_data  : std_logic_vector(7 downto 0);
  signal in_user  : std_logic_vector(0 downto 0);
  signal in_valid : std_logic;
  signal in_last  : std_logic;
  signal in_ready : std_logic;
  signal has_part : std_logic;

  signal out_data  : std_logic_vector(7 downto 0);
  signal out_valid : std_logic;
  signal out_last  : std_logic;
  signal out_ready : std_logic;
  signal is_taken  : std_logic;

  signal request_valid   : std_logic;
  signal request_ready   : std_logic;
  signal request_write   : std_logic;
  signal request_space   : std_logic_vector(1 downto 0);
  signal request_socket  : std_logic_vector(2 downto 0);
  signal request_address : std_logic_vector(15 downto 0);
  signal request_length  : std_logic_vector(11 downto 0);
  signal is_done         : std_logic;
  signal write_data      : std_logic_vector(7 downto 0);
  signal write_valid     : std_logic;
  signal write_ready     : std_logic;
  signal read_data       : std_logic_vector(7 downto 0);
  signal read_valid      : std_logic;
  signal read_ready      : std_logic;

begin

  u_from_manager : entity firm.firm_wiznet_fifo
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tuser  => s_axis_tuser,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      m_axis_tdata  => in_data,
      m_axis_tuser  => in_user,
      m_axis_tvalid => in_valid,
      m_axis_tlast  => in_last,
      m_axis_tready => in_ready,
      is_empty      => open,
      has_part      => has_part
    );

  u_to_manager : entity firm.firm_wiznet_fifo
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => out_data,
      s_axis_tuser  => "0",
      s_axis_tvalid => out_valid,
      s_axis_tlast  => out_last,
      s_axis_tready => out_ready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tuser  => open,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready,
      is_empty      => is_taken,
      has_part      => open
    );

  u_sequencer : entity firm.firm_wiznet_sequencer
    port map (
      clk             => clk,
      rst_n           => rst_n,
      ms              => ms,
      rom_address     => rom_address,
      rom_data        => rom_data,
      s_axis_tdata    => in_data,
      s_axis_tuser    => in_user,
      s_axis_tvalid   => in_valid,
      s_axis_tlast    => in_last,
      s_axis_tready   => in_ready,
      has_part        => has_part,
      m_axis_tdata    => out_data,
      m_axis_tvalid   => out_valid,
      m_axis_tlast    => out_last,
      m_axis_tready   => out_ready,
      is_taken        => is_taken,
      request_valid   => request_valid,
      request_ready   => request_ready,
      request_write   => request_write,
      request_space   => request_space,
      request_socket  => request_socket,
      request_address => request_address,
      request_length  => request_length,
      is_done         => is_done,
      write_data      => write_data,
      write_valid     => write_valid,
      write_ready     => write_ready,
      read_data       => read_data,
      read_valid      => read_valid,
      read_ready      => read_ready
    );

  u_access : entity firm.firm_wiznet_access
    generic map (
      CHIP       => CHIP,
      MODE       => MODE,
      HALF_BIT   => HALF_BIT,
      READ_DELAY => READ_DELAY
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      request_valid   => request_valid,
      request_ready   => request_ready,
      request_write   => request_write,
      request_space   => request_space,
      request_socket  => request_socket,
      request_address => request_address,
      request_length  => request_length,
      is_done         => is_done,
      s_axis_tdata    => write_data,
      s_axis_tvalid   => write_valid,
      s_axis_tready   => write_ready,
      m_axis_tdata    => read_data,
      m_axis_tvalid   => read_valid,
      m_axis_tready   => read_ready,
      spi_sck         => spi_sck,
      spi_cs_n        => spi_cs_n,
      spi_mosi        => spi_mosi,
      spi_miso        => spi_miso
    );

end architecture rtl;
