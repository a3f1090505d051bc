// SPDX-License-Identifier: Apache-2.0
// The reader of an exchange: each frame becomes one message, whose fields are those that were sent and stay until the
// message is taken; nothing of the next frame enters before.
//
// Assumed: the first cycle is a reset, and no other is; each frame has the beats of a message.
module message_receive (input clk);

localparam WIDTH  = `WIDTH;
localparam FIELDS = `FIELD_BITS;
localparam BEATS  = (FIELDS + WIDTH - 1) / WIDTH;
localparam BITS   = BEATS * WIDTH;

(* anyseq *) wire [WIDTH-1:0] s_tdata;
(* anyseq *) wire             s_tvalid;
wire                          s_tready;
wire [FIELDS-1:0]             fields;
wire                          valid;
(* anyseq *) wire             ready;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

// The beats of the frame that arrives, the lowest ones first, and the complete message.
reg [7:0]      beat;
reg [BITS-1:0] coming;
reg            has_message;
reg [BITS-1:0] message;
wire           s_tlast = beat == BEATS - 1;
wire           take    = s_tvalid && s_tready;

firm_message_receive dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata(s_tdata),
    .s_axis_tvalid(s_tvalid),
    .s_axis_tlast(s_tlast),
    .s_axis_tready(s_tready),
    .fields(fields),
    .valid(valid),
    .ready(ready));

wire [BITS+WIDTH-1:0] entering = {s_tdata, coming};
reg              stalled;
reg [FIELDS-1:0] before;
always @(posedge clk) begin
    stalled <= rst_n && valid && !ready;
    before  <= fields;
    if (!rst_n) begin
        beat        <= 0;
        has_message <= 0;
    end else begin
        if (ready) has_message <= 0;
        if (take) begin
            // The first beat is the lowest one when the last one has entered at the top.
            coming <= entering[WIDTH +: BITS];
            beat   <= s_tlast ? 0 : beat + 1;
            if (s_tlast) begin
                has_message <= 1;
                message     <= entering[WIDTH +: BITS];
            end
        end
    end
end

(* hierconn *) wire [BITS-1:0] \dut.message_r ;
always @* if (running) begin
    helper_in_a_frame: assert (beat < BEATS);
    helper_one_at_a_time: assert (!has_message || beat == 0);
    helper_message: assert (!has_message || \dut.message_r == message);
    // The beats that have entered are at the top.
    helper_beats: assert (((\dut.message_r ^ coming) >> (BITS - WIDTH*beat)) == 0);
end

always @* if (running) begin
    offered_when_complete: assert (valid == has_message);
    message_stays: assert (!stalled || (valid && fields == before));
    room_when_taken: assert (s_tready == (ready || !has_message));
    if (valid) fields_are_those_sent: assert (fields == message[FIELDS-1:0]);
end

endmodule
