// SPDX-License-Identifier: Apache-2.0
// firm_sim_join.vhd for simulators of Verilog, cycle by cycle: joins the bursts of each publisher after a Manager with
// a preemptive scheduler to frames, and forwards these in the order of their completion.
// Verilog has no memory that grows, so it keeps at most BEATS beats. More beats, or an illegal burst, end the
// simulation.

`timescale 1ns / 1ps

module firm_sim_join #(
  parameter WIDTH = 8,
  parameter BEATS = 65536
) (
  input  wire               clk,
  input  wire               rst_n,

  // Bursts; `tid` is the publisher's id.
  input  wire [WIDTH-1:0]   s_axis_tdata,
  input  wire [WIDTH/8-1:0] s_axis_tkeep,
  input  wire [0:0]         s_axis_tuser,
  input  wire [7:0]         s_axis_tid,
  input  wire               s_axis_tvalid,
  input  wire               s_axis_tlast,
  output wire               s_axis_tready,

  // Frames.
  output reg  [WIDTH-1:0]   m_axis_tdata,
  output reg  [WIDTH/8-1:0] m_axis_tkeep,
  output reg  [0:0]         m_axis_tuser,
  output reg  [7:0]         m_axis_tid,
  output reg                m_axis_tvalid,
  output reg                m_axis_tlast,
  input  wire               m_axis_tready
);

  localparam LANES        = WIDTH / 8;
  localparam HEADER_BYTES = 5;
  localparam NONE         = -1;

  // The beats, in lists.
  reg [WIDTH-1:0]          tdata     [0:BEATS-1];
  reg [LANES-1:0]          tkeep     [0:BEATS-1];
  reg [7:0]                tid       [0:BEATS-1];
  reg                      tuser     [0:BEATS-1];
  reg                      tlast     [0:BEATS-1];
  integer                  next_beat [0:BEATS-1];
  integer                  free;                   // released by a frame
  integer                  used;                   // ever used by a frame

  // The incomplete frame of each publisher.
  integer                  first     [0:255];
  integer                  last      [0:255];
  integer                  bytes     [0:255];
  reg [8*HEADER_BYTES-1:0] header    [0:255];      // id in the lowest byte, then the length

  integer                  first_whole, last_whole;  // beats of complete frames
  reg                      is_first;                 // the next beat is the first of a burst

  integer                  beat, lane, id;
  reg [8*HEADER_BYTES-1:0] bits;

  assign s_axis_tready = m_axis_tready;

  initial begin
    m_axis_tvalid = 0;
    is_first      = 1;
    free          = NONE;
    used          = 0;
    first_whole   = NONE;
    for (id = 0; id < 256; id = id + 1) begin
      first[id] = NONE;
      bytes[id] = 0;
    end
  end

  task take_room;
    if (free != NONE) begin
      beat = free;
      free = next_beat[beat];
    end else begin
      beat = used;
      used = used + 1;
      if (beat == BEATS)
        $fatal(1, "firm_sim_join: more than BEATS, %0d, beats wait for the ends of their frames", BEATS);
    end
  endtask

  task append_beat;
    begin
      take_room;
      tdata[beat]     = s_axis_tdata;
      tkeep[beat]     = s_axis_tkeep;
      tid[beat]       = s_axis_tid;
      tuser[beat]     = s_axis_tuser === 1'b1;
      tlast[beat]     = 0;
      next_beat[beat] = NONE;
      if (first[id] == NONE)
        first[id] = beat;
      else
        next_beat[last[id]] = beat;
      last[id] = beat;
    end
  endtask

  // Counts the beat's bytes for the frame; those of the header are stored.
  task count_bytes;
    begin
      bits = header[id];
      for (lane = 0; lane < LANES; lane = lane + 1)
        if (s_axis_tkeep[lane] === 1'b1) begin
          if (bytes[id] < HEADER_BYTES)
            bits[8*bytes[id] +: 8] = s_axis_tdata[8*lane +: 8];
          bytes[id] = bytes[id] + 1;
        end
      header[id] = bits;
    end
  endtask

  task pass_on;
    begin
      tlast[last[id]] = 1;
      if (first_whole == NONE)
        first_whole = first[id];
      else
        next_beat[last_whole] = first[id];
      last_whole = last[id];
      first[id]  = NONE;
      bytes[id]  = 0;
    end
  endtask

  task take_beat;
    begin
      id = {24'b0, s_axis_tid};
      if (is_first && s_axis_tdata[7:0] !== s_axis_tid)
        $fatal(1, "burst of id %0d begins with another id", id);
      if (is_first && bytes[id] > 0) begin
        // The first beat of a resumed burst carries only the id.
        if (s_axis_tlast === 1'b1)
          $fatal(1, "burst of id %0d resumes a frame without a beat of it", id);
      end else begin
        append_beat;
        count_bytes;
        if (s_axis_tlast === 1'b1 && s_axis_tuser === 1'b1)
          pass_on;
        else if (bytes[id] >= HEADER_BYTES && bytes[id] - HEADER_BYTES >= bits[39:8]) begin
          if (s_axis_tlast !== 1'b1)
            $fatal(1, "burst of id %0d continues after its frame", id);
          pass_on;
        end
      end
      is_first = s_axis_tlast === 1'b1;
    end
  endtask

  always @(posedge clk)
    if (rst_n) begin
      if (s_axis_tvalid === 1'b1 && m_axis_tready === 1'b1)
        take_beat;
      if (!m_axis_tvalid || m_axis_tready === 1'b1) begin
        m_axis_tvalid <= first_whole != NONE;
        if (first_whole != NONE) begin
          beat         = first_whole;
          m_axis_tdata <= tdata[beat];
          m_axis_tkeep <= tkeep[beat];
          m_axis_tid   <= tid[beat];
          m_axis_tuser <= tuser[beat];
          m_axis_tlast <= tlast[beat];
          first_whole     = next_beat[beat];
          next_beat[beat] = free;
          free            = beat;
        end
      end
    end

endmodule
