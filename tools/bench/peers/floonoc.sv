// SPDX-License-Identifier: Apache-2.0
// The router of FlooNoC at (1, 1) of a mesh: five ports, XY routing, input FIFOs of two flits. A flit has the bits of a
// beat of our routers: data, a mark for each byte, the user's, the last mark and a destination of four bits.
package floonoc_types;
  typedef struct packed { logic [1:0] x; logic [1:0] y; logic port_id; } place_t;
endpackage

module floonoc_router
  import floo_pkg::*;
  import floonoc_types::*;
#(
  parameter int WIDTH = 64
) (
  input  logic                           clk,
  input  logic                           rst_n,
  input  logic [4:0]                     s_valid,
  output logic [4:0]                     s_ready,
  input  logic [5*(WIDTH+WIDTH/8+6)-1:0] s_flit,
  output logic [4:0]                     m_valid,
  input  logic [4:0]                     m_ready,
  output logic [5*(WIDTH+WIDTH/8+6)-1:0] m_flit
);

  localparam int PAYLOAD = WIDTH + WIDTH/8 + 1;
  localparam int BITS = PAYLOAD + 5;
  // What the router does not need is constant.
  typedef struct packed {
    place_t      dst_id;
    place_t      collective_mask;
    place_t      src_id;
    logic        last;
    collect_op_t collective_op;
  } header_t;
  typedef struct packed { header_t hdr; logic [PAYLOAD-1:0] payload; } flit_t;
  flit_t [4:0][0:0] entering, leaving;

  for (genvar port = 0; port < 5; port++) begin : each_port
    assign entering[port][0].hdr.dst_id =
      '{x: s_flit[port*BITS +: 2], y: s_flit[port*BITS+2 +: 2], port_id: 1'b0};
    assign entering[port][0].hdr.last = s_flit[port*BITS+4];
    assign entering[port][0].hdr.collective_mask = '0;
    assign entering[port][0].hdr.src_id = '0;
    assign entering[port][0].hdr.collective_op = collect_op_t'('0);
    assign entering[port][0].payload = s_flit[port*BITS+5 +: PAYLOAD];
    assign m_flit[port*BITS +: BITS] = {
      leaving[port][0].payload, leaving[port][0].hdr.last, leaving[port][0].hdr.dst_id.y, leaving[port][0].hdr.dst_id.x
    };
  end

  floo_router #(
    .NumRoutes(5),
    .NumVirtChannels(1),
    .NumPhysChannels(1),
    .InFifoDepth(2),
    .OutFifoDepth(0),
    .RouteAlgo(XYRouting),
    .id_t(place_t),
    .flit_t(flit_t),
    .hdr_t(header_t)
  ) u_router (
    .clk_i(clk),
    .rst_ni(rst_n),
    .test_enable_i(1'b0),
    .xy_id_i('{x: 2'd1, y: 2'd1, port_id: 1'b0}),
    .id_route_map_i('0),
    .valid_i(s_valid),
    .ready_o(s_ready),
    .data_i(entering),
    .credit_o(),
    .valid_o(m_valid),
    .ready_i(m_ready),
    .data_o(leaving),
    .credit_i('0),
    .offload_req_o(),
    .offload_rsp_i('0)
  );

endmodule
