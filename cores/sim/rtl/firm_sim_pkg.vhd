-- SPDX-License-Identifier: Apache-2.0
-- The frame files of the simulation host (docs/reference/simulation-host.md): reads them, checks them and keeps them in
-- memory, one character per byte. Simulation only. A fault of form ends the simulation with `file:line: message`.
library ieee;
use ieee.std_logic_1164.all;
use std.textio.all;
library firm;
use firm.firm_axis_pkg.max;

package firm_sim_pkg is

  subtype byte_t is std_logic_vector(7 downto 0);

  -- A stream of bytes without its tready, between two entities of a bench.
  type bytes_t is record
    tdata  : byte_t;
    tuser  : std_logic_vector(0 downto 0);
    tvalid : std_logic;
    tlast  : std_logic;
  end record bytes_t;

  type frame_t;
  type frame_ptr_t is access frame_t;
  type frame_t is record
    label_text  : line;         -- without the mark and without `@n`
    cause       : integer;      -- index of the stimulus frame that causes this one; -1 if unknown
    bytes       : line;         -- byte k is character k+1
    any_byte    : line;         -- '.' at byte k+1 if it may have any value; null if there is no such byte
    size        : natural;      -- bytes
    first_cycle : natural;      -- the host notes when the first and the last beat of a stimulus frame were taken
    last_cycle  : natural;
    is_aborted  : boolean;      -- its last beat aborts it
    way         : natural;      -- frames with one id and different ways may come in any order; 0: in that of the file
    is_received : boolean;      -- set by the host
    next_frame  : frame_ptr_t;  -- in the order of the file
    next_of_id  : frame_ptr_t;  -- the next one with the same id
  end record frame_t;

  constant MOST_WAYS : positive := 63;

  type frame_per_id_t is array (0 to 65535) of frame_ptr_t;

  type frame_file_t is record
    id_bytes       : natural;         -- of a frame's id
    first          : frame_ptr_t;
    last           : frame_ptr_t;
    frames         : natural;
    first_of_id    : frame_per_id_t;  -- the next frame to come; the host moves it on
    last_of_id     : frame_per_id_t;
    id_errors      : natural;
    frame_errors   : natural;
  end record frame_file_t;

  -- An id has one byte or two.
  procedure read_stimulus_file(path : in string; content : inout frame_file_t; id_bytes : in positive := 1);
  procedure read_expected_file(path : in string; content : inout frame_file_t; id_bytes : in positive := 1);

  function to_byte(char : character) return byte_t;
  -- Of a byte that is defined.
  function to_character(value : byte_t) return character;
  -- Two digits; an undefined bit makes its digit an `X`.
  function to_hex(value : byte_t) return string;
  function is_defined(value : std_logic_vector) return boolean;

  procedure print(text : in string);

  -- Gives a text, of which `used` characters are in use, room for `wanted`. The text grows by doubling, so that a long
  -- frame is not copied for every line.
  procedure make_room(text : inout line; used : in natural; wanted : in positive);

  -- A bench that writes results to a file can compare them at once. EXPECTED is the file with the expected ones, or
  -- empty:
  --   file wanted_file : text open read_mode is existing(EXPECTED);
  --   write_result(result_file, wanted_file, EXPECTED, row);  -- in place of writeline
  --   assert endfile(wanted_file)                             -- at the end
  function existing(path : string) return string;
  procedure write_result(file results : text; file expected : text; path : in string; row : inout line);

  -- As a concurrent call: gives a pulse each millisecond after the reset, and counts them.
  procedure keep_time(
    signal   clk    : in std_logic;
    signal   rst_n  : in std_logic;
    constant cycles : in positive;  -- of a millisecond
    signal   tick   : out std_logic;
    signal   ms     : inout natural
  );

  -- Frame `number`, counted from 0, in the order of the file; null if there are fewer.
  procedure find_frame(content : inout frame_file_t; number : in natural; frame : out frame_ptr_t);

  -- Compares byte `count` of a frame with this `id`, counted from 0, and keeps it if the frame has a way. If it differs
  -- and `may_change`, the next frame of another way that begins with all bytes so far takes the place of `frame`.
  procedure compare(
    content    : inout frame_file_t;
    id         : in    natural;
    frame      : inout frame_ptr_t;
    kept       : inout line;
    count      : in    natural;
    value      : in    byte_t;
    may_change : in    boolean;
    is_right   : out   boolean
  );

