// SPDX-License-Identifier: Apache-2.0
// Publishers and the host's side of them; to be included behind manager_environment.svh.
//
// Assumed: a publisher's frame begins with its own id, which is its index; no beat is empty.

(* anyseq *) wire mark;

wire [PAYLOAD_BITS-1:0]    m_beat = {m_axis_tlast, m_axis_tuser, m_axis_tkeep, m_axis_tdata};
wire                       give   = m_axis_tvalid && m_axis_tready;
reg                        m_stalled;
reg [PAYLOAD_BITS+8-1:0]   m_before;
always @(posedge clk) begin
    m_stalled <= m_axis_tvalid && !m_axis_tready;
    m_before  <= {m_axis_tid, m_beat};
end

wire [`PUBLISHERS-1:0]     takes   = pub_axis_tvalid & pub_axis_tready;
wire                       take    = takes != 0;
wire [`PUBLISHERS-1:0]     granted = sched_grant_valid << sched_grant_select;
wire [7:0]                 source  = sched_grant_select;
wire [PAYLOAD_BITS-1:0]    p_beat  = {
    pub_axis_tlast[sched_grant_select],
    pub_axis_tuser[sched_grant_select],
    pub_axis_tkeep[sched_grant_select*(`WIDTH/8) +: `WIDTH/8],
    pub_axis_tdata[sched_grant_select*`WIDTH +: `WIDTH]};
wire                       p_last  = p_beat[PAYLOAD_BITS-1];

// Publishers whose frame has begun and is not over.
reg [`PUBLISHERS-1:0] begun;
always @(posedge clk) begin
    if (!rst_n) begun <= 0;
    else if (take) begun <= p_last ? begun & ~granted : begun | granted;
end

generate for (publisher = 0; publisher < `PUBLISHERS; publisher = publisher + 1) begin : ids
    always @* if (pub_axis_tvalid[publisher] && !begun[publisher])
        assume (pub_axis_tdata[publisher*`WIDTH +: 8] == publisher);
    always @* if (pub_axis_tvalid[publisher]) assume (pub_axis_tkeep[publisher*(`WIDTH/8)]);
end endgenerate

// What holds whatever the scheduler does.
always @* if (running) begin
    // AXI-Stream: what is offered to the host stays, and stays as it is, until it is taken.
    if (m_stalled) m_valid_stays: assert (m_axis_tvalid);
    if (m_stalled) m_payload_stays: assert ({m_axis_tid, m_beat} == m_before);

    // Nobody is ready but whom the scheduler grants.
    only_the_granted_one_is_taken: assert ((pub_axis_tready & ~granted) == 0);

    // The scheduler sees each request, each beat, and which is the last.
    scheduler_sees_requests: assert (sched_request == pub_axis_tvalid);
    scheduler_sees_beats: assert (sched_beat == take);
    if (take) scheduler_sees_last: assert (sched_last == p_last);
end
