// SPDX-License-Identifier: Apache-2.0
// The surroundings of a Manager of Managers with a watchdog, within the module of its harness.
//
// Assumed: the first cycle is a reset, and no other is; a publisher keeps a beat until it is taken, aborts no frame
// itself, and its frames begin with its index. The other beats contain the publisher's index, the number of their frame
// modulo 4, and whether they are the last: the tree does not look at data, so that what holds for these holds for all.
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
wire [7:0]             high_out      = publisher_out >= HALF;
wire                   give          = m_axis_tvalid && m_axis_tready;
wire                   aborts        = m_axis_tvalid && m_axis_tlast && m_axis_tuser;
always @(posedge clk) begin
    if (!rst_n) place <= 0;
    else if (give) begin
        place   <= m_axis_tlast ? 0 : place + (place != 2);
        current <= publisher_out;
    end
end

// What publishers send: whether the frame of each has begun, and its number.
wire [`PUBLISHERS-1:0] has_begun;
wire [COUNT_BITS-1:0]  sent [`PUBLISHERS-1:0];
genvar number;
generate for (number = 0; number < `PUBLISHERS; number = number + 1) begin : sources
    reg                  inside;
    reg [COUNT_BITS-1:0] frame;
    reg                  stalled;
    reg                  before;
    localparam [SOURCE_BITS-1:0] INDEX = number;
    assign pub_axis_tdata[8*number +: 8] = inside ? 128 + 64 * pub_axis_tlast[number] + 4 * INDEX + frame : INDEX;
    assign has_begun[number] = inside;
    assign sent[number]      = frame;
    always @(posedge clk) begin
        stalled <= rst_n && pub_axis_tvalid[number] && !pub_axis_tready[number];
        before  <= pub_axis_tlast[number];
        if (!rst_n) begin
            inside <= 0;
            frame  <= 0;
        end else if (takes[number]) begin
            inside <= !pub_axis_tlast[number];
            frame  <= frame + pub_axis_tlast[number];
        end
    end
    always @* if (running && stalled) assume (pub_axis_tvalid[number] && before == pub_axis_tlast[number]);
end endgenerate
