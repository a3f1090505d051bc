-- SPDX-License-Identifier: Apache-2.0
-- Sends bytes to a serial line: a start bit, eight data bits with the lowest first, a stop bit. No byte starts while
-- the other side is not ready; a started byte is completed. Ready bytes follow each other without a pause.
library ieee;
use ieee.std_logic_1164.all;

entity firm_uart_transmitter is
  generic (
    DIVISOR : integer := 16  -- cycles of a bit
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    data  : in  std_logic_vector(7 downto 0);
    valid : in  std_logic;
    ready : out std_logic;

    uart_txd   : out std_logic;
    uart_cts_n : in  std_logic  -- low: the other side is ready
  );
end entity firm_uart_transmitter;

architecture rtl of firm_uart_transmitter is

  constant BITS : positive := 10;

  signal cts_n_r : std_logic_vector(1 downto 0);  -- the asynchronous pin after two flip-flops; bit 1 is older
  signal count_r : natural range 0 to DIVISOR-1;  -- remaining cycles of the bit
  signal left_r  : natural range 0 to BITS-1;     -- bits after this one
  signal bits_r  : std_logic_vector(BITS-1 downto 0);
  signal done    : std_logic;                     -- the last bit ends in this cycle

  signal ready_out : std_logic;

begin

  assert DIVISOR >= 4
    report "firm_uart_transmitter: DIVISOR is " & integer'image(DIVISOR) & "; legal: 4 or more"
    severity failure;

  done      <= '1' when count_r = 0 and left_r = 0 else '0';
  ready_out <= done and not cts_n_r(1);

  transmit : process (clk)
  begin
    if rising_edge(clk) then
      cts_n_r <= cts_n_r(0) & uart_cts_n;
      if count_r /= 0 then
        count_r <= count_r - 1;
      elsif left_r /= 0 then
        count_r <= DIVISOR-1;
        left_r  <= left_r - 1;
        bits_r  <= '1' & bits_r(BITS-1 downto 1);
      elsif valid = '1' and ready_out = '1' then
        count_r <= DIVISOR-1;
        left_r  <= BITS-1;
        bits_r  <= '1' & data & '0';
      end if;
      if rst_n = '0' then
        cts_n_r <= "11";
        count_r <= 0;
        left_r  <= 0;
        bits_r  <= (others => '1');
      end if;
    end if;
  end process transmit;

  ready    <= ready_out;
  uart_txd <= bits_r(0);

end architecture rtl;
