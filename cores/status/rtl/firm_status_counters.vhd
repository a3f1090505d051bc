-- SPDX-License-Identifier: Apache-2.0
-- Counts the traffic between the Manager and the converters: for each channel its frames, its faults by code, and the
-- longest wait of a beat. Channels are the subscribers by id, then the publishers by id. The entity only listens.
--
-- Frames are counted in the cycle of their last beat, at any rate. Faults wait in one place for each channel until they
-- are counted, one in a cycle; a fault whose channel's place is occupied is not counted, and `lost` pulses.
-- firm_status_tables tells about TIME_STAMPS.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_status_counters is
  generic (
    SUBSCRIBERS : integer := 1;
    PUBLISHERS  : integer := 1;
    COUNT_BITS  : integer := 32;
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
    sub_axis_tvalid : in std_logic_vector(SUBSCRIBERS-1 downto 0);
    sub_axis_tready : in std_logic_vector(SUBSCRIBERS-1 downto 0);
    sub_axis_tlast  : in std_logic;

    -- Beats from the publishers to the Manager, as the scheduler sees them.
    pub_axis_tvalid : in std_logic_vector(PUBLISHERS-1 downto 0);
    sched_beat      : in std_logic;
    sched_last      : in std_logic;
    sched_select    : in std_logic_vector(index_bits(PUBLISHERS)-1 downto 0);

    -- Pulses of the converters, each with four bits of code.
    frame_error      : in std_logic_vector(SUBSCRIBERS+PUBLISHERS-1 downto 0);
    frame_error_code : in std_logic_vector(4*(SUBSCRIBERS+PUBLISHERS)-1 downto 0);

    -- The fault that was counted last, from the cycle of `fault` on.
    fault         : out std_logic;
    fault_channel : out std_logic_vector(11 downto 0);
    fault_code    : out std_logic_vector(3 downto 0);
    lost          : out std_logic;

    -- The counter of the time stamps; zeros without them.
    cycles : out std_logic_vector(31 downto 0);

    -- The word at an address, two cycles later: the channel, then four bits. These are a code, 13 for the frames, 14
    -- for the longest wait, or 15 for the time stamp.
    read_address : in  std_logic_vector(12 downto 0);
    read_word    : out std_logic_vector(31 downto 0)
  );
end entity firm_status_counters;

