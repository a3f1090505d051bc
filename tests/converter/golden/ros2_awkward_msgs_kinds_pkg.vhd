-- awkward_msgs_kinds_pkg: the signature and the constants of
-- awkward_msgs/Kinds (ROS 2).
--
-- A constant has the bits that a field has at a converter's port; the comment gives its type, name and value in ROS.
-- A message's name precedes the constants of a nested message.
--
-- A text is a string of UTF-8, one byte in each character; its length and bytes, the first lowest, are as in a field.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;

package awkward_msgs_kinds_pkg is

  -- The signature, by which the two ends of a topic check that they use the same message.
  constant SIGNATURE : string(1 to 71) := "RIHS01_9587b6f6d66b3faab2d996fe09f5325375bf6929b77180471678b5471d4946e0";

  constant IN_VALUE  : std_logic_vector(7 downto 0)  := x"01";               -- uint8 IN=1
  constant YES       : std_logic                     := '1';                 -- bool YES=true
  constant WIDE      : std_logic_vector(63 downto 0) := x"0000000100000000"; -- uint64 WIDE=4294967296
  constant HALF      : std_logic_vector(31 downto 0) := x"3f000000";         -- float32 HALF=0.5
  constant INNER_LOW : std_logic_vector(7 downto 0)  := x"ff";               -- int8 awkward_msgs/Inner.LOW=-1

  -- string NAME
  constant NAME        : string(1 to 5) :=
    "a" & character'val(9) & character'val(226) & character'val(130) & character'val(172);
  constant NAME_LENGTH : std_logic_vector(31 downto 0) := x"00000005";
  constant NAME_BYTES  : std_logic_vector(39 downto 0) := x"ac82e20961";

  -- wstring EMPTY
  constant EMPTY        : string(1 to 0) := "";
  constant EMPTY_LENGTH : std_logic_vector(31 downto 0) := x"00000000";

end package;
