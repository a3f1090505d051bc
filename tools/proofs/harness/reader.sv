// SPDX-License-Identifier: Apache-2.0
// The readers of a node in fabric. The sequence window: of each writer, a sample is taken only with the next number, or
// for a reader that is not reliable with a later one; then the number after it is the next one. What may be taken is
// taken. The program reads the next number, and nothing is judged while it has the lock. One commit a packet: all samples
// of a good packet count at its end, and those of another one never do. Samples leave in the order in which they came,
// each once, if they were taken.
//
// Assumed: the first cycle is a reset, and no other is; the lock is taken after a cycle in which nothing is judged; with
// the lock only, the program writes numbers and enters writers; two submessages do not end in successive cycles. The
// walker's fields are free otherwise, and so is the host. What holds for `writer`, which is any, holds for all.
module reader (input clk);

localparam NUMBER_BITS = 48, MARK_BITS = 4, SIZE_BITS = 16;
localparam SOURCE_BITS = $clog2(`SOURCES);
localparam AT_MARK = SIZE_BITS + NUMBER_BITS, AT_SOURCE = AT_MARK + MARK_BITS, AT_ID = AT_SOURCE + SOURCE_BITS;
localparam ENTRY_BITS = AT_ID + 4;

(* anyseq *) wire       field_valid, payload_valid, is_submessage, is_whole, is_faulty, is_foreign, is_aborted, is_mine;
(* anyseq *) wire [7:0] field_address, field_data, payload_data, kind, flags;
(* anyseq *) wire [SOURCE_BITS-1:0] chosen;
(* anyseq *) wire       key_write, note_write, number_write, is_locked, takes_early, m_axis_tready;
(* anyseq *) wire [3:0] write_place;
(* anyseq *) wire [7:0] write_data;
(* anyseq *) wire [2:0] read_place;
(* anyconst *) wire [SOURCE_BITS-1:0] writer;
wire       is_judging;
wire [7:0] number_byte;
wire       m_axis_tvalid, m_axis_tlast;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

firm_rtps_readers dut (
    .clk(clk),
    .rst_n(rst_n),
    .field_valid(field_valid),
    .field_address(field_address),
    .field_data(field_data),
    .payload_valid(payload_valid),
    .payload_data(payload_data),
    .kind(kind),
    .flags(flags),
    .is_submessage(is_submessage),
    .is_whole(is_whole),
    .is_faulty(is_faulty),
    .is_foreign(is_foreign),
    .is_aborted(is_aborted),
    .is_mine(is_mine),
    .source({{(6-SOURCE_BITS){1'b0}}, chosen}),
    .key_write(key_write),
    .note_write(note_write),
    .number_write(number_write),
    .write_place(write_place),
    .write_data(write_data),
    .read_place(read_place),
    .number_byte(number_byte),
    .is_locked(is_locked),
    .is_judging(is_judging),
    .takes_early(takes_early),
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .m_axis_tready(m_axis_tready));

reg                   was_running = 0;
always @(posedge clk) was_running <= rst_n;
reg                   was_locked, was_judging, was_submessage;
reg [SOURCE_BITS-1:0] was_chosen;
always @(posedge clk) begin
    was_locked       <= rst_n && is_locked;
    was_judging      <= !rst_n || is_judging;
    was_submessage   <= rst_n && is_submessage;
    was_chosen       <= chosen;
end
always @* begin
    assume (!is_locked || (running && (was_locked || !was_judging)));
    if (!is_locked) assume (!number_write && !(note_write && write_data[7]));
    if (was_submessage) assume (!is_submessage);
end

// ---------------------------------------------------------------------- what is judged
localparam QUEUE_BITS = $clog2(`SAMPLES);
(* hierconn *) wire [QUEUE_BITS:0]   \dut.oldest_r ;
(* hierconn *) wire [QUEUE_BITS:0]   \dut.judged_r ;
(* hierconn *) wire [QUEUE_BITS:0]   \dut.first_r ;
(* hierconn *) wire [QUEUE_BITS:0]   \dut.last_r ;
wire [QUEUE_BITS:0] judged = \dut.judged_r - \dut.oldest_r ;
wire [QUEUE_BITS:0] first  = \dut.first_r - \dut.oldest_r ;
wire [QUEUE_BITS:0] last   = \dut.last_r - \dut.oldest_r ;
(* hierconn *) wire [1:0]            \dut.judge_r ;
(* hierconn *) wire [ENTRY_BITS-1:0] \dut.candidate_r ;
(* hierconn *) wire                  \dut.is_taken ;
(* hierconn *) wire                  \dut.strict_r ;
(* hierconn *) wire                  \dut.same_r ;
localparam WAITING = 0, COMPARING = 1, JUDGING = 2;
wire [NUMBER_BITS-1:0] number = \dut.candidate_r [AT_MARK-1:SIZE_BITS];
wire [SOURCE_BITS-1:0] from   = \dut.candidate_r [AT_ID-1:AT_SOURCE];
wire                   is_of  = from == writer;

