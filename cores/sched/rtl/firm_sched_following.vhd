-- SPDX-License-Identifier: Apache-2.0
-- Finds the next requesting index after a given one, cyclically; the given one itself is the last. Also determines
-- whether the given one requests. No registers.
-- Requesters are arranged in rows. A later requester in the row of the given one goes first; otherwise, the lowest one
-- of the next row with a request, which may be the same row. Both are searched for in parallel.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_following is
  generic (
    REQUESTERS : integer := 2
  );
  port (
    request   : in  std_logic_vector(REQUESTERS-1 downto 0);
    index     : in  std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
    asks      : out std_logic;  -- the given one requests
    found     : out std_logic;
    following : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0)  -- any if none is found
  );
end entity firm_sched_following;

architecture rtl of firm_sched_following is

  constant BITS : positive := index_bits(REQUESTERS);
  -- Up to this number, rows are not worth their cost.
  constant FEW : positive := 8;

  -- The lowest one above `now_at`, otherwise the lowest one.
  function next_of(asking, now_at : std_logic_vector) return std_logic_vector is
    constant COUNT : positive := asking'length;
    variable later : std_logic_vector(COUNT-1 downto 0);
  begin
    later := asking and above(now_at, COUNT);
    if any_of(later) = '1' then
      return first_of(later);
    end if;
    return first_of(asking);
  end function next_of;

begin

  flat : if REQUESTERS >= 1 and REQUESTERS <= FEW generate
    asks      <= any_of(request and decode(index, '1', REQUESTERS));
    found     <= any_of(request);
    following <= next_of(request, index);
  end generate flat;

  in_rows : if REQUESTERS > FEW generate
    constant COLUMN_BITS : positive := BITS / 2;
    constant ROW_BITS    : positive := BITS - COLUMN_BITS;
    constant ROWS        : positive := 2**ROW_BITS;
    constant COLUMNS     : positive := 2**COLUMN_BITS;

    signal padded   : std_logic_vector(2**BITS-1 downto 0);
    signal row_asks : std_logic_vector(ROWS-1 downto 0);

    signal row    : std_logic_vector(ROW_BITS-1 downto 0);  -- of the given index
    signal column : std_logic_vector(COLUMN_BITS-1 downto 0);

    signal of_row    : std_logic_vector(COLUMNS-1 downto 0);  -- requests of its row, and those further on
    signal later     : std_logic_vector(COLUMNS-1 downto 0);
    signal next_row  : std_logic_vector(ROW_BITS-1 downto 0);
    signal of_next   : std_logic_vector(COLUMN_BITS-1 downto 0);
    signal is_in_row : std_logic;
  begin
    pad : process (request)
    begin
      padded                        <= (others => '0');
      padded(REQUESTERS-1 downto 0) <= request;
    end process pad;

    each_row : for row_index in 0 to ROWS-1 generate
      row_asks(row_index) <= any_of(padded((row_index+1)*COLUMNS-1 downto row_index*COLUMNS));
    end generate each_row;

    row    <= index(BITS-1 downto COLUMN_BITS);
    column <= index(COLUMN_BITS-1 downto 0);

    u_of_row : entity firm.firm_axis_select
      generic map (
        WORDS => ROWS,
        WIDTH => COLUMNS
      )
      port map (
        words_in => padded,
        index    => row,
        word     => of_row
      );

    u_of_next : entity firm.firm_sched_first_of_row
      generic map (
        ROWS    => ROWS,
        COLUMNS => COLUMNS
      )
      port map (
        request => padded,
        row     => next_row,
        column  => of_next
      );

    later     <= of_row and above(column, COLUMNS);
    asks      <= any_of(of_row and decode(column, '1', COLUMNS));
    is_in_row <= any_of(later);
    next_row  <= next_of(row_asks, row);
    found     <= any_of(row_asks);
    following <= row & first_of(later) when is_in_row = '1' else next_row & of_next;
  end generate in_rows;

end architecture rtl;
