// SPDX-License-Identifier: Apache-2.0
// Fixed priority: whenever a scheduler may choose, the grant is the lowest index of those that ask.
module scheduler_priority (input clk);

`include "scheduler_environment.svh"

// It may not leave a task that has begun or, if it preempts, a run that is too short while the requester goes on.
wire in_short_run = run_before != 0 && run_before < `SHORTEST_RUN && !finished_before && request_before[grant_select_before];
wire was_free     = `IS_PREEMPTIVE ? !in_short_run : !begun[grant_select_before];

always @* if (running && was_free && eligible_before != 0)
    lowest_index_first: assert ((granted & eligible_before) != 0 && (eligible_before & (granted - 1'b1)) == 0);

`include "helpers.svh"

endmodule
