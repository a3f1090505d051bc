-- SPDX-License-Identifier: Apache-2.0
-- The tables of the status's counters: for each channel its frames, its faults by code, the longest wait of a beat,
-- and a time stamp. Channels are the subscribers by id, then the publishers by id.
--
-- With TIME_STAMPS, a counter runs freely. Each channel has the value of this counter one cycle after an event: the
-- first beat of a subscriber's newest frame, or the last beat of a publisher's newest frame. The difference of both is
-- the time that a message took, in cycles modulo 2**32.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_status_tables is
  generic (
    SUBSCRIBERS : integer := 1;
    PUBLISHERS  : integer := 1;
    COUNT_BITS  : integer := 32;
    -- Of the counters of faults.
    FAULT_BITS  : integer := 32;
    WAIT_BITS   : integer := 16;
    TIME_STAMPS : boolean := false;
    -- The waits of publishers are stored here; otherwise, they are read through `waits_read`.
    STORES_WAITS : boolean := true;
    -- As at firm_status_tally, for the faults.
    SHARED_READ : boolean := false
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Rise after reset, when all counters are zero, and those of faults.
    is_clear    : out std_logic;
    fault_clear : out std_logic;

    -- Beats to subscribers: offered, accepted, and a last one.
    sub_offered : in std_logic;
    sub_beat    : in std_logic;
    sub_last    : in std_logic;
    -- In the cycle after an accepted beat: it counts, for this subscriber.
    sub_valid : in std_logic;
    sub_index : in std_logic_vector(index_bits(SUBSCRIBERS)-1 downto 0);

    -- A beat of a publisher counts, is a last one, and has waited so long.
    pub_valid  : in std_logic;
    pub_index  : in std_logic_vector(index_bits(PUBLISHERS)-1 downto 0);
    pub_last   : in std_logic;
    pub_waited : in std_logic_vector(WAIT_BITS-1 downto 0) := (others => '0');

    -- Without STORES_WAITS: the longest wait of a publisher, in the cycle after the index.
    waits_index : out std_logic_vector(index_bits(PUBLISHERS)-1 downto 0);
    waits_read  : in  std_logic_vector(WAIT_BITS-1 downto 0) := (others => '0');

    -- A fault counts.
    fault         : in std_logic;
    fault_channel : in std_logic_vector(index_bits(SUBSCRIBERS+PUBLISHERS)-1 downto 0);
    fault_code    : in std_logic_vector(3 downto 0);

    -- The counter of the time stamps; zeros without them.
    cycles : out std_logic_vector(31 downto 0);

    -- The word at an address, two cycles later, or at most three with SHARED_READ: the channel, then four bits. These
    -- are a code, 13 for the frames, 14 for the longest wait, or 15 for the time stamp.
    read_address : in  std_logic_vector(15 downto 0);
    read_word    : out std_logic_vector(31 downto 0)
  );
end entity firm_status_tables;

architecture rtl of firm_status_tables is

  constant CHANNELS     : positive := SUBSCRIBERS + PUBLISHERS;
  constant SUB_BITS     : positive := index_bits(SUBSCRIBERS);
  constant PUB_BITS     : positive := index_bits(PUBLISHERS);
  constant CHANNEL_BITS : positive := index_bits(CHANNELS);
  constant LONGEST      : unsigned(WAIT_BITS-1 downto 0) := (others => '1');
  constant FRAMES       : std_logic_vector(3 downto 0) := "1101";
  constant WAITED       : std_logic_vector(3 downto 0) := "1110";
  constant STAMPED      : std_logic_vector(3 downto 0) := "1111";

  -- A word of the publishers' tally has at least one bit of waits.
  function stored_wait_bits return positive is
  begin
    if STORES_WAITS then
      return WAIT_BITS;
    end if;
    return 1;
  end function stored_wait_bits;

  constant STORED_BITS : positive := stored_wait_bits;

  -- At most one subscriber is addressed, so one counter measures all waits.
  signal sub_last_r   : std_logic;
  signal sub_wait_r   : unsigned(WAIT_BITS-1 downto 0);
  signal sub_waited_r : unsigned(WAIT_BITS-1 downto 0);
  signal sub_read     : std_logic_vector(SUB_BITS-1 downto 0);
  signal sub_frames   : std_logic_vector(COUNT_BITS-1 downto 0);
  signal sub_longest  : std_logic_vector(WAIT_BITS-1 downto 0);
  signal sub_clear    : std_logic;
  signal sub_stamp    : std_logic_vector(31 downto 0);

  signal pub_read    : std_logic_vector(PUB_BITS-1 downto 0);
  signal pub_frames  : std_logic_vector(COUNT_BITS-1 downto 0);
  signal pub_stored  : std_logic_vector(STORED_BITS-1 downto 0);
  signal pub_longest : std_logic_vector(WAIT_BITS-1 downto 0);
  signal pub_clear   : std_logic;
  signal pub_stamp   : std_logic_vector(31 downto 0);

  signal fault_index  : std_logic_vector(CHANNEL_BITS+3 downto 0);
  signal fault_read   : std_logic_vector(CHANNEL_BITS+3 downto 0);
  signal faults       : std_logic_vector(FAULT_BITS-1 downto 0);
  signal faults_clear : std_logic;

  signal channel    : unsigned(11 downto 0);
  signal word_r     : std_logic_vector(3 downto 0);
  signal is_sub_r   : std_logic;
  signal is_known_r : std_logic;

