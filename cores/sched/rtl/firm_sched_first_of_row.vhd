-- SPDX-License-Identifier: Apache-2.0
-- Finds the lowest requesting column of a row. No registers. In long rows, it is found in each of them at once, before
-- the row's number is known, and then selected; in short rows, that is not worth its cost.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_first_of_row is
  generic (
    ROWS    : positive;
    COLUMNS : positive
  );
  port (
    request : in  std_logic_vector(ROWS*COLUMNS-1 downto 0);  -- row 0 lowest
    row     : in  std_logic_vector(index_bits(ROWS)-1 downto 0);
    column  : out std_logic_vector(index_bits(COLUMNS)-1 downto 0)  -- any if the row has no request
  );
end entity firm_sched_first_of_row;

architecture rtl of firm_sched_first_of_row is

  constant COLUMN_BITS : positive := index_bits(COLUMNS);
  constant SHORT       : positive := 8;

begin

  short_rows : if COLUMNS <= SHORT generate
    signal of_row : std_logic_vector(COLUMNS-1 downto 0);
  begin
    u_of_row : entity firm.firm_axis_select
      generic map (
        WORDS => ROWS,
        WIDTH => COLUMNS
      )
      port map (
        words_in => request,
        index    => row,
        word     => of_row
      );

    column <= first_of(of_row);
  end generate short_rows;

  long_rows : if COLUMNS > SHORT generate
    signal firsts : std_logic_vector(ROWS*COLUMN_BITS-1 downto 0);
  begin
    each_row : for place in 0 to ROWS-1 generate
      firsts((place+1)*COLUMN_BITS-1 downto place*COLUMN_BITS) <=
        first_of(request((place+1)*COLUMNS-1 downto place*COLUMNS));
    end generate each_row;

    u_first : entity firm.firm_axis_select
      generic map (
        WORDS => ROWS,
        WIDTH => COLUMN_BITS
      )
      port map (
        words_in => firsts,
        index    => row,
        word     => column
      );
  end generate long_rows;

end architecture rtl;
