-- SPDX-License-Identifier: Apache-2.0
-- Keeps a board's place in its network: it requests reports of its group membership (IGMP version 2, RFC 2236) and
-- probes for its own address (ARP, RFC 5227). Both are sent four times, one second apart, and again every 64 seconds,
-- since a PHY or a switch may not be ready at first. A query of a router or switch is answered. A host that uses the
-- board's address is reported. Before the board uses the address itself, it only probes for it, and also reports
-- another host that probes for it.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_net_pkg.all;

entity firm_net_presence is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

    -- This host and its group, the first byte on the line highest.
    mac       : in std_logic_vector(47 downto 0);
    address   : in std_logic_vector(31 downto 0);
    is_in_use : in std_logic := '1';  -- the board uses the address
    group_ip  : in std_logic_vector(31 downto 0);

    -- All frames of firm_mac_receiver.
    s_axis_tdata  : in std_logic_vector(7 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;

    -- A report or else a probe is due, until `is_sent`.
    wants_report : out std_logic;
    wants_probe  : out std_logic;
    is_sent      : in  std_logic;

    is_taken : out std_logic  -- a pulse for each ARP packet of another host that has or wants the board's address
  );
end entity firm_net_presence;

architecture rtl of firm_net_presence is

  constant SECOND  : positive := 1000;  -- milliseconds
  constant REPEATS : positive := 4;     -- seconds in which both are sent

  -- Places in a frame, of the first byte of a field.
  constant IPV4_PLACE      : natural := 14;
  constant PROTOCOL_PLACE  : natural := 23;
  constant SENDER_PLACE    : natural := 22;  -- of ARP: a MAC address and an IPv4 address
  constant TARGET_PLACE    : natural := 38;  -- its IPv4 address
  constant MAC_BYTES       : natural := 6;
  constant ADDRESS_BYTES   : natural := 4;
  constant SHORTEST_HEADER : natural := 5;  -- of IPv4, in words
  constant LAST_PLACE      : natural := 63;
  -- `count_r` counts down from the bytes of the header of IPv4, from its second byte on. So it is one at the first byte
  -- of IGMP, and continues from zero to the highest count.
  constant TYPE_COUNT  : natural := 1;
  constant DELAY_COUNT : natural := 0;
  constant GROUP_COUNT : natural := 122;  -- of the last byte of the group
  constant LAST_COUNT  : natural := 121;

  -- ARP for Ethernet and IPv4.
  constant ARP        : bytes_t(12 to 19) := (x"08", x"06", x"00", x"01", x"08", x"00", x"06", x"04");
  constant IPV4       : bytes_t(12 to 13) := (x"08", x"00");
  constant VERSION    : std_logic_vector(3 downto 0) := x"4";
  constant IGMP       : byte_t            := x"02";
  constant QUERY      : byte_t            := x"11";
  constant NO_ADDRESS : std_logic_vector(31 downto 0) := (others => '0');

  -- Of the frame so far.
  signal place_r  : natural range 0 to LAST_PLACE := 0;
  signal count_r  : unsigned(6 downto 0) := (others => '0');
  signal recent_r : std_logic_vector(47 downto 0) := (others => '0');  -- the last six bytes
  signal arp_r    : std_logic;
  signal other_r  : std_logic;  -- the ARP packet is from another host
  signal claims_r : std_logic;  -- it names the board's address as its sender's, or probes for it
  signal probes_r : std_logic;  -- it is a probe
  signal query_r  : std_logic;
  signal meant_r  : std_logic;  -- the query is about the board's group, or all groups
  signal limit_r  : unsigned(8 downto 0) := (others => '0');  -- bits of the delay that the query allows
  signal ended_r  : std_logic;  -- a frame that is not aborted

  signal ms_r      : natural range 0 to SECOND-1;
  signal seconds_r : unsigned(5 downto 0) := (others => '0');
  signal asked_r   : std_logic;
  signal delay     : unsigned(8 downto 0);                     -- milliseconds to the answer, of the last query
  signal delay_r   : unsigned(8 downto 0) := (others => '0');  -- of the answer that waits
  signal report_r  : std_logic;
  signal probe_r   : std_logic;

  -- The bits of a delay that stays within the time that a query allows, in tenths of a second. 0 is that of version 1,
  -- which allows ten seconds.
  function limit_of(tenths : byte_t) return unsigned is
  begin
    if unsigned(tenths) = 1 then
      return "000111111";
    elsif unsigned(tenths) = 2 then
      return "001111111";
    elsif is_within(tenths, 3, 5) = '1' then
      return "011111111";
    end if;
    return "111111111";
  end function limit_of;

