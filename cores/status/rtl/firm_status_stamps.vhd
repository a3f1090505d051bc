-- SPDX-License-Identifier: Apache-2.0
-- A table of time stamps in memory: an operation stores `op_stamp` at `op_index`. There may be an operation in every
-- cycle. `read_stamp` follows `read_index` by one cycle. A reset does not clear the table.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_status_stamps is
  generic (
    INDEX_BITS : positive := 1
  );
  port (
    clk : in std_logic;

    op_valid : in std_logic;
    op_index : in std_logic_vector(INDEX_BITS-1 downto 0);
    op_stamp : in std_logic_vector(31 downto 0);

    read_index : in  std_logic_vector(INDEX_BITS-1 downto 0);
    read_stamp : out std_logic_vector(31 downto 0)
  );
end entity firm_status_stamps;

architecture rtl of firm_status_stamps is

  type memory_t is array (natural range 0 to 2**INDEX_BITS-1) of std_logic_vector(31 downto 0);
  signal memory : memory_t := (others => (others => '0'));

begin

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if op_valid = '1' then
        memory(to_integer(unsigned(op_index))) <= op_stamp;
      end if;
      read_stamp <= memory(to_integer(unsigned(read_index)));
    end if;
  end process access_memory;

end architecture rtl;
