// SPDX-License-Identifier: Apache-2.0
// firm_sim_uart.vhd for simulators of Verilog: the host with its serial adapter. It sends as an adapter does: with
// pauses, and up to LAG bytes more after the other side's `rts_n` has risen. It opens the line with a break, as the
// host's software should. Pins change and are read at the falling edge. SEED and STALL_PERCENT can be set at the start
// of the simulator, as in +SEED=7. Simulation only.

`timescale 1ns / 1ps

module firm_sim_uart #(
  // Cycles of clk in which the line carries a bit; at least 4.
  parameter BIT_CYCLES = 10,
  parameter SEED = 1,
  // The chance that it pauses before a byte, and that it accepts none (`uart_cts_n`).
  parameter STALL_PERCENT = 0,
  parameter LAG = 16
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

  // The names of the hardware: its `uart_rxd` is the output of the host.
  output reg        uart_rxd,
  input  wire       uart_txd,
  input  wire       uart_rts_n,
  output reg        uart_cts_n
);

  wire [7:0] coded_data;
  wire       coded_valid;
  reg        coded_ready;
  reg [7:0]  received_data;
  reg        received_valid;

  integer    seed, stall_percent;
  reg [31:0] sending_random, wanting_random;

  initial begin
    seed          = SEED;
    stall_percent = STALL_PERCENT;
    if (!$value$plusargs("SEED=%d", seed))
      seed = SEED;
    if (!$value$plusargs("STALL_PERCENT=%d", stall_percent))
      stall_percent = STALL_PERCENT;
    sending_random = seed;
    wanting_random = seed + 11;
  end

  function [31:0] next_random(input [31:0] random);
    next_random = random * 32'd1664525 + 32'd1013904223;
  endfunction

  // ------------------------------------------------------------------ to the system

  reg       is_open;
  reg [7:0] sent;
  integer   lag_left, sent_bit;

  task wait_bits(input integer number);
    repeat (number * BIT_CYCLES) @(negedge clk);
  endtask

  task send_bit(input level);
    begin
      uart_rxd = level;
      wait_bits(1);
    end
  endtask

  task wait_for_leave;
    begin
      sending_random = next_random(sending_random);
      if (uart_rts_n === 1'b0)
        lag_left = sending_random[31:8] % (LAG + 1);
      else if (lag_left > 0)
        lag_left = lag_left - 1;
      else
        while (uart_rts_n !== 1'b0) @(negedge clk);
    end
  endtask

  task take_byte;
    begin
      while (coded_valid !== 1'b1) @(negedge clk);
      sent        = coded_data;
      coded_ready = 1;
      @(negedge clk);
      coded_ready = 0;
    end
  endtask

  task pause;
    begin
      sending_random = next_random(sending_random);
      if (sending_random[31:8] % 100 < stall_percent) begin
        sending_random = next_random(sending_random);
        repeat (sending_random[31:8] % (30 * BIT_CYCLES)) @(negedge clk);
      end
    end
  endtask

  task open_line;
    begin
      @(negedge clk);
      while (rst_n !== 1'b1) @(negedge clk);
      wait_bits(4);
      uart_rxd = 0;
      wait_bits(12);
      send_bit(1);
      is_open = 1;
    end
  endtask

  initial begin
    coded_ready = 0;
    uart_rxd    = 1;
    lag_left    = 0;
    is_open     = 0;
  end

  always begin : send
    if (!is_open)
      open_line;
    wait_for_leave;
    take_byte;
    pause;
    send_bit(0);
    for (sent_bit = 0; sent_bit < 8; sent_bit = sent_bit + 1)
      send_bit(sent[sent_bit]);
    send_bit(1);
  end

  // ------------------------------------------------------------------ from the system

  reg     was_high;
  integer received_bit;

  initial begin
    received_valid = 0;
    was_high       = 0;
  end

  always begin : receive
    @(negedge clk);
    received_valid = 0;
    if (was_high === 1'b1 && uart_txd === 1'b0)
      receive_byte;
    was_high = uart_txd;
  end

  task receive_byte;
    begin
      repeat (BIT_CYCLES / 2) @(negedge clk);
      if (uart_txd !== 1'b0)
        $fatal(1, "firm_sim_uart: a start bit is too short");
      for (received_bit = 0; received_bit < 8; received_bit = received_bit + 1) begin
        wait_received_bit;
        received_data[received_bit] = uart_txd;
      end
      wait_received_bit;
      if (uart_txd !== 1'b1)
        $fatal(1, "firm_sim_uart: a stop bit is low");
      received_valid = 1;
    end
  endtask

  // A task has one set of arguments for all its callers, so the two directions do not share one.
  task wait_received_bit;
    repeat (BIT_CYCLES) @(negedge clk);
  endtask

  always @(posedge clk) begin
    wanting_random = next_random(wanting_random);
    uart_cts_n <= wanting_random[31:8] % 100 < stall_percent;
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