// The next number of the writer.
reg [NUMBER_BITS-1:0] next, next_before;
integer index;
always @(posedge clk) begin
    next_before <= next;
    if (number_write && chosen == writer)
        for (index = 0; index < 6; index = index + 1)
            if (write_place[2:0] == index) next[8*index +: 8] <= write_data;
    if (running && \dut.is_taken && is_of) next <= number + 1;
end

// ---------------------------------------------------------------------- packets, and samples that leave
// The packet that ended two cycles ago.
wire is_end = is_whole || is_faulty || is_foreign || is_aborted;
wire is_bad = is_foreign || is_aborted;
reg [1:0] good_end, bad_end;
// Whether the samples that wait were taken, with a payload, by their place.
reg [`SAMPLES-1:0] taken;
reg [QUEUE_BITS:0] committed_before, oldest_before;
reg                left, skipped;  // the oldest sample left, or was not to leave
always @(posedge clk) begin
    good_end         <= {good_end[0], rst_n && is_end && !is_bad};
    bad_end          <= {bad_end[0], rst_n && is_end && is_bad};
    committed_before <= \dut.first_r ;
    oldest_before    <= \dut.oldest_r ;
    left             <= rst_n && m_axis_tvalid && m_axis_tready && m_axis_tlast;
    skipped          <= rst_n && judged != 0 && !taken[\dut.oldest_r [0]] ;
    if (\dut.judge_r == JUDGING)
        taken[\dut.judged_r [0]] <= \dut.is_taken && \dut.candidate_r [ENTRY_BITS-1];
end

// ---------------------------------------------------------------------- what ties the registers to it
(* hierconn *) wire                   \dut.spare_r ;
(* hierconn *) wire                   \dut.pushes ;
(* hierconn *) wire                   \dut.submessage_r ;
(* hierconn *) wire                   \dut.queued_r ;
(* hierconn *) wire                   \dut.keeps_r ;
(* hierconn *) wire [0:0]             \dut.kept[0] ;
(* hierconn *) wire [0:0]             \dut.kept[1] ;
(* hierconn *) wire [1:0]             \dut.state_r ;
(* hierconn *) wire [NUMBER_BITS-1:0] \dut.next_r ;
(* hierconn *) wire [NUMBER_BITS-1:0] \dut.after_r ;
(* hierconn *) wire                   \dut.equal_r ;
(* hierconn *) wire                   \dut.later_r ;
(* hierconn *) wire [ENTRY_BITS-1:0]  \dut.entries[0] ;
(* hierconn *) wire [ENTRY_BITS-1:0]  \dut.entries[1] ;
(* hierconn *) wire [7:0] \dut.all_bytes_n1_digits[0] , \dut.all_bytes_n1_digits[1] ;
(* hierconn *) wire [7:0] \dut.all_bytes_n2_digits[0] , \dut.all_bytes_n2_digits[1] ;
(* hierconn *) wire [7:0] \dut.all_bytes_n3_digits[0] , \dut.all_bytes_n3_digits[1] ;
(* hierconn *) wire [7:0] \dut.all_bytes_n4_digits[0] , \dut.all_bytes_n4_digits[1] ;
(* hierconn *) wire [7:0] \dut.all_bytes_n5_digits[0] , \dut.all_bytes_n5_digits[1] ;
(* hierconn *) wire [7:0] \dut.all_bytes_n6_digits[0] , \dut.all_bytes_n6_digits[1] ;
wire [NUMBER_BITS-1:0] first_digits = {
    \dut.all_bytes_n6_digits[0] , \dut.all_bytes_n5_digits[0] , \dut.all_bytes_n4_digits[0] ,
    \dut.all_bytes_n3_digits[0] , \dut.all_bytes_n2_digits[0] , \dut.all_bytes_n1_digits[0] };
wire [NUMBER_BITS-1:0] second_digits = {
    \dut.all_bytes_n6_digits[1] , \dut.all_bytes_n5_digits[1] , \dut.all_bytes_n4_digits[1] ,
    \dut.all_bytes_n3_digits[1] , \dut.all_bytes_n2_digits[1] , \dut.all_bytes_n1_digits[1] };
wire [NUMBER_BITS-1:0] digits = writer ? second_digits : first_digits;
// The numbers begin with any value, and nothing is judged in the reset.
always @* if (!rst_n) assume (digits == next && !\dut.is_taken );
wire [ENTRY_BITS-1:0] entry = \dut.judged_r [0] ? \dut.entries[1] : \dut.entries[0] ;

always @* if (running) begin
    no_gap_if_reliable: assert (!(\dut.is_taken && is_of && \dut.strict_r ) || number == next);
    once_and_in_order: assert (!(\dut.is_taken && is_of) || number >= next);
    only_of_the_writer_that_sent: assert (!\dut.is_taken || \dut.same_r );
    nothing_refused_that_is_next: assert (!(\dut.judge_r == JUDGING && is_of && \dut.same_r ) || \dut.is_taken
                                          || number < next || (\dut.strict_r && number != next));
    nothing_judged_under_lock: assert (!is_locked || \dut.judge_r == WAITING);
    if (was_locked && was_chosen == writer && read_place < 6)
        window_is_shown: assert (number_byte == next_before[8*read_place +: 8]);
    each_once: assert (!\dut.is_taken || (\dut.judge_r == JUDGING && judged != first));

    one_commit_a_packet: assert (!was_running || \dut.first_r == committed_before || good_end[1]);
    all_of_a_good_packet: assert (!(was_running && good_end[1]) || \dut.first_r == \dut.last_r );
    nothing_of_a_bad_packet: assert (!(was_running && bad_end[1]) || \dut.last_r == committed_before);
    only_taken_ones_leave: assert (!m_axis_tvalid || (judged != 0 && taken[\dut.oldest_r [0]]));
    each_leaves_once: assert (!was_running || \dut.oldest_r == oldest_before + left
                              || (skipped && \dut.oldest_r == oldest_before + 1'b1));

    helper_digits: assert (digits == next);
    helper_order: assert (judged <= first && first <= last && last <= 2);
    helper_room: assert (!\dut.pushes || last < 2);
    helper_push: assert (\dut.submessage_r == was_submessage);
    helper_leaving: assert (\dut.state_r != 3 && (\dut.state_r == 0 || judged != 0));
    if (\dut.state_r != 0) helper_keeps: assert (\dut.keeps_r == taken[\dut.oldest_r [0]] );
    if (judged != 0) helper_kept: assert (taken[\dut.oldest_r [0]] ==
                                          (\dut.oldest_r [0] ? \dut.kept[1] : \dut.kept[0] ));
    if (judged == 2) helper_kept_later: assert (taken[!\dut.oldest_r [0]] ==
                                                (\dut.oldest_r [0] ? \dut.kept[0] : \dut.kept[1] ));
    helper_queued: assert (!(\dut.judge_r == WAITING && \dut.queued_r ) || judged != first);
    if ((\dut.judge_r == WAITING && \dut.queued_r ) || \dut.judge_r == COMPARING || \dut.judge_r == JUDGING)
        helper_candidate: assert (judged != first && \dut.candidate_r == entry);
    if (\dut.judge_r == COMPARING && is_of) helper_next: assert (\dut.next_r == next);
    if (\dut.judge_r == JUDGING && is_of)
        helper_verdict: assert (\dut.equal_r == (number == next) && \dut.later_r == (number > next)
                                && \dut.after_r == number + 1);
end

endmodule
