// SPDX-License-Identifier: Apache-2.0
// The host of firm_sim_pipe.vhd for simulators of Verilog: the same requests, reports and stalls, cycle by cycle. SEED
// and STALL_PERCENT can be set at the start of the simulator, as in +SEED=7. It is SystemVerilog only for its queues,
// since frames have any size.
//
// Inputs are sampled before the rising edge. Outputs change at the falling edge, so the order of events does not
// matter. A stream without a beat carries 'x'.

`timescale 1ns / 1ps

module firm_sim_pipe #(
  parameter WIDTH = 8,
  // Bits of `frame_error`, one per converter.
  parameter ERRORS = 1,
  // Bits of `waits`, one per wire within the system.
  parameter WIRES = 1,
  // Determines all random choices.
  parameter SEED = 1,
  // The chance per cycle and direction that the host stalls.
  parameter STALL_PERCENT = 0
) (
  output reg                clk,
  output reg                rst_n,

  // To the system.
  output reg  [WIDTH-1:0]   m_axis_tdata,
  output reg  [WIDTH/8-1:0] m_axis_tkeep,
  output reg  [0:0]         m_axis_tuser,
  output reg                m_axis_tvalid,
  output reg                m_axis_tlast,
  input  wire               m_axis_tready,

  // From the system.
  input  wire [WIDTH-1:0]   s_axis_tdata,
  input  wire [WIDTH/8-1:0] s_axis_tkeep,
  input  wire [0:0]         s_axis_tuser,
  input  wire [7:0]         s_axis_tid,
  input  wire               s_axis_tvalid,
  input  wire               s_axis_tlast,
  output reg                s_axis_tready,

  input  wire               id_error,
  input  wire [ERRORS-1:0]  frame_error,
  // The code of each converter's fault, read with a pulse in frame_error.
  input  wire [4*ERRORS-1:0] frame_code,
  // High in each cycle in which a wire has a message or a beat that is not taken.
  input  wire [WIRES-1:0]   waits
);

  localparam LANES        = WIDTH / 8;
  localparam HALF_PERIOD  = 5;
  localparam RESET_CYCLES = 8;
  localparam HIGHEST_SEED = 2147483562;  // of math_real.uniform
  localparam MOST_ERRORS  = 65534;
  localparam MOST_WIRES   = 65533;
  localparam MOST_WAITED  = 2147483647;
  localparam VERSION      = 5;           // of requests and reports
  localparam MOST_QUIET   = 2147483647;
  // Bytes that are read at once, and written at once: a call for each byte takes more time than the simulation.
  localparam PIECE_BYTES  = 4096;
  localparam WORD_BYTES   = 64;

  integer requests, reports;             // files
  integer seed, stall_percent;
  integer random_1, random_2;

  reg [63:0] cycle;
  integer    quiet;                      // cycles since the last beat, or MOST_QUIET
  reg        is_reported;                // an event that ends a run
  integer    request, cycles_left;

  // The stream to the system: the frames that wait to be offered.
  reg [7:0]  piece [0:PIECE_BYTES-1];
  reg [7:0]  bytes [$];
  integer    sizes [$];
  reg        aborts [$];
  integer    holes [$];
  reg        is_aborted;                 // the frame being sent
  integer    hole;                       // its byte that is not kept, or -1
  integer    sending;                    // the size of the frame being sent; 0 for none
  integer    bytes_sent;                 // of it, without the beat on offer
  reg        is_offered;
  reg [63:0] first_in;

  // The stream from the system: the incoming burst.
  reg [7:0]  burst [$];
  reg [7:0]  burst_tid;
  reg [63:0] first_out;
  reg        is_accepting;

  // Cycles in which a beat waited: into the system, out of it, and on the wires within it.
  integer    waited [0:WIRES+1];
  reg        is_counting;                // the host wants to know them

  // The inputs as sampled before the rising edge.
  reg               tready, tvalid, tlast;
  reg [WIDTH-1:0]   tdata;
  reg [LANES-1:0]   tkeep;
  reg               tuser;
  reg [7:0]         tid;
  reg               id_pulse;
  reg [ERRORS-1:0]  frame_pulses;
  reg [4*ERRORS-1:0] frame_codes;
  reg [WIRES-1:0]   wait_levels;         // only while waits are counted

  // A beat that waited for `tready`, so that the stream from the system must hold it.
  reg               is_held, held_tlast, held_tuser;
  reg [WIDTH-1:0]   held_tdata;
  reg [LANES-1:0]   held_tkeep;
  reg [7:0]         held_tid;

  // ------------------------------------------------------------------ faults

  // Reports must be read before the simulation ends.
  task fail;
    begin
      $fflush(reports);
      $fatal(1, "firm_sim_pipe: the simulation cannot go on");
    end
  endtask

  task fail_in_cycle;
    begin
      $display(" in cycle %0d", cycle);
      fail;
    end
  endtask

  function [7:0] level(input bit_level);
    level = bit_level === 1'b1 ? "1" : bit_level === 1'b0 ? "0" : bit_level === 1'bz ? "Z" : "X";
  endfunction

  // math_real.uniform of VHDL, by L'Ecuyer, so that all simulators stall in the same cycles.
  task draw_stall(output reg is_stalled);
    integer step;
    if (stall_percent == 0)
      is_stalled = 0;
    else begin
      step     = random_1 / 53668;
      random_1 = 40014 * (random_1 - step * 53668) - step * 12211;
      if (random_1 < 0)
        random_1 = random_1 + 2147483563;
      step     = random_2 / 52774;
      random_2 = 40692 * (random_2 - step * 52774) - step * 3791;
      if (random_2 < 0)
        random_2 = random_2 + 2147483399;
      step = random_1 - random_2;
      if (step < 1)
        step = step + 2147483562;
      is_stalled = 100.0 * (step * 4.656613e-10) < stall_percent;
    end
  endtask

  // ------------------------------------------------------------------ requests and reports

  task read_piece(input integer size);
    if ($fread(piece, requests, 0, size) != size) begin
      $display("firm_sim_pipe: the requests end within a request");
      fail;
    end
  endtask

  task read_number(output integer number);
    reg [31:0] sum;
    integer    place;
    begin
      read_piece(4);
      for (place = 0; place < 4; place = place + 1)
        sum[8*place +: 8] = piece[place];
      if (sum[31]) begin
        $display("firm_sim_pipe: a number in a request is greater than 2147483647");
        fail;
      end
      number = sum;
    end
  endtask

  task read_frame(input reg has_abort, input reg has_hole);
    integer size, place, left, count, gap;
    begin
      gap = -1;
      if (has_hole)
        read_number(gap);
      read_number(size);
      if (size == 0) begin
        $display("firm_sim_pipe: the requested frame has no bytes");
        fail;
      end
      else if (gap >= size) begin
        $display("firm_sim_pipe: the requested frame has no byte %0d", gap);
        fail;
      end
      for (left = size; left > 0; left = left - count) begin
        count = left < PIECE_BYTES ? left : PIECE_BYTES;
        read_piece(count);
        for (place = 0; place < count; place = place + 1)
          bytes.push_back(piece[place]);
      end
      sizes.push_back(size);
      aborts.push_back(has_abort);
      holes.push_back(gap);
    end
  endtask

  task write_number(input reg [63:0] number, input integer size);
    integer place;
    for (place = 0; place < size; place = place + 1)
      $fwrite(reports, "%c", number[8*place +: 8]);
  endtask

  task write_bytes;
    reg [8*WORD_BYTES-1:0] word;
    integer                place;
    begin
      while (burst.size() >= WORD_BYTES) begin
        for (place = 0; place < WORD_BYTES; place = place + 1)
          word[8*place +: 8] = burst.pop_front();
        $fwrite(reports, "%u", word);
      end
      while (burst.size() != 0)
        $fwrite(reports, "%c", burst.pop_front());
    end
  endtask

  task report_version;
    begin
      $fwrite(reports, "V");
      write_number(VERSION, 1);
      $fflush(reports);
    end
  endtask

  task report_taken;
    begin
      is_reported = 1;
      $fwrite(reports, "T");
      write_number(first_in, 8);
      write_number(cycle, 8);
    end
  endtask

  task report_burst;
    begin
      is_reported = 1;
      $fwrite(reports, "B%c", burst_tid);
      write_number(0, 1);
      write_number({63'b0, tuser}, 1);
      write_number(first_out, 8);
      write_number(cycle, 8);
      write_number({32'b0, burst.size()}, 4);
      write_bytes;
    end
  endtask

  task report_id_error;
    begin
      is_reported = 1;
      $fwrite(reports, "I");
      write_number(cycle, 8);
    end
  endtask

  task report_error(input integer converter);
    begin
      is_reported = 1;
      $fwrite(reports, "E");
      write_number({32'b0, converter}, 2);
      write_number({60'b0, frame_codes[4*converter+:4]}, 1);
      write_number(cycle, 8);
    end
  endtask

  task report_waits;
    integer place;
    begin
      $fwrite(reports, "W");
      write_number(cycle, 8);
      write_number(WIRES + 2, 2);
      for (place = 0; place < WIRES + 2; place = place + 1) begin
        write_number({32'b0, waited[place]}, 4);
        waited[place] = 0;
      end
      is_counting = 1;
    end
  endtask

  task forget_waits;
    integer place;
    begin
      for (place = 0; place < WIRES + 2; place = place + 1)
        waited[place] = 0;
      is_counting = 0;
    end
  endtask

  task report_stand;
    begin
      $fwrite(reports, "S");
      write_number(cycle, 8);
      write_number({32'b0, quiet}, 4);
      $fflush(reports);
    end
  endtask

  // ------------------------------------------------------------------ to the system

  task offer_beat;
    integer lane;
    begin
      m_axis_tdata = {WIDTH{1'bx}};
      m_axis_tkeep = 0;
      for (lane = 0; lane < LANES && bytes_sent + lane < sending; lane = lane + 1) begin
        m_axis_tdata[8*lane +: 8] = bytes.pop_front();
        m_axis_tkeep[lane]        = bytes_sent + lane != hole;
      end
      m_axis_tvalid = 1;
      m_axis_tlast  = sending - bytes_sent <= LANES;
      m_axis_tuser  = m_axis_tlast && is_aborted;
      is_offered    = 1;
    end
  endtask

  task offer_nothing;
    begin
      m_axis_tdata  = {WIDTH{1'bx}};
      m_axis_tkeep  = {LANES{1'bx}};
      m_axis_tuser  = 1'bx;
      m_axis_tlast  = 1'bx;
      m_axis_tvalid = 0;
    end
  endtask

  task note_sent_beat;
    begin
      quiet      = 0;
      is_offered = 0;
      if (bytes_sent == 0)
        first_in = cycle;
      bytes_sent = bytes_sent + LANES;
      if (bytes_sent >= sending) begin
        report_taken;
        sending    = 0;
        bytes_sent = 0;
      end
    end
  endtask

  task send;
    reg is_stalled, was_offered;
    begin
      was_offered = is_offered;
      if (is_offered) begin
        if (tready === 1'b1)
          note_sent_beat;
        else if (tready !== 1'b0) begin
          $write("firm_sim_pipe: m_axis_tready is '%c'", level(tready));
          fail_in_cycle;
        end
      end
      if (!is_offered) begin
        if (sending == 0 && sizes.size() != 0) begin
          sending    = sizes.pop_front();
          is_aborted = aborts.pop_front();
          hole       = holes.pop_front();
        end
        draw_stall(is_stalled);
        if (sending != 0 && !is_stalled)
          offer_beat;
        else if (was_offered)
          offer_nothing;
      end
    end
  endtask

  // ------------------------------------------------------------------ from the system

  // The bytes of the beat: the lanes from the lowest up to the first that is not kept.
  task count_kept(output integer kept);
    integer lane;
    begin
      kept = 0;
      for (lane = 0; lane < LANES; lane = lane + 1)
        if (kept == lane && tkeep[lane] === 1'b1)
          kept = kept + 1;
        else if (tkeep[lane] !== 1'b0) begin
          $write("firm_sim_pipe: s_axis_tkeep is undefined or not contiguous from the lowest lane");
          fail_in_cycle;
        end
      if (kept == 0) begin
        $write("firm_sim_pipe: a beat without a byte");
        fail_in_cycle;
      end else if (kept < LANES && tlast !== 1'b1) begin
        $write("firm_sim_pipe: a beat that is neither full nor the last");
        fail_in_cycle;
      end
    end
  endtask

  task begin_burst;
    begin
      first_out = cycle;
      burst_tid = tid;
      if ((^tid) === 1'bx) begin
        $write("firm_sim_pipe: s_axis_tid is undefined");
        fail_in_cycle;
      end
    end
  endtask

  task take_beat;
    integer   kept, lane;
    reg [7:0] value;
    begin
      quiet = 0;
      if (burst.size() == 0)
        begin_burst;
      else if (tid !== burst_tid) begin
        $write("firm_sim_pipe: s_axis_tid changes within a burst");
        fail_in_cycle;
      end
      count_kept(kept);
      for (lane = 0; lane < kept; lane = lane + 1) begin
        value = tdata[8*lane +: 8];
        if ((^value) === 1'bx) begin
          $write("firm_sim_pipe: byte %0d of a burst is undefined", burst.size());
          fail_in_cycle;
        end
        burst.push_back(value);
      end
      if (tlast === 1'b1)
        report_burst;
      else if (tlast !== 1'b0) begin
        $write("firm_sim_pipe: s_axis_tlast is '%c'", level(tlast));
        fail_in_cycle;
      end
    end
  endtask

  task check_held;
    if (tvalid !== 1'b1) begin
      $write("firm_sim_pipe: s_axis_tvalid falls before s_axis_tready rises");
      fail_in_cycle;
    end else if (tdata !== held_tdata || tkeep !== held_tkeep || tuser !== held_tuser || tid !== held_tid
        || tlast !== held_tlast) begin
      $write("firm_sim_pipe: the stream from the system changes before s_axis_tready rises");
      fail_in_cycle;
    end
  endtask

  task receive;
    reg is_stalled;
    begin
      if (is_held)
        check_held;
      if (tvalid === 1'b1 && is_accepting)
        take_beat;
      else if (tvalid !== 1'b0 && tvalid !== 1'b1) begin
        $write("firm_sim_pipe: s_axis_tvalid is '%c'", level(tvalid));
        fail_in_cycle;
      end
      is_held = tvalid === 1'b1 && !is_accepting;
      if (is_held) begin
        held_tdata = tdata;
        held_tkeep = tkeep;
        held_tuser = tuser;
        held_tid   = tid;
        held_tlast = tlast;
      end
      draw_stall(is_stalled);
      is_accepting  = !is_stalled;
      s_axis_tready = is_accepting;
    end
  endtask

  // ------------------------------------------------------------------ errors

  task watch_errors;
    integer converter;
    begin
      if (id_pulse === 1'b1)
        report_id_error;
      else if (id_pulse !== 1'b0) begin
        $write("firm_sim_pipe: id_error is '%c'", level(id_pulse));
        fail_in_cycle;
      end
      if (frame_pulses !== {ERRORS{1'b0}})
        for (converter = 0; converter < ERRORS; converter = converter + 1)
          if (frame_pulses[converter] === 1'b1)
            report_error(converter);
          else if (frame_pulses[converter] !== 1'b0) begin
            $write("firm_sim_pipe: frame_error(%0d) is '%c'", converter, level(frame_pulses[converter]));
            fail_in_cycle;
          end
    end
  endtask

  // ------------------------------------------------------------------ waits

  task count_wait(input integer place);
    if (waited[place] < MOST_WAITED)
      waited[place] = waited[place] + 1;
  endtask

  task count_waits;
    integer place;
    begin
      if (is_offered && tready === 1'b0)
        count_wait(0);
      if (tvalid === 1'b1 && !is_accepting)
        count_wait(1);
      if (wait_levels !== {WIRES{1'b0}})
        for (place = 0; place < WIRES; place = place + 1)
          if (wait_levels[place] === 1'b1)
            count_wait(place + 2);
    end
  endtask

  // ------------------------------------------------------------------ cycles

  task sample;
    begin
      tready       = m_axis_tready;
      tdata        = s_axis_tdata;
      tkeep        = s_axis_tkeep;
      tuser        = s_axis_tuser === 1'b1;
      tid          = s_axis_tid;
      tvalid       = s_axis_tvalid;
      tlast        = s_axis_tlast;
      id_pulse     = id_error;
      frame_pulses = frame_error;
      frame_codes  = frame_code;
      if (is_counting)
        wait_levels = waits;
    end
  endtask

  task run;
    begin
      read_number(cycles_left);
      is_reported = 0;
      while (cycles_left > 0 && !is_reported) begin
        #HALF_PERIOD sample;
        clk = 1;
        #HALF_PERIOD clk = 0;
        rst_n = 1;
        if (quiet < MOST_QUIET)
          quiet = quiet + 1;
        if (is_counting)
          count_waits;
        send;
        receive;
        watch_errors;
        cycle       = cycle + 1;
        cycles_left = cycles_left - 1;
      end
      report_stand;
    end
  endtask

  task check_options;
    begin
      seed          = SEED;
      stall_percent = STALL_PERCENT;
      if (!$value$plusargs("SEED=%d", seed))
        seed = SEED;
      if (!$value$plusargs("STALL_PERCENT=%d", stall_percent))
        stall_percent = STALL_PERCENT;
      if (WIDTH != 8 && WIDTH != 16 && WIDTH != 32 && WIDTH != 64 && WIDTH != 128 && WIDTH != 256 && WIDTH != 512)
        $fatal(1, "firm_sim_pipe: WIDTH is %0d; legal: 8, 16, 32, 64, 128, 256, 512", WIDTH);
      if (WIRES < 1 || WIRES > MOST_WIRES)
        $fatal(1, "firm_sim_pipe: WIRES is %0d; legal: 1 to 65533", WIRES);
      if (ERRORS < 1 || ERRORS > MOST_ERRORS)
        $fatal(1, "firm_sim_pipe: ERRORS is %0d; legal: 1 to 65534", ERRORS);
      if (seed < 1 || seed > HIGHEST_SEED)
        $fatal(1, "firm_sim_pipe: SEED is %0d; legal: 1 to 2147483562", seed);
      if (stall_percent < 0 || stall_percent > 99)
        $fatal(1, "firm_sim_pipe: STALL_PERCENT is %0d; legal: 0 to 99", stall_percent);
    end
  endtask

  task open_pipes;
    begin
      requests = $fopen("/dev/fd/3", "rb");
      if (requests == 0)
        $fatal(1, "firm_sim_pipe: file descriptor 3 cannot be read; a program that sends frames starts this simulator");
      reports = $fopen("/dev/fd/4", "wb");
      if (reports == 0)
        $fatal(1, "firm_sim_pipe: file descriptor 4 cannot be written; a program that sends frames starts this simulator");
    end
  endtask

  task reset_state;
    integer place;
    begin
      cycle        = 0;
      quiet        = 0;
      random_1     = seed;
      random_2     = 1;
      sending      = 0;
      bytes_sent   = 0;
      is_offered   = 0;
      is_accepting = 0;
      is_held      = 0;
      is_counting  = 0;
      for (place = 0; place < WIRES + 2; place = place + 1)
        waited[place] = 0;
    end
  endtask

  initial begin : host
    check_options;
    open_pipes;
    report_version;
    reset_state;
    clk           = 0;
    rst_n         = 1;
    s_axis_tready = 0;
    offer_nothing;
    repeat (RESET_CYCLES) begin
      // An edge clears the registers of the reset, whatever their first level is.
      #1 rst_n = 0;
      #(HALF_PERIOD - 1) clk = 1;
      #HALF_PERIOD clk = 0;
    end
    request = $fgetc(requests);
    // The end of the requests has the same effect as Q.
    while (request >= 0) begin
      if (request == "F" || request == "A" || request == "H")
        read_frame(request == "A", request == "H");
      else if (request == "R")
        run;
      else if (request == "W")
        report_waits;
      else if (request == "N")
        forget_waits;
      else if (request == "Q")
        report_stand;
      else begin
        $display("firm_sim_pipe: unknown request %0d; legal: F, A, H, R, W, N, Q", request);
        fail;
      end
      request = request == "Q" ? -1 : $fgetc(requests);
    end
    $finish(0);
  end

endmodule
