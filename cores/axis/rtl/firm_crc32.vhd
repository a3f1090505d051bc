-- SPDX-License-Identifier: Apache-2.0
-- CRC-32 of a row of bytes, as in Ethernet and zlib: polynomial 04C11DB7, lowest bit first, ones at the start, inverted
-- at the end. On a wire, the lowest byte comes first.
library ieee;
use ieee.std_logic_1164.all;

entity firm_crc32 is
  port (
    clk   : in std_logic;
    clear : in std_logic;  -- begins a row; overrides `valid`

    data  : in std_logic_vector(7 downto 0);
    valid : in std_logic;

    -- Of the bytes so far.
    value    : out std_logic_vector(31 downto 0);
    is_right : out std_logic  -- the last four bytes are the checksum of those before
  );
end entity firm_crc32;

architecture rtl of firm_crc32 is

  subtype crc_t is std_logic_vector(31 downto 0);

  constant POLYNOMIAL : crc_t := x"edb88320";  -- lowest bit first
  -- The register after any row of bytes that is followed by its checksum.
  constant RESIDUE    : crc_t := x"debb20e3";

  signal crc_r : crc_t;

  function next_crc(crc : crc_t; byte : std_logic_vector(7 downto 0)) return crc_t is
    variable feedback : crc_t;
    variable result   : crc_t;
  begin
    result             := crc;
    result(7 downto 0) := crc(7 downto 0) xor byte;
    for step in byte'range loop
      feedback := (others => result(0));
      result   := ('0' & result(31 downto 1)) xor (POLYNOMIAL and feedback);
    end loop;
    return result;
  end function next_crc;

begin

  count : process (clk)
  begin
    if rising_edge(clk) then
      if clear = '1' then
        crc_r <= (others => '1');
      elsif valid = '1' then
        crc_r <= next_crc(crc_r, data);
      end if;
    end if;
  end process count;

  value    <= not crc_r;
  is_right <= '1' when crc_r = RESIDUE else '0';

end architecture rtl;
