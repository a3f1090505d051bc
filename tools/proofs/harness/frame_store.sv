// SPDX-License-Identifier: Apache-2.0
// The store of frames from a line that cannot wait: each good frame leaves whole, once and in order, or is reported as
// lost; no byte of an aborted frame leaves; a frame that leaves does not pause.
//
// Assumed: the first cycle is a reset, and no other is; a frame has up to four bytes, which is more than fit into the
// smallest store. A byte contains whether its frame will be aborted, the number of the good frames before it, and its
// own number: the store does not look at data, so that what holds for these holds for all.
module frame_store (input clk);

localparam BYTE_BITS  = 2;
localparam FRAME_BITS = 4;

(* anyseq *) wire         s_axis_tvalid;
(* anyseq *) wire         s_axis_tlast;
(* anyseq *) wire         will_abort;  // at the first byte of a frame
wire [7:0]                m_axis_tdata;
wire                      m_axis_tvalid;
wire                      m_axis_tlast;
(* anyseq *) wire         m_axis_tready;
wire                      is_lost;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

// The source.
reg [FRAME_BITS-1:0] frames;  // good ones that have arrived
reg [BYTE_BITS-1:0]  place;   // of the next byte
reg                  is_bad_r;
wire                 is_bad = place == 0 ? will_abort : is_bad_r;
wire [7:0]           s_axis_tdata = {1'b0, is_bad, frames, place};
always @(posedge clk) begin
    if (!rst_n) begin
        frames   <= 0;
        place    <= 0;
        is_bad_r <= 0;
    end else if (s_axis_tvalid) begin
        frames   <= frames + (s_axis_tlast && !is_bad);
        place    <= s_axis_tlast ? 0 : place + 1;
        is_bad_r <= is_bad;
    end
end
always @* if (running && s_axis_tvalid && place == 3) assume (s_axis_tlast);

firm_mac_store dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata(s_axis_tdata),
    .s_axis_tuser(s_axis_tlast && is_bad),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .m_axis_tdata(m_axis_tdata),
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .m_axis_tready(m_axis_tready),
    .is_lost(is_lost));

// The receiver.
wire                  m_bad   = m_axis_tdata[6];
wire [FRAME_BITS-1:0] m_frame = m_axis_tdata[FRAME_BITS+BYTE_BITS-1:BYTE_BITS];
wire [BYTE_BITS-1:0]  m_place = m_axis_tdata[BYTE_BITS-1:0];
wire                  give    = m_axis_tvalid && m_axis_tready;
reg                   inside;      // a frame has begun
reg [FRAME_BITS-1:0]  next_frame;  // the lowest one that may leave next, or that has begun
reg [BYTE_BITS-1:0]   next_place;
reg [FRAME_BITS-1:0]  left;        // frames that have left
reg [FRAME_BITS-1:0]  lost;        // reports
reg [BYTE_BITS-1:0]   ends [0:15]; // the last place of each good frame
reg                   m_stalled;
reg [8:0]             m_before;
wire [8:0]            m_now = {m_axis_tlast, m_axis_tdata};
always @(posedge clk) begin
    m_stalled <= rst_n && m_axis_tvalid && !m_axis_tready;
    m_before  <= m_now;
    if (s_axis_tvalid && s_axis_tlast && !is_bad) ends[frames] <= place;
    if (!rst_n) begin
        inside     <= 0;
        next_frame <= 0;
        next_place <= 0;
        left       <= 0;
        lost       <= 0;
    end else begin
        lost <= lost + is_lost;
        if (give) begin
            inside     <= !m_axis_tlast;
            next_frame <= m_frame + m_axis_tlast;
            next_place <= m_axis_tlast ? 0 : next_place + 1;
            left       <= left + m_axis_tlast;
        end
    end
end

// Cycles on end in which the receiver was ready, the source silent, and nothing moved.
reg [2:0] quiet;
always @(posedge clk)
    quiet <= !rst_n || !m_axis_tready || s_axis_tvalid || m_axis_tvalid || is_lost ? 0 : quiet + (quiet != 7);

always @* if (running) begin
    valid_stays: assert (!m_stalled || m_axis_tvalid);
    payload_stays: assert (!m_stalled || m_now == m_before);
    no_pause: assert (!inside || m_axis_tvalid);

    if (m_axis_tvalid) begin
        no_byte_of_a_bad_frame: assert (!m_bad);
        // A frame that has begun to leave is followed by nothing but its own bytes.
        in_order_once: assert (m_place == next_place && (inside ? m_frame == next_frame : m_frame >= next_frame));
        whole_frames: assert (m_axis_tlast == (m_place == ends[m_frame]) && m_frame != frames);
    end

    // When all has left, each good frame has left or was reported.
    if (quiet >= 3) lost_or_delivered: assert (frames == left + lost);
end

endmodule
