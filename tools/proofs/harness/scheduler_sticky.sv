// SPDX-License-Identifier: Apache-2.0
// A sticky grant: once somebody has it, somebody always has, if need be one that has nothing to send. So who sends alone
// sends task after task without a gap.
module scheduler_sticky (input clk);

`include "scheduler_environment.svh"

always @* if (running && grant_valid_before) grant_stays_valid: assert (grant_valid);

`include "helpers.svh"

endmodule
