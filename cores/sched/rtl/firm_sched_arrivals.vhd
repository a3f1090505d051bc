-- SPDX-License-Identifier: Apache-2.0
-- Detects new tasks: a task is accepted once and stays `known` until it finishes; accepted tasks leave one per cycle.
--
-- The requesters are arranged in rows. When no accepted task is left, the next row is read, and all its new requests
-- are accepted at once; they leave lowest index first. Rows take turns, so that lower indices that return again and
-- again cannot starve others. The next row with a request is found while the tasks of the last one leave, so the search
-- and the memories are not on one path. A lone request is accepted in the cycle after its arrival.
--
-- The set of known tasks is in distributed RAM, one row per word: a requester is known if its bits in `accepted` and
-- `finished` differ. Accepted rows and finished tasks can therefore write to separate memories.
-- A reset does not clear the RAM. After it, each row of `accepted` is set to that of `finished`, one row per cycle, so
-- that no requester is known.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_arrivals is
  generic (
    REQUESTERS : integer := 2
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    request : in std_logic_vector(REQUESTERS-1 downto 0);

    -- An accepted task, until it leaves.
    valid  : out std_logic;
    id     : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
    leaves : in  std_logic;
    -- Its place: the number of its row, and its column as the only '1'.
    row    : out std_logic_vector(row_bits_of(REQUESTERS)-1 downto 0);
    column : out std_logic_vector(2**column_bits_of(REQUESTERS)-1 downto 0);

    -- A requester finishes a task, known or not. A task that has not left is dropped.
    finished       : in std_logic;
    finished_known : in std_logic;  -- it is known and has left; only valid with `finished`
    finished_id    : in std_logic_vector(index_bits(REQUESTERS)-1 downto 0)
  );
end entity firm_sched_arrivals;

architecture rtl of firm_sched_arrivals is

  constant ID_BITS     : positive := index_bits(REQUESTERS);
  constant COLUMN_BITS : positive := column_bits_of(REQUESTERS);
  constant ROW_BITS    : positive := row_bits_of(REQUESTERS);
  constant COLUMNS     : positive := 2**COLUMN_BITS;
  constant ROWS        : positive := 2**ROW_BITS;
  subtype row_t is std_logic_vector(ROW_BITS-1 downto 0);
  subtype rows_t is std_logic_vector(ROWS-1 downto 0);
  subtype column_t is std_logic_vector(COLUMN_BITS-1 downto 0);
  subtype columns_t is std_logic_vector(COLUMNS-1 downto 0);
  subtype requesters_t is std_logic_vector(ROWS*COLUMNS-1 downto 0);

  signal clearing_r : std_logic;  -- the next row is to be made equal

  signal batch_r    : columns_t;  -- accepted, but not yet left
  signal row_r      : row_t;      -- their row, or the last one if all have left
  signal next_row_r : row_t;      -- the row to be read when all have left
  signal asked_r    : std_logic;  -- it had a request when it was found

  signal asks          : std_logic_vector(ROWS*COLUMNS-1 downto 0);
  signal rows_that_ask : rows_t;
  signal rows_above    : rows_t;
  signal found_row     : row_t;
  signal row_asks      : columns_t;  -- requests of the next row
  signal row_accepted  : columns_t;
  signal read_finished : columns_t;
  signal row_finished  : columns_t;
  signal row_known     : columns_t;
  signal row_new       : columns_t;
  signal new_accepted  : columns_t;
  signal load          : std_logic;
  signal accept_row    : std_logic;

  signal first    : column_t;   -- the requester that leaves next
  signal is_first : columns_t;
  signal next_id  : std_logic_vector(ROW_BITS+COLUMN_BITS-1 downto 0);

  signal padded_id       : std_logic_vector(ROW_BITS+COLUMN_BITS-1 downto 0);
  signal finished_row    : row_t;
  signal finished_column : columns_t;
  signal is_in_next      : std_logic;  -- the one that may finish is in the next row
  signal own_of_next     : columns_t;  -- its column, if it is
  signal own_of_batch    : columns_t;  -- the same, if it is in the row of the batch
  signal batch_or_row    : columns_t;  -- the batch without what happens in this cycle
  signal own_column      : columns_t;  -- of the one that may finish, if it is among these
  signal is_known        : std_logic;

  -- A task that has finished in the last cycle and was known is recorded in this one.
  signal finish_r         : std_logic;
  signal finished_id_r    : std_logic_vector(ROW_BITS+COLUMN_BITS-1 downto 0);
  signal recorded_row     : row_t;
  signal recorded_column  : columns_t;
  signal is_being_updated : std_logic;  -- the row that is read
  signal old_finished     : columns_t;
  signal new_finished     : columns_t;

