-- The counters beside a Manager of Managers: random beats, waits and faults of SUBSCRIBERS and PUBLISHERS, and a reading
-- of every word, compared with what happened. SEED decides everything. If CROWDED, faults may find their places taken;
-- then every fault is counted or lost. At the end, a second reset: all words are zero before the tables are clear; and
-- faults while counting is off, which are not lost ones.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
library firm;
use firm.firm_axis_pkg.all;

entity status_tree_bench is
  generic (
    SUBSCRIBERS : integer := 3;
    PUBLISHERS  : integer := 5;
    CYCLES      : integer := 3000;
    SEED        : integer := 1;
    CROWDED     : boolean := false
  );
end entity status_tree_bench;

architecture simulation of status_tree_bench is

  constant CHANNELS : positive := SUBSCRIBERS + PUBLISHERS;
  -- The cycles of a turn of the measured waits.
  constant TURN     : positive := 2**max(2, index_bits(PUBLISHERS));

  signal clk     : std_logic := '0';
  signal rst_n   : std_logic := '0';
  signal enable  : std_logic := '1';
  signal is_over : boolean   := false;

  signal is_clear, fault, lost             : std_logic;
  signal sub_offered, sub_beat, sub_last   : std_logic := '0';
  signal sub_selected                      : std_logic_vector(index_bits(SUBSCRIBERS)-1 downto 0) := (others => '0');
  signal m_axis_tid                        : std_logic_vector(15 downto 0) := (others => '0');
  signal m_axis_tvalid, m_axis_tlast       : std_logic := '0';
  signal pub_waits                         : std_logic_vector(PUBLISHERS-1 downto 0) := (others => '0');
  signal frame_error                       : std_logic_vector(CHANNELS-1 downto 0) := (others => '0');
  signal frame_error_code                  : std_logic_vector(4*CHANNELS-1 downto 0) := (others => '0');
  signal read_address                      : std_logic_vector(15 downto 0) := (others => '0');
  signal read_word                         : std_logic_vector(31 downto 0);

  type numbers_t is array (natural range <>) of natural;

