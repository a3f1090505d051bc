-- SPDX-License-Identifier: Apache-2.0
-- Tests a part that forwards a stream unchanged, between the simulation host's two streams. A source that never pauses
-- must cause no gap at the output, whatever the sink does.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_axis_pipe_tb is
  generic (
    -- register_slice or fifo
    PART          : string  := "register_slice";
    WIDTH         : integer := 8;
    DEPTH         : integer := 16;  -- of the FIFO
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    SEED          : integer := 1;
    -- The host's stalls, and stalls of the sink only.
    STALL_PERCENT      : integer := 0;
    SINK_STALL_PERCENT : integer := 0;
    -- The number of beats that the part must hold while the sink takes nothing; 0: not tested.
    CAPACITY      : integer := 0;
    WATCHDOG      : integer := 1000;
    QUIET         : integer := 100
  );
end entity firm_axis_pipe_tb;

architecture simulation of firm_axis_pipe_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
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

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tid    : std_logic_vector(7 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

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
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready,
      s_axis_tdata  => out_tdata,
      s_axis_tkeep  => out_tkeep,
      s_axis_tid    => out_tid,
      s_axis_tvalid => out_tvalid,
      s_axis_tlast  => out_tlast,
      s_axis_tready => out_tready
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

  fifo : if PART = "fifo" generate

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
    if rising_edge(clk) and STALL_PERCENT = 0 then
      if part_tvalid = '1' and part_tready = '1' then
        has_begun_r <= true;
      end if;
      assert not (has_begun_r and in_tvalid = '1' and part_tready = '1' and part_tvalid = '0')
        report "a gap although the source never pauses" severity failure;
    end if;
  end process find_gaps;

  u_check_in : entity firm.firm_axis_checker
    generic map (
      WIDTH => WIDTH,
      NAME  => "in",
      LEVEL => failure
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => in_tdata,
      axis_tkeep  => in_tkeep,
      axis_tvalid => in_tvalid,
      axis_tlast  => in_tlast,
      axis_tready => in_tready
    );

  u_check_part : entity firm.firm_axis_checker
    generic map (
      WIDTH => WIDTH,
      NAME  => "part",
      LEVEL => failure
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => part_tdata,
      axis_tkeep  => part_tkeep,
      axis_tvalid => part_tvalid,
      axis_tlast  => part_tlast,
      axis_tready => part_tready
    );

end architecture simulation;
