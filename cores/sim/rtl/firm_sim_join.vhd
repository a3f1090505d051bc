-- SPDX-License-Identifier: Apache-2.0
-- Replaces the host's software behind a Manager with a preemptive scheduler: joins the bursts of each publisher to
-- frames and forwards these in one piece each, in the order of their completion. Its memory is unbounded, and it is
-- ready when the entity after it is. An aborted frame stays one. An illegal burst ends the simulation. Simulation only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_sim_join is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Bursts; `tid` is the publisher's id.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tid    : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- Frames.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tid    : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_sim_join;

architecture simulation of firm_sim_join is

  constant LANES        : positive := WIDTH/8;
  constant HEADER_BYTES : positive := 5;

  type beat_t;
  type beat_ptr_t is access beat_t;
  type beat_t is record
    tdata     : std_logic_vector(WIDTH-1 downto 0);
    tkeep     : std_logic_vector(WIDTH/8-1 downto 0);
    tuser     : std_logic_vector(0 downto 0);
    tid       : std_logic_vector(7 downto 0);
    tlast     : std_logic;
    next_beat : beat_ptr_t;
  end record beat_t;

  type queue_t is record
    first : beat_ptr_t;  -- null if there is none
    last  : beat_ptr_t;
  end record queue_t;

  -- The incomplete frame of a publisher.
  type frame_t is record
    beats  : queue_t;
    bytes  : natural;
    header : unsigned(8*HEADER_BYTES-1 downto 0);  -- id in the lowest byte, then the length
  end record frame_t;
  type frames_t is array (0 to 255) of frame_t;

  signal valid_r : std_logic := '0';

begin

  assert is_stream_width(WIDTH)
    report "firm_sim_join: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  join : process (clk)

    variable frames   : frames_t;
    variable whole    : queue_t;           -- beats of complete frames
    variable is_first : boolean := true;   -- the next beat is the first of a burst

    -- Append all of `tail` to `queue`.
    procedure append(queue : inout queue_t; tail : inout queue_t) is
    begin
      if queue.first = null then
        queue.first := tail.first;
      else
        queue.last.next_beat := tail.first;
      end if;
      queue.last := tail.last;
      tail       := (null, null);
    end procedure append;

    procedure fault(id : in natural; what : in string) is
    begin
      report "burst of id " & integer'image(id) & " " & what severity failure;
    end procedure fault;

    -- Count the beat's bytes for the frame; those of the header are stored.
    procedure count_bytes(frame : inout frame_t) is
    begin
      for lane in 0 to LANES-1 loop
        exit when s_axis_tkeep(lane) /= '1';
        if frame.bytes < HEADER_BYTES then
          frame.header(8*frame.bytes+7 downto 8*frame.bytes) := unsigned(s_axis_tdata(8*lane+7 downto 8*lane));
        end if;
        frame.bytes := frame.bytes + 1;
      end loop;
    end procedure count_bytes;

    impure function is_whole(id : natural) return boolean is
    begin
      if frames(id).bytes < HEADER_BYTES then
        return false;
      end if;
      return frames(id).bytes - HEADER_BYTES >= to_integer(frames(id).header(8*HEADER_BYTES-1 downto 8));
    end function is_whole;

    procedure pass_on(id : in natural) is
    begin
      frames(id).beats.last.tlast := '1';
      append(whole, frames(id).beats);
      frames(id).bytes := 0;
    end procedure pass_on;

    procedure take_beat is
      constant ID   : natural := to_integer(unsigned(s_axis_tid));
      variable beat : queue_t;
    begin
      if is_first and s_axis_tdata(7 downto 0) /= s_axis_tid then
        fault(ID, "begins with another id");
      end if;
      if is_first and frames(ID).bytes > 0 then
        -- The first beat of a resumed burst carries only the id.
        if s_axis_tlast = '1' then
          fault(ID, "resumes a frame without a beat of it");
        end if;
      else
        beat.first := new beat_t'(s_axis_tdata, s_axis_tkeep, s_axis_tuser, s_axis_tid, '0', null);
        beat.last  := beat.first;
        append(frames(ID).beats, beat);
        count_bytes(frames(ID));
        if s_axis_tlast = '1' and s_axis_tuser = "1" then
          pass_on(ID);
        elsif is_whole(ID) then
          if s_axis_tlast /= '1' then
            fault(ID, "continues after its frame");
          end if;
          pass_on(ID);
        end if;
      end if;
      is_first := s_axis_tlast = '1';
    end procedure take_beat;

    procedure show_beat is
      variable shown : beat_ptr_t;
    begin
      valid_r <= '0';
      if whole.first /= null then
        valid_r      <= '1';
        m_axis_tdata <= whole.first.tdata;
        m_axis_tkeep <= whole.first.tkeep;
        m_axis_tuser <= whole.first.tuser;
        m_axis_tid   <= whole.first.tid;
        m_axis_tlast <= whole.first.tlast;
        shown        := whole.first;
        whole.first  := shown.next_beat;
        deallocate(shown);
      end if;
    end procedure show_beat;

    -- What a reset of the system interrupts never becomes whole.
    procedure forget_all is
    begin
      valid_r  <= '0';
      whole    := (null, null);
      is_first := true;
      for id in frames'range loop
        frames(id).beats := (null, null);
        frames(id).bytes := 0;
      end loop;
    end procedure forget_all;

  begin
    if rising_edge(clk) then
      if rst_n /= '1' then
        forget_all;
      else
        if s_axis_tvalid = '1' and m_axis_tready = '1' then
          take_beat;
        end if;
        if valid_r = '0' or m_axis_tready = '1' then
          show_beat;
        end if;
      end if;
    end if;
  end process join;

  s_axis_tready <= m_axis_tready;
  m_axis_tvalid <= valid_r;

end architecture simulation;
