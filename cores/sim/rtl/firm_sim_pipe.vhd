-- SPDX-License-Identifier: Apache-2.0
-- The simulated host at the end of a pipe: it generates clock and reset, and serves the requests on file descriptor 3:
-- it takes frames for the system, and runs for a number of cycles. It reports the events in them on file descriptor 4.
-- docs/reference/transports.md describes requests and reports.
--
-- No time passes between two requests, so a simulation depends only on the requests, SEED and STALL_PERCENT. A violated
-- rule ends it with a message. As in firm_sim_host, one process samples the inputs before the rising edge, and
-- its outputs change HOLD after it.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_axis_pkg.is_stream_width;
use firm.firm_sim_pkg.all;

entity firm_sim_pipe is
  generic (
    WIDTH : integer := 8;
    -- Bytes of a frame's id, 1 or 2.
    ID_BYTES : integer := 1;
    -- Bits of `frame_error`, one per converter.
    ERRORS : integer := 1;
    -- Bits of `waits`, one per wire within the system.
    WIRES : integer := 1;
    -- Determines all random choices.
    SEED : integer := 1;
    -- The chance per cycle and direction that the host stalls.
    STALL_PERCENT : integer := 0
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

    id_error    : in std_logic                           := '0';
    frame_error : in std_logic_vector(ERRORS-1 downto 0) := (others => '0');
    -- The code of each converter's fault, read with a pulse in frame_error.
    frame_code  : in std_logic_vector(4*ERRORS-1 downto 0) := (others => '0');
    -- High in each cycle in which a wire has a valid message or beat that is not accepted.
    waits       : in std_logic_vector(WIRES-1 downto 0)  := (others => '0')
  );
end entity firm_sim_pipe;

architecture simulation of firm_sim_pipe is

  constant LANES        : positive := WIDTH/8;
  constant HALF_PERIOD  : time     := 5 ns;
  constant HOLD         : time     := 1 ns;
  constant RESET_CYCLES : positive := 8;
  constant HIGHEST_SEED : positive := 2147483562;  -- of math_real.uniform
  constant NO_ERRORS    : std_logic_vector(ERRORS-1 downto 0) := (others => '0');
  constant MOST_ERRORS  : natural  := 2**16 - 2;
  constant NO_WAITS     : std_logic_vector(WIRES-1 downto 0) := (others => '0');
  constant MOST_WIRES   : natural  := 2**16 - 3;
  -- Of requests and reports.
  constant VERSION      : natural  := 5;

  type level_t is array (boolean) of std_logic;
  constant LEVEL_OF : level_t := (false => '0', true => '1');

  type pipe_t is file of character;

  -- VHDL-93 cannot flush a file, so the C library does: `fflush(NULL)`.
  procedure flush_all_files(zero : in integer) is
  begin
    assert false
      report "firm_sim_pipe: this simulator does not support VHPIDIRECT, so it cannot flush files" severity failure;
  end procedure flush_all_files;

  attribute foreign : string;
  attribute foreign of flush_all_files : procedure is "VHPIDIRECT libc.so.6 fflush";

  -- A cycle's number; the 31 bits of an integer would overflow after some minutes of a fast simulator.
  type cycle_t is record
    high : natural;
    low  : natural;  -- 24 bits
  end record cycle_t;
  constant FIRST_CYCLE : cycle_t := (0, 0);

  function next_cycle(cycle : cycle_t) return cycle_t is
  begin
    if cycle.low = 2**24 - 1 then
      return (cycle.high + 1, 0);
    end if;
    return (cycle.high, cycle.low + 1);
  end function next_cycle;

  -- Cycles in which a beat waited: into the system, out of it, and on the wires within it.
  type counts_t is array (natural range <>) of natural;

  -- A frame that waits to be sent; byte k is character k+1.
  type frame_t;
  type frame_ptr_t is access frame_t;
  type frame_t is record
    bytes      : line;
    is_aborted : boolean;
    hole       : integer;  -- the byte that is not kept, or -1
    next_frame : frame_ptr_t;
  end record frame_t;

