-- SPDX-License-Identifier: Apache-2.0
-- Connects receiver and transmitter to a PHY by RMII, at 100 Mbit/s, full duplex. `clk` is the 50 MHz reference
-- clock, shared with the PHY. Two bits are sent at a time, the lower ones first.
--
-- The PHY shows carrier and valid data on one pin: it may go high before the preamble, and after the carrier it is low
-- in the first half of each nibble until the last nibble.
library ieee;
use ieee.std_logic_1164.all;

entity firm_rmii is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The pins.
    rmii_crs_dv : in  std_logic;
    rmii_rxd    : in  std_logic_vector(1 downto 0);
    rmii_tx_en  : out std_logic;
    rmii_txd    : out std_logic_vector(1 downto 0);

    -- To firm_mac_receiver.
    rx_step : out std_logic;
    rx_dv   : out std_logic;
    rx_er   : out std_logic;
    rxd     : out std_logic_vector(7 downto 0);

    -- From firm_mac_transmitter. A pin for tx_er is missing; a frame with tx_er also has a wrong checksum.
    tx_step : out std_logic;
    tx_en   : in  std_logic;
    txd     : in  std_logic_vector(7 downto 0)
  );
end entity firm_rmii;

architecture rtl of firm_rmii is

  constant PAIRS : positive := 4;  -- in a byte

  subtype pair_t is std_logic_vector(1 downto 0);
  constant CARRIER_PAIR  : pair_t := "00";
  constant PREAMBLE_PAIR : pair_t := "01";
  constant START_PAIR    : pair_t := "11";

  constant START_BYTE : std_logic_vector(7 downto 0) := x"d5";
  -- Not a pair of the preamble: the receiver drops a burst that begins with it.
  constant WRONG_BYTE : std_logic_vector(7 downto 0) := x"00";

  type rx_state_t is (IDLE, PREAMBLE, BYTES, SKIPPED);
  signal rx_state_r : rx_state_t;
  signal dv_r       : std_logic;
  signal pair_r     : pair_t;
  signal was_dv_r   : std_logic;                        -- of the previous pair
  signal place_r    : natural range 0 to PAIRS-1;       -- of the pair in its byte
  signal byte_r     : std_logic_vector(7 downto 0);
  signal is_over    : std_logic;                        -- two pairs without valid data

  signal phase_r : natural range 0 to PAIRS-1;
  signal rest_r  : std_logic_vector(5 downto 0);        -- of the byte that is sent

begin

  -- ------------------------------------------------------------------ from the PHY

  is_over <= not (dv_r or was_dv_r);

  sample : process (clk)
  begin
    if rising_edge(clk) then
      dv_r     <= rmii_crs_dv;
      pair_r   <= rmii_rxd;
      was_dv_r <= dv_r;
    end if;
  end process sample;

  join_pairs : process (clk)
  begin
    if rising_edge(clk) then
      rx_step <= '0';
      if rx_state_r /= IDLE and is_over = '1' then
        rx_state_r <= IDLE;
        rx_step    <= '1';
        rx_dv      <= '0';
      elsif rx_state_r = IDLE or rx_state_r = PREAMBLE then
        if dv_r = '0' then
          null;
        elsif pair_r = PREAMBLE_PAIR then
          rx_state_r <= PREAMBLE;
        elsif pair_r = START_PAIR and rx_state_r = PREAMBLE then
          rx_state_r <= BYTES;
          place_r    <= 0;
          rx_step    <= '1';
          rx_dv      <= '1';
          rxd        <= START_BYTE;
        elsif pair_r /= CARRIER_PAIR or rx_state_r = PREAMBLE then
          rx_state_r <= SKIPPED;
          rx_step    <= '1';
          rx_dv      <= '1';
          rxd        <= WRONG_BYTE;
        end if;
      elsif rx_state_r = BYTES then
        byte_r  <= pair_r & byte_r(7 downto 2);
        place_r <= (place_r + 1) mod PAIRS;
        if place_r = PAIRS-1 and dv_r = '1' then
          rx_step <= '1';
          rxd     <= pair_r & byte_r(7 downto 2);
        end if;
      end if;
      if rst_n = '0' then
        rx_state_r <= SKIPPED;
        rx_step    <= '0';
      end if;
    end if;
  end process join_pairs;

  rx_er <= '0';

  -- ------------------------------------------------------------------ to the PHY

  tx_step <= '1' when phase_r = PAIRS-1 else '0';

  part : process (clk)
  begin
    if rising_edge(clk) then
      rmii_txd <= rest_r(1 downto 0);
      rest_r   <= "00" & rest_r(5 downto 2);
      if phase_r = PAIRS-1 then
        phase_r    <= 0;
        rmii_tx_en <= tx_en;
        rmii_txd   <= txd(1 downto 0);
        rest_r     <= txd(7 downto 2);
      else
        phase_r <= phase_r + 1;
      end if;
      if rst_n = '0' then
        phase_r    <= 0;
        rmii_tx_en <= '0';
      end if;
    end if;
  end process part;

end architecture rtl;
