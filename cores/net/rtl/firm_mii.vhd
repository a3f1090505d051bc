-- SPDX-License-Identifier: Apache-2.0
-- Connects receiver and transmitter to a PHY by MII, at 10 or 100 Mbit/s, full duplex. A nibble is half a byte, the
-- lower one first. Each direction has a clock of the PHY; bytes cross between it and `clk`.
--
-- `clk` must be at least as fast as the PHY's clocks. Then the FIFO to the PHY never runs empty within a frame.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;

entity firm_mii is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The pins.
    mii_rx_clk : in  std_logic;
    mii_rx_dv  : in  std_logic;
    mii_rx_er  : in  std_logic;
    mii_rxd    : in  std_logic_vector(3 downto 0);
    mii_tx_clk : in  std_logic;
    mii_tx_en  : out std_logic;
    mii_tx_er  : out std_logic;
    mii_txd    : out std_logic_vector(3 downto 0);

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
end entity firm_mii;

architecture rtl of firm_mii is

  constant PREAMBLE_NIBBLE : std_logic_vector(3 downto 0) := x"5";
  constant START_NIBBLE    : std_logic_vector(3 downto 0) := x"d";
  constant START_BYTE      : std_logic_vector(7 downto 0) := x"d5";
  constant PREAMBLE_BYTE   : std_logic_vector(7 downto 0) := x"55";
  -- Neither of them: the receiver drops a burst that begins with it.
  constant WRONG_BYTE      : std_logic_vector(7 downto 0) := x"00";
  -- Idle bytes that cross after each frame.
  constant GAP_BYTES       : positive                     := 12;

  -- A byte as it crosses.
  constant WORD_BITS : positive := 16;
  subtype word_t is std_logic_vector(WORD_BITS-1 downto 0);
  constant VALID_BIT : natural := 8;
  constant ERROR_BIT : natural := 9;

  function word_of(byte : std_logic_vector(7 downto 0); valid : std_logic; fault : std_logic) return word_t is
  begin
    return "000000" & fault & valid & byte;
  end function word_of;

  -- Of the PHY's receive clock.
  type rx_state_t is (IDLE, PREAMBLE, LOWER, UPPER, SKIPPED);
  signal rx_rst_n   : std_logic;
  signal dv_r       : std_logic;
  signal er_r       : std_logic;
  signal nibble_r   : std_logic_vector(3 downto 0);
  signal rx_state_r : rx_state_t;
  signal lower_r    : std_logic_vector(3 downto 0);
  signal lower_er_r : std_logic;
  signal arrived_r  : word_t;
  signal arrives_r  : std_logic;
  signal received   : word_t;

  -- Of the system's clock.
  signal gap_r    : natural range 0 to GAP_BYTES;  -- idle bytes that still cross
  signal sent     : word_t;
  signal sends    : std_logic;                     -- the byte belongs to a frame or to the gap after it
  signal has_room : std_logic;
  signal moves    : std_logic;                     -- the transmitter shows the next byte

  -- Of the PHY's transmit clock.
  signal tx_rst_n   : std_logic;
  signal leaving    : word_t;
  signal leaves     : std_logic;
  signal take       : std_logic;
  signal upper_r    : std_logic_vector(3 downto 0);
  signal is_upper_r : std_logic;  -- the upper nibble of a byte follows

