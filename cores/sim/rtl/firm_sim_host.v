// SPDX-License-Identifier: Apache-2.0
// The host of firm_sim_host.vhd for simulators of Verilog: it reads the same files, stalls in the same cycles for the
// same SEED, finds the same faults and writes the same report, so that runs of all simulators can be compared.
//
// The frames stay in their files: the host records the position of each, and reads it again when it is sent or
// compared. Each parameter except WIDTH and ERRORS can be set at the start of the simulator, as in +SEED=7.
//
// Inputs are read before the rising edge. Outputs change at the falling edge, so the order of events does not
// matter. A stream without a beat carries 'x'.

`timescale 1ns / 1ps

module firm_sim_host #(
  parameter WIDTH = 8,
  // Bits of `frame_error`, one per converter.
  parameter ERRORS = 1,
  // Paths relative to the directory in which the simulator runs.
  parameter STIMULUS_FILE = "stimulus.txt",
  parameter EXPECTED_FILE = "expected.txt",
  // The file for received frames, in the grammar of the expected file; none if empty.
  parameter RECEIVED_FILE = "",
  // Determines all random choices.
  parameter SEED = 1,
  // The chance per cycle and direction that the host stalls.
  parameter STALL_PERCENT = 0,
  // Frames whose labels and latency are printed; the default is all.
  parameter SHOWN = 2147483647,
  // Cycles without a beat after which the host gives up on missing frames.
  parameter WATCHDOG = 100000,
  // Cycles without a beat in which it listens for surplus frames after the last expected one.
  parameter QUIET = 1000,
  // The file for all signals of the simulation; none if empty.
  parameter WAVES = "",
  // The most frames of a file.
  parameter FRAMES = 65536
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

  // A pulse that the expected file does not announce is a fault.
  input  wire               id_error,
  input  wire [ERRORS-1:0]  frame_error
);

  localparam LANES        = WIDTH / 8;
  localparam HALF_PERIOD  = 5;
  localparam RESET_CYCLES = 8;
  localparam FAULTS_SHOWN = 10;
  localparam HIGHEST_SEED = 2147483562;  // of math_real.uniform
  localparam HEADER_BYTES = 5;
  localparam ABORTED      = 10;          // the code of aborted frames
  localparam LINE_BYTES   = 64;
  localparam NAME_BITS    = 8 * 1024;
  localparam MOST_WAYS    = 63;
  localparam WAYS_LOOKED_AT = 1000;      // frames among which the next one of another way is looked for
  localparam KEPT         = 65536;       // the bytes of a frame that may have come another way

  localparam NONE     = -1;
  localparam STIMULUS = 0;       // where the frames of the two files begin in the tables
  localparam EXPECTED = FRAMES;

  localparam TAB = 9, NEWLINE = 10, RETURN = 13, BLANK = 32;
  // The value of an illegal byte, and of `..`, which matches any byte.
  localparam ILL_FORMED = -2, ANY = -3;

  reg [NAME_BITS-1:0] stimulus_name, expected_name, received_name, waves_name, name;
  integer stimulus_file, expected_file, received_file, file;
  integer seed, stall_percent, shown, watchdog, quiet;

  // The frames of both files.
  integer label_at    [0:2*FRAMES-1];  // where the label begins in its file
  integer bytes_at    [0:2*FRAMES-1];
  integer size        [0:2*FRAMES-1];
  integer cause       [0:2*FRAMES-1];  // the stimulus that causes it; NONE if the file has none
  integer next_of_id  [0:2*FRAMES-1];  // the next one with the same id
  integer first_cycle [0:FRAMES-1];    // cycles in which the first and the last beat of a stimulus were taken
  integer last_cycle  [0:FRAMES-1];
  reg     is_aborted  [0:2*FRAMES-1];
  reg     is_received [0:2*FRAMES-1];
  integer way         [0:2*FRAMES-1];  // frames with one id and different ways may come in any order; 0: in the file's
  integer first_of_id [0:255];         // the next expected one
  integer last_of_id  [0:255];
  integer stimuli, expectations;       // frames of the files
  integer announced_id_errors, announced_frame_errors;

  integer cycle, idle_cycles, faults;
  reg     is_shown;                    // the current fault is printed
  integer random_1, random_2;

  // The stream to the system.
  integer sending;                     // NONE after the last frame
  integer frames_sent;
  integer bytes_sent;                  // of `sending`, without the beat on offer
  reg     is_offered;
  integer beats_in;

  // The stream from the system.
  integer receiving;                   // NONE if no frame is expected
  reg     is_in_frame, is_frame_right;
  integer received_id;
  integer bytes_received;
  reg [7:0] bytes_kept [0:KEPT-1];
  integer first_out, last_out;
  reg     is_accepting;
  integer frames_received, frames_right, frames_shown;
  integer beats_out;

  // The inputs as sampled before the rising edge.
  reg               tready, tvalid, tlast;
  reg [WIDTH-1:0]   tdata;
  reg [LANES-1:0]   tkeep;
  reg               tuser;
  reg [7:0]         tid;
  reg               id_pulse;
  reg [ERRORS-1:0]  frame_pulses;

  // A beat that waited for `tready`, so that the stream from the system must hold it.
  reg               is_held, held_tlast, held_tuser;
  reg [WIDTH-1:0]   held_tdata;
  reg [LANES-1:0]   held_tkeep;
  reg [7:0]         held_tid;

  integer id_errors, frame_errors;

  // ------------------------------------------------------------------ files

  integer char;         // the last one read; negative after the end
  integer line_number;
  integer value;        // of the byte that was read, or ILL_FORMED, or ANY
  integer frame;        // the frame being read; NONE before the first
  integer frame_count;
  integer base;
  reg [7:0] mark;
  reg [8*HEADER_BYTES-1:0] header;
  integer header_masks;

  task fail_form;
    begin
      $fatal(1, "firm_sim_host: invalid frame file");
    end
  endtask

  task begin_form_fault;
    $write("%0s:%0d: ", name, line_number);
  endtask

  function integer digit_value(input integer digit);
    if (digit >= "0" && digit <= "9")
      digit_value = digit - "0";
    else if (digit >= "a" && digit <= "f")
      digit_value = digit - "a" + 10;
    else if (digit >= "A" && digit <= "F")
      digit_value = digit - "A" + 10;
    else
      digit_value = NONE;
  endfunction

  task skip_line;
    while (char >= 0 && char != NEWLINE)
      char = $fgetc(file);
  endtask

  // A number of one to nine digits up to a blank or the end of the line; NONE if it is anything else.
  task read_number(output integer number);
    integer digits;
    begin
      number = 0;
      digits = 0;
      while (char >= "0" && char <= "9" && digits < 10) begin
        number = 10 * number + digit_value(char);
        digits = digits + 1;
        char   = $fgetc(file);
      end
      if (digits == 0 || digits == 10 || !(char < 0 || char == BLANK || char == NEWLINE || char == RETURN))
        number = NONE;
    end
  endtask

  // A new frame: reads the rest of `mark label` or `mark @n label` after the mark.
  task start_frame;
    begin
      if (frame_count == FRAMES) begin
        begin_form_fault;
        $display("the file has more than FRAMES (%0d) frames", FRAMES);
        fail_form;
      end
      frame        = base + frame_count;
      frame_count  = frame_count + 1;
      cause[frame] = NONE;
      size[frame]  = 0;
      next_of_id[frame]  = NONE;
      is_aborted[frame]  = 0;
      is_received[frame] = 0;
      way[frame]         = 0;
      header_masks       = 0;
      if (char >= 0 && char != BLANK && char != NEWLINE && char != RETURN) begin
        begin_form_fault;
        $display("a blank is missing after the first character");
        fail_form;
      end
      label_at[frame] = $ftell(file);
      if (char == BLANK) begin
        char = $fgetc(file);
        if (char == "@" && mark == "<") begin
          char = $fgetc(file);
          read_number(cause[frame]);
          if (cause[frame] < 0) begin
            begin_form_fault;
            $display("'@' must be followed by the number of a stimulus frame");
            fail_form;
          end
          label_at[frame] = char == BLANK ? $ftell(file) : $ftell(file) - (char < 0 ? 0 : 1);
        end
      end else if (char >= 0)
        label_at[frame] = label_at[frame] - 1;
      skip_line;
    end
  endtask

  // The rest of `! aborted id code`, from the id on: the last frame has this id and is aborted.
  task abort_frame(input integer id);
    integer code;
    begin
      code = NONE;
      if (char == BLANK) begin
        char = $fgetc(file);
        read_number(code);
      end
      if (frame == NONE) begin
        begin_form_fault;
        $display("'! aborted' must follow a frame");
        fail_form;
      end else if (size[frame] == 0) begin
        begin_form_fault;
        $display("the frame before this line has no bytes");
        fail_form;
      end else if (id != {24'b0, header[7:0]} || code != ABORTED) begin
        begin_form_fault;
        $display("expected '! aborted %0d %0d', the frame's id and the code of aborted frames", header[7:0], ABORTED);
        fail_form;
      end
      is_aborted[frame] = 1;
    end
  endtask

  // `! way n`: the last frame comes in the order of the frames with its id and way.
  task set_way(input integer number);
    begin
      if (frame == NONE) begin
        begin_form_fault;
        $display("'! way' must follow a frame");
        fail_form;
      end else if (number < 1 || number > MOST_WAYS) begin
        begin_form_fault;
        $display("'! way' must be followed by a number from 1 to %0d", MOST_WAYS);
        fail_form;
      end
      way[frame] = number;
    end
  endtask

  // The rest of `! id_error n`, `! frame_error n`, `! way n` or `! aborted id code`.
  task announce_errors;
    reg [8*12-1:0] word;
    integer        pulses;
    begin
      word = 0;
      char = $fgetc(file);
      if (char == BLANK)
        char = $fgetc(file);
      else
        char = NEWLINE;
      while (char >= 0 && char != BLANK && char != NEWLINE) begin
        word = {word[8*11-1:0], char[7:0]};
        char = $fgetc(file);
      end
      pulses = NONE;
      if (char == BLANK) begin
        char = $fgetc(file);
        read_number(pulses);
      end
      if (word == "aborted")
        abort_frame(pulses);
      else if (mark == ">") begin
        begin_form_fault;
        $display("expected '! aborted <id> <code>'");
        fail_form;
      end else if (word == "way")
        set_way(pulses);
      else if (pulses >= 0 && word == "id_error")
        announced_id_errors = pulses;
      else if (pulses >= 0 && word == "frame_error")
        announced_frame_errors = pulses;
      else begin
        begin_form_fault;
        $display("expected '! id_error <pulses>', '! frame_error <pulses>' or '! aborted <id> <code>'");
        fail_form;
      end
      skip_line;
    end
  endtask

  // A byte of two digits, the first of which has been read; ILL_FORMED, after the message is printed, if it is illegal.
  task read_byte;
    integer first;
    begin
      first = char;
      char  = $fgetc(file);
      if (char < 0 || char == NEWLINE || char == RETURN) begin
        begin_form_fault;
        $display("the line ends with half a byte");
        value = ILL_FORMED;
      end else if (first == "." && char == ".") begin
        value = ANY;
        if (mark != "<" || size[frame] == 0) begin
          begin_form_fault;
          $display("'..' is legal only in an expected frame, after the id");
          value = ILL_FORMED;
        end
      end else if (digit_value(first) < 0 || digit_value(char) < 0) begin
        begin_form_fault;
        $display("'%c%c' is not a byte of two hexadecimal digits", first[7:0], char[7:0]);
        value = ILL_FORMED;
      end else
        value = 16 * digit_value(first) + digit_value(char);
    end
  endtask

  // A line of bytes, whose first character has been read.
  task read_bytes;
    begin
      while (char >= 0 && char != NEWLINE) begin
        if (char != BLANK && char != TAB && char != RETURN) begin
          if (size[frame] == 0)
            bytes_at[frame] = $ftell(file) - 1;
          read_byte;
          if (value == ILL_FORMED)
            fail_form;
          if (size[frame] < HEADER_BYTES) begin
            header[8*size[frame] +: 8] = value == ANY ? 8'h00 : value[7:0];
            if (value == ANY)
              header_masks = header_masks + 1;
          end
          size[frame] = size[frame] + 1;
        end
        char = $fgetc(file);
      end
    end
  endtask

  // The last frame is complete: check it and append it to the others with its id.
  task close_frame;
    begin
      if (frame != NONE) begin
        if (size[frame] == 0) begin
          begin_form_fault;
          $display("the frame before this line has no bytes");
          fail_form;
        end
        if (mark == "<" && !is_aborted[frame])
          check_length;
        if (mark == "<") begin
          if (first_of_id[header[7:0]] == NONE)
            first_of_id[header[7:0]] = frame;
          else
            next_of_id[last_of_id[header[7:0]]] = frame;
          last_of_id[header[7:0]] = frame;
        end
      end
    end
  endtask

  task check_length;
    begin
      if (size[frame] < HEADER_BYTES) begin
        begin_form_fault;
        $display("the frame before this line is shorter than id and length");
        fail_form;
      end
      if (header[8*HEADER_BYTES-1]) begin
        begin_form_fault;
        $display("the frame before this line announces more than 2 GiB");
        fail_form;
      end
      if (header_masks == 0 && header[39:8] != size[frame] - HEADER_BYTES) begin
        begin_form_fault;
        $display("the frame before this line announces %0d bytes of payload but has %0d", header[39:8],
                 size[frame] - HEADER_BYTES);
        fail_form;
      end
    end
  endtask

  // Open `name` and find the frames that begin with `mark`.
  task read_frame_file;
    begin
      frame       = NONE;
      frame_count = 0;
      line_number = 1;
      file        = $fopen(name, "r");
      if (file == 0) begin
        begin_form_fault;
        $display("the file cannot be opened");
        fail_form;
      end
      char = $fgetc(file);
      while (char >= 0) begin
        if (char == "#")
          skip_line;
        else if (char == {24'b0, mark}) begin
          close_frame;
          char = $fgetc(file);
          start_frame;
        end else if (char == "!")
          announce_errors;
        else if (char == RETURN)
          char = $fgetc(file);
        else if (char != NEWLINE && frame == NONE) begin
          begin_form_fault;
          $display("expected a label line, which starts with '%c'", mark);
          fail_form;
        end else
          read_bytes;
        if (char == NEWLINE) begin
          char        = $fgetc(file);
          line_number = line_number + 1;
        end else if (char < 0)
          line_number = line_number + 1;
      end
      close_frame;
      if (mark == ">" && frame_count == 0) begin
        begin_form_fault;
        $display("the file contains no frames");
        fail_form;
      end
    end
  endtask

  // The next byte of the frame at the position of `file`; comments and announcements may be in between.
  task next_byte;
    integer first;
    begin
      char = $fgetc(file);
      while (char == BLANK || char == TAB || char == RETURN || char == NEWLINE || char == "#" || char == "!") begin
        if (char == "#" || char == "!")
          skip_line;
        char = $fgetc(file);
      end
      first = char;
      char  = $fgetc(file);
      value = first == "." ? ANY : 16 * digit_value(first) + digit_value(char);
    end
  endtask

  // Print the label of a frame; the position of `file` is unchanged.
  task write_label(input integer labelled, input integer place);
    integer origin, ignored;
    begin
      origin  = $ftell(place);
      ignored = $fseek(place, label_at[labelled], 0);
      char    = $fgetc(place);
      while (char >= 0 && char != NEWLINE && char != RETURN) begin
        $write("%c", char[7:0]);
        char = $fgetc(place);
      end
      ignored = $fseek(place, origin, 0);
    end
  endtask

  // ------------------------------------------------------------------ faults

  task begin_fault;
    begin
      faults   = faults + 1;
      is_shown = faults <= FAULTS_SHOWN;
      if (is_shown)
        $write("fault in cycle %0d: ", cycle);
    end
  endtask

  // A fault of the incoming frame.
  task begin_frame_fault;
    begin
      is_frame_right = 0;
      begin_fault;
      if (is_shown && receiving == NONE)
        $write("frame with id %0d: ", received_id);
      else if (is_shown)
        begin_of_label(receiving, expected_file);
    end
  endtask

  task begin_of_label(input integer labelled, input integer place);
    begin
      $write("'");
      write_label(labelled, place);
      $write("': ");
    end
  endtask

  function [7:0] level(input bit_level);
    level = bit_level === 1'b1 ? "1" : bit_level === 1'b0 ? "0" : bit_level === 1'bz ? "Z" : "X";
  endfunction

  function [7:0] digit(input [3:0] nibble);
    if ((^nibble) === 1'bx)
      digit = "X";
    else if (nibble < 10)
      digit = "0" + {4'b0, nibble};
    else
      digit = "a" - 8'd10 + {4'b0, nibble};
  endfunction

  // ------------------------------------------------------------------ randomness

  // math_real.uniform of VHDL, by L'Ecuyer, so that all simulators stall in the same cycles.
  task draw_stall(output reg is_stalled);
    integer step;
    begin
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

  // ------------------------------------------------------------------ to the system

  task offer_beat;
    integer lane;
    begin
      m_axis_tdata = {WIDTH{1'bx}};
      m_axis_tkeep = 0;
      file         = stimulus_file;
      for (lane = 0; lane < LANES && bytes_sent + lane < size[sending]; lane = lane + 1) begin
        next_byte;
        m_axis_tdata[8*lane +: 8] = value[7:0];
        m_axis_tkeep[lane]        = 1;
      end
      m_axis_tvalid = 1;
      m_axis_tlast  = size[sending] - bytes_sent <= LANES;
      m_axis_tuser  = m_axis_tlast && is_aborted[sending];
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

  task start_sending(input integer number);
    integer ignored;
    begin
      sending = NONE;
      if (number < stimuli) begin
        sending = STIMULUS + number;
        ignored = $fseek(stimulus_file, bytes_at[sending], 0);
      end
      bytes_sent = 0;
    end
  endtask

  task note_sent_beat;
    begin
      beats_in    = beats_in + 1;
      idle_cycles = 0;
      is_offered  = 0;
      if (bytes_sent == 0)
        first_cycle[sending] = cycle;
      bytes_sent = bytes_sent + LANES;
      if (bytes_sent >= size[sending]) begin
        last_cycle[sending] = cycle;
        frames_sent         = frames_sent + 1;
        start_sending(frames_sent);
      end
    end
  endtask

  task send;
    reg is_stalled;
    begin
      if (is_offered) begin
        if (tready === 1'b1)
          note_sent_beat;
        else if (tready !== 1'b0) begin
          begin_fault;
          if (is_shown)
            $display("m_axis_tready is '%c'", level(tready));
        end
      end
      if (!is_offered) begin
        draw_stall(is_stalled);
        if (sending == NONE || is_stalled)
          offer_nothing;
        else
          offer_beat;
      end
    end
  endtask

  // ------------------------------------------------------------------ from the system

  task show_frame;
    begin
      frames_shown = frames_shown + 1;
      if (cause[receiving] >= 0 && cause[receiving] < stimuli) begin
        $write("  %0d > ", cause[receiving]);
        write_label(STIMULUS + cause[receiving], stimulus_file);
        $write("\n");
      end
      $write("    < ");
      write_label(receiving, expected_file);
      $write("\n");
      if (cause[receiving] >= stimuli) begin
        begin_frame_fault;
        if (is_shown)
          $display("caused by stimulus %0d, which does not exist", cause[receiving]);
      end else if (cause[receiving] >= 0)
        $display("    %0d cycles first beat in to last beat out, %0d last beat in to first beat out",
                 cycle - first_cycle[cause[receiving]], first_out - last_cycle[cause[receiving]]);
    end
  endtask

  task begin_frame(input [7:0] id);
    integer ignored;
    begin
      is_in_frame    = 1;
      is_frame_right = 1;
      bytes_received = 0;
      first_out      = cycle;
      receiving      = NONE;
      received_id    = NONE;
      if (received_file != 0)
        $fwrite(received_file, "< id %c%c\n", digit(id[7:4]), digit(id[3:0]));
      if ((^id) === 1'bx) begin
        begin_frame_fault;
        if (is_shown)
          $display("its id is %c%c", digit(id[7:4]), digit(id[3:0]));
      end else begin
        received_id = {24'b0, id};
        receiving   = first_of_id[id];
        if (receiving == NONE) begin
          begin_frame_fault;
          if (is_shown)
            $display("no such frame is expected");
        end else begin
          first_of_id[id]        = next_of_id[receiving];
          is_received[receiving] = 1;
          frames_received        = frames_received + 1;
          ignored = $fseek(expected_file, bytes_at[receiving], 0);
        end
      end
    end
  endtask

  // Whether a frame has all bytes that have been received, and `got` after them; `file` is then after these.
  task check_like(input integer other, input [7:0] got, output reg is_like);
    integer place, ignored;
    begin
      is_like = !is_aborted[other] && size[other] > bytes_received && bytes_received < KEPT;
      ignored = $fseek(expected_file, bytes_at[other], 0);
      for (place = 0; place <= bytes_received && is_like; place = place + 1) begin
        file = expected_file;
        next_byte;
        is_like = value == ANY || value[7:0] === (place == bytes_received ? got : bytes_kept[place]);
      end
    end
  endtask

  // The frame that is received in place of the expected one, if it is the next one of another way.
  task try_ways(input [7:0] got, output reg is_found);
    reg [MOST_WAYS:0] seen;
    integer           other, previous, looked, origin, ignored;
    reg               fits;
    begin
      origin   = $ftell(expected_file);
      is_found = 0;
      seen     = 0;
      seen[way[receiving]] = 1;
      other    = first_of_id[received_id];
      previous   = NONE;
      for (looked = 0; looked < WAYS_LOOKED_AT && other != NONE && !is_found; looked = looked + 1) begin
        fits = 0;
        if (!seen[way[other]]) begin
          seen[way[other]] = 1;
          check_like(other, got, fits);
        end
        if (fits) begin
          if (previous == NONE)
            first_of_id[received_id] = next_of_id[other];
          else
            next_of_id[previous] = next_of_id[other];
          next_of_id[receiving]    = first_of_id[received_id];
          is_received[receiving]   = 0;
          first_of_id[received_id] = receiving;
          is_received[other]       = 1;
          receiving                = other;
          is_found                 = 1;
        end else begin
          previous = other;
          other  = next_of_id[other];
        end
      end
      if (!is_found)
        ignored = $fseek(expected_file, origin, 0);
    end
  endtask

  task receive_byte(input [7:0] got);
    reg     is_found;
    integer wanted;
    begin
      if (received_file != 0) begin
        if (bytes_received % LINE_BYTES == 0)
          $fwrite(received_file, "%0s", bytes_received == 0 ? "  " : "\n  ");
        $fwrite(received_file, "%c%c", digit(got[7:4]), digit(got[3:0]));
      end
      if (receiving != NONE) begin
        if (is_aborted[receiving])
          idle_cycles = 0;
        else if (bytes_received < size[receiving]) begin
          idle_cycles = 0;
          file        = expected_file;
          next_byte;
          wanted   = value;
          is_found = 0;
          if (wanted != ANY && got !== wanted[7:0] && is_frame_right && way[receiving] > 0)
            try_ways(got, is_found);
          if (wanted != ANY && got !== wanted[7:0] && !is_found) begin
            begin_frame_fault;
            if (is_shown)
              $display("byte %0d: expected %c%c, got %c%c", bytes_received, digit(wanted[7:4]), digit(wanted[3:0]),
                       digit(got[7:4]), digit(got[3:0]));
          end
          if (bytes_received < KEPT)
            bytes_kept[bytes_received] = got;
        end else if (bytes_received == size[receiving]) begin
          begin_frame_fault;
          if (is_shown)
            $display("continues after its %0d bytes", size[receiving]);
        end
      end
      bytes_received = bytes_received + 1;
    end
  endtask

  task finish_frame;
    begin
      is_in_frame = 0;
      if (received_file != 0 && bytes_received > 0)
        $fwrite(received_file, "\n");
      if (received_file != 0 && tuser && received_id != NONE)
        $fwrite(received_file, "! aborted %0d %0d\n", received_id, ABORTED);
      if (receiving != NONE) begin
        if (tuser && !is_aborted[receiving]) begin
          begin_frame_fault;
          if (is_shown)
            $display("is aborted after %0d bytes", bytes_received);
        end else if (!tuser && is_aborted[receiving]) begin
          begin_frame_fault;
          if (is_shown)
            $display("is not aborted");
        end else if (bytes_received < size[receiving] && !is_aborted[receiving]) begin
          begin_frame_fault;
          if (is_shown)
            $display("ends after %0d bytes, expected %0d", bytes_received, size[receiving]);
        end
        if (frames_shown < shown)
          show_frame;
        if (is_frame_right)
          frames_right = frames_right + 1;
      end
    end
  endtask

  // The bytes of the beat: the lanes from the lowest up to the first that is not kept.
  task count_kept(output integer kept);
    integer lane;
    reg     is_contiguous;
    begin
      kept          = 0;
      is_contiguous = 1;
      for (lane = 0; lane < LANES; lane = lane + 1)
        if (kept == lane && tkeep[lane] === 1'b1)
          kept = kept + 1;
        else if (tkeep[lane] !== 1'b0)
          is_contiguous = 0;
      if (!is_contiguous) begin
        begin_frame_fault;
        if (is_shown)
          $display("tkeep is undefined or not contiguous from the lowest lane");
      end
      if (kept == 0) begin
        begin_frame_fault;
        if (is_shown)
          $display("a beat without a byte");
      end else if (kept < LANES && tlast !== 1'b1) begin
        begin_frame_fault;
        if (is_shown)
          $display("a beat that is neither full nor the last");
      end
    end
  endtask

  task take_beat;
    integer bytes, lane;
    begin
      beats_out = beats_out + 1;
      last_out  = cycle;
      if (!is_in_frame)
        begin_frame(tdata[7:0]);
      if (received_id != NONE && tid !== received_id[7:0]) begin
        begin_frame_fault;
        if (is_shown)
          $display("tid is %c%c", digit(tid[7:4]), digit(tid[3:0]));
      end
      count_kept(bytes);
      for (lane = 0; lane < bytes; lane = lane + 1)
        receive_byte(tdata[8*lane +: 8]);
      if (tlast === 1'b1)
        finish_frame;
      else if (tlast !== 1'b0) begin
        begin_frame_fault;
        if (is_shown)
          $display("tlast is '%c'", level(tlast));
      end
    end
  endtask

  task check_held;
    if (tvalid !== 1'b1) begin
      begin_fault;
      if (is_shown)
        $display("s_axis_tvalid falls before s_axis_tready rises");
    end else if (tdata !== held_tdata || tkeep !== held_tkeep || tuser !== held_tuser || tid !== held_tid
        || tlast !== held_tlast) begin
      begin_fault;
      if (is_shown)
        $display("the stream from the system changes before s_axis_tready rises");
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
        begin_fault;
        if (is_shown)
          $display("s_axis_tvalid is '%c'", level(tvalid));
      end
      is_held    = tvalid === 1'b1 && !is_accepting;
      held_tdata = tdata;
      held_tkeep = tkeep;
      held_tuser = tuser;
      held_tid   = tid;
      held_tlast = tlast;
      draw_stall(is_stalled);
      is_accepting  = !is_stalled;
      s_axis_tready = is_accepting;
    end
  endtask

  // ------------------------------------------------------------------ errors, end and report

  task watch_errors;
    integer converter;
    begin
      if (id_pulse === 1'b1) begin
        id_errors = id_errors + 1;
        if (id_errors > announced_id_errors) begin
          begin_fault;
          if (is_shown)
            $display("id_error pulses, announced: %0d", announced_id_errors);
        end
      end else if (id_pulse !== 1'b0) begin
        begin_fault;
        if (is_shown)
          $display("id_error is '%c'", level(id_pulse));
      end
      if (frame_pulses !== {ERRORS{1'b0}})
        for (converter = ERRORS - 1; converter >= 0; converter = converter - 1)
          if (frame_pulses[converter] === 1'b1) begin
            frame_errors = frame_errors + 1;
            if (frame_errors > announced_frame_errors) begin
              begin_fault;
              if (is_shown)
                $display("frame_error(%0d) pulses, announced: %0d", converter, announced_frame_errors);
            end
          end else if (frame_pulses[converter] !== 1'b0) begin
            begin_fault;
            if (is_shown)
              $display("frame_error(%0d) is '%c'", converter, level(frame_pulses[converter]));
          end
    end
  endtask

  function is_all_moved(input ignored);
    is_all_moved = sending == NONE && frames_received == expectations && !is_in_frame;
  endfunction

  function is_over(input ignored);
    is_over = idle_cycles >= (is_all_moved(0) ? quiet : watchdog);
  endfunction

  task report_missing;
    integer number;
    begin
      begin_fault;
      if (is_shown)
        $display("nothing moved for %0d cycles; %0d of %0d frames in, %0d of %0d out", idle_cycles, frames_sent,
                 stimuli, frames_received, expectations);
      if (sending != NONE) begin
        begin_fault;
        if (is_shown) begin
          begin_of_label(sending, stimulus_file);
          $display("only %0d bytes taken", bytes_sent);
        end
      end
      if (is_in_frame) begin
        begin_frame_fault;
        if (is_shown)
          $display("stops after %0d bytes without tlast", bytes_received);
      end
      for (number = EXPECTED; number < EXPECTED + expectations; number = number + 1)
        if (!is_received[number]) begin
          begin_fault;
          if (is_shown) begin
            $write("missing: '");
            write_label(number, expected_file);
            $write("'\n");
          end
        end
    end
  endtask

  task report_traffic;
    integer cycles, percent_in, percent_out;
    begin
      cycles = 0;
      if (beats_in > 0 && beats_out > 0)
        if (last_out >= first_cycle[0])
          cycles = last_out - first_cycle[0] + 1;
      $display("%0d frames in, %0d frames out, %0d cycles from the first beat in to the last beat out", frames_sent,
               frames_received, cycles);
      if (cycles > 0) begin
        percent_in  = $rtoi(100.0 * beats_in / cycles + 0.5);
        percent_out = $rtoi(100.0 * beats_out / cycles + 0.5);
        $display("in: %0d beats, %0d %% of these cycles; out: %0d beats, %0d %%", beats_in, percent_in, beats_out,
                 percent_out);
      end
    end
  endtask

  task report_verdict;
    begin
      if (faults > FAULTS_SHOWN)
        $display("and %0d more faults", faults - FAULTS_SHOWN);
      $display("%0s %0d/%0d", faults == 0 ? "PASS" : "FAIL", frames_right, expectations);
      if (received_file != 0)
        $fclose(received_file);
      if (faults != 0)
        $fatal(1, "FAIL %0d/%0d", frames_right, expectations);
      $finish(0);
    end
  endtask

  // ------------------------------------------------------------------ start

  task take_options;
    begin
      // verilator lint_off WIDTH
      stimulus_name = STIMULUS_FILE;
      expected_name = EXPECTED_FILE;
      received_name = RECEIVED_FILE;
      waves_name    = WAVES;
      // verilator lint_on WIDTH
      seed          = SEED;
      stall_percent = STALL_PERCENT;
      shown         = SHOWN;
      watchdog      = WATCHDOG;
      quiet         = QUIET;
      if ($value$plusargs("STIMULUS_FILE=%s", name))
        stimulus_name = name;
      if ($value$plusargs("EXPECTED_FILE=%s", name))
        expected_name = name;
      if ($value$plusargs("RECEIVED_FILE=%s", name))
        received_name = name;
      if ($value$plusargs("WAVES=%s", name))
        waves_name = name;
      if (!$value$plusargs("SEED=%d", seed))
        seed = SEED;
      if (!$value$plusargs("STALL_PERCENT=%d", stall_percent))
        stall_percent = STALL_PERCENT;
      if (!$value$plusargs("SHOWN=%d", shown))
        shown = SHOWN;
      if (!$value$plusargs("WATCHDOG=%d", watchdog))
        watchdog = WATCHDOG;
      if (!$value$plusargs("QUIET=%d", quiet))
        quiet = QUIET;
    end
  endtask

  task check_options;
    begin
      if (WIDTH != 8 && WIDTH != 16 && WIDTH != 32 && WIDTH != 64 && WIDTH != 128 && WIDTH != 256 && WIDTH != 512)
        $fatal(1, "firm_sim_host: WIDTH is %0d; legal: 8, 16, 32, 64, 128, 256, 512", WIDTH);
      if (ERRORS < 1)
        $fatal(1, "firm_sim_host: ERRORS is %0d; legal: 1 or more", ERRORS);
      if (seed < 1 || seed > HIGHEST_SEED)
        $fatal(1, "firm_sim_host: SEED is %0d; legal: 1 to 2147483562", seed);
      if (stall_percent < 0 || stall_percent > 99)
        $fatal(1, "firm_sim_host: STALL_PERCENT is %0d; legal: 0 to 99", stall_percent);
      if (shown < 0)
        $fatal(1, "firm_sim_host: SHOWN is %0d; legal: 0 or more", shown);
      if (watchdog < 1)
        $fatal(1, "firm_sim_host: WATCHDOG is %0d; legal: 1 or more", watchdog);
      if (quiet < 1)
        $fatal(1, "firm_sim_host: QUIET is %0d; legal: 1 or more", quiet);
    end
  endtask

  task open_files;
    integer id;
    begin
      announced_id_errors    = 0;
      announced_frame_errors = 0;
      for (id = 0; id < 256; id = id + 1)
        first_of_id[id] = NONE;
      name = stimulus_name;
      mark = ">";
      base = STIMULUS;
      read_frame_file;
      stimulus_file = file;
      stimuli       = frame_count;
      name = expected_name;
      mark = "<";
      base = EXPECTED;
      read_frame_file;
      expected_file = file;
      expectations  = frame_count;
      received_file = 0;
      if (received_name != 0)
        received_file = $fopen(received_name, "w");
      if (waves_name != 0) begin
        $dumpfile(waves_name);
        $dumpvars;
      end
    end
  endtask

  task reset_state;
    begin
      cycle           = 0;
      idle_cycles     = 0;
      faults          = 0;
      random_1        = seed;
      random_2        = 1;
      frames_sent     = 0;
      is_offered      = 0;
      beats_in        = 0;
      receiving       = NONE;
      is_in_frame     = 0;
      is_frame_right  = 0;
      received_id     = NONE;
      bytes_received  = 0;
      first_out       = 0;
      last_out        = 0;
      is_accepting    = 0;
      frames_received = 0;
      frames_right    = 0;
      frames_shown    = 0;
      beats_out       = 0;
      is_held         = 0;
      id_errors       = 0;
      frame_errors    = 0;
      start_sending(0);
    end
  endtask

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
    end
  endtask

  initial begin : host
    take_options;
    check_options;
    open_files;
    reset_state;
    $display("seed %0d, stalls %0d %%, %0d bits; to repeat: +SEED=%0d +STALL_PERCENT=%0d", seed, stall_percent, WIDTH,
             seed, stall_percent);
    clk           = 0;
    rst_n         = 1;
    s_axis_tready = 0;
    offer_nothing;
    repeat (RESET_CYCLES) begin
      // An edge clears the registers of the reset, whatever their first level is.
      #1 rst_n = 0;
      #(HALF_PERIOD - 1) clk = 1;
      #HALF_PERIOD clk = 0;
      cycle = cycle + 1;
    end
    while (!is_over(0)) begin
      #HALF_PERIOD sample;
      clk = 1;
      #HALF_PERIOD clk = 0;
      rst_n       = 1;
      idle_cycles = idle_cycles + 1;
      send;
      receive;
      watch_errors;
      cycle = cycle + 1;
    end
    if (!is_all_moved(0))
      report_missing;
    if (id_errors < announced_id_errors) begin
      begin_fault;
      if (is_shown)
        $display("id_error pulsed %0d times, announced: %0d", id_errors, announced_id_errors);
    end
    if (frame_errors < announced_frame_errors) begin
      begin_fault;
      if (is_shown)
        $display("frame_error pulsed %0d times, announced: %0d", frame_errors, announced_frame_errors);
    end
    report_traffic;
    report_verdict;
  end

endmodule
