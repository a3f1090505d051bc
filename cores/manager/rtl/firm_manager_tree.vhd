-- SPDX-License-Identifier: Apache-2.0
-- A Manager of Managers, with ids of two bytes on the host's side: up to 65,536 subscribers and publishers. The
-- converters are those of firm_manager, with ids of one byte, the lower one; the upper byte is removed and inserted
-- here. Publishers form groups. In each group, a scheduler grants one publisher, and a register slice ends the paths;
-- a further scheduler chooses among the groups. Frames are sent whole (docs/reference/manager.md). With a WATCHDOG,
-- each group cuts off a publisher that stops in the middle of a frame; the groups share the timer.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_manager_tree is
  generic (
    WIDTH       : integer := 8;
    SUBSCRIBERS : integer := 1;
    PUBLISHERS  : integer := 2;
    -- For each group: the number of its publishers, the lowest places first, and its policy.
    SIZES    : times_t    := (1, 1);
    POLICIES : policies_t := (ROUND_ROBIN, ROUND_ROBIN);
    -- The policy among the groups.
    TOP_POLICY : policy_t := ROUND_ROBIN;
    -- The upper byte of the id of the publisher at each place; IMPLICIT if place and id are equal.
    HIGHS : times_t := IMPLICIT;
    -- Cycles without a beat after which the frame of a publisher that stops in the middle of it is aborted, rounded up
    -- to an even number, at least 2; or up to half as many more, since the groups share a timer. 0: never.
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
    m_axis_tid    : out std_logic_vector(15 downto 0);
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

    -- The same beats, for a listener: offered, accepted, and the subscriber's number.
    sub_offered  : out std_logic;
    sub_beat     : out std_logic;
    sub_selected : out std_logic_vector(index_bits(SUBSCRIBERS)-1 downto 0);

    -- From the publishers, group by group; the first place has the lowest bits.
    pub_axis_tdata  : in  std_logic_vector(PUBLISHERS*WIDTH-1 downto 0);
    pub_axis_tkeep  : in  std_logic_vector(PUBLISHERS*(WIDTH/8)-1 downto 0);
    pub_axis_tuser  : in  std_logic_vector(PUBLISHERS-1 downto 0) := (others => '0');
    pub_axis_tvalid : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tlast  : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tready : out std_logic_vector(PUBLISHERS-1 downto 0);

    -- Pulses for a frame from the host that reaches no subscriber.
    id_error : out std_logic;
    -- Pulses for a publisher that a watchdog has cut off, by place.
    expired : out std_logic_vector(PUBLISHERS-1 downto 0)
  );
end entity firm_manager_tree;

