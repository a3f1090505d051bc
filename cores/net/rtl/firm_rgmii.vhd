-- SPDX-License-Identifier: Apache-2.0
-- Connects receiver and transmitter to a PHY by RGMII, at 1 Gbit/s, full duplex: a GMII whose bytes cross the pins as
-- two nibbles, the lower one at the rising edge of the clock. At the falling edge, the control pin shows whether the
-- byte is valid or has an error, but not both.
--
-- The PHY delays both clocks, so that their edges are in the middle of a nibble (RGMII-ID of RGMII 2.0); cells and
-- pins have no delay here. firm_ddr_in and firm_ddr_out are those of the FPGA's family: see robot:net:firm_ddr.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.all; -- entities of the components, in simulation

entity firm_rgmii is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The pins.
    rgmii_rx_clk : in  std_logic;
    rgmii_rx_ctl : in  std_logic;
    rgmii_rxd    : in  std_logic_vector(3 downto 0);
    rgmii_tx_clk : out std_logic;
    rgmii_tx_ctl : out std_logic;
    rgmii_txd    : out std_logic_vector(3 downto 0);

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
end entity firm_rgmii;

architecture rtl of firm_rgmii is

  -- Components, since the cells of a family are modules of Verilog.
  component firm_ddr_in is
    port (
      clk    : in  std_logic;
      pin    : in  std_logic;
      first  : out std_logic;
      second : out std_logic
    );
  end component firm_ddr_in;

  component firm_ddr_out is
    port (
      clk    : in  std_logic;
      first  : in  std_logic;
      second : in  std_logic;
      pin    : out std_logic
    );
  end component firm_ddr_out;

  signal gmii_rx_dv    : std_logic;
  signal gmii_rx_er    : std_logic;
  signal gmii_rxd      : std_logic_vector(7 downto 0);
  signal gmii_tx_en    : std_logic;
  signal gmii_tx_er    : std_logic;
  signal gmii_txd      : std_logic_vector(7 downto 0);
  signal rx_ctl_second : std_logic;
  signal tx_ctl_second : std_logic;

begin

  -- vsg_off instantiation_034

  u_gmii : entity firm.firm_gmii
    port map (
      clk         => clk,
      rst_n       => rst_n,
      gmii_rx_clk => rgmii_rx_clk,
      gmii_rx_dv  => gmii_rx_dv,
      gmii_rx_er  => gmii_rx_er,
      gmii_rxd    => gmii_rxd,
      gmii_tx_en  => gmii_tx_en,
      gmii_tx_er  => gmii_tx_er,
      gmii_txd    => gmii_txd,
      rx_step     => rx_step,
      rx_dv       => rx_dv,
      rx_er       => rx_er,
      rxd         => rxd,
      tx_step     => tx_step,
      tx_en       => tx_en,
      tx_er       => tx_er,
      txd         => txd
    );

  -- ------------------------------------------------------------------ from the PHY

  gmii_rx_er <= gmii_rx_dv xor rx_ctl_second;

  u_rx_ctl : component firm_ddr_in
    port map (
      clk    => rgmii_rx_clk,
      pin    => rgmii_rx_ctl,
      first  => gmii_rx_dv,
      second => rx_ctl_second
    );

  each_rx_bit : for index in 0 to 3 generate

    u_rxd : component firm_ddr_in
      port map (
        clk    => rgmii_rx_clk,
        pin    => rgmii_rxd(index),
        first  => gmii_rxd(index),
        second => gmii_rxd(index+4)
      );

  end generate each_rx_bit;

  -- ------------------------------------------------------------------ to the PHY

  tx_ctl_second <= gmii_tx_en xor gmii_tx_er;

  -- A cell like those of the data, so that the clock has their delay.
  u_tx_clk : component firm_ddr_out
    port map (
      clk    => clk,
      first  => '1',
      second => '0',
      pin    => rgmii_tx_clk
    );

  u_tx_ctl : component firm_ddr_out
    port map (
      clk    => clk,
      first  => gmii_tx_en,
      second => tx_ctl_second,
      pin    => rgmii_tx_ctl
    );

  each_tx_bit : for index in 0 to 3 generate

    u_txd : component firm_ddr_out
      port map (
        clk    => clk,
        first  => gmii_txd(index),
        second => gmii_txd(index+4),
        pin    => rgmii_txd(index)
      );

  end generate each_tx_bit;

end architecture rtl;
