// SPDX-License-Identifier: Apache-2.0
// A Manager of Managers with a watchdog: a publisher that stops in the middle of a frame holds up neither its group nor
// the host for longer than the limits. What it sends is proved in tree_watchdog.sv.
module tree_watchdog_limits (input clk);

`include "watched_tree_environment.svh"

// With a ready host that gets nothing, cycles on end: within a frame; and in which a publisher of a group offers a beat,
// and none of the group is taken. Late beats that are dropped are taken as well: a publisher that drags out the rest of
// a frame that was cut holds up its group.
localparam MOST = `WATCHDOG + `WATCHDOG / 2;  // a watchdog's limit is up to half as long again
reg  [3:0] silent;
reg  [3:0] held [1:0];
wire       is_silent = rst_n && m_axis_tready && !m_axis_tvalid;
always @(posedge clk) silent <= !is_silent || place == 0 ? 0 : silent + (silent != 15);
genvar side;
generate for (side = 0; side < 2; side = side + 1) begin : groups
    localparam FIRST = side ? HALF : 0;
    localparam SIZE  = side ? `PUBLISHERS - HALF : HALF;
    wire [SIZE-1:0] offers = pub_axis_tvalid[FIRST +: SIZE];
    wire [SIZE-1:0] taken  = takes[FIRST +: SIZE];
    always @(posedge clk) held[side] <= !is_silent || offers == 0 || taken != 0 ? 0 : held[side] + (held[side] != 15);
end endgenerate

always @* if (running) begin
    frees_the_channel: assert (silent <= MOST);
    // The schedulers take three cycles.
    frees_the_group: assert (held[0] <= MOST + 3 && held[1] <= MOST + 3);
end

endmodule
