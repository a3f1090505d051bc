-- SPDX-License-Identifier: Apache-2.0
-- Least recently used for few requesters: of those that request, it grants the one whose last task ended the longest
-- time ago. A matrix of one bit per pair records which of the two has waited longer. All pairs are compared in one
-- cycle, so the next task is chosen in the cycle of the last beat. The area grows with the square of the requesters.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_age_matrix is
  generic (
    REQUESTERS : integer := 2
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    request : in std_logic_vector(REQUESTERS-1 downto 0);
    beat    : in std_logic;  -- a beat of the granted requester is taken in this cycle
    last    : in std_logic;  -- and is its task's last; only valid with `beat`

    grant_valid  : out std_logic;
    grant_select : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0)
  );
end entity firm_sched_age_matrix;

architecture rtl of firm_sched_age_matrix is

  subtype row_t is std_logic_vector(REQUESTERS-1 downto 0);
  type matrix_t is array (0 to REQUESTERS-1) of row_t;

  -- Bit j of row i: i has waited longer than j. Only those with i < j are registers; the others are their opposites.
  -- Their bits of longer_r are constant, since a netlist lacks signals without a value.
  signal longer   : matrix_t;
  signal longer_r : matrix_t;

  signal spent    : row_t;  -- the requester whose task ends in this cycle; its request belongs to the last beat
  signal eligible : row_t;
  signal chosen   : row_t;
  signal goes_on  : std_logic;

  signal grant_valid_r  : std_logic;
  signal grant_select_r : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
  signal started_r      : std_logic;  -- the granted task has had a beat and needs more

begin

  spent    <= decode(grant_select_r, beat and last, REQUESTERS);
  eligible <= request and not spent;
  goes_on  <= (started_r or beat) and not (beat and last);

  rows : for i in 0 to REQUESTERS-1 generate
    columns : for j in 0 to REQUESTERS-1 generate
      register_of_pair : if i < j generate
        longer(i)(j) <= longer_r(i)(j);

        note_use : process (clk)
        begin
          if rising_edge(clk) then
            -- After reset the lower index has waited longer.
            if rst_n = '0' or spent(j) = '1' then
              longer_r(i)(j) <= '1';
            elsif spent(i) = '1' then
              longer_r(i)(j) <= '0';
            end if;
          end if;
        end process note_use;
      end generate register_of_pair;

      opposite : if i > j generate
        longer(i)(j) <= not longer_r(j)(i);
      end generate opposite;

      oneself : if i = j generate
        longer(i)(j) <= '1';
      end generate oneself;

      no_register : if i >= j generate
        longer_r(i)(j) <= '0';
      end generate no_register;
    end generate columns;

    chosen(i) <= eligible(i) and not any_of(eligible and not longer(i));
  end generate rows;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      started_r <= goes_on;
      if goes_on = '0' and any_of(eligible) = '1' then
        grant_valid_r  <= '1';
        grant_select_r <= index_of(chosen);
      end if;
      if rst_n = '0' then
        started_r      <= '0';
        grant_valid_r  <= '0';
        grant_select_r <= (others => '0');
      end if;
    end if;
  end process choose;

  grant_valid  <= grant_valid_r;
  grant_select <= grant_select_r;

end architecture rtl;
