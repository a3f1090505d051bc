-- SPDX-License-Identifier: Apache-2.0
-- The host's two streams of a system that is a node of ROS 2 itself: firm_rtps_node between Ethernet frames on a line
-- and streams of any width. External memories define the node: its program, its packets and its names. It also answers
-- ARP and ping, and keeps its place in the network.
--
-- The board does not resolve MAC addresses: it sends only to peers, at the MAC address from which the peer's
-- announcement arrived, that of the peer or of the router to it.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_net_link is
  generic (
    WIDTH        : integer := 8;
    CLOCK_HZ     : integer := 125000000;
    WRITERS      : integer := 2;   -- see firm_rtps_node
    READERS      : integer := 1;
    SOURCES      : integer := 8;
    SINKS        : integer := 16;
    SAMPLE       : integer := 64;
    SLOTS        : integer := 16;
    PROGRAM_BITS : integer := 12;  -- of an address in the memory of packets
    -- Numbers of packets.
    REPORT_PACKET : integer := 0;
    PROBE_PACKET  : integer := 0;
    HAS_STATUS    : boolean := false; -- the system has a status, accessible by UDP
    DISCOVERY     : integer := 4096;  -- bytes of discovery and of payloads that wait, see firm_rtps_node
    PAYLOADS      : integer := 4096;
    ASSEMBLED     : integer := 0;     -- bytes of the longest assembled message, see firm_rtps_node
    -- Packets whose fragments may be interleaved, 0 to 4, and the bytes of the longest one; without them, fragments
    -- are dropped.
    REASSEMBLIES : integer := 0;
    REASSEMBLED  : integer := 16384;
    -- The address is obtained by DHCP, and the port `address` is ignored.
    HAS_DHCP            : boolean := false;
    DHCP_PACKET         : integer := 0;
    RENEWAL_PACKET      : integer := 0;
    ANNOUNCEMENT_PACKET : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- This host, the first byte on the line highest; the ports of its domain.
    mac       : in std_logic_vector(47 downto 0);
    address   : in std_logic_vector(31 downto 0);
    udp_ports : in std_logic_vector(47 downto 0);

    -- The quality of the node's endpoints: see firm_rtps_node.
    are_reliable  : in std_logic_vector(READERS+WRITERS-1 downto 0);
    are_transient : in std_logic_vector(READERS+WRITERS-1 downto 0);

    -- The memories created by fusesoc_firm.fabric.control, fusesoc_firm.fabric.packets and fusesoc_firm.fabric.names.
    control_enable  : out std_logic;
    control_address : out std_logic_vector(RTPS_CONTROL_BITS-1 downto 0);
    control_word    : in  std_logic_vector(35 downto 0);
    packet          : out std_logic_vector(7 downto 0);
    entry           : in  std_logic_vector(PROGRAM_BITS-1 downto 0);
    program_enable  : out std_logic;
    program_address : out std_logic_vector(PROGRAM_BITS-1 downto 0);
    program_word    : in  std_logic_vector(10 downto 0);
    names_address   : out std_logic_vector(9 downto 0);
    names_data      : in  std_logic_vector(8*(READERS+WRITERS)-1 downto 0);

    -- The line: of firm_gmii, firm_mii or firm_rmii.
    rx_step : in  std_logic;
    rx_dv   : in  std_logic;
    rx_er   : in  std_logic;
    rxd     : in  std_logic_vector(7 downto 0);
    tx_step : in  std_logic;
    tx_en   : out std_logic;
    tx_er   : out std_logic;
    txd     : out std_logic_vector(7 downto 0);

    -- Frames to the system, never aborted.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- Frames from the system; an aborted one is dropped.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- Pulses:
    --   0  a frame on the line is broken or too long
    --   1  a datagram for the board is broken
    --   2  a fragment or an incomplete packet is dropped
    --   3  a reply to ARP or ping, a packet of discovery or a frame beside a reassembled packet has no room
    --   4  another node has no room
    --   5  a publisher or subscriber of another node, of a topic of the board, has no room
    --   6  a message of another node has no room, or comes in fragments of RTPS and is too long or the node takes none
    --   7  a message to send is empty, too long or of no publisher, or the board has no address yet
    --   8  another host has the address of the board
    --   9  a packet of RTPS, or a list of parameters in it, is broken
    --  10  a publisher or subscriber of a topic of the board has another type, hash, quality, partition or encoding
    network_error : out std_logic_vector(10 downto 0)
  );