begin

  assert COUNT_BITS >= 1 and COUNT_BITS <= 32
    report "firm_status_tables: COUNT_BITS is " & integer'image(COUNT_BITS) & "; legal: 1 to 32"
    severity failure;
  assert FAULT_BITS >= 1 and FAULT_BITS <= 32
    report "firm_status_tables: FAULT_BITS is " & integer'image(FAULT_BITS) & "; legal: 1 to 32"
    severity failure;
  assert WAIT_BITS >= 1 and WAIT_BITS <= 32
    report "firm_status_tables: WAIT_BITS is " & integer'image(WAIT_BITS) & "; legal: 1 to 32"
    severity failure;

  watch_subscribers : process (clk)
  begin
    if rising_edge(clk) then
      sub_last_r   <= sub_last;
      sub_waited_r <= sub_wait_r;
      if rst_n = '0' or sub_beat = '1' then
        sub_wait_r <= (others => '0');
      elsif sub_offered = '1' and sub_wait_r /= LONGEST then
        sub_wait_r <= sub_wait_r + 1;
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
      op_valid     => sub_valid,
      op_index     => sub_index,
      op_count     => sub_last_r,
      op_longest   => std_logic_vector(sub_waited_r),
      read_index   => sub_read,
      read_count   => sub_frames,
      read_longest => sub_longest
    );

  u_publishers : entity firm.firm_status_tally
    generic map (
      INDEX_BITS   => PUB_BITS,
      COUNT_BITS   => COUNT_BITS,
      LONGEST_BITS => STORED_BITS
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      is_clear     => pub_clear,
      op_valid     => pub_valid,
      op_index     => pub_index,
      op_count     => pub_last,
      op_longest   => pub_waited(STORED_BITS-1 downto 0),
      read_index   => pub_read,
      read_count   => pub_frames,
      read_longest => pub_stored
    );

  stored_waits : if STORES_WAITS generate
    pub_longest <= pub_stored;
  end generate stored_waits;

  external_waits : if not STORES_WAITS generate
    pub_longest <= waits_read;
  end generate external_waits;

  waits_index <= pub_read;

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
    signal stamps_last  : std_logic;
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
    stamps_first <= sub_valid and was_first_r;
    stamps_last  <= pub_valid and pub_last;

    u_first_beats : entity firm.firm_status_stamps
      generic map (
        INDEX_BITS => SUB_BITS
      )
      port map (
        clk        => clk,
        op_valid   => stamps_first,
        op_index   => sub_index,
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
        op_valid   => stamps_last,
        op_index   => pub_index,
        op_stamp   => std_logic_vector(cycles_r),
        read_index => pub_read,
        read_stamp => pub_stamp
      );

  end generate with_stamps;

  fault_index <= fault_channel & fault_code;

  u_faults : entity firm.firm_status_tally
    generic map (
      INDEX_BITS   => CHANNEL_BITS + 4,
      COUNT_BITS   => FAULT_BITS,
      LONGEST_BITS => 1,
      SHARED_READ  => SHARED_READ
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      is_clear     => faults_clear,
      op_valid     => fault,
      op_index     => fault_index,
      op_count     => '1',
      op_longest   => "0",
      read_index   => fault_read,
      read_count   => faults,
      read_longest => open
    );

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

  is_clear    <= sub_clear and pub_clear and faults_clear;
  fault_clear <= faults_clear;

end architecture rtl;
