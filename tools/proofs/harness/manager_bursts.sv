// SPDX-License-Identifier: Apache-2.0
// Publishers to host, bursts: the scheduler may move the grant between any two beats, and yet every beat comes out, once,
// in order and unchanged, in bursts that the host can join.
//
// A burst ends (`tlast`) where the frame does or where the next beat is another publisher's. One that resumes a frame
// begins with a beat that is no beat of it: its lowest byte is the publisher's index.
// Order is shown by a marked beat, as in manager_to_subscribers.sv; what resumes a frame is counted as a beat, too.
module manager_bursts (input clk);

`include "manager_environment.svh"
`include "publishers_environment.svh"

// Whose beat was the last one taken.
reg       has_last;
reg [7:0] last_source;
always @(posedge clk) begin
    if (!rst_n) has_last <= 0;
    else if (take) begin
        has_last    <= 1;
        last_source <= source;
    end
end
wire waits   = has_last && (begun & (1'b1 << last_source)) != 0;  // it belongs to a frame that goes on
wire begins  = (begun & granted) == 0;
wire resumes = !begins && last_source != source;

// Beats on their way to the host.
reg [3:0] inside;
always @(posedge clk) inside <= rst_n ? inside + (take ? 1 + resumes : 0) - give : 0;

// The marked beat, and how many are ahead of it; what came behind it.
reg                    marked;
reg [3:0]              ahead;
reg [PAYLOAD_BITS-1:0] marked_beat;
reg [7:0]              marked_source;
reg                    marked_begins;
reg                    marked_resumes;
reg                    is_followed;
reg                    is_interrupted;
always @(posedge clk) begin
    if (!rst_n) marked <= 0;
    else if (marked) begin
        if (give && ahead == 0) marked <= 0;
        ahead <= ahead - give;
        if (take && !is_followed) begin
            is_followed    <= 1;
            is_interrupted <= source != marked_source;
        end
    end else if (take && mark) begin
        marked         <= 1;
        ahead          <= inside + resumes - give;
        marked_beat    <= p_beat;
        marked_source  <= source;
        marked_begins  <= begins;
        marked_resumes <= resumes;
        is_followed    <= 0;
        is_interrupted <= 0;
    end
end
wire is_marked_one = marked && ahead == 0 && m_axis_tvalid;
wire is_resumption = marked && ahead == 1 && m_axis_tvalid && marked_resumes;
wire marked_last   = marked_beat[PAYLOAD_BITS-1];

// The next beat to the host is the first one of a burst.
reg is_first;
always @(posedge clk) begin
    if (!rst_n) is_first <= 1;
    else if (give) is_first <= m_axis_tlast;
end

// Cycles on end in which the host was ready; in which the publishers, too, had nothing; since a reset.
reg [2:0] ready_cycles;
reg [2:0] quiet_cycles;
reg [3:0] cycles;
wire is_quiet = m_axis_tready && pub_axis_tvalid == 0;
always @(posedge clk) begin
    ready_cycles <= !rst_n || !m_axis_tready ? 0 : ready_cycles + (ready_cycles != 7);
    quiet_cycles <= !rst_n || !is_quiet ? 0 : quiet_cycles + (quiet_cycles != 7);
    cycles       <= !rst_n ? 0 : cycles + (cycles != 15);
end
// Cycles on end in which a granted publisher offers a beat that is not taken, the host being ready.
reg [2:0] blocked_cycles;
wire is_blocked = m_axis_tready && (granted & pub_axis_tvalid) != 0 && !take;
always @(posedge clk) blocked_cycles <= !rst_n || cycles < `PUBLISHERS || !is_blocked ? 0 : blocked_cycles + (blocked_cycles != 7);

always @* if (running) begin
    if (is_marked_one) in_order_unchanged: assert (m_beat[PAYLOAD_BITS-2:0] == marked_beat[PAYLOAD_BITS-2:0]);
    if (is_marked_one || is_resumption) tid_is_the_publisher: assert (m_axis_tid == marked_source);

    // A burst ends with the frame or where another publisher's beat follows, and nowhere else. So it is not sent before
    // that is known.
    if (is_marked_one) sent_when_its_end_is_known: assert (marked_last || is_followed);
    if (is_marked_one) bursts_end_with_tlast: assert (m_axis_tlast == (marked_last || is_interrupted));

    // It begins with a frame's first beat or with one that says whose frame goes on.
    if (is_marked_one) bursts_begin_frames: assert (is_first == marked_begins);
    if (is_resumption) resumption_begins_a_burst: assert (is_first && !m_axis_tlast);
    if (is_resumption) resumption_names_the_publisher: assert (m_axis_tdata[7:0] == marked_source);

    // Two beats are in the register slice, one is held, and before that one a resumption may be due. All comes out but
    // the last beat of an unfinished frame, which waits for the next one.
    no_beat_lost: assert (inside <= 4);
    if (quiet_cycles >= 4) all_comes_out: assert (inside <= waits);
    no_beat_invented: assert (!m_axis_tvalid || inside != 0);

    // A ready host means a beat a cycle: a resumption costs one.
    no_bubble: assert (blocked_cycles <= 2);
end

// What the registers mean, for induction: the slice holds up to two beats, the older one in its output; behind them may come
// what resumes a frame, and then the beat that is held.
(* hierconn *) wire                  \dut.u_group.u_slice_out.valid_r ;
(* hierconn *) wire                  \dut.u_group.u_slice_out.ready_r ;
(* hierconn *) wire [SENT_BITS-1:0]  \dut.u_group.u_slice_out.output_r ;
(* hierconn *) wire [SENT_BITS-1:0]  \dut.u_group.u_slice_out.skid_r ;
(* hierconn *) wire [7:0]            \dut.u_group.u_slice_out.id_r ;

wire                    has_older = \dut.u_group.u_slice_out.valid_r ;
wire                    has_newer = has_older && !\dut.u_group.u_slice_out.ready_r ;
wire [PAYLOAD_BITS-1:0] older     = sent_of(\dut.u_group.u_slice_out.output_r );
wire [PAYLOAD_BITS-1:0] newer     = sent_of(\dut.u_group.u_slice_out.skid_r );
wire [7:0]              older_id  = \dut.u_group.u_slice_out.id_r ;
wire [7:0]              newer_id  = older[PAYLOAD_BITS-1] ? newer[7:0] : older_id;
wire [7:0]              newest_id = has_newer ? newer_id : older_id;
wire                    is_over   = has_newer ? newer[PAYLOAD_BITS-1] : older[PAYLOAD_BITS-1];
wire [1:0]              in_slice  = has_older + has_newer;

localparam INDEX_BITS = $clog2(`PUBLISHERS);
(* hierconn *) wire                  \dut.u_group.parts_of_frames_u_burst.held_r ;
(* hierconn *) wire                  \dut.u_group.parts_of_frames_u_burst.resume_r ;
(* hierconn *) wire [`WIDTH-1:0]     \dut.u_group.parts_of_frames_u_burst.held_tdata_r ;
(* hierconn *) wire [`WIDTH/8-1:0]   \dut.u_group.parts_of_frames_u_burst.held_tkeep_r ;
(* hierconn *) wire                  \dut.u_group.parts_of_frames_u_burst.held_tuser_r ;
(* hierconn *) wire                  \dut.u_group.parts_of_frames_u_burst.held_tlast_r ;
(* hierconn *) wire [INDEX_BITS-1:0] \dut.u_group.parts_of_frames_u_burst.held_source_r ;
(* hierconn *) wire [INDEX_BITS:0]   \dut.u_group.parts_of_frames_u_burst.cleared_r ;

wire                    is_held     = \dut.u_group.parts_of_frames_u_burst.held_r ;
wire                    is_resumed  = \dut.u_group.parts_of_frames_u_burst.resume_r ;
wire [7:0]              held_source = \dut.u_group.parts_of_frames_u_burst.held_source_r ;
wire [PAYLOAD_BITS-1:0] held = {
    \dut.u_group.parts_of_frames_u_burst.held_tlast_r ,
    \dut.u_group.parts_of_frames_u_burst.held_tuser_r ,
    \dut.u_group.parts_of_frames_u_burst.held_tkeep_r ,
    \dut.u_group.parts_of_frames_u_burst.held_tdata_r };

reg held_begins;
always @(posedge clk) if (take) held_begins <= begins;

// The memory of frames that have begun, as far as it is cleared.
wire [`PUBLISHERS-1:0] memory;
(* hierconn *) wire \dut.u_group.parts_of_frames_u_burst.is_begun[0] ;
(* hierconn *) wire \dut.u_group.parts_of_frames_u_burst.is_begun[1] ;
assign memory[0] = \dut.u_group.parts_of_frames_u_burst.is_begun[0] ;
assign memory[1] = \dut.u_group.parts_of_frames_u_burst.is_begun[1] ;
`ifdef PUBLISHERS_4
(* hierconn *) wire \dut.u_group.parts_of_frames_u_burst.is_begun[2] ;
(* hierconn *) wire \dut.u_group.parts_of_frames_u_burst.is_begun[3] ;
assign memory[2] = \dut.u_group.parts_of_frames_u_burst.is_begun[2] ;
assign memory[3] = \dut.u_group.parts_of_frames_u_burst.is_begun[3] ;
`endif

wire is_clearing = \dut.u_group.parts_of_frames_u_burst.cleared_r [INDEX_BITS];
wire [`PUBLISHERS-1:0] uncleared =
    is_clearing ? {`PUBLISHERS{1'b1}} << \dut.u_group.parts_of_frames_u_burst.cleared_r [INDEX_BITS-1:0] : 0;

wire is_marked_held  = marked && ahead == in_slice + is_resumed;
wire is_marked_newer = marked && has_newer && ahead == 1;
wire is_marked_older = marked && has_older && ahead == 0;

always @* if (running) begin
    helper_memory: assert (((memory ^ begun) & ~uncleared) == 0);
    helper_clearing: assert (!is_clearing || !has_last);
    helper_nothing_taken: assert (has_last || (begun == 0 && inside == 0 && !is_held && is_over));
    helper_inside: assert (inside == in_slice + is_held + is_resumed);
    helper_first: assert (has_older || is_first == older[PAYLOAD_BITS-1]);

    // The beat that is held: it is the last one taken, and a burst is open for it, is to be resumed, or it opens one.
    helper_resumed: assert (!is_resumed || (is_held && is_over && !held_begins));
    if (has_last) begin
        helper_held_source: assert (last_source == held_source);
        helper_held_last: assert (waits == !held[PAYLOAD_BITS-1]);
        helper_held: assert (is_held || (is_over && !waits));
    end
    if (is_held) begin
        helper_open: assert (is_resumed || is_over == held_begins);
        helper_open_id: assert (is_over || newest_id == held_source);
        helper_held_id: assert (!held_begins || held[7:0] == held_source);
    end

    // The marked beat is one of the three.
    if (marked) helper_marked: assert (is_marked_older || is_marked_newer || (is_held && is_marked_held));
    if (is_marked_held) begin
        helper_marked_held: assert (marked_beat == held && marked_source == held_source && marked_begins == held_begins);
        helper_marked_alone: assert (!is_followed && (marked_resumes || !is_resumed));
        if (marked_resumes && !is_resumed && in_slice == 1)
            helper_resumption_older: assert (is_first && !older[PAYLOAD_BITS-1] && older[7:0] == marked_source && older_id == marked_source);
        if (marked_resumes && !is_resumed && in_slice == 2)
            helper_resumption_newer: assert (older[PAYLOAD_BITS-1] && !newer[PAYLOAD_BITS-1] && newer[7:0] == marked_source);
    end
    if (is_marked_newer || is_marked_older) helper_followed: assert (marked_last || is_followed);
    if (is_marked_newer) begin
        helper_newer: assert (newer == {marked_last || is_interrupted, marked_beat[PAYLOAD_BITS-2:0]});
        helper_newer_id: assert (newer_id == marked_source);
        helper_newer_begins: assert (older[PAYLOAD_BITS-1] == marked_begins);
        if (marked_resumes) helper_newer_resumed: assert (is_first && older[7:0] == marked_source && older_id == marked_source);
    end
    if (is_marked_older) begin
        helper_older: assert (older == {marked_last || is_interrupted, marked_beat[PAYLOAD_BITS-2:0]});
        helper_older_id: assert (older_id == marked_source);
        helper_older_begins: assert (is_first == marked_begins);
    end
    if (marked) helper_marked_source: assert (marked_source < `PUBLISHERS);
    if (marked) helper_marked_begins: assert (!(marked_begins && marked_resumes) && (!is_interrupted || is_followed));
end

endmodule
