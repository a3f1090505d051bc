// SPDX-License-Identifier: Apache-2.0
// Entities of Open Logic; `rst` is active high. A beat with its marks is a word. It has neither a multiplexer of
// several sources nor a demultiplexer.
`define WORD {s_axis_tlast, s_axis_tuser, s_axis_tkeep, s_axis_tdata}
`define RESULT {m_axis_tlast, m_axis_tuser, m_axis_tkeep, m_axis_tdata}

module register_slice (input clk, rst, `FROM(64, 1), `TO(64, 1));
    olo_base_pl_stage #(.Width_g(74)) part (
        .Clk(clk), .Rst(rst), .In_Valid(s_axis_tvalid), .In_Ready(s_axis_tready), .In_Data(`WORD),
        .Out_Valid(m_axis_tvalid), .Out_Ready(m_axis_tready), .Out_Data(`RESULT));
endmodule

module widening (input clk, rst, `FROM(8, 1), `TO(64, 1));
    olo_base_wconv_n2xn #(.InWidth_g(8), .OutWidth_g(64)) part (
        .Clk(clk), .Rst(rst), .In_Valid(s_axis_tvalid), .In_Ready(s_axis_tready), .In_Data(s_axis_tdata),
        .In_Last(s_axis_tlast), .Out_Valid(m_axis_tvalid), .Out_Ready(m_axis_tready), .Out_Data(m_axis_tdata),
        .Out_Last(m_axis_tlast), .Out_WordEna(m_axis_tkeep));
endmodule

module narrowing (input clk, rst, `FROM(64, 1), `TO(8, 1));
    olo_base_wconv_xn2n #(.InWidth_g(64), .OutWidth_g(8)) part (
        .Clk(clk), .Rst(rst), .In_Valid(s_axis_tvalid), .In_Ready(s_axis_tready), .In_Data(s_axis_tdata),
        .In_Last(s_axis_tlast), .In_WordEna(s_axis_tkeep), .Out_Valid(m_axis_tvalid), .Out_Ready(m_axis_tready),
        .Out_Data(m_axis_tdata), .Out_Last(m_axis_tlast));
endmodule

module fifo (input clk, rst, `FROM(64, 1), `TO(64, 1));
    olo_base_fifo_sync #(.Width_g(74), .Depth_g(512)) part (
        .Clk(clk), .Rst(rst), .In_Valid(s_axis_tvalid), .In_Ready(s_axis_tready), .In_Data(`WORD),
        .Out_Valid(m_axis_tvalid), .Out_Ready(m_axis_tready), .Out_Data(`RESULT));
endmodule

module crossing (input clk, rst, m_clk, m_rst, `FROM(64, 1), `TO(64, 1));
    olo_base_fifo_async #(.Width_g(73), .Depth_g(16)) part (
        .In_Clk(clk), .In_Rst(rst), .Out_Clk(m_clk), .Out_Rst(m_rst), .In_Valid(s_axis_tvalid),
        .In_Ready(s_axis_tready), .In_Data({s_axis_tlast, s_axis_tkeep, s_axis_tdata}), .Out_Valid(m_axis_tvalid),
        .Out_Ready(m_axis_tready), .Out_Data({m_axis_tlast, m_axis_tkeep, m_axis_tdata}));
endmodule
