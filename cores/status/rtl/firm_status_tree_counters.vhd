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

  signal sub_beat_r  : std_logic;
  signal sub_index_r : std_logic_vector(SUB_BITS-1 downto 0) := (others => '0');
  signal pub_frame_r : std_logic;
  signal pub_index_r : std_logic_vector(PUB_BITS-1 downto 0) := (others => '0');
  signal waits_index : std_logic_vector(PUB_BITS-1 downto 0);
  signal waits_read  : std_logic_vector(WAIT_BITS-1 downto 0);

  signal counted      : std_logic;
  signal fault_number : std_logic_vector(CHANNEL_BITS-1 downto 0);
  signal code         : std_logic_vector(3 downto 0);

  signal tables_clear : std_logic;
  signal waits_clear  : std_logic;
  signal fault_clear  : std_logic;

begin

  assert SUBSCRIBERS >= 1 and PUBLISHERS >= 1 and CHANNELS <= MOST_CHANNELS
    report "firm_status_tree_counters: SUBSCRIBERS is " & integer'image(SUBSCRIBERS) & " and PUBLISHERS is " &
    integer'image(PUBLISHERS) & "; legal: 1 or more each, and at most " & integer'image(MOST_CHANNELS) & " together"
    severity failure;

  watch_beats : process (clk)
  begin
    if rising_edge(clk) then
      sub_beat_r  <= sub_beat and enable;
      sub_index_r <= sub_selected;
      pub_frame_r <= m_axis_tvalid and m_axis_tready and m_axis_tlast and enable;
      pub_index_r <= m_axis_tid(PUB_BITS-1 downto 0);
      if rst_n = '0' then
        sub_beat_r  <= '0';
        sub_index_r <= (others => '0');
        pub_frame_r <= '0';
        pub_index_r <= (others => '0');
      end if;
    end if;
  end process watch_beats;

  u_waits : entity firm.firm_status_waits
    generic map (
      SOURCES   => PUBLISHERS,
      WAIT_BITS => WAIT_BITS
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      is_clear     => waits_clear,
      enable       => enable,
      waits        => pub_waits,
      read_index   => waits_index,
      read_longest => waits_read
    );

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

  u_tables : entity firm.firm_status_tables
    generic map (
      SUBSCRIBERS  => SUBSCRIBERS,
      PUBLISHERS   => PUBLISHERS,
      COUNT_BITS   => COUNT_BITS,
      FAULT_BITS   => FAULT_BITS,
      WAIT_BITS    => WAIT_BITS,
      TIME_STAMPS  => TIME_STAMPS,
      STORES_WAITS => false,
      SHARED_READ  => true
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      is_clear      => tables_clear,
      fault_clear   => fault_clear,
      sub_offered   => sub_offered,
      sub_beat      => sub_beat,
      sub_last      => sub_last,
      sub_valid     => sub_beat_r,
      sub_index     => sub_index_r,
      pub_valid     => pub_frame_r,
      pub_index     => pub_index_r,
      pub_last      => '1',
      waits_index   => waits_index,
      waits_read    => waits_read,
      fault         => counted,
      fault_channel => fault_number,
      fault_code    => code,
      cycles        => cycles,
      read_address  => read_address,
      read_word     => read_word
    );

  is_clear      <= tables_clear and waits_clear;
  fault         <= counted;
  fault_channel <= std_logic_vector(resize(unsigned(fault_number), 12));
  fault_code    <= code;

end architecture rtl;
