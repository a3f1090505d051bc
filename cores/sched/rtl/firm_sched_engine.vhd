-- SPDX-License-Identifier: Apache-2.0
-- The scheduler of the policies that keep their tasks in a priority queue: the smallest key goes first.
--
--   request -> arrivals -> B, a task with its key -> queue -> current, the task that has the grant
-- A task's key is its deadline (EDF), its deadline minus its transfer time, which is its latest start (LST), or the
-- stamp of its requester's last completion (LRU). The slack of all tasks except the sending one shrinks by one per
-- cycle. Instead of changing all other keys, the key of the sending task grows by one per beat.
-- When a task finishes, the next one is the queue's root; if the queue is empty, B; otherwise an arriving task. Without
-- a task, the grant stays parked: its requester may begin a task before the task is accepted. Such a task has no key
-- yet, and keeps the grant until it has one. While the queue refills its root, B or an arriving task goes first if the
-- root can preempt it after a beat; otherwise there is no grant.
-- A task with a smaller key (EDF, LST) takes the grant; the preempted one goes back into the queue through B.
-- `beat` and `last` pass through the Manager's multiplexer and arrive late. Their effects are therefore prepared for
-- each case; they only select, for keys a cycle later.
-- Keys are compared as numbers that wrap around. They must stay less than half their range apart for any behaviour of
-- the host. Time therefore stops while the key of the current task or of the root is overdue.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;
use firm.firm_sched_queue_pkg.all;

entity firm_sched_engine is
  generic (
    REQUESTERS   : integer  := 2;
    POLICY       : policy_t := LRU;        -- or EDF_RESOURCES, EDF_LATENCY, LST
    -- Added to the time at which a task leaves the arrivals, gives its key; not for LRU.
    OFFSETS      : times_t  := IMPLICIT;
    TIME_BITS    : integer  := 16;
    SHORTEST_RUN : integer  := 1
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    request : in std_logic_vector(REQUESTERS-1 downto 0);
    beat    : in std_logic;  -- a beat of the granted requester is taken in this cycle
    last    : in std_logic;  -- and is its task's last; read with `beat` only

    grant_valid  : out std_logic;
    grant_select : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0)
  );
end entity firm_sched_engine;

