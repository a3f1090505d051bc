// SPDX-License-Identifier: Apache-2.0
// The watchdog towards a sink: a sink that takes nothing does not hold up the source, a frame leaves as a whole or is
// reported once, one that has begun to leave ends with exactly one abort, and a sink that keeps up loses nothing.
//
// Assumed: the first cycle is a reset, and no other is; the source keeps a beat until it is taken, and aborts no frame.
// A beat contains its number, up to three, and that of its frame: the entity does not look at data, so that what holds
// for these holds for all.
module sink_watchdog (input clk);

localparam BEAT_BITS  = 2;
localparam FRAME_BITS = 4;

(* anyseq *) wire s_axis_tvalid;
(* anyseq *) wire s_axis_tlast;
wire              s_axis_tready;
wire [7:0]        m_axis_tdata;
wire              m_axis_tkeep;
wire              m_axis_tuser;
wire              m_axis_tvalid;
wire              m_axis_tlast;
(* anyseq *) wire m_axis_tready;
wire              frame_error;
wire [3:0]        frame_error_code;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

// The source; `blocked` counts the cycles on end in which its beat waited and the sink took nothing.
reg [FRAME_BITS-1:0] frames;
reg [BEAT_BITS-1:0]  beat;
reg                  is_inside;
reg [3:0]            blocked;
reg                  s_stalled;
reg                  s_before;
wire                 take = s_axis_tvalid && s_axis_tready;
wire                 give = m_axis_tvalid && m_axis_tready;
wire [7:0]           s_axis_tdata = {1'b0, s_axis_tlast, frames, beat};
always @(posedge clk) begin
    s_stalled <= rst_n && s_axis_tvalid && !s_axis_tready;
    s_before  <= s_axis_tlast;
    if (!rst_n) begin
        frames    <= 0;
        beat      <= 0;
        is_inside <= 0;
        blocked   <= 0;
    end else begin
        if (take) begin
            frames    <= frames + s_axis_tlast;
            beat      <= s_axis_tlast ? 0 : beat + 1;
            is_inside <= !s_axis_tlast;
        end
        blocked <= take || give || !m_axis_tvalid ? 0 : blocked + (s_axis_tvalid && blocked != 15);
    end
end
always @* if (running && s_stalled) assume (s_axis_tvalid && s_axis_tlast == s_before);
always @* if (&beat) assume (s_axis_tlast);

firm_axis_sink_watchdog dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata(s_axis_tdata),
    .s_axis_tkeep(1'b1),
    .s_axis_tuser(1'b0),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .s_axis_tready(s_axis_tready),
    .m_axis_tdata(m_axis_tdata),
    .m_axis_tkeep(m_axis_tkeep),
    .m_axis_tuser(m_axis_tuser),
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .m_axis_tready(m_axis_tready),
    .s_frame_error(1'b0),
    .s_frame_error_code(4'b0),
    .frame_error(frame_error),
    .frame_error_code(frame_error_code));

// The sink. Frames may be dropped from the end of the limit to the cycle in which the sink takes a beat; a report
// follows in the next cycle.
wire [FRAME_BITS-1:0] m_frame = m_axis_tdata[FRAME_BITS+BEAT_BITS-1:BEAT_BITS];
wire [BEAT_BITS-1:0]  m_beat  = m_axis_tdata[BEAT_BITS-1:0];
wire                  m_end   = m_axis_tdata[FRAME_BITS+BEAT_BITS];
reg                   inside;
reg [FRAME_BITS-1:0]  next_frame;
reg [BEAT_BITS-1:0]   next_beat;
reg [FRAME_BITS-1:0]  left;      // as a whole
reg [FRAME_BITS-1:0]  reported;
reg [FRAME_BITS-1:0]  aborted;
reg                   m_stalled;
reg [10:0]            m_before;
reg                   is_stuck;
reg                   may_report;
wire                  is_over = blocked + (s_axis_tvalid && !s_axis_tready) >= `LIMIT;
wire [10:0]           m_now = {m_axis_tlast, m_axis_tuser, m_axis_tkeep, m_axis_tdata};
always @(posedge clk) begin
    m_stalled <= rst_n && m_axis_tvalid && !m_axis_tready;
    m_before  <= m_now;
    if (!rst_n) begin
        inside     <= 0;
        next_frame <= 0;
        next_beat  <= 0;
        left       <= 0;
        reported   <= 0;
        aborted    <= 0;
        is_stuck   <= 0;
        may_report <= 0;
    end else begin
        reported   <= reported + frame_error;
        is_stuck   <= is_over || (is_stuck && !give);
        may_report <= is_over || is_stuck;
        if (give) begin
            inside     <= !m_axis_tlast;
            next_frame <= m_frame + m_axis_tlast;
            next_beat  <= m_axis_tlast ? 0 : m_beat + 1;
            left       <= left + (m_axis_tlast && !m_axis_tuser);
            aborted    <= aborted + m_axis_tuser;
        end
    end
end

// Cycles on end in which the sink was ready, the source was between two frames, and nothing moved.
reg [2:0] quiet;
always @(posedge clk)
    quiet <= !rst_n || !m_axis_tready || s_axis_tvalid || m_axis_tvalid || is_inside || frame_error ? 0
           : quiet + (quiet != 7);

always @* if (running) begin
    valid_stays: assert (!m_stalled || m_axis_tvalid);
    payload_stays: assert (!m_stalled || m_now == m_before);

    // The source waits for at most LIMIT cycles on end.
    frees_the_channel: assert (blocked <= `LIMIT);
    // A sink that takes a beat in time loses no frame.
    if (frame_error) no_hasty_report: assert (may_report);

    if (m_axis_tvalid && !m_axis_tuser) begin
        // Beats leave in order, and a frame that has begun is followed by nothing but its own beats, or its abort.
        frames_are_whole: assert (m_beat == next_beat && (!inside || m_frame == next_frame));
        frames_in_order: assert (m_frame >= next_frame && m_end == m_axis_tlast);
    end
    // An abort ends a frame that has begun.
    if (m_axis_tvalid && m_axis_tuser) abort_ends_one_frame: assert (inside && m_axis_tlast && m_axis_tkeep);
    // Each aborted frame is reported, and no frame twice.
    no_report_invented: assert (left + reported + frame_error <= frames + (is_inside || s_axis_tvalid));
    if (quiet >= 2) begin
        nothing_lost: assert (left + reported == frames);
        aborts_are_reported: assert (aborted <= reported);
    end
end

endmodule
