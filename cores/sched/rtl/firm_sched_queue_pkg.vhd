-- SPDX-License-Identifier: Apache-2.0
-- The order of numbers that wrap around, such as times of a counter, and the arrangement of requesters in rows.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

package firm_sched_queue_pkg is

  -- Large numbers of requesters are arranged in rows. These are the bits of a row's number and of a column's, half an
  -- index each. Both are at least 1, so two requesters form a row, and a second row is unused.
  function column_bits_of(requesters : integer) return positive;
  function row_bits_of(requesters : integer) return positive;

  -- '1' if `left` comes before `right`; both have the same length and are less than half their range apart. An index
  -- appended to the key gives an order without ties: keys decide, and the index if they are equal.
  function is_before(left, right : std_logic_vector) return std_logic;

  -- '1' if `key` is two or three eighths of the range before `now`, each truncated to whole eighths. If time then
  -- stops, and no new key is an eighth or more before or after it, keys are never half the range apart.
  function is_overdue(key, now : std_logic_vector) return std_logic;

  -- The items of a segment of firm_sched_sorted_queue, which has none for up to two segments' items.
  constant SEGMENT_ITEMS : positive := 32;

end package firm_sched_queue_pkg;

package body firm_sched_queue_pkg is

  function column_bits_of(requesters : integer) return positive is
  begin
    return max(1, index_bits(requesters) / 2);
  end function column_bits_of;

  function row_bits_of(requesters : integer) return positive is
  begin
    return max(1, index_bits(requesters) - column_bits_of(requesters));
  end function row_bits_of;

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
