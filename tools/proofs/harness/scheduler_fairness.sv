// SPDX-License-Identifier: Apache-2.0
// A fair scheduler: while a requester waits, each of the others ends one task at the most.
`define WAITING
module scheduler_fairness (input clk);

`include "scheduler_environment.svh"

// Any one requester, and how many tasks of others ended while it waited for its next beat.
(* anyconst *) wire [INDEX_BITS-1:0] waiting;
always @* assume (waiting < N);

reg [INDEX_BITS+1:0] others;
always @(posedge clk) begin
    if (!rst_n || !request[waiting] || (beat && grant_select == waiting)) others <= 0;
    else if (finished) others <= others + 1;
end

always @* if (running) after_at_most_all_others: assert (others <= N-1);

`include "helpers.svh"

endmodule
