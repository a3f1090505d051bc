-- SPDX-License-Identifier: Apache-2.0
-- The order of numbers that wrap around, such as times of a counter.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_sched_queue_pkg is

  -- '1' if `left` comes before `right`, both of the same length and less than half their range apart. With an index
  -- behind it, a key has an order without ties: the keys decide, and the index where they are equal.
  function is_before(left, right : std_logic_vector) return std_logic;

  -- '1' if `key` lies two or three eighths of the range before `now`, each cut to whole eighths. If time stands
  -- still then, and no new key is an eighth or more before or behind it, keys are never half the range apart.
  function is_overdue(key, now : std_logic_vector) return std_logic;

end package firm_sched_queue_pkg;

package body firm_sched_queue_pkg is

  function is_before(left, right : std_logic_vector) return std_logic is
    variable difference : unsigned(left'length-1 downto 0);
  begin
    difference := unsigned(left) - unsigned(right);
    return difference(difference'high);
  end function is_before;

  function is_overdue(key, now : std_logic_vector) return std_logic is
    variable eighths : unsigned(2 downto 0);
  begin
    eighths := unsigned(now(now'high downto now'high-2)) - unsigned(key(key'high downto key'high-2));
    return eighths(1) and not eighths(2);
  end function is_overdue;

end package body firm_sched_queue_pkg;
