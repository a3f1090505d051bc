-- SPDX-License-Identifier: Apache-2.0
-- Common functions of the stream cores: sizes, and two functions of an index that synthesis maps badly if they are
-- written as a dynamic array access. They are plain logic on std_logic, so an unknown bit gives an unknown result and
-- no warning. To select with an index, see firm_axis_select. Sizes may be illegal numbers, since an entity's own
-- assert, which runs only after elaboration, must report them.
library ieee;
use ieee.std_logic_1164.all;

package firm_axis_pkg is

  -- What synthesis reads of a memory whose reads never meet a write of their address, or do not matter then. With the
  -- values "no_rw_check" and "no" it adds no logic for such a cycle. tools/proofs shows for each memory that it may.
  attribute syn_ramstyle      : string;  -- Quartus, Synplify, Lattice's LSE and Yosys
  attribute rw_addr_collision : string;  -- Vivado (UG901)

  function max(left, right : integer) return integer;

  -- The number of bits to distinguish `values` items: 0 for 1, 1 for 2, 8 for 256.
  function clog2(values : integer) return natural;

  -- The number of bits of an index of `values` items. A port cannot be empty, so it is 1 for a single item.
  function index_bits(values : integer) return positive;

  function is_stream_width(width : integer) return boolean;

  -- '1' if `index`, read as an unsigned number, is less than `bound`.
  function is_below(index : std_logic_vector; bound : natural) return std_logic;

  -- '1' if `index` is `value`.
  function is_equal(index : std_logic_vector; value : natural) return std_logic;

  -- '1' if `index` is in the range `first` to `last`.
  function is_within(index : std_logic_vector; first, last : natural) return std_logic;

  -- `word` if `enable` is '1', else zeros. ORs of such words select one of them in parallel.
  function gated(word : std_logic_vector; enable : std_logic) return std_logic_vector;

  -- `left` minus `right`, of equal lengths, modulo 2**length. As LUTs, since Yosys makes a carry chain of `-`, which is
  -- slower at few bits.
  function difference(left, right : std_logic_vector) return std_logic_vector;

  -- '1' if all bits are. A comparison with a constant would be limited to 32 bits, and give a warning for unknown bits.
  function are_ones(bits : std_logic_vector) return std_logic;

  -- The number of ones in a contiguous `keep` of a stream, which has 1 to 64 bits.
  function lanes_kept(keep : std_logic_vector) return std_logic_vector;

  -- '1' if a beat breaks the rules of frames: it has a gap or no bytes, or it is neither full nor the last one.
  function is_broken_beat(keep : std_logic_vector; last : std_logic) return std_logic;

  -- Bit k is '1' if `index` is k and `enable` is '1'. The index is decoded in two halves, so that each output costs one
  -- AND.
  function decode(index : std_logic_vector; enable : std_logic; outputs : natural) return std_logic_vector;

end package firm_axis_pkg;

