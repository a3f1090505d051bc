// SPDX-License-Identifier: Apache-2.0
// firm_sim_host_tb.vhd for simulators of Verilog: the host against a system that is a wire, which +FAULT=... breaks.

`timescale 1ns / 1ps

module firm_sim_host_tb;

  parameter WIDTH = 8;

  localparam LANES = WIDTH / 8;

  wire             clk, rst_n;
  wire [WIDTH-1:0] out_tdata;
  wire [LANES-1:0] out_tkeep;
  wire             out_tvalid, out_tlast;
  reg              out_tready;
  reg  [WIDTH-1:0] in_tdata;
  reg  [LANES-1:0] in_tkeep;
  reg  [7:0]       in_tid;
  reg              in_tvalid, in_tlast;
  wire             in_tready;
  reg              id_error, frame_error;

  reg              first_r = 1;
  reg  [7:0]       id_r = 0;
  integer          beats_r = 0;
  integer          idle_r = 0;  // cycles since the last beat
  reg              held_r = 0;  // a beat has waited for a cycle

  // The way to break the stream; the block `spoil` shows them all.
  reg [8*16-1:0]   fault;

  firm_sim_host #(.WIDTH(WIDTH), .RECEIVED_FILE("received.txt"), .WATCHDOG(200), .QUIET(50)) u_host (
    .clk(clk),
    .rst_n(rst_n),
    .m_axis_tdata(out_tdata),
    .m_axis_tkeep(out_tkeep),
    .m_axis_tvalid(out_tvalid),
    .m_axis_tlast(out_tlast),
    .m_axis_tready(out_tready),
    .s_axis_tdata(in_tdata),
    .s_axis_tkeep(in_tkeep),
    .s_axis_tid(in_tid),
    .s_axis_tvalid(in_tvalid),
    .s_axis_tlast(in_tlast),
    .s_axis_tready(in_tready),
    .id_error(id_error),
    .frame_error(frame_error)
  );

  initial
    if (!$value$plusargs("FAULT=%s", fault))
      fault = "none";

  always @(posedge clk) begin : watch_frames
    held_r <= out_tvalid && !out_tready;
    idle_r <= idle_r + 1;
    if (out_tvalid && out_tready) begin
      idle_r  <= 0;
      beats_r <= beats_r + 1;
      first_r <= out_tlast;
      if (first_r)
        id_r <= out_tdata[7:0];
    end
  end

  always @* begin : spoil
    reg is_third, is_fourth;
    is_third  = beats_r == 2 && out_tvalid;
    is_fourth = beats_r == 3 && out_tvalid;

    out_tready  = in_tready;
    in_tdata    = out_tdata;
    in_tkeep    = out_tkeep;
    in_tvalid   = out_tvalid;
    in_tlast    = out_tlast;
    in_tid      = first_r ? out_tdata[7:0] : id_r;
    id_error    = 0;
    frame_error = 0;

    if (fault == "unstable" && held_r)
      in_tdata = ~out_tdata;
    else if (fault == "withdrawn" && held_r) begin
      in_tvalid  = 0;
      out_tready = 0;
    end else if (fault == "undefined" && is_third)
      in_tdata[3] = 1'bx;
    else if (fault == "unknown_valid" && is_third)
      in_tvalid = 1'bx;
    else if (fault == "sparse" && is_third)
      in_tkeep[0] = 0;
    else if (fault == "partial" && is_third)
      in_tkeep[LANES-1] = 0;
    else if (fault == "empty" && is_third)
      in_tkeep = 0;
    else if (fault == "wrong_tid" && is_third)
      in_tid = 8'ha5;
    else if (fault == "unknown_last" && is_third)
      in_tlast = 1'bx;
    else if (fault == "early_last" && is_third)
      in_tlast = 1;
    else if (fault == "late_last" && is_fourth)
      in_tlast = 0;
    else if (fault == "unknown_ready" && is_third)
      out_tready = 1'bx;
    else if (fault == "stuck" && beats_r >= 2) begin
      out_tready = 0;
      in_tvalid  = 0;
    end else if (fault == "mute") begin
      out_tready = 1;
      in_tvalid  = 0;
    end else if (fault == "late_surplus" && beats_r > 0 && idle_r == 30) begin
      in_tvalid = 1;
      in_tdata  = 0;
      in_tkeep  = {LANES{1'b1}};
      in_tid    = 0;
      in_tlast  = 1;
    end else if (fault == "endless" && beats_r >= 2) begin
      in_tvalid = 1;
      in_tdata  = 0;
      in_tkeep  = {LANES{1'b1}};
      in_tlast  = 0;
    end else if (fault == "id_pulse" && is_third)
      id_error = 1;
    else if (fault == "frame_pulse" && is_third)
      frame_error = 1;
    else if (fault == "unknown_pulse" && is_third)
      id_error = 1'bx;
  end

endmodule
