-- SPDX-License-Identifier: Apache-2.0
-- Tests the Manager's path to the host with a grant that moves at random, even within frames and to publishers without
-- a request; or, for comparison, with a scheduler. The frames of each publisher derive from its index and the frame's
-- number, so the test that reads TRACE_FILE can predict them. TRACE_FILE has one line per burst: `tid`, a blank and
-- the bytes in hex. The last printed line has the beats taken from the publishers, the beats at the host, and the
-- cycles from the first of the former to the last of the latter.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sim_check_pkg.all;
use firm.firm_sim_pkg.all;

entity firm_manager_burst_tb is
  generic (
    WIDTH      : integer := 8;
    PUBLISHERS : integer := 2;
    PREEMPTIVE : boolean := true;
    -- The fixed-priority scheduler instead of the random grant.
    SCHEDULED  : boolean := false;
    -- Frames of each publisher; of frame f of publisher p the payload has (17*p + 29*f) mod (LONGEST+1) bytes.
    FRAMES     : positive := 10;
    LONGEST    : natural  := 100;
    -- Publisher 0 stops forever after its first beat.
    STOPPED       : boolean  := false;
    TRACE_FILE    : string   := "bursts.txt";
    EXPECTED_FILE : string   := "";
    SEED          : positive := 1;
    -- The chances per cycle that the grant moves; that it moves to any publisher, even without a beat; that a publisher
    -- pauses after a beat; that the host stalls.
    MOVE_PERCENT  : natural := 30;
    IDLE_PERCENT  : natural := 0;
    PAUSE_PERCENT : natural := 0;
    STALL_PERCENT : natural := 0;
    -- Cycles without a beat at the host after which the bench gives up.
    WATCHDOG : natural := 20000
  );
end entity firm_manager_burst_tb;

