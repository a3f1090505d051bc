// Feeds the Verilog netlist of quat2euler from +vectors=FILE and prints its results, all in hexadecimal.
// It finds faults of the translation and does not repeat the checks of quat2euler_tb.vhd.

`timescale 1ns / 1ps

module quat2euler_netlist_tb;

  parameter MESSAGES = 1;
  // Cycles after which an unfinished netlist counts as hung.
  parameter PATIENCE = 200 * (MESSAGES + 1);

  reg [255:0] vectors [0:MESSAGES-1];
  reg [1023:0] file;
  integer sent = 0;
  integer received = 0;
  integer cycle = 0;

  reg clk = 0;
  reg rst_n = 0;
  reg [255:0] message;
  reg in_msg_valid = 0;
  wire in_msg_ready;
  wire [191:0] result;
  wire out_segment_valid;

  quat2euler dut (
    .clk(clk),
    .rst_n(rst_n),
    .in_x(message[255:192]),
    .in_y(message[191:128]),
    .in_z(message[127:64]),
    .in_w(message[63:0]),
    .in_segment_valid(in_msg_valid),
    .in_msg_valid(in_msg_valid),
    .in_msg_ready(in_msg_ready),
    .out_x(result[191:128]),
    .out_y(result[127:64]),
    .out_z(result[63:0]),
    .out_segment_valid(out_segment_valid),
    .out_msg_ready(cycle[0])
  );

  always #5 clk = !clk;

  initial begin
    if (!$value$plusargs("vectors=%s", file)) begin
      $display("quat2euler_netlist_tb: +vectors=FILE is missing");
      $finish(0);
    end
    $readmemh(file, vectors);
  end

  always @(posedge clk) begin
    cycle <= cycle + 1;
    rst_n <= cycle > 3;
    if (rst_n && in_msg_valid && in_msg_ready) begin
      sent <= sent + 1;
      in_msg_valid <= 0;
    end else if (rst_n && sent < MESSAGES) begin
      message <= vectors[sent];
      in_msg_valid <= 1;
    end
    if (out_segment_valid && cycle[0]) begin
      $display("%h", result);
      received <= received + 1;
    end
    if (received == MESSAGES || cycle == PATIENCE)
      $finish(0);
  end

endmodule
