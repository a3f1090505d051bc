-- SPDX-License-Identifier: Apache-2.0
-- The order of numbers that wrap around, such as times of a counter.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_sched_queue_pkg is

  -- '1' if `left` comes before `right`, both of the same length and less than half their range apart. With an index
  -- behind it, a key has an order without ties: the keys decide, and the index where they are equal.
  function is_before(left, right : std_logic_vector) return std_logic;

end package firm_sched_queue_pkg;

package body firm_sched_queue_pkg is

  function is_before(left, right : std_logic_vector) return std_logic is
    variable difference : unsigned(left'length-1 downto 0);
  begin
    difference := unsigned(left) - unsigned(right);
    return difference(difference'high);
  end function is_before;

end package body firm_sched_queue_pkg;
