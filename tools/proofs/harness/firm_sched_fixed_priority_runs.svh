// SPDX-License-Identifier: Apache-2.0
// What the registers of a preemptive firm_sched_fixed_priority with SHORTEST_RUN of more than one beat mean, for induction.
`include "firm_sched_fixed_priority_preemptive.svh"
(* hierconn *) wire [$clog2(`SHORTEST_RUN+1)-1:0] \dut.whole_runs_beats_r ;
always @* if (running) begin
    helper_no_run: assert (grant_valid || \dut.whole_runs_beats_r == 0);
    helper_run: assert (\dut.whole_runs_beats_r == (run < `SHORTEST_RUN ? run : `SHORTEST_RUN));
end
