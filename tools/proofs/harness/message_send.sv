// SPDX-License-Identifier: Apache-2.0
// The publisher of an exchange: each message leaves as frames of its fields, the lowest beat first, with zeros after
// them, one frame for each destination in turn, without a gap.
//
// Assumed: the first cycle is a reset, and no other is.
module message_send (input clk);

localparam WIDTH  = `WIDTH;
localparam FIELDS = `FIELD_BITS;
localparam COPIES = `COPIES;
localparam BEATS  = (FIELDS + WIDTH - 1) / WIDTH;
localparam BITS   = BEATS * WIDTH;
localparam DEST   = COPIES > 1 ? $clog2(COPIES) : 1;

(* anyseq *) wire [FIELDS-1:0] fields;
(* anyseq *) wire              valid;
wire                           ready;
wire [WIDTH-1:0]               m_tdata;
wire [DEST-1:0]                m_tdest;
wire                           m_tvalid, m_tlast;
(* anyseq *) wire              m_tready;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

firm_message_send dut (
    .clk(clk),
    .rst_n(rst_n),
    .fields(fields),
    .valid(valid),
    .ready(ready),
    .m_axis_tdata(m_tdata),
    .m_axis_tdest(m_tdest),
    .m_axis_tvalid(m_tvalid),
    .m_axis_tlast(m_tlast),
    .m_axis_tready(m_tready));

// The message that leaves, the beat of its frame and the frame.
reg             is_leaving;
reg [BITS-1:0]  message;
reg [7:0]       beat;
reg [7:0]       copy;
wire ends_frame   = beat == BEATS - 1;
wire ends_message = ends_frame && copy == COPIES - 1;

reg             stalled;
reg [WIDTH-1:0] before;
always @(posedge clk) begin
    stalled <= rst_n && m_tvalid && !m_tready;
    before  <= m_tdata;
    if (!rst_n) begin
        is_leaving <= 0;
        beat       <= 0;
        copy       <= 0;
    end else if (valid && ready) begin
        is_leaving <= 1;
        message    <= fields;
        beat       <= 0;
        copy       <= 0;
    end else if (is_leaving && m_tready) begin
        is_leaving <= !ends_message;
        beat       <= ends_frame ? 0 : beat + 1;
        copy       <= copy + ends_frame;
    end
end

// The registers turn by a beat at a time.
wire [2*BITS-1:0] twice = {message, message};
wire [BITS-1:0]   turned = twice[WIDTH*beat +: BITS];
(* hierconn *) wire [DEST-1:0]  \dut.copy_r ;
(* hierconn *) wire [BITS-1:0]  \dut.message_r ;
(* hierconn *) wire             \dut.ends_r ;
// With one beat, its register is a constant.
`ifdef FIELD_BITS_5
`elsif FIELD_BITS_8
`else
(* hierconn *) wire [$clog2(BEATS)-1:0] \dut.position_r ;
always @* if (running && is_leaving) helper_position: assert (\dut.position_r == beat);
`endif
always @* if (running) begin
    helper_in_a_frame: assert (!is_leaving || (beat < BEATS && copy < COPIES));
    if (is_leaving) begin
        helper_copy: assert (\dut.copy_r == copy);
        helper_turned: assert (\dut.message_r == turned);
        helper_end: assert (\dut.ends_r == ends_message);
    end
end

always @* if (running) begin
    offered_without_a_gap: assert (m_tvalid == is_leaving);
    beat_stays: assert (!stalled || (m_tvalid && m_tdata == before));
    takes_the_next_at_its_end: assert (ready == (!is_leaving || (m_tready && ends_message)));
    if (is_leaving) begin
        beats_in_order: assert (m_tdata == turned[WIDTH-1:0]);
        last_is_marked: assert (m_tlast == ends_frame);
        copies_in_order: assert (m_tdest == copy);
    end
end

endmodule
