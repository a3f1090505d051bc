// SPDX-License-Identifier: Apache-2.0
// What the registers of firm_sched_lru for few requesters mean, for induction.
(* hierconn *) wire           \dut.of_few_u_matrix.started_r ;
(* hierconn *) wire [N*N-1:0] \dut.of_few_u_matrix.longer ;
always @* if (running) begin
    helper_range: assert (grant_select < N && (grant_valid || begun == 0));
    helper_asked: assert ((begun & ~asked) == 0);
    helper_started: assert (begun == (\dut.of_few_u_matrix.started_r ? granted : 0));
end

// Bit j of row i: i has waited longer than j; row 0 lies highest. It is an order: who waits longest is always there.
function longer(input integer i, input integer j);
    longer = \dut.of_few_u_matrix.longer [(N-1-i)*N + j];
endfunction
reg is_order;
integer i, j, k;
always @* begin
    is_order = 1;
    for (i = 0; i < N; i = i + 1)
        for (j = 0; j < N; j = j + 1)
            for (k = 0; k < N; k = k + 1)
                if (longer(i, j) && longer(j, k) && !longer(i, k)) is_order = 0;
    if (running) helper_order: assert (is_order);
end

`ifdef WAITING
// Each task that ended meanwhile is one of a requester that has not waited as long.
reg [INDEX_BITS+1:0] passed;
reg                  grant_is_older;
always @* begin
    passed = 0;
    grant_is_older = 0;
    for (i = 0; i < N; i = i + 1)
        for (j = 0; j < N; j = j + 1)
            if (i == waiting && j != i) begin
                passed = passed + longer(i, j);
                if (j == grant_select) grant_is_older = longer(j, i);
            end
end
always @* if (running && others != 0) begin
    helper_passed: assert (others <= passed);
    helper_older: assert (grant_select == waiting || grant_is_older);
end
`endif
