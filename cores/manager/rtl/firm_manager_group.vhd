-- SPDX-License-Identifier: Apache-2.0
-- The part of a Manager from a group of publishers to the host: sends the frames of the publisher that the scheduler in
-- the slot grants. If the scheduler is PREEMPTIVE, it may move the grant within frames, which leave as bursts. A
-- register slice cuts the paths from the publishers to the output.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_manager_group is
  generic (
    WIDTH      : integer := 8;
    PUBLISHERS : integer := 1;
    -- The scheduler may move the grant between any two beats of a frame.
    PREEMPTIVE : boolean := false;
    -- Cycles with `tick` after which a publisher that stops in the middle of a frame is cut off; 0: never.
    WATCHDOG : integer := 0;
    -- The watchdog's memory is cleared by `clearing` and `cleared`, which several groups share.
    SHARED_CLEARING : boolean := false
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Of the watchdog, as at firm_axis_watchdog.
    tick     : in std_logic                                           := '1';
    clearing : in std_logic                                           := '0';
    cleared  : in std_logic_vector(index_bits(PUBLISHERS)-1 downto 0) := (others => '0');

    -- From the publishers; publisher 0 has the lowest bits.
    pub_axis_tdata  : in  std_logic_vector(PUBLISHERS*WIDTH-1 downto 0);
    pub_axis_tkeep  : in  std_logic_vector(PUBLISHERS*(WIDTH/8)-1 downto 0);
    pub_axis_tuser  : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tvalid : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tlast  : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tready : out std_logic_vector(PUBLISHERS-1 downto 0);

    -- The scheduler's slot.
    sched_request      : out std_logic_vector(PUBLISHERS-1 downto 0);
    sched_beat         : out std_logic;
    sched_last         : out std_logic;
    sched_grant_valid  : in  std_logic;
    sched_grant_select : in  std_logic_vector(index_bits(PUBLISHERS)-1 downto 0);

    -- The upper byte of the granted publisher's id.
    high : in std_logic_vector(7 downto 0) := x"00";

    -- `m_axis_tid` is the lower byte of the frame's id and `m_axis_high` the upper one, on every beat.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tid    : out std_logic_vector(7 downto 0);
    m_axis_high   : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- Pulses for a publisher that the watchdog has cut off.
    expired : out std_logic_vector(PUBLISHERS-1 downto 0)
  );
end entity firm_manager_group;

architecture rtl of firm_manager_group is

  signal pub_ready : std_logic_vector(PUBLISHERS-1 downto 0);
  signal cut       : std_logic;  -- the watchdog ends the granted publisher's frame

  signal granted_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal granted_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal granted_tuser  : std_logic_vector(0 downto 0);
  signal granted_tvalid : std_logic;
  signal granted_tlast  : std_logic;
  signal granted_tready : std_logic;

  -- `sent_tuser` and `out_tuser` contain the upper byte of the id above the abort mark.
  signal sent_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal sent_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal sent_tuser  : std_logic_vector(8 downto 0);
  signal sent_tvalid : std_logic;
  signal sent_tlast  : std_logic;
  signal sent_tready : std_logic;
  signal out_tuser   : std_logic_vector(8 downto 0);

