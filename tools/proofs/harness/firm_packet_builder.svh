// SPDX-License-Identifier: Apache-2.0
// Assumed: while a packet is built, its fields are not written.
(* anyseq *) wire                     start;
(* anyseq *) wire [`ADDRESS_BITS-1:0] entry;
(* anyseq *) wire [`BANK_BITS-1:0]    bank;
(* anyseq *) wire [15:0]              payload_bytes;
(* anyseq *) wire                     field_valid;
(* anyseq *) wire [`BANK_BITS-1:0]    field_bank;
(* anyseq *) wire [6:0]               field_address;
(* anyseq *) wire [10:0]              program_word;
(* anyseq *) wire                     s_axis_tvalid;
(* anyseq *) wire                     m_axis_tready;
wire                                  is_busy;

firm_packet_builder dut (
    .clk(clk),
    .rst_n(rst_n),
    .start(start),
    .entry(entry),
    .bank(bank),
    .payload_bytes(payload_bytes),
    .is_busy(is_busy),
    .field_valid(field_valid),
    .field_bank(field_bank),
    .field_address(field_address),
    .program_word(program_word),
    .s_axis_tvalid(s_axis_tvalid),
    .m_axis_tready(m_axis_tready));

(* hierconn *) wire                  \dut.valid_r ;
(* hierconn *) wire                  \dut.final_r ;
(* hierconn *) wire                  \dut.fetched_r ;
(* hierconn *) wire                  \dut.shown_r ;
(* hierconn *) wire [10:0]           \dut.word_r ;
(* hierconn *) wire [`BANK_BITS-1:0] \dut.bank_r ;

always @* if (field_valid && is_busy) assume (field_bank != \dut.bank_r );

always @* if (!is_first_cycle) begin
    helper_busy: assert (is_busy || !(\dut.fetched_r || \dut.shown_r || (\dut.valid_r && \dut.final_r )));
    helper_word: assert (!\dut.fetched_r || \dut.shown_r != \dut.word_r [10]);
    helper_final: assert (!(\dut.valid_r && \dut.final_r ) || !(\dut.fetched_r || \dut.shown_r ));
end
