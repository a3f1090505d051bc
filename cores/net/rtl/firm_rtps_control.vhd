-- SPDX-License-Identifier: Apache-2.0
-- The control of a node in fabric: firm_rtps_sequencer with its program, and the registers that the program accesses
-- outside the memory. fusesoc_firm.fabric.control has the addresses, and fusesoc_firm/fabric/ros2_node.seq the program.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_control is
  generic (
    ENDPOINTS     : integer := 2;  -- of the node, 1 to 24
    SOURCES       : integer := 8;  -- matched writers of peers, 1 to 64
    SINKS         : integer := 16; -- matched readers of peers, 1 to 128
    HAS_FRAGMENTS : boolean := false -- samples may be sent in fragments
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

    -- The memory of the program.
    program_enable  : out std_logic;
    program_address : out std_logic_vector(RTPS_CONTROL_BITS-1 downto 0);
    program_word    : in  std_logic_vector(35 downto 0);

    -- Of firm_rtps_inbox, firm_rtps_locators and firm_rtps_endpoint.
    take            : out std_logic;
    has_word        : in  std_logic;
    is_end          : in  std_logic;
    record_valid    : in  std_logic;
    record_address  : in  std_logic_vector(RECORD_BITS-1 downto 0);
    record_data     : in  std_logic_vector(7 downto 0);
    is_large        : in  std_logic;
    is_gone         : in  std_logic;
    has_metatraffic : in  std_logic;
    has_default     : in  std_logic;
    has_unicast     : in  std_logic;
    has_lease       : in  std_logic;
    is_known        : in  std_logic;
    is_reliable     : in  std_logic;
    is_transient    : in  std_logic;
    matches         : in  std_logic_vector(ENDPOINTS-1 downto 0);
    entity_id       : in  std_logic_vector(31 downto 0);

    -- Of firm_rtps_readers.
    source       : out std_logic_vector(5 downto 0);
    key_write    : out std_logic;
    note_write   : out std_logic;
    number_write : out std_logic;
    write_place  : out std_logic_vector(3 downto 0);
    write_data   : out std_logic_vector(7 downto 0);
    read_place   : out std_logic_vector(3 downto 0);
    number_byte  : in  std_logic_vector(7 downto 0);
    is_locked    : out std_logic;
    is_judging   : in  std_logic;
    has_early    : in  std_logic;
    early_source : in  std_logic_vector(5 downto 0);
    early_number : in  std_logic_vector(31 downto 0);
    takes_early  : out std_logic;

    -- Of firm_rtps_history.
    slot_valid  : out std_logic;
    slot_writer : out std_logic_vector(2 downto 0);
    has_sample  : in  std_logic;
    writer      : in  std_logic_vector(2 downto 0);
    is_done     : out std_logic;
    -- Of the selected sample, and of its fragment.
    looks        : out std_logic;
    chooses      : out std_logic;
    sample_bytes : in  unsigned(RTPS_SAMPLE_BITS-1 downto 0);
    is_long      : in  std_logic;
    is_last_part : in  std_logic;
    is_beyond    : in  std_logic;

    -- Of firm_rtps_sender; `slot_writer` is the writer whose packet is prepared.
    prepare_valid     : out std_logic;
    chosen_slot_valid : out std_logic;  -- the slot of the payload
    send_valid        : out std_logic;
    waits             : in  std_logic;
    is_started        : in  std_logic;
    is_new_long       : in  std_logic;

    -- To firm_packet_builder.
    build_field_valid   : out std_logic;
    build_field_bank    : out std_logic_vector(RTPS_BANK_BITS-1 downto 0);
    build_field_address : out std_logic_vector(6 downto 0);
    build_field_data    : out std_logic_vector(7 downto 0);

    -- Entries in use.
    peer_count   : out std_logic_vector(7 downto 0);
    source_count : out std_logic_vector(7 downto 0);
    sink_count   : out std_logic_vector(7 downto 0);
    -- Pulses: a table is full.
    is_peer_refused     : out std_logic;
    is_endpoint_refused : out std_logic
  );
end entity firm_rtps_control;