begin

  u_mux : entity firm.firm_axis_mux
    generic map (
      WIDTH   => WIDTH,
      SOURCES => PUBLISHERS
    )
    port map (
      source        => sched_grant_select,
      enable        => sched_grant_valid,
      s_axis_tdata  => pub_axis_tdata,
      s_axis_tkeep  => pub_axis_tkeep,
      s_axis_tuser  => pub_axis_tuser,
      s_axis_tvalid => pub_axis_tvalid,
      s_axis_tlast  => pub_axis_tlast,
      s_axis_tready => pub_ready,
      m_axis_tdata  => granted_tdata,
      m_axis_tkeep  => granted_tkeep,
      m_axis_tuser  => granted_tuser,
      m_axis_tvalid => granted_tvalid,
      m_axis_tlast  => granted_tlast,
      m_axis_tready => granted_tready
    );

  whole_frames : if not PREEMPTIVE and WATCHDOG <= 0 generate
    sent_tdata             <= granted_tdata;
    sent_tkeep             <= granted_tkeep;
    sent_tuser(0 downto 0) <= granted_tuser;
    sent_tvalid            <= granted_tvalid;
    sent_tlast             <= granted_tlast;
    granted_tready         <= sent_tready;
  end generate whole_frames;

  watched_frames : if not PREEMPTIVE and WATCHDOG > 0 generate
    signal expires : std_logic;
  begin
    -- The granted publisher is the only one that is ready then.
    report_publishers : process (clk)
    begin
      if rising_edge(clk) then
        expired <= pub_ready;
        if rst_n = '0' or expires = '0' then
          expired <= (others => '0');
        end if;
      end if;
    end process report_publishers;

    u_watchdog : entity firm.firm_axis_watchdog
      generic map (
        WIDTH           => WIDTH,
        SOURCES         => PUBLISHERS,
        LIMIT           => WATCHDOG,
        SHARED_CLEARING => SHARED_CLEARING
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        tick          => tick,
        clearing      => clearing,
        cleared       => cleared,
        source        => sched_grant_select,
        s_axis_tdata  => granted_tdata,
        s_axis_tkeep  => granted_tkeep,
        s_axis_tuser  => granted_tuser,
        s_axis_tvalid => granted_tvalid,
        s_axis_tlast  => granted_tlast,
        s_axis_tready => granted_tready,
        m_axis_tdata  => sent_tdata,
        m_axis_tkeep  => sent_tkeep,
        m_axis_tuser  => sent_tuser(0 downto 0),
        m_axis_tvalid => sent_tvalid,
        m_axis_tlast  => sent_tlast,
        m_axis_tready => sent_tready,
        cut           => cut,
        expires       => expires,
        expired       => open
      );
  end generate watched_frames;

  unwatched_frames : if PREEMPTIVE or WATCHDOG <= 0 generate
    cut     <= '0';
    expired <= (others => '0');
  end generate unwatched_frames;

  parts_of_frames : if PREEMPTIVE generate
    u_burst : entity firm.firm_axis_burst
      generic map (
        WIDTH   => WIDTH,
        SOURCES => PUBLISHERS
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        source        => sched_grant_select,
        s_axis_tdata  => granted_tdata,
        s_axis_tkeep  => granted_tkeep,
        s_axis_tuser  => granted_tuser,
        s_axis_tvalid => granted_tvalid,
        s_axis_tlast  => granted_tlast,
        s_axis_tready => granted_tready,
        m_axis_tdata  => sent_tdata,
        m_axis_tkeep  => sent_tkeep,
        m_axis_tuser  => sent_tuser(0 downto 0),
        m_axis_tvalid => sent_tvalid,
        m_axis_tlast  => sent_tlast,
        m_axis_tready => sent_tready
      );
  end generate parts_of_frames;

  sent_tuser(8 downto 1) <= high;

  u_slice_out : entity firm.firm_axis_register_slice
    generic map (
      WIDTH     => WIDTH,
      USER_BITS => 9
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => sent_tdata,
      s_axis_tkeep  => sent_tkeep,
      s_axis_tuser  => sent_tuser,
      s_axis_tvalid => sent_tvalid,
      s_axis_tlast  => sent_tlast,
      s_axis_tready => sent_tready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tuser  => out_tuser,
      m_axis_tid    => m_axis_tid,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

  m_axis_tuser    <= out_tuser(0 downto 0);
  m_axis_high     <= out_tuser(8 downto 1);
  pub_axis_tready <= pub_ready;

  sched_request <= pub_axis_tvalid;
  sched_beat    <= cut or (granted_tvalid and granted_tready);
  sched_last    <= cut or granted_tlast;

end architecture rtl;
