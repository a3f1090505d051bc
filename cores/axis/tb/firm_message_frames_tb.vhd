-- SPDX-License-Identifier: Apache-2.0
-- Sends messages as frames through a stream that stalls at random, and receives them again. Each copy of each message
-- must arrive once, whole, in order and at its destination; a received message must stay until it is taken. Without
-- stalls, no cycle may pass without a beat.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_message_frames_tb is
  generic (
    WIDTH      : integer := 8;
    FIELD_BITS : integer := 20;
    COPIES     : integer := 1;
    MESSAGES   : integer := 300;
    SEED       : integer := 1;
    -- The chance per cycle that the source has no message, or that the stream between the two stalls.
    STALL_PERCENT : integer := 0;
    -- The chance per cycle that a sink takes a message.
    SINK_PERCENT : integer := 100
  );
end entity firm_message_frames_tb;

architecture simulation of firm_message_frames_tb is

  constant BEATS : positive := (FIELD_BITS+WIDTH-1) / WIDTH;

  type count_t is array (natural range <>) of natural;
  type fields_t is array (natural range <>) of std_logic_vector(FIELD_BITS-1 downto 0);

  signal clk      : std_logic := '0';
  signal rst_n    : std_logic := '0';
  signal finished : boolean   := false;

  signal source_fields : std_logic_vector(FIELD_BITS-1 downto 0) := (others => '0');
  signal source_valid  : std_logic := '0';
  signal source_ready  : std_logic;
  signal data          : std_logic_vector(WIDTH-1 downto 0);
  signal dest          : std_logic_vector(index_bits(COPIES)-1 downto 0);
  signal valid         : std_logic;
  signal last          : std_logic;
  signal ready         : std_logic;
  signal passes        : std_logic := '1';  -- the stream does not stall
  signal gated_valid   : std_logic_vector(COPIES-1 downto 0);
  signal gated_ready   : std_logic_vector(COPIES-1 downto 0);
  signal sink_fields   : fields_t(0 to COPIES-1);
  signal sink_valid    : std_logic_vector(COPIES-1 downto 0);
  signal sink_ready    : std_logic_vector(COPIES-1 downto 0) := (others => '0');

  function total(counts : count_t) return natural is
    variable found : natural := 0;
  begin
    for place in counts'range loop
      found := found + counts(place);
    end loop;
    return found;
  end function total;

  -- The fields of a message: its number, repeated.
  function fields_of(number : natural) return std_logic_vector is
    constant BITS   : std_logic_vector(10 downto 0) := std_logic_vector(to_unsigned(number, 11));
    variable fields : std_logic_vector(FIELD_BITS-1 downto 0);
  begin
    for place in fields'range loop
      fields(place) := BITS(place mod 11);
    end loop;
    return fields;
  end function fields_of;

begin

  clk   <= not clk after 5 ns when not finished else '0';
  rst_n <= '1' after 32 ns;

  u_send : entity firm.firm_message_send
    generic map (
      WIDTH      => WIDTH,
      FIELD_BITS => FIELD_BITS,
      COPIES     => COPIES
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      fields        => source_fields,
      valid         => source_valid,
      ready         => source_ready,
      m_axis_tdata  => data,
      m_axis_tdest  => dest,
      m_axis_tvalid => valid,
      m_axis_tlast  => last,
      m_axis_tready => ready
    );

  ready <= passes and gated_ready(to_integer(unsigned(dest)));

  each_copy : for number in 0 to COPIES-1 generate
    gated_valid(number) <= valid and passes when unsigned(dest) = number else '0';

    u_receive : entity firm.firm_message_receive
      generic map (
        WIDTH      => WIDTH,
        FIELD_BITS => FIELD_BITS
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => data,
        s_axis_tvalid => gated_valid(number),
        s_axis_tlast  => last,
        s_axis_tready => gated_ready(number),
        fields        => sink_fields(number),
        valid         => sink_valid(number),
        ready         => sink_ready(number)
      );
  end generate each_copy;

  -- Inputs change shortly after the edge, outputs are read at the next.
  run : process
    variable random  : random_t := seeded(SEED, SEED + 1);
    variable sent    : natural := 0;
    variable taken   : count_t(0 to COPIES-1) := (others => 0);
    variable before  : fields_t(0 to COPIES-1);
    variable stalled : std_logic_vector(COPIES-1 downto 0) := (others => '0');
    variable cycles  : natural := 0;
    variable happens : boolean;
  begin
    wait until rst_n = '1';
    wait until rising_edge(clk);
    while total(taken) < MESSAGES*COPIES loop
      wait for 1 ns;
      if source_valid = '0' and sent < MESSAGES then
        draw_chance(random, STALL_PERCENT, happens);
        if not happens then
          source_valid  <= '1';
          source_fields <= fields_of(sent);
        end if;
      end if;
      for number in 0 to COPIES-1 loop
        draw_chance(random, SINK_PERCENT, happens);
        sink_ready(number) <= '0';
        if happens then
          sink_ready(number) <= '1';
        end if;
      end loop;
      draw_chance(random, STALL_PERCENT, happens);
      passes <= '1';
      if happens then
        passes <= '0';
      end if;

      wait until rising_edge(clk);
      cycles := cycles + 1;
      for number in 0 to COPIES-1 loop
        assert stalled(number) = '0' or (sink_valid(number) = '1' and sink_fields(number) = before(number))
          report "sink " & integer'image(number) & " lost its message before it took it" severity failure;
        stalled(number) := sink_valid(number) and not sink_ready(number);
        before(number)  := sink_fields(number);
        if sink_valid(number) = '1' and sink_ready(number) = '1' then
          assert sink_fields(number) = fields_of(taken(number))
            report "sink " & integer'image(number) & " received another message than " & integer'image(taken(number))
            severity failure;
          taken(number) := taken(number) + 1;
        end if;
      end loop;
      if source_valid = '1' and source_ready = '1' then
        sent := sent + 1;
        if sent < MESSAGES and STALL_PERCENT = 0 then
          source_fields <= fields_of(sent) after 1 ns;
        else
          source_valid  <= '0' after 1 ns;
          source_fields <= (others => 'X') after 1 ns;
          wait for 1 ns;
        end if;
      end if;
    end loop;

    for number in 0 to COPIES-1 loop
      assert taken(number) = MESSAGES
        report "sink " & integer'image(number) & " received " & integer'image(taken(number)) & " messages"
        severity failure;
    end loop;
    -- The first message is sent in the cycle after it is taken, the last one received in the cycle after its last beat.
    assert STALL_PERCENT > 0 or SINK_PERCENT < 100 or cycles = MESSAGES*COPIES*BEATS + 2
      report integer'image(cycles) & " cycles for " & integer'image(MESSAGES*COPIES*BEATS) & " beats" severity failure;
    report "PASS " & integer'image(MESSAGES) & " messages, " & integer'image(COPIES) & " copies of each";
    finished <= true;
    wait;
  end process run;

end architecture simulation;
