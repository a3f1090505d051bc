-- SPDX-License-Identifier: Apache-2.0
-- Tests three gates: one without requests, one whose sink is always ready, one whose sink is sometimes ready. Checks
-- that a valid that passed a gate is held until it is taken, and counts the cycles in which each gate is closed.
library ieee;
use ieee.std_logic_1164.all;
use std.textio.all;
library firm;

entity firm_sim_gates_tb is
  generic (
    SEED          : integer := 1;
    STALL_PERCENT : integer := 30;
    -- The source of gate 1 withdraws its valid, which must be reported.
    WITHDRAWS : boolean := false
  );
end entity firm_sim_gates_tb;

architecture simulation of firm_sim_gates_tb is

  constant GATES  : positive := 3;
  constant CYCLES : positive := 10000;

  signal clk     : std_logic                          := '0';
  signal rst_n   : std_logic                          := '0';
  signal is_over : boolean                            := false;
  signal valid   : std_logic_vector(GATES-1 downto 0) := (others => '0');
  signal ready   : std_logic_vector(GATES-1 downto 0) := (others => '0');
  signal is_open : std_logic_vector(GATES-1 downto 0);

begin

  clk <= not clk after 5 ns when not is_over else '0';

  u_gates : entity firm.firm_sim_gates
    generic map (
      COUNT         => GATES,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT
    )
    port map (
      clk     => clk,
      rst_n   => rst_n,
      valid   => valid,
      ready   => ready,
      is_open => is_open
    );

  play : process (clk)
    type counts_t is array (valid'range) of natural;
    variable cycle       : natural                         := 0;
    variable closed      : counts_t                        := (others => 0);
    variable transfers   : counts_t                        := (others => 0);
    variable is_shown    : std_logic_vector(valid'range)   := (others => '0');
    variable output_line : line;
  begin
    if rising_edge(clk) then
      cycle := cycle + 1;
      for gate in valid'range loop
        assert is_shown(gate) = '0' or (valid(gate) and is_open(gate)) = '1'
          report "what gate " & integer'image(gate) & " let through is withdrawn" severity failure;
        is_shown(gate) := valid(gate) and is_open(gate) and not ready(gate);
        if is_open(gate) = '0' then
          closed(gate) := closed(gate) + 1;
        end if;
        if (valid(gate) and is_open(gate) and ready(gate)) = '1' then
          transfers(gate) := transfers(gate) + 1;
        end if;
      end loop;

      rst_n    <= '1';
      ready(1) <= '1';
      ready(2) <= '0';
      if cycle mod 5 = 0 then
        ready(2) <= '1';
      end if;
      if cycle > 2 then
        valid(1) <= '1';
        valid(2) <= '1';
        if WITHDRAWS and cycle mod 3 = 0 then
          valid(1) <= '0';
        end if;
      end if;

      if cycle = CYCLES then
        for gate in closed'low to closed'high loop
          write(output_line, "gate " & integer'image(gate) & " closed " & integer'image(closed(gate)));
          writeline(output, output_line);
        end loop;
        assert transfers(1) > CYCLES/20 and transfers(2) > CYCLES/40
          report "hardly anything was let through" severity failure;
        is_over <= true;
      end if;
    end if;
  end process play;

end architecture simulation;