begin

  clk <= not clk after 5 ns when not is_over else '0';

  u_counters : entity firm.firm_status_tree_counters
    generic map (
      SUBSCRIBERS => SUBSCRIBERS,
      PUBLISHERS  => PUBLISHERS
    )
    port map (
      clk              => clk,
      rst_n            => rst_n,
      enable           => enable,
      is_clear         => is_clear,
      sub_offered      => sub_offered,
      sub_beat         => sub_beat,
      sub_last         => sub_last,
      sub_selected     => sub_selected,
      m_axis_tid       => m_axis_tid,
      m_axis_tvalid    => m_axis_tvalid,
      m_axis_tlast     => m_axis_tlast,
      m_axis_tready    => '1',
      pub_waits        => pub_waits,
      frame_error      => frame_error,
      frame_error_code => frame_error_code,
      fault            => fault,
      fault_channel    => open,
      fault_code       => open,
      lost             => lost,
      cycles           => open,
      read_address     => read_address,
      read_word        => read_word
    );

  play : process
    variable seed_1   : positive := SEED;
    variable seed_2   : positive := 1;
    variable frames   : numbers_t(0 to CHANNELS-1) := (others => 0);
    variable faults   : numbers_t(0 to 16*CHANNELS-1) := (others => 0);
    variable quiet    : numbers_t(0 to CHANNELS-1) := (others => 0);
    variable left     : numbers_t(0 to PUBLISHERS-1) := (others => 0);
    variable waited   : numbers_t(0 to PUBLISHERS-1) := (others => 0);
    variable longest  : numbers_t(0 to CHANNELS-1) := (others => 0);
    variable injected : natural := 0;
    variable counted  : natural := 0;
    variable losses   : natural := 0;
    variable sub_wait : natural := 0;
    variable is_last  : boolean;
    variable waits    : std_logic_vector(PUBLISHERS-1 downto 0) := (others => '0');
    variable number   : natural;
    variable found    : natural;

    procedure draw(most : in natural; value : out natural) is
      variable chance : real;
    begin
      uniform(seed_1, seed_2, chance);
      value := integer(floor(chance * real(most + 1)));
    end procedure draw;

    procedure read(channel, word : in natural; value : out natural) is
    begin
      read_address <= std_logic_vector(to_unsigned(16*channel + word, 16));
      for cycle in 1 to 3 loop
        wait until rising_edge(clk);
      end loop;
      wait until falling_edge(clk);
      value := to_integer(unsigned(read_word));
    end procedure read;

  begin
    for cycle in 1 to 4 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    wait until is_clear = '1' and rising_edge(clk);

    for cycle in 1 to CYCLES loop
      wait until falling_edge(clk);
      -- Faults of any channels at once.
      for channel in 0 to CHANNELS-1 loop
        frame_error(channel) <= '0';
        quiet(channel)       := quiet(channel) + 1;
        draw(20, number);
        if number = 0 and (CROWDED or quiet(channel) > 3*CHANNELS + 6) then
          draw(11, number);
          frame_error(channel)                              <= '1';
          frame_error_code(4*channel+3 downto 4*channel) <= std_logic_vector(to_unsigned(number + 1, 4));
          faults(16*channel+number+1)                       := faults(16*channel+number+1) + 1;
          injected                                          := injected + 1;
          quiet(channel)                                    := 0;
        end if;
      end loop;
      -- A beat to a subscriber, which may wait; the address stays until it is taken.
      if sub_wait = 0 then
        draw(SUBSCRIBERS - 1, number);
        sub_selected <= std_logic_vector(to_unsigned(number, sub_selected'length));
        found        := number;
      else
        found := to_integer(unsigned(sub_selected));
      end if;
      sub_offered <= '1';
      draw(1, number);
      is_last  := number = 1;
      sub_last <= '0';
      if is_last then
        sub_last <= '1';
      end if;
      sub_beat <= '0';
      draw(3, number);
      if number = 0 then
        sub_beat       <= '1';
        longest(found) := max(longest(found), sub_wait);
        sub_wait       := 0;
        if is_last then
          frames(found) := frames(found) + 1;
        end if;
      else
        sub_wait := sub_wait + 1;
      end if;
      -- A beat to the host.
      draw(PUBLISHERS - 1, number);
      m_axis_tid <= std_logic_vector(to_unsigned(number, 16));
      found      := SUBSCRIBERS + number;
      draw(3, number);
      m_axis_tvalid <= '1';
      m_axis_tlast  <= '0';
      if number = 0 then
        m_axis_tlast  <= '1';
        frames(found) := frames(found) + 1;
      end if;
      -- Publishers wait and do not, for random times.
      for publisher in 0 to PUBLISHERS-1 loop
        if left(publisher) = 0 then
          draw(12*TURN, left(publisher));
          left(publisher)   := left(publisher) + 1;
          waited(publisher) := 0;
          waits(publisher)  := not waits(publisher);
        end if;
        left(publisher) := left(publisher) - 1;
        if waits(publisher) = '1' then
          waited(publisher)              := waited(publisher) + 1;
          longest(SUBSCRIBERS+publisher) := max(longest(SUBSCRIBERS+publisher), waited(publisher));
        end if;
      end loop;
      pub_waits <= waits;
      wait until rising_edge(clk);
      if lost = '1' then
        losses := losses + 1;
      end if;
    end loop;
    wait until falling_edge(clk);
    frame_error   <= (others => '0');
    sub_offered   <= '0';
    sub_beat      <= '0';
    m_axis_tvalid <= '0';
    pub_waits     <= (others => '0');
    for cycle in 1 to 3*CHANNELS + 2*TURN + 9 loop
      wait until rising_edge(clk);
      if lost = '1' then
        losses := losses + 1;
      end if;
    end loop;

    for channel in 0 to CHANNELS-1 loop
      for code in 1 to 12 loop
        read(channel, code, found);
        counted := counted + found;
        assert CROWDED or found = faults(16*channel+code)
          report "channel " & integer'image(channel) & " has " & integer'image(found) & " faults of code " &
          integer'image(code) & " instead of " & integer'image(faults(16*channel+code)) severity failure;
      end loop;
      read(channel, 13, found);
      assert found = frames(channel)
        report "channel " & integer'image(channel) & " has " & integer'image(found) & " frames instead of " &
        integer'image(frames(channel)) severity failure;
      read(channel, 14, found);
      if channel < SUBSCRIBERS then
        assert found = longest(channel)
          report "channel " & integer'image(channel) & " waited " & integer'image(found) & " cycles instead of " &
          integer'image(longest(channel)) severity failure;
      else
        assert found <= longest(channel) and found + 2*TURN > longest(channel)
          report "channel " & integer'image(channel) & " waited " & integer'image(found) & " cycles instead of " &
          integer'image(longest(channel)) severity failure;
      end if;
    end loop;
    -- Several faults of a cycle may be lost with one pulse.
    assert counted + losses <= injected and (losses > 0 or counted = injected)
      report integer'image(injected) & " faults, " & integer'image(counted) & " counted, " & integer'image(losses) &
      " pulses" severity failure;
    assert CROWDED or losses = 0
      report "faults were lost" severity failure;

    rst_n <= '0';
    for cycle in 1 to 4 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    -- Waits are first, since they are cleared first; in the reverse of the order of clearing.
    for word in 14 downto 1 loop
      for channel in CHANNELS-1 downto 0 loop
        read_address <= std_logic_vector(to_unsigned(16*channel + word, 16));
        wait until falling_edge(clk);
        assert unsigned(read_word) = 0
          report "a word is not zero after reset, close to " & integer'image(word) & " of channel " &
          integer'image(channel) severity failure;
      end loop;
    end loop;
    if is_clear = '0' then
      wait until is_clear = '1';
    end if;

    -- The first one is counted. It still waits when counting ends.
    wait until falling_edge(clk);
    frame_error(0)               <= '1';
    frame_error_code(3 downto 0) <= x"1";
    wait until falling_edge(clk);
    enable <= '0';
    for cycle in 1 to 9 loop
      wait until falling_edge(clk);
      if cycle = 2 then
        frame_error(0) <= '0';
      end if;
      assert lost = '0'
        report "a fault that is not counted is lost" severity failure;
    end loop;
    read(0, 1, found);
    assert found = 1
      report integer'image(found) & " faults instead of one" severity failure;
    report "PASS " & integer'image(counted) & " of " & integer'image(injected);
    is_over <= true;
    wait;
  end process play;

end architecture simulation;
