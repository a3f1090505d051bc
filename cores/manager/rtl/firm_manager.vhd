-- SPDX-License-Identifier: Apache-2.0
-- Connects the host's two streams to the converters. From host to subscribers, it removes the id of a frame and routes
-- the frame. From publishers to host, it sends the frames of the publisher that the scheduler in the slot grants.
-- Register slices on the host's sides cut every path between the host and the converters.
-- If the scheduler is PREEMPTIVE, it may move the grant within frames, and the host receives bursts
-- (docs/reference/manager.md).
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_manager is
  generic (
    WIDTH       : integer := 8;
    SUBSCRIBERS : integer := 1;
    PUBLISHERS  : integer := 1;
    -- The scheduler may move the grant between any two beats of a frame.
    PREEMPTIVE : boolean := false;
    -- Cycles after which a publisher that stops in the middle of a frame is cut off; 0: never. A PREEMPTIVE scheduler
    -- serves other publishers meanwhile, and needs no watchdog.
    WATCHDOG : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- From the host. In all streams of frames, `tuser(0)` on the last beat marks an aborted frame.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- To the host; `tid` is the id of the frame on every beat.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tid    : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- To the subscribers: data for all, one bit each to select one.
    sub_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    sub_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    sub_axis_tuser  : out std_logic_vector(0 downto 0);
    sub_axis_tlast  : out std_logic;
    sub_axis_tvalid : out std_logic_vector(SUBSCRIBERS-1 downto 0);
    sub_axis_tready : in  std_logic_vector(SUBSCRIBERS-1 downto 0);

    -- From the publishers; publisher 0 has the lowest bits.
    pub_axis_tdata  : in  std_logic_vector(PUBLISHERS*WIDTH-1 downto 0);
    pub_axis_tkeep  : in  std_logic_vector(PUBLISHERS*(WIDTH/8)-1 downto 0);
    pub_axis_tuser  : in  std_logic_vector(PUBLISHERS-1 downto 0) := (others => '0');
    pub_axis_tvalid : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tlast  : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tready : out std_logic_vector(PUBLISHERS-1 downto 0);

    -- The scheduler's slot.
    sched_request      : out std_logic_vector(PUBLISHERS-1 downto 0);
    sched_beat         : out std_logic;
    sched_last         : out std_logic;
    sched_grant_valid  : in  std_logic;
    sched_grant_select : in  std_logic_vector(index_bits(PUBLISHERS)-1 downto 0);

    -- Pulses for a frame from the host that reaches no subscriber.
    id_error : out std_logic;
    -- Pulses for a publisher that the watchdog has cut off.
    expired : out std_logic_vector(PUBLISHERS-1 downto 0)
  );
end entity firm_manager;

architecture rtl of firm_manager is

  signal routed_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal routed_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal routed_tuser  : std_logic_vector(0 downto 0);
  signal routed_tvalid : std_logic;
  signal routed_tlast  : std_logic;
  signal routed_tready : std_logic;

  signal out_tid : std_logic_vector(7 downto 0);

begin

  assert SUBSCRIBERS >= 1 and SUBSCRIBERS <= 256
    report "firm_manager: SUBSCRIBERS is " & integer'image(SUBSCRIBERS) & "; legal: 1 to 256"
    severity failure;
  assert PUBLISHERS >= 1 and PUBLISHERS <= 256
    report "firm_manager: PUBLISHERS is " & integer'image(PUBLISHERS) & "; legal: 1 to 256"
    severity failure;

  assert WATCHDOG >= 0
    report "firm_manager: WATCHDOG is " & integer'image(WATCHDOG) & "; legal: 0 or more"
    severity failure;

  u_slice_in : entity firm.firm_axis_register_slice
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tkeep  => s_axis_tkeep,
      s_axis_tuser  => s_axis_tuser,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      m_axis_tdata  => routed_tdata,
      m_axis_tkeep  => routed_tkeep,
      m_axis_tuser  => routed_tuser,
      m_axis_tid    => open,
      m_axis_tvalid => routed_tvalid,
      m_axis_tlast  => routed_tlast,
      m_axis_tready => routed_tready
    );

  u_demux : entity firm.firm_axis_demux
    generic map (
      WIDTH        => WIDTH,
      DESTINATIONS => SUBSCRIBERS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => routed_tdata,
      s_axis_tkeep  => routed_tkeep,
      s_axis_tuser  => routed_tuser,
      s_axis_tvalid => routed_tvalid,
      s_axis_tlast  => routed_tlast,
      s_axis_tready => routed_tready,
      m_axis_tdata  => sub_axis_tdata,
      m_axis_tkeep  => sub_axis_tkeep,
      m_axis_tuser  => sub_axis_tuser,
      m_axis_tlast  => sub_axis_tlast,
      m_axis_tvalid => sub_axis_tvalid,
      m_axis_tready => sub_axis_tready,
      id_error      => id_error
    );

  u_group : entity firm.firm_manager_group
    generic map (
      WIDTH      => WIDTH,
      PUBLISHERS => PUBLISHERS,
      PREEMPTIVE => PREEMPTIVE,
      WATCHDOG   => WATCHDOG
    )
    port map (
      clk                => clk,
      rst_n              => rst_n,
      pub_axis_tdata     => pub_axis_tdata,
      pub_axis_tkeep     => pub_axis_tkeep,
      pub_axis_tuser     => pub_axis_tuser,
      pub_axis_tvalid    => pub_axis_tvalid,
      pub_axis_tlast     => pub_axis_tlast,
      pub_axis_tready    => pub_axis_tready,
      sched_request      => sched_request,
      sched_beat         => sched_beat,
      sched_last         => sched_last,
      sched_grant_valid  => sched_grant_valid,
      sched_grant_select => sched_grant_select,
      m_axis_tdata       => m_axis_tdata,
      m_axis_tkeep       => m_axis_tkeep,
      m_axis_tuser       => m_axis_tuser,
      m_axis_tid         => out_tid,
      m_axis_high        => open,
      m_axis_tvalid      => m_axis_tvalid,
      m_axis_tlast       => m_axis_tlast,
      m_axis_tready      => m_axis_tready,
      expired            => expired
    );

  -- Ids of publishers have at most this number of bits.
  name_publisher : for place in 0 to 7 generate
    of_index : if place < index_bits(PUBLISHERS) generate
      m_axis_tid(place) <= out_tid(place);
    end generate of_index;
    above : if place >= index_bits(PUBLISHERS) generate
      m_axis_tid(place) <= '0';
    end generate above;
  end generate name_publisher;

end architecture rtl;
