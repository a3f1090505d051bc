-- SPDX-License-Identifier: Apache-2.0
-- A queue of whole messages of fixed size: the fields of a message are one word of memory. The message at the sink is
-- in a register, so it is stable until it is taken, and it is never dropped. All outputs are registers, so the queue
-- also cuts paths and cycles of messages that wait for each other.
library ieee;
use ieee.std_logic_1164.all;

entity firm_message_queue is
  generic (
    -- The bits of a message's fields.
    FIELD_BITS : integer := 8;
    -- The most messages in the queue, the one at the sink included.
    MESSAGES : integer := 2;
    -- A message that finds the queue full is dropped, or takes the place of the oldest one that is not at the sink;
    -- with neither, it waits.
    DROP_NEWEST : boolean := false;
    DROP_OLDEST : boolean := false
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    source_fields : in  std_logic_vector(FIELD_BITS-1 downto 0);
    source_valid  : in  std_logic;
    source_ready  : out std_logic;

    sink_fields : out std_logic_vector(FIELD_BITS-1 downto 0);
    sink_valid  : out std_logic;
    sink_ready  : in  std_logic;

    dropped : out std_logic  -- a message in each such cycle
  );
end entity firm_message_queue;

architecture rtl of firm_message_queue is

  -- The words of memory; the register at the sink is the further place.
  function words_of(places : integer) return natural is
  begin
    if places < 2 then
      return 1;
    end if;
    return places - 1;
  end function words_of;

  constant WORDS : natural := words_of(MESSAGES);
  constant DROPS : boolean := DROP_NEWEST or DROP_OLDEST;

  type memory_t is array (natural range 0 to WORDS-1) of std_logic_vector(FIELD_BITS-1 downto 0);
  signal memory        : memory_t;
  signal write_index_r : natural range 0 to WORDS-1;
  signal read_index_r  : natural range 0 to WORDS-1;
  signal stored_r      : natural range 0 to WORDS;  -- messages in the memory
  signal fields_r      : std_logic_vector(FIELD_BITS-1 downto 0);
  signal valid_r       : std_logic;

  signal is_stored : std_logic;  -- the memory has a message
  signal is_full   : std_logic;
  signal enters    : std_logic;  -- a message arrives that is not dropped
  signal may_load  : std_logic;  -- the register at the sink is free after this cycle
  signal reads     : std_logic;
  signal writes    : std_logic;
  signal drops_i   : std_logic;  -- the oldest message of the memory makes room

  function next_index(index : natural) return natural is
  begin
    if index = WORDS-1 then
      return 0;
    end if;
    return index + 1;
  end function next_index;

begin

  assert FIELD_BITS >= 1
    report "firm_message_queue: FIELD_BITS is " & integer'image(FIELD_BITS) & "; legal: 1 or more"
    severity failure;
  assert MESSAGES >= 1
    report "firm_message_queue: MESSAGES is " & integer'image(MESSAGES) & "; legal: 1 or more"
    severity failure;
  assert not (DROP_NEWEST and DROP_OLDEST)
    report "firm_message_queue: DROP_NEWEST and DROP_OLDEST are both true; legal: one of them"
    severity failure;
  assert MESSAGES >= 2 or not DROP_OLDEST
    report "firm_message_queue: MESSAGES is " & integer'image(MESSAGES) & " with DROP_OLDEST; legal: 2 or more"
    severity failure;

  -- The memory has a message only while the register at the sink has one.
  is_stored <= '1' when stored_r /= 0 else '0';
  is_full   <= '1' when valid_r = '1' and stored_r = MESSAGES-1 else '0';

  source_ready <= '1' when DROPS else not is_full;
  enters       <= source_valid when DROP_OLDEST else source_valid and not is_full;

  may_load <= sink_ready or not valid_r;
  reads    <= may_load and is_stored;
  writes   <= enters and not (may_load and not is_stored);
  drops_i  <= writes and is_full and not reads when DROP_OLDEST else '0';

  dropped <= (source_valid and is_full) when DROP_NEWEST else drops_i;

  sink_fields <= fields_r;
  sink_valid  <= valid_r;

  store : process (clk)
  begin
    if rising_edge(clk) then
      if writes = '1' then
        memory(write_index_r) <= source_fields;
      end if;
      if reads = '1' then
        fields_r <= memory(read_index_r);
      elsif may_load = '1' then
        fields_r <= source_fields;
      end if;
    end if;
  end process store;

  count : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        write_index_r <= 0;
        read_index_r  <= 0;
        stored_r      <= 0;
        valid_r       <= '0';
      else
        if writes = '1' then
          write_index_r <= next_index(write_index_r);
        end if;
        if reads = '1' or drops_i = '1' then
          read_index_r <= next_index(read_index_r);
        end if;
        if writes = '1' and reads = '0' and drops_i = '0' then
          stored_r <= stored_r + 1;
        elsif writes = '0' and reads = '1' then
          stored_r <= stored_r - 1;
        end if;
        if may_load = '1' then
          valid_r <= is_stored or enters;
        end if;
      end if;
    end if;
  end process count;

end architecture rtl;
