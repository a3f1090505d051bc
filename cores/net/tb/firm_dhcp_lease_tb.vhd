-- SPDX-License-Identifier: Apache-2.0
-- Tests consecutive leases. A row of the file has the seconds from the request to the answer, the seconds counted
-- then, and, for the lease, its renewal and its rebinding, whether it is given (0 or 1) and its four bytes. A row of
-- the results has the first seconds after the request at which the lease is to be renewed, is to be rebound, and ends;
-- 0 if this does not occur.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.existing;
use firm.firm_sim_pkg.print;
use firm.firm_sim_pkg.write_result;

entity firm_dhcp_lease_tb is
  generic (
    LEASE_FILE    : string  := "leases.txt";
    RESULT_FILE   : string  := "ends.txt";
    EXPECTED_FILE : string  := "";
    BURST         : integer := 5  -- seconds that pass before they are counted
  );
end entity firm_dhcp_lease_tb;

architecture simulation of firm_dhcp_lease_tb is

  constant MOST_CYCLES : positive := 100;  -- for an answer

  type firsts_t is array (2 downto 0) of natural;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal over  : boolean   := false;

  signal second     : std_logic := '0';
  signal is_asked   : std_logic := '0';
  signal told_valid : std_logic := '0';
  signal told_place : unsigned(3 downto 0) := (others => '0');
  signal told_byte  : std_logic_vector(7 downto 0) := (others => '0');
  signal begins     : std_logic := '0';
  signal counts     : std_logic := '0';
  signal is_done    : std_logic;
  signal is_held    : std_logic := '0';
  signal is_owed    : std_logic;
  signal flags      : std_logic_vector(2 downto 0);

begin

  clk <= not clk after 4 ns when not over else '0';

  u_lease : entity firm.firm_dhcp_lease
    port map (
      clk        => clk,
      rst_n      => rst_n,
      second     => second,
      is_asked   => is_asked,
      told_valid => told_valid,
      told_place => told_place,
      told_byte  => told_byte,
      begins     => begins,
      counts     => counts,
      is_done    => is_done,
      is_held    => is_held,
      is_owed    => is_owed,
      ends       => flags(2),
      rebinds    => flags(1),
      renews     => flags(0)
    );

  play : process
    file rows        : text open read_mode is LEASE_FILE;
    file results     : text open write_mode is RESULT_FILE;
    file expected    : text open read_mode is existing(EXPECTED_FILE);
    variable row     : line;
    variable before  : natural;
    variable seconds : natural;
    variable is_told : natural;
    variable value   : natural;
    variable owed    : natural;
    variable firsts  : firsts_t;

    procedure pulse(signal wire : out std_logic) is
    begin
      wire <= '1';
      wait until rising_edge(clk);
      wire <= '0';
      wait until rising_edge(clk);
    end procedure pulse;

    procedure wait_for(signal wire : in std_logic) is
    begin
      for cycle in 1 to MOST_CYCLES loop
        exit when wire = '1';
        wait until rising_edge(clk);
      end loop;
      assert wire = '1'
        report "no answer" severity failure;
    end procedure wait_for;

    procedure pass(count : in natural) is
    begin
      for number in 1 to count loop
        pulse(second);
      end loop;
    end procedure pass;

  begin
    pulse(is_asked);
    rst_n <= '1';
    while not endfile(rows) loop
      readline(rows, row);
      read(row, before);
      read(row, seconds);
      pulse(is_asked);
      pass(before);
      for number in 0 to 2 loop
        read(row, is_told);
        for place in 0 to 3 loop
          read(row, value);
          told_place <= to_unsigned(4*number + place, 4);
          told_byte  <= std_logic_vector(to_unsigned(value, 8));
          if is_told = 1 then
            pulse(told_valid);
          end if;
        end loop;
      end loop;
      pulse(begins);
      wait_for(is_done);
      is_held <= '1';
      firsts  := (others => 0);
      owed    := 0;
      for number in 1 to seconds loop
        if owed = 0 then
          owed := BURST;
          pass(owed);
        end if;
        owed := owed - 1;
        wait_for(is_owed);
        pulse(counts);
        wait_for(is_done);
        for flag in flags'range loop
          if flags(flag) = '1' and firsts(flag) = 0 then
            firsts(flag) := before + number;
          end if;
          assert (flags(flag) = '1') = (firsts(flag) /= 0)
            report "a lease is renewed" severity failure;
        end loop;
      end loop;
      assert owed /= 0 or is_owed = '0'
        report "a second is counted twice" severity failure;
      is_held <= '0';
      wait until rising_edge(clk);
      write(row, integer'image(firsts(0)) & ' ' & integer'image(firsts(1)) & ' ' & integer'image(firsts(2)));
      write_result(results, expected, EXPECTED_FILE, row);
    end loop;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are leases" severity failure;
    print("PASS");
    over <= true;
    wait;
  end process play;

end architecture simulation;
