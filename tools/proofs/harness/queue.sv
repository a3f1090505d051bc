// SPDX-License-Identifier: Apache-2.0
// A queue of frames: each frame that arrives leaves whole and in order, or is reported as dropped; no frame is lost
// without a report, and no report is without a lost frame.
//
// Assumed: the first cycle is a reset, and no other is; the source keeps a beat until it is taken. A beat of a frame of
// up to two contains its number, that of its frame, and its own marks: the queue does not look at data, so that what
// holds for these holds for all.
module queue (input clk);

localparam BEAT_BITS  = 1;
localparam FRAME_BITS = 4;

(* anyseq *) wire         s_axis_tvalid;
(* anyseq *) wire         s_axis_tlast;
(* anyseq *) wire         s_axis_tuser;
(* anyseq *) wire         s_axis_tkeep;
wire                      s_axis_tready;
wire [7:0]                m_axis_tdata;
wire                      m_axis_tkeep;
wire                      m_axis_tuser;
wire                      m_axis_tvalid;
wire                      m_axis_tlast;
(* anyseq *) wire         m_axis_tready;
wire                      frame_error;
wire [3:0]                frame_error_code;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

// The source.
reg [FRAME_BITS-1:0] frames;  // that have arrived
reg [BEAT_BITS-1:0]  beat;    // the number of the next beat, up to the last that the queue keeps
wire                 take = s_axis_tvalid && s_axis_tready;
wire                 is_kept_end  = s_axis_tlast || beat == `BEATS - 1;
wire [7:0]           s_axis_tdata = {is_kept_end, s_axis_tuser, s_axis_tkeep, frames, beat};
reg                  is_cut;      // the queue has ended the frame
reg                  s_stalled;
reg [2:0]            s_before;
always @(posedge clk) begin
    s_stalled <= s_axis_tvalid && !s_axis_tready;
    s_before  <= {s_axis_tlast, s_axis_tuser, s_axis_tkeep};
    if (!rst_n) begin
        frames <= 0;
        beat   <= 0;
        is_cut <= 0;
    end else if (take) begin
        frames <= frames + s_axis_tlast;
        beat   <= s_axis_tlast ? 0 : beat + (beat != `BEATS - 1);
        is_cut <= !s_axis_tlast && (is_cut || is_kept_end);
    end
end
always @* if (running && s_stalled) assume (s_axis_tvalid && s_before == {s_axis_tlast, s_axis_tuser, s_axis_tkeep});

firm_axis_queue dut (
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
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .m_axis_tready(m_axis_tready),
    .s_frame_error(1'b0),
    .s_frame_error_code(4'b0),
    .frame_error(frame_error),
    .frame_error_code(frame_error_code));

// The receiver.
wire [FRAME_BITS-1:0] m_frame = m_axis_tdata[FRAME_BITS+BEAT_BITS-1:BEAT_BITS];
wire [BEAT_BITS-1:0]  m_beat  = m_axis_tdata[BEAT_BITS-1:0];
wire                  give    = m_axis_tvalid && m_axis_tready;
reg                   inside;         // a frame has begun
reg [FRAME_BITS-1:0]  next_frame;     // the lowest one that may leave next, or that has begun
reg [BEAT_BITS-1:0]   next_beat;
reg [FRAME_BITS-1:0]  left;           // frames that have left
reg [FRAME_BITS-1:0]  dropped;        // reports
reg                   m_stalled;
reg [10:0]            m_before;
wire [10:0]           m_now = {m_axis_tlast, m_axis_tuser, m_axis_tkeep, m_axis_tdata};
always @(posedge clk) begin
    m_stalled <= rst_n && m_axis_tvalid && !m_axis_tready;
    m_before  <= m_now;
    if (!rst_n) begin
        inside     <= 0;
        next_frame <= 0;
        next_beat  <= 0;
        left       <= 0;
        dropped    <= 0;
    end else begin
        dropped <= dropped + frame_error;
        if (give) begin
            inside     <= !m_axis_tlast;
            next_frame <= m_frame + m_axis_tlast;
            next_beat  <= m_axis_tlast ? 0 : next_beat + 1;
            left       <= left + m_axis_tlast;
        end
    end
end

// Cycles on end in which the receiver was ready, the source was between two frames, and nothing moved.
reg [2:0] quiet;
always @(posedge clk)
    quiet <= !rst_n || !m_axis_tready || s_axis_tvalid || m_axis_tvalid || beat != 0 || is_cut || frame_error ? 0
           : quiet + (quiet != 7);

wire [FRAME_BITS-1:0] accounted = left + dropped;

always @* if (running) begin
    valid_stays: assert (!m_stalled || m_axis_tvalid);
    payload_stays: assert (!m_stalled || m_now == m_before);

    if (m_axis_tvalid) begin
        // A frame that has begun to leave is followed by nothing but its own beats.
        frames_are_whole: assert (m_beat == next_beat && (!inside || m_frame == next_frame));
        frames_in_order: assert (m_frame >= next_frame);
        // Its end is where it was, and its marks are unchanged.
        marks_unchanged: assert (m_axis_tdata[7:5] == {m_axis_tlast, m_axis_tuser, m_axis_tkeep});
    end

    // The frame that arrives may be reported before its end.
    no_report_invented: assert (accounted <= frames + (beat != 0 || is_cut || frame_error));
    // When all has left, each frame that has arrived has left or was reported.
    if (quiet >= 3) nothing_lost: assert (accounted == frames);
    // Nothing is dropped without leave.
    if (!`DROP_NEWEST && !`DROP_OLDEST) nothing_dropped: assert (!frame_error);
end

endmodule
