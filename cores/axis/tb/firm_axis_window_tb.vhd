-- SPDX-License-Identifier: Apache-2.0
-- Sends frames from a file, whose first VOID_LANES bytes are invalid, through the window to a reader that takes random
-- numbers of bytes, stalls and skips. The bytes taken go to a file, one line per frame: in hex, then `.` if the
-- frame was taken to its end, `~` if it was skipped.
-- Inputs change at the falling edge: above 8 bits, no output may change before the next rising edge.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sim_check_pkg.all;
use firm.firm_sim_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_axis_window_tb is
  generic (
    WIDTH         : integer := 8;
    VOID_LANES    : integer := 0;
    STIMULUS_FILE : string  := "stimulus.txt";
    TAKEN_FILE    : string  := "taken.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- The chances per cycle that the source offers no beat, that the reader takes nothing, that it skips.
    SOURCE_STALL_PERCENT : integer := 0;
    READER_STALL_PERCENT : integer := 0;
    SKIP_PERCENT         : integer := 0;
    -- Each cycle, the reader takes a `random` number of the available bytes, `all` of them, or `full`: a random number
    -- of a frame's first bytes, then a whole window each time until the frame's last bytes.
    TAKE     : string  := "random";
    WATCHDOG : integer := 1000
  );
end entity firm_axis_window_tb;

architecture simulation of firm_axis_window_tb is

  constant LANES      : positive := WIDTH/8;
  constant COUNT_BITS : positive := clog2(LANES+1);

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';

  signal tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal tkeep  : std_logic_vector(LANES-1 downto 0);
  signal tvalid : std_logic := '0';
  signal tlast  : std_logic;
  signal tready : std_logic;

  signal window     : std_logic_vector(WIDTH-1 downto 0);
  signal available  : std_logic_vector(COUNT_BITS-1 downto 0);
  signal is_last    : std_logic;
  signal shown      : std_logic;
  signal ends       : std_logic;
  signal take_valid : std_logic := '0';
  signal take_count : std_logic_vector(COUNT_BITS-1 downto 0);
  signal skip       : std_logic := '0';

  signal frames      : natural := 0;  -- in the file
  signal frames_sent : natural := 0;
  signal all_sent    : boolean := false;
  signal is_done     : boolean := false;

