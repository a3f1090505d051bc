-- SPDX-License-Identifier: Apache-2.0
-- Answers ARP requests for its address (RFC 826) and ICMP echo requests (RFC 792). Most bytes of a reply are those of
-- its request in the same place, so it is formed as the request arrives: a delay line supplies the moved bytes, and
-- constants replace others. The reply waits in a store until the request is known to be complete and for this host;
-- otherwise, it is dropped there.
--
-- An echo request has an IPv4 header of 20 bytes with a right checksum, is not a fragment, and arrives in a frame that
-- is long enough. Its checksum is not verified: the reply's is right if the request's is.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_net_pkg.all;

entity firm_net_responder is
  generic (
    DEPTH : integer := 2048  -- bytes of waiting replies, a power of two
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- This host, the first byte on the line highest. A frame in progress at a change may be dropped.
    mac     : in std_logic_vector(47 downto 0);
    address : in std_logic_vector(31 downto 0);

    -- All frames of firm_mac_receiver; after a last beat, six cycles are without a beat.
    s_axis_tdata  : in std_logic_vector(7 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;

    -- Replies; within a frame there is a beat in each cycle.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    is_lost : out std_logic  -- a pulse for each reply without room
  );
end entity firm_net_responder;

architecture rtl of firm_net_responder is

  -- Places in a frame, of the first byte of a field.
  constant LENGTH_PLACE      : natural := 16;  -- of IPv4
  constant FRAGMENT_PLACE    : natural := 20;
  constant PROTOCOL_PLACE    : natural := 23;
  constant SOURCE_PLACE      : natural := 26;
  constant DESTINATION_PLACE : natural := 30;
  constant ICMP_PLACE        : natural := 34;
  constant CHECKSUM_PLACE    : natural := 36;  -- of ICMP
  constant OPCODE_PLACE      : natural := 20;  -- of ARP
  constant SENDER_PLACE      : natural := 22;
  constant TARGET_PLACE      : natural := 32;
  constant MAC_BYTES         : natural := 6;
  constant ADDRESS_BYTES     : natural := 4;
  constant ETHERNET_BYTES    : natural := 14;
  constant IPV4_BYTES        : natural := 20;
  -- The place after the last decision; counts of places stop there.
  constant PLACE_BITS        : natural := 6;
  constant END_PLACE         : natural := 2**PLACE_BITS-1;

  -- Of ARP: Ethernet for IPv4, a request.
  constant ARP_REQUEST  : bytes_t(12 to 21) := (x"08", x"06", x"00", x"01", x"08", x"00", x"06", x"04", x"00", x"01");
  -- Of IPv4 without options.
  constant IPV4         : bytes_t(12 to 14) := (x"08", x"00", x"45");
  constant ICMP         : byte_t            := x"01";
  constant ECHO_REQUEST : bytes_t(34 to 35) := (x"08", x"00");
  constant ECHO_REPLY   : byte_t            := x"00";
  constant ARP_REPLY    : byte_t            := x"02";
  -- The flag for more fragments, and the offset.
  constant FRAGMENT     : byte_t            := x"3f";
  -- The reply's checksum is higher by the difference of the types, 8 in its upper byte, which overflows if these bits
  -- are ones.
  constant OVERFLOWING : std_logic_vector(7 downto 3) := "11111";

  -- The newest byte first. A reply's byte of the same place follows AHEAD bytes later: its first bytes are those of the
  -- request's source.
  constant AHEAD     : natural := MAC_BYTES;
  constant ARP_MOVE  : natural := TARGET_PLACE - SENDER_PLACE;
  constant IPV4_MOVE : natural := DESTINATION_PLACE - SOURCE_PLACE;
  signal delay_r     : bytes_t(0 to AHEAD+ARP_MOVE);

  signal place_r   : natural range 0 to END_PLACE;      -- of the request's byte
  signal at        : std_logic_vector(PLACE_BITS-1 downto 0);  -- the same
  signal shift     : std_logic;
  signal left_r    : natural range 0 to AHEAD;          -- shifts after the request's last byte
  signal early_r   : natural range 0 to AHEAD;          -- shifts before the reply's first byte

  -- Of the request so far.
  signal direct_r    : std_logic;                       -- it is sent only to this host
  signal broadcast_r : std_logic;
  signal arp_r       : std_logic;                       -- it is an ARP request for this host
  signal echo_r      : std_logic;                       -- it is an echo request for this host
  -- Of the IPv4 header's words; the highest bit is a carry, which is added with the next word.
  signal sum_r       : unsigned(16 downto 0) := (others => '0');
  signal unseen_r    : unsigned(15 downto 0) := (others => '0');  -- remaining bytes of the IPv4 packet, plus four
  signal enough_r    : std_logic;                       -- the packet has an ICMP header
  signal summed_r    : std_logic;                       -- the IPv4 header's checksum is right
  signal holds_r     : std_logic;                       -- the frame holds the IPv4 packet
  signal aborted_r   : std_logic;

  -- The source of a reply's byte: the request's byte of the same place, one of another place, or a different byte.
  type origin_t is (SAME, SOURCE, ARP_MOVED, IPV4_MOVED, GIVEN);

  -- The place after that of the reply's byte. The source of that byte depends only on its place, and is determined one
  -- byte earlier.
  signal reply_next_r : natural range 0 to END_PLACE;
  signal origin_r     : origin_t;
  signal given_r      : byte_t;
  signal upper_r      : std_logic;  -- it is the upper byte of the checksum
  signal lower_r      : std_logic;
  signal overflows_r  : std_logic;  -- the byte at AHEAD overflows as the upper byte of a checksum
  signal overflowed_r : std_logic;  -- the one before it
  signal full_r       : std_logic;  -- the one after it is all ones
  signal carried      : std_logic;
  signal increase     : unsigned(7 downto 0);  -- of a byte of the checksum

  signal reply_tdata   : byte_t;
  signal reply_tuser   : std_logic_vector(0 downto 0);
  signal reply_tvalid  : std_logic;
  signal reply_tlast   : std_logic;
  signal chosen_tdata  : byte_t;
  signal chosen_tuser  : std_logic_vector(0 downto 0);
  signal chosen_tvalid : std_logic;
  signal chosen_tlast  : std_logic;

  -- The source of a reply's byte at `place`.
  function origin_of(place : natural; is_arp : std_logic) return origin_t is
    constant BITS : std_logic_vector(PLACE_BITS-1 downto 0) := std_logic_vector(to_unsigned(place, PLACE_BITS));
  begin
    if is_below(BITS, MAC_BYTES) = '1' then
      return SOURCE;
    elsif is_below(BITS, 2*MAC_BYTES) = '1' then
      return GIVEN;
    elsif is_arp = '1' then
      if is_within(BITS, OPCODE_PLACE+1, TARGET_PLACE-1) = '1' then
        return GIVEN;
      elsif is_within(BITS, TARGET_PLACE, TARGET_PLACE+ARP_MOVE-1) = '1' then
        return ARP_MOVED;
      end if;
    elsif is_within(BITS, SOURCE_PLACE, DESTINATION_PLACE-1) = '1' then
      return GIVEN;
    elsif is_within(BITS, DESTINATION_PLACE, DESTINATION_PLACE+IPV4_MOVE-1) = '1' then
      return IPV4_MOVED;
    elsif place = ICMP_PLACE then
      return GIVEN;
    end if;
    return SAME;
  end function origin_of;

  -- The byte of the reply's opcode, this host's MAC address and address, or the reply's type at this place.
  function given_of(place : natural; is_arp : std_logic) return natural is
    constant MAC_AT     : natural := 1;
    constant ADDRESS_AT : natural := MAC_AT+MAC_BYTES;
    constant TYPE_AT    : natural := ADDRESS_AT+ADDRESS_BYTES;
  begin
    for index in 0 to TYPE_AT-1 loop
      if (index >= MAC_AT and index < ADDRESS_AT and place = MAC_BYTES-MAC_AT+index)
         or (is_arp = '1' and place = OPCODE_PLACE+1+index)
         or (is_arp = '0' and index >= ADDRESS_AT and place = SOURCE_PLACE-ADDRESS_AT+index) then
        return index;
      end if;
    end loop;
    return TYPE_AT;
  end function given_of;

begin

  at    <= std_logic_vector(to_unsigned(place_r, PLACE_BITS));
  shift <= '1' when s_axis_tvalid = '1' or left_r /= 0 else '0';

  delay : process (clk)
  begin
    if rising_edge(clk) and shift = '1' then
      delay_r(0)                 <= s_axis_tdata;
      delay_r(1 to delay_r'high) <= delay_r(0 to delay_r'high-1);
      overflows_r                <= '0';
      overflowed_r               <= overflows_r;
      full_r                     <= '0';
      if delay_r(AHEAD-1)(OVERFLOWING'range) = OVERFLOWING then
        overflows_r <= '1';
      end if;
      if delay_r(AHEAD-2) = x"ff" then
        full_r <= '1';
      end if;
    end if;
  end process delay;

  -- ------------------------------------------------------------------ the request

  follow : process (clk)
  begin
    if rising_edge(clk) then
      if s_axis_tvalid = '1' then
        if place_r /= END_PLACE then
          place_r <= place_r + 1;
        end if;
        if s_axis_tlast = '1' then
          place_r <= 0;
          left_r  <= AHEAD;
        end if;
      elsif left_r /= 0 then
        left_r <= left_r - 1;
      end if;
      if rst_n = '0' then
        place_r <= 0;
        left_r  <= 0;
      end if;
    end if;
  end process follow;

  match : process (clk)
    variable arp_differs  : boolean;
    variable echo_differs : boolean;
  begin
    if rising_edge(clk) and s_axis_tvalid = '1' then
      if place_r = 0 then
        direct_r    <= '1';
        broadcast_r <= '1';
        arp_r       <= '1';
        echo_r      <= '1';
      end if;
      if is_below(at, MAC_BYTES) = '1' then
        if differs(place_r, s_axis_tdata, placed(mac, 0)) then
          direct_r <= '0';
        end if;
        if s_axis_tdata /= x"ff" then
          broadcast_r <= '0';
        end if;
      end if;

      arp_differs  := differs(place_r, s_axis_tdata, ARP_REQUEST)
                      or differs(place_r, s_axis_tdata, placed(address, TARGET_PLACE+MAC_BYTES));
      echo_differs := differs(place_r, s_axis_tdata, IPV4)
                      or differs(place_r, s_axis_tdata, ECHO_REQUEST)
                      or differs(place_r, s_axis_tdata, placed(address, DESTINATION_PLACE));
      if place_r = MAC_BYTES then
        -- A multicast address is not a valid source address.
        arp_differs  := s_axis_tdata(0) = '1' or (direct_r or broadcast_r) = '0';
        echo_differs := s_axis_tdata(0) = '1' or direct_r = '0';
      elsif place_r = FRAGMENT_PLACE and (s_axis_tdata and FRAGMENT) /= x"00" then
        echo_differs := true;
      elsif place_r = FRAGMENT_PLACE+1 and s_axis_tdata /= x"00" then
        echo_differs := true;
      elsif place_r = PROTOCOL_PLACE and s_axis_tdata /= ICMP then
        echo_differs := true;
      end if;
      if arp_differs then
        arp_r <= '0';
      end if;
      if echo_differs then
        echo_r <= '0';
      end if;
      aborted_r <= s_axis_tuser(0);
    end if;
  end process match;

  check_header : process (clk)
    variable carry : unsigned(0 downto 0);
  begin
    if rising_edge(clk) and s_axis_tvalid = '1' then
      if place_r = 0 then
        sum_r <= (others => '0');
      elsif is_within(at, ETHERNET_BYTES, ETHERNET_BYTES+IPV4_BYTES-1) = '1' and place_r mod 2 = 1 then
        carry(0) := sum_r(16);
        sum_r    <= resize(sum_r(15 downto 0), 17) + (unsigned(delay_r(0)) & unsigned(s_axis_tdata)) + carry;
      end if;
      -- The four bytes up to here are counted at the end.
      if place_r = LENGTH_PLACE+1 then
        unseen_r <= unsigned(delay_r(0)) & unsigned(s_axis_tdata);
      elsif unseen_r /= 0 then
        unseen_r <= unseen_r - 1;
      end if;
      if place_r = LENGTH_PLACE+2 then
        enough_r <= '0';
        -- At least 28 bytes; a comparison of parts needs no adder.
        if unseen_r(15 downto 5) /= 0 or unseen_r(4 downto 2) = "111" then
          enough_r <= '1';
        end if;
      end if;
    end if;
  end process check_header;

  -- The words and the carries add up to all ones; the frame holds the packet. Separate registers: there is time until
  -- the reply ends.
  judge : process (clk)
  begin
    if rising_edge(clk) then
      summed_r <= '0';
      if sum_r(15 downto 1) = "111111111111111" then
        summed_r <= sum_r(0) xor sum_r(16);
      end if;
      holds_r <= '0';
      if enough_r = '1' and unseen_r(15 downto 3) = 0 and (unseen_r(2) = '0' or unseen_r(1 downto 0) = 0) then
        holds_r <= '1';
      end if;
    end if;
  end process judge;

  -- ------------------------------------------------------------------ the reply

  follow_reply : process (clk)
  begin
    if rising_edge(clk) then
      reply_tvalid <= '0';
      reply_tlast  <= '0';
      if shift = '1' then
        if early_r /= 0 then
          early_r <= early_r - 1;
        else
          reply_tvalid <= '1';
        end if;
        if left_r = 1 then
          early_r     <= AHEAD;
          reply_tlast <= '1';
        end if;
      end if;
      if rst_n = '0' then
        reply_tvalid <= '0';
        early_r      <= AHEAD;
      end if;
    end if;
  end process follow_reply;

  decide : process (clk)
  begin
    if rising_edge(clk) then
      if reply_tvalid = '1' then
        if reply_next_r /= END_PLACE then
          reply_next_r <= reply_next_r + 1;
        end if;
        origin_r <= origin_of(reply_next_r, arp_r);
        given_r  <= byte_of(ARP_REPLY & mac & address & ECHO_REPLY, given_of(reply_next_r, arp_r));
        upper_r <= '0';
        lower_r <= '0';
        if arp_r = '0' and reply_next_r = CHECKSUM_PLACE then
          upper_r <= '1';
        elsif arp_r = '0' and reply_next_r = CHECKSUM_PLACE+1 then
          lower_r <= '1';
        end if;
      end if;
      if rst_n = '0' or (reply_tvalid = '1' and reply_tlast = '1') then
        reply_next_r <= 1;
        origin_r     <= SOURCE;
        upper_r      <= '0';
        lower_r      <= '0';
      end if;
    end if;
  end process decide;

  -- In ones' complement, a carry out of the upper byte enters the lower one, and may come back from there.
  carried  <= (upper_r and overflows_r and full_r) or (lower_r and overflowed_r);
  increase <= "0000" & upper_r & "00" & carried;

  reply_tdata <= delay_r(0) when origin_r = SOURCE else
                 delay_r(AHEAD+ARP_MOVE) when origin_r = ARP_MOVED else
                 delay_r(AHEAD+IPV4_MOVE) when origin_r = IPV4_MOVED else
                 given_r when origin_r = GIVEN else
                 std_logic_vector(unsigned(delay_r(AHEAD)) + increase);

  reply_tuser(0) <= aborted_r or not (arp_r or (echo_r and summed_r and holds_r));

  -- A separate cycle for the choice.
  hold_reply : process (clk)
  begin
    if rising_edge(clk) then
      chosen_tdata  <= reply_tdata;
      chosen_tuser  <= reply_tuser;
      chosen_tvalid <= reply_tvalid;
      chosen_tlast  <= reply_tlast;
      if rst_n = '0' then
        chosen_tvalid <= '0';
      end if;
    end if;
  end process hold_reply;

  u_store : entity firm.firm_mac_store
    generic map (
      DEPTH => DEPTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => chosen_tdata,
      s_axis_tuser  => chosen_tuser,
      s_axis_tvalid => chosen_tvalid,
      s_axis_tlast  => chosen_tlast,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready,
      is_lost       => is_lost
    );

end architecture rtl;
