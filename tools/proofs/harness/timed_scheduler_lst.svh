// SPDX-License-Identifier: Apache-2.0
// Where the registers of firm_sched_lst are, for few requesters.
(* hierconn *) wire [(1<<INDEX_BITS)-1:0] \dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.idle_r ;
(* hierconn *) wire [$clog2(`SHORTEST_RUN+1)-1:0] \dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.longer_runs_beats_r ;
wire [(1<<INDEX_BITS)-1:0] idle_bits = \dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.idle_r ;
wire [$clog2(`SHORTEST_RUN+1)-1:0] run_beats = \dut.u_scheduler.of_lst_u_scheduler.of_few_u_parallel.longer_runs_beats_r ;
`include "timed_scheduler_parallel.svh"
