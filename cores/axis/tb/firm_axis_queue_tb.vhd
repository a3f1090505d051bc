-- SPDX-License-Identifier: Apache-2.0
-- Tests the queue, or with LIMIT the watchdog, with frames of random lengths and a sink that stops for random times,
-- also long ones. It writes a line of the trace per cycle, which the models in tests/cores/queue_model.py and
-- tests/cores/test_axis_sink_watchdog.py replay.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_check_pkg.all;

entity firm_axis_queue_tb is
  generic (
    WIDTH       : integer := 8;
    FRAMES      : integer := 4;
    BEATS       : integer := 8;
    DROP_NEWEST : boolean := false;
    DROP_OLDEST : boolean := false;
    -- Cycles of the watchdog; 0: the queue.
    LIMIT : integer := 0;
    -- Frames of the source, and beats of the longest.
    COUNT      : integer := 200;
    LONGEST    : integer := 10;
    TRACE_FILE : string  := "trace.txt";
    SEED       : integer := 1;
    -- The chances in each cycle that the source has no beat, that the sink is not ready, that it stops, and that a stop
    -- ends; and the chance of an error of the subscriber.
    SOURCE_PERCENT : integer := 0;
    SINK_PERCENT   : integer := 0;
    STOP_PERCENT   : integer := 0;
    GO_PERCENT     : integer := 5;
    ERROR_PERCENT  : integer := 0;
    -- The bench ends after this number of cycles without a beat.
    QUIET : integer := 400
  );
end entity firm_axis_queue_tb;