architecture rtl of firm_status_counters is

  constant CHANNELS      : positive := SUBSCRIBERS + PUBLISHERS;
  constant SUB_BITS      : positive := index_bits(SUBSCRIBERS);
  constant PUB_BITS      : positive := index_bits(PUBLISHERS);
  constant CHANNEL_BITS  : positive := index_bits(CHANNELS);
  constant LONGEST       : unsigned(WAIT_BITS-1 downto 0) := (others => '1');
  constant NO_CHANNEL    : std_logic_vector(CHANNELS-1 downto 0) := (others => '0');
  constant NO_SUBSCRIBER : std_logic_vector(SUBSCRIBERS-1 downto 0) := (others => '0');

  -- The index of the bit that is '1'; zeros if there is none.
  function position(bits : std_logic_vector; size : positive) return std_logic_vector is
    alias    places : std_logic_vector(bits'length-1 downto 0) is bits;
    variable found  : std_logic_vector(size-1 downto 0) := (others => '0');
  begin
    for place in places'range loop
      for digit in found'range loop
        if (place / 2**digit) mod 2 = 1 then
          found(digit) := found(digit) or places(place);
        end if;
      end loop;
    end loop;
    return found;
  end function position;

  -- Beats to subscribers.
  signal sub_taken   : std_logic_vector(SUBSCRIBERS-1 downto 0);
  signal sub_taken_r : std_logic_vector(SUBSCRIBERS-1 downto 0) := (others => '0');
  signal sub_offered : std_logic;
  signal sub_beat    : std_logic;
  signal sub_valid   : std_logic;
  signal sub_index   : std_logic_vector(SUB_BITS-1 downto 0);

  -- Beats of publishers.
  signal pub_wait_r   : std_logic_vector(PUBLISHERS*WAIT_BITS-1 downto 0);
  signal pub_wait     : std_logic_vector(WAIT_BITS-1 downto 0);
  signal pub_beat_r   : std_logic;
  signal pub_last_r   : std_logic;
  signal pub_index_r  : std_logic_vector(PUB_BITS-1 downto 0) := (others => '0');
  signal pub_waited_r : std_logic_vector(WAIT_BITS-1 downto 0);

  -- Faults.
  signal waiting_r   : std_logic_vector(CHANNELS-1 downto 0);
  signal codes_r     : std_logic_vector(4*CHANNELS-1 downto 0);
  signal lowest      : std_logic_vector(CHANNELS-1 downto 0);
  signal chosen_r    : std_logic_vector(CHANNELS-1 downto 0);
  signal counted_r   : std_logic;
  signal channel_r   : std_logic_vector(CHANNEL_BITS-1 downto 0) := (others => '0');
  signal code_r      : std_logic_vector(3 downto 0) := (others => '0');
  signal fault_clear : std_logic;

  signal table_address : std_logic_vector(15 downto 0);

begin

  assert SUBSCRIBERS >= 1 and SUBSCRIBERS <= 256
    report "firm_status_counters: SUBSCRIBERS is " & integer'image(SUBSCRIBERS) & "; legal: 1 to 256"
    severity failure;
  assert PUBLISHERS >= 1 and PUBLISHERS <= 256
    report "firm_status_counters: PUBLISHERS is " & integer'image(PUBLISHERS) & "; legal: 1 to 256"
    severity failure;

  sub_taken   <= sub_axis_tvalid and sub_axis_tready;
  sub_offered <= '0' when sub_axis_tvalid = NO_SUBSCRIBER else '1';
  sub_beat    <= '0' when sub_taken = NO_SUBSCRIBER else '1';

  watch_subscribers : process (clk)
  begin
    if rising_edge(clk) then
      sub_taken_r <= sub_taken;
      if rst_n = '0' or enable = '0' then
        sub_taken_r <= (others => '0');
      end if;
    end if;
  end process watch_subscribers;

  sub_valid <= '0' when sub_taken_r = NO_SUBSCRIBER else '1';
  sub_index <= position(sub_taken_r, SUB_BITS);

  -- To the host. All publishers may wait at once.
  measure_waits : for number in 0 to PUBLISHERS-1 generate
    measure_wait : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' or pub_axis_tvalid(number) = '0'
           or (sched_beat = '1' and is_equal(sched_select, number) = '1') then
          pub_wait_r((number+1)*WAIT_BITS-1 downto number*WAIT_BITS) <= (others => '0');
        elsif unsigned(pub_wait_r((number+1)*WAIT_BITS-1 downto number*WAIT_BITS)) /= LONGEST then
          pub_wait_r((number+1)*WAIT_BITS-1 downto number*WAIT_BITS)
            <= std_logic_vector(unsigned(pub_wait_r((number+1)*WAIT_BITS-1 downto number*WAIT_BITS)) + 1);
        end if;
      end if;
    end process measure_wait;
  end generate measure_waits;

  u_select_wait : entity firm.firm_axis_select
    generic map (
      WORDS => PUBLISHERS,
      WIDTH => WAIT_BITS
    )
    port map (
      words_in => pub_wait_r,
      index    => sched_select,
      word     => pub_wait
    );

  watch_publishers : process (clk)
  begin
    if rising_edge(clk) then
      pub_beat_r   <= sched_beat and enable;
      pub_last_r   <= sched_last;
      pub_index_r  <= sched_select;
      pub_waited_r <= pub_wait;
      if rst_n = '0' then
        pub_beat_r  <= '0';
        pub_index_r <= (others => '0');
      end if;
    end if;
  end process watch_publishers;

  -- Faults. The lowest waiting channel is next; its code is read in the cycle after the choice.
  lowest <= waiting_r and std_logic_vector(unsigned(not waiting_r) + 1);

  take_faults : process (clk)
    variable code : std_logic_vector(3 downto 0);
  begin
    if rising_edge(clk) then
      lost     <= '0';
      chosen_r <= (others => '0');
      if fault_clear = '1' then
        chosen_r  <= lowest;
        waiting_r <= waiting_r and not lowest;
      end if;
      for number in 0 to CHANNELS-1 loop
        if frame_error(number) = '1' and enable = '1' then
          if waiting_r(number) = '1' then
            lost <= '1';
          else
            waiting_r(number)                     <= '1';
            codes_r(4*number+3 downto 4*number) <= frame_error_code(4*number+3 downto 4*number);
          end if;
        end if;
      end loop;
      code := (others => '0');
      for number in 0 to CHANNELS-1 loop
        code := code or gated(codes_r(4*number+3 downto 4*number), chosen_r(number));
      end loop;
      counted_r <= '0';
      if chosen_r /= NO_CHANNEL then
        counted_r <= '1';
        code_r    <= code;
        channel_r <= position(chosen_r, CHANNEL_BITS);
      end if;
      if rst_n = '0' then
        lost      <= '0';
        waiting_r <= (others => '0');
        chosen_r  <= (others => '0');
        counted_r <= '0';
        code_r    <= (others => '0');
        channel_r <= (others => '0');
      end if;
    end if;
  end process take_faults;

  table_address <= "000" & read_address;

  u_tables : entity firm.firm_status_tables
    generic map (
      SUBSCRIBERS => SUBSCRIBERS,
      PUBLISHERS  => PUBLISHERS,
      COUNT_BITS  => COUNT_BITS,
      FAULT_BITS  => COUNT_BITS,
      WAIT_BITS   => WAIT_BITS,
      TIME_STAMPS => TIME_STAMPS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      is_clear      => is_clear,
      fault_clear   => fault_clear,
      sub_offered   => sub_offered,
      sub_beat      => sub_beat,
      sub_last      => sub_axis_tlast,
      sub_valid     => sub_valid,
      sub_index     => sub_index,
      pub_valid     => pub_beat_r,
      pub_index     => pub_index_r,
      pub_last      => pub_last_r,
      pub_waited    => pub_waited_r,
      waits_index   => open,
      fault         => counted_r,
      fault_channel => channel_r,
      fault_code    => code_r,
      cycles        => cycles,
      read_address  => table_address,
      read_word     => read_word
    );

  fault         <= counted_r;
  fault_channel <= std_logic_vector(resize(unsigned(channel_r), 12));
  fault_code    <= code_r;

end architecture rtl;
