// SPDX-License-Identifier: Apache-2.0
// What the scheduler's registers mean, for induction.
(* hierconn *) wire \dut.started_r ;
always @* if (running) begin
    helper_started: assert (begun == (\dut.started_r ? granted : 0));
    helper_range: assert (grant_select < N);
    helper_asked: assert ((begun & ~asked) == 0);
    helper_valid: assert (grant_valid || begun == 0);
end
