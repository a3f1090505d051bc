// SPDX-License-Identifier: Apache-2.0
// The checker with a stream from a file: a line a cycle, in bits and in the order of `cycle`.

`timescale 1ns / 1ps

module axis_replay;

  parameter WIDTH        = 16;
  parameter CYCLES       = 4000;
  parameter STABLE       = 1;
  parameter KNOWN        = 1;
  parameter KEEP         = 1;
  parameter MAY_BE_EMPTY = 0;
  parameter RESET        = 1;
  parameter ABORT        = 1;
  parameter IS_FATAL     = 0;

  localparam LANES = WIDTH / 8;
  localparam BITS  = 6 + LANES + WIDTH;

  reg clk = 1'b0;
  reg [BITS-1:0] cycles [0:CYCLES-1];
  reg [BITS-1:0] cycle;
  integer number;

  firm_axis_checker #(
    .WIDTH(WIDTH),
    .USER_BITS(2),
    .NAME("random frames"),
    .IS_FATAL(IS_FATAL),
    .STABLE(STABLE),
    .KNOWN(KNOWN),
    .KEEP(KEEP),
    .MAY_BE_EMPTY(MAY_BE_EMPTY),
    .RESET(RESET),
    .ABORT(ABORT)
  ) u_checker (
    .clk(clk),
    .rst_n(cycle[BITS-1]),
    .axis_tvalid(cycle[BITS-2]),
    .axis_tready(cycle[BITS-3]),
    .axis_tlast(cycle[BITS-4]),
    .axis_tuser(cycle[BITS-5 -: 2]),
    .axis_tkeep(cycle[WIDTH +: LANES]),
    .axis_tdata(cycle[WIDTH-1:0])
  );

  initial begin
    $readmemb("cycles.txt", cycles);
    for (number = 0; number < CYCLES; number = number + 1) begin
      cycle = cycles[number];
      #5 clk = 1'b1;
      #5 clk = 1'b0;
    end
    $display("PASS %0d cycles", CYCLES);
    $finish;
  end

endmodule
