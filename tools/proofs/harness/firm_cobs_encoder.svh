// SPDX-License-Identifier: Apache-2.0
// Bytes that can leave firm_cobs_encoder lie between the read place and that of the next code.
localparam BITS = $clog2(`DEPTH);

(* anyseq *) wire [7:0] data;
(* anyseq *) wire       last;
(* anyseq *) wire       valid;
(* anyseq *) wire       coded_ready;

firm_cobs_encoder dut (
    .clk(clk),
    .rst_n(rst_n),
    .data(data),
    .last(last),
    .valid(valid),
    .coded_ready(coded_ready));

(* hierconn *) wire [BITS-1:0] \dut.code_place_r ;
(* hierconn *) wire [BITS-1:0] \dut.write_r ;
(* hierconn *) wire [BITS-1:0] \dut.read_r ;

// Distances from the place of the next read.
wire [BITS-1:0] committed = \dut.code_place_r - \dut.read_r ;
wire [BITS-1:0] written = \dut.write_r - \dut.read_r ;

always @* if (!is_first_cycle) begin
    helper_order: assert (committed < written);
end
