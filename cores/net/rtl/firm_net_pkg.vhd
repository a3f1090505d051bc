-- SPDX-License-Identifier: Apache-2.0
-- Bytes of a frame, for cores that compare each byte on arrival.
library ieee;
use ieee.std_logic_1164.all;

package firm_net_pkg is

  subtype byte_t is std_logic_vector(7 downto 0);

  type bytes_t is array (natural range <>) of byte_t;

  -- Byte `index` of a word, counted as on the line: byte 0 is the highest.
  function byte_of(word : std_logic_vector; index : natural) return byte_t;

  -- The bytes of a word as they are in a frame from `place` on.
  function placed(word : std_logic_vector; place : natural) return bytes_t;

  -- Whether a byte at `place` is not that of `wanted`, whose indices are the places of its bytes.
  function differs(place : natural; byte : byte_t; wanted : bytes_t) return boolean;

end package firm_net_pkg;

package body firm_net_pkg is

  function byte_of(word : std_logic_vector; index : natural) return byte_t is
    constant BITS : std_logic_vector(word'length-1 downto 0) := word;
  begin
    return BITS(BITS'high-8*index downto BITS'high-8*index-7);
  end function byte_of;

  function placed(word : std_logic_vector; place : natural) return bytes_t is
    variable bytes : bytes_t(place to place+word'length/8-1);
  begin
    for index in bytes'range loop
      bytes(index) := byte_of(word, index - place);
    end loop;
    return bytes;
  end function placed;

  function differs(place : natural; byte : byte_t; wanted : bytes_t) return boolean is
  begin
    for index in wanted'range loop
      if place = index and byte /= wanted(index) then
        return true;
      end if;
    end loop;
    return false;
  end function differs;

end package body firm_net_pkg;