begin

  assert is_stream_width(WIDTH)
    report "firm_sim_pipe: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert ID_BYTES = 1 or ID_BYTES = 2
    report "firm_sim_pipe: ID_BYTES is " & integer'image(ID_BYTES) & "; legal: 1, 2"
    severity failure;
  assert ERRORS >= 1 and ERRORS <= MOST_ERRORS
    report "firm_sim_pipe: ERRORS is " & integer'image(ERRORS) & "; legal: 1 to 65534"
    severity failure;
  assert WIRES >= 1 and WIRES <= MOST_WIRES
    report "firm_sim_pipe: WIRES is " & integer'image(WIRES) & "; legal: 1 to 65533"
    severity failure;
  assert SEED >= 1 and SEED <= HIGHEST_SEED
    report "firm_sim_pipe: SEED is " & integer'image(SEED) & "; legal: 1 to 2147483562"
    severity failure;
  assert STALL_PERCENT >= 0 and STALL_PERCENT <= 99
    report "firm_sim_pipe: STALL_PERCENT is " & integer'image(STALL_PERCENT) & "; legal: 0 to 99"
    severity failure;

  host : process

    file requests : pipe_t;
    file reports  : pipe_t;

    variable cycle       : cycle_t := FIRST_CYCLE;
    variable quiet       : natural := 0;        -- cycles since the last beat, or integer'high
    variable is_reported : boolean := false;    -- an event that ends a run
    variable random_1    : positive;
    variable random_2    : positive := 1;

    -- The stream to the system.
    variable sending    : frame_ptr_t;          -- null when all is sent
    variable last_frame : frame_ptr_t;
    variable bytes_sent : natural := 0;         -- of `sending`, without the beat on offer
    variable is_offered : boolean := false;
    variable first_in   : cycle_t;

    -- The stream from the system: the incoming burst, as text that grows.
    variable burst        : line;
    variable burst_size   : natural := 0;
    variable burst_tid    : std_logic_vector(s_axis_tid'range);
    variable first_out    : cycle_t;
    variable is_accepting : boolean := false;

    -- A beat that waited for `tready`, and that the stream from the system must still show.
    variable is_held    : boolean := false;
    variable held_tdata : std_logic_vector(s_axis_tdata'range);
    variable held_tkeep : std_logic_vector(s_axis_tkeep'range);
    variable held_tuser : std_logic_vector(s_axis_tuser'range);
    variable held_tid   : std_logic_vector(s_axis_tid'range);
    variable held_tlast : std_logic;

    variable is_counting : boolean := false;    -- the host requests the waits
    variable waited      : counts_t(0 to WIRES+1) := (others => 0);

    -- Reports must be read before the simulation ends.
    procedure fail(what : in string) is
    begin
      flush_all_files(0);
      assert false
        report "firm_sim_pipe: " & what severity failure;
    end procedure fail;

    procedure fail_in_cycle(what : in string) is
    begin
      fail("cycle " & integer'image(cycle.low) & " + " & integer'image(cycle.high) & " * 2**24: " & what);
    end procedure fail_in_cycle;

    procedure draw_stall(is_stalled : out boolean) is
      variable draw : real;
    begin
      is_stalled := false;
      if STALL_PERCENT > 0 then
        uniform(random_1, random_2, draw);
        is_stalled := 100.0 * draw < real(STALL_PERCENT);
      end if;
    end procedure draw_stall;

    -- ------------------------------------------------------------------ requests and reports

    procedure open_pipes is
      variable status : file_open_status;
    begin
      file_open(status, requests, "/dev/fd/3", read_mode);
      if status /= open_ok then
        fail("file descriptor 3 cannot be read; a program that sends frames starts this simulator");
      end if;
      file_open(status, reports, "/dev/fd/4", write_mode);
      if status /= open_ok then
        fail("file descriptor 4 cannot be written; a program that sends frames starts this simulator");
      end if;
    end procedure open_pipes;

    procedure read_byte(value : out character) is
    begin
      if endfile(requests) then
        fail("the requests end within a request");
      end if;
      read(requests, value);
    end procedure read_byte;

    procedure read_number(number : out natural) is
      variable byte : character;
      variable sum  : natural := 0;
    begin
      for place in 0 to 3 loop
        read_byte(byte);
        if place = 3 and byte >= character'val(128) then
          fail("a number in a request is greater than 2147483647");
        end if;
        sum := sum + character'pos(byte) * 2**(8*place);
      end loop;
      number := sum;
    end procedure read_number;

    procedure read_frame(is_aborted, has_hole : in boolean) is
      variable frame : frame_ptr_t;
      variable size  : natural;
      variable hole  : integer := -1;
    begin
      if has_hole then
        read_number(hole);
      end if;
      read_number(size);
      if size = 0 then
        fail("the requested frame has no bytes");
      elsif hole >= size then
        fail("the requested frame has no byte " & integer'image(hole));
      end if;
      frame            := new frame_t;
      frame.bytes      := new string(1 to size);
      frame.is_aborted := is_aborted;
      frame.hole       := hole;
      for place in 1 to size loop
        read_byte(frame.bytes(place));
      end loop;
      if sending = null then
        sending := frame;
      else
        last_frame.next_frame := frame;
      end if;
      last_frame := frame;
    end procedure read_frame;

    procedure write_number(number : in natural; bytes : in positive) is
      variable rest : natural := number;
    begin
      for place in 1 to bytes loop
        write(reports, character'val(rest mod 256));
        rest := rest / 256;
      end loop;
    end procedure write_number;

    procedure write_cycle(number : in cycle_t) is
    begin
      write_number(number.low, 3);
      write_number(number.high, 5);
    end procedure write_cycle;

    procedure report_version is
    begin
      write(reports, 'V');
      write_number(VERSION, 1);
      flush_all_files(0);
    end procedure report_version;

    procedure report_taken is
    begin
      is_reported := true;
      write(reports, 'T');
      write_cycle(first_in);
      write_cycle(cycle);
    end procedure report_taken;

    procedure report_burst is
    begin
      is_reported := true;
      write(reports, 'B');
      write(reports, to_character(burst_tid(7 downto 0)));
      if ID_BYTES = 1 then
        write_number(0, 1);
      else
        write(reports, to_character(burst_tid(8*ID_BYTES-1 downto 8*ID_BYTES-8)));
      end if;
      write_number(boolean'pos(s_axis_tuser = "1"), 1);
      write_cycle(first_out);
      write_cycle(cycle);
      write_number(burst_size, 4);
      for place in 1 to burst_size loop
        write(reports, burst(place));
      end loop;
    end procedure report_burst;

    procedure report_id_error is
    begin
      is_reported := true;
      write(reports, 'I');
      write_cycle(cycle);
    end procedure report_id_error;

    procedure report_error(converter : in natural) is
    begin
      is_reported := true;
      write(reports, 'E');
      write_number(converter + 2**16*to_integer(unsigned(frame_code(4*converter+3 downto 4*converter))), 3);
      write_cycle(cycle);
    end procedure report_error;

    procedure report_waits is
    begin
      write(reports, 'W');
      write_cycle(cycle);
      write_number(WIRES + 2, 2);
      for count in waited'range loop
        write_number(waited(count), 4);
      end loop;
      waited      := (others => 0);
      is_counting := true;
    end procedure report_waits;

    procedure forget_waits is
    begin
      waited      := (others => 0);
      is_counting := false;
    end procedure forget_waits;

    procedure report_stand is
    begin
      write(reports, 'S');
      write_cycle(cycle);
      write_number(quiet, 4);
      flush_all_files(0);
    end procedure report_stand;

    -- ------------------------------------------------------------------ to the system

    procedure offer_beat is
      variable tdata : std_logic_vector(WIDTH-1 downto 0) := (others => 'X');
      variable tkeep : std_logic_vector(LANES-1 downto 0) := (others => '0');
    begin
      for lane in 0 to LANES-1 loop
        exit when bytes_sent + lane = sending.bytes'length;
        tdata(8*lane+7 downto 8*lane) := to_byte(sending.bytes(bytes_sent + lane + 1));
        tkeep(lane)                   := LEVEL_OF(bytes_sent + lane /= sending.hole);
      end loop;
      m_axis_tdata  <= tdata after HOLD;
      m_axis_tkeep  <= tkeep after HOLD;
      m_axis_tvalid <= '1' after HOLD;
      m_axis_tuser  <= "0" after HOLD;
      m_axis_tlast  <= '0' after HOLD;
      if sending.bytes'length - bytes_sent <= LANES then
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
      variable sent : frame_ptr_t;
    begin
      quiet      := 0;
      is_offered := false;
      if bytes_sent = 0 then
        first_in := cycle;
      end if;
      bytes_sent := bytes_sent + LANES;
      if bytes_sent >= sending.bytes'length then
        report_taken;
        sent       := sending;
        sending    := sent.next_frame;
        bytes_sent := 0;
        deallocate(sent.bytes);
        deallocate(sent);
      end if;
    end procedure note_sent_beat;

    procedure send is
      variable is_stalled  : boolean;
      variable was_offered : boolean;
    begin
      was_offered := is_offered;
      if is_offered then
        if m_axis_tready = '1' then
          note_sent_beat;
        elsif m_axis_tready /= '0' then
          fail_in_cycle("m_axis_tready is " & std_logic'image(m_axis_tready));
        end if;
      end if;
      if not is_offered then
        draw_stall(is_stalled);
        if sending /= null and not is_stalled then
          offer_beat;
        elsif was_offered then
          offer_nothing;
        end if;
      end if;
    end procedure send;

    -- ------------------------------------------------------------------ from the system

    procedure begin_burst is
    begin
      first_out := cycle;
      burst_tid := s_axis_tid;
      if not is_defined(burst_tid) then
        fail_in_cycle("s_axis_tid is " & to_hex(burst_tid));
      end if;
    end procedure begin_burst;

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
          fail_in_cycle("s_axis_tkeep is undefined or not contiguous from the lowest lane");
        end if;
      end loop;
      if kept = 0 then
        fail_in_cycle("a beat without a byte");
      elsif kept < LANES and s_axis_tlast /= '1' then
        fail_in_cycle("a beat that is neither full nor the last");
      end if;
      bytes := kept;
    end procedure count_kept;

    procedure take_beat is
      variable bytes : natural;
      variable byte  : byte_t;
    begin
      quiet := 0;
      if burst_size = 0 then
        begin_burst;
      elsif s_axis_tid /= burst_tid then
        fail_in_cycle("s_axis_tid changes within a burst");
      end if;
      count_kept(bytes);
      make_room(burst, burst_size, burst_size + bytes);
      for lane in 0 to bytes-1 loop
        byte := s_axis_tdata(8*lane+7 downto 8*lane);
        if not is_defined(byte) then
          fail_in_cycle("byte " & integer'image(burst_size + lane) & " of a burst is " & to_hex(byte));
        end if;
        burst(burst_size + lane + 1) := to_character(byte);
      end loop;
      burst_size := burst_size + bytes;
      if s_axis_tlast = '1' then
        report_burst;
        burst_size := 0;
      elsif s_axis_tlast /= '0' then
        fail_in_cycle("s_axis_tlast is " & std_logic'image(s_axis_tlast));
      end if;
    end procedure take_beat;

    procedure check_held is
    begin
      if s_axis_tvalid /= '1' then
        fail_in_cycle("s_axis_tvalid falls before s_axis_tready rises");
      elsif s_axis_tdata /= held_tdata or s_axis_tkeep /= held_tkeep or s_axis_tuser /= held_tuser
            or s_axis_tid /= held_tid or s_axis_tlast /= held_tlast then
        fail_in_cycle("the stream from the system changes before s_axis_tready rises");
      end if;
    end procedure check_held;

    procedure hold_beat is
    begin
      held_tdata := s_axis_tdata;
      held_tkeep := s_axis_tkeep;
      held_tuser := s_axis_tuser;
      held_tid   := s_axis_tid;
      held_tlast := s_axis_tlast;
    end procedure hold_beat;

    procedure receive is
      variable is_stalled : boolean;
    begin
      if is_held then
        check_held;
      end if;
      is_held := false;
      if s_axis_tvalid = '1' and is_accepting then
        take_beat;
      elsif s_axis_tvalid = '1' then
        is_held := true;
        hold_beat;
      elsif s_axis_tvalid /= '0' then
        fail_in_cycle("s_axis_tvalid is " & std_logic'image(s_axis_tvalid));
      end if;
      draw_stall(is_stalled);
      if is_stalled = is_accepting then
        is_accepting  := not is_stalled;
        s_axis_tready <= LEVEL_OF(is_accepting) after HOLD;
      end if;
    end procedure receive;

    -- ------------------------------------------------------------------ errors

    procedure watch_errors is
    begin
      if id_error = '1' then
        report_id_error;
      elsif id_error /= '0' then
        fail_in_cycle("id_error is " & std_logic'image(id_error));
      end if;
      if frame_error /= NO_ERRORS then
        for converter in 0 to ERRORS-1 loop
          if frame_error(converter) = '1' then
            report_error(converter);
          elsif frame_error(converter) /= '0' then
            fail_in_cycle("frame_error(" & integer'image(converter) & ") is "
              & std_logic'image(frame_error(converter)));
          end if;
        end loop;
      end if;
    end procedure watch_errors;

    -- ------------------------------------------------------------------ waits

    procedure count_wait(place : in natural) is
    begin
      if waited(place) < natural'high then
        waited(place) := waited(place) + 1;
      end if;
    end procedure count_wait;

    procedure count_waits is
    begin
      if is_offered and m_axis_tready = '0' then
        count_wait(0);
      end if;
      if s_axis_tvalid = '1' and not is_accepting then
        count_wait(1);
      end if;
      if waits /= NO_WAITS then
        for wire in 0 to WIRES-1 loop
          if waits(wire) = '1' then
            count_wait(wire + 2);
          end if;
        end loop;
      end if;
    end procedure count_waits;

    -- ------------------------------------------------------------------ cycles

    procedure clock_cycle is
    begin
      wait for HALF_PERIOD;
      clk <= '0';
      wait for HALF_PERIOD;
    end procedure clock_cycle;

    procedure run is
      variable cycles_left : natural;
    begin
      read_number(cycles_left);
      is_reported := false;
      while cycles_left > 0 and not is_reported loop
        clk <= '1';
        if quiet < integer'high then
          quiet := quiet + 1;
        end if;
        if is_counting then
          count_waits;
        end if;
        send;
        receive;
        watch_errors;
        clock_cycle;
        cycle       := next_cycle(cycle);
        cycles_left := cycles_left - 1;
      end loop;
      report_stand;
    end procedure run;

    variable kind : character := 'R';  -- of the request

  begin
    random_1 := SEED;
    open_pipes;
    report_version;
    rst_n         <= '0';
    s_axis_tready <= '0';
    offer_nothing;
    for reset_cycle in 1 to RESET_CYCLES loop
      clk <= '1';
      clock_cycle;
    end loop;
    rst_n <= '1' after HOLD;

    -- The end of the requests has the same effect as Q.
    while kind /= 'Q' and not endfile(requests) loop
      read(requests, kind);
      case kind is
        when 'F'    => read_frame(false, false);
        when 'A'    => read_frame(true, false);
        when 'H'    => read_frame(false, true);
        when 'R'    => run;
        when 'W'    => report_waits;
        when 'N'    => forget_waits;
        when 'Q'    => report_stand;
        when others => fail("unknown request " & integer'image(character'pos(kind)) & "; legal: F, A, H, R, W, N, Q");
      end case;
    end loop;
    wait;
  end process host;

end architecture simulation;