architecture rtl of firm_rtps_control is

  constant MOST_ENDPOINTS : positive := 24;
  -- The program is held while a packet leaves; milliseconds beyond this number are lost.
  constant TICK_BITS      : positive := 8;
  constant MOST_TICKS     : positive := 2**TICK_BITS-1;
  constant MOST_SOURCES   : positive := 64;
  constant MOST_SINKS     : positive := 128;

  -- Addresses outside the memory. Fields of the builder are at 0 to 127.
  subtype address_t is std_logic_vector(7 downto 0);
  constant AT_KEY       : std_logic_vector(7 downto 4) := x"8";
  constant AT_NUMBER    : std_logic_vector(7 downto 3) := "10010";
  constant AT_NOTE      : address_t := x"98";
  constant AT_SLOT      : address_t := x"99";  -- of the payload of the next packet
  constant AT_WRITER    : address_t := x"9a";
  constant AT_NEXT_SLOT : address_t := x"9b";  -- of this writer
  constant AT_START     : address_t := x"9c";
  constant AT_LOCK      : address_t := x"9d";
  constant AT_TAKEN     : address_t := x"9e";  -- bit 0: a tick, 1: the early sample, 2: the sample to send
  constant AT_REFUSED   : address_t := x"9f";  -- bit 0: a peer, 1: an endpoint
  constant AT_PEERS     : address_t := x"b4";
  constant AT_SOURCES   : address_t := x"b5";
  constant AT_SINKS     : address_t := x"b6";
  constant AT_BANK      : address_t := x"b7";  -- of the fields that are written
  constant AT_PREPARED  : address_t := x"b8";  -- the packet of this writer's next sample
  constant AT_LOOK      : address_t := x"b9";  -- the slot of the selected sample
  constant AT_FRAGMENT  : address_t := x"ba";  -- of this sample, from 0 on
  -- Readable words, from x"a0" on; of the last one, the bytes are the early sample's source, the writer of the sample
  -- to send, whether numbers are large, and facts about samples. They are followed by the size of the selected sample.
  constant WORD_OF_FACTS  : std_logic_vector(1 downto 0) := "00";
  constant WORD_OF_ENTITY : std_logic_vector(1 downto 0) := "01";
  constant WORD_OF_EARLY  : std_logic_vector(1 downto 0) := "10";

  signal conditions    : std_logic_vector(3 downto 0);
  signal index         : std_logic_vector(7 downto 0);
  signal coming        : std_logic;
  signal next_address  : std_logic_vector(7 downto 0);
  signal write_address : std_logic_vector(7 downto 0);
  signal data          : std_logic_vector(7 downto 0);
  signal read_address  : std_logic_vector(7 downto 0);
  signal read_data     : std_logic_vector(7 downto 0);
  signal hold          : std_logic;
  signal padded        : std_logic_vector(MOST_ENDPOINTS-1 downto 0);
  signal facts         : std_logic_vector(7 downto 0);
  signal sample_facts  : std_logic_vector(7 downto 0);
  signal word          : std_logic_vector(31 downto 0);

  -- The write, unless the sequencer is held.
  signal at_field_r   : std_logic;
  signal at_key_r     : std_logic;
  signal at_number_r  : std_logic;
  signal at_note_r    : std_logic;
  signal at_slot_r    : std_logic;
  signal at_writer_r  : std_logic;
  signal at_next_r    : std_logic;
  signal at_start_r   : std_logic;
  signal at_lock_r    : std_logic;
  signal at_taken_r   : std_logic;
  signal at_refused_r : std_logic;
  signal at_peers_r   : std_logic;
  signal at_sources_r : std_logic;
  signal at_sinks_r   : std_logic;
  signal at_bank_r    : std_logic;
  signal at_prepare_r : std_logic;
  signal at_look_r    : std_logic;
  signal at_part_r    : std_logic;
  signal builds_r     : std_logic;  -- one of the builder's, or of the payload's

  signal ticks_r   : unsigned(TICK_BITS-1 downto 0);  -- not yet processed by the program
  signal has_tick  : std_logic;
  signal work_r    : std_logic;                        -- an event is pending for the program
  signal ends_tick : std_logic;
  signal locked_r  : std_logic;
  signal bank_r    : std_logic_vector(RTPS_BANK_BITS-1 downto 0) := RTPS_OWN_BANK;
  signal writer_r  : std_logic_vector(2 downto 0) := (others => '0');
  signal peers_r   : std_logic_vector(7 downto 0);
  signal sources_r : std_logic_vector(7 downto 0);
  signal sinks_r   : std_logic_vector(7 downto 0);

  -- Whether a byte outside is written.
  function is_at(valid : std_logic; address, place : address_t) return std_logic is
  begin
    if address = place then
      return valid;
    end if;
    return '0';
  end function is_at;

