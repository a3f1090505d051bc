// SPDX-License-Identifier: Apache-2.0
// A queue of messages: each message leaves once and in order, or is dropped because the queue is full; the message at
// the sink stays until it is taken.
//
// Assumed: the first cycle is a reset, and no other is. The fields of a message are its number: the queue does not look
// at fields, so that what holds for these holds for all.
module message_queue (input clk);

localparam BITS = `FIELD_BITS;

(* anyseq *) wire source_valid;
wire              source_ready;
wire [BITS-1:0]   sink_fields;
wire              sink_valid;
(* anyseq *) wire sink_ready;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

reg [BITS-1:0] number;   // of the message at the source
reg [BITS-1:0] held;     // messages in the queue
reg [BITS-1:0] next;     // the lowest number that may leave next
wire take    = source_valid && source_ready;
wire give    = sink_valid && sink_ready;
wire is_full = held == `MESSAGES;
// With DROP_OLDEST, a message takes the place of another one, unless one leaves.
wire enters  = take && (!is_full || (`DROP_OLDEST && give));

firm_message_queue dut (
    .clk(clk),
    .rst_n(rst_n),
    .source_fields(number),
    .source_valid(source_valid),
    .source_ready(source_ready),
    .sink_fields(sink_fields),
    .sink_valid(sink_valid),
    .sink_ready(sink_ready));

reg            m_stalled;
reg [BITS-1:0] m_before;
always @(posedge clk) begin
    m_stalled <= rst_n && sink_valid && !sink_ready;
    m_before  <= sink_fields;
    if (!rst_n) begin
        number <= 0;
        held   <= 0;
        next   <= 0;
    end else begin
        number <= number + take;
        held   <= held + enters - give;
        if (give) next <= sink_fields + 1;
    end
end

always @* if (running) begin
    valid_stays: assert (!m_stalled || sink_valid);
    payload_stays: assert (!m_stalled || sink_fields == m_before);
    offered_if_held: assert (sink_valid == (held != 0));
    ready_if_room: assert (source_ready == (`DROP_NEWEST || `DROP_OLDEST || !is_full));
    if (sink_valid) in_order_once: assert (sink_fields >= next && sink_fields < number);
    if (sink_valid && !`DROP_NEWEST && !`DROP_OLDEST) nothing_dropped: assert (sink_fields == next);
end

endmodule