begin

  -- ------------------------------------------------------------------ frames

  match : process (clk)
    variable recent : std_logic_vector(47 downto 0);
  begin
    if rising_edge(clk) then
      ended_r <= s_axis_tvalid and s_axis_tlast and not s_axis_tuser(0);
      if s_axis_tvalid = '1' then
        recent   := recent_r(39 downto 0) & s_axis_tdata;
        recent_r <= recent;
        if place_r = 0 then
          arp_r    <= '1';
          claims_r <= '0';
          query_r  <= '1';
          meant_r  <= '0';
        end if;
        if differs(place_r, s_axis_tdata, ARP) then
          arp_r <= '0';
        end if;
        if place_r = SENDER_PLACE+MAC_BYTES-1 then
          other_r <= '0';
          if recent /= mac then
            other_r <= '1';
          end if;
        elsif place_r = SENDER_PLACE+MAC_BYTES+ADDRESS_BYTES-1 then
          probes_r <= not is_in_use;
          if recent(31 downto 0) /= NO_ADDRESS then
            probes_r <= '0';
          end if;
          if recent(31 downto 0) = address then
            claims_r <= '1';
          end if;
        elsif place_r = TARGET_PLACE+ADDRESS_BYTES-1 and recent(31 downto 0) = address and probes_r = '1' then
          claims_r <= '1';
        end if;
        if differs(place_r, s_axis_tdata, IPV4) then
          query_r <= '0';
        elsif place_r = IPV4_PLACE then
          if s_axis_tdata(7 downto 4) /= VERSION or is_below(s_axis_tdata(3 downto 0), SHORTEST_HEADER) = '1' then
            query_r <= '0';
          end if;
        elsif place_r = PROTOCOL_PLACE and s_axis_tdata /= IGMP then
          query_r <= '0';
        elsif count_r = TYPE_COUNT and s_axis_tdata /= QUERY then
          query_r <= '0';
        elsif count_r = DELAY_COUNT then
          limit_r <= limit_of(s_axis_tdata);
        elsif count_r = GROUP_COUNT and (recent(31 downto 0) = NO_ADDRESS or recent(31 downto 0) = group_ip) then
          meant_r <= '1';
        end if;
        if place_r = IPV4_PLACE then
          count_r <= '0' & unsigned(s_axis_tdata(3 downto 0)) & "00";
        elsif place_r < IPV4_PLACE then
          count_r <= to_unsigned(LAST_COUNT, 7);
        elsif count_r /= LAST_COUNT then
          count_r <= count_r - 1;
        end if;
        if place_r /= LAST_PLACE then
          place_r <= place_r + 1;
        end if;
        if s_axis_tlast = '1' then
          place_r <= 0;
        end if;
      end if;
      if rst_n = '0' then
        place_r <= 0;
        ended_r <= '0';
      end if;
    end if;
  end process match;

  is_taken <= ended_r and arp_r and other_r and claims_r;

  -- ------------------------------------------------------------------ reports and probes

  wants_report <= report_r;
  wants_probe  <= probe_r and not report_r;

  -- Boards that are queried together answer at different times: the lower bits of the MAC address determine the delay
  -- of up to half a second. Of two queries, the one with the earlier answer is used.
  delay <= unsigned(mac(5 downto 0)) & "000" and limit_r;

  keep_time : process (clk)
  begin
    if rising_edge(clk) then
      if is_sent = '1' and report_r = '1' then
        report_r <= '0';
      elsif is_sent = '1' then
        probe_r <= '0';
      end if;
      if tick = '1' then
        ms_r <= (ms_r + 1) mod SECOND;
        if ms_r = SECOND-1 then
          seconds_r <= seconds_r + 1;
          if is_below(std_logic_vector(seconds_r), REPEATS) = '1' then
            report_r <= '1';
            probe_r  <= '1';
          end if;
        end if;
        delay_r <= delay_r - 1;
        if asked_r = '1' and delay_r = 0 then
          asked_r  <= '0';
          report_r <= '1';
        end if;
      end if;
      if ended_r = '1' and query_r = '1' and meant_r = '1' and (asked_r = '0' or delay < delay_r) then
        asked_r <= '1';
        delay_r <= delay;
      end if;
      if is_in_use = '0' then
        asked_r  <= '0';
        report_r <= '0';
      end if;
      if rst_n = '0' then
        ms_r      <= 0;
        seconds_r <= (others => '0');
        asked_r   <= '0';
        report_r  <= '0';
        probe_r   <= '0';
      end if;
    end if;
  end process keep_time;

end architecture rtl;
