// SPDX-License-Identifier: Apache-2.0
// A merge of messages: the sink sees whole messages of one source at a time, unchanged, and every source has its turn.
//
// Assumed: the first cycle is a reset, and no other is; a complete message is open. Messages may be withdrawn at any
// time. The fields of a source are its number: the merge does not look at fields, so that what holds for these holds for
// all.
module message_merge (input clk);

localparam N = `SOURCES;
localparam BITS = `FIELD_BITS;

(* anyseq *) wire [2*N-1:0]  source_offers;
wire [2*N-1:0]               source_takes;
wire [BITS-1:0]              sink_fields;
wire [1:0]                   sink_offers;
(* anyseq *) wire [1:0]      sink_takes;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

wire [N*BITS-1:0] source_fields;
wire [N-1:0]      open;
wire [N-1:0]      is_taken;
genvar k;
generate for (k = 0; k < N; k = k + 1) begin : each
    wire [BITS-1:0] number = k;
    assign source_fields[BITS*k +: BITS] = number;
    assign open[k]     = source_offers[2*k];
    assign is_taken[k] = source_takes[2*k] || source_takes[2*k+1];
    always @* assume (open[k] || !source_offers[2*k+1]);
end endgenerate

firm_message_merge dut (
    .clk(clk),
    .rst_n(rst_n),
    .source_fields(source_fields),
    .source_offers(source_offers),
    .source_takes(source_takes),
    .sink_fields(sink_fields),
    .sink_offers(sink_offers),
    .sink_takes(sink_takes));

wire is_open = sink_offers[0];
wire is_done = sink_offers[1] && sink_takes[0];
wire [N-1:0] at_sink = is_open ? 1'b1 << sink_fields : 0;

// What was in the cycle before.
reg         ran_before = 0;
reg [N-1:0] open_before;
reg [N-1:0] at_sink_before;
reg         is_done_before;
always @(posedge clk) begin
    ran_before     <= running;
    open_before    <= open;
    at_sink_before <= at_sink;
    is_done_before <= is_done;
end
wire all_stay = (open_before & ~(is_done_before ? at_sink_before : 0) & ~open) == 0;

// Any one source, and the messages of others that ended while it was open.
(* anyconst *) wire [BITS-1:0] waiting;
always @* assume (waiting < N);
reg [3:0] others;
always @(posedge clk) begin
    if (!rst_n || !open[waiting] || at_sink[waiting]) others <= 0;
    else others <= others + is_done;
end

always @* if (running) begin
    if (is_open) begin
        comes_from_its_source: assert (sink_fields < N && source_offers[2*sink_fields +: 2] == sink_offers);
        taken_as_the_sink_takes: assert (source_takes[2*sink_fields +: 2] == sink_takes);
    end
    takes_reach_only_it: assert ((open & is_taken & ~at_sink) == 0);
    if (ran_before) begin
        // A message that stays open keeps the sink.
        source_stays: assert (is_done_before || (at_sink_before & open & ~at_sink) == 0);
        // An idle sink sees a message after one cycle.
        idle_for_one_cycle: assert (at_sink_before != 0 || open_before == 0 || !all_stay || is_open);
        // A message that waits follows at once.
        no_gap: assert (!is_done_before || (open_before & ~at_sink_before) == 0 || !all_stay
                        || (is_open && at_sink != at_sink_before));
    end
    after_at_most_all_others: assert (others <= N-1);
end

endmodule
