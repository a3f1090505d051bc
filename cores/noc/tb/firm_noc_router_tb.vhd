-- SPDX-License-Identifier: Apache-2.0
-- Tests a router with frames of random lengths from each input to each other output, and copies to all of them. Each
-- output must receive every frame of an input once, whole and in order; offered beats must stay.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_noc_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_noc_router_tb is
  generic (
    DEPTH  : positive := 2;
    FRAMES : positive := 1000;  -- of each input
    SEED   : positive := 1;
    -- The chance per cycle that an input pauses, or that an output takes nothing.
    STALL_PERCENT : natural := 0
  );
end entity firm_noc_router_tb;

architecture simulation of firm_noc_router_tb is

  constant PORTS     : positive := 3;
  constant DEST_BITS : positive := 2;
  constant COPIES    : natural  := PORTS;  -- the destination of frames to all other outputs
  constant LONGEST   : positive := 6;
  constant BITS      : positive := 24;     -- the input, the place in the frame, the number of the frame
  constant LIMIT     : positive := 1000;

  constant ROUTES : routes_t := (
    (0, 1, 1), (0, 2, 2), (0, COPIES, 1), (0, COPIES, 2), (1, 0, 0), (1, 2, 2), (1, COPIES, 0), (1, COPIES, 2),
    (2, 0, 0), (2, 1, 1), (2, COPIES, 0), (2, COPIES, 1)
  );

  type counts_t is array (natural range <>) of natural;
  type matrix_t is array (natural range <>, natural range <>) of natural;

  signal clk      : std_logic := '0';
  signal rst_n    : std_logic := '0';
  signal finished : boolean   := false;

  signal s_beat        : std_logic_vector(PORTS*BITS-1 downto 0)      := (others => '0');
  signal s_destination : std_logic_vector(PORTS*DEST_BITS-1 downto 0) := (others => '0');
  signal s_last        : std_logic_vector(PORTS-1 downto 0)           := (others => '0');
  signal s_valid       : std_logic_vector(PORTS-1 downto 0)           := (others => '0');
  signal s_ready       : std_logic_vector(PORTS-1 downto 0);
  signal m_beat        : std_logic_vector(PORTS*BITS-1 downto 0);
  signal m_destination : std_logic_vector(PORTS*DEST_BITS-1 downto 0);
  signal m_last        : std_logic_vector(PORTS-1 downto 0);
  signal m_valid       : std_logic_vector(PORTS-1 downto 0);
  signal m_ready       : std_logic_vector(PORTS-1 downto 0)           := (others => '0');

