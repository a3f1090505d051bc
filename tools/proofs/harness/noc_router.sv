// SPDX-License-Identifier: Apache-2.0
// A router of an exchange: offered beats stay, frames never mix, only legal turns are taken, and each beat leaves once
// by each of its outputs, in order and unchanged. A frame waits for an output for at most one frame of each other input.
// The first beat of a frame with copies leaves in ascending order. A beat consists of a mark and the number of its input.
//
// Assumed: sources keep their offered beats, and the destination within a frame; destinations have routes. Any one beat
// of any one input is marked.
module noc_router (input clk);

localparam N = `PORTS;
localparam [N*N-1:0] TURNS = `TURNS;
localparam [N*N-1:0] COPIES = `COPIES;

reg rst_n = 0;
always @(posedge clk) rst_n <= 1;
reg running = 0;
always @(posedge clk) running <= rst_n;

(* anyseq *) wire [N-1:0]   last, valid, m_ready;
(* anyseq *) wire [N*3-1:0] destination;
(* anyseq *) wire           mark;
(* anyconst *) wire [2:0]   from;
always @* assume (from < N);

wire [N-1:0]   s_ready, m_last, m_valid;
wire [N*4-1:0] s_beat, m_beat;
wire [N*3-1:0] m_destination;
wire [N-1:0]   s_valid = rst_n ? valid : 0;
wire [N-1:0]   enters = s_valid & s_ready;

noc_router_case dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_beat(s_beat),
    .s_destination(destination),
    .s_last(last),
    .s_valid(s_valid),
    .s_ready(s_ready),
    .m_beat(m_beat),
    .m_destination(m_destination),
    .m_last(m_last),
    .m_valid(m_valid),
    .m_ready(m_ready));

// The outputs to which a destination leads from an input.
function [N-1:0] leads(input [2:0] source, input [2:0] sink);
    leads = sink == N ? COPIES >> (source * N) : (1'b1 << sink) & (TURNS >> (source * N));
endfunction

// Each beat of the input `from` is the marked one until one is.
reg       was_marked = 0;
reg [3:0] marked;          // its mark of the last one, and its destination
reg       begins;          // it begins a frame
wire [N-1:0] within;       // by inputs: in a frame
wire      marks = mark && !was_marked && enters[from];
wire [2:0] goes_to = destination[from*3 +: 3];
always @(posedge clk) begin
    was_marked <= rst_n && (was_marked || marks);
    if (marks) marked <= {last[from], goes_to};
    if (marks) begins <= !within[from];
end
always @* if (was_marked) assume (!mark);

// By outputs: faults, and whether the marked beat has to leave there.
wire [N-1:0] changes, mixes, turns_wrongly, confuses, waits_long, idles, jumps;
reg  [N-1:0] owed = 0;
wire [N-1:0] is_ahead;  // of the marked beat, beats of its input have to leave here

genvar port;
generate
for (port = 0; port < N; port = port + 1) begin : at
    // A source keeps its beat and, in a frame, its destination.
    reg       in_frame = 0;
    reg       waits = 0;
    assign within[port] = in_frame;
    reg [2:0] to;
    reg       last_before;
    wire [2:0] chosen = destination[port*3 +: 3];
    assign s_beat[port*4 +: 4] = {mark && port == from, port[2:0]};
    always @(posedge clk) begin
        in_frame    <= rst_n && (enters[port] ? !last[port] : in_frame);
        waits       <= s_valid[port] && !s_ready[port];
        to          <= chosen;
        last_before <= last[port];
    end
    always @* begin
        assume (leads(port, chosen) != 0);
        if (in_frame || waits) assume (chosen == to);
        if (waits) assume (valid[port] && last[port] == last_before);
    end

    // The output.
    reg       mid = 0;
    reg [2:0] input_of;
    reg       stalled = 0;
    reg [7:0] before;
    wire [7:0] now = {m_last[port], m_destination[port*3 +: 3], m_beat[port*4 +: 4]};
    wire [2:0] source = m_beat[port*4 +: 3];
    wire       leaves = m_valid[port] && m_ready[port];
    always @(posedge clk) begin
        stalled <= rst_n && m_valid[port] && !m_ready[port];
        before  <= now;
        if (!rst_n) mid <= 0;
        else if (leaves) begin
            mid      <= !m_last[port];
            input_of <= source;
        end
    end
    // Beats of `from` that have to leave here, and those of them ahead of the marked one.
    reg [3:0] pending = 0;
    reg [3:0] ahead = 0;
    wire      needed = leads(from, goes_to) >> port & 1'b1;
    wire      gone = leaves && source == from;
    wire      is_marked_one = owed[port] && ahead == 0;
    // It is the first one of its input, and all lower outputs have taken it.
    wire      wants = owed[port] && is_ahead == 0 && (owed & ((1 << port) - 1)) == 0;
    assign is_ahead[port] = ahead != 0;
    reg       wanted = 0, was_idle = 0;
    reg [2:0] frames;  // of others that have ended since it wants to leave
    always @(posedge clk) begin
        pending    <= rst_n ? pending + (enters[from] && needed) - gone : 0;
        owed[port] <= rst_n && (marks ? needed : owed[port] && !(gone && ahead == 0));
        ahead      <= marks ? pending - gone : ahead - (gone && ahead != 0);
        frames     <= wants ? frames + (leaves && m_last[port] && !gone) : 0;
        wanted     <= wants;
        was_idle   <= !mid && !m_valid[port];
    end
    assign confuses[port] = leaves && (m_beat[port*4 + 3] != (gone && is_marked_one)
                                       || gone && is_marked_one && now[7:4] != marked);
    assign waits_long[port] = wants && frames > N - 1;
    assign jumps[port] = m_valid[port] && source == from && owed[port] && is_ahead == 0 && begins && !wants;
    assign idles[port] = wanted && was_idle && !m_valid[port];
    assign changes[port] = stalled && !(m_valid[port] && now == before);
    assign mixes[port] = mid && m_valid[port] && source != input_of;
    assign turns_wrongly[port] = m_valid[port] && !(source < N && leads(source, now[6:4]) >> port & 1'b1);
end
endgenerate

always @* if (running) begin
    offered_beat_stays: assert (changes == 0);
    frames_never_mix: assert (mixes == 0);
    turn_is_legal: assert (turns_wrongly == 0);
    in_order_unchanged: assert (confuses == 0);
    after_at_most_all_others: assert (waits_long == 0);
    idle_for_one_cycle: assert (idles == 0);
    copies_ascend: assert (jumps == 0);
end

endmodule
