-- SPDX-License-Identifier: Apache-2.0
-- The same as firm_status_counters, beside a Manager of Managers: for each channel its frames, its faults by code, and
-- the longest wait of a beat, all in memory, with few bits of registers for each channel. Channels are the subscribers
-- by id, then the publishers by id. The entity only listens.
--
-- Frames are counted in the cycle of their last beat, those of publishers at the host's side of the Manager. Faults
-- wait in one place for each channel until they are counted, one in three cycles; a fault whose channel's place is
-- occupied is not counted, and `lost` pulses. The waits of publishers are measured in turns (firm_status_waits).
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_status_tree_counters is
  generic (
    SUBSCRIBERS : integer := 1;
    PUBLISHERS  : integer := 1;
    COUNT_BITS  : integer := 32;
    -- Of the counters of faults.
    FAULT_BITS  : integer := 16;
    WAIT_BITS   : integer := 16;
    TIME_STAMPS : boolean := false
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Counting; `is_clear` rises after reset when all counters are zero.
    enable   : in  std_logic;
    is_clear : out std_logic;

    -- Beats from the Manager to the subscribers.
    sub_offered  : in std_logic;
    sub_beat     : in std_logic;
    sub_last     : in std_logic;
    sub_selected : in std_logic_vector(index_bits(SUBSCRIBERS)-1 downto 0);

    -- Beats from the Manager to the host, and the publishers that wait in this cycle, by id.
    m_axis_tid    : in std_logic_vector(15 downto 0);
    m_axis_tvalid : in std_logic;
    m_axis_tlast  : in std_logic;
    m_axis_tready : in std_logic;
    pub_waits     : in std_logic_vector(PUBLISHERS-1 downto 0);

    -- Pulses of the converters, each with four bits of code.
    frame_error      : in std_logic_vector(SUBSCRIBERS+PUBLISHERS-1 downto 0);
    frame_error_code : in std_logic_vector(4*(SUBSCRIBERS+PUBLISHERS)-1 downto 0);

    -- The fault that was counted last, from the cycle of `fault` on.
    fault         : out std_logic;
    fault_channel : out std_logic_vector(11 downto 0);
    fault_code    : out std_logic_vector(3 downto 0);
    lost          : out std_logic;  -- a pulse if a fault's channel already has a waiting fault

    -- The counter of the time stamps; zeros without them.
    cycles : out std_logic_vector(31 downto 0);

    -- The word at an address, at most three cycles after the address: the channel, then four bits. These are a code, 13
    -- for the frames, 14 for the longest wait, or 15 for the time stamp.
    read_address : in  std_logic_vector(15 downto 0);
    read_word    : out std_logic_vector(31 downto 0)
  );
end entity firm_status_tree_counters;

architecture rtl of firm_status_tree_counters is

  constant MOST_CHANNELS : positive := 4096;
  constant CHANNELS      : positive := SUBSCRIBERS + PUBLISHERS;
  constant SUB_BITS      : positive := index_bits(SUBSCRIBERS);
  constant PUB_BITS      : positive := index_bits(PUBLISHERS);
  constant CHANNEL_BITS  : positive := index_bits(CHANNELS);
  constant LONGEST       : unsigned(WAIT_BITS-1 downto 0) := (others => '1');
  constant FRAMES        : std_logic_vector(3 downto 0) := "1101";
  constant WAITED        : std_logic_vector(3 downto 0) := "1110";
  constant STAMPED       : std_logic_vector(3 downto 0) := "1111";

  -- Beats to subscribers. At most one is addressed, so one counter measures all waits.
  signal sub_beat_r   : std_logic;
  signal sub_last_r   : std_logic;
  signal sub_index_r  : std_logic_vector(SUB_BITS-1 downto 0) := (others => '0');
  signal sub_wait_r   : unsigned(WAIT_BITS-1 downto 0);
  signal sub_waited_r : unsigned(WAIT_BITS-1 downto 0);
  signal sub_read     : std_logic_vector(SUB_BITS-1 downto 0);
  signal sub_frames   : std_logic_vector(COUNT_BITS-1 downto 0);
  signal sub_longest  : std_logic_vector(WAIT_BITS-1 downto 0);
  signal sub_clear    : std_logic;
  signal sub_stamp    : std_logic_vector(31 downto 0);

  -- Beats of publishers.
  signal pub_frame_r  : std_logic;
  signal pub_index_r  : std_logic_vector(PUB_BITS-1 downto 0) := (others => '0');
  signal pub_read     : std_logic_vector(PUB_BITS-1 downto 0);
  signal pub_frames   : std_logic_vector(COUNT_BITS-1 downto 0);
  signal pub_longest  : std_logic_vector(WAIT_BITS-1 downto 0);
  signal pub_clear    : std_logic;
  signal wait_clear   : std_logic;
  signal pub_stamp    : std_logic_vector(31 downto 0);

  -- Faults.
  signal counted      : std_logic;
  signal fault_number : std_logic_vector(CHANNEL_BITS-1 downto 0);
  signal code         : std_logic_vector(3 downto 0);
  signal fault_index  : std_logic_vector(CHANNEL_BITS+3 downto 0);
  signal fault_read   : std_logic_vector(CHANNEL_BITS+3 downto 0);
  signal faults       : std_logic_vector(FAULT_BITS-1 downto 0);
  signal fault_clear  : std_logic;

  signal channel      : unsigned(11 downto 0);
  signal word_r       : std_logic_vector(3 downto 0);
  signal is_sub_r     : std_logic;
  signal is_known_r   : std_logic;

