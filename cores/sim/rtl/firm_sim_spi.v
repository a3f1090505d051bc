// SPDX-License-Identifier: Apache-2.0
// firm_sim_spi.vhd for simulators of Verilog: the host as the master of an SPI link. It repeats three steps: it reads
// the status, writes as many bytes as there is room for, and reads the waiting bytes. If STALL_PERCENT is not 0,
// selections end early at random. Pins change and are read at the falling edge. SEED and STALL_PERCENT can be set at
// the start of the simulator, as in +SEED=7. Simulation only.

`timescale 1ns / 1ps

module firm_sim_spi #(
  // Half a period of spi_sclk, in cycles of clk.
  parameter HALF_CYCLES = 5,
  parameter SEED = 1,
  // The chance that it pauses before a byte, and that it ends a selection within one.
  parameter STALL_PERCENT = 0
) (
  input  wire       clk,
  input  wire       rst_n,

  // Frames of the host.
  input  wire [7:0] s_axis_tdata,
  input  wire       s_axis_tvalid,
  input  wire       s_axis_tlast,
  output wire       s_axis_tready,

  output wire [7:0] m_axis_tdata,
  output wire [0:0] m_axis_tkeep,
  output wire [7:0] m_axis_tid,
  output wire       m_axis_tvalid,
  output wire       m_axis_tlast,
  input  wire       m_axis_tready,

  output reg        spi_sclk,
  output reg        spi_cs_n,
  output reg        spi_mosi,
  input  wire       spi_miso,
  input  wire       spi_irq
);

  wire [7:0] coded_data;
  wire       coded_valid;
  reg        coded_ready;
  reg [7:0]  received_data;
  reg        received_valid;

  integer    seed, stall_percent;
  reg [31:0] random;
  reg        is_happening;

  reg [7:0]  answer, unsent;
  reg        has_unsent;  // `unsent` was taken from the host, and not written yet
  reg [31:0] status;
  integer    room, waiting, place, number;
  reg        is_open, is_over;

  initial begin
    seed          = SEED;
    stall_percent = STALL_PERCENT;
    if (!$value$plusargs("SEED=%d", seed))
      seed = SEED;
    if (!$value$plusargs("STALL_PERCENT=%d", stall_percent))
      stall_percent = STALL_PERCENT;
    random = seed + 13;
  end

  task draw;
    begin
      random       = random * 32'd1664525 + 32'd1013904223;
      is_happening = random[31:8] % 100 < stall_percent;
    end
  endtask

  task wait_halves(input integer halves);
    repeat (halves * HALF_CYCLES) @(negedge clk);
  endtask

  task send_bits(input [7:0] data, input integer bits);
    for (place = 7; place >= 8 - bits; place = place - 1) begin
      spi_mosi = data[place];
      wait_halves(1);
      spi_sclk      = 1;
      answer[place]  = spi_miso;
      wait_halves(1);
      spi_sclk = 0;
    end
  endtask

  task begin_selection(input [7:0] command);
    begin
      spi_cs_n = 0;
      wait_halves(2);
      send_bits(command, 8);
      if (answer[7:1] !== 7'b1000000)
        $fatal(1, "firm_sim_spi: the answer to a command begins with an unknown byte, or bytes were dropped");
    end
  endtask

  task end_selection;
    begin
      wait_halves(1);
      spi_cs_n = 1;
      spi_mosi = 1'bx;
      wait_halves(4);
    end
  endtask

  task ask_status;
    begin
      begin_selection(8'h00);
      for (number = 0; number < 4; number = number + 1) begin
        send_bits(8'hff, 8);
        status[8*number +: 8] = answer;
      end
      room    = status[15:0];
      waiting = status[31:16];
      end_selection;
    end
  endtask

  task take_byte;
    begin
      unsent      = coded_data;
      has_unsent  = 1;
      coded_ready = 1;
      @(negedge clk);
      coded_ready = 0;
    end
  endtask

  task write_byte;
    begin
      draw;
      if (is_happening) begin
        draw;
        repeat (random[31:8] % (40 * HALF_CYCLES)) @(negedge clk);
      end
      draw;
      is_over = is_happening;
      // A byte that is not clocked to its end is ignored.
      send_bits(unsent, is_over ? 5 : 8);
      has_unsent = is_over;
      room       = room - 1;
    end
  endtask

  task write_bytes;
    begin
      begin_selection(8'h01);
      is_over = 0;
      while (room > 0 && !is_over) begin
        if (!has_unsent && coded_valid === 1'b1)
          take_byte;
        if (has_unsent)
          write_byte;
        else
          is_over = 1;
      end
      end_selection;
    end
  endtask

  task read_byte;
    begin
      draw;
      is_over = is_happening;
      send_bits(8'hff, is_over ? 3 : 8);
      if (!is_over) begin
        received_data  = answer;
        received_valid = 1;
        @(negedge clk);
        received_valid = 0;
        waiting = waiting - 1;
      end
    end
  endtask

  task read_bytes;
    begin
      begin_selection(8'h02);
      is_over = 0;
      while (waiting > 0 && !is_over)
        read_byte;
      end_selection;
    end
  endtask

  task open_line;
    begin
      @(negedge clk);
      while (rst_n !== 1'b1) @(negedge clk);
      wait_halves(8);
      begin_selection(8'h03);
      end_selection;
      is_open = 1;
    end
  endtask

  initial begin
    coded_ready    = 0;
    received_valid = 0;
    has_unsent     = 0;
    is_open        = 0;
    spi_cs_n       = 1;
    spi_sclk       = 0;
  end

  always begin : master
    if (!is_open)
      open_line;
    while (coded_valid !== 1'b1 && !has_unsent && spi_irq === 1'b0) @(negedge clk);
    ask_status;
    if ((coded_valid === 1'b1 || has_unsent) && room > 0)
      write_bytes;
    if (waiting > 0)
      read_bytes;
  end

  firm_sim_link u_link (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata(s_axis_tdata),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .s_axis_tready(s_axis_tready),
    .m_axis_tdata(m_axis_tdata),
    .m_axis_tkeep(m_axis_tkeep),
    .m_axis_tid(m_axis_tid),
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .m_axis_tready(m_axis_tready),
    .coded_data(coded_data),
    .coded_valid(coded_valid),
    .coded_ready(coded_ready),
    .received_data(received_data),
    .received_valid(received_valid)
  );

endmodule
