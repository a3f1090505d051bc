-- SPDX-License-Identifier: Apache-2.0
-- Tests a board with the pins of an MII, a GMII or an RMII that returns each good frame. A row of the file is a burst
-- on the line to the board, in units of nibbles, bytes or two bits: the idle ones before it, the one at which the PHY
-- reports an error or -1, the number, and the values; one of 256 and more has no rx_dv. The output of the board is
-- written to a file in the same form. The clocks are unrelated; an RMII has that of the system.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_mii_tb is
  generic (
    IS_GMII       : boolean := false;
    IS_RGMII      : boolean := false;
    IS_RMII       : boolean := false;
    LINE_FILE     : string  := "nibbles.txt";
    RESULT_FILE   : string  := "sent.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- Of the system's clock, and about that of both clocks of the PHY, which are unrelated.
    PERIOD_PS     : integer := 10000;
    PHY_PERIOD_PS : integer := 40000
  );
end entity firm_mii_tb;

architecture simulation of firm_mii_tb is

  -- Of the line, at the end: the longest frame and some more.
  constant LAST_UNITS : positive := 4000;

  signal clk      : std_logic := '0';
  signal rx_clk   : std_logic;
  signal tx_clk   : std_logic;
  signal rst_n    : std_logic := '0';
  signal over     : boolean   := false;

  -- The pins; an MII has the lower four of data, an RMII the lower two.
  signal pin_rx_dv : std_logic                    := '0';
  signal pin_rx_er : std_logic                    := '0';
  signal pin_rxd   : std_logic_vector(7 downto 0) := x"00";
  signal pin_tx_en : std_logic;
  signal pin_tx_er : std_logic;
  signal pin_txd   : std_logic_vector(7 downto 0);

  -- Of an RGMII. The PHY delays both clocks by a quarter of their period.
  constant RX_DELAY : time := PHY_PERIOD_PS * 250 fs;
  constant TX_DELAY : time := PERIOD_PS * 250 fs;

  signal rgmii_rx_ctl : std_logic                    := '0';
  signal rgmii_rxd    : std_logic_vector(3 downto 0) := x"0";
  signal rgmii_tx_clk : std_logic;
  signal rgmii_tx_ctl : std_logic;
  signal rgmii_txd    : std_logic_vector(3 downto 0);

  signal rx_step : std_logic;
  signal rx_dv   : std_logic;
  signal rx_er   : std_logic;
  signal rxd     : std_logic_vector(7 downto 0);
  signal tx_step : std_logic;
  signal tx_en   : std_logic;
  signal tx_er   : std_logic;
  signal txd     : std_logic_vector(7 downto 0);

  signal received_tdata  : std_logic_vector(7 downto 0);
  signal received_tuser  : std_logic_vector(0 downto 0);
  signal received_tvalid : std_logic;
  signal received_tlast  : std_logic;
  signal stored_tdata    : std_logic_vector(7 downto 0);
  signal stored_tvalid   : std_logic;
  signal stored_tlast    : std_logic;
  signal stored_tready   : std_logic;
  signal is_lost         : std_logic;

