-- SPDX-License-Identifier: Apache-2.0
-- Common functions of the schedulers: the choice among requesters, the times of tasks, and the check of generics.
-- Generics may be illegal, and the assert that names them runs only after elaboration. No function here may therefore
-- fail on them: a function that needs a missing time returns 1.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

package firm_sched_pkg is

  constant MAX_REQUESTERS : positive := 256;

  -- `make policies` writes the list from fusesoc_firm/scheduling/policies.py.
  type policy_t is (FIXED_PRIORITY, FIXED_PRIORITY_PREEMPTIVE, ROUND_ROBIN, LRU, EDF_RESOURCES, EDF_LATENCY, LST);
  type policies_t is array (natural range <>) of policy_t;

  type times_t is array (natural range <>) of integer;  -- in clock cycles, one for each requester

  -- Whether a bit is '1', and the index of the lowest one, with index_bits(bits'length) bits; if there is none, any
  -- index.
  function any_of(bits : std_logic_vector) return std_logic;
  function first_of(bits : std_logic_vector) return std_logic_vector;

  -- The same as the only '1' of as many bits; if there is none, zeros.
  function only_first_of(bits : std_logic_vector) return std_logic_vector;

  -- The index of the only '1'; if there is none, any index.
  function index_of(one_hot : std_logic_vector) return std_logic_vector;

  -- The word at the place of the only '1', of as many words; word 0 is the lowest. If there is none, zeros.
  function word_of(one_hot, words : std_logic_vector) return std_logic_vector;

  -- Bit k is '1' if k is more than `index`.
  function above(index : std_logic_vector; outputs : natural) return std_logic_vector;

  -- A substitute for deadlines: each deadline is its requester's period.
  constant IMPLICIT : times_t(0 to 0) := (0 => 0);

  function has_deadlines(policy : policy_t) return boolean;

  function time_of(requester : natural; times : times_t) return integer;

  -- The relative deadline of a requester's tasks.
  function deadline_of(requester : natural; periods, deadlines : times_t) return integer;
  function deadlines_of(requesters : integer; periods, deadlines : times_t) return times_t;  -- of all
  function slacks_of(requesters : integer; deadlines, transfer_times : times_t) return times_t;  -- at the request

  -- The times of `count` requesters from `first` on. Deadlines that are implicit stay so.
  function part_of(times : times_t; first : natural; count : positive) return times_t;

  -- Of the first `count` elements.
  function sum_of(times : times_t; count : natural) return natural;

  -- A time less than this can be distinguished from a past one, with `time_bits` bits that wrap around.
  function horizon(time_bits : integer) return positive;

  -- A description of the fault in generics; empty if there is none.
  function fault_of_size(requesters : integer) return string;
  function fault_of_run(shortest_run : integer) return string;
  function fault_of_time_bits(time_bits : integer) return string;
  -- `kind` is "period", "deadline" or "transfer time"; `generic_name` is the generic that `times` come from.
  function fault_of_times(generic_name, kind : string; times : times_t; requesters, time_bits : integer) return string;
  -- Checks all generics of a policy with deadlines except the transfer times.
  function fault_of_deadlines(requesters : integer; periods, deadlines : times_t; time_bits, shortest_run : integer)
    return string;
  -- Checks the times of a policy that weighs them against deadlines.
  function fault_of_transfer(transfer_times : times_t; requesters, time_bits : integer) return string;
  function fault_of_groups(requesters : integer; sizes : times_t; policies : policies_t; top_policy : policy_t)
    return string;
  -- Checks the times of all groups, if the policy of one uses them.
  function fault_of_group_times(requesters : integer; policies : policies_t;
    periods, transfer_times, deadlines : times_t; time_bits, shortest_run : integer)
    return string;

end package firm_sched_pkg;

package body firm_sched_pkg is

  constant SHORTEST_TIME : positive := 8;   -- bits
  constant LONGEST_TIME  : positive := 31;

  -- Both are trees: a chain would be synthesised to long paths.
  function any_of(bits : std_logic_vector) return std_logic is
    constant COUNT : positive := bits'length;
    alias numbered : std_logic_vector(COUNT-1 downto 0) is bits;
  begin
    if COUNT = 1 then
      return numbered(0);
    end if;
    return any_of(numbered(COUNT-1 downto COUNT/2)) or any_of(numbered(COUNT/2-1 downto 0));
  end function any_of;

  function first_of(bits : std_logic_vector) return std_logic_vector is
    constant COUNT  : positive := bits'length;
    alias numbered  : std_logic_vector(COUNT-1 downto 0) is bits;
    constant HALF   : natural := 2**clog2(COUNT) / 2;  -- the largest power of two below
    variable lower  : std_logic_vector(index_bits(COUNT)-1 downto 0) := (others => '0');
    variable higher : std_logic_vector(index_bits(COUNT)-1 downto 0) := (others => '0');
  begin
    if COUNT = 1 then
      return lower;
    elsif COUNT > 2 then
      lower(index_bits(HALF)-1 downto 0)        := first_of(numbered(HALF-1 downto 0));
      higher(index_bits(COUNT-HALF)-1 downto 0) := first_of(numbered(COUNT-1 downto HALF));
    end if;
    higher(higher'high) := '1';
    if any_of(numbered(HALF-1 downto 0)) = '1' then
      return lower;
    end if;
    return higher;
  end function first_of;

  function only_first_of(bits : std_logic_vector) return std_logic_vector is
    constant COUNT : positive := bits'length;
    alias numbered : std_logic_vector(COUNT-1 downto 0) is bits;
    variable only  : std_logic_vector(COUNT-1 downto 0);
  begin
    only(0) := numbered(0);
    for place in 1 to COUNT-1 loop
      only(place) := numbered(place) and not any_of(numbered(place-1 downto 0));
    end loop;
    return only;
  end function only_first_of;

  function index_of(one_hot : std_logic_vector) return std_logic_vector is
    variable bits  : std_logic_vector(one_hot'length-1 downto 0);
    variable index : std_logic_vector(index_bits(one_hot'length)-1 downto 0) := (others => '0');
  begin
    bits := one_hot;
    for value in bits'range loop
      for place in index'range loop
        if (value / 2**place) mod 2 = 1 then
          index(place) := index(place) or bits(value);
        end if;
      end loop;
    end loop;
    return index;
  end function index_of;

  function word_of(one_hot, words : std_logic_vector) return std_logic_vector is
    constant WIDTH : positive := words'length / one_hot'length;
    alias places   : std_logic_vector(one_hot'length-1 downto 0) is one_hot;
    alias numbered : std_logic_vector(words'length-1 downto 0) is words;
    variable found : std_logic_vector(WIDTH-1 downto 0) := (others => '0');
  begin
    for place in places'range loop
      found := found or gated(numbered((place+1)*WIDTH-1 downto place*WIDTH), places(place));
    end loop;
    return found;
  end function word_of;

  function above(index : std_logic_vector; outputs : natural) return std_logic_vector is
    variable more : std_logic_vector(outputs-1 downto 0);
  begin
    for value in more'range loop
      more(value) := is_below(index, value);
    end loop;
    return more;
  end function above;

  function has_deadlines(policy : policy_t) return boolean is
  begin
    return policy = EDF_RESOURCES or policy = EDF_LATENCY or policy = LST;
  end function has_deadlines;

  function has_transfer_times(policy : policy_t) return boolean is
  begin
    return policy = LST;
  end function has_transfer_times;

  function is_implicit(deadlines : times_t) return boolean is
  begin
    return deadlines'length = 1 and time_of(0, deadlines) = 0;
  end function is_implicit;

  function time_of(requester : natural; times : times_t) return integer is
  begin
    if requester >= times'length then
      return 1;
    end if;
    return times(times'low + requester);
  end function time_of;

  function deadline_of(requester : natural; periods, deadlines : times_t) return integer is
  begin
    if is_implicit(deadlines) then
      return time_of(requester, periods);
    end if;
    return time_of(requester, deadlines);
  end function deadline_of;

  function deadlines_of(requesters : integer; periods, deadlines : times_t) return times_t is
    variable result : times_t(0 to requesters-1);
  begin
    for requester in result'range loop
      result(requester) := deadline_of(requester, periods, deadlines);
    end loop;
    return result;
  end function deadlines_of;

  function slacks_of(requesters : integer; deadlines, transfer_times : times_t) return times_t is
    variable result : times_t(0 to requesters-1);
  begin
    for requester in result'range loop
      result(requester) := time_of(requester, deadlines) - time_of(requester, transfer_times);
    end loop;
    return result;
  end function slacks_of;

  function part_of(times : times_t; first : natural; count : positive) return times_t is
    variable part : times_t(0 to count-1);
  begin
    if is_implicit(times) then
      return IMPLICIT;
    end if;
    for requester in part'range loop
      part(requester) := time_of(first+requester, times);
    end loop;
    return part;
  end function part_of;

  function sum_of(times : times_t; count : natural) return natural is
    variable sum : natural := 0;
  begin
    for place in 0 to count-1 loop
      sum := sum + time_of(place, times);
    end loop;
    return sum;
  end function sum_of;

  function horizon(time_bits : integer) return positive is
  begin
    if time_bits < SHORTEST_TIME or time_bits > LONGEST_TIME then
      return 1;
    end if;
    return 2**(time_bits-3);
  end function horizon;

  -- The smallest number of bits whose horizon exceeds `value`.
  function time_bits_for(value : integer) return positive is
  begin
    for bits in SHORTEST_TIME to LONGEST_TIME loop
      if value < horizon(bits) then
        return bits;
      end if;
    end loop;
    return LONGEST_TIME+1;
  end function time_bits_for;

  function fault_of_size(requesters : integer) return string is
  begin
    if requesters < 1 or requesters > MAX_REQUESTERS then
      return "REQUESTERS is " & integer'image(requesters) & "; legal: 1 to " & integer'image(MAX_REQUESTERS);
    end if;
    return "";
  end function fault_of_size;

  function fault_of_run(shortest_run : integer) return string is
  begin
    if shortest_run < 1 then
      return "SHORTEST_RUN is " & integer'image(shortest_run) & "; legal: 1 or more beats";
    end if;
    return "";
  end function fault_of_run;

  function fault_of_time_bits(time_bits : integer) return string is
  begin
    if time_bits < SHORTEST_TIME or time_bits > LONGEST_TIME then
      return "TIME_BITS is " & integer'image(time_bits) & "; legal: " & integer'image(SHORTEST_TIME) & " to " &
        integer'image(LONGEST_TIME);
    end if;
    return "";
  end function fault_of_time_bits;

  function fault_of_times(generic_name, kind : string; times : times_t; requesters, time_bits : integer)
    return string is
  begin
    if times'length /= requesters then
      return generic_name & " has " & integer'image(times'length) & " times; legal: one for each of " &
        integer'image(requesters) & " requesters";
    end if;
    for requester in natural range 0 to times'length-1 loop
      if time_of(requester, times) < 1 then
        return "the " & kind & " of requester " & integer'image(requester) & " is " &
          integer'image(time_of(requester, times)) & "; legal: 1 or more cycles";
      elsif time_of(requester, times) >= horizon(time_bits) then
        return "TIME_BITS is " & integer'image(time_bits) & "; the " & kind & " " &
          integer'image(time_of(requester, times)) & " of requester " & integer'image(requester) & " needs " &
          integer'image(time_bits_for(time_of(requester, times)));
      end if;
    end loop;
    return "";
  end function fault_of_times;

  function fault_of_deadlines(requesters : integer; periods, deadlines : times_t; time_bits, shortest_run : integer)
    return string is
  begin
    if fault_of_size(requesters) /= "" then
      return fault_of_size(requesters);
    elsif fault_of_run(shortest_run) /= "" then
      return fault_of_run(shortest_run);
    elsif fault_of_time_bits(time_bits) /= "" then
      return fault_of_time_bits(time_bits);
    elsif is_implicit(deadlines) then
      return fault_of_times("PERIODS", "deadline", periods, requesters, time_bits);
    -- A period that is not a deadline need not fit the time.
    elsif fault_of_times("PERIODS", "period", periods, requesters, LONGEST_TIME) /= "" then
      return fault_of_times("PERIODS", "period", periods, requesters, LONGEST_TIME);
    end if;
    return fault_of_times("DEADLINES", "deadline", deadlines, requesters, time_bits);
  end function fault_of_deadlines;

  function fault_of_transfer(transfer_times : times_t; requesters, time_bits : integer) return string is
  begin
    return fault_of_times("TRANSFER_TIMES", "transfer time", transfer_times, requesters, time_bits);
  end function fault_of_transfer;

  function fault_of_groups(requesters : integer; sizes : times_t; policies : policies_t; top_policy : policy_t)
    return string is
  begin
    if sizes'length = 0 or sizes'length /= policies'length then
      return "SIZES has " & integer'image(sizes'length) & " groups and POLICIES " & integer'image(policies'length) &
        "; legal: 1 or more, as many in both";
    elsif has_deadlines(top_policy) then
      return "TOP_POLICY is " & policy_t'image(top_policy) & "; legal: a policy without deadlines";
    end if;
    for place in natural range 0 to sizes'length-1 loop
      if time_of(place, sizes) < 1 or time_of(place, sizes) > MAX_REQUESTERS then
        return "the size of group " & integer'image(place) & " is " & integer'image(time_of(place, sizes)) &
          "; legal: 1 to " & integer'image(MAX_REQUESTERS);
      end if;
    end loop;
    if sum_of(sizes, sizes'length) /= requesters then
      return "the sizes of the groups add up to " & integer'image(sum_of(sizes, sizes'length)) & "; legal: " &
        integer'image(requesters) & ", the number of requesters";
    end if;
    return "";
  end function fault_of_groups;

  function fault_of_group_times(requesters : integer; policies : policies_t;
    periods, transfer_times, deadlines : times_t; time_bits, shortest_run : integer)
    return string is
    variable any_deadlines : boolean := false;
    variable any_transfer  : boolean := false;
  begin
    for place in policies'range loop
      any_deadlines := any_deadlines or has_deadlines(policies(place));
      any_transfer  := any_transfer or has_transfer_times(policies(place));
    end loop;
    if any_deadlines and fault_of_deadlines(requesters, periods, deadlines, time_bits, shortest_run) /= "" then
      return fault_of_deadlines(requesters, periods, deadlines, time_bits, shortest_run);
    elsif any_transfer then
      return fault_of_transfer(transfer_times, requesters, time_bits);
    end if;
    return "";
  end function fault_of_group_times;

end package body firm_sched_pkg;
