-- sensor_msgs_pointcloud2_pkg: the signature and the constants of
-- sensor_msgs/PointCloud2 (ROS 1).
--
-- A constant has the bits that a field has at a converter's port; the comment gives its type, name and value in ROS.
-- A message's name precedes the constants of a nested message.
--
-- Generated from the message's definition by robot:firm; changes belong there.
library ieee;
use ieee.std_logic_1164.all;

package sensor_msgs_pointcloud2_pkg is

  -- The signature, by which the two ends of a topic check that they use the same message.
  constant SIGNATURE : string(1 to 32) := "1158d486dd51d683ce2f1be655c3c181";

  constant POINTFIELD_INT8    : std_logic_vector(7 downto 0) := x"01"; -- uint8 sensor_msgs/PointField.INT8=1
  constant POINTFIELD_UINT8   : std_logic_vector(7 downto 0) := x"02"; -- uint8 sensor_msgs/PointField.UINT8=2
  constant POINTFIELD_INT16   : std_logic_vector(7 downto 0) := x"03"; -- uint8 sensor_msgs/PointField.INT16=3
  constant POINTFIELD_UINT16  : std_logic_vector(7 downto 0) := x"04"; -- uint8 sensor_msgs/PointField.UINT16=4
  constant POINTFIELD_INT32   : std_logic_vector(7 downto 0) := x"05"; -- uint8 sensor_msgs/PointField.INT32=5
  constant POINTFIELD_UINT32  : std_logic_vector(7 downto 0) := x"06"; -- uint8 sensor_msgs/PointField.UINT32=6
  constant POINTFIELD_FLOAT32 : std_logic_vector(7 downto 0) := x"07"; -- uint8 sensor_msgs/PointField.FLOAT32=7
  constant POINTFIELD_FLOAT64 : std_logic_vector(7 downto 0) := x"08"; -- uint8 sensor_msgs/PointField.FLOAT64=8

end package;
