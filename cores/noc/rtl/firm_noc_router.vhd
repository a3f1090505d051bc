-- SPDX-License-Identifier: Apache-2.0
-- A wormhole router of frames. ROUTES are constants, so a router consists only of the turns that its frames use. The
-- outputs of a beat are looked up before the input buffer and kept in it with one bit for each output. Therefore,
-- requests are registers, and so is the destination, which the next router looks up. An output keeps its input from a
-- frame's first beat to its last one. Then the next input that requests it has its turn, round robin. The grant is a
-- register, which stays with the last input while none requests. Beats of one input pass without a gap, one cycle after
-- they have arrived; the change of an idle output to another input costs one cycle.
-- If a destination has several outputs, these are acquired in ascending order, each with its copy of the frame's first
-- beat, so frames never wait for each other in a circle. Each output takes each further beat on its own.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_noc_pkg.all;

entity firm_noc_router is
  generic (
    -- Of a beat, without the mark of the last one.
    BITS      : positive := 10;
    DEST_BITS : integer  := 1;
    PORTS     : positive := 2;
    -- The beats in an input's buffer: 2, in registers, or a larger power of two, in memories.
    DEPTH : positive := 2;
    -- At each input, a destination without a route never arrives.
    ROUTES : routes_t := ((0, 0, 1), (1, 0, 0))
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Port 0 has the lowest bits.
    s_beat        : in  std_logic_vector(PORTS*BITS-1 downto 0);
    s_destination : in  std_logic_vector(PORTS*DEST_BITS-1 downto 0);
    s_last        : in  std_logic_vector(PORTS-1 downto 0);
    s_valid       : in  std_logic_vector(PORTS-1 downto 0);
    s_ready       : out std_logic_vector(PORTS-1 downto 0);

    m_beat        : out std_logic_vector(PORTS*BITS-1 downto 0);
    m_destination : out std_logic_vector(PORTS*DEST_BITS-1 downto 0);
    m_last        : out std_logic_vector(PORTS-1 downto 0);
    m_valid       : out std_logic_vector(PORTS-1 downto 0);
    m_ready       : in  std_logic_vector(PORTS-1 downto 0)
  );
end entity firm_noc_router;

