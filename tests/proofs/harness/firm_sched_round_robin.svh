// SPDX-License-Identifier: Apache-2.0
// What the registers of firm_sched_round_robin mean, for induction.
(* hierconn *) wire                  \dut.started_r ;
(* hierconn *) wire [INDEX_BITS-1:0] \dut.served_r ;
always @* if (running) begin
    helper_range: assert (grant_select < N && (grant_valid || begun == 0));
    helper_asked: assert ((begun & ~asked) == 0);
    helper_started: assert (begun == (\dut.started_r ? granted : 0));
    helper_served: assert (!\dut.started_r || \dut.served_r == grant_select);
end

`ifdef WAITING
// The round goes from who was served last to the one that waits: who is further on in it has fewer ahead of it.
function [INDEX_BITS:0] steps_from(input [INDEX_BITS-1:0] index);
    steps_from = waiting >= index ? waiting - index : waiting + N - index;
endfunction
always @* if (running && others != 0) begin
    helper_round: assert (\dut.served_r != waiting && \dut.served_r < N);
    helper_ahead: assert (others + steps_from(\dut.served_r ) + \dut.started_r <= N);
    helper_next: assert (\dut.started_r || grant_select == waiting || steps_from(grant_select) < steps_from(\dut.served_r ));
end
`endif
