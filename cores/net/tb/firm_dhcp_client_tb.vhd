-- SPDX-License-Identifier: Apache-2.0
-- Tests a client of the board 02:00:00:00:00:02 between a line and a builder. A row of the file begins with an event:
--
--   0 aborted size bytes   a frame; 256 to 259 are the bytes of the client's number, 260 to 263 their complements
--   1 ms                   no event for some milliseconds
--   2                      no event until the client has sent a packet
--   3                      another host has the address
--   4                      no event until a packet is due
--   5 ms                   the builder is busy for the next milliseconds
--
-- A row of the results is a millisecond and an event: `checking`, `bound` or `lost`, or a packet, `message`, `renewal`
-- or `announcement`, with the bytes that the builder gets: the type, the current address, the option with the address,
-- the option with the server, the MAC address of the server, the address, the number, and an end or not.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_dhcp_client_tb is
  generic (
    FRAME_FILE    : string  := "offers.txt";
    RESULT_FILE   : string  := "lease.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    SLOW_PERCENT  : integer := 0;  -- the chance per cycle of no byte
    TICK_CYCLES   : integer := 8;  -- of a millisecond
    STOP_CYCLES   : integer := 40  -- until the user of an address is idle
  );
end entity firm_dhcp_client_tb;

architecture simulation of firm_dhcp_client_tb is

  constant RESET_CYCLES : positive := 4;
  constant GAP_CYCLES   : positive := 6;
  constant OWN_BYTES    : positive := 32;
  constant NUMBER_PLACE : positive := 27;  -- of the client's number
  constant NUMBER       : positive := 256; -- the code of its first byte
  constant MOST_MS      : positive := 150000;
  constant BYTE_CYCLES  : positive := 3;   -- from a byte of a packet to the next one

  type selects_t is array (0 to OWN_BYTES-1) of natural range 0 to 127;
  constant SELECTS : selects_t := (
    31, 32, 33, 34, 35,
    96+18, 96+4, 64, 65, 66, 67,
    96+22, 96+4, 68, 69, 70, 71,
    12, 13, 14, 15, 16, 17,
    0, 1, 2, 3,
    8, 9, 10, 11,
    30
  );

  type number_t is array (0 to 3) of integer range 0 to 255;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal over  : boolean   := false;
  signal tick  : std_logic := '0';
  signal ms    : natural   := 0;
  signal due   : natural   := 0;  -- packets
  signal sent  : natural   := 0;
  signal free  : natural   := 0;  -- the millisecond from which the builder is ready
  signal xid   : number_t  := (others => 0);

  signal tdata  : std_logic_vector(7 downto 0) := (others => '0');
  signal tuser  : std_logic_vector(0 downto 0) := "0";
  signal tvalid : std_logic := '0';
  signal tlast  : std_logic := '0';

  signal wants_broadcast    : std_logic;
  signal wants_renewal      : std_logic;
  signal wants_announcement : std_logic;
  signal is_sent            : std_logic := '0';
  signal own_select         : std_logic_vector(6 downto 0) := (others => '0');
  signal own_byte           : std_logic_vector(7 downto 0);
  signal address            : std_logic_vector(31 downto 0);
  signal is_bound           : std_logic;
  signal is_checking        : std_logic;
  signal is_taken           : std_logic := '0';
  signal is_stopped         : std_logic := '1';
  signal is_lost            : std_logic;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_client : entity firm.firm_dhcp_client
    port map (
      clk                => clk,
      rst_n              => rst_n,
      tick               => tick,
      mac                => x"020000000002",
      s_axis_tdata       => tdata,
      s_axis_tuser       => tuser,
      s_axis_tvalid      => tvalid,
      s_axis_tlast       => tlast,
      wants_broadcast    => wants_broadcast,
      wants_renewal      => wants_renewal,
      wants_announcement => wants_announcement,
      is_sent            => is_sent,
      own_select         => own_select,
      own_byte           => own_byte,
      address            => address,
      is_bound           => is_bound,
      is_checking        => is_checking,
      is_taken           => is_taken,
      is_stopped         => is_stopped,
      is_lost            => is_lost
    );

  keep_time(clk, rst_n, TICK_CYCLES, tick, ms);

  rest_user : process (clk)
    variable rest : natural := 0;
  begin
    if rising_edge(clk) and rst_n = '1' then
      rest := rest + 1;
      if is_bound = '1' then
        rest := 0;
      end if;
      is_stopped <= '0';
      if rest >= STOP_CYCLES then
        is_stopped <= '1';
      end if;
    end if;
  end process rest_user;

  play : process
    file rows        : text open read_mode is FRAME_FILE;
    variable row     : line;
    variable what    : integer;
    variable value   : integer;
    variable aborted : integer;
    variable size    : integer;
    variable before  : natural;
    variable start   : natural;
    variable random  : random_t := seeded(SEED, 3);

    procedure wait_for(cycles : in natural) is
    begin
      for cycle in 1 to cycles loop
        wait until rising_edge(clk);
      end loop;
    end procedure wait_for;

  begin
    wait_for(RESET_CYCLES);
    rst_n <= '1';
    while not endfile(rows) loop
      readline(rows, row);
      read(row, what);
      if what = 0 then
        read(row, aborted);
        read(row, size);
        wait_for(GAP_CYCLES);
        for place in 0 to size-1 loop
          read(row, value);
          pause(clk, '1', random, SLOW_PERCENT);
          if value >= NUMBER+4 then
            value := 255 - xid(value-NUMBER-4);
          elsif value >= NUMBER then
            value := xid(value-NUMBER);
          end if;
          tvalid <= '1';
          tdata  <= std_logic_vector(to_unsigned(value, 8));
          tlast  <= '0';
          tuser  <= "0";
          if place = size-1 then
            tlast <= '1';
            if aborted = 1 then
              tuser <= "1";
            end if;
          end if;
          wait until rising_edge(clk);
          tvalid <= '0';
          tdata  <= (others => 'X');
        end loop;
      elsif what = 1 then
        read(row, value);
        wait_for(value * TICK_CYCLES);
      elsif what = 2 then
        before := sent;
        start  := ms;
        while sent = before loop
          assert ms < start + MOST_MS
            report "no packet" severity failure;
          wait until rising_edge(clk);
        end loop;
      elsif what = 3 then
        is_taken <= '1';
        wait until rising_edge(clk);
        is_taken <= '0';
      elsif what = 4 then
        before := due;
        start  := ms;
        while due = before loop
          assert ms < start + MOST_MS
            report "no packet is due" severity failure;
          wait until rising_edge(clk);
        end loop;
      else
        read(row, value);
        free <= ms + value;
        wait until rising_edge(clk);
      end if;
    end loop;
    over <= true;
    wait;
  end process play;

  record_events : process
    file results        : text open write_mode is RESULT_FILE;
    file expected       : text open read_mode is existing(EXPECTED_FILE);
    variable row        : line;
    variable was_check  : std_logic := '0';
    variable was_bound  : std_logic := '0';
    variable byte       : natural;
    variable wanted     : std_logic_vector(2 downto 0);

    procedure note(what : in string) is
    begin
      write(row, integer'image(ms) & ' ' & what);
    end procedure note;

    procedure finish is
    begin
      write_result(results, expected, EXPECTED_FILE, row);
    end procedure finish;

  begin
    while not over loop
      wait until rising_edge(clk) or over;
      next when over or rst_n = '0';
      if is_checking = '1' and was_check = '0' then
        note("checking");
        finish;
      end if;
      if is_bound = '1' and was_bound = '0' then
        note("bound");
        finish;
      end if;
      if is_lost = '1' then
        assert is_bound = '0'
          report "an address is lost and in use" severity failure;
        note("lost");
        finish;
      end if;
      assert is_lost = '1' or was_bound = '0' or is_bound = '1'
        report "an address ends without a word" severity failure;
      was_check := is_checking;
      was_bound := is_bound;
      if wants_broadcast = '1' or wants_renewal = '1' or wants_announcement = '1' then
        if wants_renewal = '1' then
          note("renewal");
        elsif wants_announcement = '1' then
          note("announcement");
        else
          note("message");
        end if;
        wanted := wants_broadcast & wants_renewal & wants_announcement;
        due    <= due + 1;
        wait until rising_edge(clk);
        for index in SELECTS'range loop
          own_select <= std_logic_vector(to_unsigned(SELECTS(index), 7));
          for cycle in 1 to BYTE_CYCLES loop
            wait until rising_edge(clk);
          end loop;
          byte := to_integer(unsigned(own_byte));
          write(row, ' ' & integer'image(byte));
          if index >= NUMBER_PLACE and index < NUMBER_PLACE+4 then
            xid(index-NUMBER_PLACE) <= byte;
          end if;
        end loop;
        finish;
        while ms < free loop
          wait until rising_edge(clk);
        end loop;
        assert wanted = (wants_broadcast & wants_renewal & wants_announcement)
          report "a packet changes before it is sent" severity failure;
        is_sent <= '1';
        wait until rising_edge(clk);
        is_sent <= '0';
        sent    <= sent + 1;
        wait until rising_edge(clk);
      end if;
    end loop;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are events" severity failure;
    print("PASS");
    wait;
  end process record_events;

end architecture simulation;
