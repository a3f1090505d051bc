// SPDX-License-Identifier: Apache-2.0
// A Manager of Managers, to the host: every publisher's beats come out once, in order, whole frames with ids of two
// bytes, and one publisher of a group is granted at a time.
//
// Assumed: the first cycle is a reset, and no other is; a publisher keeps a beat until it is taken; its frames begin
// with its index. The other beats contain the publisher's index and their number among all of its beats: the tree does
// not look at data, so that what holds for these holds for all.
module manager_tree (input clk);

localparam HALF        = `PUBLISHERS / 2;
localparam SOURCE_BITS = $clog2(`PUBLISHERS);
localparam COUNT_BITS  = 8 - SOURCE_BITS;

wire [7:0]                          m_axis_tdata;
wire                                m_axis_tuser;
wire [15:0]                         m_axis_tid;
wire                                m_axis_tvalid;
wire                                m_axis_tlast;
(* anyseq *) wire                   m_axis_tready;
wire [`PUBLISHERS*8-1:0]            pub_axis_tdata;
(* anyseq *) wire [`PUBLISHERS-1:0] pub_axis_tuser;
(* anyseq *) wire [`PUBLISHERS-1:0] pub_axis_tvalid;
(* anyseq *) wire [`PUBLISHERS-1:0] pub_axis_tlast;
wire [`PUBLISHERS-1:0]              pub_axis_tready;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

small_tree dut (
    .clk(clk),
    .rst_n(rst_n),
    .m_axis_tdata(m_axis_tdata),
    .m_axis_tuser(m_axis_tuser),
    .m_axis_tid(m_axis_tid),
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .m_axis_tready(m_axis_tready),
    .pub_axis_tdata(pub_axis_tdata),
    .pub_axis_tuser(pub_axis_tuser),
    .pub_axis_tvalid(pub_axis_tvalid),
    .pub_axis_tlast(pub_axis_tlast),
    .pub_axis_tready(pub_axis_tready));

wire [`PUBLISHERS-1:0] takes = pub_axis_tvalid & pub_axis_tready;

// The host's side: the place in the frame (0: the id's lower byte, 1: its upper byte, 2: the rest), and the frame's
// publisher.
reg  [1:0]             place;
reg  [SOURCE_BITS-1:0] current;
wire [SOURCE_BITS-1:0] publisher_out = place == 0 ? m_axis_tdata[SOURCE_BITS-1:0] : current;
wire [7:0]             high_out      = publisher_out >= HALF;
wire                   give          = m_axis_tvalid && m_axis_tready;
reg                    m_stalled;
reg  [25:0]            m_before;
wire [25:0]            m_now = {m_axis_tlast, m_axis_tuser, m_axis_tid, m_axis_tdata};
always @(posedge clk) begin
    m_stalled <= rst_n && m_axis_tvalid && !m_axis_tready;
    m_before  <= m_now;
    if (!rst_n) place <= 0;
    else if (give) begin
        place   <= m_axis_tlast ? 0 : place + (place != 2);
        current <= publisher_out;
    end
end

// Cycles on end in which nothing is offered to the host, although beats that may follow next are inside: those of the
// frame that has begun there or, between frames, any.
reg  [2:0]             mute;
wire [`PUBLISHERS-1:0] is_all_out;  // no beat of the publisher is inside
wire                   is_due = place == 0 ? !(&is_all_out) : !is_all_out[current];
always @(posedge clk) mute <= !rst_n || m_axis_tvalid || !is_due ? 0 : mute + (mute != 7);

wire [COUNT_BITS-1:0]  expected [`PUBLISHERS-1:0];  // the number of the publisher's next beat at the host
genvar index;
generate for (index = 0; index < `PUBLISHERS; index = index + 1) begin : publishers
    reg                    has_begun;
    reg [COUNT_BITS-1:0]   taken;    // beats after the first ones of frames
    reg [COUNT_BITS-1:0]   given;
    reg [2:0]              started;  // frames taken, and frames at the host
    reg [2:0]              arrived;
    reg                    stalled;
    reg [1:0]              before;
    localparam [SOURCE_BITS-1:0] INDEX = index;
    assign pub_axis_tdata[8*index +: 8] = has_begun ? {INDEX, taken} : INDEX;
    assign expected[index]   = given;
    assign is_all_out[index] = taken == given && started == arrived;
    always @(posedge clk) begin
        stalled <= rst_n && pub_axis_tvalid[index] && !pub_axis_tready[index];
        before  <= {pub_axis_tlast[index], pub_axis_tuser[index]};
        if (!rst_n) begin
            has_begun <= 0;
            taken     <= 0;
            given     <= 0;
            started   <= 0;
            arrived   <= 0;
        end else begin
            if (takes[index]) begin
                has_begun <= !pub_axis_tlast[index];
                taken     <= taken + has_begun;
                started   <= started + !has_begun;
            end
            if (give && publisher_out == INDEX) begin
                given   <= given + (place == 2);
                arrived <= arrived + (place == 0);
            end
        end
    end
    always @* if (running && stalled)
        assume (pub_axis_tvalid[index] && before == {pub_axis_tlast[index], pub_axis_tuser[index]});
    always @* assume (!pub_axis_tuser[index] || pub_axis_tlast[index]);
end endgenerate

always @* if (running) begin
    valid_stays: assert (!m_stalled || m_axis_tvalid);
    payload_stays: assert (!m_stalled || m_now == m_before);

    // At most one publisher of a group is ready.
    one_grant_in_a_group: assert (
        (pub_axis_tready[HALF-1:0] & (pub_axis_tready[HALF-1:0] - 1'b1)) == 0 &&
        (pub_axis_tready[`PUBLISHERS-1:HALF] & (pub_axis_tready[`PUBLISHERS-1:HALF] - 1'b1)) == 0);

    if (m_axis_tvalid) begin
        // A frame begins with the id of two bytes, which `tid` repeats.
        if (place == 0) begins_with_its_id: assert (m_axis_tdata < `PUBLISHERS && !m_axis_tlast);
        if (place == 1) upper_byte_is_inserted: assert (m_axis_tdata == high_out);
        tid_is_the_id: assert (m_axis_tid == {high_out, 8'b0} + publisher_out);
        // Then come the beats of this publisher, each once and in order.
        if (place == 2) in_order_without_loss: assert (m_axis_tdata == {publisher_out, expected[publisher_out]});
        // An abort is on a last beat.
        abort_ends_a_frame: assert (!m_axis_tuser || m_axis_tlast);
    end
    // No beat stays inside.
    all_comes_out: assert (mute <= 4);
end

endmodule
