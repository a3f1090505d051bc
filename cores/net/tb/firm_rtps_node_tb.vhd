-- SPDX-License-Identifier: Apache-2.0
-- Tests a node with firm_packet_builder. A row of the file is an event: its kind, the cycles before it, the number of
-- bytes, and the bytes. A negative number of cycles waits until the node is idle.
--
--   0 a packet, 1 a packet that is aborted with its last byte, 2 milliseconds (as many as the number of bytes, without
--   bytes), 3 a frame to send, 4 a frame that is aborted with its last byte, 5 milliseconds, one in each cycle
--
-- Results go to a file. A frame to the host is `frame` and its bytes; a packet of the node is `sent` and its bytes
-- from the destination on; `refused`, `lost`, `peer` and `endpoint` are pulses; `done` follows each event that waited
-- for the node.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_rtps_pkg.all;
use firm.firm_sim_pkg.all;

entity firm_rtps_node_tb is
  generic (
    EVENT_FILE    : string  := "events.txt";
    NAMES_FILE    : string  := "names.txt";    -- a word of each memory in each row, in hexadecimal
    PROGRAM_FILE  : string  := "program.txt";
    PACKETS_FILE  : string  := "packets.txt";
    ENTRIES_FILE  : string  := "entries.txt";  -- the address of each packet
    RESULT_FILE   : string  := "results.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;              -- the chance per cycle that the host takes nothing
    MAIN          : integer := 40;             -- the address of the program's loop
    WRITERS       : integer := 4;
    READERS       : integer := 3;
    SOURCES       : integer := 8;
    SINKS         : integer := 8;
    DEPTH         : integer := 4096;
    SAMPLES       : integer := 16;
    SAMPLE        : integer := 64;
    SLOTS         : integer := 16;
    RELIABLE      : integer := 116;             -- bits of the endpoints
    TRANSIENT     : integer := 98
  );
end entity firm_rtps_node_tb;

