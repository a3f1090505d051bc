-- SPDX-License-Identifier: Apache-2.0
-- Runs programs in the builder. A row of the file with programs is a word, from address 0 on. A row of the file with
-- jobs is a packet: the program's entry, the 128 bytes of the fields, the number of the payload's bytes, and these. The
-- fields of each packet are in the bank after that of the last one, and the next bank has other bytes. A row of the
-- result is a frame: its number of bytes, and the bytes. If STALL_PERCENT is 0, a pause in a frame is a fault, and so
-- is a latency from the start to the first byte above MOST_CYCLES.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_random_pkg.all;

entity firm_packet_builder_tb is
  generic (
    PROGRAM_FILE  : string  := "programs.txt";
    JOB_FILE      : string  := "jobs.txt";
    RESULT_FILE   : string  := "built.txt";
    EXPECTED_FILE : string  := "";
    ADDRESS_BITS  : integer := 12;
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;  -- the chance per cycle that the frame's reader waits
    SLOW_PERCENT  : integer := 0   -- the chance per cycle of no byte of the payload
  );
end entity firm_packet_builder_tb;

architecture simulation of firm_packet_builder_tb is

  constant FIELD_BYTES : positive := 128;
  constant BANK_BITS   : positive := 4;
  constant MOST_CYCLES : positive := 12;

  type memory_t is array (natural range 0 to 2**ADDRESS_BITS-1) of std_logic_vector(10 downto 0);

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal over  : boolean   := false;

  signal start         : std_logic := '0';
  signal entry         : std_logic_vector(ADDRESS_BITS-1 downto 0) := (others => '0');
  signal bank          : unsigned(BANK_BITS-1 downto 0) := (others => '0');
  signal payload_bytes : std_logic_vector(15 downto 0) := (others => '0');
  signal is_busy       : std_logic;

  signal field_valid   : std_logic := '0';
  signal field_bank    : unsigned(BANK_BITS-1 downto 0) := (others => '0');
  signal field_address : std_logic_vector(6 downto 0) := (others => '0');
  signal field_data    : std_logic_vector(7 downto 0) := (others => '0');

  signal program_enable  : std_logic;
  signal program_address : std_logic_vector(ADDRESS_BITS-1 downto 0);
  signal program_word    : std_logic_vector(10 downto 0) := (others => '0');

  signal s_tdata  : std_logic_vector(7 downto 0) := (others => '0');
  signal s_tvalid : std_logic := '0';
  signal s_tready : std_logic;
  signal m_tdata  : std_logic_vector(7 downto 0);
  signal m_tvalid : std_logic;
  signal m_tlast  : std_logic;
  signal m_tready : std_logic;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_builder : entity firm.firm_packet_builder
    generic map (
      ADDRESS_BITS => ADDRESS_BITS,
      BANK_BITS    => BANK_BITS
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      start           => start,
      entry           => entry,
      bank            => std_logic_vector(bank),
      payload_bytes   => payload_bytes,
      is_busy         => is_busy,
      field_valid     => field_valid,
      field_bank      => std_logic_vector(field_bank),
      field_address   => field_address,
      field_data      => field_data,
      program_enable  => program_enable,
      program_address => program_address,
      program_word    => program_word,
      s_axis_tdata    => s_tdata,
      s_axis_tvalid   => s_tvalid,
      s_axis_tready   => s_tready,
      m_axis_tdata    => m_tdata,
      m_axis_tvalid   => m_tvalid,
      m_axis_tlast    => m_tlast,
      m_axis_tready   => m_tready
    );

  show_program : process
    file words      : text open read_mode is PROGRAM_FILE;
    variable row    : line;
    variable word   : integer;
    variable memory : memory_t := (others => (others => '0'));
    variable place  : natural := 0;
  begin
    while not endfile(words) loop
      readline(words, row);
      read(row, word);
      memory(place) := std_logic_vector(to_unsigned(word, 11));
      place         := place + 1;
    end loop;
    loop
      wait until rising_edge(clk);
      if program_enable = '1' then
        program_word <= memory(to_integer(unsigned(program_address)));
      end if;
    end loop;
  end process show_program;

  send : process
    file jobs       : text open read_mode is JOB_FILE;
    variable row    : line;
    variable number : integer;
    variable size   : integer;
    variable random : random_t := seeded(SEED, 3);
  begin
    end_reset(clk, '1', rst_n);
    while not endfile(jobs) loop
      readline(jobs, row);
      read(row, number);
      entry <= std_logic_vector(to_unsigned(number, ADDRESS_BITS));
      for address in 0 to FIELD_BYTES-1 loop
        read(row, number);
        field_valid   <= '1';
        field_address <= std_logic_vector(to_unsigned(address, 7));
        field_bank    <= bank + 1;
        field_data    <= std_logic_vector(to_unsigned(number, 8));
        wait until rising_edge(clk);
        field_bank    <= bank + 2;
        field_data    <= not field_data;
        wait until rising_edge(clk);
      end loop;
      bank        <= bank + 1;
      field_valid <= '0';
      read(row, size);
      payload_bytes <= std_logic_vector(to_unsigned(size, 16));
      start         <= '1';
      wait until rising_edge(clk);
      start <= '0';
      for place in 1 to size loop
        read(row, number);
        pause(clk, '1', random, SLOW_PERCENT);
        s_tvalid <= '1';
        s_tdata  <= std_logic_vector(to_unsigned(number, 8));
        loop
          wait until rising_edge(clk);
          exit when s_tready = '1';
        end loop;
        s_tvalid <= '0';
      end loop;
      loop
        wait until rising_edge(clk);
        exit when is_busy = '0';
      end loop;
    end loop;
    for cycle in 1 to 8 loop
      wait until rising_edge(clk);
    end loop;
    over <= true;
    wait;
  end process send;

  u_record : entity firm.firm_sim_record
    generic map (
      RESULT_FILE   => RESULT_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      over          => over,
      s_axis_tdata  => m_tdata,
      s_axis_tvalid => m_tvalid,
      s_axis_tlast  => m_tlast,
      s_axis_tready => m_tready
    );

  check_times : process (clk)
    variable is_open : boolean := false;
    variable cycles  : natural := 0;  -- since the start
  begin
    if rising_edge(clk) and STALL_PERCENT = 0 and SLOW_PERCENT = 0 then
      cycles := cycles + 1;
      if start = '1' then
        cycles := 0;
      end if;
      assert m_tvalid = '1' or not is_open
        report "a pause in a frame" severity failure;
      if m_tvalid = '1' then
        assert is_open or cycles <= MOST_CYCLES
          report integer'image(cycles) & " cycles before the first byte" severity failure;
        is_open := m_tlast = '0';
      end if;
    end if;
  end process check_times;

end architecture simulation;
