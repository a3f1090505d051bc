// SPDX-License-Identifier: Apache-2.0
// A frame may be aborted, or too long. Its data play no part.
localparam BITS = $clog2(`DEPTH);

(* anyseq *) wire s_axis_tvalid;
(* anyseq *) wire s_axis_tlast;
(* anyseq *) wire s_axis_tuser;
(* anyseq *) wire m_axis_tready;

firm_axis_length_buffer dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata({`WIDTH{1'b0}}),
    .s_axis_tkeep({`WIDTH/8{1'b1}}),
    .s_axis_tuser(s_axis_tuser),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .m_axis_tready(m_axis_tready));
