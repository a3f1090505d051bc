// SPDX-License-Identifier: Apache-2.0
// What the registers of firm_sched_parallel mean, for induction: `idle_bits` and `run_beats`, which whoever includes this names.
always @* if (running) begin
    helper_range: assert (grant_select < N && (grant_valid || begun == 0));
    helper_idle: assert (idle_bits[N-1:0] == ~asked && (begun & ~asked) == 0);
    helper_no_run: assert (grant_valid || run_beats == 0);
    helper_run: assert (run_beats == (run < `SHORTEST_RUN ? run : `SHORTEST_RUN));
end