architecture rtl of firm_sched_engine is

  constant ID_BITS : positive := index_bits(REQUESTERS);
  -- With 5 bits more than an index, stamps are sparse enough for the sweep of firm_sched_stamps.
  constant STAMP_BITS : positive := ID_BITS + 5;
  constant HAS_STAMPS : boolean  := POLICY = LRU;
  constant IS_SORTED  : boolean  := POLICY = EDF_LATENCY;
  -- Where paths are long, the task in B is selected in the next cycle, which needs a register for each candidate. But
  -- without segments, the sorted queue compares B with all items, and the selection would be repeated in each.
  constant B_IS_SELECTED_LATER : boolean := REQUESTERS > 2 * SEGMENT_ITEMS or (REQUESTERS > 32 and not IS_SORTED);

  function bits_of_key return positive is
  begin
    if HAS_STAMPS then
      return STAMP_BITS;
    end if;
    return max(TIME_BITS, 3);
  end function bits_of_key;

  constant KEY_BITS : positive := bits_of_key;
  subtype id_t is std_logic_vector(ID_BITS-1 downto 0);
  subtype key_t is std_logic_vector(KEY_BITS-1 downto 0);

  -- Selects among the values prepared for a cycle without a beat, with a beat before its task's last, and with the
  -- last.
  function of_case(has_beat, is_last, paused, sent, ended : std_logic) return std_logic is
  begin
    if has_beat = '0' then
      return paused;
    elsif is_last = '0' then
      return sent;
    end if;
    return ended;
  end function of_case;

  -- The first task of the arrivals, A.
  signal a_valid    : std_logic;
  signal a_id       : id_t;
  signal a_row      : std_logic_vector(row_bits_of(REQUESTERS)-1 downto 0);
  signal a_column   : std_logic_vector(2**column_bits_of(REQUESTERS)-1 downto 0);
  signal a_key      : key_t;
  signal a_is_own   : std_logic;  -- of the requester that has the grant
  signal a_leaves   : std_logic;
  signal key_ready  : std_logic;

  -- B is the arrived task or the preempted one.
  signal b_valid_r  : std_logic;
  signal b_id       : id_t;
  signal b_key      : key_t;
  signal b_is_free  : std_logic;  -- is empty or leaves
  signal b_has_room : std_logic;  -- for a preempted task

  signal preempted_r   : std_logic;
  signal after_beat_r  : std_logic;  -- the preempted task sent a beat in its last cycle
  signal arrived_id_r  : id_t;
  signal arrived_key_r : key_t;
  signal left_id_r     : id_t;
  signal left_key_r    : key_t;      -- without a beat in the last cycle
  signal left_later_r  : key_t;      -- with a beat in it

  signal insert       : std_logic;
  signal insert_ready : std_logic;
  signal root_valid   : std_logic;
  signal root_id      : id_t;
  signal root_key     : key_t;
  signal first_valid  : std_logic;
  signal first_id     : id_t;
  signal first_key    : key_t;
  signal empty        : std_logic;

  signal grant_valid_r  : std_logic;
  signal grant_select_r : id_t;
  signal running_r      : std_logic;  -- the grant is a task's, not parked
  signal keyed_r        : std_logic;  -- and the task has a key
  signal key            : key_t;      -- the current task's key
  signal key_after_beat : key_t;      -- the same after a beat
  signal gets_key       : std_logic;  -- the current task gets its key

  -- Its candidates of the last cycle: after a choice, or of a continued task, with a beat or without.
  signal chose_r         : std_logic;
  signal beat_r          : std_logic;
  signal key_if_chosen_r : key_t;
  signal key_if_sent_r   : key_t;
  signal key_if_paused_r : key_t;

  signal finished        : std_logic;
  signal choose          : std_logic;  -- no task is entitled to the grant in the next cycle
  signal gives_way       : std_logic;  -- the queue yields to an item that is about to enter it
  signal may_take_b      : std_logic;
  signal may_take_a      : std_logic;
  signal next_id         : id_t;
  signal waiting_key     : key_t;
  signal next_key        : key_t;
  signal available       : std_logic;  -- there is a next task
  signal grant_moves     : std_logic;  -- the grant moves to it
  signal moves_if_paused : std_logic;
  signal given_if_paused : std_logic;  -- the choice finds a task
  signal given_if_ended  : std_logic;
  signal keyed_if_kept   : std_logic;
  signal pop             : std_logic;
  signal may_leave       : std_logic;
  signal may_preempt     : std_logic;  -- the root preempts the task if the task continues
  signal preempt         : std_logic;

  -- The effects on arriving tasks if the next grant is chosen, at the end of a task, and if the task continues.
  signal b_is_free_if_chosen : std_logic;
  signal b_is_free_if_kept   : std_logic;
  signal leaves_if_chosen    : std_logic;
  signal leaves_if_kept      : std_logic;
  signal enters_if_chosen    : std_logic;
  signal enters_if_kept      : std_logic;
  signal enters_if_ended     : std_logic;
  signal b_valid_if_kept     : std_logic;
  signal b_valid_if_chosen   : std_logic;
  signal b_valid_if_ended    : std_logic;

  signal advance : std_logic;  -- time advances

