// SPDX-License-Identifier: Apache-2.0
// Ports of the modules that are compared, and their connections: streams from N sources of W bits, and one to a sink or
// to N sinks that share its data.
`define FROM(W, N) \
    input  [(N)*(W)-1:0]   s_axis_tdata, \
    input  [(N)*(W)/8-1:0] s_axis_tkeep, \
    input  [(N)-1:0]       s_axis_tuser, \
    input  [(N)-1:0]       s_axis_tvalid, \
    input  [(N)-1:0]       s_axis_tlast, \
    output [(N)-1:0]       s_axis_tready

`define TO(W, N) \
    output [(W)-1:0]       m_axis_tdata, \
    output [(W)/8-1:0]     m_axis_tkeep, \
    output                 m_axis_tuser, \
    output                 m_axis_tlast, \
    output [(N)-1:0]       m_axis_tvalid, \
    input  [(N)-1:0]       m_axis_tready

`define SOURCE \
    .s_axis_tdata(s_axis_tdata), .s_axis_tkeep(s_axis_tkeep), .s_axis_tvalid(s_axis_tvalid), \
    .s_axis_tlast(s_axis_tlast), .s_axis_tready(s_axis_tready)

`define SINK \
    .m_axis_tdata(m_axis_tdata), .m_axis_tkeep(m_axis_tkeep), .m_axis_tvalid(m_axis_tvalid), \
    .m_axis_tlast(m_axis_tlast), .m_axis_tready(m_axis_tready)

`define MARKS .s_axis_tuser(s_axis_tuser), .m_axis_tuser(m_axis_tuser)
