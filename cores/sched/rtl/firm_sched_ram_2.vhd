-- SPDX-License-Identifier: Apache-2.0
-- Like firm_sched_ram, with a second read address.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_sched_ram_2 is
  generic (
    ADDRESS_BITS : positive;
    WORD_BITS    : positive
  );
  port (
    clk : in std_logic;

    address      : in  std_logic_vector(ADDRESS_BITS-1 downto 0);
    read_word    : out std_logic_vector(WORD_BITS-1 downto 0);
    write_enable : in  std_logic;
    write_word   : in  std_logic_vector(WORD_BITS-1 downto 0);

    address_2   : in  std_logic_vector(ADDRESS_BITS-1 downto 0);
    read_word_2 : out std_logic_vector(WORD_BITS-1 downto 0)
  );
end entity firm_sched_ram_2;

architecture rtl of firm_sched_ram_2 is

  type memory_t is array (natural range 0 to 2**ADDRESS_BITS-1) of std_logic_vector(WORD_BITS-1 downto 0);
  signal memory : memory_t := (others => (others => '0'));

begin

  write_memory : process (clk)
  begin
    if rising_edge(clk) then
      if write_enable = '1' then
        memory(to_integer(unsigned(address))) <= write_word;
      end if;
    end if;
  end process write_memory;

  read_word   <= memory(to_integer(unsigned(address)));
  read_word_2 <= memory(to_integer(unsigned(address_2)));

end architecture rtl;
