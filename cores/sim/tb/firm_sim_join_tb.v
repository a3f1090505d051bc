// SPDX-License-Identifier: Apache-2.0
// firm_sim_join_tb.vhd for simulators of Verilog: the frames of the host's stimulus file are bursts.

`timescale 1ns / 1ps

module firm_sim_join_tb;

  parameter WIDTH = 8;
  parameter BEATS = 65536;

  wire               clk, rst_n;
  wire [WIDTH-1:0]   burst_tdata, frame_tdata;
  wire [WIDTH/8-1:0] burst_tkeep, frame_tkeep;
  wire               burst_tvalid, frame_tvalid;
  wire               burst_tlast, frame_tlast;
  wire [0:0]         burst_tuser, frame_tuser;
  wire               burst_tready, frame_tready;
  wire [7:0]         frame_tid;

  // The first beat of a frame contains its id.
  reg                first_r;
  reg  [7:0]         id_r;
  wire [7:0]         burst_tid = first_r ? burst_tdata[7:0] : id_r;

  always @(posedge clk)
    if (!rst_n)
      first_r <= 1;
    else if (burst_tvalid && burst_tready) begin
      first_r <= burst_tlast;
      if (first_r)
        id_r <= burst_tdata[7:0];
    end

  firm_sim_host #(.WIDTH(WIDTH), .RECEIVED_FILE("received.txt"), .WATCHDOG(200), .QUIET(50)) u_host (
    .clk(clk),
    .rst_n(rst_n),
    .m_axis_tdata(burst_tdata),
    .m_axis_tkeep(burst_tkeep),
    .m_axis_tuser(burst_tuser),
    .m_axis_tvalid(burst_tvalid),
    .m_axis_tlast(burst_tlast),
    .m_axis_tready(burst_tready),
    .s_axis_tdata(frame_tdata),
    .s_axis_tkeep(frame_tkeep),
    .s_axis_tuser(frame_tuser),
    .s_axis_tid(frame_tid),
    .s_axis_tvalid(frame_tvalid),
    .s_axis_tlast(frame_tlast),
    .s_axis_tready(frame_tready),
    .id_error(1'b0),
    .frame_error(1'b0)
  );

  firm_sim_join #(.WIDTH(WIDTH), .BEATS(BEATS)) u_join (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata(burst_tdata),
    .s_axis_tkeep(burst_tkeep),
    .s_axis_tuser(burst_tuser),
    .s_axis_tid(burst_tid),
    .s_axis_tvalid(burst_tvalid),
    .s_axis_tlast(burst_tlast),
    .s_axis_tready(burst_tready),
    .m_axis_tdata(frame_tdata),
    .m_axis_tkeep(frame_tkeep),
    .m_axis_tuser(frame_tuser),
    .m_axis_tid(frame_tid),
    .m_axis_tvalid(frame_tvalid),
    .m_axis_tlast(frame_tlast),
    .m_axis_tready(frame_tready)
  );

endmodule
