-- SPDX-License-Identifier: Apache-2.0
-- Moves a magnitude to the left until its highest bit is one, but at most by a limit.
--
-- The distance is found and applied bit by bit from its highest one: two bits take one pipeline register. If a bit of
-- the limit is one but the magnitude does not move so far, the limit exceeds all remaining distances; otherwise, the
-- remaining bits are the limit of what remains. `rest` accompanies the magnitude.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_shift_left is
  generic (
    -- Bits of the magnitude.
    WIDTH  : positive;
    -- Bits of the distance; 2**(LEVELS-1) <= WIDTH.
    LEVELS : positive;
    -- Bits of the rest.
    REST   : positive
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;
    -- All registers keep their values unless it is high.
    advance       : in  std_logic;

    in_valid      : in  std_logic;
    in_magnitude  : in  unsigned(WIDTH-1 downto 0);
    in_limit      : in  unsigned(LEVELS-1 downto 0);
    in_rest       : in  std_logic_vector(REST-1 downto 0);

    -- High stages_for(LEVELS) cycles after in_valid.
    out_valid     : out std_logic;
    out_magnitude : out unsigned(WIDTH-1 downto 0);
    -- The places by which the magnitude has moved.
    out_distance  : out unsigned(LEVELS-1 downto 0);
    out_rest      : out std_logic_vector(REST-1 downto 0)
  );
end entity firm_float_shift_left;

architecture rtl of firm_float_shift_left is

  constant STAGES : positive := stages_for(LEVELS);

  type magnitudes_t is array (natural range <>) of unsigned(WIDTH-1 downto 0);
  type distances_t is array (natural range <>) of unsigned(LEVELS-1 downto 0);
  type rests_t is array (natural range <>) of std_logic_vector(REST-1 downto 0);

  -- Index 0 is the input.
  signal valids     : std_logic_vector(STAGES downto 0);
  signal magnitudes : magnitudes_t(STAGES downto 0);
  signal limits     : distances_t(STAGES downto 0);
  signal distances  : distances_t(STAGES downto 0);
  signal rests      : rests_t(STAGES downto 0);

begin

  valids(0)     <= in_valid;
  magnitudes(0) <= in_magnitude;
  limits(0)     <= in_limit;
  distances(0)  <= (others => '0');
  rests(0)      <= in_rest;

  out_valid     <= valids(STAGES);
  out_magnitude <= magnitudes(STAGES);
  out_distance  <= distances(STAGES);
  out_rest      <= rests(STAGES);

  each_stage : for stage in 0 to STAGES-1 generate

    move : process (clk)
      variable magnitude : unsigned(WIDTH-1 downto 0);
      variable limit     : unsigned(LEVELS-1 downto 0);
      variable distance  : unsigned(LEVELS-1 downto 0);
      variable level     : integer;
    begin
      if rising_edge(clk) then
        if advance = '1' then
          magnitude := magnitudes(stage);
          limit     := limits(stage);
          distance  := distances(stage);
          for half in 0 to 1 loop
            level := LEVELS-1 - 2*stage - half;
            if level >= 0 then
              if limit(level) = '1' then
                if magnitude(WIDTH-1 downto WIDTH-2**level) = 0 then
                  magnitude       := shift_left(magnitude, 2**level);
                  distance(level) := '1';
                else
                  limit := (others => '1');
                end if;
              end if;
            end if;
          end loop;
          valids(stage+1)     <= valids(stage);
          magnitudes(stage+1) <= magnitude;
          limits(stage+1)     <= limit;
          distances(stage+1)  <= distance;
          rests(stage+1)      <= rests(stage);
        end if;
        if rst_n = '0' then
          valids(stage+1) <= '0';
        end if;
      end if;
    end process move;

  end generate each_stage;

end architecture rtl;
