-- SPDX-License-Identifier: Apache-2.0
-- Receives bytes from a serial line: a start bit, eight data bits with the lowest first, a stop bit. Each bit is
-- sampled in its middle. A low stop bit is a break if all other bits were low, too, and a fault otherwise. In either
-- case the line must rise before the next byte can start.
library ieee;
use ieee.std_logic_1164.all;

entity firm_uart_receiver is
  generic (
    DIVISOR : integer := 16  -- cycles of a bit
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    uart_rxd : in std_logic;

    data     : out std_logic_vector(7 downto 0);
    valid    : out std_logic;   -- a pulse with each byte
    is_break : out std_logic;   -- a pulse
    is_wrong : out std_logic  -- a pulse: the stop bit was low
  );
end entity firm_uart_receiver;

architecture rtl of firm_uart_receiver is

  constant FIRST_BIT : natural := 0;
  constant STOP_BIT  : natural := 9;  -- after the start bit and eight data bits

  type state_t is (WAITING, RECEIVING, RECOVERING);

  signal line_r  : std_logic_vector(1 downto 0);  -- the asynchronous pin after two flip-flops; bit 1 is older
  signal state_r : state_t;
  signal count_r : natural range 0 to DIVISOR-1;  -- cycles until the next bit's middle
  signal bit_r   : natural range FIRST_BIT to STOP_BIT;
  signal byte_r  : std_logic_vector(7 downto 0);

begin

  assert DIVISOR >= 4
    report "firm_uart_receiver: DIVISOR is " & integer'image(DIVISOR) & "; legal: 4 or more"
    severity failure;

  receive : process (clk)

    procedure take_bit is
    begin
      count_r <= DIVISOR-1;
      bit_r   <= bit_r + 1;
      if bit_r = FIRST_BIT then
        -- Too short for a start bit.
        if line_r(1) = '1' then
          state_r <= WAITING;
        end if;
      elsif bit_r < STOP_BIT then
        byte_r <= line_r(1) & byte_r(7 downto 1);
      end if;
    end procedure take_bit;

    procedure finish_byte is
    begin
      state_r <= WAITING;
      valid   <= line_r(1);
      if line_r(1) = '0' then
        state_r <= RECOVERING;
        if byte_r = x"00" then
          is_break <= '1';
        else
          is_wrong <= '1';
        end if;
      end if;
    end procedure finish_byte;

  begin
    if rising_edge(clk) then
      line_r   <= line_r(0) & uart_rxd;
      valid    <= '0';
      is_break <= '0';
      is_wrong <= '0';
      if state_r = WAITING then
        count_r <= DIVISOR/2 - 1;
        bit_r   <= FIRST_BIT;
        if line_r(1) = '0' then
          state_r <= RECEIVING;
        end if;
      elsif state_r = RECOVERING then
        if line_r(1) = '1' then
          state_r <= WAITING;
        end if;
      elsif count_r /= 0 then
        count_r <= count_r - 1;
      elsif bit_r = STOP_BIT then
        finish_byte;
      else
        take_bit;
      end if;
      if rst_n = '0' then
        line_r  <= "11";
        state_r <= RECOVERING;
      end if;
    end if;
  end process receive;

  data <= byte_r;

end architecture rtl;
