-- SPDX-License-Identifier: Apache-2.0
-- Random gates for handshakes: the bench connects `valid` and `ready` of handshake k while `is_open(k)` is high. A gate
-- stays open from the cycle in which it showed a `valid` until the transfer, so no valid is withdrawn. The entity also
-- checks that the source does not withdraw it. Simulation only.
library ieee;
use ieee.std_logic_1164.all;

entity firm_sim_gates is
  generic (
    COUNT : integer := 1;
    SEED  : integer := 1;
    -- The chance that a gate is closed in a cycle with `valid`; 0 keeps all open.
    STALL_PERCENT : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Of the source, and of the sink.
    valid : in std_logic_vector(COUNT-1 downto 0);
    ready : in std_logic_vector(COUNT-1 downto 0);

    is_open : out std_logic_vector(COUNT-1 downto 0)
  );
end entity firm_sim_gates;

architecture simulation of firm_sim_gates is

  signal is_open_r : std_logic_vector(COUNT-1 downto 0) := (others => '1');

  -- The generator `x := 75 x mod 65537` has a period of 65536.
  constant MODULUS : positive := 65537;
  constant FACTOR  : positive := 75;

begin

  assert SEED >= 1
    report "firm_sim_gates: SEED is " & integer'image(SEED) & "; legal: 1 or more"
    severity failure;
  assert STALL_PERCENT >= 0 and STALL_PERCENT <= 99
    report "firm_sim_gates: STALL_PERCENT is " & integer'image(STALL_PERCENT) & "; legal: 0 to 99"
    severity failure;

  open_and_close : process (clk)
    variable random     : positive range 1 to MODULUS-1 := 1 + SEED mod (MODULUS-1);
    variable is_waiting : std_logic_vector(COUNT-1 downto 0) := (others => '0');
    variable is_asked   : boolean;
  begin
    if rising_edge(clk) then
      for gate in valid'range loop
        if rst_n = '0' then
          is_waiting(gate) := '0';
        else
          assert valid(gate) = '0' or valid(gate) = '1'
            report "firm_sim_gates: valid(" & integer'image(gate) & ") is " & std_logic'image(valid(gate))
            severity failure;
          assert is_waiting(gate) = '0' or valid(gate) = '1'
            report "firm_sim_gates: valid(" & integer'image(gate) & ") falls before ready rises"
            severity failure;
          is_waiting(gate) := valid(gate) and not (is_open_r(gate) and ready(gate));
        end if;
        -- A gate without `valid` keeps its state: drawing for hundreds of them would only slow the simulation down.
        is_asked := rst_n = '0' or valid(gate) = '1';
        if STALL_PERCENT > 0 and is_asked and (is_open_r(gate) = '0' or is_waiting(gate) = '0') then
          random          := FACTOR * random mod MODULUS;
          is_open_r(gate) <= '1';
          if 100 * (random - 1) < STALL_PERCENT * (MODULUS - 1) then
            is_open_r(gate) <= '0';
          end if;
        end if;
      end loop;
    end if;
  end process open_and_close;

  is_open <= is_open_r;

end architecture simulation;
