-- SPDX-License-Identifier: Apache-2.0
-- A synchroniser for simulation: the last change before an edge may be seen at this edge or the next, independently for
-- each bit, as a metastable register decides. A library uses it in place of robot:cdc:firm_cdc_sync.
-- Earlier changes have settled: as on wires, successive changes of bits are never seen in another order. The random
-- numbers derive from the instance's path and the time of its first input change: another phase gives other numbers.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;

entity firm_cdc_sync is
  generic (
    BITS   : integer := 1;
    STAGES : integer := 2
  );
  port (
    clk    : in  std_logic;
    level  : in  std_logic_vector(BITS-1 downto 0);
    synced : out std_logic_vector(BITS-1 downto 0)
  );
end entity firm_cdc_sync;

architecture simulation of firm_cdc_sync is

  constant HIGHEST_SEED : positive := 2147483398;

  signal stages_r : std_logic_vector(STAGES*BITS-1 downto 0);

  function hash(name : string) return positive is
    constant MODULUS : positive := 65521;
    variable value   : natural  := 1;
  begin
    for place in name'range loop
      value := (31 * value + character'pos(name(place))) mod MODULUS;
    end loop;
    return value + 1;
  end function hash;

  -- The part of a time below its nanoseconds.
  function femtoseconds(moment : time) return natural is
  begin
    return (moment - (moment / 1 ns) * 1 ns) / 1 fs;
  end function femtoseconds;

begin

  assert BITS >= 1
    report "firm_cdc_sync: BITS is " & integer'image(BITS) & "; legal: 1 or more"
    severity failure;
  assert STAGES >= 2
    report "firm_cdc_sync: STAGES is " & integer'image(STAGES) & "; legal: 2 or more"
    severity failure;

  pass_on : process (clk, level)
    variable random_1 : positive := hash(simulation'path_name);
    variable random_2 : positive := 1;
    variable current  : std_logic_vector(BITS-1 downto 0);
    variable before   : std_logic_vector(BITS-1 downto 0);  -- the last change
    variable is_new   : boolean := false;                   -- no edge since then
    variable sampled  : std_logic_vector(BITS-1 downto 0);
    variable draw     : real;
  begin
    if level'event then
      before  := current;
      current := level;
      is_new  := true;
      if random_2 = 1 and now > 0 ns then
        random_2 := 2 + (femtoseconds(now) + now / 1 ns) mod (HIGHEST_SEED - 2);
      end if;
    end if;
    if rising_edge(clk) then
      sampled := current;
      for place in 0 to BITS-1 loop
        if is_new and current(place) /= before(place) then
          uniform(random_1, random_2, draw);
          if draw < 0.5 then
            sampled(place) := before(place);
          end if;
        end if;
      end loop;
      is_new   := false;
      stages_r <= stages_r((STAGES-1)*BITS-1 downto 0) & sampled;
    end if;
  end process pass_on;

  synced <= stages_r(STAGES*BITS-1 downto (STAGES-1)*BITS);

end architecture simulation;