architecture simulation of firm_axis_queue_tb is

  constant LANES : positive := WIDTH/8;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal over  : boolean   := false;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(LANES-1 downto 0);
  signal in_tvalid : std_logic := '0';
  signal in_tlast  : std_logic := '0';
  signal in_tready : std_logic;

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(LANES-1 downto 0);
  signal out_tuser  : std_logic_vector(0 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic := '0';

  signal s_frame_error    : std_logic := '0';
  signal frame_error      : std_logic;
  signal frame_error_code : std_logic_vector(3 downto 0);

  -- The bytes of a beat count up from a random value.
  function word_of(number : natural) return std_logic_vector is
    variable word : std_logic_vector(WIDTH-1 downto 0);
  begin
    for lane in 0 to LANES-1 loop
      word(8*lane+7 downto 8*lane) := std_logic_vector(to_unsigned((number + lane) mod 256, 8));
    end loop;
    return word;
  end function word_of;

  function kept(number : positive) return std_logic_vector is
    variable keep : std_logic_vector(LANES-1 downto 0) := (others => '0');
  begin
    keep(number-1 downto 0) := (others => '1');
    return keep;
  end function kept;

  function lanes_of(keep : std_logic_vector) return natural is
    variable number : natural := 0;
  begin
    for lane in keep'range loop
      if keep(lane) = '1' then
        number := number + 1;
      end if;
    end loop;
    return number;
  end function lanes_of;

begin

  clk <= not clk after 5 ns when not over else clk;

  queue : if LIMIT <= 0 generate
    u_part : entity firm.firm_axis_queue
      generic map (
        WIDTH       => WIDTH,
        FRAMES      => FRAMES,
        BEATS       => BEATS,
        DROP_NEWEST => DROP_NEWEST,
        DROP_OLDEST => DROP_OLDEST
      )
      port map (
        clk                => clk,
        rst_n              => rst_n,
        s_axis_tdata       => in_tdata,
        s_axis_tkeep       => in_tkeep,
        s_axis_tvalid      => in_tvalid,
        s_axis_tlast       => in_tlast,
        s_axis_tready      => in_tready,
        m_axis_tdata       => out_tdata,
        m_axis_tkeep       => out_tkeep,
        m_axis_tuser       => out_tuser,
        m_axis_tvalid      => out_tvalid,
        m_axis_tlast       => out_tlast,
        m_axis_tready      => out_tready,
        s_frame_error      => s_frame_error,
        s_frame_error_code => "0010",
        frame_error        => frame_error,
        frame_error_code   => frame_error_code
      );
  end generate queue;

  watchdog : if LIMIT > 0 generate
    u_part : entity firm.firm_axis_sink_watchdog
      generic map (
        WIDTH => WIDTH,
        LIMIT => LIMIT
      )
      port map (
        clk                => clk,
        rst_n              => rst_n,
        s_axis_tdata       => in_tdata,
        s_axis_tkeep       => in_tkeep,
        s_axis_tvalid      => in_tvalid,
        s_axis_tlast       => in_tlast,
        s_axis_tready      => in_tready,
        m_axis_tdata       => out_tdata,
        m_axis_tkeep       => out_tkeep,
        m_axis_tuser       => out_tuser,
        m_axis_tvalid      => out_tvalid,
        m_axis_tlast       => out_tlast,
        m_axis_tready      => out_tready,
        s_frame_error      => s_frame_error,
        s_frame_error_code => "0010",
        frame_error        => frame_error,
        frame_error_code   => frame_error_code
      );
  end generate watchdog;

  drive : process
    file trace          : text open write_mode is TRACE_FILE;
    variable row        : line;
    variable sent       : natural := 0;
    variable left_beats : natural := 0;
    variable quiet_for  : natural := 0;
    variable is_stopped : boolean := false;
    variable random_1   : positive := SEED;
    variable random_2   : positive := 2;

    impure function drawn(bound : positive) return natural is
      variable draw : real;
    begin
      uniform(random_1, random_2, draw);
      return natural(floor(draw * real(bound)));
    end function drawn;

    procedure put(value : integer) is
    begin
      write(row, value);
      write(row, ' ');
    end procedure put;

    procedure put(bit : std_logic) is
    begin
      if bit = '1' then
        put(1);
      else
        put(0);
      end if;
    end procedure put;

    procedure put_beat(tvalid, tready, tlast : std_logic; tdata, tkeep : std_logic_vector) is
    begin
      put(tvalid);
      put(tready);
      if tvalid = '1' then
        put(tlast);
        put(lanes_of(tkeep));
        put(to_integer(unsigned(tdata(7 downto 0))));
        assert tdata = word_of(to_integer(unsigned(tdata(7 downto 0))))
          report "the lanes of a beat do not belong together" severity failure;
      else
        put(0);
        put(0);
        put(0);
      end if;
    end procedure put_beat;

  begin
    for cycle in 1 to 4 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    while quiet_for < QUIET loop
      wait until rising_edge(clk);
      put_beat(in_tvalid, in_tready, in_tlast, in_tdata, in_tkeep);
      put_beat(out_tvalid, out_tready, out_tlast, out_tdata, out_tkeep);
      put(s_frame_error);
      put(frame_error);
      if frame_error = '1' then
        put(to_integer(unsigned(frame_error_code)));
      else
        put(0);
      end if;
      if out_tvalid = '1' then
        put(out_tuser(0));
      else
        put(0);
      end if;
      writeline(trace, row);

      quiet_for := quiet_for + 1;
      if (in_tvalid = '1' and in_tready = '1') or (out_tvalid = '1' and out_tready = '1') then
        quiet_for := 0;
      end if;

      if in_tvalid = '0' or in_tready = '1' then
        in_tvalid <= '0';
        if (sent < COUNT or left_beats > 0) and drawn(100) >= SOURCE_PERCENT then
          if left_beats = 0 then
            sent       := sent + 1;
            left_beats := 1 + drawn(1 + drawn(LONGEST));
          end if;
          left_beats := left_beats - 1;
          in_tvalid <= '1';
          in_tdata  <= word_of(drawn(256));
          in_tlast  <= '0';
          in_tkeep  <= (others => '1');
          if left_beats = 0 then
            in_tlast <= '1';
            in_tkeep <= kept(1 + drawn(LANES));
          end if;
        end if;
      end if;

      if drawn(100) < STOP_PERCENT then
        is_stopped := true;
      elsif drawn(100) < GO_PERCENT then
        is_stopped := false;
      end if;
      out_tready <= '1';
      if is_stopped or drawn(100) < SINK_PERCENT then
        out_tready <= '0';
      end if;
      s_frame_error <= '0';
      if drawn(100) < ERROR_PERCENT then
        s_frame_error <= '1';
      end if;
    end loop;
    over <= true;
    wait;
  end process drive;

  check_stream(clk, rst_n, out_tdata, out_tkeep, out_tvalid, out_tlast, out_tready, "out");

end architecture simulation;
