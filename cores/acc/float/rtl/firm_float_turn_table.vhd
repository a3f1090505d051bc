-- SPDX-License-Identifier: Apache-2.0
-- Constants of sine and cosine: the quarter turns in a rad, the angles of rotations, and the gains of rotations.
--
-- ieee.math_real has 53 bits, too few for float64 with guard bits, and does not synthesise everywhere. The constants
-- are therefore literals of 96 bits, rounded to nearest; tests/cores/test_sincos.py recomputes them.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_float_turn_table is

  constant TURN_TABLE_FRACTION : positive := 96;
  constant TURN_TABLE_LAST     : positive := 31;
  -- Digits of 2/pi after the point, to the base 4.
  constant PI_DIGITS           : positive := 576;

  subtype pi_digit_t is std_logic_vector(1 downto 0);
  -- The digit k, from 1, has the weight 4**-k. "11" is -1.
  type pi_digits_t is array (natural range PI_DIGITS downto 0) of pi_digit_t;

  -- 2/pi, truncated, in digits from -1 to 2.
  function two_over_pi return pi_digits_t;

  -- 2**index * atan(2**-index) in quarter turns, from 1 to 31; fraction < 96.
  function quarter_turns(index : positive; fraction : positive) return unsigned;

  -- The product of 1/sqrt(1 + 4**-i) over all i >= index, less than 1; the index is odd, from 1 to 31; fraction < 96.
  function inverse_gain_from(index : positive; fraction : positive) return unsigned;

  -- pi/2 times this product, less 1, with 96 fraction bits.
  function rad_of_quarter_turns(index : positive) return unsigned;

end package firm_float_turn_table;

