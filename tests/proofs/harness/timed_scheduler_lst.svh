// SPDX-License-Identifier: Apache-2.0
// What the registers of firm_sched_parallel in firm_sched_lst mean, for induction.
(* hierconn *) wire [(1<<INDEX_BITS)-1:0] \dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.known_r ;
(* hierconn *) wire [$clog2(`SHORTEST_RUN+1)-1:0] \dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.longer_runs_beats_r ;
always @* if (running) begin
    helper_range: assert (grant_select < N && (grant_valid || begun == 0));
    helper_known: assert (\dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.known_r == asked && (begun & ~asked) == 0);
    helper_no_run: assert (grant_valid || \dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.longer_runs_beats_r == 0);
    helper_run: assert (\dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.longer_runs_beats_r == (run < `SHORTEST_RUN ? run : `SHORTEST_RUN));
end
