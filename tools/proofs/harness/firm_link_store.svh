// SPDX-License-Identifier: Apache-2.0
// Bytes that can leave firm_link_store lie between the read place and the start of the incoming frame.
localparam BITS = $clog2(`LONGEST + `SPARE + 6);

(* anyseq *) wire [7:0] data;
(* anyseq *) wire       valid;
(* anyseq *) wire       ends;
(* anyseq *) wire       is_wrong;
(* anyseq *) wire       is_lost;
(* anyseq *) wire       m_ready;

firm_link_store dut (
    .clk(clk),
    .rst_n(rst_n),
    .data(data),
    .valid(valid),
    .ends(ends),
    .is_wrong(is_wrong),
    .is_lost(is_lost),
    .m_ready(m_ready));

(* hierconn *) wire [BITS-1:0] \dut.start_r ;
(* hierconn *) wire [BITS-1:0] \dut.write_r ;
(* hierconn *) wire [BITS-1:0] \dut.read_r ;

// Distances from the place of the next read.
wire [BITS-1:0] committed = \dut.start_r - \dut.read_r ;
wire [BITS-1:0] written = \dut.write_r - \dut.read_r ;

always @* if (!is_first_cycle) begin
    helper_order: assert (committed <= written);
end
