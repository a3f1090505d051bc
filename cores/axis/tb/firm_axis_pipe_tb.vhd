-- SPDX-License-Identifier: Apache-2.0
-- Tests a part of streams between the simulation host's two streams. The register slice, the FIFO and the gearbox
-- forward a stream unchanged, and a source that never pauses must cause no gap at their output, whatever the sink does.
-- The gearbox is a window and a packer, which joins its bytes again: without stalls, a whole window is transferred per
-- cycle; otherwise, random numbers of bytes are. The length buffer must not pause within a frame.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sim_check_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_axis_pipe_tb is
  generic (
    -- register_slice, fifo, gearbox or length_buffer
    PART          : string  := "register_slice";
    WIDTH         : integer := 8;
    DEPTH         : integer := 16;  -- of the FIFO and the length buffer
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    SEED          : integer := 1;
    -- The host's stalls, and stalls of the sink only.
    STALL_PERCENT      : integer := 0;
    SINK_STALL_PERCENT : integer := 0;
    -- The number of beats that the part must hold while the sink takes nothing; 0: not tested.
    CAPACITY : integer := 0;
    -- Errors that a publisher reports to the length buffer at the beginning.
    PUBLISHER_ERRORS : integer := 0;
    WATCHDOG         : integer := 2000;
    QUIET            : integer := 200
  );
end entity firm_axis_pipe_tb;

