// SPDX-License-Identifier: Apache-2.0
// A Manager of Managers with a watchdog: the frame of a publisher that stops in the middle of it ends with exactly one
// abort, which is reported, the rest of that frame never leaves, and a publisher that keeps up is never aborted. How
// soon a stopped one is cut off is proved in tree_watchdog_limits.sv.
module tree_watchdog (input clk);

`include "watched_tree_environment.svh"

wire [COUNT_BITS-1:0]  expected [`PUBLISHERS-1:0];  // the number of the publisher's next frame at the host
// The publisher was silent in that frame for the watchdog's cycles, in three of which the tree was ready: one for each
// pulse of the shared timer.
wire [`PUBLISHERS-1:0] has_paused;
wire [`PUBLISHERS-1:0] is_reported;      // that frame was reported
wire [`PUBLISHERS-1:0] may_be_reported;  // the frame being sent was not
genvar index;
generate for (index = 0; index < `PUBLISHERS; index = index + 1) begin : publishers
    reg [COUNT_BITS-1:0] given;
    reg [2:0]            pause;    // cycles on end in a frame without a beat
    reg [1:0]            awaited;  // those of them in which the tree was ready, up to 3
    reg [3:0]            paused;   // by the number of the frame
    reg [3:0]            reports;  // also
    wire                 waits  = has_begun[index] && !pub_axis_tvalid[index];
    wire                 begins = takes[index] && !has_begun[index];
    localparam [SOURCE_BITS-1:0] INDEX = index;
    assign expected[index]        = given;
    assign has_paused[index]      = paused[given];
    assign is_reported[index]     = reports[given];
    assign may_be_reported[index] = has_begun[index] && !reports[sent[index]];
    always @(posedge clk) begin
        if (!rst_n) begin
            given   <= 0;
            pause   <= 0;
            awaited <= 0;
            paused  <= 0;
            reports <= 0;
        end else begin
            pause   <= !waits ? 0 : pause + (pause != 7);
            awaited <= !waits ? 0 : awaited + (pub_axis_tready[index] && awaited != 3);
            if (begins) paused[sent[index]] <= 0;
            else if (pause >= `WATCHDOG && awaited == 3) paused[sent[index]] <= 1;
            if (begins) reports[sent[index]] <= 0;
            else if (expired[index]) reports[sent[index]] <= 1;
            if (give && publisher_out == INDEX && m_axis_tlast) given <= given + 1'b1;
        end
    end
end endgenerate

always @* if (running) begin
    // Each frame of a publisher is one frame at the host, which begins with its id of two bytes, and is whole or has an
    // abort as its end. Nothing of it leaves later.
    if (m_axis_tvalid) begin
        if (place == 0) begins_with_its_id: assert (m_axis_tdata < `PUBLISHERS && !m_axis_tlast);
        if (place == 1) upper_byte_is_inserted: assert (m_axis_tdata == high_out);
        tid_is_the_id: assert (m_axis_tid == {high_out, 8'b0} + publisher_out);
        if (place == 2 && !aborts) abort_ends_one_frame: assert (
            m_axis_tdata == 128 + 64 * m_axis_tlast + 4 * publisher_out + expected[publisher_out]);
        if (m_axis_tlast && !m_axis_tuser) whole_without_abort: assert (sent[publisher_out] != expected[publisher_out]);
    end
    // A publisher that keeps up is left alone.
    if (aborts) no_hasty_abort: assert (has_paused[publisher_out]);
    // Each abort is reported once, as that of its publisher, and nothing else is.
    if (aborts) each_abort_is_reported: assert (is_reported[publisher_out]);
    no_report_invented: assert ((expired & ~may_be_reported) == 0 &&
        !(m_axis_tvalid && m_axis_tlast && !m_axis_tuser && is_reported[publisher_out]));
end

endmodule
