// SPDX-License-Identifier: Apache-2.0
// A Manager of Managers with a watchdog: a publisher that stops in the middle of a frame holds up neither its group nor
// the host, its frame ends with exactly one abort, the rest of that frame never leaves, and a publisher that keeps up is
// never aborted.
//
// Assumed: the first cycle is a reset, and no other is; a publisher keeps a beat until it is taken, aborts no frame
// itself, and its frames begin with its index. The other beats contain the publisher's index and the number of their
// frame modulo 4: the tree does not look at data, so that what holds for these holds for all.
module tree_watchdog (input clk);

localparam HALF        = `PUBLISHERS / 2;
localparam SOURCE_BITS = $clog2(`PUBLISHERS);
localparam COUNT_BITS  = 2;

wire [7:0]                          m_axis_tdata;
wire                                m_axis_tuser;
wire [15:0]                         m_axis_tid;
wire                                m_axis_tvalid;
wire                                m_axis_tlast;
(* anyseq *) wire                   m_axis_tready;
wire [`PUBLISHERS*8-1:0]            pub_axis_tdata;
(* anyseq *) wire [`PUBLISHERS-1:0] pub_axis_tvalid;
(* anyseq *) wire [`PUBLISHERS-1:0] pub_axis_tlast;
wire [`PUBLISHERS-1:0]              pub_axis_tready;
wire [`PUBLISHERS-1:0]              expired;

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
    .pub_axis_tuser({`PUBLISHERS{1'b0}}),
    .pub_axis_tvalid(pub_axis_tvalid),
    .pub_axis_tlast(pub_axis_tlast),
    .pub_axis_tready(pub_axis_tready),
    .expired(expired));

wire [`PUBLISHERS-1:0] takes = pub_axis_tvalid & pub_axis_tready;

// The host's side: the place in the frame (0: the id's lower byte, 1: its upper byte, 2: the rest), and the frame's
// publisher.
reg  [1:0]             place;
reg  [SOURCE_BITS-1:0] current;
wire [SOURCE_BITS-1:0] publisher_out = place == 0 ? m_axis_tdata[SOURCE_BITS-1:0] : current;
wire                   give          = m_axis_tvalid && m_axis_tready;
wire                   aborts        = m_axis_tvalid && m_axis_tlast && m_axis_tuser;
always @(posedge clk) begin
    if (!rst_n) place <= 0;
    else if (give) begin
        place   <= m_axis_tlast ? 0 : place + (place != 2);
        current <= publisher_out;
    end
end

// With a ready host, cycles on end in which it gets nothing within a frame; and in which a publisher of a group offers a
// beat, none of the group is taken, and the host gets nothing of the other group.
localparam MOST = `WATCHDOG + `WATCHDOG / 2;  // a watchdog's limit is up to half as long again
reg  [3:0] silent;
reg  [3:0] held [1:0];
wire       is_second = publisher_out >= HALF;
always @(posedge clk) silent <= !rst_n || m_axis_tvalid || !m_axis_tready || place == 0 ? 0 : silent + (silent != 15);
genvar side;
generate for (side = 0; side < 2; side = side + 1) begin : groups
    localparam FIRST = side ? HALF : 0;
    localparam SIZE  = side ? `PUBLISHERS - HALF : HALF;
    wire [SIZE-1:0] offers = pub_axis_tvalid[FIRST +: SIZE];
    wire [SIZE-1:0] taken  = takes[FIRST +: SIZE];
    wire            lasts  = m_axis_tready && (!m_axis_tvalid || is_second == side);
    always @(posedge clk)
        held[side] <= !rst_n || !lasts || offers == 0 || taken != 0 ? 0 : held[side] + (held[side] != 15);
end endgenerate

wire [COUNT_BITS-1:0]  expected [`PUBLISHERS-1:0];  // the number of the publisher's next frame at the host
wire [`PUBLISHERS-1:0] has_paused;                  // the publisher was silent in that frame for the watchdog's cycles
wire [1:0]             reported [`PUBLISHERS-1:0];
wire [1:0]             aborted  [`PUBLISHERS-1:0];
genvar index;
generate for (index = 0; index < `PUBLISHERS; index = index + 1) begin : publishers
    reg                    has_begun;
    reg [COUNT_BITS-1:0]   frame;
    reg [COUNT_BITS-1:0]   given;
    reg [2:0]              pause;
    reg [3:0]              paused;  // by the number of the frame
    reg [1:0]              reports;
    reg [1:0]              ends;
    reg                    stalled;
    reg                    before;
    localparam [SOURCE_BITS-1:0] INDEX = index;
    assign pub_axis_tdata[8*index +: 8] = has_begun ? 4 * INDEX + frame : INDEX;
    assign expected[index]   = given;
    assign has_paused[index] = paused[given];
    assign reported[index]   = reports;
    assign aborted[index]    = ends;
    always @(posedge clk) begin
        stalled <= rst_n && pub_axis_tvalid[index] && !pub_axis_tready[index];
        before  <= pub_axis_tlast[index];
        if (!rst_n) begin
            has_begun <= 0;
            frame     <= 0;
            given     <= 0;
            pause     <= 0;
            paused    <= 0;
            reports   <= 0;
            ends      <= 0;
        end else begin
            pause   <= !has_begun || pub_axis_tvalid[index] ? 0 : pause + (pause != 7);
            if (takes[index] && !has_begun) paused[frame] <= 0;
            else if (pause >= `WATCHDOG) paused[frame] <= 1;
            reports <= reports + expired[index];
            if (takes[index]) begin
                has_begun <= !pub_axis_tlast[index];
                frame     <= frame + pub_axis_tlast[index];
            end
            if (give && publisher_out == INDEX && m_axis_tlast) begin
                given <= given + 1'b1;
                ends  <= ends + m_axis_tuser;
            end
        end
    end
    always @* if (running && stalled) assume (pub_axis_tvalid[index] && before == pub_axis_tlast[index]);
end endgenerate

always @* if (running) begin
    frees_the_channel: assert (silent <= MOST);
    // The schedulers take three cycles.
    frees_the_group: assert (held[0] <= MOST + 3 && held[1] <= MOST + 3);

    // Each frame of a publisher is one frame at the host, whole or with an abort as its end, and nothing of it leaves
    // later.
    if (m_axis_tvalid && place == 2 && !aborts)
        abort_ends_one_frame: assert (m_axis_tdata == 4 * publisher_out + expected[publisher_out]);
    // A publisher that keeps up is left alone.
    if (aborts) no_hasty_abort: assert (has_paused[publisher_out]);
    // Each abort is reported, as that of its publisher.
    if (aborts) each_abort_is_reported: assert (reported[publisher_out] != aborted[publisher_out]);
end

endmodule
