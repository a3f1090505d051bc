// SPDX-License-Identifier: Apache-2.0
// firm_sim_clock.vhd for simulators of Verilog: a clock of the same average period, with the same phase and deviation
// for the same SEED, whose edges are rounded to picoseconds. It ends with the simulation. SEED can be set at the start
// of the simulator, as in +SEED=7, like that of the host. Simulation only.

// As in the test bench: Verilator 5.006 counts the delays of all modules in the unit of the top.
`timescale 1ns / 1ps

module firm_sim_clock #(
  // Period in picoseconds, 2 and more.
  parameter PERIOD_PS = 10000,
  // Different for each clock of a simulation, 1 to 999.
  parameter NUMBER = 1,
  // The seed of the simulation; it and NUMBER determine phase and deviation.
  parameter SEED = 1
) (
  output reg clk
);

  localparam DRIFT = 0.001;

  integer seed, random_1, random_2;
  real    draw;     // the last random number, from 0 to 1
  real    half;     // the half period, and the time of the next edge, in nanoseconds
  real    next;

  // math_real.uniform of VHDL, by L'Ecuyer.
  task draw_number;
    integer step;
    begin
      step     = random_1 / 53668;
      random_1 = 40014 * (random_1 - step * 53668) - step * 12211;
      if (random_1 < 0)
        random_1 = random_1 + 2147483563;
      step     = random_2 / 52774;
      random_2 = 40692 * (random_2 - step * 52774) - step * 3791;
      if (random_2 < 0)
        random_2 = random_2 + 2147483399;
      step = random_1 - random_2;
      if (step < 1)
        step = step + 2147483562;
      draw = step * 4.656613e-10;
    end
  endtask

  initial begin
    if (PERIOD_PS < 2)
      $fatal(1, "firm_sim_clock: PERIOD_PS is %0d; legal: 2 or more", PERIOD_PS);
    if (NUMBER < 1 || NUMBER > 999)
      $fatal(1, "firm_sim_clock: NUMBER is %0d; legal: 1 to 999", NUMBER);
    if (!$value$plusargs("SEED=%d", seed))
      seed = SEED;
    random_1 = NUMBER + 1000 * (seed % 1000003);
    random_2 = 3;
    draw_number;  // neighbouring seeds give similar first numbers
    draw_number;
    half = 0.0005 * PERIOD_PS * (1.0 + DRIFT * (2.0 * draw - 1.0));
    draw_number;
    next = 0.001 * draw * PERIOD_PS;
    clk  = 0;
    forever begin
      #(next - $realtime) clk = !clk;
      next = next + half;
    end
  end

endmodule
