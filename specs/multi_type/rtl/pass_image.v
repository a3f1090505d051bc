// SPDX-License-Identifier: Apache-2.0
// Forwards a sensor_msgs/Image unchanged. Nothing is stored: each field and beat leaves in the cycle in which it
// arrives. ROS 1 has seq and nsec, ROS 2 has nanosec: a system connects those of its message.
module pass_image #(
  parameter WIDTH = 8
) (
  input  wire               clk,
  input  wire               rst_n,

  input  wire [31:0]        in_payload_length,
  input  wire [31:0]        in_header_seq,
  input  wire [31:0]        in_header_stamp_sec,
  input  wire [31:0]        in_header_stamp_nsec,
  input  wire [31:0]        in_header_stamp_nanosec,
  input  wire [31:0]        in_header_frame_id_length,
  input  wire [WIDTH-1:0]   in_header_frame_id_axis_tdata,
  input  wire [WIDTH/8-1:0] in_header_frame_id_axis_tkeep,
  input  wire               in_header_frame_id_axis_tvalid,
  input  wire               in_header_frame_id_axis_tlast,
  output wire               in_header_frame_id_axis_tready,
  input  wire [31:0]        in_height,
  input  wire [31:0]        in_width,
  input  wire [31:0]        in_encoding_length,
  input  wire [WIDTH-1:0]   in_encoding_axis_tdata,
  input  wire [WIDTH/8-1:0] in_encoding_axis_tkeep,
  input  wire               in_encoding_axis_tvalid,
  input  wire               in_encoding_axis_tlast,
  output wire               in_encoding_axis_tready,
  input  wire [7:0]         in_is_bigendian,
  input  wire [31:0]        in_step,
  input  wire [31:0]        in_data_length,
  input  wire [WIDTH-1:0]   in_data_axis_tdata,
  input  wire [WIDTH/8-1:0] in_data_axis_tkeep,
  input  wire               in_data_axis_tvalid,
  input  wire               in_data_axis_tlast,
  output wire               in_data_axis_tready,
  input  wire [2:0]         in_segment_valid,
  input  wire               in_msg_valid,
  output wire               in_msg_ready,

  output wire [31:0]        out_payload_length,
  output wire [31:0]        out_header_seq,
  output wire [31:0]        out_header_stamp_sec,
  output wire [31:0]        out_header_stamp_nsec,
  output wire [31:0]        out_header_stamp_nanosec,
  output wire [31:0]        out_header_frame_id_length,
  output wire [WIDTH-1:0]   out_header_frame_id_axis_tdata,
  output wire [WIDTH/8-1:0] out_header_frame_id_axis_tkeep,
  output wire               out_header_frame_id_axis_tvalid,
  output wire               out_header_frame_id_axis_tlast,
  input  wire               out_header_frame_id_axis_tready,
  output wire [31:0]        out_height,
  output wire [31:0]        out_width,
  output wire [31:0]        out_encoding_length,
  output wire [WIDTH-1:0]   out_encoding_axis_tdata,
  output wire [WIDTH/8-1:0] out_encoding_axis_tkeep,
  output wire               out_encoding_axis_tvalid,
  output wire               out_encoding_axis_tlast,
  input  wire               out_encoding_axis_tready,
  output wire [7:0]         out_is_bigendian,
  output wire [31:0]        out_step,
  output wire [31:0]        out_data_length,
  output wire [WIDTH-1:0]   out_data_axis_tdata,
  output wire [WIDTH/8-1:0] out_data_axis_tkeep,
  output wire               out_data_axis_tvalid,
  output wire               out_data_axis_tlast,
  input  wire               out_data_axis_tready,
  output wire [2:0]         out_segment_valid,
  output wire               out_msg_valid,
  input  wire               out_msg_ready
);

  assign out_payload_length              = in_payload_length;
  assign out_header_seq                  = in_header_seq;
  assign out_header_stamp_sec            = in_header_stamp_sec;
  assign out_header_stamp_nsec           = in_header_stamp_nsec;
  assign out_header_stamp_nanosec        = in_header_stamp_nanosec;
  assign out_header_frame_id_length      = in_header_frame_id_length;
  assign out_header_frame_id_axis_tdata  = in_header_frame_id_axis_tdata;
  assign out_header_frame_id_axis_tkeep  = in_header_frame_id_axis_tkeep;
  assign out_header_frame_id_axis_tvalid = in_header_frame_id_axis_tvalid;
  assign out_header_frame_id_axis_tlast  = in_header_frame_id_axis_tlast;
  assign in_header_frame_id_axis_tready  = out_header_frame_id_axis_tready;
  assign out_height                      = in_height;
  assign out_width                       = in_width;
  assign out_encoding_length             = in_encoding_length;
  assign out_encoding_axis_tdata         = in_encoding_axis_tdata;
  assign out_encoding_axis_tkeep         = in_encoding_axis_tkeep;
  assign out_encoding_axis_tvalid        = in_encoding_axis_tvalid;
  assign out_encoding_axis_tlast         = in_encoding_axis_tlast;
  assign in_encoding_axis_tready         = out_encoding_axis_tready;
  assign out_is_bigendian                = in_is_bigendian;
  assign out_step                        = in_step;
  assign out_data_length                 = in_data_length;
  assign out_data_axis_tdata             = in_data_axis_tdata;
  assign out_data_axis_tkeep             = in_data_axis_tkeep;
  assign out_data_axis_tvalid            = in_data_axis_tvalid;
  assign out_data_axis_tlast             = in_data_axis_tlast;
  assign in_data_axis_tready             = out_data_axis_tready;
  assign out_segment_valid               = in_segment_valid;
  assign out_msg_valid                   = in_msg_valid;
  assign in_msg_ready                    = out_msg_ready;

endmodule
