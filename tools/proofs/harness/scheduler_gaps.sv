// SPDX-License-Identifier: Apache-2.0
// Ready requesters follow each other without a gap: a task's last beat and the next one's first are in successive cycles.
module scheduler_gaps (input clk);

`include "scheduler_environment.svh"

// The next task may be one that has begun and pauses.
wire pausing = `WAITS_FOR_PAUSES && grant_valid && begun[grant_select] && !request[grant_select];

// When a task ended, another requester was waiting: since that cycle or, of a scheduler that takes its time, longer.
reg [N-1:0] eligible_earlier;
always @(posedge clk) eligible_earlier <= running ? eligible_before : 0;
wire was_awaited = finished_before && (eligible_before & (`LATENCY > 1 ? eligible_earlier : {N{1'b1}})) != 0;

always @* if (running && was_awaited && ready && !pausing) no_gap_between_tasks: assert (beat);

`include "helpers.svh"

endmodule