package body firm_float_turn_table is

  subtype word_t is unsigned(TURN_TABLE_FRACTION-1 downto 0);
  type turns_t is array (1 to TURN_TABLE_LAST) of word_t;
  type gains_t is array (0 to TURN_TABLE_LAST/2) of word_t;
  type words_t is array (0 to 2*PI_DIGITS/TURN_TABLE_FRACTION-1) of word_t;

  constant TURNS : turns_t := (
    x"972028ecef984332b447b6d7",
    x"9fb385b5ee39e8ddf43f3ca1",
    x"a2223a83bbb3436ff24ab964",
    x"a2c350c39626bb303300048a",
    x"a2ebf0ac82313c2b4e4a6f41",
    x"a2f61e5c28262984d6bf58b5",
    x"a2f8aa23a8855d45860d95bd",
    x"a2f94d1b430cdbf245e9bac8",
    x"a2f975d98559bdc9a0f96a1c",
    x"a2f980091ba7b67f43a92212",
    x"a2f982950196e0f11e0072ed",
    x"a2f98337fb186652dd8577aa",
    x"a2f98360b9792357a5fcfe92",
    x"a2f9836ae91158539db461f4",
    x"a2f9836d74f765ee47fc135c",
    x"a2f9836e17f0e95aad539e40",
    x"a2f9836e40af4a362255dae6",
    x"a2f9836e4adee26d05512faf",
    x"a2f9836e4d6ac87abe6bb13b",
    x"a2f9836e4e0dc1fe2cb80c63",
    x"a2f9836e4e36805f084b7eda",
    x"a2f9836e4e40aff73f306132",
    x"a2f9836e4e433bdd4ce99a24",
    x"a2f9836e4e43ded6d057e866",
    x"a2f9836e4e44079531337bf7",
    x"a2f9836e4e4411c4c96a60db",
    x"a2f9836e4e441450af781a14",
    x"a2f9836e4e4414f3a8fb8863",
    x"a2f9836e4e44151c675c63f6",
    x"a2f9836e4e44152696f49adb",
    x"a2f9836e4e44152922daa894"
  );

  constant INVERSE_GAINS : gains_t := (
    x"dbd95b1677c136eb661deb79",
    x"fd5d0ec8e182199763d5d0fd",
    x"ffd55d263cd78cfb959e44d5",
    x"fffd555d27b91db0577280c5",
    x"ffffd5555d27d0e72b3bdbfa",
    x"fffffd55555d27d263c803f4",
    x"ffffffd555555d27d27b91d6",
    x"fffffffd5555555d27d27d0e",
    x"ffffffffd55555555d27d27d",
    x"fffffffffd555555555d27d2",
    x"ffffffffffd5555555555d28",
    x"fffffffffffd55555555555d",
    x"ffffffffffffd55555555555",
    x"fffffffffffffd5555555555",
    x"ffffffffffffffd555555555",
    x"fffffffffffffffd55555555"
  );

  constant RADS : gains_t := (
    x"59568c069c4af4ec95791bdb",
    x"8dfb82e296bee99301d21836",
    x"91dcbc42657b0432174100bd",
    x"921b84fbfe1edc1ace987f86",
    x"921f723f063a4cadd359ae3a",
    x"921fb113ee4fc28d17e8e0db",
    x"921fb5013d88affd3c83ce93",
    x"921fb540127cf66a7633f36f",
    x"921fb543ffcc3b88e008af95",
    x"921fb5443ea12fdb7e3c3536",
    x"921fb544428e7f20a8d703ca",
    x"921fb54442cd5414fb81684a",
    x"921fb54442d1416440ac0f49",
    x"921fb54442d1803934feb9ba",
    x"921fb54442d184268443e461",
    x"921fb54442d184655938370c"
  );

  -- One word after the other, from the point.
  constant TWO_OVER_PI_WORDS : words_t := (
    x"a2f9836e4e441529fc2757d1",
    x"f534ddc0db6295993c439041",
    x"fe5163abdebbc561b7246e3a",
    x"424dd2e006492eea09d1921c",
    x"fe1deb1cb129a73ee88235f5",
    x"2ebb4484e99c7026b45f7e41",
    x"3991d639835339f49c845f8b",
    x"bdf9283b1ff897ffde05980f",
    x"ef2f118b5a0a6d1f6d367ecf",
    x"27cb09b74f463f669e5fea2d",
    x"7527bac7ebe5f17b3d0739f7",
    x"8a5292ea6bfb5fb11f8d5d08"
  );

  function rounded(word : word_t; fraction : positive) return unsigned is
    variable result : unsigned(fraction-1 downto 0);
  begin
    result := word(TURN_TABLE_FRACTION-1 downto TURN_TABLE_FRACTION-fraction);
    if word(TURN_TABLE_FRACTION-fraction-1) = '1' then
      result := result + 1;
    end if;
    return result;
  end function rounded;

  function two_over_pi return pi_digits_t is
    variable result : pi_digits_t := (others => "00");
    variable word   : word_t;
    variable place  : natural;
    variable digit  : unsigned(1 downto 0);
    -- From the digit below, if it is -1.
    variable carry  : unsigned(1 downto 0);
  begin
    carry := "00";
    for k in PI_DIGITS downto 1 loop
      word  := TWO_OVER_PI_WORDS(2*(k-1) / TURN_TABLE_FRACTION);
      place := TURN_TABLE_FRACTION - 2 - 2*(k-1) mod TURN_TABLE_FRACTION;
      digit := word(place+1 downto place) + carry;
      -- 3, or 4, whose digit is 0 after the carry.
      if word(place+1 downto place) = "11" or digit = "11" then
        carry := "01";
      else
        carry := "00";
      end if;
      result(k) := std_logic_vector(digit);
    end loop;
    return result;
  end function two_over_pi;

  function quarter_turns(index : positive; fraction : positive) return unsigned is
  begin
    return rounded(TURNS(index), fraction);
  end function quarter_turns;

  function inverse_gain_from(index : positive; fraction : positive) return unsigned is
  begin
    return rounded(INVERSE_GAINS(index / 2), fraction);
  end function inverse_gain_from;

  function rad_of_quarter_turns(index : positive) return unsigned is
  begin
    return RADS(index / 2);
  end function rad_of_quarter_turns;

end package body firm_float_turn_table;
