-- SPDX-License-Identifier: Apache-2.0
-- Sends streams of random length through the crossing, or at one clock through the resizer alone: every byte must
-- arrive once, in order, in full beats from lane 0 up, with zeros in unused lanes. The last beat of a stream must not
-- be taken from the source before the sink has it.
-- Without stalls, the slower end limits the throughput: the longest stream may take no more cycles than its beats
-- there plus SLACK.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_sim_check_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_cdc_stream_tb is
  generic (
    -- crossing or resizer
    PART        : string  := "crossing";
    S_WIDTH     : integer := 8;
    M_WIDTH     : integer := 8;
    DEPTH       : integer := 16;
    S_PERIOD_PS : integer := 10000;
    M_PERIOD_PS : integer := 10000;
    SEED        : integer := 1;
    STREAMS     : integer := 200;
    LONGEST     : integer := 300;  -- bytes
    -- The chance per cycle that an end does nothing.
    STALL_PERCENT : integer := 0;
    -- Cycles of the slower end; negative: not tested.
    SLACK : integer := -1
  );
end entity firm_cdc_stream_tb;

architecture simulation of firm_cdc_stream_tb is

  constant S_LANES : positive := S_WIDTH/8;
  constant M_LANES : positive := M_WIDTH/8;

  signal tick     : std_logic := '0';
  signal s_clk    : std_logic;
  signal m_clk    : std_logic;
  signal other    : std_logic;
  signal s_rst_n  : std_logic := '0';
  signal m_rst_n  : std_logic;
  signal finished : boolean   := false;

  signal s_tdata  : std_logic_vector(S_WIDTH-1 downto 0)   := (others => '0');
  signal s_tkeep  : std_logic_vector(S_WIDTH/8-1 downto 0) := (others => '0');
  signal s_tvalid : std_logic := '0';
  signal s_tlast  : std_logic := '0';
  signal s_tready : std_logic;
  signal m_tdata  : std_logic_vector(M_WIDTH-1 downto 0);
  signal m_tkeep  : std_logic_vector(M_WIDTH/8-1 downto 0);
  signal m_tvalid : std_logic;
  signal m_tlast  : std_logic;
  signal m_tready : std_logic := '0';

  signal sent     : natural := 0;  -- streams that the source has sent
  signal received : natural := 0;  -- streams that the sink has

  -- The first stream is the longest.
  function length_of(stream : natural) return positive is
  begin
    if stream = 0 then
      return LONGEST;
    end if;
    return 1 + (stream * 7919) mod (LONGEST / (1 + stream mod 7) + 1);
  end function length_of;

  function byte_of(stream, place : natural) return std_logic_vector is
  begin
    return std_logic_vector(to_unsigned((stream * 101 + place * 7 + place / 256) mod 256, 8));
  end function byte_of;

