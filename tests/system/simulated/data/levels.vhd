-- What is at the pins of two probes: 1.5 at the first while it asks, -2.0 at the second at any time.
library ieee;
use ieee.std_logic_1164.all;

entity levels is
  port (
    clk          : in  std_logic;
    rst_n        : in  std_logic;
    first_asked  : in  std_logic;
    first_level  : out std_logic_vector(63 downto 0);
    second_asked : in  std_logic;
    second_level : out std_logic_vector(63 downto 0)
  );
end entity levels;

architecture behaviour of levels is
begin

  first_level  <= x"3FF8000000000000" when first_asked = '1' and rst_n = '1' else (others => 'X');
  second_level <= x"C000000000000000";

end architecture behaviour;
