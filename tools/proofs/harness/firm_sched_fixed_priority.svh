// SPDX-License-Identifier: Apache-2.0
// What the registers of a non-preemptive firm_sched_fixed_priority mean, for induction.
(* hierconn *) wire \dut.whole_tasks_started_r ;
always @* if (running) begin
    helper_range: assert (grant_select < N && (grant_valid || begun == 0));
    helper_asked: assert ((begun & ~asked) == 0);
    helper_started: assert (begun == (\dut.whole_tasks_started_r ? granted : 0));
end
