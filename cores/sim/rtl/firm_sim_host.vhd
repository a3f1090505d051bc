-- SPDX-License-Identifier: Apache-2.0
-- The simulated host: it generates clock and reset, sends the frames of a stimulus file, compares responses with an
-- expected file, and reports. docs/reference/simulation-host.md describes the files and the report.
--
-- One process does everything, once per cycle: it samples the inputs before the rising edge, and its outputs change
-- HOLD after the edge, so the order of delta cycles does not matter. A stream without a beat carries 'X'.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sim_pkg.all;

entity firm_sim_host is
  generic (
    WIDTH : integer := 8;
    -- Bytes of a frame's id: 1 or 2.
    ID_BYTES : integer := 1;
    -- Bits of `frame_error`, one per converter.
    ERRORS : integer := 1;
    -- Paths relative to the directory in which the simulator runs.
    STIMULUS_FILE : string := "stimulus.txt";
    EXPECTED_FILE : string := "expected.txt";
    -- The file for received frames, in the grammar of the expected file; none if empty.
    RECEIVED_FILE : string := "";
    -- Determines all random choices.
    SEED : integer := 1;
    -- The chance per cycle and direction that the host stalls.
    STALL_PERCENT : integer := 0;
    -- Frames whose labels and latency are printed; the default is all.
    SHOWN : integer := integer'high;
    -- Cycles without a beat after which the host gives up on missing frames.
    WATCHDOG : integer := 100000;
    -- Cycles without a beat in which it listens for surplus frames after the last expected one.
    QUIET : integer := 1000
  );
  port (
    clk   : out std_logic;
    rst_n : out std_logic;

    -- To the system.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- From the system.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tid    : in  std_logic_vector(8*ID_BYTES-1 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- A pulse that the expected file does not announce is a fault.
    id_error    : in std_logic                           := '0';
    frame_error : in std_logic_vector(ERRORS-1 downto 0) := (others => '0')
  );
end entity firm_sim_host;

architecture simulation of firm_sim_host is

  constant LANES         : positive := WIDTH/8;
  constant HALF_PERIOD   : time     := 5 ns;
  constant HOLD          : time     := 1 ns;
  constant RESET_CYCLES  : positive := 8;
  constant FAULTS_SHOWN  : positive := 10;
  constant HIGHEST_SEED  : positive := 2147483562;  -- of math_real.uniform
  constant NO_ID         : integer  := -1;
  constant LINE_BYTES    : positive := 64;

  function percent_of(beats, cycles : natural) return string is
  begin
    return integer'image(beats) & " beats, " & integer'image(integer(100.0 * real(beats) / real(cycles))) & " %";
  end function percent_of;

  -- The id in the first beat of a frame. If the beat is narrower, the comparison of the bytes shows whether `tid` is
  -- correct.
  function id_of(tdata, tid : std_logic_vector) return std_logic_vector is
    variable beat : std_logic_vector(WIDTH+7 downto 0);
  begin
    if WIDTH < 8*ID_BYTES then
      return tid;
    end if;
    beat(WIDTH-1 downto 0) := tdata;
    return beat(8*ID_BYTES-1 downto 0);
  end function id_of;

  -- The highest byte first.
  function hex_of_id(id : std_logic_vector) return string is
    alias numbered : std_logic_vector(id'length-1 downto 0) is id;
  begin
    if ID_BYTES = 1 then
      return to_hex(numbered);
    end if;
    return to_hex(numbered(numbered'high downto numbered'high-7)) & to_hex(numbered(7 downto 0));
  end function hex_of_id;

begin

  assert is_stream_width(WIDTH)
    report "firm_sim_host: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert ID_BYTES = 1 or ID_BYTES = 2
    report "firm_sim_host: ID_BYTES is " & integer'image(ID_BYTES) & "; legal: 1, 2"
    severity failure;
  assert ERRORS >= 1
    report "firm_sim_host: ERRORS is " & integer'image(ERRORS) & "; legal: 1 or more"
    severity failure;
  assert SEED >= 1 and SEED <= HIGHEST_SEED
    report "firm_sim_host: SEED is " & integer'image(SEED) & "; legal: 1 to 2147483562"
    severity failure;
  assert STALL_PERCENT >= 0 and STALL_PERCENT <= 99
    report "firm_sim_host: STALL_PERCENT is " & integer'image(STALL_PERCENT) & "; legal: 0 to 99"
    severity failure;
  assert SHOWN >= 0
    report "firm_sim_host: SHOWN is " & integer'image(SHOWN) & "; legal: 0 or more"
    severity failure;
  assert WATCHDOG >= 1
    report "firm_sim_host: WATCHDOG is " & integer'image(WATCHDOG) & "; legal: 1 or more"
    severity failure;
  assert QUIET >= 1
    report "firm_sim_host: QUIET is " & integer'image(QUIET) & "; legal: 1 or more"
    severity failure;

  host : process

    variable stimulus : frame_file_t;
    variable expected : frame_file_t;

    variable cycle       : natural := 0;
    variable idle_cycles : natural := 0;  -- since the last beat sent or expected; surplus ones do not keep a run alive
    variable faults      : natural := 0;
    variable random_1    : positive;
    variable random_2    : positive := 1;

    -- The stream to the system.
    variable sending     : frame_ptr_t;   -- null when all is sent
    variable frames_sent : natural := 0;
    variable bytes_sent  : natural := 0;  -- of `sending`, without the beat on offer
    variable is_offered  : boolean := false;
    variable beats_in    : natural := 0;

    -- The stream from the system.
    variable receiving       : frame_ptr_t;  -- the expected frame; null if no frame is expected
    variable is_in_frame     : boolean := false;
    variable is_frame_right  : boolean;
    variable received_id     : integer := NO_ID;
    variable bytes_received  : natural := 0;
    variable bytes_kept      : line;         -- those of the incoming frame, if it may have come another way
    variable first_out       : natural;
    variable is_accepting    : boolean := false;
    variable frames_received : natural := 0;  -- expected ones
    variable frames_right    : natural := 0;
    variable frames_shown    : natural := 0;
    variable beats_out       : natural := 0;
    variable last_out        : natural := 0;

    -- A beat that waited for `tready`, and that the stream from the system must still show.
    variable is_held    : boolean := false;
    variable held_tdata : std_logic_vector(s_axis_tdata'range);
    variable held_tkeep : std_logic_vector(s_axis_tkeep'range);
    variable held_tuser : std_logic_vector(s_axis_tuser'range);
    variable held_tid   : std_logic_vector(s_axis_tid'range);
    variable held_tlast : std_logic;

    -- The file of received frames, and its line of the incoming frame.
    file received          : text;
    variable received_line : line;

    variable id_errors    : natural := 0;
    variable frame_errors : natural := 0;

    procedure fault(what : in string) is
    begin
      faults := faults + 1;
      if faults <= FAULTS_SHOWN then
        print("fault in cycle " & integer'image(cycle) & ": " & what);
      end if;
    end procedure fault;

    -- A fault of the incoming frame.
    procedure frame_fault(what : in string) is
    begin
      is_frame_right := false;
      if receiving = null then
        fault("frame with id " & integer'image(received_id) & ": " & what);
      else
        fault("'" & receiving.label_text.all & "': " & what);
      end if;
    end procedure frame_fault;

    procedure draw_stall(is_stalled : out boolean) is
      variable draw : real;
    begin
      uniform(random_1, random_2, draw);
      is_stalled := 100.0 * draw < real(STALL_PERCENT);
    end procedure draw_stall;

    -- ------------------------------------------------------------------ to the system

    procedure offer_beat is
      variable tdata : std_logic_vector(WIDTH-1 downto 0) := (others => 'X');
      variable tkeep : std_logic_vector(LANES-1 downto 0) := (others => '0');
    begin
      for lane in 0 to LANES-1 loop
        exit when bytes_sent + lane = sending.size;
        tdata(8*lane+7 downto 8*lane) := to_byte(sending.bytes(bytes_sent + lane + 1));
        tkeep(lane)                   := '1';
      end loop;
      m_axis_tdata  <= tdata after HOLD;
      m_axis_tkeep  <= tkeep after HOLD;
      m_axis_tvalid <= '1' after HOLD;
      m_axis_tuser  <= "0" after HOLD;
      m_axis_tlast  <= '0' after HOLD;
      if sending.size - bytes_sent <= LANES then
        m_axis_tlast <= '1' after HOLD;
        if sending.is_aborted then
          m_axis_tuser <= "1" after HOLD;
        end if;
      end if;
      is_offered := true;
    end procedure offer_beat;

    procedure offer_nothing is
    begin
      m_axis_tdata  <= (m_axis_tdata'range => 'X') after HOLD;
      m_axis_tkeep  <= (m_axis_tkeep'range => 'X') after HOLD;
      m_axis_tuser  <= "X" after HOLD;
      m_axis_tlast  <= 'X' after HOLD;
      m_axis_tvalid <= '0' after HOLD;
    end procedure offer_nothing;

    procedure note_sent_beat is
    begin
      beats_in    := beats_in + 1;
      idle_cycles := 0;
      is_offered  := false;
      if bytes_sent = 0 then
        sending.first_cycle := cycle;
      end if;
      bytes_sent := bytes_sent + LANES;
      if bytes_sent >= sending.size then
        sending.last_cycle := cycle;
        sending            := sending.next_frame;
        bytes_sent         := 0;
        frames_sent        := frames_sent + 1;
      end if;
    end procedure note_sent_beat;

    procedure send is
      variable is_stalled : boolean;
    begin
      if is_offered then
        if m_axis_tready = '1' then
          note_sent_beat;
        elsif m_axis_tready /= '0' then
          fault("m_axis_tready is " & std_logic'image(m_axis_tready));
        end if;
      end if;
      if not is_offered then
        draw_stall(is_stalled);
        if sending = null or is_stalled then
          offer_nothing;
        else
          offer_beat;
        end if;
      end if;
    end procedure send;

    -- ------------------------------------------------------------------ from the system

    procedure show_frame is
      variable cause : frame_ptr_t;
    begin
      frames_shown := frames_shown + 1;
      if receiving.cause < 0 then
        print("    < " & receiving.label_text.all);
        return;
      end if;
      find_frame(stimulus, receiving.cause, cause);
      if cause = null then
        print("    < " & receiving.label_text.all);
        frame_fault("caused by stimulus " & integer'image(receiving.cause) & ", which does not exist");
        return;
      end if;
      print("  " & integer'image(receiving.cause) & " > " & cause.label_text.all);
      print("    < " & receiving.label_text.all);
      print("    " & integer'image(cycle - cause.first_cycle) & " cycles first beat in to last beat out, "
            & integer'image(first_out - cause.last_cycle) & " last beat in to first beat out");
    end procedure show_frame;

    -- Nothing is written without a file: writing would double the simulation time.
    procedure note_frame(id : in std_logic_vector(8*ID_BYTES-1 downto 0)) is
    begin
      if RECEIVED_FILE /= "" then
        write(received_line, "< id " & hex_of_id(id));
        writeline(received, received_line);
      end if;
    end procedure note_frame;

    procedure note_byte(value : in byte_t) is
    begin
      if RECEIVED_FILE /= "" then
        if bytes_received mod LINE_BYTES = 0 then
          if bytes_received > 0 then
            writeline(received, received_line);
          end if;
          write(received_line, string'("  "));
        end if;
        write(received_line, to_hex(value));
      end if;
    end procedure note_byte;

    procedure note_end is
    begin
      if RECEIVED_FILE /= "" and bytes_received > 0 then
        writeline(received, received_line);
        if s_axis_tuser = "1" and received_id /= NO_ID then
          write(received_line, "! aborted " & integer'image(received_id) & " 10");
          writeline(received, received_line);
        end if;
      end if;
    end procedure note_end;

    procedure begin_frame(id : in std_logic_vector(8*ID_BYTES-1 downto 0)) is
    begin
      note_frame(id);
      is_in_frame    := true;
      is_frame_right := true;
      bytes_received := 0;
      first_out      := cycle;
      receiving      := null;
      received_id    := NO_ID;
      if not is_defined(id) then
        frame_fault("its id is " & hex_of_id(id));
        return;
      end if;
      received_id := to_integer(unsigned(id));
      receiving   := expected.first_of_id(received_id);
      if receiving = null then
        frame_fault("no such frame is expected");
      else
        expected.first_of_id(received_id) := receiving.next_of_id;
        receiving.is_received             := true;
        frames_received                   := frames_received + 1;
      end if;
    end procedure begin_frame;

    procedure compare_byte(value : in byte_t) is
      constant WANTED   : byte_t := to_byte(receiving.bytes(bytes_received+1));
      variable is_right : boolean;
    begin
      compare(expected, received_id, receiving, bytes_kept, bytes_received, value, is_frame_right, is_right);
      if not is_right then
        frame_fault("byte " & integer'image(bytes_received) & ": expected " & to_hex(WANTED) & ", got "
          & to_hex(value));
      end if;
    end procedure compare_byte;

    procedure receive_byte(value : in byte_t) is
    begin
      note_byte(value);
      if receiving /= null then
        if receiving.is_aborted then
          idle_cycles := 0;
        elsif bytes_received < receiving.size then
          idle_cycles := 0;
          compare_byte(value);
        elsif bytes_received = receiving.size then
          frame_fault("continues after its " & integer'image(receiving.size) & " bytes");
        end if;
      end if;
      bytes_received := bytes_received + 1;
    end procedure receive_byte;

    procedure finish_frame is
    begin
      is_in_frame := false;
      note_end;
      if receiving = null then
        return;
      end if;
      if s_axis_tuser = "1" and not receiving.is_aborted then
        frame_fault("is aborted after " & integer'image(bytes_received) & " bytes");
      elsif s_axis_tuser /= "1" and receiving.is_aborted then
        frame_fault("is not aborted");
      elsif bytes_received < receiving.size and not receiving.is_aborted then
        frame_fault("ends after " & integer'image(bytes_received) & " bytes, expected "
          & integer'image(receiving.size));
      end if;
      if frames_shown < SHOWN then
        show_frame;
      end if;
      if is_frame_right then
        frames_right := frames_right + 1;
      end if;
    end procedure finish_frame;

    -- The bytes of the beat: the lanes from the lowest up to the first that is not kept.
    procedure count_kept(bytes : out natural) is
      variable kept : natural := 0;
    begin
      while kept < LANES loop
        exit when s_axis_tkeep(kept) /= '1';
        kept := kept + 1;
      end loop;
      for lane in kept to LANES-1 loop
        if s_axis_tkeep(lane) /= '0' then
          frame_fault("tkeep is undefined or not contiguous from the lowest lane");
          exit;
        end if;
      end loop;
      if kept = 0 then
        frame_fault("a beat without a byte");
      elsif kept < LANES and s_axis_tlast /= '1' then
        frame_fault("a beat that is neither full nor the last");
      end if;
      bytes := kept;
    end procedure count_kept;

    procedure take_beat is
      variable bytes : natural;
    begin
      beats_out := beats_out + 1;
      last_out  := cycle;
      if not is_in_frame then
        begin_frame(id_of(s_axis_tdata, s_axis_tid));
      end if;
      if received_id /= NO_ID and s_axis_tid /= std_logic_vector(to_unsigned(received_id, 8*ID_BYTES)) then
        frame_fault("tid is " & hex_of_id(s_axis_tid));
      end if;
      count_kept(bytes);
      for lane in 0 to bytes-1 loop
        receive_byte(s_axis_tdata(8*lane+7 downto 8*lane));
      end loop;
      if s_axis_tlast = '1' then
        finish_frame;
      elsif s_axis_tlast /= '0' then
        frame_fault("tlast is " & std_logic'image(s_axis_tlast));
      end if;
    end procedure take_beat;

    procedure check_held is
    begin
      if s_axis_tvalid /= '1' then
        fault("s_axis_tvalid falls before s_axis_tready rises");
      elsif s_axis_tdata /= held_tdata or s_axis_tkeep /= held_tkeep or s_axis_tuser /= held_tuser
            or s_axis_tid /= held_tid or s_axis_tlast /= held_tlast then
        fault("the stream from the system changes before s_axis_tready rises");
      end if;
    end procedure check_held;

    procedure receive is
      variable is_stalled : boolean;
    begin
      if is_held then
        check_held;
      end if;
      if s_axis_tvalid = '1' and is_accepting then
        take_beat;
      elsif s_axis_tvalid /= '0' and s_axis_tvalid /= '1' then
        fault("s_axis_tvalid is " & std_logic'image(s_axis_tvalid));
      end if;
      is_held    := s_axis_tvalid = '1' and not is_accepting;
      held_tdata := s_axis_tdata;
      held_tkeep := s_axis_tkeep;
      held_tuser := s_axis_tuser;
      held_tid   := s_axis_tid;
      held_tlast := s_axis_tlast;
      draw_stall(is_stalled);
      is_accepting := not is_stalled;
      s_axis_tready <= '0' after HOLD;
      if is_accepting then
        s_axis_tready <= '1' after HOLD;
      end if;
    end procedure receive;

    -- ------------------------------------------------------------------ errors, end and report

    procedure watch_error(name : in string; level : in std_logic; announced : in natural; pulses : inout natural) is
    begin
      if level = '1' then
        pulses := pulses + 1;
        if pulses > announced then
          fault(name & " pulses, announced: " & integer'image(announced));
        end if;
      elsif level /= '0' then
        fault(name & " is " & std_logic'image(level));
      end if;
    end procedure watch_error;

    procedure watch_errors is
    begin
      watch_error("id_error", id_error, expected.id_errors, id_errors);
      for converter in frame_error'range loop
        watch_error("frame_error(" & integer'image(converter) & ")", frame_error(converter), expected.frame_errors,
                    frame_errors);
      end loop;
    end procedure watch_errors;

    procedure clock_cycle is
    begin
      wait for HALF_PERIOD;
      clk <= '0';
      wait for HALF_PERIOD;
      cycle := cycle + 1;
    end procedure clock_cycle;

    impure function is_all_moved return boolean is
    begin
      return sending = null and frames_received = expected.frames and not is_in_frame;
    end function is_all_moved;

    impure function is_over return boolean is
    begin
      if is_all_moved then
        return idle_cycles >= QUIET;
      end if;
      return idle_cycles >= WATCHDOG;
    end function is_over;

    procedure report_missing is
      variable frame : frame_ptr_t;
    begin
      fault("nothing moved for " & integer'image(idle_cycles) & " cycles; " & integer'image(frames_sent) & " of "
            & integer'image(stimulus.frames) & " frames in, " & integer'image(frames_received) & " of "
            & integer'image(expected.frames) & " out");
      if sending /= null then
        fault("'" & sending.label_text.all & "': only " & integer'image(bytes_sent) & " bytes taken");
      end if;
      if is_in_frame then
        frame_fault("stops after " & integer'image(bytes_received) & " bytes without tlast");
      end if;
      frame := expected.first;
      while frame /= null loop
        if not frame.is_received then
          fault("missing: '" & frame.label_text.all & "'");
        end if;
        frame := frame.next_frame;
      end loop;
    end procedure report_missing;

    procedure check_announced(name : in string; pulses, announced : in natural) is
    begin
      if pulses < announced then
        fault(name & " pulsed " & integer'image(pulses) & " times, announced: " & integer'image(announced));
      end if;
    end procedure check_announced;

    procedure report_traffic is
      variable cycles : natural := 0;
    begin
      if beats_in > 0 and beats_out > 0 and last_out >= stimulus.first.first_cycle then
        cycles := last_out - stimulus.first.first_cycle + 1;
      end if;
      print(integer'image(frames_sent) & " frames in, " & integer'image(frames_received) & " frames out, "
            & integer'image(cycles) & " cycles from the first beat in to the last beat out");
      if cycles > 0 then
        print("in: " & percent_of(beats_in, cycles) & " of these cycles; out: " & percent_of(beats_out, cycles));
      end if;
    end procedure report_traffic;

    procedure report_verdict(verdict : in string) is
      constant SCORE : string := verdict & " " & integer'image(frames_right) & "/" & integer'image(expected.frames);
    begin
      if faults > FAULTS_SHOWN then
        print("and " & integer'image(faults - FAULTS_SHOWN) & " more faults");
      end if;
      print(SCORE);
      assert faults = 0 report SCORE severity failure;
    end procedure report_verdict;

  begin
    random_1 := SEED;
    read_stimulus_file(STIMULUS_FILE, stimulus, ID_BYTES);
    read_expected_file(EXPECTED_FILE, expected, ID_BYTES);
    if RECEIVED_FILE /= "" then
      file_open(received, RECEIVED_FILE, write_mode);
    end if;
    print("seed " & integer'image(SEED) & ", stalls " & integer'image(STALL_PERCENT) & " %, "
          & integer'image(WIDTH) & " bits; to repeat: -gSEED=" & integer'image(SEED)
          & " -gSTALL_PERCENT=" & integer'image(STALL_PERCENT));

    rst_n         <= '0';
    s_axis_tready <= '0';
    offer_nothing;
    for reset_cycle in 1 to RESET_CYCLES loop
      clk <= '1';
      clock_cycle;
    end loop;
    rst_n <= '1' after HOLD;

    sending := stimulus.first;
    while not is_over loop
      clk         <= '1';
      idle_cycles := idle_cycles + 1;
      send;
      receive;
      watch_errors;
      clock_cycle;
    end loop;

    if not is_all_moved then
      report_missing;
    end if;
    check_announced("id_error", id_errors, expected.id_errors);
    check_announced("frame_error", frame_errors, expected.frame_errors);
    report_traffic;
    if RECEIVED_FILE /= "" then
      file_close(received);
    end if;
    if faults = 0 then
      report_verdict("PASS");
    else
      report_verdict("FAIL");
    end if;
    wait;
  end process host;

end architecture simulation;
