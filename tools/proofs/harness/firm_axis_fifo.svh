// SPDX-License-Identifier: Apache-2.0
// With equal indices, firm_axis_fifo is full or empty.
localparam BITS = $clog2(`DEPTH);

(* anyseq *) wire s_axis_tvalid;
(* anyseq *) wire m_axis_tready;

firm_axis_fifo dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tvalid(s_axis_tvalid),
    .m_axis_tready(m_axis_tready));

(* hierconn *) wire [BITS-1:0] \dut.write_index_r ;
(* hierconn *) wire [BITS-1:0] \dut.read_index_r ;
(* hierconn *) wire            \dut.ready_r ;
(* hierconn *) wire            \dut.filled_r ;

always @* if (!is_first_cycle) begin
    helper_indices: assert (\dut.write_index_r < `DEPTH && \dut.read_index_r < `DEPTH);
    helper_full_or_empty: assert (\dut.write_index_r != \dut.read_index_r || !(\dut.ready_r && \dut.filled_r ));
end