begin

  clk <= not clk after PERIOD_PS * 500 fs when not over else '0';

  if_phy_clock : if not IS_RMII generate

    u_rx_clock : entity firm.firm_sim_clock
      generic map (
        PERIOD_PS => PHY_PERIOD_PS,
        SEED      => SEED
      )
      port map (
        reference => clk,
        clk       => rx_clk
      );

  end generate if_phy_clock;

  if_rmii : if IS_RMII generate

    rx_clk <= clk;
    tx_clk <= clk;

    u_rmii : entity firm.firm_rmii
      port map (
        clk         => clk,
        rst_n       => rst_n,
        rmii_crs_dv => pin_rx_dv,
        rmii_rxd    => pin_rxd(1 downto 0),
        rmii_tx_en  => pin_tx_en,
        rmii_txd    => pin_txd(1 downto 0),
        rx_step     => rx_step,
        rx_dv       => rx_dv,
        rx_er       => rx_er,
        rxd         => rxd,
        tx_step     => tx_step,
        tx_en       => tx_en,
        txd         => txd
      );

    pin_txd(7 downto 2) <= (others => '0');
    pin_tx_er           <= '0';

  end generate if_rmii;

  if_mii : if not (IS_GMII or IS_RGMII or IS_RMII) generate

    u_tx_clock : entity firm.firm_sim_clock
      generic map (
        PERIOD_PS => PHY_PERIOD_PS,
        SEED      => SEED + 1
      )
      port map (
        reference => clk,
        clk       => tx_clk
      );

    u_mii : entity firm.firm_mii
      port map (
        clk        => clk,
        rst_n      => rst_n,
        mii_rx_clk => rx_clk,
        mii_rx_dv  => pin_rx_dv,
        mii_rx_er  => pin_rx_er,
        mii_rxd    => pin_rxd(3 downto 0),
        mii_tx_clk => tx_clk,
        mii_tx_en  => pin_tx_en,
        mii_tx_er  => pin_tx_er,
        mii_txd    => pin_txd(3 downto 0),
        rx_step    => rx_step,
        rx_dv      => rx_dv,
        rx_er      => rx_er,
        rxd        => rxd,
        tx_step    => tx_step,
        tx_en      => tx_en,
        tx_er      => tx_er,
        txd        => txd
      );

    pin_txd(7 downto 4) <= x"0";

  end generate if_mii;

  if_gmii : if IS_GMII generate

    tx_clk <= clk;

    u_gmii : entity firm.firm_gmii
      port map (
        clk         => clk,
        rst_n       => rst_n,
        gmii_rx_clk => rx_clk,
        gmii_rx_dv  => pin_rx_dv,
        gmii_rx_er  => pin_rx_er,
        gmii_rxd    => pin_rxd,
        gmii_tx_en  => pin_tx_en,
        gmii_tx_er  => pin_tx_er,
        gmii_txd    => pin_txd,
        rx_step     => rx_step,
        rx_dv       => rx_dv,
        rx_er       => rx_er,
        rxd         => rxd,
        tx_step     => tx_step,
        tx_en       => tx_en,
        tx_er       => tx_er,
        txd         => txd
      );

  end generate if_gmii;

  if_rgmii : if IS_RGMII generate

    tx_clk <= transport rgmii_tx_clk after TX_DELAY;

    u_rgmii : entity firm.firm_rgmii
      port map (
        clk          => clk,
        rst_n        => rst_n,
        rgmii_rx_clk => rx_clk,
        rgmii_rx_ctl => rgmii_rx_ctl,
        rgmii_rxd    => rgmii_rxd,
        rgmii_tx_clk => rgmii_tx_clk,
        rgmii_tx_ctl => rgmii_tx_ctl,
        rgmii_txd    => rgmii_txd,
        rx_step      => rx_step,
        rx_dv        => rx_dv,
        rx_er        => rx_er,
        rxd          => rxd,
        tx_step      => tx_step,
        tx_en        => tx_en,
        tx_er        => tx_er,
        txd          => txd
      );

    -- The PHY shows each nibble in the half of its clock's period around an edge.
    show_nibbles : process
    begin
      wait until falling_edge(rx_clk);
      wait for RX_DELAY;
      rgmii_rx_ctl <= pin_rx_dv;
      rgmii_rxd    <= pin_rxd(3 downto 0);
      wait until rising_edge(rx_clk);
      wait for RX_DELAY;
      rgmii_rx_ctl <= pin_rx_dv xor pin_rx_er;
      rgmii_rxd    <= pin_rxd(7 downto 4);
    end process show_nibbles;

    take_nibbles : process
      variable lower : std_logic_vector(3 downto 0);
      variable valid : std_logic;
    begin
      wait until rising_edge(tx_clk);
      lower := rgmii_txd;
      valid := rgmii_tx_ctl;
      wait until falling_edge(tx_clk);
      pin_txd   <= rgmii_txd & lower;
      pin_tx_en <= valid;
      pin_tx_er <= rgmii_tx_ctl xor valid;
    end process take_nibbles;

  end generate if_rgmii;

  u_receiver : entity firm.firm_mac_receiver
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rx_step       => rx_step,
      rx_dv         => rx_dv,
      rx_er         => rx_er,
      rxd           => rxd,
      m_axis_tdata  => received_tdata,
      m_axis_tuser  => received_tuser,
      m_axis_tvalid => received_tvalid,
      m_axis_tlast  => received_tlast,
      is_good       => open,
      is_broken     => open,
      is_long       => open
    );

  u_store : entity firm.firm_mac_store
    generic map (
      DEPTH => 16384
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => received_tdata,
      s_axis_tuser  => received_tuser,
      s_axis_tvalid => received_tvalid,
      s_axis_tlast  => received_tlast,
      m_axis_tdata  => stored_tdata,
      m_axis_tvalid => stored_tvalid,
      m_axis_tlast  => stored_tlast,
      m_axis_tready => stored_tready,
      is_lost       => is_lost
    );

  u_transmitter : entity firm.firm_mac_transmitter
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => stored_tdata,
      s_axis_tvalid => stored_tvalid,
      s_axis_tlast  => stored_tlast,
      s_axis_tready => stored_tready,
      tx_step       => tx_step,
      tx_en         => tx_en,
      tx_er         => tx_er,
      txd           => txd,
      is_sent       => open,
      is_spoiled    => open
    );

  assert is_lost /= '1'
    report "the store is full"
    severity failure;

  play : process
    file bursts     : text open read_mode is LINE_FILE;
    variable row    : line;
    variable idle   : integer;
    variable fault  : integer;
    variable size   : integer;
    variable value  : integer;

    procedure show(dv : in std_logic; er : in std_logic; data : in natural) is
    begin
      -- Like a PHY, away from the rising edge.
      wait until falling_edge(rx_clk);
      pin_rx_dv <= dv;
      pin_rx_er <= er;
      pin_rxd   <= std_logic_vector(to_unsigned(data, 8));
    end procedure show;

  begin
    for cycle in 1 to 10 loop
      wait until rising_edge(rx_clk);
    end loop;
    wait until rising_edge(clk);
    rst_n <= '1';
    for cycle in 1 to 10 loop
      wait until rising_edge(rx_clk);
    end loop;
    while not endfile(bursts) loop
      readline(bursts, row);
      read(row, idle);
      read(row, fault);
      read(row, size);
      for place in 1 to idle loop
        show('0', '0', 0);
      end loop;
      for place in 0 to size-1 loop
        read(row, value);
        if value >= 256 then
          show('0', '0', value - 256);
        elsif place = fault then
          show('1', '1', value);
        else
          show('1', '0', value);
        end if;
      end loop;
    end loop;
    for place in 1 to LAST_UNITS loop
      show('0', '0', 0);
    end loop;
    over <= true;
    wait;
  end process play;

  record_bursts : process
    file results     : text open write_mode is RESULT_FILE;
    file expected    : text open read_mode is existing(EXPECTED_FILE);
    variable row     : line;
    variable content : line;
    variable idle    : natural := 0;
    variable fault   : integer := -1;
    variable size    : natural := 0;
  begin
    while not over loop
      wait until rising_edge(tx_clk) or over;
      next when over or rst_n = '0';
      if pin_tx_en = '1' then
        write(content, ' ' & integer'image(to_integer(unsigned(pin_txd))));
        if pin_tx_er = '1' and fault = -1 then
          fault := size;
        end if;
        size := size + 1;
      elsif size = 0 then
        idle := idle + 1;
      else
        write(row, integer'image(idle) & ' ' & integer'image(fault) & ' ' & integer'image(size) & content.all);
        write_result(results, expected, EXPECTED_FILE, row);
        deallocate(content);
        size  := 0;
        idle  := 1;
        fault := -1;
      end if;
    end loop;
    assert size = 0
      report "a frame without an end" severity failure;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are bursts" severity failure;
    print("PASS");
    wait;
  end process record_bursts;

end architecture simulation;