package body firm_axis_pkg is

  function max(left, right : integer) return integer is
  begin
    if left > right then
      return left;
    end if;
    return right;
  end function max;

  function clog2(values : integer) return natural is
    variable bits     : natural := 0;
    variable capacity : positive := 1;
  begin
    while capacity < values loop
      bits     := bits + 1;
      capacity := 2 * capacity;
    end loop;
    return bits;
  end function clog2;

  function index_bits(values : integer) return positive is
  begin
    return max(1, clog2(values));
  end function index_bits;

  function is_stream_width(width : integer) return boolean is
  begin
    return width = 8 or width = 16 or width = 32 or width = 64 or width = 128 or width = 256 or width = 512;
  end function is_stream_width;

  function is_below(index : std_logic_vector; bound : natural) return std_logic is
    variable bits  : std_logic_vector(index'length-1 downto 0);
    variable less  : std_logic := '0';
    variable equal : std_logic := '1';
  begin
    if bound >= 2**index'length then
      return '1';
    end if;
    bits := index;
    for place in bits'range loop
      if (bound / 2**place) mod 2 = 1 then
        less  := less or (equal and not bits(place));
        equal := equal and bits(place);
      else
        equal := equal and not bits(place);
      end if;
    end loop;
    return less;
  end function is_below;

  -- Found bit by bit from the highest.
  function lanes_kept(keep : std_logic_vector) return std_logic_vector is
    constant LANES      : positive := keep'length;
    constant COUNT_BITS : positive := clog2(LANES+1);
    variable part       : std_logic_vector(LANES-1 downto 0);
    variable count      : std_logic_vector(COUNT_BITS-1 downto 0) := (others => '0');
  begin
    part := keep;
    if part(LANES-1) = '1' then
      count(COUNT_BITS-1) := '1';
      return count;
    end if;
    for place in COUNT_BITS-2 downto 0 loop
      if part(2**place-1) = '1' then
        count(place)              := '1';
        part(2**place-1 downto 0) := part(2**(place+1)-1 downto 2**place);
      end if;
    end loop;
    return count;
  end function lanes_kept;

  function is_broken_beat(keep : std_logic_vector; last : std_logic) return std_logic is
    variable lanes   : std_logic_vector(keep'length-1 downto 0);
    variable has_gap : std_logic := '0';
  begin
    lanes := keep;
    for lane in 1 to lanes'high loop
      has_gap := has_gap or (lanes(lane) and not lanes(lane-1));
    end loop;
    return has_gap or not lanes(0) or (not lanes(lanes'high) and not last);
  end function is_broken_beat;

  function is_equal(index : std_logic_vector; value : natural) return std_logic is
    variable bits  : std_logic_vector(index'length-1 downto 0);
    variable equal : std_logic := '1';
  begin
    bits := index;
    for place in bits'range loop
      if (value / 2**place) mod 2 = 1 then
        equal := equal and bits(place);
      else
        equal := equal and not bits(place);
      end if;
    end loop;
    return equal;
  end function is_equal;

  function is_within(index : std_logic_vector; first, last : natural) return std_logic is
  begin
    return is_below(index, last+1) and not is_below(index, first);
  end function is_within;

  function gated(word : std_logic_vector; enable : std_logic) return std_logic_vector is
    variable result : std_logic_vector(word'length-1 downto 0);
  begin
    result := word;
    for place in result'range loop
      result(place) := result(place) and enable;
    end loop;
    return result;
  end function gated;

  function difference(left, right : std_logic_vector) return std_logic_vector is
    variable minuend    : std_logic_vector(left'length-1 downto 0);
    variable subtrahend : std_logic_vector(left'length-1 downto 0);
    variable result     : std_logic_vector(left'length-1 downto 0);
    variable borrow     : std_logic := '0';
  begin
    minuend    := left;
    subtrahend := right;
    for place in result'reverse_range loop
      result(place) := minuend(place) xor subtrahend(place) xor borrow;
      borrow        := (not minuend(place) and (subtrahend(place) or borrow)) or (subtrahend(place) and borrow);
    end loop;
    return result;
  end function difference;

  function are_ones(bits : std_logic_vector) return std_logic is
    variable all_are : std_logic := '1';
  begin
    for place in bits'range loop
      all_are := all_are and bits(place);
    end loop;
    return all_are;
  end function are_ones;

  function decode(index : std_logic_vector; enable : std_logic; outputs : natural) return std_logic_vector is
    constant LOW_BITS  : natural := index'length / 2;
    constant HIGH_BITS : positive := index'length - LOW_BITS;
    variable bits      : std_logic_vector(index'length-1 downto 0);
    variable column    : std_logic_vector(2**LOW_BITS-1 downto 0);
    variable row       : std_logic_vector(2**HIGH_BITS-1 downto 0);
    variable decoded   : std_logic_vector(outputs-1 downto 0);
  begin
    bits   := index;
    column := (others => '1');
    if LOW_BITS > 0 then
      for value in column'range loop
        column(value) := is_equal(bits(LOW_BITS-1 downto 0), value);
      end loop;
    end if;
    for value in row'range loop
      row(value) := enable and is_equal(bits(index'length-1 downto LOW_BITS), value);
    end loop;
    for value in decoded'range loop
      decoded(value) := row(value / 2**LOW_BITS) and column(value mod 2**LOW_BITS);
    end loop;
    return decoded;
  end function decode;

end package body firm_axis_pkg;
