// SPDX-License-Identifier: Apache-2.0
// Host to subscribers: every beat that belongs to a subscriber comes out there, once, in order and unchanged; every
// frame for nobody is told once by `id_error`.
//
// How order is shown of streams without end: whenever it likes, the solver marks a beat that is taken from the host. The
// beats ahead of it are counted down as they come out, and then the marked one has to.
module manager_to_subscribers (input clk);

`include "manager_environment.svh"

(* anyseq *) wire mark;

wire [PAYLOAD_BITS-1:0] given = {sub_axis_tlast, sub_axis_tuser, sub_axis_tkeep, sub_axis_tdata};
wire                    take  = s_axis_tvalid && s_axis_tready;
wire                    give  = (sub_axis_tvalid & sub_axis_tready) != 0;

reg [`SUBSCRIBERS-1:0] sub_stalled;
reg [PAYLOAD_BITS-1:0] given_before;
always @(posedge clk) begin
    sub_stalled  <= sub_axis_tvalid & ~sub_axis_tready;
    given_before <= given;
end

// The frame that the host sends: whose it is, and what becomes of the beat that is taken. At 8 bits the first beat is
// the id alone and goes no further, and a frame that is nothing else is for nobody.
function belongs_to_somebody(input [`WIDTH-1:0] tdata);
    belongs_to_somebody = tdata[7:0] < `SUBSCRIBERS;
endfunction
function goes_on(input first, input known, input [`WIDTH-1:0] tdata);
    goes_on = first ? `WIDTH > 8 && belongs_to_somebody(tdata) : known;
endfunction
function is_for_nobody(input first, input [PAYLOAD_BITS-1:0] payload);
    is_for_nobody = first && (!belongs_to_somebody(payload[`WIDTH-1:0]) || (`WIDTH == 8 && payload[PAYLOAD_BITS-1]));
endfunction

reg       first;  // the next beat is the first of a frame
reg       known;
reg [7:0] id;
wire       is_known = first ? belongs_to_somebody(s_axis_tdata) : known;
wire [7:0] its_id   = first ? s_axis_tdata[7:0] : id;
wire       enters   = take && goes_on(first, known, s_axis_tdata);
wire       is_bad   = take && is_for_nobody(first, s_beat);
always @(posedge clk) begin
    if (!rst_n) first <= 1;
    else if (take) begin
        first <= s_axis_tlast;
        known <= is_known;
        id    <= its_id;
    end
end

// Beats on their way to subscribers, and frames whose error is still to be told.
reg [3:0] inside;
reg [3:0] untold;
always @(posedge clk) begin
    if (!rst_n) begin
        inside <= 0;
        untold <= 0;
    end else begin
        inside <= inside + enters - give;
        untold <= untold + is_bad - id_error;
    end
end

// The marked beat, and how many are ahead of it.
reg                    marked;
reg [3:0]              ahead;
reg [PAYLOAD_BITS-1:0] marked_payload;
reg [7:0]              marked_id;
always @(posedge clk) begin
    if (!rst_n) marked <= 0;
    else if (marked) begin
        if (give && ahead == 0) marked <= 0;
        ahead <= ahead - give;
    end else if (enters && mark) begin
        marked         <= 1;
        ahead          <= inside - give;
        marked_payload <= s_beat;
        marked_id      <= its_id;
    end
end
wire is_marked_one = marked && ahead == 0 && sub_axis_tvalid != 0;

// Cycles on end in which all subscribers were ready; in which the host, too, had nothing; in which a beat was inside
// and none was offered.
reg [2:0] ready_cycles;
reg [2:0] quiet_cycles;
reg [2:0] mute_cycles;
always @(posedge clk) begin
    ready_cycles <= !rst_n || sub_axis_tready != {`SUBSCRIBERS{1'b1}} ? 0 : ready_cycles + (ready_cycles != 7);
    quiet_cycles <= !rst_n || sub_axis_tready != {`SUBSCRIBERS{1'b1}} || s_axis_tvalid ? 0 : quiet_cycles + (quiet_cycles != 7);
    mute_cycles  <= !rst_n || inside == 0 || sub_axis_tvalid != 0 ? 0 : mute_cycles + (mute_cycles != 7);
end

always @* if (running) begin
    // AXI-Stream: what is offered stays, and stays as it is, until it is taken.
    sub_valid_stays: assert ((sub_stalled & ~sub_axis_tvalid) == 0);
    if (sub_stalled != 0) sub_payload_stays: assert (given == given_before);

    // A beat is offered to one subscriber, and only if the host has sent one.
    one_subscriber_at_a_time: assert ((sub_axis_tvalid & (sub_axis_tvalid - 1'b1)) == 0);
    if (sub_axis_tvalid != 0) no_beat_invented: assert (inside != 0);

    // It goes to the one that its frame's id names, in order and unchanged.
    if (is_marked_one) routed_by_id: assert (sub_axis_tvalid == 1'b1 << marked_id);
    if (is_marked_one) in_order_unchanged: assert (given == marked_payload);

    // No more is inside than the two beats of the register slice, and all comes out.
    no_beat_lost: assert (inside <= 2);
    if (quiet_cycles >= 3) all_comes_out: assert (inside == 0);

    // A beat is offered whether or not anybody is ready.
    offered_unasked: assert (mute_cycles <= 1);

    // A beat a cycle: ready subscribers mean a ready Manager.
    no_bubble: assert (s_axis_tready || ready_cycles < 2);

    // An error is told for each frame for nobody, and for no other.
    if (id_error) no_error_invented: assert (untold != 0);
    no_error_lost: assert (untold <= 3);
    if (quiet_cycles >= 3) all_errors_told: assert (untold == 0);
end

// What the registers mean, for induction: the slice holds up to two beats, the older one in its output.
(* hierconn *) wire                     \dut.u_slice_in.valid_r ;
(* hierconn *) wire                     \dut.u_slice_in.ready_r ;
(* hierconn *) wire [SLICE_BITS-1:0]    \dut.u_slice_in.output_r ;
(* hierconn *) wire [SLICE_BITS-1:0]    \dut.u_slice_in.skid_r ;
(* hierconn *) wire                     \dut.u_demux.first_r ;
(* hierconn *) wire                     \dut.u_demux.known_r ;
(* hierconn *) wire [$clog2(`SUBSCRIBERS)-1:0] \dut.u_demux.index_r ;

wire                    has_older = \dut.u_slice_in.valid_r ;
wire                    has_newer = has_older && !\dut.u_slice_in.ready_r ;
wire [PAYLOAD_BITS-1:0] older     = payload_of(\dut.u_slice_in.output_r );
wire [PAYLOAD_BITS-1:0] newer     = payload_of(\dut.u_slice_in.skid_r );

wire       older_first = \dut.u_demux.first_r ;
wire       older_known = older_first ? belongs_to_somebody(older[`WIDTH-1:0]) : \dut.u_demux.known_r ;
wire [7:0] older_id    = older_first ? older[7:0] : \dut.u_demux.index_r ;
wire       older_goes  = has_older && goes_on(older_first, \dut.u_demux.known_r , older[`WIDTH-1:0]);
wire       newer_first = has_older ? older[PAYLOAD_BITS-1] : older_first;
wire       newer_known = newer_first ? belongs_to_somebody(newer[`WIDTH-1:0]) : older_known;
wire [7:0] newer_id    = newer_first ? newer[7:0] : older_id;
wire       newer_goes  = has_newer && goes_on(newer_first, older_known, newer[`WIDTH-1:0]);

always @* if (running) begin
    // No beat of a frame for nobody is offered.
    if (sub_axis_tvalid != 0) no_refused_beat_leaves: assert (older_goes);
end

always @* if (running) begin
    helper_inside: assert (inside == older_goes + newer_goes);
    helper_untold: assert (untold == id_error + (has_older && is_for_nobody(older_first, older)) + (has_newer && is_for_nobody(newer_first, newer)));
    helper_first: assert (first == (has_newer ? newer[PAYLOAD_BITS-1] : newer_first));
    if (!first) helper_known: assert (known == (has_newer ? newer_known : has_older ? older_known : \dut.u_demux.known_r ));
    if (!first && known) helper_id: assert (id == (has_newer ? newer_id : has_older ? older_id : \dut.u_demux.index_r ));
    helper_index: assert (\dut.u_demux.first_r || !\dut.u_demux.known_r || \dut.u_demux.index_r < `SUBSCRIBERS);
    if (marked) begin
        helper_ahead: assert (ahead < inside);
        if (ahead == 0 && older_goes) helper_older: assert (marked_payload == older && marked_id == older_id);
        else helper_newer: assert (marked_payload == newer && marked_id == newer_id);
    end
end

endmodule
