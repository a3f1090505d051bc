-- SPDX-License-Identifier: Apache-2.0
-- Reports whether an obstacle is nearer than NEAR, or too near to be measured, which is minus infinity (REP 117).
-- Other distances below the sensor's range and NaN are ignored.
-- Non-negative floats have the order of their bits, so nothing is calculated.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity obstacle is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- sensor_msgs/Range
    in_payload_length : in  std_logic_vector(31 downto 0);
    in_min_range      : in  std_logic_vector(31 downto 0);
    in_range_field    : in  std_logic_vector(31 downto 0);
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;

    -- std_msgs/Bool
    out_data          : out std_logic;
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity obstacle;

architecture rtl of obstacle is

  subtype magnitude_t is unsigned(30 downto 0);
  constant NEAR     : magnitude_t := "011" & x"f000000";  -- 0.5 m
  constant INFINITE : magnitude_t := "111" & x"f800000";
  constant ZERO     : magnitude_t := (others => '0');

  signal distance : magnitude_t;
  signal least    : magnitude_t;  -- the shortest valid distance
  signal is_below : std_logic;    -- the distance is negative

begin

  distance <= unsigned(in_range_field(30 downto 0));
  is_below <= '1' when in_range_field(31) = '1' and distance /= ZERO else '0';
  -- A negative bound is ignored; with NaN as the bound, all distances are.
  least    <= ZERO when in_min_range(31) = '1' and unsigned(in_min_range(30 downto 0)) <= INFINITE else
              unsigned(in_min_range(30 downto 0));

  out_data <= '1' when (is_below = '1' and distance = INFINITE)
                       or (is_below = '0' and distance >= least and distance < NEAR) else
              '0';

  out_segment_valid(0) <= in_msg_valid;
  in_msg_ready         <= out_msg_ready;

end architecture rtl;
