-- SPDX-License-Identifier: Apache-2.0
-- Records when each requester completed its last task, counted in completions: the keys of "least recently used".
--
-- The count wraps around, so stamps must not grow too old. A sweep renews those that are older than
-- a quarter of the range; the count advances at most four times per step of the sweep. Requesters that were idle for so
-- long have no order among each other, but go before all others. The memory is used once per cycle: a completion has
-- priority, then a sweep that is due, then a read. A step of the sweep reads a stamp in one cycle and writes it, if
-- necessary, in a later one, which keeps the path through the memory short. A completion arrives late, and is recorded
-- in the next cycle; no task of its requester can be read before. The column of a read arrives late: each column has a
-- memory, and the read's column only selects among their words, while that of the sweep selects for itself.
-- A requester without a stamp since reset uses its index: lower ones count as less recently used. Marks record which
-- requesters have stamps, in rows like those of firm_sched_arrivals. After reset they are cleared, one row per cycle,
-- while no task arrives.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_stamps is
  generic (
    REQUESTERS : integer := 2;
    STAMP_BITS : positive  -- those of an index and 5 more
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    completed    : in std_logic;
    completed_id : in std_logic_vector(index_bits(REQUESTERS)-1 downto 0);

    read        : in  std_logic;
    read_id     : in  std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
    -- The place of the same in firm_sched_arrivals: its row, and its column as the only '1'.
    read_row    : in  std_logic_vector(row_bits_of(REQUESTERS)-1 downto 0);
    read_column : in  std_logic_vector(2**column_bits_of(REQUESTERS)-1 downto 0);
    read_ready  : out std_logic;  -- `stamp` is that of `read_id`
    stamp       : out std_logic_vector(STAMP_BITS-1 downto 0)
  );
end entity firm_sched_stamps;

architecture rtl of firm_sched_stamps is

  constant COLUMN_BITS : positive := column_bits_of(REQUESTERS);
  constant ROW_BITS    : positive := row_bits_of(REQUESTERS);
  constant ID_BITS     : positive := ROW_BITS + COLUMN_BITS;  -- those of an index, or one more for two requesters
  constant COLUMNS     : positive := 2**COLUMN_BITS;
  subtype id_t is std_logic_vector(ID_BITS-1 downto 0);
  subtype columns_t is std_logic_vector(COLUMNS-1 downto 0);

  constant QUARTER : unsigned(STAMP_BITS-1 downto 0) := to_unsigned(2**(STAMP_BITS-2), STAMP_BITS);

  signal completed_r    : std_logic;
  signal completed_id_r : std_logic_vector(index_bits(REQUESTERS)-1 downto 0);

  signal count_r : unsigned(STAMP_BITS-1 downto 0);
  signal sweep_r : unsigned(ID_BITS downto 0);     -- the highest bit: all marks are cleared
  signal swept_r : std_logic_vector(STAMP_BITS-1 downto 0);  -- the sweep's stamp, once read
  signal known_r : std_logic;
  signal steps_r : unsigned(2 downto 0);           -- of the count since the last one of the sweep, at most four
  signal due     : std_logic;

  signal clearing      : std_logic;
  signal reads         : std_logic;
  signal sweeps        : std_logic;
  signal write_address : id_t;
  signal write_row     : std_logic_vector(ROW_BITS-1 downto 0);
  signal write_column  : std_logic_vector(COLUMN_BITS-1 downto 0);
  signal stamp_row     : std_logic_vector(ROW_BITS-1 downto 0);
  signal words         : std_logic_vector(COLUMNS*STAMP_BITS-1 downto 0);  -- of the row of the read, or of the sweep
  signal read_word     : std_logic_vector(STAMP_BITS-1 downto 0);
  signal sweep_word    : std_logic_vector(STAMP_BITS-1 downto 0);
  signal write_word    : std_logic_vector(STAMP_BITS-1 downto 0);
  signal write_enable  : std_logic;
  signal write_columns : columns_t;
  signal marks         : columns_t;  -- of the read's row
  signal old_marks     : columns_t;  -- of the row of a completion, or of the sweep
  signal new_marks     : columns_t;
  signal write_marks   : std_logic;
  signal is_marked     : std_logic;
  signal sweep_marked  : std_logic_vector(0 downto 0);
  signal age           : unsigned(STAMP_BITS-1 downto 0);  -- of the sweep's stamp
  signal is_old        : std_logic;
  signal moves         : std_logic;  -- the sweep moves to the next requester