begin

  assert SUBSCRIBERS >= 1 and PUBLISHERS >= 1 and CHANNELS <= MOST_CHANNELS
    report "firm_status_tree_counters: SUBSCRIBERS is " & integer'image(SUBSCRIBERS) & " and PUBLISHERS is " &
    integer'image(PUBLISHERS) & "; legal: 1 or more each, and at most " & integer'image(MOST_CHANNELS) & " together"
    severity failure;
  assert COUNT_BITS >= 1 and COUNT_BITS <= 32
    report "firm_status_tree_counters: COUNT_BITS is " & integer'image(COUNT_BITS) & "; legal: 1 to 32"
    severity failure;
  assert FAULT_BITS >= 1 and FAULT_BITS <= 32
    report "firm_status_tree_counters: FAULT_BITS is " & integer'image(FAULT_BITS) & "; legal: 1 to 32"
    severity failure;
  assert WAIT_BITS >= 1 and WAIT_BITS <= 32
    report "firm_status_tree_counters: WAIT_BITS is " & integer'image(WAIT_BITS) & "; legal: 1 to 32"
    severity failure;

  -- From the host.
  watch_subscribers : process (clk)
  begin
    if rising_edge(clk) then
      sub_beat_r   <= sub_beat and enable;
      sub_last_r   <= sub_last;
      sub_index_r  <= sub_selected;
      sub_waited_r <= sub_wait_r;
      if rst_n = '0' or sub_beat = '1' then
        sub_wait_r <= (others => '0');
      elsif sub_offered = '1' and sub_wait_r /= LONGEST then
        sub_wait_r <= sub_wait_r + 1;
      end if;
      if rst_n = '0' then
        sub_beat_r  <= '0';
        sub_index_r <= (others => '0');
      end if;
    end if;
  end process watch_subscribers;

  u_subscribers : entity firm.firm_status_tally
    generic map (
      INDEX_BITS   => SUB_BITS,
      COUNT_BITS   => COUNT_BITS,
      LONGEST_BITS => WAIT_BITS
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      is_clear     => sub_clear,
      op_valid     => sub_beat_r,
      op_index     => sub_index_r,
      op_count     => sub_last_r,
      op_longest   => std_logic_vector(sub_waited_r),
      read_index   => sub_read,
      read_count   => sub_frames,
      read_longest => sub_longest
    );

  -- To the host.
  watch_publishers : process (clk)
  begin
    if rising_edge(clk) then
      pub_frame_r <= m_axis_tvalid and m_axis_tready and m_axis_tlast and enable;
      pub_index_r <= m_axis_tid(PUB_BITS-1 downto 0);
      if rst_n = '0' then
        pub_frame_r <= '0';
        pub_index_r <= (others => '0');
      end if;
    end if;
  end process watch_publishers;

  u_publishers : entity firm.firm_status_tally
    generic map (
      INDEX_BITS   => PUB_BITS,
      COUNT_BITS   => COUNT_BITS,
      LONGEST_BITS => 1
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      is_clear     => pub_clear,
      op_valid     => pub_frame_r,
      op_index     => pub_index_r,
      op_count     => '1',
      op_longest   => "0",
      read_index   => pub_read,
      read_count   => pub_frames,
      read_longest => open
    );

  u_waits : entity firm.firm_status_waits
    generic map (
      SOURCES   => PUBLISHERS,
      WAIT_BITS => WAIT_BITS
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      is_clear     => wait_clear,
      enable       => enable,
      waits        => pub_waits,
      read_index   => pub_read,
      read_longest => pub_longest
    );

  -- Time stamps
  without_stamps : if not TIME_STAMPS generate
    cycles    <= (others => '0');
    sub_stamp <= (others => '0');
    pub_stamp <= (others => '0');
  end generate without_stamps;

  with_stamps : if TIME_STAMPS generate
    signal cycles_r     : unsigned(31 downto 0);
    signal is_first_r   : std_logic;  -- the next beat to a subscriber is the first one of its frame
    signal was_first_r  : std_logic;
    signal stamps_first : std_logic;
  begin
    count_cycles : process (clk)
    begin
      if rising_edge(clk) then
        cycles_r    <= cycles_r + 1;
        was_first_r <= is_first_r;
        if sub_beat = '1' then
          is_first_r <= sub_last;
        end if;
        if rst_n = '0' then
          cycles_r   <= (others => '0');
          is_first_r <= '1';
        end if;
      end if;
    end process count_cycles;

    cycles       <= std_logic_vector(cycles_r);
    stamps_first <= sub_beat_r and was_first_r;

    u_first_beats : entity firm.firm_status_stamps
      generic map (
        INDEX_BITS => SUB_BITS
      )
      port map (
        clk        => clk,
        op_valid   => stamps_first,
        op_index   => sub_index_r,
        op_stamp   => std_logic_vector(cycles_r),
        read_index => sub_read,
        read_stamp => sub_stamp
      );

    u_last_beats : entity firm.firm_status_stamps
      generic map (
        INDEX_BITS => PUB_BITS
      )
      port map (
        clk        => clk,
        op_valid   => pub_frame_r,
        op_index   => pub_index_r,
        op_stamp   => std_logic_vector(cycles_r),
        read_index => pub_read,
        read_stamp => pub_stamp
      );

  end generate with_stamps;

  u_collect : entity firm.firm_status_faults
    generic map (
      CHANNELS => CHANNELS
    )
    port map (
      clk              => clk,
      rst_n            => rst_n,
      enable           => enable,
      may_leave        => fault_clear,
      frame_error      => frame_error,
      frame_error_code => frame_error_code,
      fault            => counted,
      channel          => fault_number,
      code             => code,
      lost             => lost
    );

  fault_index <= fault_number & code;

  u_faults : entity firm.firm_status_tally
    generic map (
      INDEX_BITS   => CHANNEL_BITS + 4,
      COUNT_BITS   => FAULT_BITS,
      LONGEST_BITS => 1,
      SHARED_READ  => true
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      is_clear     => fault_clear,
      op_valid     => counted,
      op_index     => fault_index,
      op_count     => '1',
      op_longest   => "0",
      read_index   => fault_read,
      read_count   => faults,
      read_longest => open
    );

  fault         <= counted;
  fault_channel <= std_logic_vector(resize(unsigned(fault_number), 12));
  fault_code    <= code;

  -- Reading. An index that belongs to another table is meaningless, but within the range of its own.
  channel    <= unsigned(read_address(15 downto 4));
  fault_read <= std_logic_vector(resize(unsigned(read_address), CHANNEL_BITS+4));
  sub_read   <= read_address(SUB_BITS+3 downto 4);
  pub_read   <= std_logic_vector(resize(channel - SUBSCRIBERS, PUB_BITS));

  note_place : process (clk)
  begin
    if rising_edge(clk) then
      word_r     <= read_address(3 downto 0);
      is_sub_r   <= is_below(std_logic_vector(channel), SUBSCRIBERS);
      is_known_r <= is_below(std_logic_vector(channel), CHANNELS);
    end if;
  end process note_place;

  read_counter : process (clk)
  begin
    if rising_edge(clk) then
      read_word <= (others => '0');
      if is_known_r = '0' then
        null;
      elsif word_r = FRAMES and is_sub_r = '1' then
        read_word(COUNT_BITS-1 downto 0) <= sub_frames;
      elsif word_r = FRAMES then
        read_word(COUNT_BITS-1 downto 0) <= pub_frames;
      elsif word_r = WAITED and is_sub_r = '1' then
        read_word(WAIT_BITS-1 downto 0) <= sub_longest;
      elsif word_r = WAITED then
        read_word(WAIT_BITS-1 downto 0) <= pub_longest;
      elsif word_r = STAMPED and is_sub_r = '1' then
        read_word <= sub_stamp;
      elsif word_r = STAMPED then
        read_word <= pub_stamp;
      else
        read_word(FAULT_BITS-1 downto 0) <= faults;
      end if;
    end if;
  end process read_counter;

  is_clear <= sub_clear and pub_clear and wait_clear and fault_clear;

end architecture rtl;
