// SPDX-License-Identifier: Apache-2.0
// The checker of firm_axis_checker.vhd for simulators of Verilog: it finds the same faults at the same times and reports
// them in the same words. Simulators without 'x', such as Verilator, cannot violate the rule `known`.
//
// A rule is checked at rising edges of `clk`, with the values before them. In reset only the rule `reset` applies.

`timescale 1ns / 1ps

module firm_axis_checker #(
  parameter WIDTH     = 8,
  parameter USER_BITS = 1,
  // The stream, in reports.
  parameter NAME = "a stream",
  // End the simulation with the first violation.
  parameter IS_FATAL = 0,

  // The checked rules.
  //
  // A beat that is offered does not change until it is accepted.
  parameter STABLE = 1,
  // `tvalid` and `tready` are 0 or 1, and so are `tkeep`, `tlast` and the bytes kept of a beat.
  parameter KNOWN = 1,
  // So is `tready` without a beat; 0 if `tready` depends on `tlast`, which is then undefined.
  parameter IDLE_READY = 1,
  // `tkeep` is contiguous from byte 0, not empty, and full before the last beat.
  parameter KEEP = 1,
  // The last beat may have no byte: the only beat of a stream without bytes.
  parameter MAY_BE_EMPTY = 0,
  // `tvalid` is low from the second edge of a reset on.
  parameter RESET = 1,
  // `tuser[0]`, which aborts a frame, is high on a last beat only. For streams with `tuser`.
  parameter ABORT = 0
) (
  input wire                 clk,
  input wire                 rst_n,

  input wire [WIDTH-1:0]     axis_tdata,
  input wire [WIDTH/8-1:0]   axis_tkeep,
  input wire [USER_BITS-1:0] axis_tuser,
  input wire                 axis_tvalid,
  input wire                 axis_tlast,
  input wire                 axis_tready
);

  localparam LANES = WIDTH / 8;
  localparam [LANES-1:0] FULL = {LANES{1'b1}};
  localparam [LANES-1:0] NONE = {LANES{1'b0}};

  reg was_reset  = 1'b0;
  // A beat was offered and not accepted: its values.
  reg is_waiting = 1'b0;
  reg [WIDTH-1:0]     tdata;
  reg [LANES-1:0]     tkeep;
  reg [USER_BITS-1:0] tuser;
  reg                 tlast;

  integer lane;

  // No lane is kept above a lane that is not kept.
  wire is_contiguous = (axis_tkeep & ~((axis_tkeep << 1) | 1'b1)) === NONE;
  wire is_known_keep = (^axis_tkeep) !== 1'bx;

  task check(input is_right, input [8*8-1:0] rule, input [8*48-1:0] fault);
    if (!is_right && IS_FATAL != 0)
      $fatal(1, "firm_axis_checker: %0s: %0s: %0s", NAME, rule, fault);
    else if (!is_right)
      $display("@%0dns: firm_axis_checker: %0s: %0s: %0s", $time, NAME, rule, fault);
  endtask

  task check_byte(input is_right, input integer number);
    if (!is_right && IS_FATAL != 0)
      $fatal(1, "firm_axis_checker: %0s: known: a bit of byte %0d is neither '0' nor '1'", NAME, number);
    else if (!is_right)
      $display("@%0dns: firm_axis_checker: %0s: known: a bit of byte %0d is neither '0' nor '1'", $time, NAME, number);
  endtask

  task check_stable;
    begin
      check(axis_tvalid !== 1'b0, "stable", "tvalid fell before tready");
      if (axis_tvalid === 1'b1) begin
        check(axis_tdata === tdata, "stable", "tdata changed before tready");
        check(axis_tkeep === tkeep, "stable", "tkeep changed before tready");
        check(axis_tlast === tlast, "stable", "tlast changed before tready");
        check(axis_tuser === tuser, "stable", "tuser changed before tready");
      end
    end
  endtask

  task check_known;
    begin
      check((^axis_tvalid) !== 1'bx, "known", "tvalid is neither '0' nor '1'");
      check((^axis_tready) !== 1'bx || (axis_tvalid === 1'b0 && IDLE_READY == 0), "known",
            "tready is neither '0' nor '1'");
      if (axis_tvalid === 1'b1) begin
        check(is_known_keep, "known", "a bit of tkeep is neither '0' nor '1'");
        check((^axis_tlast) !== 1'bx, "known", "tlast is neither '0' nor '1'");
        check(ABORT == 0 || (^axis_tuser[0]) !== 1'bx, "known", "tuser(0) is neither '0' nor '1'");
        for (lane = 0; lane < LANES; lane = lane + 1)
          check_byte(axis_tkeep[lane] !== 1'b1 || (^axis_tdata[8*lane +: 8]) !== 1'bx, lane);
      end
    end
  endtask

  task check_keep;
    begin
      check(is_contiguous, "keep", "tkeep has a gap");
      check(axis_tkeep !== NONE || (MAY_BE_EMPTY != 0 && axis_tlast === 1'b1), "keep", "tkeep is empty");
      check(axis_tkeep === FULL || axis_tlast !== 1'b0 || axis_tkeep === NONE || !is_contiguous, "keep",
            "tkeep is not full before the last beat");
    end
  endtask

  always @(posedge clk) begin
    if (rst_n !== 1'b1) begin
      check(RESET == 0 || !was_reset || axis_tvalid === 1'b0, "reset", "tvalid is not low in reset");
      is_waiting = 1'b0;
    end else begin
      if (STABLE != 0 && is_waiting)
        check_stable;
      if (KNOWN != 0)
        check_known;
      if (KEEP != 0 && axis_tvalid === 1'b1 && is_known_keep)
        check_keep;
      if (ABORT != 0 && axis_tvalid === 1'b1)
        check(axis_tuser[0] !== 1'b1 || axis_tlast !== 1'b0, "abort", "tuser(0) is high before the last beat");
      is_waiting = axis_tvalid === 1'b1 && axis_tready === 1'b0;
      tdata      = axis_tdata;
      tkeep      = axis_tkeep;
      tuser      = axis_tuser;
      tlast      = axis_tlast;
    end
    was_reset = rst_n !== 1'b1;
  end

  initial begin
    if (WIDTH != 8 && WIDTH != 16 && WIDTH != 32 && WIDTH != 64 && WIDTH != 128 && WIDTH != 256 && WIDTH != 512)
      $fatal(1, "firm_axis_checker: WIDTH is %0d; legal: 8, 16, 32, 64, 128, 256, 512", WIDTH);
    if (USER_BITS < 1)
      $fatal(1, "firm_axis_checker: USER_BITS is %0d; legal: 1 and more", USER_BITS);
  end

endmodule