architecture simulation of firm_axis_pipe_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tuser  : std_logic_vector(0 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal part_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal part_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal part_tvalid : std_logic;
  signal part_tlast  : std_logic;
  signal part_tready : std_logic;

  signal stalled_tvalid : std_logic;
  signal stalled_tready : std_logic;

  signal is_filling_r : boolean := CAPACITY > 0;
  signal has_begun_r  : boolean := false;  -- a beat has left the part
  signal is_within_r  : boolean := false;  -- the frame of the last beat has not ended

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tid    : std_logic_vector(7 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

  signal frame_error : std_logic_vector(0 downto 0);

begin

  u_host : entity firm.firm_sim_host
    generic map (
      WIDTH         => WIDTH,
      STIMULUS_FILE => STIMULUS_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      SHOWN         => 0,
      WATCHDOG      => WATCHDOG,
      QUIET         => QUIET
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => in_tdata,
      m_axis_tkeep  => in_tkeep,
      m_axis_tuser  => in_tuser,
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready,
      s_axis_tdata  => out_tdata,
      s_axis_tkeep  => out_tkeep,
      s_axis_tid    => out_tid,
      s_axis_tvalid => out_tvalid,
      s_axis_tlast  => out_tlast,
      s_axis_tready => out_tready,
      frame_error   => frame_error
    );

  slice : if PART = "register_slice" generate
    u_part : entity firm.firm_axis_register_slice
      generic map (
        WIDTH => WIDTH
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => in_tdata,
        s_axis_tkeep  => in_tkeep,
        s_axis_tvalid => in_tvalid,
        s_axis_tlast  => in_tlast,
        s_axis_tready => in_tready,
        m_axis_tdata  => part_tdata,
        m_axis_tkeep  => part_tkeep,
        m_axis_tid    => out_tid,
        m_axis_tvalid => part_tvalid,
        m_axis_tlast  => part_tlast,
        m_axis_tready => part_tready
      );
  end generate slice;

  others_than_slice : if PART /= "register_slice" generate
    u_tid : entity firm.firm_sim_tid
      generic map (
        WIDTH => WIDTH
      )
      port map (
        clk         => clk,
        rst_n       => rst_n,
        axis_tdata  => part_tdata,
        axis_tvalid => part_tvalid,
        axis_tlast  => part_tlast,
        axis_tready => part_tready,
        axis_tid    => out_tid
      );
  end generate others_than_slice;

  fifo : if PART = "fifo" generate
    u_part : entity firm.firm_axis_fifo
      generic map (
        WIDTH => WIDTH,
        DEPTH => DEPTH
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => in_tdata,
        s_axis_tkeep  => in_tkeep,
        s_axis_tvalid => in_tvalid,
        s_axis_tlast  => in_tlast,
        s_axis_tready => in_tready,
        m_axis_tdata  => part_tdata,
        m_axis_tkeep  => part_tkeep,
        m_axis_tvalid => part_tvalid,
        m_axis_tlast  => part_tlast,
        m_axis_tready => part_tready
      );
  end generate fifo;

  gearbox : if PART = "gearbox" generate
    constant LANES : positive := WIDTH/8;

    signal window    : std_logic_vector(WIDTH-1 downto 0);
    signal available : std_logic_vector(clog2(LANES+1)-1 downto 0);
    signal is_last   : std_logic;
    signal wanted_r  : natural range 0 to LANES := LANES;
    signal piece     : natural range 0 to LANES;
    signal count     : std_logic_vector(clog2(LANES+1)-1 downto 0);
    signal last      : std_logic;
    signal valid     : std_logic;
    signal ready     : std_logic;
    signal take      : std_logic;
  begin
    u_window : entity firm.firm_axis_window
      generic map (
        WIDTH => WIDTH
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => in_tdata,
        s_axis_tkeep  => in_tkeep,
        s_axis_tvalid => in_tvalid,
        s_axis_tlast  => in_tlast,
        s_axis_tready => in_tready,
        window        => window,
        available     => available,
        is_last       => is_last,
        take_valid    => take,
        take          => count,
        skip          => '0'
      );

    choose_piece : process (available, is_last, wanted_r, rst_n)
      variable offered : natural;
    begin
      valid <= '0';
      last  <= '0';
      piece <= 0;
      if rst_n = '1' then
        offered := to_integer(unsigned(available));
        piece   <= wanted_r;
        if offered >= wanted_r then
          valid <= '1';
        end if;
        if is_last = '1' and offered <= wanted_r then
          valid <= '1';
          last  <= '1';
          piece <= offered;
        end if;
      end if;
    end process choose_piece;

    count <= std_logic_vector(to_unsigned(piece, clog2(LANES+1)));
    take  <= valid and ready;

    draw_piece : process (clk)
      variable random : random_t := seeded(SEED, 7);
      variable wanted : natural;
    begin
      if rising_edge(clk) and STALL_PERCENT > 0 and take = '1' then
        draw(random, LANES, wanted);
        wanted_r <= wanted;
      end if;
    end process draw_piece;

    u_pack : entity firm.firm_axis_pack
      generic map (
        WIDTH => WIDTH
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        data          => window,
        count         => count,
        last          => last,
        valid         => valid,
        ready         => ready,
        m_axis_tdata  => part_tdata,
        m_axis_tkeep  => part_tkeep,
        m_axis_tvalid => part_tvalid,
        m_axis_tlast  => part_tlast,
        m_axis_tready => part_tready
      );
  end generate gearbox;

  length_buffer : if PART = "length_buffer" generate
    signal publisher_error : std_logic := '0';
    signal code            : std_logic_vector(3 downto 0);
  begin
    u_part : entity firm.firm_axis_length_buffer
      generic map (
        WIDTH => WIDTH,
        DEPTH => DEPTH
      )
      port map (
        clk                => clk,
        rst_n              => rst_n,
        s_axis_tdata       => in_tdata,
        s_axis_tkeep       => in_tkeep,
        s_axis_tuser       => in_tuser,
        s_axis_tvalid      => in_tvalid,
        s_axis_tlast       => in_tlast,
        s_axis_tready      => in_tready,
        m_axis_tdata       => part_tdata,
        m_axis_tkeep       => part_tkeep,
        m_axis_tvalid      => part_tvalid,
        m_axis_tlast       => part_tlast,
        m_axis_tready      => part_tready,
        s_frame_error      => publisher_error,
        s_frame_error_code => "0010",
        frame_error        => frame_error(0),
        frame_error_code   => code
      );

    publisher : process (clk)
      variable count : natural := 0;
    begin
      if rising_edge(clk) and rst_n = '1' then
        publisher_error <= '0';
        if count < PUBLISHER_ERRORS and publisher_error = '0' then
          publisher_error <= '1';
          count           := count + 1;
        end if;
        if frame_error(0) = '1' then
          report "code " & integer'image(to_integer(unsigned(code)));
        end if;
      end if;
    end process publisher;
  end generate length_buffer;

  no_errors : if PART /= "length_buffer" generate
    frame_error(0) <= '0';
  end generate no_errors;

  u_stall : entity firm.firm_sim_stall
    generic map (
      WIDTH         => WIDTH,
      SEED          => SEED,
      STALL_PERCENT => SINK_STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => part_tdata,
      s_axis_tkeep  => part_tkeep,
      s_axis_tvalid => part_tvalid,
      s_axis_tlast  => part_tlast,
      s_axis_tready => part_tready,
      m_axis_tdata  => out_tdata,
      m_axis_tkeep  => out_tkeep,
      m_axis_tvalid => stalled_tvalid,
      m_axis_tlast  => out_tlast,
      m_axis_tready => stalled_tready
    );

  out_tvalid     <= '0' when is_filling_r else stalled_tvalid;
  stalled_tready <= '0' when is_filling_r else out_tready;

  fill : process (clk)
    variable beats : natural := 0;
  begin
    if rising_edge(clk) then
      if is_filling_r and in_tvalid = '1' then
        if in_tready = '1' then
          beats := beats + 1;
        elsif beats > 0 then
          is_filling_r <= false;
          assert beats = CAPACITY
            report "the part holds " & integer'image(beats) & " beats, expected " & integer'image(CAPACITY)
            severity failure;
        end if;
      end if;
    end if;
  end process fill;

  find_gaps : process (clk)
  begin
    if rising_edge(clk) then
      if part_tvalid = '1' and part_tready = '1' then
        has_begun_r <= true;
        is_within_r <= part_tlast = '0';
      end if;
      if PART = "length_buffer" then
        assert part_tvalid = '1' or not is_within_r
          report "a gap within a frame" severity failure;
      elsif STALL_PERCENT = 0 then
        assert not (has_begun_r and in_tvalid = '1' and part_tready = '1' and part_tvalid = '0')
          report "a gap although the source never pauses" severity failure;
      end if;
    end if;
  end process find_gaps;

  check_stream(clk, rst_n, in_tdata, in_tkeep, in_tvalid, in_tlast, in_tready, "in");

  check_stream(clk, rst_n, part_tdata, part_tkeep, part_tvalid, part_tlast, part_tready, "part");

end architecture simulation;
