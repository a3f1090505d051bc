// SPDX-License-Identifier: Apache-2.0
// Publishers to host, whole frames: every beat that is taken from a publisher comes out, once, in order and unchanged,
// and `tid` says whose it is.
//
// Assumed: the scheduler does not leave a frame that has begun (`whole_tasks` of scheduler_grants.sv).
// Order is shown by a marked beat, as in manager_to_subscribers.sv.
module manager_to_host (input clk);

`include "manager_environment.svh"
`include "publishers_environment.svh"

always @* if (running && begun != 0) assume (granted == begun);

// Beats on their way to the host, the marked one, and how many are ahead of it.
reg [3:0]              inside;
reg                    marked;
reg [3:0]              ahead;
reg [PAYLOAD_BITS-1:0] marked_beat;
reg [7:0]              marked_source;
always @(posedge clk) begin
    inside <= rst_n ? inside + take - give : 0;
    if (!rst_n) marked <= 0;
    else if (marked) begin
        if (give && ahead == 0) marked <= 0;
        ahead <= ahead - give;
    end else if (take && mark) begin
        marked        <= 1;
        ahead         <= inside - give;
        marked_beat   <= p_beat;
        marked_source <= source;
    end
end
wire is_marked_one = marked && ahead == 0 && m_axis_tvalid;

// Aborts on their way to the host.
reg [3:0] aborts;
always @(posedge clk)
    aborts <= rst_n ? aborts + (take && p_beat[ABORT_BIT]) - (give && m_axis_tuser) : 0;

// Cycles on end in which the host was ready.
reg [2:0] ready_cycles;
always @(posedge clk) ready_cycles <= !rst_n || !m_axis_tready ? 0 : ready_cycles + (ready_cycles != 7);

always @* if (running) begin
    // A beat is offered as soon as one is inside, whether or not the host is ready.
    offered_if_inside: assert (m_axis_tvalid == (inside != 0));

    if (is_marked_one) in_order_unchanged: assert (m_beat == marked_beat);
    if (is_marked_one) tid_is_the_publisher: assert (m_axis_tid == marked_source);

    // Each abort that is taken ends one frame at the host; nothing else does so.
    if (m_axis_tvalid && m_axis_tuser) abort_ends_one_frame: assert (m_axis_tlast && aborts != 0);
    no_abort_lost: assert (aborts <= inside);

    // No more is inside than the two beats of the register slice.
    no_beat_lost: assert (inside <= 2);

    // A beat a cycle: a ready host means that the granted publisher's beat is taken.
    no_bubble: assert (pub_axis_tready == granted || ready_cycles < 2);
end

// What the registers mean, for induction.
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

always @* if (running) begin
    helper_inside: assert (inside == has_older + has_newer);
    helper_aborts: assert (aborts == (has_older && older[ABORT_BIT]) + (has_newer && newer[ABORT_BIT]));
    if (has_older) helper_older_end: assert (!older[ABORT_BIT] || older[PAYLOAD_BITS-1]);
    if (has_newer) helper_newer_end: assert (!newer[ABORT_BIT] || newer[PAYLOAD_BITS-1]);
    helper_ids: assert ((!has_older || older_id < `PUBLISHERS) && (!has_older && is_over || newest_id < `PUBLISHERS));
    helper_begun: assert (begun == (is_over ? 0 : 1'b1 << newest_id));
    if (marked) begin
        helper_ahead: assert (ahead < inside);
        helper_marked: assert (ahead == 0 ? marked_beat == older && marked_source == older_id
                                          : marked_beat == newer && marked_source == newer_id);
    end
end

endmodule
