// SPDX-License-Identifier: Apache-2.0
// Our entities; `rst` is active low.
module register_slice (input clk, rst, `FROM(64, 1), `TO(64, 1));
    firm_axis_register_slice #(.WIDTH(64)) part (.clk(clk), .rst_n(rst), `SOURCE, `SINK, `MARKS);
endmodule

module widening (input clk, rst, `FROM(8, 1), `TO(64, 1));
    firm_axis_resize #(.S_WIDTH(8), .M_WIDTH(64)) part (.clk(clk), .rst_n(rst), .is_open(1'b1), `SOURCE, `SINK);
endmodule

module narrowing (input clk, rst, `FROM(64, 1), `TO(8, 1));
    firm_axis_resize #(.S_WIDTH(64), .M_WIDTH(8)) part (.clk(clk), .rst_n(rst), .is_open(1'b1), `SOURCE, `SINK);
endmodule

module fifo (input clk, rst, `FROM(64, 1), `TO(64, 1));
    firm_axis_fifo #(.WIDTH(64), .DEPTH(512)) part (.clk(clk), .rst_n(rst), `SOURCE, `SINK, `MARKS);
endmodule

module crossing (input clk, rst, m_clk, m_rst, `FROM(64, 1), `TO(64, 1));
    firm_cdc_stream #(.S_WIDTH(64), .M_WIDTH(64), .DEPTH(16)) part (
        .s_clk(clk), .s_rst_n(rst), .m_clk(m_clk), .m_rst_n(m_rst),
        .s_open(1'b1), .s_enable(1'b1), .m_open(1'b1), `SOURCE, `SINK);
endmodule

// A scheduler, a multiplexer, and a slice that registers what it gives.
module merging (input clk, rst, `FROM(64, 4), `TO(64, 1));
    wire        grant, tuser, tvalid, tlast, tready;
    wire [1:0]  select;
    wire [63:0] tdata;
    wire [7:0]  tkeep;
    firm_sched_round_robin #(.REQUESTERS(4)) scheduler (
        .clk(clk), .rst_n(rst), .request(s_axis_tvalid), .beat(tvalid && tready), .last(tlast),
        .grant_valid(grant), .grant_select(select));
    firm_axis_mux #(.WIDTH(64), .SOURCES(4)) multiplexer (
        .source(select), .enable(grant), `SOURCE, .s_axis_tuser(s_axis_tuser),
        .m_axis_tdata(tdata), .m_axis_tkeep(tkeep), .m_axis_tuser(tuser), .m_axis_tvalid(tvalid),
        .m_axis_tlast(tlast), .m_axis_tready(tready));
    firm_axis_register_slice #(.WIDTH(64)) slice (
        .clk(clk), .rst_n(rst), .s_axis_tdata(tdata), .s_axis_tkeep(tkeep), .s_axis_tuser(tuser),
        .s_axis_tvalid(tvalid), .s_axis_tlast(tlast), .s_axis_tready(tready), `SINK, .m_axis_tuser(m_axis_tuser));
endmodule

// The slice registers what the demultiplexer routes by the id in its frame's first beat.
module demultiplexer (input clk, rst, input [1:0] select, `FROM(64, 1), `TO(64, 4));
    wire        tuser, tvalid, tlast, tready;
    wire [63:0] tdata;
    wire [7:0]  tkeep;
    firm_axis_register_slice #(.WIDTH(64)) slice (
        .clk(clk), .rst_n(rst), `SOURCE, .s_axis_tuser(s_axis_tuser),
        .m_axis_tdata(tdata), .m_axis_tkeep(tkeep), .m_axis_tuser(tuser), .m_axis_tvalid(tvalid),
        .m_axis_tlast(tlast), .m_axis_tready(tready));
    firm_axis_demux #(.WIDTH(64), .DESTINATIONS(4)) part (
        .clk(clk), .rst_n(rst), .high(8'b0), .has_high(1'b1), .s_axis_tdata(tdata), .s_axis_tkeep(tkeep),
        .s_axis_tuser(tuser), .s_axis_tvalid(tvalid), .s_axis_tlast(tlast), .s_axis_tready(tready), `SINK,
        .m_axis_tuser(m_axis_tuser));
endmodule