end package firm_sim_pkg;

package body firm_sim_pkg is

  constant HEX_DIGITS   : string(1 to 16) := "0123456789abcdef";
  constant LENGTH_BYTES : positive        := 4;

  -- Frames among which the next one of another way is looked for.
  constant WAYS_LOOKED_AT : positive := 1000;

  type byte_table_t is array (character) of byte_t;

  function byte_table return byte_table_t is
    variable table : byte_table_t;
    variable rest  : natural;
  begin
    for char in character loop
      rest := character'pos(char);
      for place in 0 to 7 loop
        table(char)(place) := '0';
        if rest mod 2 = 1 then
          table(char)(place) := '1';
        end if;
        rest := rest / 2;
      end loop;
    end loop;
    return table;
  end function byte_table;

  constant BYTE_OF : byte_table_t := byte_table;

  function to_byte(char : character) return byte_t is
  begin
    return BYTE_OF(char);
  end function to_byte;

  function to_character(value : byte_t) return character is
    variable code : natural := 0;
  begin
    for place in value'range loop
      code := 2 * code;
      if value(place) = '1' then
        code := code + 1;
      end if;
    end loop;
    return character'val(code);
  end function to_character;

  function to_hex(value : byte_t) return string is
    variable text  : string(1 to 2);
    variable digit : natural;
  begin
    for place in 0 to 1 loop
      digit := 0;
      for bit_place in 7 - 4*place downto 4 - 4*place loop
        digit := 2 * digit;
        if to_x01(value(bit_place)) = '1' then
          digit := digit + 1;
        end if;
      end loop;
      text(place+1) := HEX_DIGITS(digit+1);
      if not is_defined(value(7 - 4*place downto 4 - 4*place)) then
        text(place+1) := 'X';
      end if;
    end loop;
    return text;
  end function to_hex;

  function is_defined(value : std_logic_vector) return boolean is
  begin
    for place in value'range loop
      if value(place) /= '0' and value(place) /= '1' then
        return false;
      end if;
    end loop;
    return true;
  end function is_defined;

  procedure print(text : in string) is
    variable output_line : line;
  begin
    write(output_line, text);
    writeline(output, output_line);
  end procedure print;

  function existing(path : string) return string is
  begin
    if path = "" then
      return "/dev/null";
    end if;
    return path;
  end function existing;

  procedure write_result(file results : text; file expected : text; path : in string; row : inout line) is
    variable wanted : line;
  begin
    if path /= "" then
      assert not endfile(expected)
        report path & " has fewer lines than there are results" severity failure;
      readline(expected, wanted);
      assert row /= null and row.all = wanted.all
        report "the result differs from " & path & ": " & wanted.all severity failure;
      deallocate(wanted);
    end if;
    writeline(results, row);
  end procedure write_result;

  procedure keep_time(
    signal   clk    : in std_logic;
    signal   rst_n  : in std_logic;
    constant cycles : in positive;
    signal   tick   : out std_logic;
    signal   ms     : inout natural
  ) is
  begin
    loop
      for cycle in 1 to cycles loop
        wait until rising_edge(clk) and rst_n = '1';
        tick <= '0';
      end loop;
      tick <= '1';
      ms   <= ms + 1;
    end loop;
  end procedure keep_time;

  procedure fail_at(path : in string; line_number : in natural; what : in string) is
  begin
    print(path & ":" & integer'image(line_number) & ": " & what);
    assert false report "firm_sim_host: invalid frame file" severity failure;
  end procedure fail_at;

  -- The value of a hexadecimal digit, or -1.
  function digit_value(char : character) return integer is
  begin
    case char is
      when '0' to '9' => return character'pos(char) - character'pos('0');
      when 'a' to 'f' => return character'pos(char) - character'pos('a') + 10;
      when 'A' to 'F' => return character'pos(char) - character'pos('A') + 10;
      when others     => return -1;
    end case;
  end function digit_value;

  procedure make_room(text : inout line; used : in natural; wanted : in positive) is
    variable wider : line;
    variable size  : positive := 64;
  begin
    if text /= null then
      if wanted <= text'length then
        return;
      end if;
      size := text'length;
    end if;
    while size < wanted loop
      size := 2 * size;
    end loop;
    wider := new string(1 to size);
    if text /= null then
      wider(1 to used) := text(1 to used);
      deallocate(text);
    end if;
    text := wider;
  end procedure make_room;

  procedure append_byte(frame : inout frame_t; value : in natural; is_any : in boolean) is
  begin
    make_room(frame.bytes, frame.size, frame.size + 1);
    if is_any or frame.any_byte /= null then
      make_room(frame.any_byte, frame.size, frame.bytes'length);
    end if;
    frame.size              := frame.size + 1;
    frame.bytes(frame.size) := character'val(value);
    if is_any then
      frame.any_byte(frame.size) := '.';
    end if;
  end procedure append_byte;

  -- The number of one to nine digits from `first` to the next blank or the end; -1 for other characters.
  function parse_number(text : string; first : positive) return integer is
    variable number : natural := 0;
    variable place  : positive := first;
  begin
    while place <= text'high loop
      exit when text(place) = ' ';
      if text(place) < '0' or text(place) > '9' or place - first = 9 then
        return -1;
      end if;
      number := 10 * number + digit_value(text(place));
      place  := place + 1;
    end loop;
    if place = first then
      return -1;
    end if;
    return number;
  end function parse_number;

  -- The position after the blank that follows `first`, or after the end.
  function next_word(text : string; first : positive) return positive is
    variable place : positive := first;
  begin
    while place <= text'high loop
      place := place + 1;
      exit when text(place-1) = ' ';
    end loop;
    return place;
  end function next_word;

  -- `mark label` or `mark @n label`: a new frame without bytes at the end of the list.
  procedure start_frame(path : in string; line_number : in natural; text : in string; content : inout frame_file_t) is
    variable frame       : frame_ptr_t;
    variable label_start : positive := 3;
    variable cause       : integer  := -1;
  begin
    if text'length >= 2 then
      if text(2) /= ' ' then
        fail_at(path, line_number, "a blank is missing after the first character");
      end if;
    end if;
    if text'length >= 3 and text(1) = '<' then
      if text(3) = '@' then
        cause := parse_number(text, 4);
        if cause < 0 then
          fail_at(path, line_number, "'@' must be followed by the number of a stimulus frame");
        end if;
        label_start := next_word(text, 4);
      end if;
    end if;
    frame            := new frame_t;
    frame.label_text := new string'(text(label_start to text'high));
    frame.cause      := cause;
    if content.first = null then
      content.first := frame;
    else
      content.last.next_frame := frame;
    end if;
    content.last   := frame;
    content.frames := content.frames + 1;
  end procedure start_frame;

  procedure append_bytes(path : in string; line_number : in natural; text : in string; is_mask_legal : in boolean;
    frame : inout frame_t) is
    variable place : positive := 1;
    variable high  : integer;
    variable low   : integer;
  begin
    while place <= text'high loop
      if text(place) = ' ' or text(place) = HT then
        place := place + 1;
      elsif place = text'high then
        fail_at(path, line_number, "the line ends with half a byte");
      elsif text(place to place+1) = ".." then
        if not is_mask_legal or frame.size = 0 then
          fail_at(path, line_number, "'..' is legal only in an expected frame, after the id");
        end if;
        append_byte(frame, 0, true);
        place := place + 2;
      else
        high := digit_value(text(place));
        low  := digit_value(text(place+1));
        if high < 0 or low < 0 then
          fail_at(path, line_number, "'" & text(place to place+1) & "' is not a byte of two hexadecimal digits");
        end if;
        append_byte(frame, 16*high + low, false);
        place := place + 2;
      end if;
    end loop;
  end procedure append_bytes;

  -- `! id_error n` or `! frame_error n`.
  procedure announce_errors(path : in string; line_number : in natural; text : in string;
    content : inout frame_file_t) is
    constant ID_ERROR    : string := "! id_error ";
    constant FRAME_ERROR : string := "! frame_error ";
    variable pulses      : integer := -1;
  begin
    if text'length > ID_ERROR'length then
      if text(ID_ERROR'range) = ID_ERROR then
        pulses            := parse_number(text, ID_ERROR'length + 1);
        content.id_errors := max(pulses, 0);
      end if;
    end if;
    if text'length > FRAME_ERROR'length then
      if text(FRAME_ERROR'range) = FRAME_ERROR then
        pulses               := parse_number(text, FRAME_ERROR'length + 1);
        content.frame_errors := max(pulses, 0);
      end if;
    end if;
    if pulses < 0 then
      fail_at(path, line_number, "expected '! id_error <pulses>', '! frame_error <pulses>' or '! aborted <id> <code>'");
    end if;
  end procedure announce_errors;

  -- The number in `count` bytes of a frame from byte `first` on, the lowest byte first.
  procedure read_number(frame : inout frame_t; first, count : in positive; number : out natural) is
    variable value : natural := 0;
  begin
    for place in first+count-1 downto first loop
      value := 256*value + character'pos(frame.bytes(place));
    end loop;
    number := value;
  end procedure read_number;

  -- The last frame must contain an id.
  procedure check_id(path : in string; line_number : in natural; content : inout frame_file_t) is
  begin
    if content.last.size < content.id_bytes then
      fail_at(path, line_number, "the frame before this line is shorter than its id");
    end if;
  end procedure check_id;

  -- `! aborted id code`: the last frame has this id and is aborted.
  procedure abort_frame(path : in string; line_number : in natural; text : in string; content : inout frame_file_t) is
    constant ABORTED : string   := "! aborted ";
    constant CODE    : positive := 10;
    constant PLACE   : positive := next_word(text, ABORTED'length + 1);
    variable id      : natural;
  begin
    if content.last = null then
      fail_at(path, line_number, "'! aborted' must follow a frame");
    elsif content.last.size = 0 then
      fail_at(path, line_number, "the frame before this line has no bytes");
    end if;
    check_id(path, line_number, content);
    read_number(content.last.all, 1, content.id_bytes, id);
    if parse_number(text, ABORTED'length + 1) /= id or parse_number(text, PLACE) /= CODE then
      fail_at(path, line_number, "expected '! aborted " & integer'image(id) & " " & integer'image(CODE)
              & "', the frame's id and the code of aborted frames");
    end if;
    content.last.is_aborted := true;
  end procedure abort_frame;

  -- `! way n`: the last frame comes in the order of the frames with its id and way.
  procedure set_way(path : in string; line_number : in natural; text : in string; content : inout frame_file_t) is
    constant WAY : integer := parse_number(text, 7);
  begin
    if content.last = null then
      fail_at(path, line_number, "'! way' must follow a frame");
    elsif WAY < 1 or WAY > MOST_WAYS then
      fail_at(path, line_number, "'! way' must be followed by a number from 1 to " & integer'image(MOST_WAYS));
    end if;
    content.last.way := WAY;
  end procedure set_way;

  -- A line that starts with '!'.
  procedure read_announcement(path : in string; line_number : in natural; mark : in character; text : in string;
    content : inout frame_file_t) is
    constant ABORTED : string := "! aborted ";
    constant WAY     : string := "! way ";
  begin
    if text'length > ABORTED'length then
      if text(ABORTED'range) = ABORTED then
        abort_frame(path, line_number, text, content);
        return;
      end if;
    end if;
    if mark /= '<' then
      fail_at(path, line_number, "expected '! aborted <id> <code>'");
    end if;
    if text'length > WAY'length then
      if text(WAY'range) = WAY then
        set_way(path, line_number, text, content);
        return;
      end if;
    end if;
    announce_errors(path, line_number, text, content);
  end procedure read_announcement;

  -- The last frame is complete: check it and append it to the others with its id.
  procedure close_frame(path : in string; line_number : in natural; mark : in character;
    content : inout frame_file_t) is
    constant HEADER_BYTES : positive := content.id_bytes + LENGTH_BYTES;
    variable announced    : natural;
    variable is_masked    : boolean := false;
    variable id           : natural;
  begin
    if content.last = null then
      return;
    end if;
    if content.last.size = 0 then
      fail_at(path, line_number, "the frame before this line has no bytes");
    elsif mark = '>' then
      return;
    end if;
    check_id(path, line_number, content);
    if not content.last.is_aborted then
      if content.last.size < HEADER_BYTES then
        fail_at(path, line_number, "the frame before this line is shorter than id and length");
      end if;
      for place in HEADER_BYTES downto content.id_bytes+1 loop
        if content.last.any_byte /= null then
          is_masked := is_masked or content.last.any_byte(place) = '.';
        end if;
        if place = HEADER_BYTES and content.last.bytes(place) > character'val(127) then
          fail_at(path, line_number, "the frame before this line announces more than 2 GiB");
        end if;
      end loop;
      read_number(content.last.all, content.id_bytes+1, LENGTH_BYTES, announced);
      if not is_masked and announced /= content.last.size - HEADER_BYTES then
        fail_at(path, line_number, "the frame before this line announces " & integer'image(announced)
                & " bytes of payload but has " & integer'image(content.last.size - HEADER_BYTES));
      end if;
    end if;
    read_number(content.last.all, 1, content.id_bytes, id);
    if content.first_of_id(id) = null then
      content.first_of_id(id) := content.last;
    else
      content.last_of_id(id).next_of_id := content.last;
    end if;
    content.last_of_id(id) := content.last;
  end procedure close_frame;

  procedure read_line(path : in string; line_number : in natural; mark : in character; text : in string;
    content : inout frame_file_t) is
    alias characters : string(1 to text'length) is text;
    variable frame   : frame_ptr_t;
  begin
    if text'length = 0 then
      return;
    elsif characters(characters'high) = CR then
      read_line(path, line_number, mark, characters(1 to characters'high-1), content);
    elsif characters(1) = '#' then
      return;
    elsif characters(1) = mark then
      close_frame(path, line_number, mark, content);
      start_frame(path, line_number, characters, content);
    elsif characters(1) = '!' then
      read_announcement(path, line_number, mark, characters, content);
    elsif content.last = null then
      fail_at(path, line_number, "expected a label line, which starts with '" & mark & "'");
    else
      frame := content.last;
      append_bytes(path, line_number, characters, mark = '<', frame.all);
    end if;
  end procedure read_line;

  procedure read_frame_file(path : in string; id_bytes : in positive; mark : in character;
    content : inout frame_file_t) is
    file source          : text;
    variable status      : file_open_status;
    variable line_text   : line;
    variable line_number : natural := 0;
  begin
    content.id_bytes := id_bytes;
    file_open(status, source, path, read_mode);
    if status /= open_ok then
      fail_at(path, 1, "the file cannot be opened");
    end if;
    while not endfile(source) loop
      readline(source, line_text);
      line_number := line_number + 1;
      read_line(path, line_number, mark, line_text.all, content);
    end loop;
    file_close(source);
    deallocate(line_text);
    close_frame(path, line_number + 1, mark, content);
    if mark = '>' and content.frames = 0 then
      fail_at(path, line_number + 1, "the file contains no frames");
    end if;
  end procedure read_frame_file;

  procedure read_stimulus_file(path : in string; content : inout frame_file_t; id_bytes : in positive := 1) is
  begin
    read_frame_file(path, id_bytes, '>', content);
  end procedure read_stimulus_file;

  procedure read_expected_file(path : in string; content : inout frame_file_t; id_bytes : in positive := 1) is
  begin
    read_frame_file(path, id_bytes, '<', content);
  end procedure read_expected_file;

  procedure find_frame(content : inout frame_file_t; number : in natural; frame : out frame_ptr_t) is
    variable found : frame_ptr_t := content.first;
  begin
    for passed in 1 to number loop
      exit when found = null;
      found := found.next_frame;
    end loop;
    frame := found;
  end procedure find_frame;

  -- Whether byte `place`, counted from 1, of a frame may have a value.
  procedure check_byte(frame : inout frame_t; place : in positive; value : in byte_t; is_like : out boolean) is
  begin
    is_like := to_byte(frame.bytes(place)) = value;
    if frame.any_byte /= null then
      is_like := frame.any_byte(place) = '.' or to_byte(frame.bytes(place)) = value;
    end if;
  end procedure check_byte;

  procedure check_begin(frame : inout frame_t; kept : inout line; count : in natural; value : in byte_t;
    is_like : out boolean) is
    variable fits : boolean := not frame.is_aborted and frame.size > count;
  begin
    if fits then
      check_byte(frame, count + 1, value, fits);
    end if;
    for place in count downto 1 loop
      exit when not fits;
      check_byte(frame, place, to_byte(kept(place)), fits);
    end loop;
    is_like := fits;
  end procedure check_begin;

  -- `receiving` is the next frame with its `id` again if another one takes its place.
  procedure take_another_way(
    content   : inout frame_file_t;
    id        : in    natural;
    receiving : inout frame_ptr_t;
    kept      : inout line;
    count     : in    natural;
    value     : in    byte_t;
    is_found  : out   boolean
  ) is
    type seen_t is array (0 to MOST_WAYS) of boolean;
    variable seen   : seen_t := (others => false);
    variable frame  : frame_ptr_t := content.first_of_id(id);
    variable before : frame_ptr_t;
    variable fits   : boolean;
  begin
    is_found            := false;
    seen(receiving.way) := true;
    for looked in 1 to WAYS_LOOKED_AT loop
      exit when frame = null;
      fits := false;
      if not seen(frame.way) then
        seen(frame.way) := true;
        check_begin(frame.all, kept, count, value, fits);
      end if;
      if fits then
        if before = null then
          content.first_of_id(id) := frame.next_of_id;
        else
          before.next_of_id := frame.next_of_id;
        end if;
        receiving.next_of_id    := content.first_of_id(id);
        receiving.is_received   := false;
        content.first_of_id(id) := receiving;
        frame.is_received       := true;
        receiving               := frame;
        is_found                := true;
        return;
      end if;
      before := frame;
      frame  := frame.next_of_id;
    end loop;
  end procedure take_another_way;

  procedure compare(
    content    : inout frame_file_t;
    id         : in    natural;
    frame      : inout frame_ptr_t;
    kept       : inout line;
    count      : in    natural;
    value      : in    byte_t;
    may_change : in    boolean;
    is_right   : out   boolean
  ) is
    variable fits : boolean;
  begin
    check_byte(frame.all, count + 1, value, fits);
    if not fits and may_change and frame.way > 0 then
      take_another_way(content, id, frame, kept, count, value, fits);
    end if;
    if frame.way > 0 and is_defined(value) then
      make_room(kept, count, count + 1);
      kept(count+1) := to_character(value);
    end if;
    is_right := fits;
  end procedure compare;

end package body firm_sim_pkg;
