-- SPDX-License-Identifier: Apache-2.0
-- Forwards the messages of several sources to one sink, one whole message after the other. Round robin: when a message
-- ends, the next open source after its own one has its turn. Without another open source, the turn stays, so messages
-- of a single source pass without a gap.
-- All signals of a message pass: its fields, the levels that offer it or a part of it (valid), and the levels that take
-- these (ready). A source without its turn sees no ready, and the sink sees nothing of it.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_message_merge is
  generic (
    SOURCES : integer := 2;
    -- The bits of a message's fields and data, which are not levels of a handshake.
    FIELD_BITS : integer := 8;
    -- The levels that offer: the lowest one is high from the begin of a message to its end, and the highest one offers
    -- the complete message. With one level, it is both.
    OFFERS : integer := 1;
    -- The levels that take; the lowest one takes the complete message.
    TAKES : integer := 1
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The first source has the lowest bits. A message may be withdrawn: its offers fall before it is taken.
    source_fields : in  std_logic_vector(SOURCES*FIELD_BITS-1 downto 0);
    source_offers : in  std_logic_vector(SOURCES*OFFERS-1 downto 0);
    source_takes  : out std_logic_vector(SOURCES*TAKES-1 downto 0);

    sink_fields : out std_logic_vector(FIELD_BITS-1 downto 0);
    sink_offers : out std_logic_vector(OFFERS-1 downto 0);
    sink_takes  : in  std_logic_vector(TAKES-1 downto 0)
  );
end entity firm_message_merge;

architecture rtl of firm_message_merge is

  constant NOTHING : std_logic_vector(SOURCES-1 downto 0) := (others => '0');

  signal turn_r   : std_logic_vector(SOURCES-1 downto 0) := (others => '0');  -- one bit is high
  signal is_open  : std_logic_vector(SOURCES-1 downto 0);
  signal others_i : std_logic_vector(SOURCES-1 downto 0);  -- open sources without the turn
  signal after_i  : unsigned(2*SOURCES-1 downto 0);        -- the place after the turn
  signal once_i   : unsigned(2*SOURCES-1 downto 0);
  signal round_i  : unsigned(2*SOURCES-1 downto 0);        -- two rounds of open sources
  signal first_i  : std_logic_vector(2*SOURCES-1 downto 0);
  signal next_i   : std_logic_vector(SOURCES-1 downto 0);
  signal offers_i : std_logic_vector(OFFERS-1 downto 0);
  signal is_going : std_logic;  -- the source with the turn has an open message
  signal is_done  : std_logic;

  -- The word of the source that has the turn.
  function chosen(words, turn : std_logic_vector; bits : positive) return std_logic_vector is
    variable found : std_logic_vector(bits-1 downto 0) := (others => '0');
  begin
    for source in 0 to SOURCES-1 loop
      for place in 0 to bits-1 loop
        found(place) := found(place) or (words(bits*source + place) and turn(source));
      end loop;
    end loop;
    return found;
  end function chosen;

begin

  assert SOURCES >= 1
    report "firm_message_merge: SOURCES is " & integer'image(SOURCES) & "; legal: 1 or more"
    severity failure;
  assert FIELD_BITS >= 1
    report "firm_message_merge: FIELD_BITS is " & integer'image(FIELD_BITS) & "; legal: 1 or more"
    severity failure;
  assert OFFERS >= 1
    report "firm_message_merge: OFFERS is " & integer'image(OFFERS) & "; legal: 1 or more"
    severity failure;
  assert TAKES >= 1
    report "firm_message_merge: TAKES is " & integer'image(TAKES) & "; legal: 1 or more"
    severity failure;

  -- Illegal generics end at the assertions above.
  levels : if OFFERS >= 1 and TAKES >= 1 generate
    each_source : for source in 0 to SOURCES-1 generate
      is_open(source) <= source_offers(OFFERS*source);

      each_take : for place in 0 to TAKES-1 generate
        source_takes(TAKES*source + place) <= sink_takes(place) and turn_r(source);
      end generate each_take;
    end generate each_source;

    is_going <= offers_i(0);
    is_done  <= offers_i(OFFERS-1) and sink_takes(0);
  end generate levels;

  offers_i    <= chosen(source_offers, turn_r, OFFERS);
  sink_fields <= chosen(source_fields, turn_r, FIELD_BITS);
  sink_offers <= offers_i;

  -- The lowest open source from the place after the turn, in two rounds.
  others_i <= is_open and not turn_r;
  once_i   <= resize(unsigned(others_i), 2*SOURCES);
  round_i  <= once_i or shift_left(once_i, SOURCES);
  after_i  <= shift_left(resize(unsigned(turn_r), 2*SOURCES), 1);
  first_i  <= std_logic_vector(round_i and not (round_i - after_i));
  next_i   <= first_i(2*SOURCES-1 downto SOURCES) or first_i(SOURCES-1 downto 0);

  give_turns : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        turn_r <= std_logic_vector(to_unsigned(1, SOURCES));
      elsif others_i /= NOTHING and (is_done = '1' or is_going = '0') then
        turn_r <= next_i;
      end if;
    end if;
  end process give_turns;

end architecture rtl;
