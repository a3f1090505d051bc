// SPDX-License-Identifier: Apache-2.0
// The level of firm_wiznet_fifo is the distance from the read place to the write place.
(* anyseq *) wire s_axis_tvalid;
(* anyseq *) wire m_axis_tready;

firm_wiznet_fifo dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tvalid(s_axis_tvalid),
    .m_axis_tready(m_axis_tready));

(* hierconn *) wire [5:0] \dut.write_r ;
(* hierconn *) wire [5:0] \dut.read_r ;
(* hierconn *) wire [5:0] \dut.level_r ;

always @* if (!is_first_cycle) helper_distance: assert (\dut.level_r == 6'(\dut.write_r - \dut.read_r ));
