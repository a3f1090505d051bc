-- SPDX-License-Identifier: Apache-2.0
-- Forwards a geometry_msgs/TwistStamped unchanged. Nothing is stored: each field and beat leaves in the cycle in which
-- it arrives. ROS 1 has seq and nsec, ROS 2 has nanosec: a system connects those of its message.
library ieee;
use ieee.std_logic_1164.all;

entity pass_twist is
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
    in_twist_linear_x              : in  std_logic_vector(63 downto 0);
    in_twist_linear_y              : in  std_logic_vector(63 downto 0);
    in_twist_linear_z              : in  std_logic_vector(63 downto 0);
    in_twist_angular_x             : in  std_logic_vector(63 downto 0);
    in_twist_angular_y             : in  std_logic_vector(63 downto 0);
    in_twist_angular_z             : in  std_logic_vector(63 downto 0);
    in_segment_valid               : in  std_logic_vector(1 downto 0);
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
    out_twist_linear_x              : out std_logic_vector(63 downto 0);
    out_twist_linear_y              : out std_logic_vector(63 downto 0);
    out_twist_linear_z              : out std_logic_vector(63 downto 0);
    out_twist_angular_x             : out std_logic_vector(63 downto 0);
    out_twist_angular_y             : out std_logic_vector(63 downto 0);
    out_twist_angular_z             : out std_logic_vector(63 downto 0);
    out_segment_valid               : out std_logic_vector(1 downto 0);
    out_msg_valid                   : out std_logic;
    out_msg_ready                   : in  std_logic
  );
end entity pass_twist;

architecture rtl of pass_twist is
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
  out_twist_linear_x              <= in_twist_linear_x;
  out_twist_linear_y              <= in_twist_linear_y;
  out_twist_linear_z              <= in_twist_linear_z;
  out_twist_angular_x             <= in_twist_angular_x;
  out_twist_angular_y             <= in_twist_angular_y;
  out_twist_angular_z             <= in_twist_angular_z;
  out_segment_valid               <= in_segment_valid;
  out_msg_valid                   <= in_msg_valid;
  in_msg_ready                    <= out_msg_ready;

end architecture rtl;