architecture simulation of firm_manager_burst_tb is

  constant LANES        : positive := WIDTH/8;
  constant HEADER_BYTES : positive := 5;

  function speaking_publishers return natural is
  begin
    if STOPPED then
      return PUBLISHERS - 1;
    end if;
    return PUBLISHERS;
  end function speaking_publishers;

  constant SPEAKING : natural := speaking_publishers;

  type index_list_t is array (0 to PUBLISHERS-1) of natural;
  type flag_list_t is array (0 to PUBLISHERS-1) of boolean;

  signal clk      : std_logic := '0';
  signal rst_n    : std_logic := '0';
  signal finished : boolean := false;

  signal pub_tdata  : std_logic_vector(PUBLISHERS*WIDTH-1 downto 0)   := (others => '0');
  signal pub_tkeep  : std_logic_vector(PUBLISHERS*LANES-1 downto 0)   := (others => '0');
  signal pub_tvalid : std_logic_vector(PUBLISHERS-1 downto 0)         := (others => '0');
  signal pub_tlast  : std_logic_vector(PUBLISHERS-1 downto 0)         := (others => '0');
  signal pub_tready : std_logic_vector(PUBLISHERS-1 downto 0);

  signal request      : std_logic_vector(PUBLISHERS-1 downto 0);
  signal beat         : std_logic;
  signal last         : std_logic;
  signal grant_valid  : std_logic;
  signal grant_select : std_logic_vector(index_bits(PUBLISHERS)-1 downto 0);

  signal drawn_valid  : std_logic := '0';
  signal drawn_select : std_logic_vector(index_bits(PUBLISHERS)-1 downto 0) := (others => '0');

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(LANES-1 downto 0);
  signal out_tid    : std_logic_vector(7 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic := '0';

  signal cycle           : natural := 0;
  signal beats_in        : natural := 0;
  signal first_cycle     : natural := 0;
  signal frames_sent     : natural := 0;

  function payload_bytes(publisher, frame : natural) return natural is
  begin
    return (17*publisher + 29*frame) mod (LONGEST+1);
  end function payload_bytes;

  function byte_of(publisher, frame, place : natural) return natural is
    constant LENGTH : natural := payload_bytes(publisher, frame);
  begin
    if place = 0 then
      return publisher;
    elsif place < HEADER_BYTES then
      if place = 1 then
        return LENGTH mod 256;
      elsif place = 2 then
        return LENGTH / 256;
      end if;
      return 0;
    end if;
    return (publisher + 31*frame + 7*(place-HEADER_BYTES)) mod 256;
  end function byte_of;

begin

  clk   <= not clk after 5 ns when not finished else '0';
  rst_n <= '0', '1' after 42 ns;

  u_manager : entity firm.firm_manager
    generic map (
      WIDTH       => WIDTH,
      SUBSCRIBERS => 1,
      PUBLISHERS  => PUBLISHERS,
      PREEMPTIVE  => PREEMPTIVE
    )
    port map (
      clk                => clk,
      rst_n              => rst_n,
      s_axis_tdata       => (WIDTH-1 downto 0 => '0'),
      s_axis_tkeep       => (LANES-1 downto 0 => '0'),
      s_axis_tvalid      => '0',
      s_axis_tlast       => '0',
      s_axis_tready      => open,
      m_axis_tdata       => out_tdata,
      m_axis_tkeep       => out_tkeep,
      m_axis_tid         => out_tid,
      m_axis_tvalid      => out_tvalid,
      m_axis_tlast       => out_tlast,
      m_axis_tready      => out_tready,
      sub_axis_tdata     => open,
      sub_axis_tkeep     => open,
      sub_axis_tlast     => open,
      sub_axis_tvalid    => open,
      sub_axis_tready    => "1",
      pub_axis_tdata     => pub_tdata,
      pub_axis_tkeep     => pub_tkeep,
      pub_axis_tvalid    => pub_tvalid,
      pub_axis_tlast     => pub_tlast,
      pub_axis_tready    => pub_tready,
      sched_request      => request,
      sched_beat         => beat,
      sched_last         => last,
      sched_grant_valid  => grant_valid,
      sched_grant_select => grant_select,
      id_error           => open
    );

  drawn : if not SCHEDULED generate
    grant_valid  <= drawn_valid;
    grant_select <= drawn_select;
  end generate drawn;

  scheduler : if SCHEDULED generate
    u_scheduler : entity firm.firm_sched_fixed_priority
      generic map (
        REQUESTERS => PUBLISHERS
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        request      => request,
        beat         => beat,
        last         => last,
        grant_valid  => grant_valid,
        grant_select => grant_select
      );
  end generate scheduler;

  play : process (clk)
    variable random_1 : positive := SEED;
    variable random_2 : positive := 2;
    variable frame    : index_list_t := (others => 0);
    variable place    : index_list_t := (others => 0);
    variable waiting  : flag_list_t  := (others => true);  -- a beat is offered
    variable granted  : natural range 0 to PUBLISHERS-1 := 0;

    impure function chance(percent : natural) return boolean is
      variable draw : real;
    begin
      if percent = 0 then
        return false;
      end if;
      uniform(random_1, random_2, draw);
      return 100.0 * draw < real(percent);
    end function chance;

    impure function any_publisher return natural is
      variable draw : real;
    begin
      uniform(random_1, random_2, draw);
      return integer(floor(draw * real(PUBLISHERS))) mod PUBLISHERS;
    end function any_publisher;

    -- The next publisher from `first` on that offers a beat, or `first`.
    impure function next_waiting(first : natural) return natural is
    begin
      for distance in 0 to PUBLISHERS-1 loop
        if waiting((first+distance) mod PUBLISHERS) then
          return (first+distance) mod PUBLISHERS;
        end if;
      end loop;
      return first;
    end function next_waiting;

    procedure offer(publisher : natural) is
      constant LENGTH : natural := HEADER_BYTES + payload_bytes(publisher, frame(publisher));
    begin
      for lane in 0 to LANES-1 loop
        if place(publisher) + lane < LENGTH then
          pub_tdata(publisher*WIDTH+8*lane+7 downto publisher*WIDTH+8*lane) <=
            std_logic_vector(to_unsigned(byte_of(publisher, frame(publisher), place(publisher)+lane), 8));
          pub_tkeep(publisher*LANES+lane) <= '1';
        else
          pub_tkeep(publisher*LANES+lane) <= '0';
        end if;
      end loop;
      pub_tlast(publisher)  <= '0';
      if place(publisher) + LANES >= LENGTH then
        pub_tlast(publisher) <= '1';
      end if;
      pub_tvalid(publisher) <= '1';
      waiting(publisher)    := true;
    end procedure offer;

    procedure advance(publisher : natural) is
    begin
      place(publisher) := place(publisher) + LANES;
      if place(publisher) >= HEADER_BYTES + payload_bytes(publisher, frame(publisher)) then
        place(publisher) := 0;
        frame(publisher) := frame(publisher) + 1;
        frames_sent      <= frames_sent + 1;
      end if;
      pub_tvalid(publisher) <= '0';
      waiting(publisher)    := false;
    end procedure advance;

    procedure check_handshake is
      variable taken : natural := 0;
      variable ended : std_logic := '0';
    begin
      assert request = pub_tvalid report "a request is not its publisher's tvalid" severity failure;
      for publisher in 0 to PUBLISHERS-1 loop
        if pub_tvalid(publisher) = '1' and pub_tready(publisher) = '1' then
          taken := taken + 1;
          ended := pub_tlast(publisher);
          assert publisher = granted and grant_valid = '1'
            report "a beat was taken of another publisher than the granted one" severity failure;
        end if;
      end loop;
      assert (taken = 1) = (beat = '1') report "beat does not tell what is taken" severity failure;
      assert taken = 0 or ended = last report "last is not the beat's tlast" severity failure;
    end procedure check_handshake;

  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        for publisher in 0 to PUBLISHERS-1 loop
          offer(publisher);
        end loop;
      else
        if SCHEDULED then
          granted := to_integer(unsigned(grant_select));
        end if;
        check_handshake;
        if beat = '1' then
          if beats_in = 0 then
            first_cycle <= cycle;
          end if;
          beats_in <= beats_in + 1;
          advance(granted);
        end if;
        for publisher in 0 to PUBLISHERS-1 loop
          if not waiting(publisher) and frame(publisher) < FRAMES and not (STOPPED and publisher = 0) then
            if not chance(PAUSE_PERCENT) then
              offer(publisher);
            end if;
          end if;
        end loop;
        drawn_valid <= '1';
        if chance(IDLE_PERCENT) then
          granted := any_publisher;
        elsif chance(MOVE_PERCENT) and (PREEMPTIVE or place(granted) = 0) then
          granted := next_waiting(any_publisher);
        elsif place(granted) = 0 and not waiting(granted) then
          granted := next_waiting(granted);
        end if;
        drawn_select <= std_logic_vector(to_unsigned(granted, index_bits(PUBLISHERS)));
      end if;
    end if;
  end process play;

  -- The host: takes beats, writes bursts, checks the rules of the stream.
  take : process (clk)
    file trace           : text open write_mode is TRACE_FILE;
    file wanted_file     : text open read_mode is existing(EXPECTED_FILE);
    variable random_1    : positive := SEED;
    variable random_2    : positive := 3;
    variable draw        : real;
    variable text_line   : line;
    variable begun       : boolean := false;
    variable beats_out   : natural := 0;
    variable idle_cycles : natural := 0;
    variable kept        : natural;
    variable is_shown    : boolean := false;  -- the beat was offered in the previous cycle and not taken
    variable old_tdata   : std_logic_vector(WIDTH-1 downto 0);
    variable old_rest    : std_logic_vector(LANES+8 downto 0);
  begin
    if rising_edge(clk) then
      cycle <= cycle + 1;
      if rst_n = '1' then
        assert not is_shown
          or (out_tvalid = '1' and old_tdata = out_tdata and old_rest = out_tkeep & out_tid & out_tlast)
          report "a beat was withdrawn or changed" severity failure;
        is_shown    := out_tvalid = '1' and out_tready = '0';
        old_tdata   := out_tdata;
        old_rest    := out_tkeep & out_tid & out_tlast;
        idle_cycles := idle_cycles + 1;
        if out_tvalid = '1' and out_tready = '1' then
          idle_cycles := 0;
          beats_out   := beats_out + 1;
          if not begun then
            write(text_line, to_hex(out_tid) & " ");
          end if;
          kept := 0;
          for lane in 0 to LANES-1 loop
            if out_tkeep(lane) = '1' then
              assert kept = lane report "tkeep has a gap" severity failure;
              kept := kept + 1;
              write(text_line, to_hex(out_tdata(8*lane+7 downto 8*lane)));
            end if;
          end loop;
          assert kept = LANES or (kept > 0 and out_tlast = '1') report "a beat is not full" severity failure;
          begun := out_tlast = '0';
          if not begun then
            write_result(trace, wanted_file, EXPECTED_FILE, text_line);
          end if;
        end if;
        if frames_sent = FRAMES * SPEAKING and idle_cycles = 20 then
          print(integer'image(beats_in) & " " & integer'image(beats_out) & " "
                & integer'image(cycle - idle_cycles - first_cycle + 1));
          assert endfile(wanted_file) report "bursts are missing" severity failure;
          finished <= true;
        end if;
        assert idle_cycles < WATCHDOG report "nothing comes any more" severity failure;
        uniform(random_1, random_2, draw);
        out_tready <= '1';
        if 100.0 * draw < real(STALL_PERCENT) then
          out_tready <= '0';
        end if;
      end if;
    end if;
  end process take;

  check_stream(clk, rst_n, out_tdata, out_tkeep, out_tvalid, out_tlast, out_tready, "out");

end architecture simulation;
