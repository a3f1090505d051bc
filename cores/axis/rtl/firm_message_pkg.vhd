-- SPDX-License-Identifier: Apache-2.0
-- Functions for accelerators that process the values of messages.
library ieee;
use ieee.std_logic_1164.all;

package firm_message_pkg is

  -- Whether a value equals a constant, as `value = reference` but bit by bit. GHDL 2.0 synthesises a 64-bit constant as
  -- zero if its low half is zero, and writes a constant of more than 32 bits to Verilog as a string. This function uses
  -- only constants of one bit.
  function is_equal(value, reference : std_logic_vector) return boolean;

end package firm_message_pkg;

package body firm_message_pkg is

  function is_equal(value, reference : std_logic_vector) return boolean is
    alias value_bits     : std_logic_vector(value'length-1 downto 0) is value;
    alias reference_bits : std_logic_vector(reference'length-1 downto 0) is reference;
    variable equal       : boolean := true;
  begin
    if value'length /= reference'length then
      return false;
    end if;
    for place in value_bits'range loop
      if value_bits(place) /= reference_bits(place) then
        equal := false;
      end if;
    end loop;
    return equal;
  end function is_equal;

end package body firm_message_pkg;
