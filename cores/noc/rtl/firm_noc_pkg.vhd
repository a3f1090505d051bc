-- SPDX-License-Identifier: Apache-2.0
-- The routes of a router, which are constants, and what follows from them: only the turns in use are built. A turn
-- leads from an input to an output.
library ieee;
use ieee.std_logic_1164.all;

package firm_noc_pkg is

  -- At this input, the destination leads to this output. Several outputs of one destination each receive a copy.
  type route_t is record
    input       : natural;
    destination : natural;
    output      : natural;
  end record route_t;
  type routes_t is array (natural range <>) of route_t;

  -- A matrix of the turns in use: bit `input*ports+output`.
  function turns_of(routes : routes_t; ports : positive) return std_logic_vector;

  -- The number of turns from an input, or to an output.
  function count_from(turns : std_logic_vector; ports : positive; input : natural) return natural;
  function count_to(turns : std_logic_vector; ports : positive; output : natural) return natural;

  -- The input or output of such a turn, the lowest one first; 0 beyond the last one.
  function output_from(turns : std_logic_vector; ports : positive; input, turn : natural) return natural;
  function input_to(turns : std_logic_vector; ports : positive; output, turn : natural) return natural;

  -- Whether a destination of the input has several outputs.
  function has_copies(routes : routes_t; input : natural) return boolean;

end package firm_noc_pkg;

package body firm_noc_pkg is

  function turns_of(routes : routes_t; ports : positive) return std_logic_vector is
    variable turns : std_logic_vector(ports*ports-1 downto 0) := (others => '0');
  begin
    for place in routes'range loop
      turns(routes(place).input*ports + routes(place).output) := '1';
    end loop;
    return turns;
  end function turns_of;

  function count_from(turns : std_logic_vector; ports : positive; input : natural) return natural is
    variable count : natural := 0;
  begin
    for output in 0 to ports-1 loop
      if turns(input*ports + output) = '1' then
        count := count + 1;
      end if;
    end loop;
    return count;
  end function count_from;

  function count_to(turns : std_logic_vector; ports : positive; output : natural) return natural is
    variable count : natural := 0;
  begin
    for input in 0 to ports-1 loop
      if turns(input*ports + output) = '1' then
        count := count + 1;
      end if;
    end loop;
    return count;
  end function count_to;

  function output_from(turns : std_logic_vector; ports : positive; input, turn : natural) return natural is
    variable count : natural := 0;
  begin
    for output in 0 to ports-1 loop
      if turns(input*ports + output) = '1' then
        if count = turn then
          return output;
        end if;
        count := count + 1;
      end if;
    end loop;
    return 0;
  end function output_from;

  function input_to(turns : std_logic_vector; ports : positive; output, turn : natural) return natural is
    variable count : natural := 0;
  begin
    for input in 0 to ports-1 loop
      if turns(input*ports + output) = '1' then
        if count = turn then
          return input;
        end if;
        count := count + 1;
      end if;
    end loop;
    return 0;
  end function input_to;

  function has_copies(routes : routes_t; input : natural) return boolean is
  begin
    for first in routes'range loop
      for second in routes'range loop
        if routes(first).input = input and routes(second).input = input and
           routes(first).destination = routes(second).destination and
           routes(first).output /= routes(second).output then
          return true;
        end if;
      end loop;
    end loop;
    return false;
  end function has_copies;

end package body firm_noc_pkg;
