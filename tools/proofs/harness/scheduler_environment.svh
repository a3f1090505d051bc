// SPDX-License-Identifier: Apache-2.0
// A scheduler (`DUT) and what may happen around it; to be included in a harness.
//
// All inputs are free (`anyseq`: the solver chooses them anew in each cycle) but for these assumptions, which docs/reference/manager.md makes of the Manager and AXI-Stream of the publishers:
// * the first cycle is a reset; others may follow at any time;
// * a request stays until a beat of its requester is taken;
// * a beat is taken if and only if the granted one requests and the sink is ready.

localparam N = `REQUESTERS;
localparam INDEX_BITS = N > 2 ? $clog2(N) : 1;

(* anyseq *) wire         rst_n;
(* anyseq *) wire [N-1:0] request;
(* anyseq *) wire         ready;
(* anyseq *) wire         last;

wire                  grant_valid;
wire [INDEX_BITS-1:0] grant_select;
wire                  beat = grant_valid && request[grant_select] && ready;
wire                  finished = beat && last;

`DUT dut (
    .clk(clk),
    .rst_n(rst_n),
    .request(request),
    .beat(beat),
    .last(last),
    .grant_valid(grant_valid),
    .grant_select(grant_select));

// What was in the cycle before; `running` says that it was no reset.
reg                  running = 0;
reg [N-1:0]          request_before;
reg                  beat_before;
reg                  finished_before;
reg                  grant_valid_before;
reg [INDEX_BITS-1:0] grant_select_before;
always @(posedge clk) begin
    running             <= rst_n;
    request_before      <= request;
    beat_before         <= beat;
    finished_before     <= finished;
    grant_valid_before  <= grant_valid;
    grant_select_before <= grant_select;
end

// Before the first cycle there was none.
reg is_first = 1;
always @(posedge clk) is_first <= 0;
always @* if (is_first) assume (!rst_n);

wire [N-1:0] taken_before = beat_before << grant_select_before;
always @* if (running) assume ((request_before & ~taken_before & ~request) == 0);

// Each requester: has it asked for the task that it has, and has it had a beat of it?
reg [N-1:0] asked;
reg [N-1:0] begun;
wire [N-1:0] granted = 1'b1 << grant_select;
always @(posedge clk) begin
    if (!rst_n) begin
        asked <= 0;
        begun <= 0;
    end else begin
        asked <= (asked | request) & ~(finished ? granted : 0);
        if (beat) begun <= last ? begun & ~granted : begun | granted;
    end
end

// The grant has come to somebody in this cycle.
wire moved = grant_valid && (!grant_valid_before || grant_select != grant_select_before);

// Beats that the granted one has had in a row, of this task: up to the cycle before, and up to this one.
reg  [3:0] run_before;
wire [3:0] run = moved || finished_before ? 0 : run_before;
always @(posedge clk) run_before <= !rst_n ? 0 : run + (beat && run != 15);

// Requests that the cycle before could answer: not the one that came with a task's last beat.
wire [N-1:0] granted_before  = grant_valid_before << grant_select_before;
wire [N-1:0] eligible_before = request_before & ~(finished_before ? granted_before : 0);

// Who has asked and has not begun still asks: for induction.
always @* if (running) helper_still_asks: assert ((asked & ~begun & ~request) == 0);