begin

  finished <= beat and last;

  -- Arriving tasks.

  u_arrivals : entity firm.firm_sched_arrivals
    generic map (
      REQUESTERS => REQUESTERS
    )
    port map (
      clk            => clk,
      rst_n          => rst_n,
      request        => request,
      valid          => a_valid,
      id             => a_id,
      leaves         => a_leaves,
      row            => a_row,
      column         => a_column,
      finished       => finished,
      finished_known => keyed_r,
      finished_id    => grant_select_r
    );

  a_is_own <= '1' when a_id = grant_select_r else '0';

  -- Keys.

  timed : if not HAS_STAMPS generate
    constant COLUMNS : positive := 2**column_bits_of(REQUESTERS);
    constant ROWS    : positive := 2**row_bits_of(REQUESTERS);
    subtype words_t is std_logic_vector(ROWS*COLUMNS*KEY_BITS-1 downto 0);

    function words_of_offsets return words_t is
      variable words : words_t;
    begin
      for requester in 0 to ROWS*COLUMNS-1 loop
        words((requester+1)*KEY_BITS-1 downto requester*KEY_BITS) :=
          std_logic_vector(to_signed(time_of(requester, OFFSETS), KEY_BITS));
      end loop;
      return words;
    end function words_of_offsets;

    constant OFFSET_WORDS : words_t := words_of_offsets;

    signal of_row : std_logic_vector(COLUMNS*KEY_BITS-1 downto 0);
    signal offset : key_t;

    signal time_r        : key_t;
    signal is_clearing   : std_logic;
    signal current_waits : std_logic;
    signal root_waits    : std_logic;
  begin
    -- The column arrives late, so it selects among the offsets of its row. Words of an array would become registers:
    -- Yosys moves the row's across them.
    u_of_row : entity firm.firm_axis_select
      generic map (
        WORDS => ROWS,
        WIDTH => COLUMNS*KEY_BITS
      )
      port map (
        words_in => OFFSET_WORDS,
        index    => a_row,
        word     => of_row
      );

    offset    <= word_of(a_column, of_row);
    a_key     <= std_logic_vector(unsigned(time_r) + unsigned(offset));
    key_ready <= '1';

    -- The heap after reset; B may wait for it.
    is_clearing   <= empty and not insert_ready;
    current_waits <= running_r and keyed_r and is_overdue(key, time_r);
    root_waits    <= root_valid and is_overdue(root_key, time_r);
    advance       <= not (is_clearing or current_waits or root_waits);

    count_time : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          time_r <= (others => '0');
        elsif advance = '1' then
          time_r <= std_logic_vector(unsigned(time_r) + 1);
        end if;
      end if;
    end process count_time;
  end generate timed;

  stamped : if HAS_STAMPS generate
    u_stamps : entity firm.firm_sched_stamps
      generic map (
        REQUESTERS => REQUESTERS,
        STAMP_BITS => STAMP_BITS
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        completed    => finished,
        completed_id => grant_select_r,
        read         => a_valid,
        read_id      => a_id,
        read_row     => a_row,
        read_column  => a_column,
        read_ready   => key_ready,
        stamp        => a_key
      );

    advance <= '0';
  end generate stamped;

  -- The queue.

  of_few_luts : if not IS_SORTED generate
    u_heap : entity firm.firm_sched_heap
      generic map (
        ITEMS    => max(REQUESTERS, 1),
        KEY_BITS => KEY_BITS
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        insert_valid => b_valid_r,
        insert_ready => insert_ready,
        insert       => insert,
        insert_id    => b_id,
        insert_key   => b_key,
        root_valid   => root_valid,
        root_id      => root_id,
        root_key     => root_key,
        first_valid  => first_valid,
        first_id     => first_id,
        first_key    => first_key,
        pop          => pop,
        empty        => empty
      );
  end generate of_few_luts;

  of_few_cycles : if IS_SORTED generate
    u_sorted : entity firm.firm_sched_sorted_queue
      generic map (
        ITEMS    => max(REQUESTERS, 1),
        KEY_BITS => KEY_BITS
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        insert_valid => b_valid_r,
        insert_ready => insert_ready,
        insert       => insert,
        insert_id    => b_id,
        insert_key   => b_key,
        root_valid   => root_valid,
        root_id      => root_id,
        root_key     => root_key,
        first_valid  => first_valid,
        first_id     => first_id,
        first_key    => first_key,
        pop          => pop,
        empty        => empty
      );
  end generate of_few_cycles;

  -- The next grant.

  b_has_room <= '1' when IS_SORTED else not b_valid_r;

  choose          <= of_case(beat, last, not running_r, '0', '1');
  moves_if_paused <= may_preempt or not running_r;
  pop             <= of_case(beat, last, moves_if_paused and first_valid, may_preempt and first_valid, first_valid);

  may_take_b <= gives_way and b_valid_r;
  may_take_a <= gives_way and a_valid and not b_valid_r;

  next_id  <= first_id when first_valid = '1' else
              b_id when b_valid_r = '1' else
              a_id;
  -- The key of A is the last to arrive.
  waiting_key <= first_key when first_valid = '1' else b_key;
  next_key    <= waiting_key when (first_valid or b_valid_r) = '1' else a_key;
  available   <= first_valid or may_take_b or may_take_a;

  given_if_paused <= available and not running_r;
  -- The task that finishes may be first of the arrivals.
  given_if_ended  <= first_valid or may_take_b or (may_take_a and not a_is_own);
  -- Where the root preempts, there is a next task.
  grant_moves     <= of_case(beat, last, may_preempt or given_if_paused, may_preempt, given_if_ended);

  preemptive : if not HAS_STAMPS generate
    signal root_is_before : std_logic;
  begin
    root_is_before <= root_valid and is_before(root_key, key);
    -- A possibly wrong task is better than none, since the right one preempts it after a beat.
    gives_way      <= not first_valid when SHORTEST_RUN <= 1 else empty;
    may_preempt    <= running_r and keyed_r and root_is_before and b_has_room and may_leave;
    preempt        <= may_preempt and not finished;
  end generate preemptive;
  non_preemptive : if HAS_STAMPS generate
    gives_way   <= empty;
    may_preempt <= '0';
    preempt     <= '0';
  end generate non_preemptive;

  runs_of_one : if SHORTEST_RUN <= 1 generate
    may_leave <= '1';
  end generate runs_of_one;
  longer_runs : if SHORTEST_RUN > 1 generate
    signal beats_r : natural range 0 to SHORTEST_RUN;  -- of the run, saturating at the shortest run
    signal beats   : natural range 0 to SHORTEST_RUN;  -- including that of this cycle
    signal pauses  : std_logic;
  begin
    beats     <= beats_r + 1 when beat = '1' and beats_r < SHORTEST_RUN else beats_r;
    pauses    <= '0' when (request and decode(grant_select_r, '1', REQUESTERS)) /= (request'range => '0') else '1';
    may_leave <= '1' when beats = 0 or beats = SHORTEST_RUN or pauses = '1' else '0';

    count_beats : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' or choose = '1' or preempt = '1' then
          beats_r <= 0;
        else
          beats_r <= beats;
        end if;
      end if;
    end process count_beats;
  end generate longer_runs;

  -- A choice pops the heap if it can, which then accepts no item; B is taken only if the choice cannot pop.
  heap_inserts : if not IS_SORTED generate
    signal offers : std_logic;
  begin
    offers              <= b_valid_r and insert_ready;
    insert              <= of_case(beat, last, offers and running_r, offers, '0');
    b_is_free_if_chosen <= gives_way or not b_valid_r;
  end generate heap_inserts;
  sorted_queue_inserts : if IS_SORTED generate
    insert              <= b_valid_r and not (choose and gives_way);
    b_is_free_if_chosen <= '1';
  end generate sorted_queue_inserts;
  b_is_free_if_kept <= insert_ready or not b_valid_r;

  -- A task of the current requester stays in A until its key is the current one's, or until it finishes and is dropped.
  enters_if_chosen <= a_valid and key_ready and b_is_free_if_chosen and not may_take_a;
  enters_if_kept   <= a_valid and key_ready and b_is_free_if_kept and not (may_preempt or a_is_own);
  leaves_if_chosen <= may_take_a or enters_if_chosen;
  leaves_if_kept   <= gets_key or enters_if_kept;

  a_leaves <= of_case(beat, last, (leaves_if_kept and running_r) or (leaves_if_chosen and not running_r),
                      leaves_if_kept, leaves_if_chosen);
  -- A task that finishes is dropped.
  enters_if_ended <= enters_if_chosen and not a_is_own;

  b_is_free <= of_case(beat, last, (b_is_free_if_kept and running_r) or (b_is_free_if_chosen and not running_r),
                       b_is_free_if_kept, b_is_free_if_chosen);

  b_valid_if_kept   <= may_preempt or enters_if_kept or not b_is_free_if_kept;
  b_valid_if_chosen <= enters_if_chosen or not b_is_free_if_chosen;
  b_valid_if_ended  <= enters_if_ended or not b_is_free_if_chosen;

  hold_b : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        b_valid_r <= '0';
      else
        b_valid_r <= of_case(beat, last, (b_valid_if_kept and running_r) or (b_valid_if_chosen and not running_r),
                             b_valid_if_kept, b_valid_if_ended);
      end if;
    end if;
  end process hold_b;

  -- Without a task in B, its content is ignored. The entering task is known late in the cycle.
  hold_both : process (clk)
  begin
    if rising_edge(clk) then
      if b_is_free = '1' then
        preempted_r   <= preempt;
        after_beat_r  <= beat;
        arrived_id_r  <= a_id;
        arrived_key_r <= a_key;
        if not B_IS_SELECTED_LATER and preempt = '1' then
          arrived_id_r  <= grant_select_r;
          arrived_key_r <= key;
          if beat = '1' then
            arrived_key_r <= key_after_beat;
          end if;
        end if;
      end if;
      if b_has_room = '1' then
        left_id_r    <= grant_select_r;
        left_key_r   <= key;
        left_later_r <= key_after_beat;
      end if;
    end if;
  end process hold_both;

  b_id  <= left_id_r when B_IS_SELECTED_LATER and preempted_r = '1' else arrived_id_r;
  b_key <= arrived_key_r when not B_IS_SELECTED_LATER or preempted_r = '0' else
           left_later_r when after_beat_r = '1' else
           left_key_r;

  sends_own_time : if POLICY = LST generate
    signal step : unsigned(0 downto 0);
  begin
    step(0)        <= advance;
    key_after_beat <= std_logic_vector(unsigned(key) + step);
  end generate sends_own_time;
  keeps_key : if POLICY /= LST generate
    key_after_beat <= key;
  end generate keeps_key;

  gets_key <= a_valid and a_is_own;

  -- Without a task with a key, its content is ignored.
  hold_keys : process (clk)
  begin
    if rising_edge(clk) then
      chose_r         <= choose;
      beat_r          <= beat;
      key_if_chosen_r <= next_key;
      if keyed_r = '0' then
        key_if_sent_r   <= a_key;
        key_if_paused_r <= a_key;
      elsif may_preempt = '1' then
        key_if_sent_r   <= root_key;
        key_if_paused_r <= root_key;
      else
        key_if_sent_r   <= key_after_beat;
        key_if_paused_r <= key;
      end if;
    end if;
  end process hold_keys;

  key <= key_if_chosen_r when chose_r = '1' else
         key_if_sent_r when beat_r = '1' else
         key_if_paused_r;

  keyed_if_kept <= keyed_r or gets_key;

  grant : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        grant_valid_r  <= '0';
        grant_select_r <= (others => '0');
        running_r      <= '0';
        keyed_r        <= '0';
      else
        if grant_moves = '1' then
          grant_select_r <= next_id;
        end if;
        grant_valid_r <= of_case(beat, last, given_if_paused or (grant_valid_r and (running_r or empty)), grant_valid_r,
                                 given_if_ended or (grant_valid_r and empty));
        running_r     <= of_case(beat, last, given_if_paused or running_r, '1', given_if_ended);
        keyed_r       <= of_case(beat, last, given_if_paused or (keyed_if_kept and running_r), keyed_if_kept,
                                 given_if_ended);
      end if;
    end if;
  end process grant;

  grant_valid  <= grant_valid_r;
  grant_select <= grant_select_r;

end architecture rtl;
