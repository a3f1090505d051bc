// SPDX-License-Identifier: Apache-2.0
// The Manager and what may happen around it; to be included in a harness.
//
// All inputs are free (`anyseq`: the solver chooses them anew in each cycle) but for these assumptions:
// * the first cycle is a reset; others may follow at any time;
// * the host and the publishers keep a beat as it is until it is taken, as AXI-Stream asks;
// * `tuser`, which aborts a frame, is high on a last beat only.
// The scheduler may grant any publisher, or none, in each cycle, unless a harness says more.

// A beat: `tlast` highest, then `tuser`, `tkeep` and `tdata`.
localparam PAYLOAD_BITS = `WIDTH + `WIDTH/8 + 2;
localparam ABORT_BIT    = PAYLOAD_BITS - 2;

(* anyseq *) wire                              rst_n;
(* anyseq *) wire [`WIDTH-1:0]                 s_axis_tdata;
(* anyseq *) wire [`WIDTH/8-1:0]               s_axis_tkeep;
(* anyseq *) wire                              s_axis_tuser;
(* anyseq *) wire                              s_axis_tvalid;
(* anyseq *) wire                              s_axis_tlast;
wire                                           s_axis_tready;

wire [`WIDTH-1:0]                              m_axis_tdata;
wire [`WIDTH/8-1:0]                            m_axis_tkeep;
wire                                           m_axis_tuser;
wire [7:0]                                     m_axis_tid;
wire                                           m_axis_tvalid;
wire                                           m_axis_tlast;
(* anyseq *) wire                              m_axis_tready;

wire [`WIDTH-1:0]                              sub_axis_tdata;
wire [`WIDTH/8-1:0]                            sub_axis_tkeep;
wire                                           sub_axis_tuser;
wire                                           sub_axis_tlast;
wire [`SUBSCRIBERS-1:0]                        sub_axis_tvalid;
(* anyseq *) wire [`SUBSCRIBERS-1:0]           sub_axis_tready;

(* anyseq *) wire [`PUBLISHERS*`WIDTH-1:0]     pub_axis_tdata;
(* anyseq *) wire [`PUBLISHERS*(`WIDTH/8)-1:0] pub_axis_tkeep;
(* anyseq *) wire [`PUBLISHERS-1:0]            pub_axis_tuser;
(* anyseq *) wire [`PUBLISHERS-1:0]            pub_axis_tvalid;
(* anyseq *) wire [`PUBLISHERS-1:0]            pub_axis_tlast;
wire [`PUBLISHERS-1:0]                         pub_axis_tready;

wire [`PUBLISHERS-1:0]                         sched_request;
wire                                           sched_beat;
wire                                           sched_last;
(* anyseq *) wire                              sched_grant_valid;
(* anyseq *) wire [$clog2(`PUBLISHERS)-1:0]    sched_grant_select;

wire                                           id_error;

firm_manager dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata(s_axis_tdata),
    .s_axis_tkeep(s_axis_tkeep),
    .s_axis_tuser(s_axis_tuser),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .s_axis_tready(s_axis_tready),
    .m_axis_tdata(m_axis_tdata),
    .m_axis_tkeep(m_axis_tkeep),
    .m_axis_tuser(m_axis_tuser),
    .m_axis_tid(m_axis_tid),
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .m_axis_tready(m_axis_tready),
    .sub_axis_tdata(sub_axis_tdata),
    .sub_axis_tkeep(sub_axis_tkeep),
    .sub_axis_tuser(sub_axis_tuser),
    .sub_axis_tlast(sub_axis_tlast),
    .sub_axis_tvalid(sub_axis_tvalid),
    .sub_axis_tready(sub_axis_tready),
    .pub_axis_tdata(pub_axis_tdata),
    .pub_axis_tkeep(pub_axis_tkeep),
    .pub_axis_tuser(pub_axis_tuser),
    .pub_axis_tvalid(pub_axis_tvalid),
    .pub_axis_tlast(pub_axis_tlast),
    .pub_axis_tready(pub_axis_tready),
    .sched_request(sched_request),
    .sched_beat(sched_beat),
    .sched_last(sched_last),
    .sched_grant_valid(sched_grant_valid),
    .sched_grant_select(sched_grant_select),
    .id_error(id_error));

// The cycle before was no reset, so that what was then binds what is now.
reg running = 0;
reg is_first_cycle = 1;
always @(posedge clk) begin
    running        <= rst_n;
    is_first_cycle <= 0;
end
always @* if (is_first_cycle) assume (!rst_n);
always @* assume (sched_grant_select < `PUBLISHERS);

// A beat that is not taken stays.
wire [PAYLOAD_BITS-1:0]                    s_beat = {s_axis_tlast, s_axis_tuser, s_axis_tkeep, s_axis_tdata};
reg                                        s_stalled;
reg [PAYLOAD_BITS-1:0]                     s_beat_before;
always @(posedge clk) begin
    s_stalled     <= s_axis_tvalid && !s_axis_tready;
    s_beat_before <= s_beat;
end
always @* if (running && s_stalled) assume (s_axis_tvalid && s_beat == s_beat_before);
always @* assume (!s_axis_tuser || s_axis_tlast);

genvar publisher;
generate for (publisher = 0; publisher < `PUBLISHERS; publisher = publisher + 1) begin : publishers
    wire [PAYLOAD_BITS-1:0] beat = {
        pub_axis_tlast[publisher],
        pub_axis_tuser[publisher],
        pub_axis_tkeep[publisher*(`WIDTH/8) +: `WIDTH/8],
        pub_axis_tdata[publisher*`WIDTH +: `WIDTH]};
    reg                    stalled;
    reg [PAYLOAD_BITS-1:0] beat_before;
    always @(posedge clk) begin
        stalled     <= pub_axis_tvalid[publisher] && !pub_axis_tready[publisher];
        beat_before <= beat;
    end
    always @* if (running && stalled) assume (pub_axis_tvalid[publisher] && beat == beat_before);
    always @* assume (!pub_axis_tuser[publisher] || pub_axis_tlast[publisher]);
end endgenerate

// A register slice keeps a beat in the same order.
localparam SLICE_BITS = PAYLOAD_BITS;
function [PAYLOAD_BITS-1:0] payload_of(input [SLICE_BITS-1:0] kept);
    payload_of = kept;
endfunction

// The register slice to the host has the upper byte of an id beside `tuser`, which is used in a tree only.
localparam SENT_BITS = SLICE_BITS + 8;
function [PAYLOAD_BITS-1:0] sent_of(input [SENT_BITS-1:0] kept);
    sent_of = {kept[SENT_BITS-1], kept[PAYLOAD_BITS-2:0]};
endfunction
