// SPDX-License-Identifier: Apache-2.0
// firm_sim_pipe_tb.vhd for simulators of Verilog: the host at the end of a pipe with a system that is a wire, which
// +FAULT=... breaks.

`timescale 1ns / 1ps

module firm_sim_pipe_tb;

  parameter WIDTH = 8;

  localparam LANES = WIDTH / 8;

  wire             clk, rst_n;
  wire [WIDTH-1:0] out_tdata, in_tdata;
  wire [LANES-1:0] out_tkeep, in_tkeep;
  wire [0:0]       out_tuser, in_tuser;
  wire [7:0]       in_tid;
  wire             out_tvalid, out_tlast, out_tready;
  wire             in_tvalid, in_tlast, in_tready;
  wire             id_error, frame_error;

  // The system itself is the wire, seen from both ends.
  wire [1:0] waits = {in_tvalid & ~in_tready, out_tvalid & ~out_tready};

  firm_sim_pipe #(.WIDTH(WIDTH), .WIRES(2)) u_host (
    .clk(clk),
    .rst_n(rst_n),
    .m_axis_tdata(out_tdata),
    .m_axis_tkeep(out_tkeep),
    .m_axis_tuser(out_tuser),
    .m_axis_tvalid(out_tvalid),
    .m_axis_tlast(out_tlast),
    .m_axis_tready(out_tready),
    .s_axis_tdata(in_tdata),
    .s_axis_tkeep(in_tkeep),
    .s_axis_tuser(in_tuser),
    .s_axis_tid(in_tid),
    .s_axis_tvalid(in_tvalid),
    .s_axis_tlast(in_tlast),
    .s_axis_tready(in_tready),
    .id_error(id_error),
    .frame_error(frame_error),
    .frame_code(4'd7),
    .waits(waits)
  );

  firm_sim_wire #(.WIDTH(WIDTH)) u_system (
    .clk(clk),
    .s_axis_tdata(out_tdata),
    .s_axis_tkeep(out_tkeep),
    .s_axis_tuser(out_tuser),
    .s_axis_tvalid(out_tvalid),
    .s_axis_tlast(out_tlast),
    .s_axis_tready(out_tready),
    .m_axis_tdata(in_tdata),
    .m_axis_tkeep(in_tkeep),
    .m_axis_tuser(in_tuser),
    .m_axis_tid(in_tid),
    .m_axis_tvalid(in_tvalid),
    .m_axis_tlast(in_tlast),
    .m_axis_tready(in_tready),
    .id_error(id_error),
    .frame_error(frame_error)
  );

endmodule
