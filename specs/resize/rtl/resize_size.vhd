-- SPDX-License-Identifier: Apache-2.0
-- Doubles the image size in a sensor_msgs/CameraInfo. It is combinational, since it only shifts.
library ieee;
use ieee.std_logic_1164.all;

entity resize_size is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    in_height        : in  std_logic_vector(31 downto 0);
    in_width         : in  std_logic_vector(31 downto 0);
    in_segment_valid : in  std_logic_vector(0 downto 0);
    in_msg_valid     : in  std_logic;
    in_msg_ready     : out std_logic;

    out_height        : out std_logic_vector(31 downto 0);
    out_width         : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity resize_size;

architecture rtl of resize_size is
begin

  out_height <= in_height(30 downto 0) & '0';
  out_width  <= in_width(30 downto 0) & '0';

  out_segment_valid <= (others => in_msg_valid);
  in_msg_ready      <= in_msg_valid and out_msg_ready;

end architecture rtl;
