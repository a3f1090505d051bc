-- SPDX-License-Identifier: Apache-2.0
-- Forwards a sensor_msgs/Image unchanged. Nothing is stored: each field and beat leaves in the cycle in which it
-- arrives. ROS 1 has seq and nsec, ROS 2 has nanosec: a system connects those of its message.
library ieee;
use ieee.std_logic_1164.all;

entity pass_image is
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
    in_height                      : in  std_logic_vector(31 downto 0);
    in_width                       : in  std_logic_vector(31 downto 0);
    in_encoding_length             : in  std_logic_vector(31 downto 0);
    in_encoding_axis_tdata         : in  std_logic_vector(WIDTH-1 downto 0);
    in_encoding_axis_tkeep         : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_encoding_axis_tvalid        : in  std_logic;
    in_encoding_axis_tlast         : in  std_logic;
    in_encoding_axis_tready        : out std_logic;
    in_is_bigendian                : in  std_logic_vector(7 downto 0);
    in_step                        : in  std_logic_vector(31 downto 0);
    in_data_length                 : in  std_logic_vector(31 downto 0);
    in_data_axis_tdata             : in  std_logic_vector(WIDTH-1 downto 0);
    in_data_axis_tkeep             : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_data_axis_tvalid            : in  std_logic;
    in_data_axis_tlast             : in  std_logic;
    in_data_axis_tready            : out std_logic;
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
    out_height                      : out std_logic_vector(31 downto 0);
    out_width                       : out std_logic_vector(31 downto 0);
    out_encoding_length             : out std_logic_vector(31 downto 0);
    out_encoding_axis_tdata         : out std_logic_vector(WIDTH-1 downto 0);
    out_encoding_axis_tkeep         : out std_logic_vector(WIDTH/8-1 downto 0);
    out_encoding_axis_tvalid        : out std_logic;
    out_encoding_axis_tlast         : out std_logic;
    out_encoding_axis_tready        : in  std_logic;
    out_is_bigendian                : out std_logic_vector(7 downto 0);
    out_step                        : out std_logic_vector(31 downto 0);
    out_data_length                 : out std_logic_vector(31 downto 0);
    out_data_axis_tdata             : out std_logic_vector(WIDTH-1 downto 0);
    out_data_axis_tkeep             : out std_logic_vector(WIDTH/8-1 downto 0);
    out_data_axis_tvalid            : out std_logic;
    out_data_axis_tlast             : out std_logic;
    out_data_axis_tready            : in  std_logic;
    out_segment_valid               : out std_logic_vector(2 downto 0);
    out_msg_valid                   : out std_logic;
    out_msg_ready                   : in  std_logic
  );
end entity pass_image;

architecture rtl of pass_image is
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
  out_height                      <= in_height;
  out_width                       <= in_width;
  out_encoding_length             <= in_encoding_length;
  out_encoding_axis_tdata         <= in_encoding_axis_tdata;
  out_encoding_axis_tkeep         <= in_encoding_axis_tkeep;
  out_encoding_axis_tvalid        <= in_encoding_axis_tvalid;
  out_encoding_axis_tlast         <= in_encoding_axis_tlast;
  in_encoding_axis_tready         <= out_encoding_axis_tready;
  out_is_bigendian                <= in_is_bigendian;
  out_step                        <= in_step;
  out_data_length                 <= in_data_length;
  out_data_axis_tdata             <= in_data_axis_tdata;
  out_data_axis_tkeep             <= in_data_axis_tkeep;
  out_data_axis_tvalid            <= in_data_axis_tvalid;
  out_data_axis_tlast             <= in_data_axis_tlast;
  in_data_axis_tready             <= out_data_axis_tready;
  out_segment_valid               <= in_segment_valid;
  out_msg_valid                   <= in_msg_valid;
  in_msg_ready                    <= out_msg_ready;

end architecture rtl;
