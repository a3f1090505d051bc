-- SPDX-License-Identifier: Apache-2.0
-- Sends packets to a node with two readers. A row of the file is a packet: the cycles before it, whether it is aborted
-- (0 or 1), the number of bytes, and the bytes. Results go to a file. A frame to the host is `frame` and its bytes. An
-- answer to a heartbeat of discovery is `request`, the number of its packet, and the bytes of all fields. A sample that
-- the node sends is `sample` and the number of its bytes; one that it refuses is `long`.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_rtps_node_tb is
  generic (
    FRAME_FILE    : string  := "packets.txt";
    NAMES_FILE    : string  := "names.txt";  -- a word of the memory of names in each row
    RESULT_FILE   : string  := "results.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;            -- the chance, each cycle, that the host takes nothing
    SOURCES       : integer := 8;
    DEPTH         : integer := 4096;
    SAMPLES       : integer := 16;
    SAMPLE        : integer := 64;
    SENT_BYTES    : integer := 0             -- if not 0, samples of 1 to so many bytes are sent
  );
end entity firm_rtps_node_tb;

architecture simulation of firm_rtps_node_tb is

  constant READERS         : positive := 2;
  constant WANTS_RELIABLE  : std_logic_vector(READERS-1 downto 0) := "00";
  constant WANTS_TRANSIENT : std_logic_vector(READERS-1 downto 0) := "10";
  constant WRITERS         : positive := 2;
  constant FIELD_BYTES     : positive := 128;
  constant USED_BYTES      : positive := 72; -- bytes that the node writes
  -- Of an answer: see firm_rtps_control.
  constant ACKNOWLEDGE  : natural := 12 + WRITERS + READERS;
  constant REQUEST      : natural := 13 + WRITERS + READERS;
  constant PLAIN_SAMPLE : natural := 7 + WRITERS + READERS;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic;
  signal over  : boolean;
  signal done  : boolean := false;

  signal s_tdata  : std_logic_vector(7 downto 0);
  signal s_tuser  : std_logic_vector(0 downto 0);
  signal s_tvalid : std_logic;
  signal s_tlast  : std_logic;

  signal names_address : std_logic_vector(9 downto 0);
  signal names_data    : std_logic_vector(8*READERS-1 downto 0);

  signal m_tdata  : std_logic_vector(7 downto 0);
  signal m_tvalid : std_logic;
  signal m_tlast  : std_logic;
  signal m_tready : std_logic;

  signal start         : std_logic;
  signal packet        : std_logic_vector(7 downto 0);
  signal build_valid   : std_logic;
  signal build_address : std_logic_vector(6 downto 0);
  signal build_data    : std_logic_vector(7 downto 0);
  signal payload_bytes : std_logic_vector(15 downto 0);

  signal sample_valid : std_logic := '0';
  signal sample_last  : std_logic := '0';
  signal sample_ready : std_logic;
  signal is_long      : std_logic;

begin

  clk <= not clk after 4 ns when not done else '0';

  u_rows : entity firm.firm_sim_rows
    generic map (
      FRAME_FILE  => FRAME_FILE,
      SEED        => SEED,
      GAP_CYCLES  => 12,
      LAST_CYCLES => 6000
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => s_tdata,
      m_axis_tuser  => s_tuser,
      m_axis_tvalid => s_tvalid,
      m_axis_tlast  => s_tlast,
      over          => over
    );

  done <= over;

  u_node : entity firm.firm_rtps_node
    generic map (
      WRITERS => WRITERS,
      READERS => READERS,
      SOURCES => SOURCES,
      DEPTH   => DEPTH,
      SAMPLES => SAMPLES,
      SAMPLE  => SAMPLE
    )
    port map (
      clk                 => clk,
      rst_n               => rst_n,
      tick                => '0',
      prefix              => x"000002000000000200000000",
      sample_writer       => x"00000403",
      wants_reliable      => WANTS_RELIABLE,
      wants_transient     => WANTS_TRANSIENT,
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
      sample_tdata        => x"00",
      sample_tvalid       => sample_valid,
      sample_tlast        => sample_last,
      sample_tready       => sample_ready,
      start               => start,
      packet              => packet,
      payload_bytes       => payload_bytes,
      is_busy             => '0',
      build_field_valid   => build_valid,
      build_field_address => build_address,
      build_field_data    => build_data,
      payload_tdata       => open,
      payload_tvalid      => open,
      payload_tready      => '0',
      peers_known         => open,
      sources_known       => open,
      is_lost             => open,
      is_full             => open,
      is_unmatched        => open,
      is_dropped          => open,
      is_long             => is_long
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

  -- ------------------------------------------------------------------ names

  show_names : process
    type names_t is array (natural range 0 to 1023) of std_logic_vector(8*READERS-1 downto 0);

    file names      : text open read_mode is NAMES_FILE;
    variable row    : line;
    variable value  : integer;
    variable memory : names_t := (others => (others => '0'));
    variable count  : natural := 0;
  begin
    while not endfile(names) loop
      readline(names, row);
      read(row, value);
      memory(count) := std_logic_vector(to_unsigned(value, 8*READERS));
      count         := count + 1;
    end loop;
    while not done loop
      wait until rising_edge(clk) or done;
      if not is_x(names_address) then
        names_data <= memory(to_integer(unsigned(names_address)));
      end if;
    end loop;
    wait;
  end process show_names;

  -- ------------------------------------------------------------------ samples to send

  send_samples : process
    variable size : positive := 1;
  begin
    wait until rst_n = '1';
    while SENT_BYTES > 0 and not done loop
      for place in 1 to size loop
        sample_valid <= '1';
        sample_last  <= '0';
        if place = size then
          sample_last <= '1';
        end if;
        wait until (rising_edge(clk) and sample_ready = '1') or done;
      end loop;
      size := size mod SENT_BYTES + 1;
    end loop;
    sample_valid <= '0';
    wait;
  end process send_samples;

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
    type fields_t is array (natural range 0 to FIELD_BYTES-1) of natural;

    file results    : text open write_mode is RESULT_FILE;
    file expected   : text open read_mode is existing(EXPECTED_FILE);
    variable row    : line;
    variable frame  : line;
    variable fields : fields_t := (others => 0);
  begin
    write(frame, string'("frame"));
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
      if build_valid = '1' then
        assert unsigned(build_address) < USED_BYTES
          report "a field has the address " & integer'image(to_integer(unsigned(build_address))) severity failure;
        fields(to_integer(unsigned(build_address))) := to_integer(unsigned(build_data));
      end if;
      if is_long = '1' then
        write(row, string'("long"));
        write_result(results, expected, EXPECTED_FILE, row);
      end if;
      if start = '1' and unsigned(packet) = PLAIN_SAMPLE then
        write(row, "sample " & integer'image(to_integer(unsigned(payload_bytes))));
        write_result(results, expected, EXPECTED_FILE, row);
      end if;
      if start = '1' and (unsigned(packet) = ACKNOWLEDGE or unsigned(packet) = REQUEST) then
        write(row, "request " & integer'image(to_integer(unsigned(packet))));
        for index in 0 to USED_BYTES-1 loop
          write(row, ' ' & integer'image(fields(index)));
        end loop;
        write_result(results, expected, EXPECTED_FILE, row);
      end if;
    end loop;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are results" severity failure;
    print("PASS");
    wait;
  end process record_results;

end architecture simulation;
