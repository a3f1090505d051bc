// SPDX-License-Identifier: Apache-2.0
// No read of a memory meets a write of its address in one cycle, so synthesis need not know what such a read gives. The
// netlist of the memory's entity has the wire `collides` in addition (collisions.py).
//
// Assumed: the first cycle is a reset, and others may follow. A file of the entity's name instantiates it, with inputs
// that the solver chooses; those without influence are left out.
module collisions (input clk);

(* anyseq *) wire chooses_reset;
reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n = !is_first_cycle && !chooses_reset;

`include "helpers.svh"

(* hierconn *) wire \dut.collides ;
always @* if (!is_first_cycle) no_collision: assert (!\dut.collides );

endmodule
