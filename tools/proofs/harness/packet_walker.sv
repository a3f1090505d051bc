// SPDX-License-Identifier: Apache-2.0
// The walker of RTPS packets: each packet has one verdict, two cycles after its last byte; nothing comes of what is not
// RTPS 2; a submessage ends where its length says or where the packet does, and not before its head is over. Which packets are whole and which are faulty, and which submessages are told, is
// only bound by that.
//
// Assumed: the first cycle is a reset, and no other is. The bytes are free: any packets, pauses, ends and aborts.
module packet_walker (input clk);

(* anyseq *) wire [7:0]  s_axis_tdata;
(* anyseq *) wire        s_axis_tuser;
(* anyseq *) wire        s_axis_tvalid;
(* anyseq *) wire        s_axis_tlast;
(* anyseq *) wire [47:0] source_mac;
wire                     field_valid;
wire [7:0]               field_address;
wire                     payload_valid;
wire                     is_submessage;
wire                     is_whole;
wire                     is_faulty;
wire                     is_foreign;
wire                     is_aborted;
wire [7:0]               kind;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

firm_rtps_walker dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata(s_axis_tdata),
    .s_axis_tuser(s_axis_tuser),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .source_mac(source_mac),
    .field_valid(field_valid),
    .field_address(field_address),
    .payload_valid(payload_valid),
    .kind(kind),
    .is_submessage(is_submessage),
    .is_whole(is_whole),
    .is_faulty(is_faulty),
    .is_foreign(is_foreign),
    .is_aborted(is_aborted));