architecture rtl of firm_manager_tree is

  constant MOST_PUBLISHERS : positive := 65536;
  constant GROUPS          : positive := max(1, SIZES'length);
  constant LANES           : positive := WIDTH/8;
  -- A publisher is cut off at the third pulse in a row without a beat, so after two periods to three.
  constant TICKS  : positive := 3;
  constant PERIOD : positive := max(1, (WATCHDOG + TICKS - 2) / (TICKS - 1));

  function sends_whole_frames(policy : policy_t) return boolean is
  begin
    return policy = FIXED_PRIORITY or policy = ROUND_ROBIN or policy = LRU;
  end function sends_whole_frames;

  function ticks_to_abort return natural is
  begin
    if WATCHDOG > 0 then
      return TICKS;
    end if;
    return 0;
  end function ticks_to_abort;

  function high_of(place : natural) return natural is
  begin
    if HIGHS'length = PUBLISHERS then
      return time_of(place, HIGHS);
    end if;
    return place / 256;
  end function high_of;

  function found_fault return string is
  begin
    if PUBLISHERS < 1 or PUBLISHERS > MOST_PUBLISHERS then
      return "PUBLISHERS is " & integer'image(PUBLISHERS) & "; legal: 1 to " & integer'image(MOST_PUBLISHERS);
    elsif SUBSCRIBERS < 1 or SUBSCRIBERS > MOST_PUBLISHERS then
      return "SUBSCRIBERS is " & integer'image(SUBSCRIBERS) & "; legal: 1 to " & integer'image(MOST_PUBLISHERS);
    elsif WATCHDOG < 0 then
      return "WATCHDOG is " & integer'image(WATCHDOG) & "; legal: 0 or more";
    elsif SIZES'length > MAX_REQUESTERS then
      return "SIZES has " & integer'image(SIZES'length) & " groups; legal: 1 to " & integer'image(MAX_REQUESTERS);
    elsif fault_of_groups(PUBLISHERS, SIZES, POLICIES, TOP_POLICY) /= "" then
      return fault_of_groups(PUBLISHERS, SIZES, POLICIES, TOP_POLICY);
    elsif not sends_whole_frames(TOP_POLICY) then
      return "TOP_POLICY is " & policy_t'image(TOP_POLICY) & "; legal: a policy that is not preemptive";
    elsif HIGHS'length /= 1 and HIGHS'length /= PUBLISHERS then
      return "HIGHS has " & integer'image(HIGHS'length) & " bytes; legal: one for each publisher";
    end if;
    for place in POLICIES'range loop
      if not sends_whole_frames(POLICIES(place)) then
        return "the policy of a group is " & policy_t'image(POLICIES(place)) &
          "; legal: a policy that is not preemptive";
      end if;
    end loop;
    return "";
  end function found_fault;

  -- An index of the largest group.
  function largest_index return positive is
    variable bits : positive := 1;
  begin
    for place in SIZES'range loop
      bits := max(bits, index_bits(SIZES(place)));
    end loop;
    return bits;
  end function largest_index;

  constant CLEAR_BITS : positive := largest_index;

  constant FAULT    : string  := found_fault;
  constant IS_LEGAL : boolean := FAULT = "";

  -- From the host: frames with ids of two bytes, then of one.
  signal routed_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal routed_tkeep  : std_logic_vector(LANES-1 downto 0);
  signal routed_tuser  : std_logic_vector(0 downto 0);
  signal routed_tvalid : std_logic;
  signal routed_tlast  : std_logic;
  signal routed_tready : std_logic;
  signal narrow_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal narrow_tkeep  : std_logic_vector(LANES-1 downto 0);
  signal narrow_tuser  : std_logic_vector(0 downto 0);
  signal narrow_tvalid : std_logic;
  signal narrow_tlast  : std_logic;
  signal narrow_tready : std_logic;
  signal high          : std_logic_vector(7 downto 0);
  signal has_high      : std_logic;

  -- The timer of the watchdogs, and the clearing of their memories after reset.
  signal tick     : std_logic;
  signal clearing : std_logic;
  signal cleared  : std_logic_vector(CLEAR_BITS-1 downto 0);

  -- From the groups; `group_high` contains the upper bytes of the ids.
  signal group_tdata  : std_logic_vector(GROUPS*WIDTH-1 downto 0);
  signal group_tkeep  : std_logic_vector(GROUPS*LANES-1 downto 0);
  signal group_tuser  : std_logic_vector(GROUPS-1 downto 0);
  signal group_high   : std_logic_vector(GROUPS*8-1 downto 0);
  signal group_tvalid : std_logic_vector(GROUPS-1 downto 0);
  signal group_tlast  : std_logic_vector(GROUPS-1 downto 0);
  signal group_tready : std_logic_vector(GROUPS-1 downto 0);

  -- The granted group.
  signal top_valid      : std_logic;
  signal top_select     : std_logic_vector(index_bits(GROUPS)-1 downto 0);
  signal top_beat       : std_logic;
  signal granted_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal granted_tkeep  : std_logic_vector(LANES-1 downto 0);
  signal granted_tuser  : std_logic_vector(0 downto 0);
  signal granted_high   : std_logic_vector(7 downto 0);
  signal granted_tvalid : std_logic;
  signal granted_tlast  : std_logic;
  signal granted_tready : std_logic;

  -- With ids of two bytes; `tuser` contains the upper byte above the abort mark.
  signal sent_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal sent_tkeep  : std_logic_vector(LANES-1 downto 0);
  signal sent_tuser  : std_logic_vector(8 downto 0);
  signal sent_tvalid : std_logic;
  signal sent_tlast  : std_logic;
  signal sent_tready : std_logic;
  signal out_tuser   : std_logic_vector(8 downto 0);

