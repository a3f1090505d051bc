// SPDX-License-Identifier: Apache-2.0
// The clock, the reset and the SPI slave of a simulated board, whose bytes another program exchanges: that of
// firm_sim_chip.vhd for simulators of Verilog, with the same reports.

`timescale 1ns / 1ps

module firm_sim_chip (
  output reg  clk,
  output reg  rst_n,

  input  wire spi_sck,
  input  wire spi_cs_n,
  input  wire spi_mosi,
  output reg  spi_miso,
  input  wire spi_rst_n
);

  localparam HALF_PERIOD  = 5;
  localparam RESET_CYCLES = 8;

  integer answers, reports;              // files
  integer answer;
  integer bits;                          // of the current byte
  reg [31:0] cycles;                     // since the last frame of SPI
  reg [7:0]  taken, shown;
  reg        sck, cs_n, reset_n;         // of the previous cycle

  task next_byte;
    begin
      $fflush(reports);
      answer = $fgetc(answers);
      if (answer < 0)
        $finish(0);
    end
  endtask

  task load;
    begin
      $fwrite(reports, "a");
      next_byte;
      shown = answer;
    end
  endtask

  task change_select;
    begin
      if (bits != 0)
        $fatal(1, "firm_sim_chip: a frame of the SPI ends within a byte");
      if (spi_cs_n === 1'b0) begin
        $fwrite(reports, "s%c%c%c%c", cycles[7:0], cycles[15:8], cycles[23:16], cycles[31:24]);
        cycles = 0;
        next_byte;
        load;
      end
      else begin
        $fwrite(reports, "d");
        $fflush(reports);
      end
    end
  endtask

  task change_clock;
    if (spi_sck === 1'b1) begin
      taken = {taken[6:0], spi_mosi};
      bits  = bits + 1;
      if (bits == 8) begin
        $fwrite(reports, "t%c", taken);
        bits = 0;
      end
    end
    else if (bits != 0)
      shown = {shown[6:0], 1'b0};
    else
      load;
  endtask

  // The slave samples the values that the system samples at the next rising edge.
  task sample;
    begin
      if (spi_rst_n === 1'b0 && reset_n !== 1'b0)
        $fwrite(reports, "r");
      if (spi_cs_n !== cs_n)
        change_select;
      if (spi_cs_n === 1'b0 && spi_sck !== sck)
        change_clock;
      cs_n     = spi_cs_n;
      sck      = spi_sck;
      reset_n  = spi_rst_n;
      spi_miso = spi_cs_n === 1'b0 ? shown[7] : 1'b0;
    end
  endtask

  initial begin : chip
    answers = $fopen("/dev/fd/3", "rb");
    reports = $fopen("/dev/fd/4", "wb");
    if (answers == 0 || reports == 0)
      $fatal(1, "firm_sim_chip: file descriptors 3 and 4 are not open; firm live starts this simulator");
    bits     = 0;
    cycles   = 0;
    cs_n     = 1;
    sck      = 0;
    reset_n  = 0;
    spi_miso = 0;
    clk      = 0;
    rst_n    = 0;
    repeat (RESET_CYCLES) begin
      #HALF_PERIOD clk = 1;
      #HALF_PERIOD clk = 0;
    end
    rst_n = 1;
    forever begin
      #HALF_PERIOD clk = 1;
      #HALF_PERIOD clk = 0;
      if (cycles != 32'h7fffffff)
        cycles = cycles + 1;
      sample;
    end
  end

endmodule
