// SPDX-License-Identifier: Apache-2.0
// The clock, the reset and the PHY of a simulated board, whose frames another program exchanges: that of
// firm_sim_phy.vhd for simulators of Verilog, with the same reports.

`timescale 1ns / 1ps

module firm_sim_phy #(
  parameter BITS   = 8,  // 2, 4 or 8
  parameter IS_DDR = 0   // both edges, with 4 bits
) (
  output reg             clk,
  output reg             rst_n,

  output reg             rx_dv,
  output reg  [BITS-1:0] rxd,
  input  wire            tx_en,
  input  wire [BITS-1:0] txd
);

  localparam HALF_PERIOD  = 5;
  localparam QUARTER      = 2.5;
  localparam RESET_CYCLES = 8;
  localparam QUIET_CYCLES = 200;
  localparam GAP_CYCLES   = 12 * 8 / BITS;
  localparam MOST_BYTES   = 65536;

  integer answers, reports;              // files
  integer low, high;                     // bytes of an answer; negative after the file's end
  integer size, place, bits;             // of the frame to the system, and of its byte
  integer rest;                          // cycles without a frame to come
  integer taken_bits;
  reg [7:0]  line [0:MOST_BYTES-1];
  reg [7:0]  shown, taken;
  reg [31:0] cycles;                     // since the last question
  reg        is_inside;                  // in the middle of a frame of the system

  task ask;
    begin
      $fwrite(reports, "w%c%c%c%c", cycles[7:0], cycles[15:8], cycles[23:16], cycles[31:24]);
      $fflush(reports);
      cycles = 0;
      low    = $fgetc(answers);
      high   = $fgetc(answers);
      size = high < 0 ? 0 : low + 256 * high;
      for (place = 0; place < size && high >= 0; place = place + 1) begin
        high        = $fgetc(answers);
        line[place] = high;
      end
      if (high < 0) begin
        $finish(0);
        size = 0;
      end
      place = 0;
      bits  = 0;
      rest  = size == 0 ? QUIET_CYCLES : GAP_CYCLES;
    end
  endtask

  task take;
    if (tx_en === 1'b1) begin
      is_inside  = 1;
      taken      = {txd, taken} >> BITS;
      taken_bits = taken_bits + BITS;
      if (taken_bits == 8) begin
        $fwrite(reports, "b%c", taken);
        taken_bits = 0;
      end
    end
    else if (is_inside) begin
      $fwrite(reports, "e");
      $fflush(reports);
      is_inside  = 0;
      taken_bits = 0;
    end
  endtask

  task show;
    begin
      if (place == size && rest == 0)
        ask;
      if (place != size) begin
        shown = bits == 0 ? line[place] : shown >> BITS;
        rx_dv = 1;
        rxd   = shown[BITS-1:0];
        bits  = bits + BITS;
        if (bits == 8) begin
          bits  = 0;
          place = place + 1;
        end
      end
      else begin
        rx_dv = 0;
        rxd   = 0;
        rest  = rest - 1;
      end
    end
  endtask

  task exchange;
    begin
      take;
      show;
    end
  endtask

  initial begin : phy
    if (BITS != 2 && BITS != 4 && BITS != 8)
      $fatal(1, "firm_sim_phy: BITS is %0d; legal: 2, 4, 8", BITS);
    if (IS_DDR && BITS != 4)
      $fatal(1, "firm_sim_phy: BITS is %0d; legal with IS_DDR: 4", BITS);
    answers = $fopen("/dev/fd/3", "rb");
    reports = $fopen("/dev/fd/4", "wb");
    if (answers == 0 || reports == 0)
      $fatal(1, "firm_sim_phy: file descriptors 3 and 4 are not open; firm live starts this simulator");
    size       = 0;
    place      = 0;
    rest       = QUIET_CYCLES;
    cycles     = 0;
    is_inside  = 0;
    taken_bits = 0;
    rx_dv      = 0;
    rxd        = 0;
    clk        = 0;
    rst_n      = 0;
    repeat (RESET_CYCLES) begin
      #HALF_PERIOD clk = 1;
      #HALF_PERIOD clk = 0;
    end
    rst_n = 1;
    forever begin
      cycles = cycles + 1;
      if (IS_DDR) begin
        // The first nibble of a byte is shown around the rising edge, and taken while the clock is high.
        #QUARTER exchange;
        #QUARTER clk = 1;
        #QUARTER exchange;
        #QUARTER clk = 0;
      end
      else begin
        #HALF_PERIOD clk = 1;
        #HALF_PERIOD clk = 0;
        exchange;
      end
    end
  end

endmodule
