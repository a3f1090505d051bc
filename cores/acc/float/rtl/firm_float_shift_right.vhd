-- SPDX-License-Identifier: Apache-2.0
-- Moves a magnitude to the right; the lowest bit keeps whether a one has moved out.
--
-- Two bits of the distance take one pipeline register. `rest` accompanies the magnitude.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_shift_right is
  generic (
    -- Bits of the magnitude.
    WIDTH  : positive;
    -- Bits of the distance.
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
    in_distance   : in  unsigned(LEVELS-1 downto 0);
    in_rest       : in  std_logic_vector(REST-1 downto 0);

    -- High stages_for(LEVELS) cycles after in_valid.
    out_valid     : out std_logic;
    out_magnitude : out unsigned(WIDTH-1 downto 0);
    out_rest      : out std_logic_vector(REST-1 downto 0)
  );
end entity firm_float_shift_right;

architecture rtl of firm_float_shift_right is

  constant STAGES : positive := stages_for(LEVELS);

  type magnitudes_t is array (natural range <>) of unsigned(WIDTH-1 downto 0);
  type distances_t is array (natural range <>) of unsigned(LEVELS-1 downto 0);
  type rests_t is array (natural range <>) of std_logic_vector(REST-1 downto 0);

  -- Index 0 is the input.
  signal valids     : std_logic_vector(STAGES downto 0);
  signal magnitudes : magnitudes_t(STAGES downto 0);
  signal distances  : distances_t(STAGES downto 0);
  signal rests      : rests_t(STAGES downto 0);

begin

  valids(0)     <= in_valid;
  magnitudes(0) <= in_magnitude;
  distances(0)  <= in_distance;
  rests(0)      <= in_rest;

  out_valid     <= valids(STAGES);
  out_magnitude <= magnitudes(STAGES);
  out_rest      <= rests(STAGES);

  each_stage : for stage in 0 to STAGES-1 generate

    move : process (clk)
      variable magnitude : unsigned(WIDTH-1 downto 0);
    begin
      if rising_edge(clk) then
        if advance = '1' then
          magnitude := magnitudes(stage);
          for level in 2*stage to 2*stage+1 loop
            if level < LEVELS then
              if distances(stage)(level) = '1' then
                magnitude := moved_right(magnitude, 2**level);
              end if;
            end if;
          end loop;
          valids(stage+1)     <= valids(stage);
          magnitudes(stage+1) <= magnitude;
          distances(stage+1)  <= distances(stage);
          rests(stage+1)      <= rests(stage);
        end if;
        if rst_n = '0' then
          valids(stage+1) <= '0';
        end if;
      end if;
    end process move;

  end generate each_stage;

end architecture rtl;
