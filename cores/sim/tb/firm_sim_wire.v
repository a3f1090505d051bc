// SPDX-License-Identifier: Apache-2.0
// firm_sim_wire.vhd for simulators of Verilog: a system that is a wire, which +FAULT=... breaks.

`timescale 1ns / 1ps

module firm_sim_wire #(
  parameter WIDTH = 8
) (
  input  wire               clk,

  input  wire [WIDTH-1:0]   s_axis_tdata,
  input  wire [WIDTH/8-1:0] s_axis_tkeep,
  input  wire [0:0]         s_axis_tuser,
  input  wire               s_axis_tvalid,
  input  wire               s_axis_tlast,
  output reg                s_axis_tready,

  output reg  [WIDTH-1:0]   m_axis_tdata,
  output reg  [WIDTH/8-1:0] m_axis_tkeep,
  output wire [0:0]         m_axis_tuser,
  output reg  [7:0]         m_axis_tid,
  output reg                m_axis_tvalid,
  output reg                m_axis_tlast,
  input  wire               m_axis_tready,

  output reg                id_error,
  output reg                frame_error
);

  localparam LANES = WIDTH / 8;

  reg              first_r = 1;
  reg  [7:0]       id_r = 0;
  integer          beats_r = 0;
  integer          idle_r = 0;  // cycles since the last beat
  reg              held_r = 0;  // a beat has waited for a cycle

  // The way to break the stream; the block `spoil` lists all ways.
  reg [8*16-1:0]   fault;

  initial
    if (!$value$plusargs("FAULT=%s", fault))
      fault = "none";

  always @(posedge clk) begin : watch_frames
    held_r <= s_axis_tvalid && !s_axis_tready;
    idle_r <= idle_r + 1;
    if (s_axis_tvalid && s_axis_tready) begin
      idle_r  <= 0;
      beats_r <= beats_r + 1;
      first_r <= s_axis_tlast;
      if (first_r)
        id_r <= s_axis_tdata[7:0];
    end
  end

  assign m_axis_tuser = s_axis_tuser;

  always @* begin : spoil
    reg is_third, is_fourth;
    is_third  = beats_r == 2 && s_axis_tvalid;
    is_fourth = beats_r == 3 && s_axis_tvalid;

    s_axis_tready  = m_axis_tready;
    m_axis_tdata    = s_axis_tdata;
    m_axis_tkeep    = s_axis_tkeep;
    m_axis_tvalid   = s_axis_tvalid;
    m_axis_tlast    = s_axis_tlast;
    m_axis_tid      = first_r ? s_axis_tdata[7:0] : id_r;
    id_error    = 0;
    frame_error = 0;

    if (fault == "unstable" && held_r)
      m_axis_tdata = ~s_axis_tdata;
    else if (fault == "withdrawn" && held_r) begin
      m_axis_tvalid  = 0;
      s_axis_tready = 0;
    end else if (fault == "undefined" && is_third)
      m_axis_tdata[3] = 1'bx;
    else if (fault == "unknown_valid" && is_third)
      m_axis_tvalid = 1'bx;
    else if (fault == "sparse" && is_third)
      m_axis_tkeep[0] = 0;
    else if (fault == "partial" && is_third)
      m_axis_tkeep[LANES-1] = 0;
    else if (fault == "empty" && is_third)
      m_axis_tkeep = 0;
    else if (fault == "wrong_tid" && is_third)
      m_axis_tid = 8'ha5;
    else if (fault == "unknown_last" && is_third)
      m_axis_tlast = 1'bx;
    else if (fault == "early_last" && is_third)
      m_axis_tlast = 1;
    else if (fault == "late_last" && is_fourth)
      m_axis_tlast = 0;
    else if (fault == "unknown_ready" && is_third)
      s_axis_tready = 1'bx;
    else if (fault == "stuck" && beats_r >= 2) begin
      s_axis_tready = 0;
      m_axis_tvalid  = 0;
    end else if (fault == "mute") begin
      s_axis_tready = 1;
      m_axis_tvalid  = 0;
    end else if (fault == "late_surplus" && beats_r > 0 && idle_r == 30) begin
      m_axis_tvalid = 1;
      m_axis_tdata  = 0;
      m_axis_tkeep  = {LANES{1'b1}};
      m_axis_tid    = 0;
      m_axis_tlast  = 1;
    end else if (fault == "endless" && beats_r >= 2) begin
      m_axis_tvalid = 1;
      m_axis_tdata  = 0;
      m_axis_tkeep  = {LANES{1'b1}};
      m_axis_tlast  = 0;
    end else if (fault == "id_pulse" && is_third)
      id_error = 1;
    else if (fault == "frame_pulse" && is_third)
      frame_error = 1;
    else if (fault == "unknown_pulse" && is_third)
      id_error = 1'bx;
  end

endmodule
