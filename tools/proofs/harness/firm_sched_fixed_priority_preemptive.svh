// SPDX-License-Identifier: Apache-2.0
// What the registers of a preemptive firm_sched_fixed_priority mean, for induction.
always @* if (running) begin
    helper_range: assert (grant_select < N && (grant_valid || begun == 0));
    helper_asked: assert ((begun & ~asked) == 0);
end
