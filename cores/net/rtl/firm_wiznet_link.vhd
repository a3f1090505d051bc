-- SPDX-License-Identifier: Apache-2.0
-- The host's two streams of a system that is a node in the sockets of a W5500 or W5200: firm_wiznet_node with the
-- chip's reset, its milliseconds, and streams of any width. The external ROM defines the node.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_wiznet_link is
  generic (
    WIDTH    : integer := 8;
    CLOCK_HZ : integer := 12000000;
    CHIP     : integer := 5500  -- or 5200
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The data follow the address by one cycle.
    rom_address : out std_logic_vector(15 downto 0);
    rom_data    : in  std_logic_vector(7 downto 0);

    -- The chip.
    spi_sck   : out std_logic;
    spi_cs_n  : out std_logic;
    spi_mosi  : out std_logic;
    spi_miso  : in  std_logic;
    spi_rst_n : out std_logic;

    -- Frames to the system, never aborted.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- Frames from the system.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic
  );
end entity firm_wiznet_link;

architecture rtl of firm_wiznet_link is

  -- The fastest clock that modules on wires reach safely; the chips allow 33 MHz and more.
  constant FASTEST_SCK : positive := 25000000;

  function half_bit_of(hertz : integer) return positive is
  begin
    if hertz <= 2*FASTEST_SCK then
      return 1;
    end if;
    return (hertz + 2*FASTEST_SCK - 1) / (2*FASTEST_SCK);
  end function half_bit_of;

  function cycles_of(hertz : integer) return positive is
  begin
    if hertz < 1000 then
      return 1;
    end if;
    return hertz / 1000;
  end function cycles_of;

  -- The chip's reset takes 2 ms. A W5200 is then ready after 150 ms, a W5500 after 1 ms (the datasheets' reset timing).
  function start_of(number : integer) return positive is
  begin
    if number = 5200 then
      return 160;
    end if;
    return 10;
  end function start_of;

  constant CYCLES     : positive := cycles_of(CLOCK_HZ);
  constant RESET_ENDS : positive := 2;
  constant STARTS     : positive := start_of(CHIP);

  signal cycle_r : natural range 0 to CYCLES-1;
  signal ms_r    : std_logic;
  signal start_r : natural range 0 to STARTS;
  signal node_r  : std_logic;  -- its reset

  signal in_data   : std_logic_vector(7 downto 0);
  signal in_abort  : std_logic_vector(0 downto 0);
  signal in_valid  : std_logic;
  signal in_last   : std_logic;
  signal in_ready  : std_logic;
  signal out_data  : std_logic_vector(7 downto 0);
  signal out_valid : std_logic;
  signal out_last  : std_logic;
  signal out_ready : std_logic;

begin

  assert CLOCK_HZ >= 1
    report "firm_wiznet_link: CLOCK_HZ is " & integer'image(CLOCK_HZ) & "; legal: 1 and more"
    severity failure;

  count_time : process (clk)
  begin
    if rising_edge(clk) then
      ms_r <= '0';
      if cycle_r = CYCLES-1 then
        cycle_r <= 0;
        ms_r    <= '1';
        if start_r /= STARTS then
          start_r <= start_r + 1;
        end if;
      else
        cycle_r <= cycle_r + 1;
      end if;
      spi_rst_n <= '1';
      if start_r < RESET_ENDS then
        spi_rst_n <= '0';
      end if;
      node_r <= '0';
      if start_r = STARTS then
        node_r <= '1';
      end if;
      if rst_n = '0' then
        cycle_r   <= 0;
        start_r   <= 0;
        spi_rst_n <= '0';
        node_r    <= '0';
      end if;
    end if;
  end process count_time;

  u_node : entity firm.firm_wiznet_node
    generic map (
      CHIP     => CHIP,
      HALF_BIT => half_bit_of(CLOCK_HZ)
    )
    port map (
      clk           => clk,
      rst_n         => node_r,
      ms            => ms_r,
      rom_address   => rom_address,
      rom_data      => rom_data,
      s_axis_tdata  => in_data,
      s_axis_tuser  => in_abort,
      s_axis_tvalid => in_valid,
      s_axis_tlast  => in_last,
      s_axis_tready => in_ready,
      m_axis_tdata  => out_data,
      m_axis_tvalid => out_valid,
      m_axis_tlast  => out_last,
      m_axis_tready => out_ready,
      spi_sck       => spi_sck,
      spi_cs_n      => spi_cs_n,
      spi_mosi      => spi_mosi,
      spi_miso      => spi_miso
    );

  u_streams : entity firm.firm_net_streams
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      to_tdata      => out_data,
      to_tvalid     => out_valid,
      to_tlast      => out_last,
      to_tready     => out_ready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tuser  => m_axis_tuser,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tkeep  => s_axis_tkeep,
      s_axis_tuser  => s_axis_tuser,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      from_tdata    => in_data,
      from_tuser    => in_abort,
      from_tvalid   => in_valid,
      from_tlast    => in_last,
      from_tready   => in_ready
    );

end architecture rtl;