// ---------------------------------------------------------------------- what the bytes mean
localparam HEADER_BYTES = 20, HEAD_BYTES = 4;
localparam [39:0] RTPS_2 = {"RTPS", 8'd2};
localparam [7:0] PAD = 8'h01, INFO_TIMESTAMP = 8'h09;

// The byte that came one cycle ago, as the walker looks at it.
reg       valid;
reg [7:0] octet;
reg       is_last, is_abort;
always @(posedge clk) begin
    valid <= rst_n && s_axis_tvalid;
    if (s_axis_tvalid) begin
        octet    <= s_axis_tdata;
        is_last  <= s_axis_tlast;
        is_abort <= s_axis_tuser;
    end
end

reg        in_header;
reg [4:0]  place;        // in the header, or in the head of a submessage; 4 in its body
reg        is_rtps_r;
reg [7:0]  head_kind;
reg        is_little;
reg [7:0]  before;       // the byte before
reg [15:0] left;         // bytes of the body
reg        to_the_end;   // the body ends with the packet
wire       is_body  = !in_header && place == HEAD_BYTES;
wire [39:0] checked = RTPS_2 >> (8 * (4 - place));
wire       is_rtps  = (place == 0 || is_rtps_r) && (place > 4 || octet == checked[7:0]);
wire [15:0] length  = is_little ? {octet, before} : {before, octet};
wire       is_free  = head_kind == PAD || head_kind == INFO_TIMESTAMP;
wire       closes   = is_body && (to_the_end ? is_last : left == 1);
always @(posedge clk) begin
    if (!rst_n) begin
        in_header <= 1;
        place     <= 0;
    end else if (valid) begin
        before <= octet;
        place  <= is_body ? (closes ? 0 : HEAD_BYTES) : place + 1;
        if (in_header) begin
            is_rtps_r <= is_rtps;
            if (place == HEADER_BYTES-1) begin
                in_header <= 0;
                place     <= 0;
            end
        end else if (is_body) left <= left - 1;
        else begin
            if (place == 0) head_kind <= octet;
            if (place == 1) is_little <= octet[0];
            if (place == 3) begin
                left       <= length;
                to_the_end <= length == 0;
                if (length == 0 && is_free) place <= 0;
            end
        end
        if (is_last) begin
            in_header <= 1;
            place     <= 0;
        end
    end
end

// The answers come one cycle later.
reg came, ended, aborted, closed, of_rtps, of_body;
always @(posedge clk) begin
    came    <= rst_n && valid;
    ended   <= rst_n && valid && is_last;
    aborted <= is_abort;
    closed  <= closes;
    of_rtps <= is_rtps_r;
    of_body <= is_body;
end

// What ties the registers to the bytes. The steps of the walker, one bit each, from the highest one on.
(* hierconn *) wire [19:0] \dut.step_r ;
(* hierconn *) wire [19:0] \dut.planned_r ;
(* hierconn *) wire [4:0]  \dut.place_r ;
(* hierconn *) wire [15:0] \dut.left_r ;
(* hierconn *) wire        \dut.last_r ;
(* hierconn *) wire [15:0] \dut.body_r ;
(* hierconn *) wire [15:0] \dut.half_r ;
(* hierconn *) wire        \dut.zero_r ;
(* hierconn *) wire        \dut.one_r ;
(* hierconn *) wire        \dut.open_r ;
(* hierconn *) wire        \dut.final_r ;
(* hierconn *) wire        \dut.valid_r ;
(* hierconn *) wire        \dut.end_r ;
(* hierconn *) wire        \dut.abort_r ;
(* hierconn *) wire        \dut.free_r ;
(* hierconn *) wire [7:0]  \dut.byte_r ;
(* hierconn *) wire [7:0]  \dut.kind_r ;
(* hierconn *) wire [7:0]  \dut.flags_r ;
localparam [19:0] OUTER = 20'd7 << 17 | 20'd3;  // the steps that are not of a submessage's body
wire at_protocol = \dut.step_r [19];
wire at_source   = \dut.step_r [18];
wire at_head     = \dut.step_r [17];
wire is_foreign_step = \dut.step_r [1];
wire is_faulty_step  = \dut.step_r [0];
wire in_body     = !(at_protocol || at_source || at_head || is_foreign_step || is_faulty_step);

always @* if (running) begin
    one_verdict: assert (32'd0 + is_whole + is_faulty + is_foreign + is_aborted == ended);
    aborts_are_told: assert (is_aborted == (ended && aborted));
    nothing_between: assert (came || !(field_valid || payload_valid || is_submessage));
    only_of_rtps_2: assert (!(payload_valid || is_submessage) || (of_rtps && of_body));
    submessages_end_in_time: assert (!is_submessage || closed);

    helper_valid: assert (\dut.valid_r == valid);
    if (valid || place != 0 || !in_header)
        helper_byte: assert (\dut.byte_r == octet && \dut.end_r == is_last && \dut.abort_r == is_abort);
    if (!valid && place != 0) helper_before: assert (before == octet || is_body);
    helper_one_step: assert (at_protocol + at_source + at_head + is_foreign_step + is_faulty_step
                             + ((\dut.step_r & ~OUTER) != 0) <= 1);
    helper_plan: assert ((\dut.planned_r & (20'd1 << 19 | 20'd3)) == 0);
    if (at_protocol && place >= 1) helper_plan_of_protocol: assert (\dut.planned_r == 20'd1 << 18);
    if (at_source && place > 8) helper_plan_of_source: assert (\dut.planned_r == 20'd1 << 17);
    if ((at_head && place >= 1) || in_body) helper_plan_of_body: assert (\dut.planned_r [18:17] == 0);
    helper_header: assert (!(at_protocol || at_source) || in_header);
    helper_rtps: assert (at_protocol ? place == 0 || is_rtps_r : is_foreign_step || is_faulty_step || is_rtps_r);
    if (at_protocol) helper_protocol: assert (\dut.place_r == place && place < 8 && \dut.left_r == 7 - place);
    if (at_source) helper_source: assert (\dut.place_r == place - 8 && place >= 8 && \dut.left_r == 19 - place);
    if (at_head) helper_head: assert (!in_header && \dut.place_r == place && place < 4 && \dut.left_r == 3 - place);
    if (at_protocol || at_source || at_head) helper_last: assert (\dut.last_r == (\dut.left_r == 0) && !\dut.final_r );
    if (in_body) begin
        helper_body: assert (is_body && \dut.open_r == to_the_end && (to_the_end || left != 0));
        if (!to_the_end) helper_left: assert (\dut.body_r == left && \dut.final_r == (left == 1));
        else helper_open: assert (!\dut.final_r );
    end
    if (at_head && place >= 1) helper_kind: assert (\dut.kind_r == head_kind);
    if (at_head && place >= 2) helper_flags: assert (\dut.free_r == is_free && \dut.flags_r [0] == is_little);
    if (at_head && place == 3 && valid)
        helper_half: assert (\dut.half_r == length && \dut.zero_r == (length == 0) && \dut.one_r == (length == 1));
end

endmodule
