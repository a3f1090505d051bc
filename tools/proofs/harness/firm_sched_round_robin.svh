// SPDX-License-Identifier: Apache-2.0
// What the registers of firm_sched_round_robin mean, for induction.
(* hierconn *) wire \dut.started_r ;
always @* if (running) begin
    helper_range: assert (grant_valid ? grant_select < N : begun == 0);
    helper_asked: assert ((begun & ~asked) == 0);
    helper_started: assert (begun == (\dut.started_r ? granted : 0));
end

`ifdef WAITING
// The round goes from who has the grant to the one that waits: who is further on in it has fewer ahead of it.
wire [INDEX_BITS:0] ahead = waiting >= grant_select ? waiting - grant_select : waiting + N - grant_select;
always @* if (running && others != 0) begin
    helper_granted: assert (grant_valid);
    helper_ahead: assert (others + ahead <= N-1);
end
`endif
