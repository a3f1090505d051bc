-- SPDX-License-Identifier: Apache-2.0
-- The checksum of links, for their hosts in simulation: CRC-32 as in Ethernet and zlib. Simulation only.
library ieee;
use ieee.std_logic_1164.all;

package firm_sim_link_pkg is

  constant CHECKSUM_BYTES : positive := 4;

  subtype crc_t is std_logic_vector(31 downto 0);

  constant CRC_START   : crc_t := x"ffffffff";
  -- After a row of bytes and its checksum, which is the inverted value before it.
  constant CRC_RESIDUE : crc_t := x"debb20e3";

  function next_crc(crc : crc_t; data : std_logic_vector(7 downto 0)) return crc_t;

end package firm_sim_link_pkg;

package body firm_sim_link_pkg is

  function next_crc(crc : crc_t; data : std_logic_vector(7 downto 0)) return crc_t is
    variable result   : crc_t := crc;
    variable has_left : std_logic;
  begin
    for place in 0 to 7 loop
      has_left := result(0) xor data(place);
      result   := '0' & result(31 downto 1);
      if has_left = '1' then
        result := result xor x"edb88320";
      end if;
    end loop;
    return result;
  end function next_crc;

end package body firm_sim_link_pkg;