end entity firm_net_link;

architecture rtl of firm_net_link is

  constant PORTS             : positive := 3;
  constant GROUP_IP          : std_logic_vector(31 downto 0) := x"efff0001";  -- 239.255.0.1
  constant MOST_REASSEMBLIES : natural := 4;

  function cycles_of(hertz : integer) return positive is
  begin
    if hertz < 1000 then
      return 1;
    end if;
    return hertz / 1000;
  end function cycles_of;

  function number_of(number : integer) return std_logic_vector is
    variable bits : std_logic_vector(7 downto 0) := (others => '0');
  begin
    for place in bits'range loop
      if (number / 2**place) mod 2 = 1 then
        bits(place) := '1';
      end if;
    end loop;
    return bits;
  end function number_of;

  function sources_sent_of(answers : boolean) return positive is
  begin
    if answers then
      return 3;
    end if;
    return 2;
  end function sources_sent_of;

  constant CYCLES       : positive := cycles_of(CLOCK_HZ);
  constant SOURCES_SENT : positive := sources_sent_of(HAS_STATUS);
  -- A constant prefix does not change at a restart: vendor, MAC address, zeros.
  constant PREFIX_HEAD : std_logic_vector(15 downto 0) := x"0000";
  constant PREFIX_TAIL : std_logic_vector(31 downto 0) := x"00000000";

  signal cycle_r : natural range 0 to CYCLES-1;
  signal tick_r  : std_logic;

  signal received_tdata  : std_logic_vector(7 downto 0);
  signal received_tuser  : std_logic_vector(0 downto 0);
  signal received_tvalid : std_logic;
  signal received_tlast  : std_logic;

  -- The same, with whole packets instead of their fragments.
  signal whole_tdata  : std_logic_vector(7 downto 0);
  signal whole_tuser  : std_logic_vector(0 downto 0);
  signal whole_tvalid : std_logic;
  signal whole_tlast  : std_logic;

  signal datagram_tdata  : std_logic_vector(7 downto 0);
  signal datagram_tuser  : std_logic_vector(0 downto 0);
  signal datagram_tvalid : std_logic;
  signal datagram_tlast  : std_logic;
  signal source_mac      : std_logic_vector(47 downto 0);
  signal prefix          : std_logic_vector(95 downto 0);

  signal in_tdata   : std_logic_vector(7 downto 0);
  signal in_tvalid  : std_logic;
  signal in_tlast   : std_logic;
  signal in_tready  : std_logic;
  signal out_tdata  : std_logic_vector(7 downto 0);
  signal out_tuser  : std_logic_vector(0 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

  -- Frames of the node without those of the status.
  signal sample_tdata  : std_logic_vector(7 downto 0);
  signal sample_tvalid : std_logic;
  signal sample_tlast  : std_logic;
  signal sample_tready : std_logic;
  -- The same while the node runs.
  signal given_tvalid : std_logic;
  signal given_tready : std_logic;
  signal frame_tvalid : std_logic;
  signal frame_tready : std_logic;
  -- Those that the node accepts.
  signal offered_tvalid : std_logic;
  signal offered_tready : std_logic;

  -- This host: constant without DHCP. With DHCP, the node and all users of its address are idle without one.
  signal own_address : std_logic_vector(31 downto 0);
  signal is_bound    : std_logic;
  signal node_runs   : std_logic;
  signal node_rst_n  : std_logic;
  signal watch_rst_n : std_logic;  -- of the presence
  signal node_takes  : std_logic;  -- frames of the system
  signal node_busy   : std_logic;
  signal heard_valid : std_logic;  -- a byte received, for the users of the address
  signal data_bytes  : std_logic_vector(15 downto 0);
  signal own_select  : std_logic_vector(6 downto 0);
  signal own_byte    : std_logic_vector(7 downto 0);
  signal is_conflict : std_logic;

  -- Packets of the node, of its presence, and of DHCP.
  signal node_start    : std_logic;
  signal node_starts   : std_logic;
  signal wants_dhcp    : std_logic;
  signal client_packet : std_logic_vector(7 downto 0);
  signal node_packet   : std_logic_vector(7 downto 0);
  signal wants_report  : std_logic;
  signal wants_probe   : std_logic;
  signal is_sent       : std_logic;
  signal start         : std_logic;
  signal payload_bytes : std_logic_vector(15 downto 0);
  signal bank          : std_logic_vector(RTPS_BANK_BITS-1 downto 0);
  signal is_busy       : std_logic;

  signal field_valid    : std_logic;
  signal field_bank     : std_logic_vector(RTPS_BANK_BITS-1 downto 0);
  signal field_address  : std_logic_vector(6 downto 0);
  signal field_data     : std_logic_vector(7 downto 0);
  signal payload_tdata  : std_logic_vector(7 downto 0);
  signal payload_tvalid : std_logic;
  signal payload_tready : std_logic;

  -- Replies to ARP and ping, packets, then replies of the status.
  signal sources_tdata  : std_logic_vector(8*SOURCES_SENT-1 downto 0);
  signal sources_tvalid : std_logic_vector(SOURCES_SENT-1 downto 0);
  signal sources_tlast  : std_logic_vector(SOURCES_SENT-1 downto 0);
  signal sources_tready : std_logic_vector(SOURCES_SENT-1 downto 0);
  signal sent_tdata     : std_logic_vector(7 downto 0);
  signal sent_tvalid    : std_logic;
  signal sent_tlast     : std_logic;
  signal sent_tready    : std_logic;

  signal is_broken     : std_logic;
  signal is_too_long   : std_logic;
  signal is_reply_lost : std_logic;
  signal is_lost       : std_logic;

  signal is_fragment       : std_logic;
  signal is_sample_lost    : std_logic;
  signal is_sample_parted  : std_logic;
  signal is_packet_dropped : std_logic;
  signal is_frame_lost     : std_logic;
  signal is_frame_refused  : std_logic;
  signal is_frame_dropped  : std_logic;  -- of the system, without an address

begin

  assert CLOCK_HZ >= 1
    report "firm_net_link: CLOCK_HZ is " & integer'image(CLOCK_HZ) & "; legal: 1 and more"
    severity failure;
  assert REASSEMBLIES >= 0 and REASSEMBLIES <= MOST_REASSEMBLIES
    report "firm_net_link: REASSEMBLIES is " & integer'image(REASSEMBLIES) & "; legal: 0 to "
           & integer'image(MOST_REASSEMBLIES)
    severity failure;

  count_time : process (clk)
  begin
    if rising_edge(clk) then
      if cycle_r = CYCLES-1 then
        cycle_r <= 0;
        tick_r  <= '1';
      else
        cycle_r <= cycle_r + 1;
        tick_r  <= '0';
      end if;
      if rst_n = '0' then
        cycle_r <= 0;
        tick_r  <= '0';
      end if;
    end if;
  end process count_time;

  -- ------------------------------------------------------------------ the address

  without_dhcp : if not HAS_DHCP generate
    own_address <= address;
    is_bound    <= '1';
    node_runs   <= '1';
    node_rst_n  <= rst_n;
    watch_rst_n <= rst_n;
    node_takes  <= '1';
    heard_valid <= received_tvalid;
    data_bytes  <= payload_bytes;
    own_byte    <= (others => '0');
    wants_dhcp  <= '0';
    client_packet <= (others => '0');
    is_frame_dropped <= '0';
  end generate without_dhcp;

  with_dhcp : if HAS_DHCP generate

    signal wants_broadcast    : std_logic;
    signal wants_renewal      : std_logic;
    signal wants_announcement : std_logic;
    signal dhcp_sent          : std_logic;
    signal is_checking        : std_logic;
    signal is_stopped         : std_logic;

    signal inside_r   : std_logic;  -- of a frame received
    signal hears_r    : std_logic;
    signal checks_r   : std_logic;
    signal runs_r     : std_logic;
    signal to_r       : std_logic;  -- inside a frame to the system
    signal from_r     : std_logic;  -- inside a frame from it that the node accepts
    signal drops_r    : std_logic;  -- inside a dropped one
    signal sends_r    : std_logic;  -- a packet of DHCP leaves
    signal rests      : std_logic;
    signal is_own_r   : std_logic;  -- the packet is not the node's

  begin

    u_client : entity firm.firm_dhcp_client
      port map (
        clk                => clk,
        rst_n              => rst_n,
        tick               => tick_r,
        mac                => mac,
        s_axis_tdata       => received_tdata,
        s_axis_tuser       => received_tuser,
        s_axis_tvalid      => received_tvalid,
        s_axis_tlast       => received_tlast,
        wants_broadcast    => wants_broadcast,
        wants_renewal      => wants_renewal,
        wants_announcement => wants_announcement,
        is_sent            => dhcp_sent,
        own_select         => own_select,
        own_byte           => own_byte,
        address            => own_address,
        is_bound           => is_bound,
        is_checking        => is_checking,
        is_taken           => is_conflict,
        is_stopped         => is_stopped,
        is_lost            => open
      );

    wants_dhcp  <= (wants_broadcast or wants_renewal or wants_announcement) and not sends_r;
    client_packet <= number_of(RENEWAL_PACKET) when wants_renewal = '1' else
                     number_of(ANNOUNCEMENT_PACKET) when wants_announcement = '1' else
                     number_of(DHCP_PACKET);
    -- The builder reads the bytes of the client up to the end of the packet.
    dhcp_sent   <= sends_r and not is_busy;

    -- The node completes the current packet, and the current frame in each direction. Then it is reset, so that it
    -- announces itself again with the next address.
    node_runs  <= runs_r;
    node_rst_n <= rst_n and runs_r;
    is_stopped <= not runs_r;
    rests      <= not (is_bound or is_busy or node_start or to_r or given_tvalid or from_r);
    -- A frame is accepted or dropped as a whole.
    node_takes <= from_r or (runs_r and is_bound and not drops_r);

    -- The presence restarts with each address. It also probes for an address before its use.
    watch_rst_n <= rst_n and (hears_r or checks_r);
    heard_valid <= received_tvalid and hears_r;

    -- The node outputs the size of its last payload, also while another packet leaves.
    data_bytes <= (others => '0') when is_own_r = '1' else payload_bytes;

    follow_address : process (clk)
    begin
      if rising_edge(clk) then
        if received_tvalid = '1' then
          inside_r <= not received_tlast;
        elsif inside_r = '0' then
          checks_r <= is_checking;
          hears_r  <= is_bound and not (checks_r or is_checking);
        end if;
        if start = '1' then
          is_own_r <= not node_starts;
          sends_r  <= wants_dhcp and not (node_starts or wants_report or wants_probe);
        elsif is_busy = '0' then
          sends_r <= '0';
        end if;
        if given_tvalid = '1' and given_tready = '1' then
          to_r <= not sample_tlast;
        end if;
        is_frame_dropped <= '0';
        if frame_tvalid = '1' and frame_tready = '1' then
          from_r           <= node_takes and not out_tlast;
          drops_r          <= not (node_takes or out_tlast);
          is_frame_dropped <= out_tlast and not (node_takes or out_tuser(0));
        end if;
        if is_bound = '1' then
          runs_r <= '1';
        elsif rests = '1' then
          runs_r <= '0';
        end if;
        if rst_n = '0' then
          inside_r <= '0';
          checks_r <= '0';
          hears_r  <= '0';
          to_r     <= '0';
          from_r   <= '0';
          drops_r  <= '0';
          runs_r   <= '0';
          sends_r  <= '0';
        end if;
      end if;
    end process follow_address;

  end generate with_dhcp;

  -- ------------------------------------------------------------------ frames of the line

  u_receiver : entity firm.firm_mac_receiver
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rx_step       => rx_step,
      rx_dv         => rx_dv,
      rx_er         => rx_er,
      rxd           => rxd,
      m_axis_tdata  => received_tdata,
      m_axis_tuser  => received_tuser,
      m_axis_tvalid => received_tvalid,
      m_axis_tlast  => received_tlast,
      is_good       => open,
      is_broken     => is_broken,
      is_long       => is_too_long
    );

  u_responder : entity firm.firm_net_responder
    port map (
      clk           => clk,
      rst_n         => rst_n,
      mac           => mac,
      address       => own_address,
      s_axis_tdata  => received_tdata,
      s_axis_tuser  => received_tuser,
      s_axis_tvalid => heard_valid,
      s_axis_tlast  => received_tlast,
      m_axis_tdata  => sources_tdata(7 downto 0),
      m_axis_tvalid => sources_tvalid(0),
      m_axis_tlast  => sources_tlast(0),
      m_axis_tready => sources_tready(0),
      is_lost       => is_reply_lost
    );

  u_presence : entity firm.firm_net_presence
    port map (
      clk           => clk,
      rst_n         => watch_rst_n,
      tick          => tick_r,
      mac           => mac,
      address       => own_address,
      is_in_use     => is_bound,
      group_ip      => GROUP_IP,
      s_axis_tdata  => received_tdata,
      s_axis_tuser  => received_tuser,
      s_axis_tvalid => received_tvalid,
      s_axis_tlast  => received_tlast,
      wants_report  => wants_report,
      wants_probe   => wants_probe,
      is_sent       => is_sent,
      is_taken      => is_conflict
    );

  without_fragments : if REASSEMBLIES = 0 generate
    whole_tdata       <= received_tdata;
    whole_tuser       <= received_tuser;
    whole_tvalid      <= heard_valid;
    whole_tlast       <= received_tlast;
    is_packet_dropped <= '0';
    is_frame_lost     <= '0';
  end generate without_fragments;

  -- For an invalid number, the part would report an error first.
  with_fragments : if REASSEMBLIES >= 1 and REASSEMBLIES <= MOST_REASSEMBLIES generate

    signal rests : std_logic;

  begin

    rests <= not sample_tvalid;

    u_reassembly : entity firm.firm_ipv4_reassembly
      generic map (
        -- The same number may leave at the same time.
        PACKETS => 2*REASSEMBLIES,
        BYTES   => REASSEMBLED,
        -- The payload of a shorter one has room in the queue of waiting ones.
        LONG    => PAYLOADS
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        tick          => tick_r,
        mac           => mac,
        address       => own_address,
        s_axis_tdata  => received_tdata,
        s_axis_tuser  => received_tuser,
        s_axis_tvalid => heard_valid,
        s_axis_tlast  => received_tlast,
        m_axis_tdata  => whole_tdata,
        m_axis_tuser  => whole_tuser,
        m_axis_tvalid => whole_tvalid,
        m_axis_tlast  => whole_tlast,
        rests         => rests,
        is_dropped    => is_packet_dropped,
        is_lost       => is_frame_lost
      );

  end generate with_fragments;

  u_udp : entity firm.firm_udp_receiver
    generic map (
      PORTS => PORTS
    )
    port map (
      clk            => clk,
      rst_n          => rst_n,
      mac            => mac,
      address        => own_address,
      group_ip       => GROUP_IP,
      udp_ports      => udp_ports,
      s_axis_tdata   => whole_tdata,
      s_axis_tuser   => whole_tuser,
      s_axis_tvalid  => whole_tvalid,
      s_axis_tlast   => whole_tlast,
      m_axis_tdata   => datagram_tdata,
      m_axis_tuser   => datagram_tuser,
      m_axis_tvalid  => datagram_tvalid,
      m_axis_tlast   => datagram_tlast,
      source_mac     => source_mac,
      source_address => open,
      source_port    => open,
      port_match     => open,
      is_fragment    => is_fragment,
      is_broken      => network_error(1)
    );

  -- ------------------------------------------------------------------ the node

  -- A frame that the node does not accept is dropped, so that the system does not stall.
  offered_tvalid <= frame_tvalid and node_takes;
  frame_tready   <= offered_tready or not node_takes;
  -- In the cycle before its reset, the node may offer another frame, whose rest would never arrive.
  given_tvalid   <= sample_tvalid and node_runs;
  sample_tready  <= given_tready and node_runs;

  prefix <= PREFIX_HEAD & mac & PREFIX_TAIL;

  u_node : entity firm.firm_rtps_node
    generic map (
      WRITERS   => WRITERS,
      READERS   => READERS,
      SOURCES   => SOURCES,
      SINKS     => SINKS,
      SAMPLE    => SAMPLE,
      SLOTS     => SLOTS,
      DEPTH     => DISCOVERY,
      BYTES     => PAYLOADS,
      ASSEMBLED => ASSEMBLED
    )
    port map (
      clk                 => clk,
      rst_n               => node_rst_n,
      tick                => tick_r,
      prefix              => prefix,
      are_reliable        => are_reliable,
      are_transient       => are_transient,
      program_enable      => control_enable,
      program_address     => control_address,
      program_word        => control_word,
      packet_tdata        => datagram_tdata,
      packet_tuser        => datagram_tuser,
      packet_tvalid       => datagram_tvalid,
      packet_tlast        => datagram_tlast,
      source_mac          => source_mac,
      names_address       => names_address,
      names_data          => names_data,
      frame_tdata         => sample_tdata,
      frame_tvalid        => sample_tvalid,
      frame_tlast         => sample_tlast,
      frame_tready        => sample_tready,
      sample_tdata        => out_tdata,
      sample_tuser        => out_tuser,
      sample_tvalid       => offered_tvalid,
      sample_tlast        => out_tlast,
      sample_tready       => offered_tready,
      start               => node_start,
      packet              => node_packet,
      bank                => bank,
      payload_bytes       => payload_bytes,
      is_busy             => node_busy,
      build_field_valid   => field_valid,
      build_field_bank    => field_bank,
      build_field_address => field_address,
      build_field_data    => field_data,
      payload_tdata       => payload_tdata,
      payload_tvalid      => payload_tvalid,
      payload_tready      => payload_tready,
      peer_count          => open,
      source_count        => open,
      sink_count          => open,
      is_discovery_lost   => is_lost,
      is_sample_lost      => is_sample_lost,
      is_peer_refused     => network_error(4),
      is_endpoint_refused => network_error(5),
      is_frame_refused    => is_frame_refused,
      is_sample_parted    => is_sample_parted,
      is_packet_broken    => network_error(9),
      is_endpoint_other   => network_error(10)
    );

  -- ------------------------------------------------------------------ the status

  without_status : if not HAS_STATUS generate
    in_tdata     <= sample_tdata;
    in_tvalid    <= given_tvalid;
    in_tlast     <= sample_tlast;
    given_tready <= in_tready;
    frame_tvalid <= out_tvalid;
    out_tready   <= frame_tready;
  end generate without_status;

  with_status : if HAS_STATUS generate

    constant STATUS_ID : std_logic_vector(7 downto 0) := x"ff";

    -- Frames to the system: samples, then requests.
    signal merged_tdata  : std_logic_vector(15 downto 0);
    signal merged_tvalid : std_logic_vector(1 downto 0);
    signal merged_tlast  : std_logic_vector(1 downto 0);
    signal merged_tready : std_logic_vector(1 downto 0);

    signal inside_r      : std_logic;  -- the byte of the system is not the first one of its frame
    signal is_answer_r   : std_logic;  -- its frame belongs to the status
    signal is_answer     : std_logic;
    signal answer_tvalid : std_logic;

  begin

    u_status : entity firm.firm_net_status
      port map (
        clk            => clk,
        rst_n          => rst_n,
        mac            => mac,
        address        => own_address,
        s_axis_tdata   => received_tdata,
        s_axis_tuser   => received_tuser,
        s_axis_tvalid  => heard_valid,
        s_axis_tlast   => received_tlast,
        request_tdata  => merged_tdata(15 downto 8),
        request_tvalid => merged_tvalid(1),
        request_tlast  => merged_tlast(1),
        request_tready => merged_tready(1),
        answer_tdata   => out_tdata,
        answer_tvalid  => answer_tvalid,
        answer_tlast   => out_tlast,
        m_axis_tdata   => sources_tdata(23 downto 16),
        m_axis_tvalid  => sources_tvalid(2),
        m_axis_tlast   => sources_tlast(2),
        m_axis_tready  => sources_tready(2)
      );

    merged_tdata(7 downto 0) <= sample_tdata;
    merged_tvalid(0)         <= given_tvalid;
    merged_tlast(0)          <= sample_tlast;
    given_tready             <= merged_tready(0);

    u_requests : entity firm.firm_net_merge
      generic map (
        SOURCES => 2
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => merged_tdata,
        s_axis_tvalid => merged_tvalid,
        s_axis_tlast  => merged_tlast,
        s_axis_tready => merged_tready,
        m_axis_tdata  => in_tdata,
        m_axis_tvalid => in_tvalid,
        m_axis_tlast  => in_tlast,
        m_axis_tready => in_tready
      );

    is_answer     <= is_answer_r when inside_r = '1' else
                     '1' when out_tdata = STATUS_ID else
                     '0';
    answer_tvalid <= out_tvalid and is_answer;
    frame_tvalid  <= out_tvalid and not is_answer;
    out_tready    <= frame_tready or is_answer;

    follow_frame : process (clk)
    begin
      if rising_edge(clk) then
        if out_tvalid = '1' and (frame_tready = '1' or is_answer = '1') then
          inside_r    <= not out_tlast;
          is_answer_r <= is_answer;
        end if;
        if rst_n = '0' then
          inside_r <= '0';
        end if;
      end if;
    end process follow_frame;

  end generate with_status;

  u_streams : entity firm.firm_net_streams
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      to_tdata      => in_tdata,
      to_tvalid     => in_tvalid,
      to_tlast      => in_tlast,
      to_tready     => in_tready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tuser  => m_axis_tuser,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tkeep  => s_axis_tkeep,
      s_axis_tuser  => s_axis_tuser,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      from_tdata    => out_tdata,
      from_tuser    => out_tuser,
      from_tvalid   => out_tvalid,
      from_tlast    => out_tlast,
      from_tready   => out_tready
    );

  -- ------------------------------------------------------------------ packets

  -- The node starts a packet only while the builder is not busy. Its presence has constant frames, which neither use
  -- nor change the node's prepared fields and payload, and may therefore leave between any two packets.
  -- Before the node has an address, there is nothing to report.
  node_busy   <= is_busy or not is_bound;
  node_starts <= node_start and node_runs;
  start       <= node_starts or ((wants_report or wants_probe or wants_dhcp) and not is_busy);
  is_sent     <= not node_starts and (wants_report or wants_probe) and not is_busy;
  packet      <= node_packet when node_starts = '1' else
                 number_of(REPORT_PACKET) when wants_report = '1' else
                 number_of(PROBE_PACKET) when wants_probe = '1' or wants_dhcp = '0' else
                 client_packet;

  u_builder : entity firm.firm_packet_builder
    generic map (
      ADDRESS_BITS => PROGRAM_BITS,
      BANK_BITS    => RTPS_BANK_BITS,
      HAS_OWN      => HAS_DHCP
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      start           => start,
      entry           => entry,
      bank            => bank,
      payload_bytes   => data_bytes,
      is_busy         => is_busy,
      field_valid     => field_valid,
      field_bank      => field_bank,
      field_address   => field_address,
      field_data      => field_data,
      own_select      => own_select,
      own_byte        => own_byte,
      program_enable  => program_enable,
      program_address => program_address,
      program_word    => program_word,
      s_axis_tdata    => payload_tdata,
      s_axis_tvalid   => payload_tvalid,
      s_axis_tready   => payload_tready,
      m_axis_tdata    => sources_tdata(15 downto 8),
      m_axis_tvalid   => sources_tvalid(1),
      m_axis_tlast    => sources_tlast(1),
      m_axis_tready   => sources_tready(1)
    );

  u_merge : entity firm.firm_net_merge
    generic map (
      SOURCES => SOURCES_SENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => sources_tdata,
      s_axis_tvalid => sources_tvalid,
      s_axis_tlast  => sources_tlast,
      s_axis_tready => sources_tready,
      m_axis_tdata  => sent_tdata,
      m_axis_tvalid => sent_tvalid,
      m_axis_tlast  => sent_tlast,
      m_axis_tready => sent_tready
    );

  u_transmitter : entity firm.firm_mac_transmitter
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => sent_tdata,
      s_axis_tvalid => sent_tvalid,
      s_axis_tlast  => sent_tlast,
      s_axis_tready => sent_tready,
      tx_step       => tx_step,
      tx_en         => tx_en,
      tx_er         => tx_er,
      txd           => txd,
      is_sent       => open,
      is_spoiled    => open
    );

  network_error(0) <= is_broken or is_too_long;
  network_error(2) <= is_fragment or is_packet_dropped;
  network_error(3) <= is_reply_lost or is_lost or is_frame_lost;
  network_error(6) <= is_sample_lost or is_sample_parted;
  network_error(7) <= is_frame_refused or is_frame_dropped;
  network_error(8) <= is_conflict;

end architecture rtl;
