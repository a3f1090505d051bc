// SPDX-License-Identifier: Apache-2.0
// Whom a scheduler grants: one at a time, and only who has asked.
// A grant is sticky: it stays with whom has nothing more to send until somebody else asks. So it is each of its moves, not the
// grant itself, that a request must go ahead of.
module scheduler_grants (input clk);

`include "scheduler_environment.svh"

always @* if (running) begin
    // The grant is one index, so there is at most one; it is the index of a requester.
    if (grant_valid) at_most_one_grant: assert (grant_select < N);

    // Nothing is granted before somebody asks.
    if (!grant_valid_before && request_before == 0) no_grant_unasked: assert (!grant_valid || asked != 0);

    // It moves only to a requester that has asked and was not served since.
    if (moved) only_to_a_requester: assert (asked[grant_select]);
end

`include "helpers.svh"

endmodule
