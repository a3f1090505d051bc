// SPDX-License-Identifier: Apache-2.0
// Modules of verilog-axis; `rst` is active high. Inputs without use are zero.
module register_slice (input clk, rst, `FROM(64, 1), `TO(64, 1));
    axis_register #(.DATA_WIDTH(64)) part (.clk(clk), .rst(rst), .s_axis_tid(0), .s_axis_tdest(0), `SOURCE, `SINK, `MARKS);
endmodule

module widening (input clk, rst, `FROM(8, 1), `TO(64, 1));
    axis_adapter #(.S_DATA_WIDTH(8), .M_DATA_WIDTH(64), .USER_ENABLE(0)) part (
        .clk(clk), .rst(rst), .s_axis_tid(0), .s_axis_tdest(0), .s_axis_tuser(0), `SOURCE, `SINK);
endmodule

module narrowing (input clk, rst, `FROM(64, 1), `TO(8, 1));
    axis_adapter #(.S_DATA_WIDTH(64), .M_DATA_WIDTH(8), .USER_ENABLE(0)) part (
        .clk(clk), .rst(rst), .s_axis_tid(0), .s_axis_tdest(0), .s_axis_tuser(0), `SOURCE, `SINK);
endmodule

// The depth is in bytes.
module fifo (input clk, rst, `FROM(64, 1), `TO(64, 1));
    axis_fifo #(.DEPTH(8*512), .DATA_WIDTH(64)) part (
        .clk(clk), .rst(rst), .s_axis_tid(0), .s_axis_tdest(0), .pause_req(0), `SOURCE, `SINK, `MARKS);
endmodule

module crossing (input clk, rst, m_clk, m_rst, `FROM(64, 1), `TO(64, 1));
    axis_async_fifo #(.DEPTH(8*16), .DATA_WIDTH(64), .USER_ENABLE(0)) part (
        .s_clk(clk), .s_rst(rst), .m_clk(m_clk), .m_rst(m_rst), .s_axis_tid(0), .s_axis_tdest(0), .s_axis_tuser(0),
        .s_pause_req(0), .m_pause_req(0), `SOURCE, `SINK);
endmodule

module merging (input clk, rst, `FROM(64, 4), `TO(64, 1));
    axis_arb_mux #(.S_COUNT(4), .DATA_WIDTH(64), .ARB_TYPE_ROUND_ROBIN(1)) part (
        .clk(clk), .rst(rst), .s_axis_tid(0), .s_axis_tdest(0), `SOURCE, `SINK, `MARKS);
endmodule

// All its outputs have the same data. An input selects the sink.
module demultiplexer (input clk, rst, input [1:0] select, `FROM(64, 1), `TO(64, 4));
    wire [3*64-1:0] tdata;
    wire [3*8-1:0]  tkeep;
    wire [2:0]      tuser, tlast;
    axis_demux #(.M_COUNT(4), .DATA_WIDTH(64)) part (
        .clk(clk), .rst(rst), .enable(1'b1), .drop(1'b0), .select(select), .s_axis_tid(0), .s_axis_tdest(0), `SOURCE,
        .s_axis_tuser(s_axis_tuser), .m_axis_tdata({tdata, m_axis_tdata}), .m_axis_tkeep({tkeep, m_axis_tkeep}),
        .m_axis_tuser({tuser, m_axis_tuser}), .m_axis_tlast({tlast, m_axis_tlast}), .m_axis_tvalid(m_axis_tvalid),
        .m_axis_tready(m_axis_tready));
endmodule
