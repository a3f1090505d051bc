-- SPDX-License-Identifier: Apache-2.0
-- Extracts the UDP datagrams for this host, or for its group, from Ethernet frames (RFC 768, RFC 791, RFC 1112).
-- The payload is forwarded while it arrives. Its last byte waits for the end of the frame, since only then the frame,
-- the packet and the datagram are known to be whole.
--
-- Options of IPv4 are skipped. Fragments are not reassembled: they are dropped, and each is reported.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_udp_receiver is
  generic (
    PORTS : integer := 3  -- UDP ports, 1 to 16
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- This host and its group, the first byte on the line highest; port 0 in the lowest 16 bits.
    mac       : in std_logic_vector(47 downto 0);
    address   : in std_logic_vector(31 downto 0);
    group_ip  : in std_logic_vector(31 downto 0);
    udp_ports : in std_logic_vector(16*PORTS-1 downto 0);

    -- All frames of firm_mac_receiver; after a last beat, six cycles are without a beat.
    s_axis_tdata  : in std_logic_vector(7 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;

    -- Payloads; tuser(0) of a last beat aborts. A datagram without a payload has no beat.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    -- Of the datagram: its sender, and which of the ports it is for.
    source_mac     : out std_logic_vector(47 downto 0);
    source_address : out std_logic_vector(31 downto 0);
    source_port    : out std_logic_vector(15 downto 0);
    port_match     : out std_logic_vector(PORTS-1 downto 0);

    -- Pulses at the end of a frame for this host.
    is_fragment : out std_logic;
    is_broken   : out std_logic
  );
end entity firm_udp_receiver;

architecture rtl of firm_udp_receiver is

  constant MOST_PORTS : positive := 16;

  type section_t is (ETHERNET, HEADER, DATAGRAM, PAYLOAD);
  constant MAC_BYTES       : natural := 6;
  constant SOURCE_END      : natural := 12;  -- of the sender's MAC address
  constant ETHERNET_LAST   : natural := 13;
  constant ADDRESSES       : natural := 12;  -- in the header of IPv4
  constant HEADER_LAST     : natural := 19;  -- of a header without options
  constant SHORTEST_HEADER : natural := 5;  -- in words
  constant DATAGRAM_BYTES  : natural := 8;
  constant LENGTH_END      : natural := 6;   -- of the datagram's length, in its header
  constant DATA_END        : natural := 6;   -- a datagram's bytes that are not counted down
  constant PLACE_BITS      : natural := 6;
  constant LAST_PLACE      : natural := 2**PLACE_BITS-1;
  -- Of IPv4: high and low byte of its type, version, and the protocol.
  constant TYPE_HIGH : std_logic_vector(7 downto 0) := x"08";
  constant TYPE_LOW  : std_logic_vector(7 downto 0) := x"00";
  constant VERSION   : std_logic_vector(3 downto 0) := x"4";
  constant UDP       : unsigned(7 downto 0)         := x"11";
  -- A group's MAC address begins with this, and ends with 23 bits of its IPv4 address.
  constant GROUP_MAC : std_logic_vector(24 downto 0) := x"01005e" & '0';
  -- The flag for more fragments, and the upper bits of the offset.
  constant FRAGMENT  : std_logic_vector(7 downto 0) := x"3f";

  signal section_r : section_t;
  signal place_r   : natural range 0 to LAST_PLACE;  -- in the section
  signal at        : std_logic_vector(PLACE_BITS-1 downto 0);  -- the same
  signal odd_r     : std_logic;                      -- the byte is the lower one of a word

  -- Of the frame so far.
  signal direct_r       : std_logic;  -- it is sent to this host
  signal grouped_r      : std_logic;  -- it is sent to the group
  signal mine_r         : std_logic;
  signal fragment_r     : std_logic;
  signal header_bytes_r : unsigned(5 downto 0) := (others => '0');
  -- Four more than the bytes of the packet to come, and from the third byte of a datagram on, six more than those.
  signal packet_left_r  : unsigned(15 downto 0) := (others => '0');
  signal short_r        : std_logic;  -- the packet has no room for a datagram
  signal header_sum_r   : unsigned(16 downto 0) := (others => '0');
  signal header_right_r : std_logic;
  signal port_r         : std_logic_vector(PORTS-1 downto 0);
  -- Bytes of the datagram after its length: those to come, and six.
  signal length_r       : unsigned(15 downto 0) := (others => '0');
  signal has_data       : std_logic;  -- bytes of the payload remain
  signal misfit_r       : std_logic;  -- the datagram does not fit into the packet
  signal unsummed_r     : std_logic;  -- the datagram has no checksum
  signal sum_r          : unsigned(16 downto 0) := (others => '0');
  signal accepted_r     : std_logic;

  signal held_r       : std_logic_vector(7 downto 0);
  signal has_held_r   : std_logic;
  signal source_mac_r : std_logic_vector(47 downto 0);
  signal source_ip_r  : std_logic_vector(31 downto 0);
  signal source_udp_r : std_logic_vector(15 downto 0);
  signal target_r     : std_logic_vector(47 downto 0);  -- the last six bytes

  -- Of the frame that has ended: one cycle later, and two cycles later.
  signal ended_r     : std_logic;
  signal judged_r    : std_logic;
  signal aborted_r   : std_logic;
  signal past_r      : std_logic;  -- it continued after the header
  signal named_r     : std_logic;  -- it reached the end of the addresses
  signal full_r      : std_logic;  -- it holds the header of a datagram
  signal whole       : std_logic;  -- it holds the packet
  signal whole_r     : std_logic;
  signal summed      : std_logic;  -- the datagram's checksum is right, or there is none
  signal summed_r    : std_logic;

  -- The sum with a further byte, once or twice, and the carry of before, which is the highest bit. In ones' complement,
  -- twice a word is the word rotated by one bit.
  function added(sum : unsigned(16 downto 0); byte : std_logic_vector(7 downto 0); odd : std_logic; twice : boolean)
    return unsigned is
    variable word  : unsigned(15 downto 0) := (others => '0');
    variable carry : unsigned(0 downto 0);
  begin
    if odd = '1' then
      word(7 downto 0) := unsigned(byte);
    else
      word(15 downto 8) := unsigned(byte);
    end if;
    if twice then
      word := word(14 downto 0) & word(15);
    end if;
    carry(0) := sum(16);
    return resize(sum(15 downto 0), 17) + word + carry;
  end function added;

  -- Whether words and carry add up to all ones.
  function is_right(sum : unsigned(16 downto 0)) return std_logic is
  begin
    if sum(15 downto 1) = "111111111111111" then
      return sum(0) xor sum(16);
    end if;
    return '0';
  end function is_right;

begin

  assert PORTS >= 1 and PORTS <= MOST_PORTS
    report "firm_udp_receiver: PORTS is " & integer'image(PORTS) & "; legal: 1 to " & integer'image(MOST_PORTS)
    severity failure;

  at <= std_logic_vector(to_unsigned(place_r, PLACE_BITS));

  follow : process (clk)
  begin
    if rising_edge(clk) then
      if s_axis_tvalid = '1' then
        odd_r <= not odd_r;
        if place_r /= LAST_PLACE then
          place_r <= place_r + 1;
        end if;
        if section_r = ETHERNET and place_r = ETHERNET_LAST then
          section_r <= HEADER;
          place_r   <= 0;
        elsif section_r = HEADER and is_below(at, HEADER_LAST) = '0'
              and to_unsigned(place_r + 1, 7) = header_bytes_r then
          section_r <= DATAGRAM;
          place_r   <= 0;
        elsif section_r = DATAGRAM and place_r = DATAGRAM_BYTES-1 then
          section_r <= PAYLOAD;
        end if;
        if s_axis_tlast = '1' then
          section_r <= ETHERNET;
          place_r   <= 0;
          odd_r     <= '0';
        end if;
      end if;
      if rst_n = '0' then
        section_r <= ETHERNET;
        place_r   <= 0;
        odd_r     <= '0';
      end if;
    end if;
  end process follow;

  -- ------------------------------------------------------------------ Ethernet and IPv4

  match : process (clk)
    variable recent : std_logic_vector(47 downto 0);
  begin
    if rising_edge(clk) and s_axis_tvalid = '1' then
      recent   := target_r(39 downto 0) & s_axis_tdata;
      target_r <= recent;
      if section_r = ETHERNET then
        if place_r = 0 then
          mine_r     <= '1';
          fragment_r <= '0';
        elsif place_r = MAC_BYTES-1 then
          direct_r  <= '0';
          grouped_r <= '0';
          if recent = mac then
            direct_r <= '1';
          end if;
          if recent = GROUP_MAC & group_ip(22 downto 0) then
            grouped_r <= '1';
          end if;
        elsif place_r = MAC_BYTES and s_axis_tdata(0) = '1' then
          -- A multicast address is not a valid source address.
          mine_r <= '0';
        elsif place_r = SOURCE_END-1 then
          source_mac_r <= recent;
        elsif place_r = ETHERNET_LAST-1 and s_axis_tdata /= TYPE_HIGH then
          mine_r <= '0';
        elsif place_r = ETHERNET_LAST and s_axis_tdata /= TYPE_LOW then
          mine_r <= '0';
        end if;
      elsif section_r = HEADER then
        if place_r = 0 then
          header_bytes_r <= unsigned(s_axis_tdata(3 downto 0)) & "00";
          if s_axis_tdata(7 downto 4) /= VERSION or is_below(s_axis_tdata(3 downto 0), SHORTEST_HEADER) = '1' then
            mine_r <= '0';
          end if;
        elsif place_r = 6 and (s_axis_tdata and FRAGMENT) /= x"00" then
          fragment_r <= '1';
        elsif place_r = 7 and s_axis_tdata /= x"00" then
          fragment_r <= '1';
        elsif place_r = 9 and unsigned(s_axis_tdata) /= UDP then
          mine_r <= '0';
        elsif place_r = 15 then
          source_ip_r <= recent(31 downto 0);
        elsif place_r = HEADER_LAST then
          if not ((direct_r = '1' and recent(31 downto 0) = address)
                  or (grouped_r = '1' and recent(31 downto 0) = group_ip)) then
            mine_r <= '0';
          end if;
        end if;
      end if;
    end if;
  end process match;

  check_header : process (clk)
  begin
    if rising_edge(clk) then
      header_right_r <= is_right(header_sum_r);
      if s_axis_tvalid = '1' then
        if section_r = ETHERNET then
          header_sum_r  <= (others => '0');
          packet_left_r <= (others => '1');
        elsif section_r = HEADER then
          header_sum_r <= added(header_sum_r, s_axis_tdata, odd_r, false);
        end if;
        -- The four bytes up to here are counted at the end, and so are two of a datagram. This is therefore the
        -- packet's room for the datagram, when its length has arrived.
        if section_r = HEADER and place_r = 3 then
          packet_left_r <= unsigned(target_r(7 downto 0)) & unsigned(s_axis_tdata);
        elsif section_r /= ETHERNET and packet_left_r /= 0 and not (section_r = DATAGRAM and is_below(at, 2) = '1') then
          packet_left_r <= packet_left_r - 1;
        end if;
      end if;
    end if;
  end process check_header;

  -- ------------------------------------------------------------------ UDP

  read_datagram : process (clk)
    variable recent : std_logic_vector(15 downto 0);
  begin
    if rising_edge(clk) and s_axis_tvalid = '1' then
      recent := target_r(7 downto 0) & s_axis_tdata;
      if section_r = DATAGRAM then
        if place_r = 1 then
          source_udp_r <= recent;
        elsif place_r = 3 then
          for index in 0 to PORTS-1 loop
            port_r(index) <= '0';
            if recent = udp_ports(16*index+15 downto 16*index) then
              port_r(index) <= '1';
            end if;
          end loop;
        elsif place_r = 5 then
          length_r <= unsigned(recent);
        elsif place_r = LENGTH_END then
          misfit_r <= '0';
          short_r  <= '0';
          if length_r(15 downto 3) = 0 or length_r > packet_left_r then
            misfit_r <= '1';
          end if;
          if packet_left_r(15 downto 3) = 0 then
            short_r <= '1';
          end if;
        elsif place_r = 7 then
          unsummed_r <= '0';
          if recent = x"0000" then
            unsummed_r <= '1';
          end if;
          accepted_r <= '0';
          if mine_r = '1' and fragment_r = '0' and short_r = '0' and header_right_r = '1' and misfit_r = '0'
             and unsigned(port_r) /= 0 then
            accepted_r <= '1';
          end if;
        end if;
      elsif section_r = ETHERNET then
        accepted_r <= '0';
      end if;
      if (section_r = DATAGRAM and is_below(at, LENGTH_END) = '0') or (section_r = PAYLOAD and has_data = '1') then
        length_r <= length_r - 1;
      end if;
    end if;
  end process read_datagram;

  has_data <= '0' when length_r = DATA_END else '1';

  -- The checksum covers both addresses, the protocol, the datagram, and once more its length.
  add_datagram : process (clk)
  begin
    if rising_edge(clk) and s_axis_tvalid = '1' then
      if section_r = ETHERNET then
        sum_r <= resize(UDP, 17);
      elsif section_r = HEADER and is_within(at, ADDRESSES, HEADER_LAST) = '1' then
        sum_r <= added(sum_r, s_axis_tdata, odd_r, false);
      elsif section_r = DATAGRAM then
        sum_r <= added(sum_r, s_axis_tdata, odd_r, place_r = 4 or place_r = 5);
      elsif section_r = PAYLOAD and has_data = '1' then
        sum_r <= added(sum_r, s_axis_tdata, odd_r, false);
      end if;
    end if;
  end process add_datagram;

  -- ------------------------------------------------------------------ the end

  whole  <= '1' when packet_left_r(15 downto 3) = 0 and packet_left_r(2 downto 0) /= "111" else '0';
  summed <= unsummed_r or is_right(sum_r);

  judge : process (clk)
  begin
    if rising_edge(clk) then
      ended_r  <= s_axis_tvalid and s_axis_tlast;
      judged_r <= ended_r;
      if s_axis_tvalid = '1' then
        aborted_r <= s_axis_tuser(0);
        past_r    <= '0';
        named_r   <= '0';
        full_r    <= '0';
        if section_r = PAYLOAD or (section_r = DATAGRAM and place_r = DATAGRAM_BYTES-1) then
          full_r <= '1';
        end if;
        if section_r = DATAGRAM or section_r = PAYLOAD then
          past_r  <= '1';
          named_r <= '1';
        elsif section_r = HEADER and is_below(at, HEADER_LAST) = '0' then
          named_r <= '1';
        end if;
      end if;
      whole_r  <= whole;
      summed_r <= summed;
      if rst_n = '0' then
        ended_r  <= '0';
        judged_r <= '0';
      end if;
    end if;
  end process judge;

  -- Damage to the header, then to the packet, then to the datagram, if it is for one of the ports.
  tell : process (clk)
  begin
    if rising_edge(clk) then
      is_fragment <= '0';
      is_broken   <= '0';
      if judged_r = '1' and aborted_r = '0' and mine_r = '1' and named_r = '1' then
        if past_r = '0' or header_right_r = '0' then
          is_broken <= '1';
        elsif fragment_r = '1' then
          is_fragment <= '1';
        elsif full_r = '0' or short_r = '1' or whole_r = '0' then
          is_broken <= '1';
        elsif unsigned(port_r) /= 0 and (misfit_r = '1' or summed_r = '0') then
          is_broken <= '1';
        end if;
      end if;
      if rst_n = '0' then
        is_fragment <= '0';
        is_broken   <= '0';
      end if;
    end if;
  end process tell;

  hold : process (clk)
  begin
    if rising_edge(clk) then
      m_axis_tvalid <= '0';
      m_axis_tlast  <= '0';
      m_axis_tuser  <= "0";
      m_axis_tdata  <= held_r;
      if s_axis_tvalid = '1' and section_r = PAYLOAD and accepted_r = '1' and has_data = '1' then
        m_axis_tvalid <= has_held_r;
        held_r        <= s_axis_tdata;
        has_held_r    <= '1';
      elsif ended_r = '1' then
        m_axis_tvalid   <= has_held_r;
        m_axis_tlast    <= has_held_r;
        m_axis_tuser(0) <= aborted_r or not (whole and summed);
        has_held_r      <= '0';
      end if;
      if rst_n = '0' then
        m_axis_tvalid <= '0';
        has_held_r    <= '0';
      end if;
    end if;
  end process hold;

  source_mac     <= source_mac_r;
  source_address <= source_ip_r;
  source_port    <= source_udp_r;
  port_match     <= port_r;

end architecture rtl;