begin

  hold_completion : process (clk)
  begin
    if rising_edge(clk) then
      completed_r    <= completed and rst_n;
      completed_id_r <= completed_id;
    end if;
  end process hold_completion;

  clearing <= not sweep_r(ID_BITS);
  due      <= steps_r(2);
  reads    <= read and not (completed_r or due);
  sweeps   <= not (completed_r or reads);

  write_address <= std_logic_vector(resize(unsigned(completed_id_r), ID_BITS)) when completed_r = '1' else
                   std_logic_vector(sweep_r(ID_BITS-1 downto 0));
  write_row     <= write_address(ID_BITS-1 downto COLUMN_BITS);
  write_column  <= write_address(COLUMN_BITS-1 downto 0);
  -- A word that is read together with a completion is not used.
  stamp_row     <= read_row when read = '1' and due = '0' else
                   std_logic_vector(sweep_r(ID_BITS-1 downto COLUMN_BITS));

  write_columns <= decode(write_column, write_enable, COLUMNS);

  stamps : for column in columns_t'range generate
    u_stamps : entity firm.firm_sched_ram_2
      generic map (
        ADDRESS_BITS => ROW_BITS,
        WORD_BITS    => STAMP_BITS
      )
      port map (
        clk          => clk,
        address      => write_row,
        read_word    => open,
        write_enable => write_columns(column),
        write_word   => write_word,
        address_2    => stamp_row,
        read_word_2  => words((column+1)*STAMP_BITS-1 downto column*STAMP_BITS)
      );
  end generate stamps;

  u_sweep_word : entity firm.firm_axis_select
    generic map (
      WORDS => COLUMNS,
      WIDTH => STAMP_BITS
    )
    port map (
      words_in => words,
      index    => write_column,
      word     => sweep_word
    );

  new_marks   <= old_marks or decode(write_column, '1', COLUMNS) when clearing = '0' else (others => '0');
  write_marks <= write_enable or clearing;

  u_marks : entity firm.firm_sched_ram_2
    generic map (
      ADDRESS_BITS => ROW_BITS,
      WORD_BITS    => COLUMNS
    )
    port map (
      clk          => clk,
      address      => write_row,
      read_word    => old_marks,
      write_enable => write_marks,
      write_word   => new_marks,
      address_2    => read_row,
      read_word_2  => marks
    );

  is_marked <= any_of(marks and read_column);
  read_word <= word_of(read_column, words);

  u_sweep_marked : entity firm.firm_axis_select
    generic map (
      WORDS => COLUMNS,
      WIDTH => 1
    )
    port map (
      words_in => old_marks,
      index    => write_column,
      word     => sweep_marked
    );

  age    <= count_r - unsigned(swept_r);
  is_old <= age(STAMP_BITS-1) or age(STAMP_BITS-2);
  moves  <= known_r and (sweeps or not is_old);

  write_enable <= completed_r or (sweeps and known_r and is_old);
  write_word   <= std_logic_vector(count_r) when completed_r = '1' else std_logic_vector(count_r - QUARTER);

  count : process (clk)
    variable steps : unsigned(2 downto 0);
  begin
    if rising_edge(clk) then
      steps := steps_r;
      if moves = '1' then
        steps := (others => '0');
      end if;
      if completed_r = '1' and due = '0' then
        steps   := steps + 1;
        count_r <= count_r + 1;
      end if;
      steps_r <= steps;
      if rst_n = '0' then
        count_r <= to_unsigned(2**ID_BITS, STAMP_BITS);
        steps_r <= (others => '0');
      end if;
    end if;
  end process count;

  sweep : process (clk)
  begin
    if rising_edge(clk) then
      if clearing = '1' then
        sweep_r <= sweep_r + COLUMNS;
      elsif moves = '1' then
        sweep_r          <= sweep_r + 1;
        sweep_r(ID_BITS) <= '1';
      end if;
      if known_r = '0' then
        swept_r <= sweep_word;
        if sweep_marked(0) = '0' then
          swept_r <= std_logic_vector(resize(sweep_r(ID_BITS-1 downto 0), STAMP_BITS));
        end if;
      end if;
      -- A stamp that was read is outdated if its requester completes a task.
      known_r <= not clearing and (sweeps or known_r) and not moves;
      if completed_r = '1' and unsigned(completed_id_r) = sweep_r(ID_BITS-1 downto 0) then
        known_r <= '0';
      end if;
      if rst_n = '0' then
        sweep_r <= (others => '0');
        known_r <= '0';
      end if;
    end if;
  end process sweep;

  read_ready <= reads;
  stamp      <= read_word when is_marked = '1' else std_logic_vector(resize(unsigned(read_id), STAMP_BITS));

end architecture rtl;
