-- store_settings: sensor_msgs/SetCameraInfoRequest in, sensor_msgs/SetCameraInfoResponse out.
--
-- The response succeeds if the width is odd, and its text is the name of the distortion model.
library ieee;
use ieee.std_logic_1164.all;

entity store_settings is
  port (
    clk   : in  std_logic;
    rst_n : in  std_logic;

    -- sensor_msgs/SetCameraInfoRequest
    in_payload_length                           : in  std_logic_vector(31 downto 0);
    in_camera_info_width                        : in  std_logic_vector(31 downto 0);
    in_camera_info_distortion_model_length      : in  std_logic_vector(31 downto 0);
    in_camera_info_distortion_model_axis_tdata  : in  std_logic_vector(31 downto 0);
    in_camera_info_distortion_model_axis_tkeep  : in  std_logic_vector(3 downto 0);
    in_camera_info_distortion_model_axis_tvalid : in  std_logic;
    in_camera_info_distortion_model_axis_tlast  : in  std_logic;
    in_camera_info_distortion_model_axis_tready : out std_logic;
    in_segment_valid                            : in  std_logic_vector(0 downto 0);
    in_msg_valid                                : in  std_logic;
    in_msg_ready                                : out std_logic;

    -- sensor_msgs/SetCameraInfoResponse
    out_success                                 : out std_logic;
    out_status_message_length                   : out std_logic_vector(31 downto 0);
    out_status_message_axis_tdata               : out std_logic_vector(31 downto 0);
    out_status_message_axis_tkeep               : out std_logic_vector(3 downto 0);
    out_status_message_axis_tvalid              : out std_logic;
    out_status_message_axis_tlast               : out std_logic;
    out_status_message_axis_tready              : in  std_logic;
    out_segment_valid                           : out std_logic_vector(0 downto 0);
    out_msg_valid                               : out std_logic;
    out_msg_ready                               : in  std_logic
  );
end entity store_settings;

architecture rtl of store_settings is
begin

  out_success                                 <= in_camera_info_width(0);
  out_status_message_length                   <= in_camera_info_distortion_model_length;
  out_status_message_axis_tdata               <= in_camera_info_distortion_model_axis_tdata;
  out_status_message_axis_tkeep               <= in_camera_info_distortion_model_axis_tkeep;
  out_status_message_axis_tvalid              <= in_camera_info_distortion_model_axis_tvalid;
  out_status_message_axis_tlast               <= in_camera_info_distortion_model_axis_tlast;
  in_camera_info_distortion_model_axis_tready <= out_status_message_axis_tready;
  out_segment_valid                           <= in_segment_valid;
  out_msg_valid                               <= in_msg_valid;
  in_msg_ready                                <= out_msg_ready;

end architecture rtl;
