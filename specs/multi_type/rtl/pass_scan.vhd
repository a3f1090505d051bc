-- SPDX-License-Identifier: Apache-2.0
-- Forwards a sensor_msgs/LaserScan unchanged. Nothing is stored: each field and beat leaves in the cycle in which it
-- arrives. ROS 1 has seq and nsec, ROS 2 has nanosec: a system connects those of its message.
library ieee;
use ieee.std_logic_1164.all;

entity pass_scan is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    in_payload_length              : in  std_logic_vector(31 downto 0);
    in_header_seq                  : in  std_logic_vector(31 downto 0) := (others => '0');
    in_header_stamp_sec            : in  std_logic_vector(31 downto 0);
    in_header_stamp_nsec           : in  std_logic_vector(31 downto 0) := (others => '0');
    in_header_stamp_nanosec        : in  std_logic_vector(31 downto 0) := (others => '0');
    in_header_frame_id_length      : in  std_logic_vector(31 downto 0);
    in_header_frame_id_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    in_header_frame_id_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_header_frame_id_axis_tvalid : in  std_logic;
    in_header_frame_id_axis_tlast  : in  std_logic;
    in_header_frame_id_axis_tready : out std_logic;
    in_angle_min                   : in  std_logic_vector(31 downto 0);
    in_angle_max                   : in  std_logic_vector(31 downto 0);
    in_angle_increment             : in  std_logic_vector(31 downto 0);
    in_time_increment              : in  std_logic_vector(31 downto 0);
    in_scan_time                   : in  std_logic_vector(31 downto 0);
    in_range_min                   : in  std_logic_vector(31 downto 0);
    in_range_max                   : in  std_logic_vector(31 downto 0);
    in_ranges_length               : in  std_logic_vector(31 downto 0);
    in_ranges_axis_tdata           : in  std_logic_vector(WIDTH-1 downto 0);
    in_ranges_axis_tkeep           : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_ranges_axis_tvalid          : in  std_logic;
    in_ranges_axis_tlast           : in  std_logic;
    in_ranges_axis_tready          : out std_logic;
    in_intensities_length          : in  std_logic_vector(31 downto 0);
    in_intensities_axis_tdata      : in  std_logic_vector(WIDTH-1 downto 0);
    in_intensities_axis_tkeep      : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_intensities_axis_tvalid     : in  std_logic;
    in_intensities_axis_tlast      : in  std_logic;
    in_intensities_axis_tready     : out std_logic;
    in_segment_valid               : in  std_logic_vector(2 downto 0);
    in_msg_valid                   : in  std_logic;
    in_msg_ready                   : out std_logic;

    out_payload_length              : out std_logic_vector(31 downto 0);
    out_header_seq                  : out std_logic_vector(31 downto 0);
    out_header_stamp_sec            : out std_logic_vector(31 downto 0);
    out_header_stamp_nsec           : out std_logic_vector(31 downto 0);
    out_header_stamp_nanosec        : out std_logic_vector(31 downto 0);
    out_header_frame_id_length      : out std_logic_vector(31 downto 0);
    out_header_frame_id_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    out_header_frame_id_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    out_header_frame_id_axis_tvalid : out std_logic;
    out_header_frame_id_axis_tlast  : out std_logic;
    out_header_frame_id_axis_tready : in  std_logic;
    out_angle_min                   : out std_logic_vector(31 downto 0);
    out_angle_max                   : out std_logic_vector(31 downto 0);
    out_angle_increment             : out std_logic_vector(31 downto 0);
    out_time_increment              : out std_logic_vector(31 downto 0);
    out_scan_time                   : out std_logic_vector(31 downto 0);
    out_range_min                   : out std_logic_vector(31 downto 0);
    out_range_max                   : out std_logic_vector(31 downto 0);
    out_ranges_length               : out std_logic_vector(31 downto 0);
    out_ranges_axis_tdata           : out std_logic_vector(WIDTH-1 downto 0);
    out_ranges_axis_tkeep           : out std_logic_vector(WIDTH/8-1 downto 0);
    out_ranges_axis_tvalid          : out std_logic;
    out_ranges_axis_tlast           : out std_logic;
    out_ranges_axis_tready          : in  std_logic;
    out_intensities_length          : out std_logic_vector(31 downto 0);
    out_intensities_axis_tdata      : out std_logic_vector(WIDTH-1 downto 0);
    out_intensities_axis_tkeep      : out std_logic_vector(WIDTH/8-1 downto 0);
    out_intensities_axis_tvalid     : out std_logic;
    out_intensities_axis_tlast      : out std_logic;
    out_intensities_axis_tready     : in  std_logic;
    out_segment_valid               : out std_logic_vector(2 downto 0);
    out_msg_valid                   : out std_logic;
    out_msg_ready                   : in  std_logic
  );
end entity pass_scan;

architecture rtl of pass_scan is
begin

  out_payload_length              <= in_payload_length;
  out_header_seq                  <= in_header_seq;
  out_header_stamp_sec            <= in_header_stamp_sec;
  out_header_stamp_nsec           <= in_header_stamp_nsec;
  out_header_stamp_nanosec        <= in_header_stamp_nanosec;
  out_header_frame_id_length      <= in_header_frame_id_length;
  out_header_frame_id_axis_tdata  <= in_header_frame_id_axis_tdata;
  out_header_frame_id_axis_tkeep  <= in_header_frame_id_axis_tkeep;
  out_header_frame_id_axis_tvalid <= in_header_frame_id_axis_tvalid;
  out_header_frame_id_axis_tlast  <= in_header_frame_id_axis_tlast;
  in_header_frame_id_axis_tready  <= out_header_frame_id_axis_tready;
  out_angle_min                   <= in_angle_min;
  out_angle_max                   <= in_angle_max;
  out_angle_increment             <= in_angle_increment;
  out_time_increment              <= in_time_increment;
  out_scan_time                   <= in_scan_time;
  out_range_min                   <= in_range_min;
  out_range_max                   <= in_range_max;
  out_ranges_length               <= in_ranges_length;
  out_ranges_axis_tdata           <= in_ranges_axis_tdata;
  out_ranges_axis_tkeep           <= in_ranges_axis_tkeep;
  out_ranges_axis_tvalid          <= in_ranges_axis_tvalid;
  out_ranges_axis_tlast           <= in_ranges_axis_tlast;
  in_ranges_axis_tready           <= out_ranges_axis_tready;
  out_intensities_length          <= in_intensities_length;
  out_intensities_axis_tdata      <= in_intensities_axis_tdata;
  out_intensities_axis_tkeep      <= in_intensities_axis_tkeep;
  out_intensities_axis_tvalid     <= in_intensities_axis_tvalid;
  out_intensities_axis_tlast      <= in_intensities_axis_tlast;
  in_intensities_axis_tready      <= out_intensities_axis_tready;
  out_segment_valid               <= in_segment_valid;
  out_msg_valid                   <= in_msg_valid;
  in_msg_ready                    <= out_msg_ready;

end architecture rtl;
