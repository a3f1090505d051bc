// SPDX-License-Identifier: Apache-2.0
// The level of firm_axis_fifo is the distance from the read index to the write index.
localparam BITS = $clog2(`DEPTH);

(* anyseq *) wire s_axis_tvalid;
(* anyseq *) wire m_axis_tready;

firm_axis_fifo dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tvalid(s_axis_tvalid),
    .m_axis_tready(m_axis_tready));

(* hierconn *) wire [BITS-1:0]             \dut.write_index_r ;
(* hierconn *) wire [BITS-1:0]             \dut.read_index_r ;
(* hierconn *) wire [$clog2(`DEPTH+1)-1:0] \dut.level_r ;
(* hierconn *) wire                        \dut.ready_r ;
(* hierconn *) wire                        \dut.filled_r ;

wire [BITS+1:0] written = \dut.read_index_r + \dut.level_r ;

always @* if (!is_first_cycle) begin
    helper_indices: assert (\dut.write_index_r < `DEPTH && \dut.read_index_r < `DEPTH && \dut.level_r <= `DEPTH);
    helper_distance: assert (written == \dut.write_index_r || written == \dut.write_index_r + `DEPTH);
    helper_room: assert (!(\dut.ready_r && \dut.level_r == `DEPTH));
    helper_beat: assert (!(\dut.filled_r && \dut.level_r == 0));
end
