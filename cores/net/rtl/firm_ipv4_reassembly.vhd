-- SPDX-License-Identifier: Apache-2.0
-- Reassembles the fragments of UDP datagrams (RFC 791). Frames pass through at once; those with a fragment for this
-- host are aborted, since missing fragments are detected only here. When a packet is complete, it is sent as one frame
-- without fragments. Meanwhile, arriving frames except fragments wait in a store. They leave in turns with further
-- packets, which are sent in the order of completion.
--
-- The user has room for the content of one long packet. The next long one therefore waits until the user is idle, but
-- not forever. Other packets overtake it. Frames also wait while there is room, since they may refer to data that the
-- user has not yet received.
--
-- Fragments of several packets may be interleaved, but those of each packet must arrive in order, as sent by hosts and
-- preserved by Ethernet. The state of a packet is therefore just its size so far. A packet with a missing fragment is
-- dropped, and so are fragments with options.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_ipv4_reassembly is
  generic (
    PACKETS : integer := 2;     -- reassembled at the same time, 1 to 8
    BYTES   : integer := 16384; -- of the longest one, without its header; a power of two, 2048 to 65536
    DEPTH   : integer := 4096;  -- bytes of frames that wait for the end of a packet, a power of two, 4 and more
    TICKS   : integer := 1000;  -- without a fragment, after which a packet is dropped, 1 to 65535
    LONG    : integer := 4096;  -- bytes from which on a packet is long, a power of two, 2 and more
    -- Milliseconds after a long packet until the next one leaves in any case, 1 to 65535. The board of a simulation,
    -- whose millisecond has 250 cycles, needs 262 for the longest message.
    HOLD_TICKS : integer := 300
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

    -- This host, the first byte on the line highest.
    mac     : in std_logic_vector(47 downto 0);
    address : in std_logic_vector(31 downto 0);

    -- All frames of firm_mac_receiver; after a last beat, six cycles are without a beat.
    s_axis_tdata  : in std_logic_vector(7 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;

    -- The same, in which fragments are aborted, and reassembled packets.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;

    rests : in std_logic;  -- the user is not processing the content of packets

    -- Pulses.
    is_dropped : out std_logic;  -- an incomplete packet, or a fragment without a packet
    is_lost    : out std_logic   -- a frame that waited without room
  );
end entity firm_ipv4_reassembly;

architecture rtl of firm_ipv4_reassembly is

  constant SLOT_BITS  : positive := max(1, clog2(PACKETS));
  constant PLACE_BITS : positive := max(1, clog2(BYTES));
  constant HEAD_BITS  : positive := 6;

  -- Places in a frame, of the first byte of a field.
  constant TYPE_PLACE     : natural := 12;
  constant VERSION_PLACE  : natural := 14;
  constant LENGTH_PLACE   : natural := 16;
  constant NUMBER_PLACE   : natural := 18;
  constant FRAGMENT_PLACE : natural := 20;
  constant PROTOCOL_PLACE : natural := 23;
  constant CHECKSUM_PLACE : natural := 24;
  constant SOURCE_PLACE   : natural := 26;
  constant TARGET_PLACE   : natural := 30;
  constant DATA_PLACE     : natural := 34;
  constant LAST_PLACE     : natural := 127;
  constant IPV4_BYTES     : natural := 20;
  constant MAC_BYTES      : natural := 6;
  constant GAP            : natural := 6;      -- cycles between frames
  constant LONGEST        : natural := 65535;  -- a packet with its header
  -- Idle cycles after which the user counts as idle, since it may begin with a delay.
  constant REST           : positive := 256;

  subtype byte_t is std_logic_vector(7 downto 0);
  constant UDP     : byte_t := x"11";
  constant VERSION : byte_t := x"45";  -- without options
  constant IPV4    : unsigned(15 downto 0) := x"0800";

  subtype slot_t is unsigned(SLOT_BITS-1 downto 0);
  subtype size_t is unsigned(16 downto 0);
  subtype sum_t is unsigned(18 downto 0);
  subtype key_t is std_logic_vector(47 downto 0);  -- the sender's address, and the packet's identification
  subtype slots_t is std_logic_vector(PACKETS-1 downto 0);
  type memory_t is array (natural range <>) of byte_t;
  type keys_t is array (natural range 0 to PACKETS-1) of key_t;
  type sizes_t is array (natural range 0 to PACKETS-1) of size_t;
  type sums_t is array (natural range 0 to PACKETS-1) of sum_t;
  type orders_t is array (natural range 0 to PACKETS-1) of slots_t;
  type ages_t is array (natural range 0 to PACKETS-1) of natural range 0 to 65535;
  constant NO_SLOT : slots_t := (others => '0');

  signal data_memory : memory_t(0 to 2**(SLOT_BITS+PLACE_BITS)-1);
  signal head_memory : memory_t(0 to 2**(SLOT_BITS+HEAD_BITS)-1);

  -- Of each packet.
  signal used_r  : slots_t;                                 -- it has fragments
  signal whole_r : slots_t;                                 -- it waits to be sent
  signal long_r  : slots_t;                                 -- and is long
  signal older_r : orders_t := (others => NO_SLOT);         -- the packets completed earlier
  signal keys_r  : keys_t;
  signal sizes_r : sizes_t := (others => (others => '0'));  -- bytes so far
  signal sums_r  : sums_t := (others => (others => '0'));   -- of the words of the header that stay
  signal ages_r  : ages_t;

  -- ------------------------------------------------------------------ the frame that comes
  signal place_r    : unsigned(6 downto 0) := (others => '0');
  signal recent_r   : std_logic_vector(39 downto 0) := (others => '0');
  signal mine_r     : std_logic;                            -- it is a fragment for this host, so far
  signal has_more_r : std_logic;
  signal offset_r   : size_t := (others => '0');            -- of its first byte in the packet
  signal bytes_r    : size_t := (others => '0');            -- of the packet, in this frame
  signal end_r      : size_t := (others => '0');            -- the offset after its last byte
  signal key_r      : key_t := (others => '0');
  signal sum_r      : sum_t := (others => '0');
  signal check_r    : sum_t := (others => '0');
  signal free_r     : slot_t := (others => '0');            -- its place if it is a first fragment
  signal has_free_r : std_logic;

  -- The packet of the fragment, which is known before the header ends.
  signal found_r   : slots_t;
  signal known     : slot_t;
  signal size_r    : size_t := (others => '0');
  signal repeats_r : std_logic;                             -- the fragment is a repetition
  signal follows_r : std_logic;                             -- it is the next one
  signal exceeds_r : std_logic;                             -- the packet has no room
  signal fed       : slots_t;                               -- it is not dropped: its fragment is arriving

  -- The beat one cycle later, and what is done with it.
  signal beat_r    : byte_t := (others => '0');
  signal moves_r   : std_logic;
  signal ends_r    : std_logic;
  signal aborted_r : std_logic;
  signal slot_r    : slot_t := (others => '0');
  signal own_r     : std_logic;                             -- it is a fragment for this host
  signal taken_r   : std_logic;                             -- these are the packet's next bytes
  signal refused_r : std_logic;                             -- the fragment belongs to no packet
  signal broken_r  : std_logic;                             -- a fragment before it is missing
  signal left_r    : size_t := (others => '0');             -- remaining bytes
  signal write_r   : size_t := (others => '0');
  signal writes    : std_logic;
  signal is_whole  : std_logic;                             -- the frame had all bytes
  signal is_good   : std_logic;                             -- it has ended, and is not aborted

  -- ------------------------------------------------------------------ what leaves
  signal ready    : slots_t;                                -- those that may be sent, and the first one of them
  signal next_one : slots_t;
  signal held_r   : std_logic;                              -- long ones are not sent
  signal rest_r   : natural range 0 to REST-1;              -- cycles until then
  signal since_r  : natural range 0 to 65535;               -- the last long one, milliseconds

  type state_t is (PASSING, SENDING, RESTING, DRAINING);
  signal state_r     : state_t;
  signal turn_r      : std_logic;                           -- it is the store's turn
  signal waits_r     : std_logic;                           -- the arriving frame goes to the store
  signal waits       : std_logic;
  signal out_slot_r  : slot_t := (others => '0');
  signal out_place_r : size_t := (others => '0');
  signal out_last_r  : size_t := (others => '0');
  signal out_total_r : unsigned(15 downto 0) := (others => '0');
  signal out_sum_r   : sum_t := (others => '0');
  signal checksum_r  : unsigned(15 downto 0) := (others => '0');
  signal gap_r       : natural range 0 to GAP;
  signal shown_r     : std_logic;                           -- the memories output a byte of the packet
  signal shown_at_r  : size_t := (others => '0');
  signal shows_end_r : std_logic;
  signal data_r      : byte_t := (others => '0');
  signal head_r      : byte_t := (others => '0');
  -- One cycle later, since memories output their bytes late in a cycle.
  signal sends_r      : std_logic;                          -- a byte of the packet
  signal ends_sent_r  : std_logic;
  signal sent_at_r    : size_t := (others => '0');
  signal sent_data_r  : byte_t := (others => '0');
  signal sent_head_r  : byte_t := (others => '0');
  signal drains_r     : std_logic;                          -- a byte of the store
  signal ends_store_r : std_logic;
  signal store_data_r : byte_t := (others => '0');
  signal sent_byte    : byte_t;

  signal user           : std_logic_vector(0 downto 0);      -- of the arriving frame; a fragment is aborted
  signal store_valid    : std_logic;
  signal stored_data    : byte_t;
  signal stored_valid   : std_logic;
  signal stored_last    : std_logic;
  signal stored_ready   : std_logic;
  signal waiting_r      : std_logic;                         -- the next byte of the store, whose memory is also late
  signal waiting_data_r : byte_t := (others => '0');
  signal waiting_last_r : std_logic;
  signal drains         : std_logic;
  signal loses          : std_logic;

  -- The lowest one of several, or 0.
  function lowest(slots : slots_t) return slot_t is
  begin
    for index in 0 to PACKETS-1 loop
      if slots(index) = '1' then
        return to_unsigned(index, SLOT_BITS);
      end if;
    end loop;
    return to_unsigned(0, SLOT_BITS);
  end function lowest;

  -- Sixteen bits and the carries, as RFC 1071 adds them.
  function folded(sum : sum_t) return unsigned is
    variable once : sum_t;
  begin
    once := resize(sum(15 downto 0), 19) + sum(18 downto 16);
    return once(15 downto 0) + once(18 downto 16);
  end function folded;

begin

  assert PACKETS >= 1 and PACKETS <= 8
    report "firm_ipv4_reassembly: PACKETS is " & integer'image(PACKETS) & "; legal: 1 to 8"
    severity failure;
  assert BYTES >= 2048 and BYTES <= 65536 and 2**clog2(BYTES) = BYTES
    report "firm_ipv4_reassembly: BYTES is " & integer'image(BYTES) & "; legal: powers of two, 2048 to 65536"
    severity failure;
  assert TICKS >= 1 and TICKS <= 65535
    report "firm_ipv4_reassembly: TICKS is " & integer'image(TICKS) & "; legal: 1 to 65535"
    severity failure;

  assert LONG >= 2 and 2**clog2(LONG) = LONG
    report "firm_ipv4_reassembly: LONG is " & integer'image(LONG) & "; legal: powers of two, 2 and more"
    severity failure;
  assert HOLD_TICKS >= 1 and HOLD_TICKS <= 65535
    report "firm_ipv4_reassembly: HOLD_TICKS is " & integer'image(HOLD_TICKS) & "; legal: 1 to 65535"
    severity failure;

  -- ------------------------------------------------------------------ the header

  read_header : process (clk)
    variable recent : std_logic_vector(47 downto 0);
    variable word   : unsigned(15 downto 0);
  begin
    if rising_edge(clk) then
      end_r <= offset_r + bytes_r;
      if s_axis_tvalid = '1' then
        recent   := recent_r & s_axis_tdata;
        word     := unsigned(recent(15 downto 0));
        recent_r <= recent(39 downto 0);
        if place_r = 0 then
          mine_r  <= '1';
          sum_r   <= (others => '0');
          check_r <= (others => '0');
        elsif place_r = MAC_BYTES-1 and recent /= mac then
          mine_r <= '0';
        elsif place_r = MAC_BYTES and s_axis_tdata(0) = '1' then
          -- A multicast address is not a valid source address.
          mine_r <= '0';
        elsif place_r = TYPE_PLACE+1 and word /= IPV4 then
          mine_r <= '0';
        elsif place_r = VERSION_PLACE and s_axis_tdata /= VERSION then
          mine_r <= '0';
        elsif place_r = LENGTH_PLACE+1 then
          bytes_r <= resize(word, 17) - IPV4_BYTES;
          if word <= IPV4_BYTES then
            mine_r <= '0';
          end if;
        elsif place_r = NUMBER_PLACE+1 then
          key_r(15 downto 0) <= recent(15 downto 0);
        elsif place_r = FRAGMENT_PLACE+1 then
          has_more_r <= word(13);
          offset_r   <= '0' & word(12 downto 0) & "000";
          if word(13 downto 0) = 0 then
            mine_r <= '0';
          end if;
          -- All fragments but the last have multiples of eight bytes.
          if word(13) = '1' and bytes_r(2 downto 0) /= 0 then
            mine_r <= '0';
          end if;
        elsif place_r = PROTOCOL_PLACE and s_axis_tdata /= UDP then
          mine_r <= '0';
        elsif place_r = SOURCE_PLACE+3 then
          key_r(47 downto 16) <= recent(31 downto 0);
        elsif place_r = TARGET_PLACE+3 and recent(31 downto 0) /= address then
          mine_r <= '0';
        end if;
        if place_r >= VERSION_PLACE and place_r < DATA_PLACE and place_r(0) = '1' then
          check_r <= resize(check_r(15 downto 0), 19) + check_r(18 downto 16) + word;
          if place_r /= LENGTH_PLACE+1 and place_r /= FRAGMENT_PLACE+1 and place_r /= CHECKSUM_PLACE+1 then
            sum_r <= sum_r + word;
          end if;
        end if;
        if place_r /= LAST_PLACE then
          place_r <= place_r + 1;
        end if;
        if s_axis_tlast = '1' then
          place_r <= (others => '0');
        end if;
      end if;
      if rst_n = '0' then
        place_r <= (others => '0');
      end if;
    end if;
  end process read_header;

  -- The key is complete four beats before the first one after the header: there is time for these.
  find_packet : process (clk)
  begin
    if rising_edge(clk) then
      for index in 0 to PACKETS-1 loop
        found_r(index) <= '0';
        if used_r(index) = '1' and whole_r(index) = '0' and keys_r(index) = key_r then
          found_r(index) <= '1';
        end if;
      end loop;
      size_r    <= sizes_r(to_integer(known));
      repeats_r <= '0';
      if end_r <= size_r then
        repeats_r <= '1';
      end if;
      follows_r <= '0';
      if offset_r = size_r then
        follows_r <= '1';
      end if;
      exceeds_r <= '0';
      if end_r > BYTES or end_r > LONGEST-IPV4_BYTES then
        exceeds_r <= '1';
      end if;
    end if;
  end process find_packet;

  known <= lowest(found_r);

  -- ------------------------------------------------------------------ the fragment

  decide : process (clk)
  begin
    if rising_edge(clk) then
      beat_r    <= s_axis_tdata;
      moves_r   <= s_axis_tvalid;
      ends_r    <= s_axis_tvalid and s_axis_tlast;
      aborted_r <= s_axis_tuser(0);
      if writes = '1' then
        left_r  <= left_r - 1;
        write_r <= write_r + 1;
      end if;
      if s_axis_tvalid = '1' and place_r = 0 then
        free_r     <= lowest(not used_r);
        has_free_r <= '0';
        if (not used_r) /= NO_SLOT then
          has_free_r <= '1';
        end if;
        own_r     <= '0';
        taken_r   <= '0';
        refused_r <= '0';
        broken_r  <= '0';
      elsif s_axis_tvalid = '1' and place_r = DATA_PLACE and mine_r = '1' and folded(check_r) = x"ffff" then
        own_r   <= '1';
        left_r  <= bytes_r;
        write_r <= offset_r;
        slot_r  <= known;
        if found_r /= NO_SLOT and repeats_r = '1' then
          -- It is a repetition.
          null;
        elsif exceeds_r = '1' then
          refused_r <= '1';
          broken_r  <= '1';
        elsif found_r /= NO_SLOT and follows_r = '1' then
          taken_r <= '1';
        elsif found_r = NO_SLOT and offset_r = 0 and has_free_r = '1' then
          taken_r <= '1';
          slot_r  <= free_r;
        else
          refused_r <= '1';
          broken_r  <= '1';
        end if;
        if found_r = NO_SLOT then
          broken_r <= '0';
        end if;
      end if;
      if rst_n = '0' then
        moves_r   <= '0';
        ends_r    <= '0';
        own_r     <= '0';
        taken_r   <= '0';
        refused_r <= '0';
        broken_r  <= '0';
      end if;
    end if;
  end process decide;

  writes   <= '1' when moves_r = '1' and taken_r = '1' and left_r /= 0 else '0';
  is_whole <= '1' when left_r = 0 or (left_r = 1 and writes = '1') else '0';

  access_data : process (clk)
  begin
    if rising_edge(clk) then
      if writes = '1' then
        data_memory(to_integer(slot_r & write_r(PLACE_BITS-1 downto 0))) <= beat_r;
      end if;
      data_r <= data_memory(to_integer(out_slot_r & resize(out_place_r - DATA_PLACE, PLACE_BITS)));
    end if;
  end process access_data;

  -- The header of the frame's place if it is a first fragment. When its first byte arrives, the place is not yet known;
  -- this byte is that of the board's address.
  access_head : process (clk)
  begin
    if rising_edge(clk) then
      if s_axis_tvalid = '1' and place_r < DATA_PLACE and place_r /= 0 and has_free_r = '1' then
        head_memory(to_integer(free_r & place_r(HEAD_BITS-1 downto 0))) <= s_axis_tdata;
      end if;
      head_r <= head_memory(to_integer(out_slot_r & out_place_r(HEAD_BITS-1 downto 0)));
    end if;
  end process access_head;

  is_good <= ends_r and not aborted_r;
  -- A packet is not dropped while its fragment arrives, and no packet while the fragment's packet is being searched
  -- for.
  fed     <= (others => '1') when place_r >= SOURCE_PLACE+4 and place_r <= DATA_PLACE else
             found_r when mine_r = '1' and (place_r > DATA_PLACE or ends_r = '1') else
             NO_SLOT;

  keep_packets : process (clk)
  begin
    if rising_edge(clk) then
      is_dropped <= is_good and (refused_r or (taken_r and not is_whole));
      for index in 0 to PACKETS-1 loop
        if tick = '1' and used_r(index) = '1' and whole_r(index) = '0' then
          if ages_r(index) /= TICKS-1 then
            ages_r(index) <= ages_r(index) + 1;
          elsif fed(index) = '0' then
            used_r(index) <= '0';
            is_dropped    <= '1';
          end if;
        end if;
        if is_good = '1' and slot_r = index then
          if taken_r = '1' and is_whole = '1' then
            used_r(index)  <= '1';
            whole_r(index) <= not has_more_r;
            long_r(index)  <= '0';
            if end_r >= LONG then
              long_r(index) <= '1';
            end if;
            older_r(index) <= whole_r;
            for other in 0 to PACKETS-1 loop
              older_r(other)(index) <= '0';
            end loop;
            sizes_r(index) <= end_r;
            ages_r(index)  <= 0;
            if offset_r = 0 then
              keys_r(index) <= key_r;
              sums_r(index) <= sum_r;
            end if;
          elsif broken_r = '1' then
            used_r(index) <= '0';
          end if;
        end if;
        if shows_end_r = '1' and out_slot_r = index then
          used_r(index)  <= '0';
          whole_r(index) <= '0';
        end if;
      end loop;
      if rst_n = '0' then
        used_r     <= NO_SLOT;
        whole_r    <= NO_SLOT;
        is_dropped <= '0';
      end if;
    end if;
  end process keep_packets;

  -- ------------------------------------------------------------------ what leaves

  find_next : process (whole_r, long_r, held_r, older_r, ready)
  begin
    for index in 0 to PACKETS-1 loop
      ready(index)    <= whole_r(index) and not (long_r(index) and held_r);
      next_one(index) <= '0';
      if (older_r(index) and ready) = NO_SLOT then
        next_one(index) <= ready(index);
      end if;
    end loop;
  end process find_next;

  hold : process (clk)
  begin
    if rising_edge(clk) then
      if rests = '0' then
        rest_r <= REST-1;
      elsif rest_r /= 0 then
        rest_r <= rest_r - 1;
      end if;
      if shows_end_r = '1' and long_r(to_integer(out_slot_r)) = '1' then
        held_r  <= '1';
        rest_r  <= REST-1;
        since_r <= 0;
      elsif rest_r = 0 or loses = '1' then
        held_r <= '0';
      elsif tick = '1' then
        since_r <= since_r + 1;
        if since_r = HOLD_TICKS-1 then
          held_r  <= '0';
          since_r <= 0;
        end if;
      end if;
      if rst_n = '0' then
        held_r  <= '0';
        rest_r  <= 0;
        since_r <= 0;
      end if;
    end if;
  end process hold;

  waits <= waits_r when place_r /= 0 else
           '0' when state_r = PASSING else
           '1';

  store_valid <= s_axis_tvalid and waits;
  user(0)     <= s_axis_tuser(0) or own_r when place_r > DATA_PLACE else s_axis_tuser(0);

  u_store : entity firm.firm_mac_store
    generic map (
      DEPTH => DEPTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tuser  => user,
      s_axis_tvalid => store_valid,
      s_axis_tlast  => s_axis_tlast,
      m_axis_tdata  => stored_data,
      m_axis_tvalid => stored_valid,
      m_axis_tlast  => stored_last,
      m_axis_tready => stored_ready,
      is_lost       => loses
    );

  is_lost      <= loses;
  drains       <= waiting_r when state_r = DRAINING else '0';
  stored_ready <= drains or not waiting_r;

  wait_for_turn : process (clk)
  begin
    if rising_edge(clk) then
      if stored_ready = '1' then
        waiting_r      <= stored_valid;
        waiting_data_r <= stored_data;
        waiting_last_r <= stored_last;
      end if;
      if rst_n = '0' then
        waiting_r <= '0';
      end if;
    end if;
  end process wait_for_turn;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      waits_r     <= waits;
      shown_r     <= '0';
      shows_end_r <= '0';
      shown_at_r  <= out_place_r;
      if state_r = PASSING then
        out_place_r <= (others => '0');
        -- In the last of these cycles, a packet begins: the next frame must therefore wait.
        if s_axis_tvalid = '1' or place_r /= 0 then
          gap_r <= GAP-1;
        elsif gap_r /= 0 then
          gap_r <= gap_r - 1;
        elsif ready /= NO_SLOT then
          state_r    <= SENDING;
          out_slot_r <= lowest(next_one);
        elsif whole_r /= NO_SLOT then
          state_r <= RESTING;
        end if;
      elsif state_r = SENDING then
        out_last_r  <= sizes_r(to_integer(out_slot_r)) + (DATA_PLACE-1);
        out_total_r <= resize(sizes_r(to_integer(out_slot_r)) + IPV4_BYTES, 16);
        out_sum_r   <= resize(sums_r(to_integer(out_slot_r)), 19) + out_total_r;
        checksum_r  <= not folded(out_sum_r);
        shown_r     <= '1';
        out_place_r <= out_place_r + 1;
        if out_place_r = out_last_r and out_place_r >= DATA_PLACE then
          shows_end_r <= '1';
        end if;
        if shows_end_r = '1' then
          shown_r <= '0';
          state_r <= RESTING;
          turn_r  <= '1';
          gap_r   <= GAP;
        end if;
      elsif state_r = RESTING then
        out_place_r <= (others => '0');
        if gap_r /= 0 then
          gap_r <= gap_r - 1;
        elsif waiting_r = '1' and (turn_r = '1' or whole_r = NO_SLOT) then
          state_r <= DRAINING;
        elsif ready /= NO_SLOT then
          state_r    <= SENDING;
          out_slot_r <= lowest(next_one);
        elsif whole_r = NO_SLOT and stored_valid = '0' and (place_r = 0 or waits_r = '0')
              and s_axis_tvalid = '0' and moves_r = '0' and ends_r = '0' then
          state_r <= PASSING;
        end if;
      elsif waiting_r = '1' and waiting_last_r = '1' then
        state_r <= RESTING;
        turn_r  <= '0';
        gap_r   <= GAP;
      end if;
      if rst_n = '0' then
        state_r     <= PASSING;
        waits_r     <= '0';
        shown_r     <= '0';
        shows_end_r <= '0';
        gap_r       <= 0;
      end if;
    end if;
  end process choose;

  -- Length, fragment and checksum are those of the whole packet.
  sent_byte <= sent_data_r when sent_at_r >= DATA_PLACE else
               std_logic_vector(out_total_r(15 downto 8)) when sent_at_r = LENGTH_PLACE else
               std_logic_vector(out_total_r(7 downto 0)) when sent_at_r = LENGTH_PLACE+1 else
               x"00" when sent_at_r = FRAGMENT_PLACE or sent_at_r = FRAGMENT_PLACE+1 else
               std_logic_vector(checksum_r(15 downto 8)) when sent_at_r = CHECKSUM_PLACE else
               std_logic_vector(checksum_r(7 downto 0)) when sent_at_r = CHECKSUM_PLACE+1 else
               mac(47 downto 40) when sent_at_r = 0 else
               sent_head_r;

  show : process (clk)
  begin
    if rising_edge(clk) then
      sends_r      <= shown_r;
      ends_sent_r  <= shows_end_r;
      sent_at_r    <= shown_at_r;
      sent_data_r  <= data_r;
      sent_head_r  <= head_r;
      drains_r     <= drains;
      ends_store_r <= waiting_last_r;
      store_data_r <= waiting_data_r;

      m_axis_tdata  <= s_axis_tdata;
      m_axis_tuser  <= user;
      m_axis_tvalid <= s_axis_tvalid and not waits;
      m_axis_tlast  <= s_axis_tlast;
      if sends_r = '1' then
        m_axis_tdata  <= sent_byte;
        m_axis_tuser  <= "0";
        m_axis_tvalid <= '1';
        m_axis_tlast  <= ends_sent_r;
      elsif drains_r = '1' then
        m_axis_tdata  <= store_data_r;
        m_axis_tuser  <= "0";
        m_axis_tvalid <= '1';
        m_axis_tlast  <= ends_store_r;
      end if;
      if rst_n = '0' then
        sends_r       <= '0';
        drains_r      <= '0';
        m_axis_tvalid <= '0';
      end if;
    end if;
  end process show;

end architecture rtl;