begin

  tick    <= not tick after S_PERIOD_PS * 500 fs when not finished else '0';
  s_clk   <= tick;
  s_rst_n <= '1' after S_PERIOD_PS * 3 ps;

  u_clock : entity firm.firm_sim_clock
    generic map (
      PERIOD_PS => M_PERIOD_PS,
      SEED      => SEED
    )
    port map (
      reference => tick,
      clk       => other
    );

  crossing : if PART = "crossing" generate

    signal seen     : std_logic;
    signal released : std_logic;

  begin

    m_clk <= other;

    u_seen : entity firm.firm_cdc_reset
      port map (
        clk          => m_clk,
        rst_n        => s_rst_n,
        synced_rst_n => seen
      );

    u_released : entity firm.firm_cdc_reset
      port map (
        clk          => s_clk,
        rst_n        => s_rst_n,
        may_end      => seen,
        synced_rst_n => released
      );

    u_reset : entity firm.firm_cdc_reset
      port map (
        clk          => m_clk,
        rst_n        => s_rst_n,
        may_end      => released,
        synced_rst_n => m_rst_n
      );

    u_stream : entity firm.firm_cdc_stream
      generic map (
        S_WIDTH => S_WIDTH,
        M_WIDTH => M_WIDTH,
        DEPTH   => DEPTH
      )
      port map (
        s_clk         => s_clk,
        s_rst_n       => released,
        s_enable      => released,
        s_idle        => open,
        s_axis_tdata  => s_tdata,
        s_axis_tkeep  => s_tkeep,
        s_axis_tvalid => s_tvalid,
        s_axis_tlast  => s_tlast,
        s_axis_tready => s_tready,
        m_clk         => m_clk,
        m_rst_n       => m_rst_n,
        m_axis_tdata  => m_tdata,
        m_axis_tkeep  => m_tkeep,
        m_axis_tvalid => m_tvalid,
        m_axis_tlast  => m_tlast,
        m_axis_tready => m_tready
      );

  end generate crossing;

  resizer : if PART = "resizer" generate

    m_clk   <= tick;
    m_rst_n <= s_rst_n;

    u_resize : entity firm.firm_axis_resize
      generic map (
        S_WIDTH => S_WIDTH,
        M_WIDTH => M_WIDTH
      )
      port map (
        clk           => s_clk,
        rst_n         => s_rst_n,
        s_axis_tdata  => s_tdata,
        s_axis_tkeep  => s_tkeep,
        s_axis_tvalid => s_tvalid,
        s_axis_tlast  => s_tlast,
        s_axis_tready => s_tready,
        m_axis_tdata  => m_tdata,
        m_axis_tkeep  => m_tkeep,
        m_axis_tvalid => m_tvalid,
        m_axis_tlast  => m_tlast,
        m_axis_tready => m_tready
      );

  end generate resizer;

  send : process
    variable random : random_t := seeded(SEED, 5);
    variable place  : natural;
  begin
    wait until s_rst_n = '1';
    for stream in 0 to STREAMS-1 loop
      place := 0;
      while place < length_of(stream) loop
        pause(s_clk, '1', random, STALL_PERCENT);
        s_tdata <= (others => '0');
        s_tkeep <= (others => '0');
        for lane in 0 to S_LANES-1 loop
          exit when place + lane = length_of(stream);
          s_tdata(8*lane+7 downto 8*lane) <= byte_of(stream, place + lane);
          s_tkeep(lane)                   <= '1';
        end loop;
        s_tvalid <= '1';
        s_tlast  <= '0';
        if place + S_LANES >= length_of(stream) then
          s_tlast <= '1';
        end if;
        wait until rising_edge(s_clk) and s_tready = '1';
        s_tvalid <= '0';
        s_tdata  <= (others => 'X');
        s_tkeep  <= (others => 'X');
        s_tlast  <= 'X';
        place    := place + S_LANES;
      end loop;
      sent <= stream + 1;
    end loop;
    wait;
  end process send;

  receive : process
    variable random   : random_t := seeded(SEED, 9);
    variable place    : natural;
    variable begun    : time;
    variable slower   : time;
    variable beats    : natural;
    variable cycles   : natural;

    variable is_waiting : boolean := false;  -- a beat was offered and not taken
    variable held_tdata : std_logic_vector(M_WIDTH-1 downto 0);
    variable held_tkeep : std_logic_vector(M_WIDTH/8-1 downto 0);
    variable held_tlast : std_logic;
  begin
    for stream in 0 to STREAMS-1 loop
      place := 0;
      while place < length_of(stream) loop
        wait until rising_edge(m_clk);
        assert m_rst_n /= '1' or m_tvalid = '0' or m_tvalid = '1'
          report "m_tvalid is undefined" severity failure;
        if is_waiting then
          assert m_tvalid = '1' and m_tdata = held_tdata and m_tkeep = held_tkeep and m_tlast = held_tlast
            report "a beat changed before it was taken" severity failure;
        end if;
        is_waiting := m_rst_n = '1' and m_tvalid = '1' and m_tready = '0';
        held_tdata := m_tdata;
        held_tkeep := m_tkeep;
        held_tlast := m_tlast;
        if m_rst_n = '1' and m_tvalid = '1' and m_tready = '1' then
          assert sent <= stream
            report "the source was rid of stream " & integer'image(stream) & " before its end" severity failure;
          if stream = 0 and place = 0 then
            begun := now;
          end if;
          for lane in 0 to M_LANES-1 loop
            if place + lane < length_of(stream) then
              assert m_tkeep(lane) = '1' and m_tdata(8*lane+7 downto 8*lane) = byte_of(stream, place + lane)
                report "byte " & integer'image(place + lane) & " of stream " & integer'image(stream) & " is wrong"
                severity failure;
            else
              assert m_tkeep(lane) = '0' and m_tdata(8*lane+7 downto 8*lane) = x"00"
                report "a lane behind stream " & integer'image(stream) & " is not zero" severity failure;
            end if;
          end loop;
          place := place + M_LANES;
          assert (m_tlast = '1') = (place >= length_of(stream))
            report "tlast of stream " & integer'image(stream) & " is wrong" severity failure;
        end if;
        draw_ready(random, STALL_PERCENT, m_tready);
      end loop;
      received <= stream + 1;
      if stream = 0 and SLACK >= 0 then
        slower := S_PERIOD_PS * 1 ps;
        beats  := (LONGEST + S_LANES - 1) / S_LANES;
        if ((LONGEST + M_LANES - 1) / M_LANES) * (M_PERIOD_PS * 1 ps) > beats * slower then
          slower := M_PERIOD_PS * 1 ps;
          beats  := (LONGEST + M_LANES - 1) / M_LANES;
        end if;
        cycles := (now - begun) / slower;
        -- The clock is off by a thousandth.
        assert cycles <= beats + beats / 500 + SLACK
          report integer'image(beats) & " beats took " & integer'image(cycles) & " cycles" severity failure;
      end if;
    end loop;
    m_tready <= '1';
    for cycle in 1 to 100 loop
      wait until rising_edge(m_clk);
      assert m_tvalid = '0' report "a beat too many" severity failure;
    end loop;
    assert sent = STREAMS report "the source is not rid of all streams" severity failure;
    report "PASS " & integer'image(STREAMS) & " streams, the first one in " & integer'image(cycles) & " cycles for "
           & integer'image(beats) & " beats";
    finished <= true;
    wait;
  end process receive;

  -- Ends the simulation after a pause longer than the slowest end needs.
  watchdog : process
    variable before : natural;
  begin
    while not finished loop
      before := received;
      wait for (S_PERIOD_PS + M_PERIOD_PS) * 400 ns / 100 + LONGEST * (S_PERIOD_PS + M_PERIOD_PS) * 5 ps;
      assert finished or received > before
        report "no stream in a long time after " & integer'image(received) severity failure;
    end loop;
    wait;
  end process watchdog;

  check_stream(s_clk, s_rst_n, s_tdata, s_tkeep, s_tvalid, s_tlast, s_tready, "in",
               (idle_ready => false, may_be_empty => false, abort => false, others => true));

  check_stream(m_clk, m_rst_n, m_tdata, m_tkeep, m_tvalid, m_tlast, m_tready, "out");

end architecture simulation;
