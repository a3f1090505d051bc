-- SPDX-License-Identifier: Apache-2.0
-- The generated node of a system with DHCP, between a line and a system that always sends frames. A row of the file
-- begins with what happens:
--
--   0 size bytes   a frame of the line, without FCS; 256 to 259 are the bytes of the number of the last request
--   1 ms           nothing, for some milliseconds
--   2              nothing, until the board has sent a message of DHCP
--   3 takes        the system takes frames from now on (1), or does not (0)
--
-- A row of the results is what happens: `message` and its type, `announced` (an address), `played` (a frame of the
-- line), `error` and its number, or `taken` and the bytes of a frame that the system gets; `part` are those of one that
-- has not ended.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;

entity dhcp_node is
  generic (
    EVENT_FILE  : string  := "events.txt";
    RESULT_FILE : string  := "results.txt";
    MS_CYCLES   : integer := 40
  );
end entity dhcp_node;

architecture simulation of dhcp_node is

  constant RESET_CYCLES : positive := 4;
  constant GAP_CYCLES   : positive := 12;
  constant MOST_CYCLES  : positive := 500000;  -- until a message
  constant BEAT_CYCLES  : positive := 3;       -- from a byte of the system to the next one
  constant FRAME_BYTES  : positive := 41;      -- of the system: id, length and payload
  constant PAYLOAD      : positive := 36;
  constant NUMBER       : positive := 256;     -- the first of the bytes of the request's number
  constant PREAMBLE     : positive := 8;

  -- Places in a frame.
  constant TYPE_PLACE    : positive := 12;
  constant SENDER_PLACE  : positive := 28;  -- of ARP: IPv4 addresses
  constant TARGET_PLACE  : positive := 38;
  constant PORT_PLACE    : positive := 36;
  constant NUMBER_PLACE  : positive := 46;
  constant MESSAGE_PLACE : positive := 284;  -- the type of the message
  constant SERVER_PORT   : positive := 67;
  constant ARP           : positive := 6;
  constant IPV4          : natural  := 0;

  subtype byte_t is natural range 0 to 255;
  type bytes_t is array (natural range <>) of byte_t;

  signal clk      : std_logic := '0';
  signal rst_n    : std_logic := '0';
  signal over     : boolean   := false;
  signal rx_dv    : std_logic := '0';
  signal rxd      : std_logic_vector(7 downto 0) := x"00";
  signal tx_en    : std_logic;
  signal txd      : std_logic_vector(7 downto 0);
  signal messages : natural := 0;
  signal played   : natural := 0;
  signal xid      : bytes_t(0 to 3) := (others => 0);
  signal takes    : std_logic := '1';

  signal m_tdata  : std_logic_vector(7 downto 0);
  signal m_tkeep  : std_logic_vector(0 downto 0);
  signal m_tuser  : std_logic_vector(0 downto 0);
  signal m_tvalid : std_logic;
  signal m_tlast  : std_logic;
  signal s_tdata  : std_logic_vector(7 downto 0) := x"00";
  signal s_tvalid : std_logic := '0';
  signal s_tlast  : std_logic := '0';
  signal s_tready : std_logic;
  signal errors   : std_logic_vector(10 downto 0);

  -- The frame check sequence after another byte.
  function crc_of(before : unsigned(31 downto 0); byte : byte_t) return unsigned is
    variable crc : unsigned(31 downto 0) := before xor to_unsigned(byte, 32);
  begin
    for bit in 0 to 7 loop
      if crc(0) = '1' then
        crc := ('0' & crc(31 downto 1)) xor x"edb88320";
      else
        crc := '0' & crc(31 downto 1);
      end if;
    end loop;
    return crc;
  end function crc_of;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_node : entity firm.turtle_system_node
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rx_step       => '1',
      rx_dv         => rx_dv,
      rx_er         => '0',
      rxd           => rxd,
      tx_step       => '1',
      tx_en         => tx_en,
      tx_er         => open,
      txd           => txd,
      m_axis_tdata  => m_tdata,
      m_axis_tkeep  => m_tkeep,
      m_axis_tuser  => m_tuser,
      m_axis_tvalid => m_tvalid,
      m_axis_tlast  => m_tlast,
      m_axis_tready => takes,
      s_axis_tdata  => s_tdata,
      s_axis_tkeep  => "1",
      s_axis_tuser  => "0",
      s_axis_tvalid => s_tvalid,
      s_axis_tlast  => s_tlast,
      s_axis_tready => s_tready,
      network_error => errors
    );

  u_to_system : entity firm.firm_axis_checker
    generic map (
      NAME  => "to the system",
      LEVEL => failure
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => m_tdata,
      axis_tkeep  => m_tkeep,
      axis_tuser  => m_tuser,
      axis_tvalid => m_tvalid,
      axis_tlast  => m_tlast,
      axis_tready => takes
    );

  u_from_system : entity firm.firm_axis_checker
    generic map (
      NAME  => "from the system",
      LEVEL => failure
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => s_tdata,
      axis_tkeep  => "1",
      axis_tvalid => s_tvalid,
      axis_tlast  => s_tlast,
      axis_tready => s_tready
    );

  send_frames : process
  begin
    wait until rising_edge(clk) and rst_n = '1';
    for place in 0 to FRAME_BYTES-1 loop
      for cycle in 2 to BEAT_CYCLES loop
        wait until rising_edge(clk);
      end loop;
      s_tvalid <= '1';
      s_tdata  <= x"00";
      if place = 1 then
        s_tdata <= std_logic_vector(to_unsigned(PAYLOAD, 8));
      end if;
      s_tlast <= '0';
      if place = FRAME_BYTES-1 then
        s_tlast <= '1';
      end if;
      wait until rising_edge(clk) and s_tready = '1';
      s_tvalid <= '0';
    end loop;
    if over then
      wait;
    end if;
  end process send_frames;

  play : process
    file events     : text open read_mode is EVENT_FILE;
    variable row    : line;
    variable what   : integer;
    variable value  : integer;
    variable size   : integer;
    variable before : natural;
    variable crc    : unsigned(31 downto 0);

    procedure wait_for(cycles : in natural) is
    begin
      for cycle in 1 to cycles loop
        wait until rising_edge(clk);
      end loop;
    end procedure wait_for;

    procedure put(byte : in byte_t) is
    begin
      rx_dv <= '1';
      rxd   <= std_logic_vector(to_unsigned(byte, 8));
      wait until rising_edge(clk);
    end procedure put;

  begin
    wait_for(RESET_CYCLES);
    rst_n <= '1';
    while not endfile(events) loop
      readline(events, row);
      read(row, what);
      if what = 0 then
        read(row, size);
        wait_for(GAP_CYCLES);
        for place in 2 to PREAMBLE loop
          put(16#55#);
        end loop;
        put(16#d5#);
        crc := (others => '1');
        for place in 0 to size-1 loop
          read(row, value);
          if value >= NUMBER then
            value := xid(value-NUMBER);
          end if;
          put(value);
          crc := crc_of(crc, value);
        end loop;
        crc := not crc;
        for place in 0 to 3 loop
          put(to_integer(crc(8*place+7 downto 8*place)));
        end loop;
        rx_dv  <= '0';
        played <= played + 1;
      elsif what = 1 then
        read(row, value);
        wait_for(value * MS_CYCLES);
      elsif what = 2 then
        before := messages;
        for cycle in 1 to MOST_CYCLES loop
          wait until rising_edge(clk);
          exit when messages /= before;
        end loop;
        assert messages /= before
          report "no message" severity failure;
      else
        read(row, value);
        takes <= '0';
        if value = 1 then
          takes <= '1';
        end if;
      end if;
    end loop;
    over <= true;
    wait;
  end process play;

  record_events : process
    file results    : text open write_mode is RESULT_FILE;
    variable row    : line;
    variable taken  : line;
    variable sent   : bytes_t(0 to 2047);
    variable size   : natural := 0;
    variable known  : natural := 0;

    procedure note(what : in string) is
    begin
      write(row, what);
      writeline(results, row);
    end procedure note;

    -- What the board has sent.
    procedure judge is
    begin
      if sent(TYPE_PLACE+1) = IPV4 and sent(PORT_PLACE+1) = SERVER_PORT then
        note("message " & integer'image(sent(MESSAGE_PLACE)));
        xid      <= sent(NUMBER_PLACE to NUMBER_PLACE+3);
        messages <= messages + 1;
      elsif sent(TYPE_PLACE+1) = ARP
            and sent(SENDER_PLACE to SENDER_PLACE+3) = sent(TARGET_PLACE to TARGET_PLACE+3) then
        note("announced");
      end if;
    end procedure judge;

  begin
    while not over loop
      wait until rising_edge(clk) or over;
      if tx_en = '1' then
        if size >= PREAMBLE then
          sent(size-PREAMBLE) := to_integer(unsigned(txd));
        end if;
        size := size + 1;
      elsif size /= 0 then
        judge;
        size := 0;
      end if;
      if played /= known then
        note("played");
        known := played;
      end if;
      for bit in errors'range loop
        if errors(bit) = '1' then
          note("error " & integer'image(bit));
        end if;
      end loop;
      if m_tvalid = '1' and takes = '1' then
        write(taken, ' ' & integer'image(to_integer(unsigned(m_tdata))));
        if m_tlast = '1' then
          note("taken" & taken.all);
          deallocate(taken);
        end if;
      end if;
    end loop;
    if taken /= null then
      note("part" & taken.all);
    end if;
    wait;
  end process record_events;

end architecture simulation;
