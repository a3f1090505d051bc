-- SPDX-License-Identifier: Apache-2.0
-- Connects receiver and transmitter to a PHY by GMII, at 1 Gbit/s, full duplex. The PHY's receive clock is not the
-- system's; they differ by a few thousandths of a percent, and the bytes of a frame cross between them. The
-- transmitter's bytes leave with `clk`, which is also the PHY's transmit clock (GTX_CLK).
--
-- `clk` may be slower than the receive clock by as much as two clocks of 125 MHz may differ: the FIFO fills by less
-- than a byte in a frame, and empties in the gap, which does not cross.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_gmii is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The pins.
    gmii_rx_clk : in  std_logic;
    gmii_rx_dv  : in  std_logic;
    gmii_rx_er  : in  std_logic;
    gmii_rxd    : in  std_logic_vector(7 downto 0);
    gmii_tx_en  : out std_logic;
    gmii_tx_er  : out std_logic;
    gmii_txd    : out std_logic_vector(7 downto 0);

    -- To firm_mac_receiver.
    rx_step : out std_logic;
    rx_dv   : out std_logic;
    rx_er   : out std_logic;
    rxd     : out std_logic_vector(7 downto 0);

    -- From firm_mac_transmitter.
    tx_step : out std_logic;
    tx_en   : in  std_logic;
    tx_er   : in  std_logic;
    txd     : in  std_logic_vector(7 downto 0)
  );
end entity firm_gmii;

architecture rtl of firm_gmii is

  -- A byte as it crosses.
  constant WORD_BITS : positive := 16;
  subtype word_t is std_logic_vector(WORD_BITS-1 downto 0);
  constant VALID_BIT : natural := 8;
  constant ERROR_BIT : natural := 9;

  -- Of the PHY's receive clock.
  signal rx_rst_n  : std_logic;
  signal arrived_r : word_t;
  signal was_r     : std_logic;  -- the previous byte belongs to a frame
  signal arrives   : std_logic;

  signal received : word_t;      -- of the system's clock

begin

  -- ------------------------------------------------------------------ from the PHY

  u_rx_reset : entity firm.firm_cdc_reset
    port map (
      clk          => gmii_rx_clk,
      rst_n        => rst_n,
      synced_rst_n => rx_rst_n
    );

  sample : process (gmii_rx_clk)
  begin
    if rising_edge(gmii_rx_clk) then
      arrived_r <= "000000" & gmii_rx_er & gmii_rx_dv & gmii_rxd;
      was_r     <= arrived_r(VALID_BIT);
      -- After a reset, the receiver waits for an idle byte.
      if rx_rst_n = '0' then
        was_r <= '1';
      end if;
    end if;
  end process sample;

  -- The bytes of a frame, and one that marks its end.
  arrives <= (arrived_r(VALID_BIT) or was_r) and rx_rst_n;

  u_from_phy : entity firm.firm_cdc_stream
    generic map (
      S_WIDTH => WORD_BITS,
      M_WIDTH => WORD_BITS
    )
    port map (
      s_clk         => gmii_rx_clk,
      s_rst_n       => rx_rst_n,
      s_idle        => open,
      s_axis_tdata  => arrived_r,
      s_axis_tkeep  => "11",
      s_axis_tvalid => arrives,
      s_axis_tlast  => '0',
      s_axis_tready => open,
      m_clk         => clk,
      m_rst_n       => rst_n,
      m_axis_tdata  => received,
      m_axis_tkeep  => open,
      m_axis_tvalid => rx_step,
      m_axis_tlast  => open,
      m_axis_tready => '1'
    );

  rx_dv <= received(VALID_BIT);
  rx_er <= received(ERROR_BIT);
  rxd   <= received(7 downto 0);

  -- ------------------------------------------------------------------ to the PHY

  -- Separate registers can be packed into I/O cells.
  send : process (clk)
  begin
    if rising_edge(clk) then
      gmii_tx_en <= tx_en;
      gmii_tx_er <= tx_er;
      gmii_txd   <= txd;
      if rst_n = '0' then
        gmii_tx_en <= '0';
        gmii_tx_er <= '0';
      end if;
    end if;
  end process send;

  tx_step <= '1';

end architecture rtl;