begin

  clk   <= not clk after 5 ns when not finished else '0';
  rst_n <= '1' after 32 ns;

  u_router : entity firm.firm_noc_router
    generic map (
      BITS      => BITS,
      DEST_BITS => DEST_BITS,
      PORTS     => PORTS,
      DEPTH     => DEPTH,
      ROUTES    => ROUTES
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_beat        => s_beat,
      s_destination => s_destination,
      s_last        => s_last,
      s_valid       => s_valid,
      s_ready       => s_ready,
      m_beat        => m_beat,
      m_destination => m_destination,
      m_last        => m_last,
      m_valid       => m_valid,
      m_ready       => m_ready
    );

  -- Inputs change shortly after the edge, outputs are read at the next.
  run : process
    variable random   : random_t := seeded(SEED, SEED + 1);
    variable lengths  : counts_t(0 to PORTS-1) := (others => 0);  -- of the frame that an input sends, or 0
    variable places   : counts_t(0 to PORTS-1) := (others => 0);
    variable numbers  : counts_t(0 to PORTS-1) := (others => 0);
    variable sinks    : counts_t(0 to PORTS-1) := (others => 0);
    variable senders  : counts_t(0 to PORTS-1) := (others => PORTS);  -- at the outputs, or PORTS
    variable next_at  : counts_t(0 to PORTS-1) := (others => 0);
    variable seen     : matrix_t(0 to PORTS-1, 0 to PORTS-1) := (others => (others => 0));
    variable owed     : natural := 0;  -- frames on their way to an output
    variable received : natural := 0;
    variable idle     : natural := 0;
    variable source   : natural;
    variable place    : natural;
    variable number   : natural;
    variable happens  : boolean;
    variable is_over  : boolean := false;
    variable before   : std_logic_vector(PORTS*BITS-1 downto 0);
    variable waiting  : std_logic_vector(PORTS-1 downto 0) := (others => '0');
    variable beat     : std_logic_vector(BITS-1 downto 0);
  begin
    wait until rst_n = '1';
    wait until rising_edge(clk);
    while not is_over loop
      wait for 1 ns;
      for port_in in 0 to PORTS-1 loop
        if s_valid(port_in) = '0' then
          draw_chance(random, STALL_PERCENT, happens);
          if lengths(port_in) = 0 and numbers(port_in) < FRAMES then
            draw(random, LONGEST-1, lengths(port_in));
            lengths(port_in) := lengths(port_in) + 1;
            draw(random, PORTS-1, sinks(port_in));
            -- The own one gives the copies their turn.
            if sinks(port_in) = port_in then
              sinks(port_in) := COPIES;
            end if;
            for port_out in 0 to PORTS-1 loop
              if port_out = sinks(port_in) or (sinks(port_in) = COPIES and port_out /= port_in) then
                owed := owed + 1;
              end if;
            end loop;
          end if;
          if lengths(port_in) > 0 and not happens then
            s_valid(port_in) <= '1';
            s_last(port_in)  <= '0';
            if places(port_in) = lengths(port_in)-1 then
              s_last(port_in) <= '1';
            end if;
            s_destination((port_in+1)*DEST_BITS-1 downto port_in*DEST_BITS)
              <= std_logic_vector(to_unsigned(sinks(port_in), DEST_BITS));
            s_beat((port_in+1)*BITS-1 downto port_in*BITS)
              <= std_logic_vector(to_unsigned(port_in, 4)) & std_logic_vector(to_unsigned(places(port_in), 4))
                 & std_logic_vector(to_unsigned(numbers(port_in), 16));
          end if;
        end if;
        draw_chance(random, STALL_PERCENT, happens);
        m_ready(port_in) <= '1';
        if happens then
          m_ready(port_in) <= '0';
        end if;
      end loop;

      wait until rising_edge(clk);
      idle := idle + 1;
      for port_out in 0 to PORTS-1 loop
        beat := m_beat((port_out+1)*BITS-1 downto port_out*BITS);
        assert waiting(port_out) = '0' or
               (m_valid(port_out) = '1' and beat = before((port_out+1)*BITS-1 downto port_out*BITS))
          report "an offered beat changes" severity failure;
        waiting(port_out) := m_valid(port_out) and not m_ready(port_out);
        before((port_out+1)*BITS-1 downto port_out*BITS) := beat;
        if m_valid(port_out) = '1' and m_ready(port_out) = '1' then
          idle   := 0;
          source := to_integer(unsigned(beat(23 downto 20)));
          place  := to_integer(unsigned(beat(19 downto 16)));
          number := to_integer(unsigned(beat(15 downto 0)));
          assert source /= port_out and (senders(port_out) = PORTS or senders(port_out) = source)
            report "frames are mixed" severity failure;
          assert place = next_at(port_out)
            report "a beat is lost, or there twice" severity failure;
          assert place > 0 or number >= seen(source, port_out)
            report "a frame is late, or there twice" severity failure;
          senders(port_out) := source;
          next_at(port_out) := place + 1;
          if m_last(port_out) = '1' then
            owed := owed - 1;
            received := received + 1;
            seen(source, port_out) := number + 1;
            senders(port_out) := PORTS;
            next_at(port_out) := 0;
          end if;
        end if;
      end loop;
      is_over := owed = 0;
      for port_in in 0 to PORTS-1 loop
        if s_valid(port_in) = '1' and s_ready(port_in) = '1' then
          idle := 0;
          s_valid(port_in) <= '0';
          places(port_in)  := places(port_in) + 1;
          if places(port_in) = lengths(port_in) then
            places(port_in)  := 0;
            lengths(port_in) := 0;
            numbers(port_in) := numbers(port_in) + 1;
          end if;
        end if;
        is_over := is_over and numbers(port_in) = FRAMES;
      end loop;
      assert idle < LIMIT
        report "nothing moves" severity failure;
    end loop;

    report "PASS " & integer'image(received) & " frames";
    finished <= true;
    wait;
  end process run;

end architecture simulation;
