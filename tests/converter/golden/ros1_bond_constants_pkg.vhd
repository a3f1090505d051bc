-- bond_constants_pkg: the signature and the constants of
-- bond/Constants (ROS 1).
--
-- A constant has the bits that a field has at a converter's port; the comment gives its type, name and value in ROS.
-- A message's name precedes the constants of a nested message.
--
-- A text is a string of UTF-8, one byte in each character; its length and bytes, the first lowest, are as in a field.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;

package bond_constants_pkg is

  -- The signature, by which the two ends of a topic check that they use the same message.
  constant SIGNATURE : string(1 to 32) := "6fc594dc1d7bd7919077042712f8c8b0";

  -- float32 DEAD_PUBLISH_PERIOD=0.05
  constant DEAD_PUBLISH_PERIOD        : std_logic_vector(31 downto 0) := x"3d4ccccd";
  -- float32 DEFAULT_CONNECT_TIMEOUT=10.0
  constant DEFAULT_CONNECT_TIMEOUT    : std_logic_vector(31 downto 0) := x"41200000";
  -- float32 DEFAULT_HEARTBEAT_TIMEOUT=4.0
  constant DEFAULT_HEARTBEAT_TIMEOUT  : std_logic_vector(31 downto 0) := x"40800000";
  -- float32 DEFAULT_DISCONNECT_TIMEOUT=2.0
  constant DEFAULT_DISCONNECT_TIMEOUT : std_logic_vector(31 downto 0) := x"40000000";
  -- float32 DEFAULT_HEARTBEAT_PERIOD=1.0
  constant DEFAULT_HEARTBEAT_PERIOD   : std_logic_vector(31 downto 0) := x"3f800000";

  -- string DISABLE_HEARTBEAT_TIMEOUT_PARAM
  constant DISABLE_HEARTBEAT_TIMEOUT_PARAM        : string(1 to 31) := "/bond_disable_heartbeat_timeout";
  constant DISABLE_HEARTBEAT_TIMEOUT_PARAM_LENGTH : std_logic_vector(31 downto 0) := x"0000001f";
  constant DISABLE_HEARTBEAT_TIMEOUT_PARAM_BYTES  : std_logic_vector(247 downto 0) :=
    x"74756f656d69745f7461656274726165685f656c62617369645f646e6f622f";

end package;
