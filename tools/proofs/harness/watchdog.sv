// SPDX-License-Identifier: Apache-2.0
// The watchdog: a source that stops in the middle of a frame does not keep the channel, its frame ends with exactly one
// abort, the rest of that frame never leaves, and a source that keeps up is never aborted.
//
// Assumed: the first cycle is a reset, and no other is; a source keeps a beat until it is taken, and marks aborts on a
// last beat only; the grant stays until the scheduler sees the end of a frame, and moves at will between frames.
module watchdog (input clk);

localparam SOURCE_BITS = $clog2(`SOURCES);

(* anyseq *) wire [SOURCE_BITS-1:0] source;
(* anyseq *) wire [7:0]             s_axis_tdata;
(* anyseq *) wire                   s_axis_tuser;
(* anyseq *) wire                   s_axis_tvalid;
(* anyseq *) wire                   s_axis_tlast;
wire                                s_axis_tready;
wire [7:0]                          m_axis_tdata;
wire                                m_axis_tkeep;
wire                                m_axis_tuser;
wire                                m_axis_tvalid;
wire                                m_axis_tlast;
(* anyseq *) wire                   m_axis_tready;
wire                                cut;
wire [`SOURCES-1:0]                 expired;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

firm_axis_watchdog dut (
    .clk(clk),
    .rst_n(rst_n),
    .tick(1'b1),
    .source(source),
    .s_axis_tdata(s_axis_tdata),
    .s_axis_tkeep(1'b1),
    .s_axis_tuser(s_axis_tuser),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .s_axis_tready(s_axis_tready),
    .m_axis_tdata(m_axis_tdata),
    .m_axis_tkeep(m_axis_tkeep),
    .m_axis_tuser(m_axis_tuser),
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .m_axis_tready(m_axis_tready),
    .cut(cut),
    .expired(expired));

wire take = s_axis_tvalid && s_axis_tready;
wire give = m_axis_tvalid && m_axis_tready;

// The grant of a frame, the source's beat, and sources whose aborted frame is not over.
reg                    is_granted;
reg [SOURCE_BITS-1:0]  granted;
reg                    s_stalled;
reg [9:0]              s_before;
reg [`SOURCES-1:0]     is_late;
wire [9:0]             s_now = {s_axis_tlast, s_axis_tuser, s_axis_tdata};
wire                   aborts = cut && !is_late[source];
always @(posedge clk) begin
    s_stalled <= rst_n && s_axis_tvalid && !s_axis_tready;
    s_before  <= s_now;
    granted   <= source;
    if (!rst_n) begin
        is_granted <= 0;
        is_late    <= 0;
    end else begin
        is_granted <= !cut && (take ? !s_axis_tlast : is_granted);
        if (cut) is_late[source] <= 1;
        else if (take && s_axis_tlast) is_late[source] <= 0;
    end
end
always @* if (running && is_granted) assume (source == granted);
always @* if (running && s_stalled && source == granted) assume (s_axis_tvalid && s_now == s_before);
always @* assume (!s_axis_tuser || s_axis_tlast);

// The receiver's frame; cycles on end, within it, in which the receiver was ready and got nothing; and cycles on end of
// a grant in which the source was not held up, and nothing was taken.
reg       inside;
reg [3:0] silent;
reg [3:0] idle;
reg       aborted_before;
always @(posedge clk) begin
    aborted_before <= rst_n && aborts;
    if (!rst_n) begin
        inside <= 0;
        silent <= 0;
        idle   <= 0;
    end else begin
        if (give) inside <= !m_axis_tlast;
        silent <= give || !inside ? 0 : silent + (m_axis_tready && silent != 15);
        idle   <= take || cut || !is_granted ? 0 : idle + ((m_axis_tready || is_late[source]) && idle != 15);
    end
end

always @* if (running) begin
    // The channel is free again after LIMIT cycles without a beat, and that of the abort.
    frees_the_channel: assert (silent <= `LIMIT);
    // So is the grant, also of a source whose late beats are dropped.
    frees_the_grant: assert (idle <= `LIMIT);

    // The abort ends a frame that has begun, once.
    if (aborts) abort_ends_one_frame: assert (inside && give && m_axis_tlast && m_axis_tuser);
    // Nothing of the aborted frame leaves later.
    if (is_late[source]) no_late_beat_leaves: assert (!m_axis_tvalid);
    // A source that keeps up is left alone, and its beats pass unchanged.
    if (cut) no_hasty_abort: assert (idle == `LIMIT);
    if (give && !aborts) beats_pass_unchanged: assert (
        take && {m_axis_tlast, m_axis_tuser, m_axis_tdata} == s_now);
    // Each abort is reported, as that of its source.
    each_abort_is_reported: assert (expired == (aborted_before ? 1'b1 << granted : 0));
end

endmodule
