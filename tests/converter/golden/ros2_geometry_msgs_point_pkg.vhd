-- geometry_msgs_point_pkg: the signature and the constants of
-- geometry_msgs/Point (ROS 2).
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;

package geometry_msgs_point_pkg is

  -- The signature, by which the two ends of a topic check that they use the same message.
  constant SIGNATURE : string(1 to 71) := "RIHS01_6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881";

end package;
