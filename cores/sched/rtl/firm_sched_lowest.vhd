-- SPDX-License-Identifier: Apache-2.0
-- Finds the lowest requesting index except a given one, and determines whether the given one also requests. No
-- registers.
-- Requesters are arranged in rows. The requests of the given one's row are read at once, since its number is known.
-- Meanwhile the first other row with a request is found, and its first request. The rows' numbers decide which of the
-- two is lower.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_sched_lowest is
  generic (
    REQUESTERS : integer := 2
  );
  port (
    request     : in  std_logic_vector(REQUESTERS-1 downto 0);
    index       : in  std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
    index_valid : in  std_logic;  -- otherwise no index is given, and `index` is 0
    asks        : out std_logic;  -- the given one requests
    found       : out std_logic;  -- another one requests
    is_before   : out std_logic;  -- one of a lower index requests
    lowest      : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0)  -- any if none is found
  );
end entity firm_sched_lowest;

architecture rtl of firm_sched_lowest is

  constant BITS : positive := index_bits(REQUESTERS);
  -- Up to this number, rows are not worth their cost.
  constant FEW : positive := 8;

  -- The word of a number, found from its highest bit on.
  function word_at(words, number : std_logic_vector) return std_logic_vector is
    constant HALF         : positive := words'length / 2;
    alias numbered        : std_logic_vector(2*HALF-1 downto 0) is words;
    alias number_bits     : std_logic_vector(number'length-1 downto 0) is number;
    variable half_of_word : std_logic_vector(HALF-1 downto 0);
  begin
    if number_bits(number_bits'high) = '1' then
      half_of_word := numbered(2*HALF-1 downto HALF);
    else
      half_of_word := numbered(HALF-1 downto 0);
    end if;
    if number_bits'length = 1 then
      return half_of_word;
    end if;
    return word_at(half_of_word, number_bits(number_bits'high-1 downto 0));
  end function word_at;

begin

  flat : if REQUESTERS >= 1 and REQUESTERS <= FEW generate
    signal is_index : std_logic_vector(REQUESTERS-1 downto 0);
    signal left     : std_logic_vector(REQUESTERS-1 downto 0);  -- without the given one
  begin
    is_index  <= decode(index, index_valid, REQUESTERS);
    left      <= request and not is_index;
    asks      <= any_of(request and is_index);
    found     <= any_of(left);
    is_before <= any_of(left and not above(index, REQUESTERS));
    lowest    <= first_of(left);
  end generate flat;

  in_rows : if REQUESTERS > FEW generate
    constant COLUMN_BITS : positive := BITS / 2;
    constant ROW_BITS    : positive := BITS - COLUMN_BITS;
    constant ROWS        : positive := 2**ROW_BITS;
    constant COLUMNS     : positive := 2**COLUMN_BITS;

    signal padded : std_logic_vector(2**BITS-1 downto 0);

    signal row       : std_logic_vector(ROW_BITS-1 downto 0);  -- of the given one
    signal column    : std_logic_vector(COLUMN_BITS-1 downto 0);
    signal is_row    : std_logic_vector(ROWS-1 downto 0);
    signal is_column : std_logic_vector(COLUMNS-1 downto 0);
    signal of_row    : std_logic_vector(COLUMNS-1 downto 0);

    signal left       : std_logic_vector(COLUMNS-1 downto 0);  -- the requests of its row without its own
    signal first_left : std_logic_vector(COLUMN_BITS-1 downto 0);

    signal row_asks   : std_logic_vector(ROWS-1 downto 0);  -- of the other rows
    signal first_row  : std_logic_vector(ROW_BITS-1 downto 0);
    signal of_first   : std_logic_vector(COLUMN_BITS-1 downto 0);
    signal row_before : std_logic;  -- a row of a lower number has requests
  begin
    pad : process (request)
    begin
      padded                        <= (others => '0');
      padded(REQUESTERS-1 downto 0) <= request;
    end process pad;

    row       <= index(BITS-1 downto COLUMN_BITS);
    column    <= index(COLUMN_BITS-1 downto 0);
    is_row    <= decode(row, '1', ROWS);
    is_column <= decode(column, index_valid, COLUMNS);

    each_row : for row_index in 0 to ROWS-1 generate
      row_asks(row_index) <= any_of(padded((row_index+1)*COLUMNS-1 downto row_index*COLUMNS)) and
                             not is_row(row_index);
    end generate each_row;

    u_of_first : entity firm.firm_sched_first_of_row
      generic map (
        ROWS    => ROWS,
        COLUMNS => COLUMNS
      )
      port map (
        request => padded,
        row     => first_row,
        column  => of_first
      );

    of_row     <= word_at(padded, row);
    left       <= of_row and not is_column;
    first_left <= first_of(left);
    first_row  <= first_of(row_asks);
    row_before <= any_of(row_asks and not above(row, ROWS));

    asks      <= any_of(of_row and is_column);
    found     <= any_of(left) or any_of(row_asks);
    is_before <= '1' when row_before = '1' or (any_of(left) = '1' and first_left < column) else '0';
    lowest    <= row & first_left when any_of(left) = '1' and row_before = '0' else first_row & of_first;
  end generate in_rows;

end architecture rtl;
