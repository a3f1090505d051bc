// SPDX-License-Identifier: Apache-2.0
// The node of tests/cores/net_node.vhd, to which its frames return, and a host of LiteEth at the other end of its GMII.
module liteeth_bench (
    input         clk,
    input         rst_n,
    input         tick,

    // The frames of the node.
    output [7:0]  frame_tdata,
    output        frame_tvalid,
    output        frame_tready,
    output        frame_tlast,

    // A payload to a port of the node.
    input         sink_valid,
    output        sink_ready,
    input         sink_last,
    input  [7:0]  sink_data,
    input  [15:0] sink_dst_port,
    input  [15:0] sink_length,

    // Payloads from the node, to two ports.
    output        discovery_valid,
    output        discovery_last,
    output [7:0]  discovery_data,
    output [31:0] discovery_ip_address,
    output [15:0] discovery_length,
    output        user_valid,
    output        user_last,
    output [7:0]  user_data,
    output [31:0] user_ip_address,
    output [15:0] user_length
);

wire       node_en, host_en;
wire [7:0] node_data, host_data;

net_node node (
    .clk(clk),
    .rst_n(rst_n),
    .tick(tick),
    .rx_dv(host_en),
    .rxd(host_data),
    .tx_en(node_en),
    .txd(node_data),
    .m_axis_tdata(frame_tdata),
    .m_axis_tvalid(frame_tvalid),
    .m_axis_tlast(frame_tlast),
    .m_axis_tready(frame_tready),
    .s_axis_tdata(frame_tdata),
    .s_axis_tvalid(frame_tvalid),
    .s_axis_tlast(frame_tlast),
    .s_axis_tready(frame_tready),
    .peer_count(),
    .source_count(),
    .sink_count()
);

liteeth_host host (
    .sys_clk(clk),
    .sys_rst(!rst_n),
    .gmii_rx_dv(node_en),
    .gmii_rx_data(node_data),
    .gmii_tx_en(host_en),
    .gmii_tx_data(host_data),
    .gmii_tx_er(),
    .sink_valid(sink_valid),
    .sink_ready(sink_ready),
    .sink_last(sink_last),
    .sink_last_be(sink_last),
    .sink_data(sink_data),
    .sink_src_port(16'd7411),
    .sink_dst_port(sink_dst_port),
    .sink_ip_address(32'hc0000209),
    .sink_length(sink_length),
    .discovery_valid(discovery_valid),
    .discovery_last(discovery_last),
    .discovery_data(discovery_data),
    .discovery_src_port(),
    .discovery_ip_address(discovery_ip_address),
    .discovery_length(discovery_length),
    .user_valid(user_valid),
    .user_last(user_last),
    .user_data(user_data),
    .user_src_port(),
    .user_ip_address(user_ip_address),
    .user_length(user_length)
);

endmodule
