// SPDX-License-Identifier: Apache-2.0
// A preemptive scheduler leaves a task only after SHORTEST_RUN beats in a row, or while the requester pauses. A run that has not
// begun is none.
module scheduler_preemption (input clk);

`include "scheduler_environment.svh"

always @* if (running && moved && begun[grant_select_before] && grant_valid_before && request_before[grant_select_before])
    no_short_run: assert (run_before == 0 || run_before >= `SHORTEST_RUN);

`include "helpers.svh"

endmodule