begin

  -- ------------------------------------------------------------------ from the PHY

  u_rx_reset : entity firm.firm_cdc_reset
    port map (
      clk          => mii_rx_clk,
      rst_n        => rst_n,
      synced_rst_n => rx_rst_n
    );

  sample : process (mii_rx_clk)
  begin
    if rising_edge(mii_rx_clk) then
      dv_r     <= mii_rx_dv;
      er_r     <= mii_rx_er;
      nibble_r <= mii_rxd;
    end if;
  end process sample;

  -- The number of the preamble's nibbles may be odd, so bytes are aligned by the end of the preamble. Of the preamble,
  -- one byte crosses.
  join_nibbles : process (mii_rx_clk)
  begin
    if rising_edge(mii_rx_clk) then
      arrives_r <= '0';
      if dv_r = '0' then
        rx_state_r <= IDLE;
        if rx_state_r /= IDLE then
          arrives_r <= '1';
          arrived_r <= word_of(WRONG_BYTE, '0', '0');
        end if;
      elsif rx_state_r = IDLE or rx_state_r = PREAMBLE then
        if er_r = '1' or (nibble_r /= PREAMBLE_NIBBLE and nibble_r /= START_NIBBLE) then
          rx_state_r <= SKIPPED;
          arrives_r  <= '1';
          arrived_r  <= word_of(WRONG_BYTE, '1', '0');
        elsif nibble_r = START_NIBBLE then
          rx_state_r <= LOWER;
          arrives_r  <= '1';
          arrived_r  <= word_of(START_BYTE, '1', '0');
        elsif rx_state_r = IDLE then
          rx_state_r <= PREAMBLE;
          arrives_r  <= '1';
          arrived_r  <= word_of(PREAMBLE_BYTE, '1', '0');
        end if;
      elsif rx_state_r = LOWER then
        rx_state_r <= UPPER;
        lower_r    <= nibble_r;
        lower_er_r <= er_r;
      elsif rx_state_r = UPPER then
        rx_state_r <= LOWER;
        arrives_r  <= '1';
        arrived_r  <= word_of(nibble_r & lower_r, '1', er_r or lower_er_r);
      end if;
      if rx_rst_n = '0' then
        rx_state_r <= SKIPPED;
        arrives_r  <= '0';
      end if;
    end if;
  end process join_nibbles;

  u_from_phy : entity firm.firm_cdc_stream
    generic map (
      S_WIDTH => WORD_BITS,
      M_WIDTH => WORD_BITS
    )
    port map (
      s_clk         => mii_rx_clk,
      s_rst_n       => rx_rst_n,
      s_idle        => open,
      s_axis_tdata  => arrived_r,
      s_axis_tkeep  => "11",
      s_axis_tvalid => arrives_r,
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

  sent    <= word_of(txd, tx_en, tx_er);
  sends   <= '1' when tx_en = '1' or gap_r /= 0 else '0';
  moves   <= has_room or not sends;
  tx_step <= moves;

  count_gap : process (clk)
  begin
    if rising_edge(clk) then
      if moves = '1' and tx_en = '1' then
        gap_r <= GAP_BYTES;
      elsif moves = '1' and gap_r /= 0 then
        gap_r <= gap_r - 1;
      end if;
      if rst_n = '0' then
        gap_r <= 0;
      end if;
    end if;
  end process count_gap;

  u_to_phy : entity firm.firm_cdc_stream
    generic map (
      S_WIDTH => WORD_BITS,
      M_WIDTH => WORD_BITS
    )
    port map (
      s_clk         => clk,
      s_rst_n       => rst_n,
      s_idle        => open,
      s_axis_tdata  => sent,
      s_axis_tkeep  => "11",
      s_axis_tvalid => sends,
      s_axis_tlast  => '0',
      s_axis_tready => has_room,
      m_clk         => mii_tx_clk,
      m_rst_n       => tx_rst_n,
      m_axis_tdata  => leaving,
      m_axis_tkeep  => open,
      m_axis_tvalid => leaves,
      m_axis_tlast  => open,
      m_axis_tready => take
    );

  u_tx_reset : entity firm.firm_cdc_reset
    port map (
      clk          => mii_tx_clk,
      rst_n        => rst_n,
      synced_rst_n => tx_rst_n
    );

  take <= not is_upper_r;

  part : process (mii_tx_clk)
  begin
    if rising_edge(mii_tx_clk) then
      if is_upper_r = '1' then
        is_upper_r <= '0';
        mii_txd    <= upper_r;
      else
        is_upper_r <= leaves;
        mii_tx_en  <= leaves and leaving(VALID_BIT);
        mii_tx_er  <= leaves and leaving(ERROR_BIT);
        mii_txd    <= leaving(3 downto 0);
        upper_r    <= leaving(7 downto 4);
      end if;
      if tx_rst_n = '0' then
        is_upper_r <= '0';
        mii_tx_en  <= '0';
        mii_tx_er  <= '0';
      end if;
    end if;
  end process part;

end architecture rtl;