begin

  assert ENDPOINTS >= 1 and ENDPOINTS <= MOST_ENDPOINTS
    report "firm_rtps_control: ENDPOINTS is " & integer'image(ENDPOINTS) & "; legal: 1 to "
           & integer'image(MOST_ENDPOINTS)
    severity failure;
  assert SOURCES >= 1 and SOURCES <= MOST_SOURCES
    report "firm_rtps_control: SOURCES is " & integer'image(SOURCES) & "; legal: 1 to " & integer'image(MOST_SOURCES)
    severity failure;
  assert SINKS >= 1 and SINKS <= MOST_SINKS
    report "firm_rtps_control: SINKS is " & integer'image(SINKS) & "; legal: 1 to " & integer'image(MOST_SINKS)
    severity failure;

  conditions <= work_r & has_sample & has_early & has_tick;

  u_sequencer : entity firm.firm_rtps_sequencer
    generic map (
      ENTRIES => SOURCES+SINKS
    )
    port map (
      clk                => clk,
      rst_n              => rst_n,
      program_enable     => program_enable,
      program_address    => program_address,
      program_word       => program_word,
      take               => take,
      has_word           => has_word,
      is_end             => is_end,
      record_valid       => record_valid,
      record_address     => record_address,
      record_data        => record_data,
      port_index         => index,
      port_next          => coming,
      port_next_address  => next_address,
      port_write_address => write_address,
      port_write_data    => data,
      port_read_address  => read_address,
      port_read_data     => read_data,
      hold               => hold,
      conditions         => conditions
    );

  -- The builder's fields, packets that are prepared and the payload stay until a packet has left, and no slot is given
  -- to a new sample before; numbers of samples stay while one is judged.
  hold <= (builds_r and waits) or (at_lock_r and data(0) and is_judging);

  find_place : process (clk)
  begin
    if rising_edge(clk) then
      if hold = '0' then
        at_field_r  <= coming and not next_address(7);
        at_key_r    <= '0';
        at_number_r <= '0';
        if next_address(7 downto 4) = AT_KEY then
          at_key_r <= coming;
        end if;
        if next_address(7 downto 3) = AT_NUMBER then
          at_number_r <= coming;
        end if;
        at_note_r    <= is_at(coming, next_address, AT_NOTE);
        at_slot_r    <= is_at(coming, next_address, AT_SLOT);
        at_writer_r  <= is_at(coming, next_address, AT_WRITER);
        at_next_r    <= is_at(coming, next_address, AT_NEXT_SLOT);
        at_start_r   <= is_at(coming, next_address, AT_START);
        at_lock_r    <= is_at(coming, next_address, AT_LOCK);
        at_taken_r   <= is_at(coming, next_address, AT_TAKEN);
        at_refused_r <= is_at(coming, next_address, AT_REFUSED);
        at_peers_r   <= is_at(coming, next_address, AT_PEERS);
        at_sources_r <= is_at(coming, next_address, AT_SOURCES);
        at_sinks_r   <= is_at(coming, next_address, AT_SINKS);
        at_bank_r    <= is_at(coming, next_address, AT_BANK);
        at_prepare_r <= is_at(coming, next_address, AT_PREPARED);
        at_look_r    <= is_at(coming, next_address, AT_LOOK);
        at_part_r    <= is_at(coming, next_address, AT_FRAGMENT);
        builds_r     <= coming and not next_address(7);
        if next_address = AT_SLOT or next_address = AT_NEXT_SLOT or next_address = AT_START
           or next_address = AT_PREPARED then
          builds_r <= coming;
        end if;
        if HAS_FRAGMENTS and (next_address = AT_LOOK or next_address = AT_FRAGMENT) then
          builds_r <= coming;
        end if;
      end if;
      if rst_n = '0' then
        at_field_r   <= '0';
        at_key_r     <= '0';
        at_number_r  <= '0';
        at_note_r    <= '0';
        at_slot_r    <= '0';
        at_writer_r  <= '0';
        at_next_r    <= '0';
        at_start_r   <= '0';
        at_lock_r    <= '0';
        at_taken_r   <= '0';
        at_refused_r <= '0';
        at_peers_r   <= '0';
        at_sources_r <= '0';
        at_sinks_r   <= '0';
        at_bank_r    <= '0';
        at_prepare_r <= '0';
        at_look_r    <= '0';
        at_part_r    <= '0';
        builds_r     <= '0';
      end if;
    end if;
  end process find_place;

  -- ------------------------------------------------------------------ what is written

  ends_tick <= at_taken_r and data(0);
  has_tick  <= '0' when ticks_r = 0 else '1';

  note : process (clk)
  begin
    if rising_edge(clk) then
      work_r <= has_word or has_sample or has_early or has_tick;
      if at_writer_r = '1' then
        writer_r <= data(2 downto 0);
      end if;
      if at_bank_r = '1' then
        bank_r <= data(RTPS_BANK_BITS-1 downto 0);
      end if;
      if at_peers_r = '1' then
        peers_r <= data;
      end if;
      if at_sources_r = '1' then
        sources_r <= data;
      end if;
      if at_sinks_r = '1' then
        sinks_r <= data;
      end if;
      if at_lock_r = '1' and hold = '0' then
        locked_r <= data(0);
      end if;
      if tick = '1' and ends_tick = '0' and ticks_r /= MOST_TICKS then
        ticks_r <= ticks_r + 1;
      elsif tick = '0' and ends_tick = '1' then
        ticks_r <= ticks_r - 1;
      end if;
      if rst_n = '0' then
        ticks_r   <= (others => '0');
        locked_r  <= '0';
        peers_r   <= (others => '0');
        sources_r <= (others => '0');
        sinks_r   <= (others => '0');
      end if;
    end if;
  end process note;

  source       <= index(5 downto 0);
  key_write    <= at_key_r;
  number_write <= at_number_r;
  note_write   <= at_note_r;
  write_place  <= write_address(3 downto 0);
  write_data   <= data;
  read_place   <= read_address(3 downto 0);
  is_locked    <= locked_r;

  takes_early <= at_taken_r and data(1);
  is_done     <= at_taken_r and data(2);
  slot_valid  <= at_next_r and not waits;
  slot_writer <= writer_r;
  looks       <= at_look_r and not waits;
  chooses     <= at_part_r and not waits;

  prepare_valid     <= at_prepare_r and not waits;
  chosen_slot_valid <= at_slot_r and not waits;
  send_valid        <= at_start_r and not waits;

  build_field_valid   <= at_field_r and not waits;
  build_field_bank    <= bank_r;
  build_field_address <= write_address(6 downto 0);
  build_field_data    <= data;

  peer_count          <= peers_r;
  source_count        <= sources_r;
  sink_count          <= sinks_r;
  is_peer_refused     <= at_refused_r and data(0);
  is_endpoint_refused <= at_refused_r and data(1);

  -- ------------------------------------------------------------------ what is read

  pad : process (matches)
  begin
    padded <= (others => '0');
    for place in padded'range loop
      if place < ENDPOINTS then
        padded(place) <= matches(place);
      end if;
    end loop;
  end process pad;

  facts <= has_lease & is_gone & has_default & has_metatraffic & has_unicast & is_transient & is_known & is_reliable;

  sample_facts <= "000" & is_new_long & is_beyond & is_last_part & is_long & is_started;

  -- Entities have their first byte highest.
  choose_word : process (read_address, facts, padded, entity_id, early_number, sample_facts, is_large, writer,
                         early_source, sample_bytes)
  begin
    if HAS_FRAGMENTS and read_address(4) = '1' then
      word <= std_logic_vector(resize(sample_bytes, 32));
    elsif read_address(3 downto 2) = WORD_OF_FACTS then
      word <= facts & padded;
    elsif read_address(3 downto 2) = WORD_OF_ENTITY then
      word <= entity_id(7 downto 0) & entity_id(15 downto 8) & entity_id(23 downto 16) & entity_id(31 downto 24);
    elsif read_address(3 downto 2) = WORD_OF_EARLY then
      word <= early_number;
    else
      word <= sample_facts & "0000000" & is_large & "00000" & writer & "00" & early_source;
    end if;
  end process choose_word;

  -- Numbers of sources, and the state of a sample in fragments, are at the lower addresses.
  read_data <= number_byte when read_address(5) = '0' else
               word(7 downto 0) when read_address(1 downto 0) = "00" else
               word(15 downto 8) when read_address(1 downto 0) = "01" else
               word(23 downto 16) when read_address(1 downto 0) = "10" else
               word(31 downto 24);

end architecture rtl;
