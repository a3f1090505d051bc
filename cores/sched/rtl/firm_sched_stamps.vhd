-- SPDX-License-Identifier: Apache-2.0
-- When each requester completed its last task, counted in completions: the keys of "least recently used".
--
-- The count wraps around, so stamps must not grow too old. A sweep goes round and renews those that are older than
-- a quarter of the range; the count moves on at most four times a step of the sweep. Those that were idle for so
-- long keep no order among each other, but come before all that were not. The memory has one port: a completion
-- goes first, then a sweep that is due, then whoever reads.
-- After reset the sweep goes round once and writes each requester's index: the lower ones count as less recently
-- used.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_sched_stamps is
  generic (
    REQUESTERS : integer := 2;
    STAMP_BITS : positive);  -- those of an index and 5 more
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    initialised : out std_logic;

    completed    : in std_logic;
    completed_id : in std_logic_vector(index_bits(REQUESTERS)-1 downto 0);

    read       : in  std_logic;
    read_id    : in  std_logic_vector(index_bits(REQUESTERS)-1 downto 0);
    read_ready : out std_logic;  -- `stamp` is that of `read_id`
    stamp      : out std_logic_vector(STAMP_BITS-1 downto 0));
end entity firm_sched_stamps;

architecture rtl of firm_sched_stamps is

  constant ID_BITS : positive := index_bits(REQUESTERS);
  constant QUARTER : unsigned(STAMP_BITS-1 downto 0) := to_unsigned(2**(STAMP_BITS-2), STAMP_BITS);

  signal count_r : unsigned(STAMP_BITS-1 downto 0);
  signal sweep_r : unsigned(ID_BITS downto 0);     -- the highest bit: it has gone round
  signal steps_r : unsigned(1 downto 0);           -- of the count since the last one of the sweep
  signal due_r   : std_logic;                      -- those are four

  signal is_initial   : std_logic;
  signal reads        : std_logic;
  signal sweeps       : std_logic;
  signal age          : unsigned(STAMP_BITS-1 downto 0);
  signal address      : std_logic_vector(ID_BITS-1 downto 0);
  signal read_word    : std_logic_vector(STAMP_BITS-1 downto 0);
  signal write_word   : std_logic_vector(STAMP_BITS-1 downto 0);
  signal write_enable : std_logic;

begin

  is_initial <= not sweep_r(ID_BITS);
  reads      <= read and not (completed or due_r or is_initial);
  sweeps     <= not (completed or reads);

  address <= completed_id when completed = '1' else
             read_id when reads = '1' else
             std_logic_vector(sweep_r(ID_BITS-1 downto 0));

  u_stamps : entity firm.firm_sched_ram
    generic map (
      ADDRESS_BITS => ID_BITS,
      WORD_BITS    => STAMP_BITS)
    port map (
      clk          => clk,
      address      => address,
      read_word    => read_word,
      write_enable => write_enable,
      write_word   => write_word);

  age <= count_r - unsigned(read_word);

  choose_write : process (completed, sweeps, is_initial, age, count_r, sweep_r)
  begin
    write_enable <= completed;
    write_word   <= std_logic_vector(count_r);
    if sweeps = '1' then
      write_enable <= is_initial or age(STAMP_BITS-1) or age(STAMP_BITS-2);
      write_word   <= std_logic_vector(count_r - QUARTER);
      if is_initial = '1' then
        write_word <= std_logic_vector(resize(sweep_r, STAMP_BITS));
      end if;
    end if;
  end process choose_write;

  count_and_sweep : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        count_r <= to_unsigned(2**ID_BITS, STAMP_BITS);
        sweep_r <= (others => '0');
        steps_r <= (others => '0');
        due_r   <= '0';
      else
        if completed = '1' and due_r = '0' then
          count_r <= count_r + 1;
          steps_r <= steps_r + 1;
          if steps_r = 3 then
            due_r <= '1';
          end if;
        end if;
        if sweeps = '1' then
          sweep_r <= sweep_r + 1;
          if is_initial = '0' then
            sweep_r(ID_BITS) <= '1';
          end if;
          steps_r <= (others => '0');
          due_r   <= '0';
        end if;
      end if;
    end if;
  end process count_and_sweep;

  initialised <= not is_initial;
  read_ready  <= reads;
  stamp       <= read_word;

end architecture rtl;
