// SPDX-License-Identifier: Apache-2.0
// Forwards a geometry_msgs/TwistStamped unchanged. Nothing is stored: each field and beat leaves in the cycle in which
// it arrives. ROS 1 has seq and nsec, ROS 2 has nanosec: a system connects those of its message.
module pass_twist #(
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
  input  wire [63:0]        in_twist_linear_x,
  input  wire [63:0]        in_twist_linear_y,
  input  wire [63:0]        in_twist_linear_z,
  input  wire [63:0]        in_twist_angular_x,
  input  wire [63:0]        in_twist_angular_y,
  input  wire [63:0]        in_twist_angular_z,
  input  wire [1:0]         in_segment_valid,
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
  output wire [63:0]        out_twist_linear_x,
  output wire [63:0]        out_twist_linear_y,
  output wire [63:0]        out_twist_linear_z,
  output wire [63:0]        out_twist_angular_x,
  output wire [63:0]        out_twist_angular_y,
  output wire [63:0]        out_twist_angular_z,
  output wire [1:0]         out_segment_valid,
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
  assign out_twist_linear_x              = in_twist_linear_x;
  assign out_twist_linear_y              = in_twist_linear_y;
  assign out_twist_linear_z              = in_twist_linear_z;
  assign out_twist_angular_x             = in_twist_angular_x;
  assign out_twist_angular_y             = in_twist_angular_y;
  assign out_twist_angular_z             = in_twist_angular_z;
  assign out_segment_valid               = in_segment_valid;
  assign out_msg_valid                   = in_msg_valid;
  assign in_msg_ready                    = out_msg_ready;

endmodule