architecture simulation of firm_rtps_node_tb is

  constant ENDPOINTS : positive := READERS+WRITERS;
  -- More cycles than an idle loop of the program takes, and more than a packet takes through the node.
  constant LOOP_CYCLES : positive := 24;
  constant LOOPS       : positive := 50;
  constant LAST_CYCLES : positive := 200;

  constant ABORTED_PACKET : natural := 1;
  constant TICKS          : natural := 2;
  constant ABORTED_FRAME  : natural := 4;
  constant RUSHED         : natural := 5;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal done  : boolean := false;

  signal tick : std_logic := '0';

  signal s_tdata  : std_logic_vector(7 downto 0) := (others => '0');
  signal s_tuser  : std_logic_vector(0 downto 0) := "0";
  signal s_tvalid : std_logic := '0';
  signal s_tlast  : std_logic := '0';

  signal sample_tdata  : std_logic_vector(7 downto 0) := (others => '0');
  signal sample_tuser  : std_logic_vector(0 downto 0) := "0";
  signal sample_tvalid : std_logic := '0';
  signal sample_tlast  : std_logic := '0';
  signal sample_tready : std_logic;

  signal names_address   : std_logic_vector(9 downto 0);
  signal names_data      : std_logic_vector(8*ENDPOINTS-1 downto 0);
  signal program_enable  : std_logic;
  signal program_address : std_logic_vector(RTPS_CONTROL_BITS-1 downto 0);
  signal program_word    : std_logic_vector(35 downto 0) := (others => '0');
  signal packets_enable  : std_logic;
  signal packets_address : std_logic_vector(12 downto 0);
  signal packets_word    : std_logic_vector(10 downto 0) := (others => '0');

  signal m_tdata  : std_logic_vector(7 downto 0);
  signal m_tvalid : std_logic;
  signal m_tlast  : std_logic;
  signal m_tready : std_logic;

  signal start          : std_logic;
  signal bank           : std_logic_vector(RTPS_BANK_BITS-1 downto 0);
  signal number         : std_logic_vector(7 downto 0);
  signal entry          : std_logic_vector(12 downto 0) := (others => '0');
  signal is_busy        : std_logic;
  signal build_valid    : std_logic;
  signal build_bank     : std_logic_vector(RTPS_BANK_BITS-1 downto 0);
  signal build_address  : std_logic_vector(6 downto 0);
  signal build_data     : std_logic_vector(7 downto 0);
  signal payload_bytes  : std_logic_vector(15 downto 0);
  signal payload_tdata  : std_logic_vector(7 downto 0);
  signal payload_tvalid : std_logic;
  signal payload_tready : std_logic;

  signal sent_tdata  : std_logic_vector(7 downto 0);
  signal sent_tvalid : std_logic;
  signal sent_tlast  : std_logic;

  signal is_discovery_lost   : std_logic;
  signal is_sample_lost      : std_logic;
  signal is_peer_refused     : std_logic;
  signal is_endpoint_refused : std_logic;
  signal is_frame_refused    : std_logic;

  signal since_main : natural := 0;  -- cycles
  signal idle_count : natural := 0;
  signal is_done    : std_logic := '0';

  subtype packet_word_t is std_logic_vector(10 downto 0);
  subtype program_word_t is std_logic_vector(35 downto 0);
  subtype name_word_t is std_logic_vector(8*ENDPOINTS-1 downto 0);
  type packet_words_t is array (natural range 0 to 8191) of packet_word_t;
  type program_words_t is array (natural range 0 to 2047) of program_word_t;
  type name_words_t is array (natural range 0 to 1023) of name_word_t;
  type entries_t is array (natural range 0 to 255) of natural;

  -- A word in hexadecimal.
  procedure read_word(row : inout line; word : out std_logic_vector) is
    variable char  : character;
    variable value : unsigned(word'length+3 downto 0) := (others => '0');
    variable digit : natural;
  begin
    while row'length > 0 loop
      read(row, char);
      digit := character'pos(char) - character'pos('0');
      if digit > 9 then
        digit := character'pos(char) - character'pos('a') + 10;
      end if;
      value := value(word'length-1 downto 0) & to_unsigned(digit, 4);
    end loop;
    word := std_logic_vector(value(word'length-1 downto 0));
  end procedure read_word;

begin

  clk <= not clk after 4 ns when not done else '0';

  u_node : entity firm.firm_rtps_node
    generic map (
      WRITERS => WRITERS,
      READERS => READERS,
      SOURCES => SOURCES,
      SINKS   => SINKS,
      DEPTH   => DEPTH,
      BYTES   => DEPTH,
      SAMPLES => SAMPLES,
      SAMPLE  => SAMPLE,
      SLOTS   => SLOTS
    )
    port map (
      clk                 => clk,
      rst_n               => rst_n,
      tick                => tick,
      prefix              => x"000002000000000200000000",
      are_reliable        => std_logic_vector(to_unsigned(RELIABLE, ENDPOINTS)),
      are_transient       => std_logic_vector(to_unsigned(TRANSIENT, ENDPOINTS)),
      program_enable      => program_enable,
      program_address     => program_address,
      program_word        => program_word,
      packet_tdata        => s_tdata,
      packet_tuser        => s_tuser,
      packet_tvalid       => s_tvalid,
      packet_tlast        => s_tlast,
      source_mac          => x"020000000001",
      names_address       => names_address,
      names_data          => names_data,
      frame_tdata         => m_tdata,
      frame_tvalid        => m_tvalid,
      frame_tlast         => m_tlast,
      frame_tready        => m_tready,
      sample_tdata        => sample_tdata,
      sample_tuser        => sample_tuser,
      sample_tvalid       => sample_tvalid,
      sample_tlast        => sample_tlast,
      sample_tready       => sample_tready,
      start               => start,
      packet              => number,
      bank                => bank,
      payload_bytes       => payload_bytes,
      is_busy             => is_busy,
      build_field_valid   => build_valid,
      build_field_bank    => build_bank,
      build_field_address => build_address,
      build_field_data    => build_data,
      payload_tdata       => payload_tdata,
      payload_tvalid      => payload_tvalid,
      payload_tready      => payload_tready,
      peer_count          => open,
      source_count        => open,
      sink_count          => open,
      is_discovery_lost   => is_discovery_lost,
      is_sample_lost      => is_sample_lost,
      is_peer_refused     => is_peer_refused,
      is_endpoint_refused => is_endpoint_refused,
      is_frame_refused    => is_frame_refused,
      is_sample_parted    => open,
      is_packet_broken    => open,
      is_endpoint_other   => open
    );

  u_builder : entity firm.firm_packet_builder
    generic map (
      ADDRESS_BITS => 13
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      start           => start,
      entry           => entry,
      bank            => bank,
      payload_bytes   => payload_bytes,
      is_busy         => is_busy,
      field_valid     => build_valid,
      field_bank      => build_bank,
      field_address   => build_address,
      field_data      => build_data,
      program_enable  => packets_enable,
      program_address => packets_address,
      program_word    => packets_word,
      s_axis_tdata    => payload_tdata,
      s_axis_tvalid   => payload_tvalid,
      s_axis_tready   => payload_tready,
      m_axis_tdata    => sent_tdata,
      m_axis_tvalid   => sent_tvalid,
      m_axis_tlast    => sent_tlast,
      m_axis_tready   => '1'
    );

  u_checker : entity firm.firm_axis_checker
    generic map (
      WIDTH => 8,
      NAME  => "frames",
      LEVEL => failure
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => m_tdata,
      axis_tkeep  => "1",
      axis_tvalid => m_tvalid,
      axis_tlast  => m_tlast,
      axis_tready => m_tready
    );

  -- ------------------------------------------------------------------ memories

  show_memories : process
    file     names          : text open read_mode is NAMES_FILE;
    file     programs       : text open read_mode is PROGRAM_FILE;
    file     packets        : text open read_mode is PACKETS_FILE;
    file     entries        : text open read_mode is ENTRIES_FILE;
    variable row            : line;
    variable count          : natural := 0;
    variable address        : natural;
    variable name_memory    : name_words_t := (others => (others => '0'));
    variable program_memory : program_words_t := (others => (others => '0'));
    variable packet_memory  : packet_words_t := (others => (others => '0'));
    variable entry_table    : entries_t := (others => 0);
  begin
    while not endfile(names) loop
      readline(names, row);
      read_word(row, name_memory(count));
      count := count + 1;
    end loop;
    count := 0;
    while not endfile(programs) loop
      readline(programs, row);
      read_word(row, program_memory(count));
      count := count + 1;
    end loop;
    count := 0;
    while not endfile(packets) loop
      readline(packets, row);
      read_word(row, packet_memory(count));
      count := count + 1;
    end loop;
    count := 0;
    while not endfile(entries) loop
      readline(entries, row);
      read(row, address);
      entry_table(count) := address;
      count              := count + 1;
    end loop;
    while not done loop
      wait until rising_edge(clk) or start = '1' or done;
      if start = '1' then
        entry <= std_logic_vector(to_unsigned(entry_table(to_integer(unsigned(number))), 13));
      end if;
      if rising_edge(clk) then
        if not is_x(names_address) then
          names_data <= name_memory(to_integer(unsigned(names_address)));
        end if;
        if program_enable = '1' then
          program_word <= program_memory(to_integer(unsigned(program_address)));
        end if;
        if packets_enable = '1' then
          packets_word <= packet_memory(to_integer(unsigned(packets_address)));
        end if;
      end if;
    end loop;
    wait;
  end process show_memories;

  -- ------------------------------------------------------------------ events

  -- Counts the idle loops of the program.
  watch : process (clk)
  begin
    if rising_edge(clk) then
      since_main <= since_main + 1;
      if s_tvalid = '1' or tick = '1' or sample_tvalid = '1' or is_busy = '1' or m_tvalid = '1' then
        idle_count <= 0;
      elsif program_enable = '1' and unsigned(program_address) = MAIN then
        since_main <= 0;
        idle_count <= idle_count + 1;
        if since_main > LOOP_CYCLES then
          idle_count <= 0;
        end if;
      end if;
    end if;
  end process watch;

  play : process
    file     events : text open read_mode is EVENT_FILE;
    variable row    : line;
    variable kind   : integer;
    variable before : integer;
    variable size   : integer;
    variable byte   : integer;

    procedure wait_until_idle is
    begin
      loop
        wait until rising_edge(clk);
        exit when idle_count >= LOOPS;
      end loop;
    end procedure wait_until_idle;

    procedure send_packet is
    begin
      for place in 1 to size loop
        read(row, byte);
        s_tvalid <= '1';
        s_tdata  <= std_logic_vector(to_unsigned(byte, 8));
        s_tlast  <= '0';
        s_tuser  <= "0";
        if place = size then
          s_tlast <= '1';
          if kind = ABORTED_PACKET then
            s_tuser <= "1";
          end if;
        end if;
        wait until rising_edge(clk);
      end loop;
      s_tvalid <= '0';
      s_tdata  <= (others => 'X');
    end procedure send_packet;

    procedure send_frame is
    begin
      for place in 1 to size loop
        read(row, byte);
        sample_tvalid <= '1';
        sample_tdata  <= std_logic_vector(to_unsigned(byte, 8));
        sample_tlast  <= '0';
        sample_tuser  <= "0";
        if place = size then
          sample_tlast <= '1';
          if kind = ABORTED_FRAME then
            sample_tuser <= "1";
          end if;
        end if;
        wait until rising_edge(clk) and sample_tready = '1';
      end loop;
      sample_tvalid <= '0';
    end procedure send_frame;

  begin
    for cycle in 1 to 4 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    while not endfile(events) loop
      readline(events, row);
      read(row, kind);
      read(row, before);
      read(row, size);
      if before < 0 then
        wait_until_idle;
        is_done <= '1';
        wait until rising_edge(clk);
        is_done <= '0';
      end if;
      for cycle in 1 to before loop
        wait until rising_edge(clk);
      end loop;
      if kind = TICKS then
        for count in 1 to size loop
          tick <= '1';
          wait until rising_edge(clk);
          tick <= '0';
          wait_until_idle;
        end loop;
      elsif kind = RUSHED then
        tick <= '1';
        for count in 1 to size loop
          wait until rising_edge(clk);
        end loop;
        tick <= '0';
      elsif kind <= ABORTED_PACKET then
        send_packet;
      else
        send_frame;
      end if;
    end loop;
    wait_until_idle;
    for cycle in 1 to LAST_CYCLES loop
      wait until rising_edge(clk);
    end loop;
    done <= true;
    wait;
  end process play;

  -- ------------------------------------------------------------------ results

  stall : process
    variable random_1 : positive := SEED;
    variable random_2 : positive := 5;
    variable draw     : real;
  begin
    m_tready <= '0';
    while not done loop
      wait until rising_edge(clk) or done;
      uniform(random_1, random_2, draw);
      m_tready <= '1';
      if draw * 100.0 < real(STALL_PERCENT) then
        m_tready <= '0';
      end if;
    end loop;
    wait;
  end process stall;

  record_results : process
    file     results  : text open write_mode is RESULT_FILE;
    file     expected : text open read_mode is existing(EXPECTED_FILE);
    variable frame    : line;
    variable sent     : line;

    procedure note(pulse : in std_logic; name : in string) is
      variable row : line;
    begin
      if pulse = '1' then
        write(row, name);
        write_result(results, expected, EXPECTED_FILE, row);
      end if;
    end procedure note;

  begin
    write(frame, string'("frame"));
    write(sent, string'("sent"));
    while not done loop
      wait until rising_edge(clk) or done;
      next when done or rst_n = '0';
      if m_tvalid = '1' and m_tready = '1' then
        write(frame, ' ' & integer'image(to_integer(unsigned(m_tdata))));
        if m_tlast = '1' then
          write_result(results, expected, EXPECTED_FILE, frame);
          write(frame, string'("frame"));
        end if;
      end if;
      if sent_tvalid = '1' then
        write(sent, ' ' & integer'image(to_integer(unsigned(sent_tdata))));
        if sent_tlast = '1' then
          write_result(results, expected, EXPECTED_FILE, sent);
          write(sent, string'("sent"));
        end if;
      end if;
      note(is_frame_refused, "refused");
      note(is_sample_lost or is_discovery_lost, "lost");
      note(is_peer_refused, "peer");
      note(is_endpoint_refused, "endpoint");
      note(is_done, "done");
    end loop;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are results" severity failure;
    print("PASS");
    wait;
  end process record_results;

end architecture simulation;
