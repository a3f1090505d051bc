-- diagnostic_msgs_diagnosticstatus_pkg: the signature and the constants of
-- diagnostic_msgs/DiagnosticStatus (ROS 1).
--
-- A constant has the bits that a field has at a converter's port; the comment gives its type, name and value in ROS.
-- A message's name precedes the constants of a nested message.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;

package diagnostic_msgs_diagnosticstatus_pkg is

  -- The signature, by which the two ends of a topic check that they use the same message.
  constant SIGNATURE : string(1 to 32) := "d0ce08bc6e5ba34c7754f563a9cabaf1";

  constant OK          : std_logic_vector(7 downto 0) := x"00"; -- byte OK=0
  constant WARN        : std_logic_vector(7 downto 0) := x"01"; -- byte WARN=1
  constant ERROR_VALUE : std_logic_vector(7 downto 0) := x"02"; -- byte ERROR=2
  constant STALE       : std_logic_vector(7 downto 0) := x"03"; -- byte STALE=3

end package;