begin

  clk <= not clk after 5 ns when not is_done else '0';

  u_window : entity firm.firm_axis_window
    generic map (
      WIDTH      => WIDTH,
      VOID_LANES => VOID_LANES
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => tdata,
      s_axis_tkeep  => tkeep,
      s_axis_tvalid => tvalid,
      s_axis_tlast  => tlast,
      s_axis_tready => tready,
      window        => window,
      available     => available,
      is_last       => is_last,
      is_broken     => open,
      shown         => shown,
      ends          => ends,
      take_valid    => take_valid,
      take          => take_count,
      skip          => skip
    );

  send : process
    variable content  : frame_file_t;
    variable frame    : frame_ptr_t;
    variable place    : natural;  -- of the next byte
    variable beats    : natural := 0;
    variable waits    : natural := 0;
    variable random   : random_t := seeded(SEED, 3);
  begin
    read_stimulus_file(STIMULUS_FILE, content);
    end_reset(clk, '0', rst_n);
    frames <= content.frames;
    frame  := content.first;
    while frame /= null loop
      place := 0;
      while place < frame.size loop
        pause(clk, '0', random, SOURCE_STALL_PERCENT);
        tdata  <= (others => 'X');
        tkeep  <= (others => '0');
        tvalid <= '1';
        for lane in 0 to LANES-1 loop
          exit when place >= frame.size;
          tkeep(lane) <= '1';
          if place >= VOID_LANES then
            tdata(8*lane+7 downto 8*lane) <= to_byte(frame.bytes(place+1));
          end if;
          place := place + 1;
        end loop;
        tlast <= '0';
        if place >= frame.size then
          tlast <= '1';
        end if;
        loop
          wait until rising_edge(clk);
          exit when tready = '1';
          if beats > 0 then
            waits := waits + 1;
          end if;
        end loop;
        beats := beats + 1;
        wait until falling_edge(clk);
        tvalid <= '0';
        tdata  <= (others => 'X');
        tkeep  <= (others => 'X');
        tlast  <= 'X';
      end loop;
      frames_sent <= frames_sent + 1;
      frame := frame.next_frame;
    end loop;
    all_sent <= true;
    print(integer'image(beats) & " beats, " & integer'image(waits) & " waits");
    wait;
  end process send;

  read : process
    file lines        : text open write_mode is TAKEN_FILE;
    file wanted_file  : text open read_mode is existing(EXPECTED_FILE);
    variable taken    : line;
    variable finished : natural := 0;
    variable is_open  : boolean := false;  -- bytes of the frame were taken
    variable may_skip : boolean := true;   -- the last skip is complete
    variable offered  : natural;
    variable wanted   : natural;
    variable at_least : natural := 0;  -- the bytes that must still be available
    variable idle     : natural := 0;
    variable idle_max : natural := 0;  -- between frames, though the next has been sent
    variable watch    : natural := 0;
    variable random   : random_t := seeded(SEED, 5);

    impure function chance(percent : natural) return boolean is
      variable happens : boolean;
    begin
      draw_chance(random, percent, happens);
      return happens;
    end function chance;

    impure function draw_to(highest : natural) return natural is
      variable number : natural;
    begin
      draw(random, highest, number);
      return number;
    end function draw_to;

    procedure finish_frame(mark : in character) is
    begin
      assert finished < frames report "more frames than were sent" severity failure;
      write(taken, mark);
      write_result(lines, wanted_file, EXPECTED_FILE, taken);
      finished := finished + 1;
      is_open  := false;
      at_least := 0;
      idle     := 0;
      watch    := 0;
    end procedure finish_frame;

  begin
    wait until rst_n = '1';
    while not (all_sent and finished = frames) loop
      wait until falling_edge(clk);
      wait for 1 ns;
      take_valid <= '0';
      take_count <= (others => 'X');
      skip       <= '0';
      assert is_defined(available) and is_defined(is_last & tready) report "an output is undefined" severity failure;
      offered := to_integer(unsigned(available));
      assert offered <= LANES and offered >= at_least report "the window lost bytes" severity failure;
      watch := watch + 1;
      assert watch < WATCHDOG report "nothing comes" severity failure;
      if offered = 0 and is_last = '0' and not is_open and finished > 0 and finished < frames_sent then
        idle := idle + 1;
        idle_max := max(idle, idle_max);
      end if;
      at_least := offered;
      may_skip := may_skip or offered > 0 or is_last = '1';
      if may_skip and finished < frames and SKIP_PERCENT > 0 and chance(SKIP_PERCENT) then
        may_skip := false;
        skip       <= '1';
        take_valid <= '1';  -- has no effect
        take_count <= available;
        finish_frame('~');
      elsif not chance(READER_STALL_PERCENT) then
        wanted := offered;
        if TAKE = "random" then
          wanted := draw_to(offered);
        elsif TAKE = "full" and not is_open and offered > 0 then
          wanted := 1 + draw_to(offered-1);
        elsif TAKE = "full" and offered < LANES and is_last = '0' then
          wanted := 0;
        end if;
        take_valid <= '1';
        take_count <= std_logic_vector(to_unsigned(wanted, COUNT_BITS));
        for lane in 0 to wanted-1 loop
          write(taken, to_hex(window(8*lane+7 downto 8*lane)));
        end loop;
        at_least := offered - wanted;
        is_open  := is_open or wanted > 0;
        if wanted > 0 then
          watch := 0;
        end if;
        if is_last = '1' and wanted = offered then
          finish_frame('.');
        end if;
      end if;
    end loop;
    print(integer'image(idle_max) & " cycles idle between frames");
    assert endfile(wanted_file) report "results are missing" severity failure;
    print("PASS");
    is_done <= true;
    wait;
  end process read;

  check_shown : process
  begin
    wait until falling_edge(clk);
    wait for 3 ns;
    if take_valid = '1' and skip = '0' then
      assert is_defined(shown & "") and (shown = '0' or is_defined(ends & ""))
        report "an output is undefined" severity failure;
      assert shown = '0' or unsigned(take_count) <= unsigned(available) report "it shows too much" severity failure;
      assert shown = '0' or unsigned(available) = 0 or (ends = '1') = (is_last = '1' and take_count = available)
        report "the frame ends elsewhere" severity failure;
    end if;
  end process check_shown;

  -- Sampled before the inputs change, and again before the clock rises.
  find_paths : process
    variable outputs : std_logic_vector(WIDTH+COUNT_BITS+1 downto 0);
  begin
    wait until falling_edge(clk);
    outputs := window & available & is_last & tready;
    wait for 4 ns;
    assert WIDTH = 8 or rst_n = '0' or outputs = window & available & is_last & tready
      report "a combinational path from an input to an output" severity failure;
  end process find_paths;

  check_stream(clk, rst_n, tdata, tkeep, tvalid, tlast, tready, "in",
               (known => VOID_LANES = 0, may_be_empty => false, abort => false, others => true));

end architecture simulation;
