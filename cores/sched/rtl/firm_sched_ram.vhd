-- SPDX-License-Identifier: Apache-2.0
-- A memory with one port and an asynchronous read, for which FPGAs use LUTs as RAM. Reset does not clear it.
-- If the address is a register, synthesis may use a block RAM for many bits, which is slower. The words are therefore
-- divided among memories of at most 1024 bits, whose words have a multiple of the 7 bits that a memory of LUTs holds in
-- an UltraScale+.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_sched_ram is
  generic (
    ADDRESS_BITS : positive;
    WORD_BITS    : positive
  );
  port (
    clk : in std_logic;

    address      : in  std_logic_vector(ADDRESS_BITS-1 downto 0);
    read_word    : out std_logic_vector(WORD_BITS-1 downto 0);
    write_enable : in  std_logic;
    write_word   : in  std_logic_vector(WORD_BITS-1 downto 0)
  );
end entity firm_sched_ram;

architecture rtl of firm_sched_ram is

  constant MOST_BITS  : positive := max(1, 1024 / 2**ADDRESS_BITS);
  constant SLICE_BITS : positive := max(MOST_BITS - MOST_BITS mod 7, MOST_BITS mod 7);
  constant SLICES     : positive := (WORD_BITS + SLICE_BITS - 1) / SLICE_BITS;

begin

  slices_of_words : for slice in 0 to SLICES-1 generate
    constant LOW    : natural  := slice * SLICE_BITS;
    constant BITS   : positive := SLICE_BITS - max(0, LOW + SLICE_BITS - WORD_BITS);
    type     memory_t is array (natural range 0 to 2**ADDRESS_BITS-1) of std_logic_vector(BITS-1 downto 0);
    signal   memory : memory_t := (others => (others => '0'));
  begin
    write_memory : process (clk)
    begin
      if rising_edge(clk) then
        if write_enable = '1' then
          memory(to_integer(unsigned(address))) <= write_word(LOW+BITS-1 downto LOW);
        end if;
      end if;
    end process write_memory;

    read_word(LOW+BITS-1 downto LOW) <= memory(to_integer(unsigned(address)));
  end generate slices_of_words;

end architecture rtl;
