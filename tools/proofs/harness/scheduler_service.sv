// SPDX-License-Identifier: Apache-2.0
// A scheduler serves: while somebody waits and the sink is ready, somebody is served.
module scheduler_service (input clk);

`include "scheduler_environment.svh"

// Cycles on end in which the sink is ready, somebody asks, and nothing is sent. Some policies wait while a task that has begun
// pauses; that is its requester's doing.
wire      pausing = `WAITS_FOR_PAUSES && grant_valid && begun[grant_select] && !request[grant_select];
reg [3:0] idle;
always @(posedge clk) begin
    if (!rst_n || !ready || request == 0 || beat || pausing) idle <= 0;
    else if (idle != 15) idle <= idle + 1;
end

always @* if (running) no_deadlock: assert (idle <= `LATENCY);

`include "helpers.svh"

endmodule
