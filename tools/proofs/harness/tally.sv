// SPDX-License-Identifier: Apache-2.0
// A table of counters: what is read are the operations up to the cycle before, whatever a read gives of a word that is
// written in the same cycle.
//
// Assumed: the first cycle is a reset, and no other is. The solver chooses a counter, of which the harness keeps the
// value, and all operations.
module tally (input clk);

localparam [`COUNT_BITS-1:0] MOST = {`COUNT_BITS{1'b1}};

(* anyconst *) wire [`INDEX_BITS-1:0]  watched;
(* anyseq *) wire                      op_valid;
(* anyseq *) wire [`INDEX_BITS-1:0]    op_index;
(* anyseq *) wire                      op_count;
(* anyseq *) wire [`LONGEST_BITS-1:0]  op_longest;
(* anyseq *) wire [`INDEX_BITS-1:0]    read_index;
wire                                   is_clear;
wire [`COUNT_BITS-1:0]                 read_count;
wire [`LONGEST_BITS-1:0]               read_longest;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;

firm_status_tally dut (
    .clk(clk),
    .rst_n(!is_first_cycle),
    .is_clear(is_clear),
    .op_valid(op_valid),
    .op_index(op_index),
    .op_count(op_count),
    .op_longest(op_longest),
    .read_index(read_index),
    .read_count(read_count),
    .read_longest(read_longest));

// All operations, and those up to the cycle before, the latter as a read sees them.
reg [`COUNT_BITS-1:0]   count, count_before;
reg [`LONGEST_BITS-1:0] longest, longest_before;
reg                     is_read;
wire                    is_of_watched = op_valid && is_clear && op_index == watched;
always @(posedge clk) begin
    count_before   <= count;
    longest_before <= longest;
    is_read        <= is_clear && read_index == watched && !(`SHARED_READ && op_valid);
    if (is_first_cycle) begin
        count   <= 0;
        longest <= 0;
        is_read <= 0;
    end else if (is_of_watched) begin
        count   <= count + (op_count && count != MOST);
        longest <= op_longest > longest ? op_longest : longest;
    end
end

always @* if (!is_first_cycle && is_read) begin
    counts_all: assert (read_count == count_before);
    keeps_the_longest: assert (read_longest == longest_before);
end

endmodule
