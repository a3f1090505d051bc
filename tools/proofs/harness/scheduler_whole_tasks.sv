// SPDX-License-Identifier: Apache-2.0
// A scheduler that does not preempt leaves no task that has begun.
module scheduler_whole_tasks (input clk);

`include "scheduler_environment.svh"

always @* if (running) begin
    if (begun[grant_select_before]) whole_tasks: assert (grant_valid && grant_select == grant_select_before);

    // So nobody is in the middle of a task when the grant comes, and the request that it answers is still there.
    if (moved) only_to_who_has_not_begun: assert (!begun[grant_select]);
    if (moved) request_is_still_there: assert (request[grant_select]);
end

`include "helpers.svh"

endmodule
