-- All that GHDL 2.0 writes wrongly in Verilog: division of signed numbers, arithmetic shifts, `abs`, wide constants,
-- a `case` whose last choice is `others`, and a signal that does not keep its first value.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity arithmetic is
  generic (
    OFFSET : integer := 1
  );
  port (
    clk      : in  std_logic;
    a        : in  std_logic_vector(15 downto 0);
    b        : in  std_logic_vector(15 downto 0);
    quotient : out std_logic_vector(15 downto 0);
    modulus  : out std_logic_vector(15 downto 0);
    rest     : out std_logic_vector(15 downto 0);
    shifted  : out std_logic_vector(15 downto 0);
    absolute : out std_logic_vector(15 downto 0);
    product  : out std_logic_vector(31 downto 0);
    wide     : out std_logic_vector(79 downto 0);
    by_bits  : out std_logic_vector(15 downto 0);
    by_bit   : out std_logic;
    turn     : out std_logic_vector(15 downto 0);
    driven   : out std_logic_vector(3 downto 0)
  );
end entity arithmetic;

architecture rtl of arithmetic is

  type turn_t is (FIRST, SECOND, THIRD);

  signal turn_r : turn_t := FIRST;
  signal fixed  : std_logic_vector(3 downto 0) := "0011";

begin

  fixed    <= "0101";
  driven   <= fixed;
  quotient <= std_logic_vector(signed(a) / signed(b));
  modulus  <= std_logic_vector(signed(a) mod signed(b));
  rest     <= std_logic_vector(signed(a) rem signed(b));
  shifted  <= std_logic_vector(shift_right(signed(a), to_integer(unsigned(b(3 downto 0)))));
  absolute <= std_logic_vector(abs signed(a));
  product  <= std_logic_vector(signed(a) * signed(b));
  wide     <= X"0123456789ABCDEF0123" when a(0) = '1' else X"123456789ABCDEF01234";

  choose : process (a, b)
  begin
    case a(1 downto 0) is
      when "00"   => by_bits <= a;
      when "01"   => by_bits <= b;
      when others => by_bits <= a(7 downto 0) & b(15 downto 8);
    end case;
    case a(3 downto 2) is
      when "00"   => by_bit <= b(0);
      when "10"   => by_bit <= '0';
      when others => by_bit <= '1';
    end case;
  end process choose;

  go_on : process (clk)
  begin
    if rising_edge(clk) then
      case turn_r is
        when FIRST  => turn_r <= SECOND; turn <= a;
        when SECOND => turn_r <= THIRD;  turn <= b;
        when THIRD  => turn_r <= FIRST;  turn <= std_logic_vector(to_signed(OFFSET, 16));
      end case;
    end if;
  end process go_on;

end architecture rtl;