begin

  assert FAULT = ""
    report "firm_manager_tree: " & FAULT
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

  u_id_remove : entity firm.firm_axis_id_remove
    generic map (
      WIDTH => WIDTH
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
      high          => high,
      has_high      => has_high,
      m_axis_tdata  => narrow_tdata,
      m_axis_tkeep  => narrow_tkeep,
      m_axis_tuser  => narrow_tuser,
      m_axis_tvalid => narrow_tvalid,
      m_axis_tlast  => narrow_tlast,
      m_axis_tready => narrow_tready
    );

  u_demux : entity firm.firm_axis_demux
    generic map (
      WIDTH        => WIDTH,
      DESTINATIONS => SUBSCRIBERS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      high          => high,
      has_high      => has_high,
      s_axis_tdata  => narrow_tdata,
      s_axis_tkeep  => narrow_tkeep,
      s_axis_tuser  => narrow_tuser,
      s_axis_tvalid => narrow_tvalid,
      s_axis_tlast  => narrow_tlast,
      s_axis_tready => narrow_tready,
      m_axis_tdata  => sub_axis_tdata,
      m_axis_tkeep  => sub_axis_tkeep,
      m_axis_tuser  => sub_axis_tuser,
      m_axis_tlast  => sub_axis_tlast,
      m_axis_tvalid => sub_axis_tvalid,
      m_axis_tready => sub_axis_tready,
      offered       => sub_offered,
      beat          => sub_beat,
      selected      => sub_selected,
      id_error      => id_error
    );

  watched_frames : if WATCHDOG > 0 generate
    signal counted_r : natural range 0 to max(1, PERIOD-1);
    signal cleared_r : unsigned(CLEAR_BITS downto 0);  -- the highest bit: not all are cleared
  begin
    tick     <= '1' when counted_r = PERIOD-1 else '0';
    clearing <= cleared_r(CLEAR_BITS);
    cleared  <= std_logic_vector(cleared_r(CLEAR_BITS-1 downto 0));

    count_cycles : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' or tick = '1' then
          counted_r <= 0;
        else
          counted_r <= counted_r + 1;
        end if;
      end if;
    end process count_cycles;

    clear_memories : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          cleared_r <= to_unsigned(2**CLEAR_BITS, CLEAR_BITS+1);
        elsif clearing = '1' then
          cleared_r <= cleared_r + 1;
        end if;
      end if;
    end process clear_memories;
  end generate watched_frames;

  unwatched_frames : if WATCHDOG <= 0 generate
    tick     <= '0';
    clearing <= '0';
    cleared  <= (others => '0');
  end generate unwatched_frames;

  -- Ranges that do not fit would end the elaboration before an assert can report them.
  each_group : for group_index in 0 to GROUPS-1 generate
    legal : if IS_LEGAL generate
      constant SIZE  : positive := time_of(group_index, SIZES);
      constant FIRST : natural  := sum_of(SIZES, group_index);

      -- Constants: synthesis keeps only the bits in which the publishers of the group differ.
      function highs_of_group return std_logic_vector is
        variable result : std_logic_vector(SIZE*8-1 downto 0);
      begin
        for place in 0 to SIZE-1 loop
          result(place*8+7 downto place*8) := std_logic_vector(to_unsigned(high_of(FIRST+place), 8));
        end loop;
        return result;
      end function highs_of_group;

      signal request      : std_logic_vector(SIZE-1 downto 0);
      signal grant_valid  : std_logic;
      signal grant_select : std_logic_vector(index_bits(SIZE)-1 downto 0);
      signal beat         : std_logic;
      signal last         : std_logic;
      signal group_highs  : std_logic_vector(SIZE*8-1 downto 0);
      signal member_high  : std_logic_vector(7 downto 0);
    begin
      u_scheduler : entity firm.firm_sched_by_policy
        generic map (
          POLICY     => POLICIES(POLICIES'low+group_index),
          REQUESTERS => SIZE
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

      group_highs <= highs_of_group;

      u_group_high : entity firm.firm_axis_select
        generic map (
          WORDS => SIZE,
          WIDTH => 8
        )
        port map (
          words_in => group_highs,
          index    => grant_select,
          word     => member_high
        );

      u_group : entity firm.firm_manager_group
        generic map (
          WIDTH           => WIDTH,
          PUBLISHERS      => SIZE,
          WATCHDOG        => ticks_to_abort,
          SHARED_CLEARING => true
        )
        port map (
          clk                => clk,
          rst_n              => rst_n,
          tick               => tick,
          clearing           => clearing,
          cleared            => cleared(index_bits(SIZE)-1 downto 0),
          pub_axis_tdata     => pub_axis_tdata((FIRST+SIZE)*WIDTH-1 downto FIRST*WIDTH),
          pub_axis_tkeep     => pub_axis_tkeep((FIRST+SIZE)*LANES-1 downto FIRST*LANES),
          pub_axis_tuser     => pub_axis_tuser(FIRST+SIZE-1 downto FIRST),
          pub_axis_tvalid    => pub_axis_tvalid(FIRST+SIZE-1 downto FIRST),
          pub_axis_tlast     => pub_axis_tlast(FIRST+SIZE-1 downto FIRST),
          pub_axis_tready    => pub_axis_tready(FIRST+SIZE-1 downto FIRST),
          sched_request      => request,
          sched_beat         => beat,
          sched_last         => last,
          sched_grant_valid  => grant_valid,
          sched_grant_select => grant_select,
          high               => member_high,
          m_axis_tdata       => group_tdata((group_index+1)*WIDTH-1 downto group_index*WIDTH),
          m_axis_tkeep       => group_tkeep((group_index+1)*LANES-1 downto group_index*LANES),
          m_axis_tuser       => group_tuser(group_index downto group_index),
          m_axis_tid         => open,
          m_axis_high        => group_high((group_index+1)*8-1 downto group_index*8),
          m_axis_tvalid      => group_tvalid(group_index),
          m_axis_tlast       => group_tlast(group_index),
          m_axis_tready      => group_tready(group_index),
          expired            => expired(FIRST+SIZE-1 downto FIRST)
        );
    end generate legal;
  end generate each_group;

  among_groups : if IS_LEGAL generate
    u_top : entity firm.firm_sched_by_policy
      generic map (
        POLICY     => TOP_POLICY,
        REQUESTERS => GROUPS
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        request      => group_tvalid,
        beat         => top_beat,
        last         => sent_tlast,
        grant_valid  => top_valid,
        grant_select => top_select
      );
  end generate among_groups;

  u_mux : entity firm.firm_axis_mux
    generic map (
      WIDTH   => WIDTH,
      SOURCES => GROUPS
    )
    port map (
      source        => top_select,
      enable        => top_valid,
      s_axis_tdata  => group_tdata,
      s_axis_tkeep  => group_tkeep,
      s_axis_tuser  => group_tuser,
      s_axis_tvalid => group_tvalid,
      s_axis_tlast  => group_tlast,
      s_axis_tready => group_tready,
      m_axis_tdata  => granted_tdata,
      m_axis_tkeep  => granted_tkeep,
      m_axis_tuser  => granted_tuser,
      m_axis_tvalid => granted_tvalid,
      m_axis_tlast  => granted_tlast,
      m_axis_tready => granted_tready
    );

  u_high : entity firm.firm_axis_select
    generic map (
      WORDS => GROUPS,
      WIDTH => 8
    )
    port map (
      words_in => group_high,
      index    => top_select,
      word     => granted_high
    );

  -- Beats are counted after the insertion, since it may split the first beat, and the grant must not move then.
  top_beat <= sent_tvalid and sent_tready;

  u_id_insert : entity firm.firm_axis_id_insert
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      high          => granted_high,
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

  sent_tuser(8 downto 1) <= granted_high;

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
      m_axis_tid    => m_axis_tid(7 downto 0),
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

  m_axis_tuser            <= out_tuser(0 downto 0);
  m_axis_tid(15 downto 8) <= out_tuser(8 downto 1);

end architecture rtl;