architecture rtl of firm_noc_router is

  constant TURNS     : std_logic_vector(PORTS*PORTS-1 downto 0) := turns_of(ROUTES, PORTS);
  constant WORD_BITS : positive := 1 + BITS + DEST_BITS;
  constant NONE      : std_logic_vector(PORTS-1 downto 0) := (others => '0');

  -- A beat with its destination and, in the lowest bit, its mark of the last one.
  subtype word_t is std_logic_vector(WORD_BITS-1 downto 0);
  type words_t is array (natural range <>) of word_t;

  signal words    : words_t(PORTS-1 downto 0);
  signal requests : std_logic_vector(PORTS*PORTS-1 downto 0);  -- of inputs to outputs
  signal takes    : std_logic_vector(PORTS*PORTS-1 downto 0);  -- by outputs from inputs

  -- Whether a destination leads from an input to an output.
  function leads(destination : std_logic_vector; input, output : natural) return std_logic is
    variable found : std_logic := '0';
  begin
    for place in ROUTES'range loop
      if ROUTES(place).input = input and ROUTES(place).output = output then
        found := found or is_equal(destination, ROUTES(place).destination);
      end if;
    end loop;
    return found;
  end function leads;

  -- One of several bits. Of each four, a LUT has the lower two; for the upper two, it gives the lowest bit of the index
  -- to the next LUT. These are two LUTs of four inputs, where synthesis finds three or four, which is why the inverse
  -- index is in other registers.
  function chosen(offers, index, inverse : std_logic_vector) return std_logic is
    constant LEVELS : positive := (index'length + 1) / 2;
    variable number : std_logic_vector(2*LEVELS-1 downto 0) := (others => '0');
    variable denied : std_logic_vector(2*LEVELS-1 downto 0) := (others => '1');
    variable found  : std_logic_vector(4**LEVELS-1 downto 0) := (others => '0');
    variable lower  : std_logic;
  begin
    number(index'length-1 downto 0)   := index;
    denied(inverse'length-1 downto 0) := inverse;
    found(offers'length-1 downto 0)   := offers;
    for level in 0 to LEVELS-1 loop
      for part in natural range 0 to 4**(LEVELS-1-level)-1 loop
        lower := number(2*level);
        if number(2*level+1) = '0' then
          lower := found(4*part);
          if number(2*level) = '1' then
            lower := found(4*part+1);
          end if;
        end if;
        if denied(2*level+1) = '1' then
          found(part) := lower;
        elsif lower = '1' then
          found(part) := found(4*part+3);
        else
          found(part) := found(4*part+2);
        end if;
      end loop;
    end loop;
    return found(0);
  end function chosen;

  -- The bits of the ways that a buffer keeps: none for one way, and one for two of which a beat takes one.
  function kept_ways(ways : natural; copies : boolean) return natural is
  begin
    if copies or ways > 2 then
      return ways;
    end if;
    return ways - 1;
  end function kept_ways;

begin

  assert DEST_BITS >= 1 and DEST_BITS <= 16
    report "firm_noc_router: DEST_BITS is " & integer'image(DEST_BITS) & "; legal: 1 to 16"
    severity failure;
  every_turn : for turn in 0 to PORTS*PORTS-1 generate
    unused : if TURNS(turn) = '0' generate
      requests(turn) <= '0';
      takes(turn)    <= '0';
    end generate unused;
  end generate every_turn;

  each_input : for input in 0 to PORTS-1 generate
    constant WAYS : natural := count_from(TURNS, PORTS, input);
  begin
    unused : if WAYS = 0 generate
      s_ready(input) <= '0';
      words(input)   <= (others => '0');
    end generate unused;

    used : if WAYS > 0 generate
      constant COPIES : boolean := has_copies(ROUTES, input);
      constant KEPT   : natural := kept_ways(WAYS, COPIES);

      -- The ways, the destination, which the next router looks up, and the mark of the last beat.
      signal arriving : std_logic_vector(KEPT+DEST_BITS downto 0);
      signal first    : std_logic_vector(KEPT+DEST_BITS downto 0);
      signal valid    : std_logic;
      signal pop      : std_logic;
      signal wanted   : std_logic_vector(WAYS-1 downto 0);  -- the ways of the first beat
      signal taken    : std_logic_vector(WAYS-1 downto 0);
    begin
      arriving(0)                      <= s_last(input);
      arriving(DEST_BITS downto 1)     <= s_destination((input+1)*DEST_BITS-1 downto input*DEST_BITS);
      words(input)(DEST_BITS downto 0) <= first(DEST_BITS downto 0);

      u_buffer : entity firm.firm_noc_buffer
        generic map (
          BITS         => BITS,
          CONTROL_BITS => 1+DEST_BITS+KEPT,
          DEPTH        => DEPTH
        )
        port map (
          clk       => clk,
          rst_n     => rst_n,
          s_payload => s_beat((input+1)*BITS-1 downto input*BITS),
          s_control => arriving,
          s_valid   => s_valid(input),
          s_ready   => s_ready(input),
          m_payload => words(input)(WORD_BITS-1 downto DEST_BITS+1),
          m_control => first,
          m_valid   => valid,
          m_ready   => pop
        );

      single_way : if KEPT = 0 generate
        wanted <= (others => valid);
      end generate single_way;

      either_way : if KEPT = 1 and WAYS = 2 generate
        arriving(1+DEST_BITS) <= leads(s_destination((input+1)*DEST_BITS-1 downto input*DEST_BITS),
                             input, output_from(TURNS, PORTS, input, 1));
        wanted(0)   <= valid and not first(1+DEST_BITS);
        wanted(1)   <= valid and first(1+DEST_BITS);
      end generate either_way;

      each_way : for way in 0 to WAYS-1 generate
        constant OUTPUT : natural := output_from(TURNS, PORTS, input, way);
      begin
        kept_way : if KEPT = WAYS generate
          arriving(1+DEST_BITS+way)
            <= leads(s_destination((input+1)*DEST_BITS-1 downto input*DEST_BITS), input, OUTPUT);
          wanted(way) <= valid and first(1+DEST_BITS+way);
        end generate kept_way;

        taken(way) <= takes(input*PORTS + OUTPUT);
      end generate each_way;

      without_copies : if not COPIES generate
        forward : for way in 0 to WAYS-1 generate
          requests(input*PORTS + output_from(TURNS, PORTS, input, way)) <= wanted(way);
        end generate forward;

        pop <= '0' when taken = NONE(WAYS-1 downto 0) else '1';
      end generate without_copies;

      with_copies : if COPIES generate
        signal done_r   : std_logic_vector(WAYS-1 downto 0);  -- outputs that have taken the first word
        signal begins_r : std_logic;                          -- it is the first beat of a frame
        signal left     : std_logic_vector(WAYS-1 downto 0);  -- ways that it has not taken yet
      begin
        left <= wanted and not done_r;

        forward : for way in 0 to WAYS-1 generate
          signal lower : std_logic;  -- a lower output must be acquired before
        begin
          lower <= '0' when way = 0 or left(max(0, way-1) downto 0) = NONE(max(0, way-1) downto 0) else begins_r;
          requests(input*PORTS + output_from(TURNS, PORTS, input, way)) <= left(way) and not lower;
        end generate forward;

        pop <= valid when (left and not taken) = NONE(WAYS-1 downto 0) else '0';

        track_copies : process (clk)
        begin
          if rising_edge(clk) then
            done_r <= done_r or taken;
            if pop = '1' then
              done_r   <= (others => '0');
              begins_r <= first(0);
            end if;
            if rst_n = '0' then
              done_r   <= (others => '0');
              begins_r <= '1';
            end if;
          end if;
        end process track_copies;
      end generate with_copies;
    end generate used;
  end generate each_input;

  each_output : for output in 0 to PORTS-1 generate
    constant INPUTS : natural := count_to(TURNS, PORTS, output);

    signal word : word_t;
  begin
    m_last(output)                                                <= word(0);
    m_destination((output+1)*DEST_BITS-1 downto output*DEST_BITS) <= word(DEST_BITS downto 1);
    m_beat((output+1)*BITS-1 downto output*BITS)                  <= word(WORD_BITS-1 downto DEST_BITS+1);

    unused : if INPUTS = 0 generate
      word            <= (others => '0');
      m_valid(output) <= '0';
    end generate unused;

    single : if INPUTS = 1 generate
      constant INPUT : natural := input_to(TURNS, PORTS, output, 0);
    begin
      word                         <= words(INPUT);
      m_valid(output)              <= requests(INPUT*PORTS + output);
      takes(INPUT*PORTS + output)  <= requests(INPUT*PORTS + output) and m_ready(output);
    end generate single;

    several : if INPUTS > 1 generate
      signal grant_r    : std_logic_vector(clog2(INPUTS)-1 downto 0);
      signal inverse_r  : std_logic_vector(clog2(INPUTS)-1 downto 0);  -- of the grant
      signal busy_r     : std_logic;                                   -- a frame has begun
      signal candidates : std_logic_vector(INPUTS-1 downto 0);
      signal granted    : std_logic_vector(INPUTS-1 downto 0);
      signal next_grant : std_logic_vector(clog2(INPUTS)-1 downto 0);
      signal offered    : std_logic;
      signal renew      : std_logic;
    begin
      each_turn : for turn in 0 to INPUTS-1 generate
        constant INPUT : natural := input_to(TURNS, PORTS, output, turn);
      begin
        candidates(turn)            <= requests(INPUT*PORTS + output);
        granted(turn)               <= candidates(turn) and is_equal(grant_r, turn);
        takes(INPUT*PORTS + output) <= granted(turn) and m_ready(output);
      end generate each_turn;

      m_valid(output) <= offered;

      offered <= '0' when granted = NONE(INPUTS-1 downto 0) else '1';
      renew   <= (m_ready(output) and word(0)) when offered = '1' else not busy_r;

      each_bit : for place in 0 to WORD_BITS-1 generate
        signal offers : std_logic_vector(INPUTS-1 downto 0);
      begin
        each_offer : for turn in 0 to INPUTS-1 generate
          offers(turn) <= words(input_to(TURNS, PORTS, output, turn))(place);
        end generate each_offer;

        word(place) <= chosen(offers, grant_r, inverse_r);
      end generate each_bit;

      -- The first candidate after the present one, in a circle.
      take_turns : process (candidates, grant_r)
      begin
        next_grant <= grant_r;
        for turn in INPUTS-1 downto 0 loop
          if candidates(turn) = '1' and is_below(grant_r, turn+1) = '0' then
            next_grant <= std_logic_vector(to_unsigned(turn, clog2(INPUTS)));
          end if;
        end loop;
        for turn in INPUTS-1 downto 1 loop
          if candidates(turn) = '1' and is_below(grant_r, turn) = '1' then
            next_grant <= std_logic_vector(to_unsigned(turn, clog2(INPUTS)));
          end if;
        end loop;
      end process take_turns;

      grant : process (clk)
      begin
        if rising_edge(clk) then
          if offered = '1' and m_ready(output) = '1' then
            busy_r <= not word(0);
          end if;
          if renew = '1' then
            grant_r   <= next_grant;
            inverse_r <= not next_grant;
          end if;
          if rst_n = '0' then
            busy_r    <= '0';
            grant_r   <= (others => '0');
            inverse_r <= (others => '1');
          end if;
        end if;
      end process grant;
    end generate several;
  end generate each_output;

end architecture rtl;