begin

  requests : for requester in 0 to ROWS*COLUMNS-1 generate
    used : if requester < REQUESTERS generate
      asks(requester) <= request(requester);
    end generate used;
    unused : if requester >= REQUESTERS generate
      asks(requester) <= '0';
    end generate unused;
  end generate requests;

  -- The row after the next one: the lowest one above it, else the lowest.

  search_rows : for place in rows_t'range generate
    rows_that_ask(place) <= any_of(asks((place+1)*COLUMNS-1 downto place*COLUMNS));
  end generate search_rows;

  rows_above <= rows_that_ask and above(next_row_r, ROWS);
  found_row  <= first_of(rows_above) when any_of(rows_above) = '1' else first_of(rows_that_ask);

  find_row : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        clearing_r <= '1';
        next_row_r <= (others => '0');
        asked_r    <= '0';
      elsif clearing_r = '1' then
        clearing_r <= not are_ones(next_row_r);
        next_row_r <= std_logic_vector(unsigned(next_row_r) + 1);
      elsif load = '1' or asked_r = '0' then
        asked_r <= any_of(rows_that_ask);
        if any_of(rows_that_ask) = '1' then
          next_row_r <= found_row;
        end if;
      end if;
    end if;
  end process find_row;

  u_row_asks : entity firm.firm_axis_select
    generic map (
      WORDS => ROWS,
      WIDTH => COLUMNS
    )
    port map (
      words_in => asks,
      index    => next_row_r,
      word     => row_asks
    );

  -- Its columns. The request of the one that finishes is its last beat's, not a new task's. `finished` arrives late, so
  -- that it only keeps the task out of the batch. The memories count the task as accepted, and record its end a cycle
  -- later; a row that is read in that cycle already includes it.

  padded_id       <= std_logic_vector(resize(unsigned(finished_id), ROW_BITS+COLUMN_BITS));
  finished_row    <= padded_id(ROW_BITS+COLUMN_BITS-1 downto COLUMN_BITS);
  finished_column <= decode(padded_id(COLUMN_BITS-1 downto 0), '1', COLUMNS);
  is_in_next      <= '1' when next_row_r = finished_row else '0';
  own_of_next     <= gated(finished_column, is_in_next);
  own_of_batch    <= finished_column when row_r = finished_row else (others => '0');

  recorded_row     <= finished_id_r(ROW_BITS+COLUMN_BITS-1 downto COLUMN_BITS);
  recorded_column  <= decode(finished_id_r(COLUMN_BITS-1 downto 0), '1', COLUMNS);
  is_being_updated <= finish_r when next_row_r = recorded_row else '0';

  row_finished <= read_finished xor gated(recorded_column, is_being_updated);
  row_known    <= row_accepted xor row_finished;
  row_new      <= row_asks and not row_known;
  load         <= not (any_of(batch_r) or clearing_r);

  accept_row   <= load or clearing_r;
  new_accepted <= row_finished when clearing_r = '1' else row_finished xor (row_known or row_asks);

  u_accepted : entity firm.firm_sched_ram
    generic map (
      ADDRESS_BITS => ROW_BITS,
      WORD_BITS    => COLUMNS
    )
    port map (
      clk          => clk,
      address      => next_row_r,
      read_word    => row_accepted,
      write_enable => accept_row,
      write_word   => new_accepted
    );

  -- A finished requester is no longer known. A task that is dropped was known, too, or becomes known in this cycle.
  is_known     <= finished_known or any_of(batch_r and own_of_batch) or (load and is_in_next);
  new_finished <= old_finished xor recorded_column;

  hold_finished : process (clk)
  begin
    if rising_edge(clk) then
      finish_r      <= finished and is_known and rst_n;
      finished_id_r <= padded_id;
    end if;
  end process hold_finished;

  u_finished : entity firm.firm_sched_ram_2
    generic map (
      ADDRESS_BITS => ROW_BITS,
      WORD_BITS    => COLUMNS
    )
    port map (
      clk          => clk,
      address      => recorded_row,
      read_word    => old_finished,
      write_enable => finish_r,
      write_word   => new_finished,
      address_2    => next_row_r,
      read_word_2  => read_finished
    );

  -- Whether all have left, and which columns are the finished requester's, is known before the late inputs.
  batch_or_row <= row_new when load = '1' else batch_r;
  own_column   <= own_of_next when load = '1' else own_of_batch;

  hold_batch : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        batch_r <= (others => '0');
        row_r   <= (others => '1');
      else
        batch_r <= batch_or_row and not gated(is_first, leaves) and not gated(own_column, finished);
        if load = '1' then
          row_r <= next_row_r;
        end if;
      end if;
    end if;
  end process hold_batch;

  first    <= first_of(batch_r);
  is_first <= only_first_of(batch_r);

  next_id <= row_r & first;
  valid   <= any_of(batch_r);
  id      <= next_id(ID_BITS-1 downto 0);
  row     <= row_r;
  column  <= is_first;

end architecture rtl;
