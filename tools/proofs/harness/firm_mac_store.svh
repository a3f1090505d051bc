// SPDX-License-Identifier: Apache-2.0
// Bytes that can leave firm_mac_store lie between the read place and the start of the incoming frame.
localparam BITS = $clog2(`DEPTH);

(* anyseq *) wire s_axis_tvalid;
(* anyseq *) wire s_axis_tlast;
(* anyseq *) wire s_axis_tuser;
(* anyseq *) wire m_axis_tready;

firm_mac_store dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tuser(s_axis_tuser),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .m_axis_tready(m_axis_tready));

(* hierconn *) wire [BITS-1:0] \dut.start_r ;
(* hierconn *) wire [BITS-1:0] \dut.write_r ;
(* hierconn *) wire [BITS-1:0] \dut.next_r ;
(* hierconn *) wire [BITS-1:0] \dut.read_r ;

// Distances from the place of the next read.
wire [BITS-1:0] committed = \dut.start_r - \dut.read_r ;
wire [BITS-1:0] written = \dut.write_r - \dut.read_r ;

always @* if (!is_first_cycle) begin
    helper_order: assert (committed <= written);
    helper_next: assert (\dut.next_r == BITS'(\dut.write_r + 1));
end
