// SPDX-License-Identifier: Apache-2.0
// The host's end of a link for simulators of Verilog, as firm_sim_coder and firm_sim_frames are in VHDL: it appends the
// checksum to each frame and encodes the frame (COBS); it decodes received frames, checks their lengths and checksums,
// and passes each on when it is complete. A broken frame ends the simulation. With +RAW=true, bytes pass unchanged in
// both directions, and a zero byte ends a frame from the system. Simulation only.

`timescale 1ns / 1ps

module firm_sim_link #(
  // The bits of the addresses of the memory for received bytes.
  parameter ADDRESS_BITS = 20
) (
  input  wire       clk,
  input  wire       rst_n,

  // Frames of the host.
  input  wire [7:0] s_axis_tdata,
  input  wire       s_axis_tvalid,
  input  wire       s_axis_tlast,
  output reg        s_axis_tready,

  output reg  [7:0] m_axis_tdata,
  output wire [0:0] m_axis_tkeep,
  output reg  [7:0] m_axis_tid,
  output reg        m_axis_tvalid,
  output reg        m_axis_tlast,
  input  wire       m_axis_tready,

  // Bytes to the line.
  output reg  [7:0] coded_data,
  output reg        coded_valid,
  input  wire       coded_ready,

  // Bytes from the line, at most one per cycle.
  input  wire [7:0] received_data,
  input  wire       received_valid
);

  localparam HEADER_BYTES   = 5;
  localparam CHECKSUM_BYTES = 4;
  localparam FULL_BLOCK     = 254;
  localparam QUEUE_BYTES    = 1024;
  // Bytes are taken from the host while fewer than this number wait, as in firm_sim_coder.vhd.
  localparam FEW            = 16;
  localparam CRC_START      = 32'hffffffff;
  localparam CRC_RESIDUE    = 32'hdebb20e3;
  localparam STORE_BYTES    = 1 << ADDRESS_BITS;

  reg is_raw;

  initial begin
    is_raw        = $test$plusargs("RAW=true") != 0;
    s_axis_tready = 0;
    coded_valid   = 0;
    m_axis_tvalid = 0;
  end

  function [31:0] next_crc(input [31:0] crc, input [7:0] data);
    integer place;
    begin
      next_crc = crc;
      for (place = 0; place < 8; place = place + 1)
        next_crc = {1'b0, next_crc[31:1]} ^ (next_crc[0] ^ data[place] ? 32'hedb88320 : 32'h0);
    end
  endfunction

  // ------------------------------------------------------------------ to the system

  reg [7:0]  queue [0:QUEUE_BYTES-1];
  integer    first, count;
  reg [7:0]  content [0:FULL_BLOCK-1];
  integer    size, index;
  reg        is_open;  // the frame does not end with the last block that was written
  reg [31:0] sent_crc;

  initial begin
    first    = 0;
    count    = 0;
    size     = 0;
    is_open  = 1;
    sent_crc = CRC_START;
  end

  task put(input [7:0] value);
    begin
      queue[(first + count) % QUEUE_BYTES] = value;
      count = count + 1;
    end
  endtask

  task end_block;
    begin
      put(size[7:0] + 8'd1);
      for (index = 0; index < size; index = index + 1)
        put(content[index]);
      size = 0;
    end
  endtask

  task add(input [7:0] value);
    begin
      is_open = 1;
      if (value == 0)
        end_block;
      else begin
        content[size] = value;
        size          = size + 1;
        if (size == FULL_BLOCK) begin
          end_block;
          is_open = 0;
        end
      end
    end
  endtask

  task end_sent_frame;
    begin
      sent_crc = ~sent_crc;
      add(sent_crc[7:0]);
      add(sent_crc[15:8]);
      add(sent_crc[23:16]);
      add(sent_crc[31:24]);
      if (is_open)
        end_block;
      put(0);
      is_open  = 1;
      sent_crc = CRC_START;
    end
  endtask

  task encode;
    if (is_raw)
      put(s_axis_tdata);
    else begin
      sent_crc = next_crc(sent_crc, s_axis_tdata);
      add(s_axis_tdata);
      if (s_axis_tlast)
        end_sent_frame;
    end
  endtask

  always @(posedge clk)
    if (rst_n) begin
      if (s_axis_tvalid && s_axis_tready)
        encode;
      if (!coded_valid || coded_ready) begin
        coded_valid <= count > 0;
        if (count > 0) begin
          coded_data <= queue[first];
          first       = (first + 1) % QUEUE_BYTES;
          count       = count - 1;
        end
      end
      s_axis_tready <= count < FEW;
    end

  // ------------------------------------------------------------------ from the system

  // All waiting bytes, those of complete frames first; the highest bit marks the last one of a frame.
  reg [8:0]  store [0:STORE_BYTES-1];
  integer    oldest, waiting;
  integer    whole;   // bytes of complete frames
  integer    left;    // coded bytes of the block still to come
  reg        is_due;  // a zero follows this block
  integer    bytes;   // of the incoming frame, with its checksum
  reg [39:0] header;
  reg [31:0] crc;
  reg        is_first;

  initial begin
    oldest   = 0;
    waiting  = 0;
    whole    = 0;
    left     = 0;
    is_due   = 0;
    bytes    = 0;
    crc      = CRC_START;
    is_first = 1;
  end

  assign m_axis_tkeep = 1'b1;

  task keep(input [7:0] value);
    begin
      if (waiting == STORE_BYTES)
        $fatal(1, "firm_sim_link: more than %0d bytes wait for the host", STORE_BYTES);
      store[(oldest + waiting) % STORE_BYTES] = {1'b0, value};
      waiting = waiting + 1;
    end
  endtask

  // All waiting bytes now belong to complete frames.
  task end_kept;
    begin
      store[(oldest + waiting - 1) % STORE_BYTES] = store[(oldest + waiting - 1) % STORE_BYTES] | 9'h100;
      whole = waiting;
    end
  endtask

  task take_byte(input [7:0] value);
    begin
      crc = next_crc(crc, value);
      if (bytes < HEADER_BYTES)
        header[8*bytes +: 8] = value;
      bytes = bytes + 1;
      if (bytes <= HEADER_BYTES || bytes <= HEADER_BYTES + header[39:8])
        keep(value);
    end
  endtask

  task end_frame;
    begin
      if (left != 0 || bytes < HEADER_BYTES + CHECKSUM_BYTES || crc != CRC_RESIDUE)
        $fatal(1, "firm_sim_link: the system sent a frame whose code or checksum is wrong");
      if (bytes != HEADER_BYTES + header[39:8] + CHECKSUM_BYTES)
        $fatal(1, "firm_sim_link: the system sent a frame whose length is wrong");
      end_kept;
      bytes  = 0;
      is_due = 0;
      crc    = CRC_START;
    end
  endtask

  task decode;
    if (is_raw) begin
      keep(received_data);
      if (received_data == 0)
        end_kept;
    end else if (received_data == 0)
      end_frame;
    else if (left == 0) begin
      if (is_due)
        take_byte(0);
      left   = received_data - 1;
      is_due = received_data != 8'hff;
    end else begin
      left = left - 1;
      take_byte(received_data);
    end
  endtask

  task show_byte;
    begin
      m_axis_tvalid <= whole > 0;
      if (whole > 0) begin
        m_axis_tdata <= store[oldest][7:0];
        m_axis_tlast <= store[oldest][8];
        if (is_first)
          m_axis_tid <= is_raw ? 8'd0 : store[oldest][7:0];
        is_first = store[oldest][8];
        oldest   = (oldest + 1) % STORE_BYTES;
        waiting  = waiting - 1;
        whole    = whole - 1;
      end
    end
  endtask

  always @(posedge clk)
    if (rst_n) begin
      if (received_valid)
        decode;
      if (!m_axis_tvalid || m_axis_tready)
        show_byte;
    end

endmodule
