-- SPDX-License-Identifier: Apache-2.0
-- Gets the address of a board by DHCP (RFC 2131), probes it before its use (RFC 5227), and keeps it. Its packets are
-- programs of firm_packet_builder, which fusesoc_firm.fabric.dhcp makes; `own_byte` has the bytes that they lack. A
-- message that comes is held in a memory and read twice: first to judge it, then to take what it says. So nothing of a
-- message that is broken or not wanted has an effect.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_net_pkg.all;

entity firm_dhcp_client is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;
    tick  : in std_logic;  -- a pulse each millisecond

    mac : in std_logic_vector(47 downto 0);  -- of this host, the first byte on the line highest

    -- All frames of firm_mac_receiver; after a last beat, six cycles are without a beat.
    s_axis_tdata  : in std_logic_vector(7 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;

    -- A packet is due, until `is_sent`: a message to all, a message to the server, or an announcement by ARP. Up to
    -- then, `own_byte` stays that of the packet; so `is_sent` is a pulse after the builder has read it.
    wants_broadcast    : out std_logic;
    wants_renewal      : out std_logic;
    wants_announcement : out std_logic;
    is_sent            : in  std_logic;

    -- For the builder: which byte, and the byte. Bits 6 to 5 of `own_select` are 0 for the byte that bits 4 to 0
    -- select, 1 for the same or 0 while the board has no address, 2 for the same or 0 in a message without a choice of
    -- server and address, and 3 for the number of bits 4 to 0 with bit 4 repeated, or 0 likewise.
    own_select : in  std_logic_vector(6 downto 0);
    own_byte   : out std_logic_vector(7 downto 0);

    -- The address, constant while `is_bound` or `is_checking`. While `is_checking`, it is probed for.
    address     : out std_logic_vector(31 downto 0);
    is_bound    : out std_logic;
    is_checking : out std_logic;
    is_taken    : in  std_logic;  -- a pulse if another host has the address
    is_stopped  : in  std_logic;  -- what used the last address is at rest
    is_lost     : out std_logic   -- a pulse when the board loses its address
  );
end entity firm_dhcp_client;

architecture rtl of firm_dhcp_client is

  -- ------------------------------------------------------------------ places

  -- In a frame, from the header of IPv4 on; those before it are at the end of the memory.
  constant PLACE_BITS     : positive := 11;
  subtype place_t is unsigned(PLACE_BITS-1 downto 0);
  constant FIRST_PLACE    : natural := 2**PLACE_BITS-14;
  constant SENDER_PLACE   : natural := 2**PLACE_BITS-8;
  constant LENGTH_PLACE   : natural := 2;
  constant FRAGMENT_PLACE : natural := 6;
  constant XID_PLACE      : natural := 32;   -- a multiple of four
  constant OFFER_PLACE    : natural := 44;   -- the address for this host
  constant HARDWARE_PLACE : natural := 56;
  constant NAME_PLACE     : natural := 72;   -- of the server, or more options
  constant FILE_PLACE     : natural := 136;  -- of its file, or more options
  constant MAGIC_PLACE    : natural := 264;
  constant OPTIONS_PLACE  : natural := 268;
  constant FILE_BYTES     : natural := 128;
  constant MAC_BYTES      : natural := 6;

  constant TYPE_IPV4 : bytes_t(2**PLACE_BITS-2 to 2**PLACE_BITS-1) := (x"08", x"00");
  constant VERSION   : bytes_t(0 to 0) := (others => x"45");       -- IPv4 without options
  constant UDP       : bytes_t(9 to 9) := (others => x"11");
  constant PORT_68   : bytes_t(22 to 23) := (x"00", x"44");
  constant REPLY     : bytes_t(28 to 30) := (x"02", x"01", x"06"); -- a reply, to an address of Ethernet
  constant MAGIC     : bytes_t(MAGIC_PLACE to MAGIC_PLACE+3) := (x"63", x"82", x"53", x"63");
  constant FRAGMENT  : byte_t := x"3f";                             -- the flag for more fragments, and the offset
  constant LOOPBACK  : byte_t := x"7f";
  constant GROUP_BIT : natural := 0;

  -- ------------------------------------------------------------------ what is known

  -- Slots of `known`.
  subtype slot_t is unsigned(4 downto 0);
  constant OFFERED_SLOT : natural := 0;
  constant SERVER_SLOT  : natural := 4;
  constant XID_SLOT     : natural := 8;
  constant SENDER_SLOT  : natural := 12;
  -- Not in the memory: the end of a message that lacks some options (0 in the others), and the type of the message.
  constant END_SLOT  : natural := 30;
  constant TYPE_SLOT : natural := 31;

  -- Slots of `times`, the highest byte first: seconds since the lease began.
  subtype time_t is unsigned(3 downto 0);
  constant LEASE_TIME   : natural := 0;
  constant RENEW_TIME   : natural := 4;
  constant REBIND_TIME  : natural := 8;
  constant ELAPSED_TIME : natural := 12;

  type frame_t is array (natural range 0 to 2**PLACE_BITS-1) of byte_t;
  type known_t is array (natural range 0 to 31) of byte_t;
  type times_t is array (natural range 0 to 15) of byte_t;
  signal frame : frame_t;
  signal known : known_t;
  signal times : times_t;

  -- ------------------------------------------------------------------ messages and options

  subtype type_t is unsigned(2 downto 0);
  constant NO_TYPE  : type_t := "000";
  constant DISCOVER : type_t := "001";
  constant OFFER    : type_t := "010";
  constant REQUEST  : type_t := "011";
  constant DECLINE  : type_t := "100";
  constant ACK      : type_t := "101";
  constant NAK      : type_t := "110";

  constant PAD_TAG      : natural := 0;
  constant LEASE_TAG    : natural := 51;
  constant OVERLOAD_TAG : natural := 52;
  constant TYPE_TAG     : natural := 53;
  constant SERVER_TAG   : natural := 54;
  constant RENEW_TAG    : natural := 58;
  constant REBIND_TAG   : natural := 59;
  constant END_TAG      : natural := 255;
  constant WORD_BYTES   : natural := 4;

  type option_t is (OTHER, LEASE, OVERLOAD, MESSAGE_TYPE, SERVER, RENEWAL, REBINDING);
  type area_t is (OPTIONS, FILE_NAME, SERVER_NAME);

  -- ------------------------------------------------------------------ the client

  -- STARTING: without an address, until the pause is over. The others wait for an offer, for the lease, for a host with
  -- the same address, for the time of renewal, for the server, and for any server.
  type state_t is (STARTING, SELECTING, REQUESTING, CHECKING, BOUND, RENEWING, REBOUND);
  type step_t is (
    RESTING, MIXING, SENDING, SENDER, ADDRESSING, TAG, SIZE, VALUE, ENDING, JUDGING, COUNTING, DECIDING
  );

  signal state_r : state_t;
  signal step_r  : step_t;
  signal bound_r : std_logic;

  -- The frame that comes, and the place in it, also when it is read.
  signal place_r   : place_t := (others => '0');
  signal inside_r  : std_logic;
  signal takes_r   : std_logic;  -- the frame is written
  signal ended_r   : std_logic;
  signal aborted_r : std_logic;
  signal direct_r  : std_logic;  -- it is for this host only, so far
  signal all_r     : std_logic;  -- it is for all hosts, so far
  signal meant_r   : std_logic;  -- it is a reply to this host, so far
  signal deep_r    : std_logic;  -- it has reached the options
  signal length_r  : unsigned(15 downto 0) := (others => '0');  -- of the packet
  signal at_end    : std_logic;
  signal idles     : std_logic;  -- no frame is under way, and none waits
  signal writes    : std_logic;
  signal comes     : std_logic;  -- it was a reply to this host
  signal got_r     : std_logic;  -- one waits to be read

  signal shown_r   : byte_t := (others => '0');  -- the byte at the place before
  signal data_r    : byte_t := (others => '0');  -- the same one cycle later, since the memory is slow
  signal settles_r : std_logic;
  signal ready_r   : std_logic;                  -- it is the byte at the place
  signal walks     : std_logic;  -- the frame is read
  signal at_limit  : std_logic;
  signal area_r    : area_t;
  signal writes_r  : std_logic;  -- the message is read for the second time
  signal option_r  : option_t;
  signal size_r    : unsigned(7 downto 0) := (others => '0');  -- bytes of the option to come
  signal count_r   : unsigned(4 downto 0) := (others => '0');

  -- Of the message.
  signal type_r       : type_t := (others => '0');
  signal overload_r   : std_logic_vector(1 downto 0) := (others => '0');
  signal has_lease_r  : std_logic;
  signal has_server_r : std_logic;
  signal chosen_r     : std_logic;  -- it is that of the offer chosen
  signal proper_r     : std_logic;  -- it is a server that may answer
  signal has_renew_r  : std_logic;
  signal has_rebind_r : std_logic;
  signal same_r       : std_logic;  -- it has the address that the board knows
  signal legal_r      : std_logic;  -- it has an address of a host
  signal address_r    : std_logic_vector(31 downto 0) := (others => '0');

  -- Slots that are written and read.
  signal writes_known : std_logic;
  signal known_slot   : slot_t;
  signal known_data   : byte_t;
  signal read_slot    : slot_t;
  signal read_known   : byte_t;
  signal own_slot     : slot_t;
  signal own_known    : byte_t;
  signal own_type     : type_t;
  signal chooses      : std_logic;
  signal is_selecting : std_logic;
  signal is_server    : std_logic;
  signal is_time      : std_logic;

  -- A pass over four bytes of times: what is computed of which of them.
  -- RENEW finds half of the lease; HALF, QUARTER, EIGHTH and REBIND find seven eighths of it. CLEAR begins with the
  -- seconds since the request. ELAPSE adds a second; the others compare.
  type pass_t is (CLEAR, RENEW, HALF, QUARTER, EIGHTH, REBIND, ELAPSE, EXPIRED, TO_REBIND, TO_RENEW);
  signal pass_r          : pass_t;
  signal first_base      : time_t;
  signal second_base     : time_t;
  signal target_base     : time_t;
  signal halves          : std_logic;  -- the first one is halved, from its highest byte on
  signal offset          : unsigned(1 downto 0);
  signal first           : unsigned(7 downto 0);
  signal second          : unsigned(7 downto 0);
  signal total           : unsigned(8 downto 0);
  signal carry           : unsigned(0 downto 0);
  signal carry_r         : unsigned(0 downto 0) := (others => '0');
  signal writes_times    : std_logic;
  signal time_slot       : time_t;
  signal time_data       : byte_t;

  -- ------------------------------------------------------------------ time

  constant MS_BITS     : natural := 10;
  constant LAST_MS     : natural := 999;
  constant PAUSE_BITS  : natural := 7;
  subtype tries_t is unsigned(2 downto 0);
  -- Pauses, in 1024 ms, to which up to 1023 ms are added.
  subtype pause_t is unsigned(PAUSE_BITS-1 downto 0);
  constant START_PAUSE    : natural := 1;
  constant DECLINE_PAUSE  : natural := 10;
  constant CHECK_PAUSE    : natural := 5;
  constant ANNOUNCE_PAUSE : natural := 2;
  constant LAST_TRY       : natural := 4;
  constant LAST_REQUEST   : natural := 2;

  signal ms_r          : unsigned(MS_BITS-1 downto 0) := (others => '0');
  -- Seconds that have passed with an address, but are not counted yet: a packet may wait for its turn for long.
  signal owed_r        : unsigned(15 downto 0) := (others => '0');
  signal second_r      : std_logic;                              -- there is one of them
  signal since_r       : unsigned(6 downto 0)  := (others => '0');  -- since the last packet
  signal conflict_r    : std_logic;
  signal random_r      : std_logic_vector(31 downto 0) := (others => '1');
  signal wait_r        : unsigned(PAUSE_BITS+MS_BITS-1 downto 0) := (others => '0');
  signal due_r         : std_logic;
  signal pauses_r      : boolean;                       -- a pause begins
  signal pause_r       : pause_t := (others => '0');  -- its length; 0 for that before the next try
  signal tries_r       : tries_t := (others => '0');

  -- Four seconds, doubled with each try, and up to one second less or more: up to one second is added, and half of the
  -- pauses are one second shorter.
  function pause_of(tries : tries_t; is_longer : std_logic) return pause_t is
    variable pause : pause_t   := (others => '0');
    variable below : std_logic := not is_longer;
  begin
    for place in 0 to PAUSE_BITS-1 loop
      pause(place) := below;
      if tries+2 = place then
        pause(place) := is_longer;
        below        := '0';
      end if;
    end loop;
    return pause;
  end function pause_of;

  function after_pass(pass : pass_t) return pass_t is
  begin
    if pass = CLEAR then
      return RENEW;
    elsif pass = RENEW then
      return HALF;
    elsif pass = HALF then
      return QUARTER;
    elsif pass = QUARTER then
      return EIGHTH;
    elsif pass = EIGHTH then
      return REBIND;
    elsif pass = ELAPSE then
      return EXPIRED;
    elsif pass = EXPIRED then
      return TO_REBIND;
    end if;
    return TO_RENEW;
  end function after_pass;

  function option_of(number : unsigned(7 downto 0)) return option_t is
  begin
    if number = LEASE_TAG then
      return LEASE;
    elsif number = OVERLOAD_TAG then
      return OVERLOAD;
    elsif number = TYPE_TAG then
      return MESSAGE_TYPE;
    elsif number = SERVER_TAG then
      return SERVER;
    elsif number = RENEW_TAG then
      return RENEWAL;
    elsif number = REBIND_TAG then
      return REBINDING;
    end if;
    return OTHER;
  end function option_of;

  -- The bytes of an option's value.
  function size_of(option : option_t) return natural is
  begin
    if option = OVERLOAD or option = MESSAGE_TYPE then
      return 1;
    end if;
    return WORD_BYTES;
  end function size_of;

begin

  -- ------------------------------------------------------------------ the frame

  at_end <= '1' when length_r = place_r else '0';
  idles  <= not (got_r or s_axis_tvalid or inside_r or ended_r);
  writes <= s_axis_tvalid and takes_r and not at_end;
  comes  <= ended_r and takes_r and meant_r and deep_r and at_end and not aborted_r;

  follow : process (clk)
    variable wrong : boolean;
  begin
    if rising_edge(clk) then
      ended_r   <= s_axis_tvalid and s_axis_tlast;
      aborted_r <= s_axis_tuser(0);
      if s_axis_tvalid = '1' then
        inside_r <= not s_axis_tlast;
      end if;
      if idles = '1' then
        takes_r  <= '1';
        direct_r <= '1';
        all_r    <= '1';
        meant_r  <= '1';
        deep_r   <= '0';
        length_r <= (others => '1');
      elsif writes = '1' then
        if place_r = LENGTH_PLACE then
          length_r(15 downto 8) <= unsigned(s_axis_tdata);
        elsif place_r = LENGTH_PLACE+1 then
          length_r(7 downto 0) <= unsigned(s_axis_tdata);
        elsif place_r = MAGIC_PLACE+3 then
          deep_r <= '1';
        end if;
        wrong := differs(place_r, s_axis_tdata, TYPE_IPV4)
                 or differs(place_r, s_axis_tdata, VERSION)
                 or differs(place_r, s_axis_tdata, UDP)
                 or differs(place_r, s_axis_tdata, PORT_68)
                 or differs(place_r, s_axis_tdata, REPLY)
                 or differs(place_r, s_axis_tdata, MAGIC)
                 or (place_r = SENDER_PLACE and (s_axis_tdata(GROUP_BIT) = '1' or (direct_r or all_r) = '0'))
                 or (place_r = FRAGMENT_PLACE and (s_axis_tdata and FRAGMENT) /= x"00")
                 or (place_r = FRAGMENT_PLACE+1 and s_axis_tdata /= x"00")
                 or (place_r(PLACE_BITS-1 downto 2) = XID_PLACE/4 and s_axis_tdata /= read_known);
        for index in 0 to MAC_BYTES-1 loop
          if place_r = FIRST_PLACE+index and s_axis_tdata /= byte_of(mac, index) then
            direct_r <= '0';
          end if;
          if place_r = FIRST_PLACE+index and s_axis_tdata /= x"ff" then
            all_r <= '0';
          end if;
          if place_r = HARDWARE_PLACE+index and s_axis_tdata /= byte_of(mac, index) then
            wrong := true;
          end if;
        end loop;
        if wrong then
          meant_r <= '0';
        end if;
      end if;
      -- A frame under way may be an answer to the number before.
      if ended_r = '1' or step_r = MIXING then
        takes_r <= '0';
      end if;
      if rst_n = '0' then
        inside_r <= '0';
        ended_r  <= '0';
        takes_r  <= '0';
      end if;
    end if;
  end process follow;

  access_frame : process (clk)
  begin
    if rising_edge(clk) then
      if writes = '1' then
        frame(to_integer(place_r)) <= s_axis_tdata;
      end if;
      shown_r <= frame(to_integer(place_r));
      data_r  <= shown_r;
    end if;
  end process access_frame;

  -- ------------------------------------------------------------------ what is known

  writes_known <= count_r(2) and count_r(1) and count_r(0) when step_r = MIXING else
                  writes_r and ready_r when step_r = SENDER else
                  writes_r and ready_r and is_selecting when step_r = ADDRESSING else
                  writes_r and ready_r and is_server and not at_limit when step_r = VALUE else
                  '0';

  known_slot <= to_unsigned(XID_SLOT, 5) + count_r(4 downto 3) when step_r = MIXING else
                to_unsigned(SENDER_SLOT, 5) + count_r(2 downto 0) when step_r = SENDER else
                to_unsigned(OFFERED_SLOT, 5) + count_r(1 downto 0) when step_r = ADDRESSING else
                to_unsigned(SERVER_SLOT, 5) + count_r(1 downto 0);
  known_data <= random_r(7 downto 0) when step_r = MIXING else
                data_r;
  is_selecting <= '1' when state_r = SELECTING else '0';
  is_server    <= '1' when option_r = SERVER else '0';

  -- A frame that comes is compared with the number of the request, and one that is read with the address, and with the
  -- server.
  read_slot  <= to_unsigned(SERVER_SLOT, 5) + count_r(1 downto 0) when step_r = VALUE else
                to_unsigned(OFFERED_SLOT, 5) + count_r(1 downto 0) when got_r = '1' else
                to_unsigned(XID_SLOT, 5) + place_r(1 downto 0);
  read_known <= known(to_integer(read_slot));
  own_slot   <= unsigned(own_select(4 downto 0));
  own_known  <= known(to_integer(own_slot));

  access_known : process (clk)
  begin
    if rising_edge(clk) then
      if writes_known = '1' then
        known(to_integer(known_slot)) <= known_data;
      end if;
    end if;
  end process access_known;

  own_type <= DISCOVER when state_r = SELECTING else
              DECLINE when state_r = STARTING else
              REQUEST;
  chooses  <= '1' when state_r = REQUESTING or state_r = STARTING else '0';

  show : process (own_select, own_slot, own_known, own_type, bound_r, chooses)
    variable byte : byte_t;
  begin
    byte := own_known;
    if own_slot = END_SLOT and own_type = DECLINE then
      byte := std_logic_vector(to_unsigned(END_TAG, 8));
    elsif own_slot = END_SLOT then
      byte := (others => '0');
    elsif own_slot = TYPE_SLOT then
      byte := std_logic_vector(resize(own_type, 8));
    end if;
    if own_select(6 downto 5) = "11" then
      byte := "00" & own_select(4) & own_select(4 downto 0);
    end if;
    if (own_select(6 downto 5) = "01" and bound_r = '0') or (own_select(6) = '1' and chooses = '0') then
      byte := (others => '0');
    end if;
    own_byte <= byte;
  end process show;

  address     <= address_r;
  is_bound    <= bound_r;
  is_checking <= '1' when state_r = CHECKING else '0';

  -- ------------------------------------------------------------------ times

  halves <= '1' when pass_r = RENEW or pass_r = HALF or pass_r = QUARTER or pass_r = EIGHTH else
            '0';
  first_base  <= to_unsigned(ELAPSED_TIME, 4) when pass_r >= ELAPSE else
                 to_unsigned(REBIND_TIME, 4) when pass_r = QUARTER or pass_r = EIGHTH else
                 to_unsigned(LEASE_TIME, 4);
  second_base <= to_unsigned(LEASE_TIME, 4) when pass_r = EXPIRED else
                 to_unsigned(RENEW_TIME, 4) when pass_r = TO_RENEW else
                 to_unsigned(REBIND_TIME, 4);
  target_base <= to_unsigned(RENEW_TIME, 4) when pass_r = RENEW else
                 to_unsigned(ELAPSED_TIME, 4) when pass_r = CLEAR or pass_r = ELAPSE else
                 to_unsigned(REBIND_TIME, 4);
  -- The lowest byte is the last one.
  offset <= count_r(1 downto 0) when halves = '1' else not count_r(1 downto 0);
  first  <= unsigned(times(to_integer(first_base + offset)));
  second <= x"00" when pass_r = ELAPSE else not unsigned(times(to_integer(second_base + offset)));
  carry  <= carry_r when count_r(1 downto 0) /= 0 else
            "0" when halves = '1' else
            "1";
  total  <= resize(first, 9) + second + carry;

  writes_times <= '1' when step_r = COUNTING and pass_r <= ELAPSE else
                  writes_r and ready_r and is_time and not at_limit when step_r = VALUE else
                  '0';

  is_time   <= '1' when option_r = LEASE or option_r = RENEWAL or option_r = REBINDING else '0';
  time_slot <= target_base + offset when step_r = COUNTING else
               to_unsigned(LEASE_TIME, 4) + count_r(1 downto 0) when option_r = LEASE else
               to_unsigned(RENEW_TIME, 4) + count_r(1 downto 0) when option_r = RENEWAL else
               to_unsigned(REBIND_TIME, 4) + count_r(1 downto 0);
  time_data <= data_r when step_r /= COUNTING else
               std_logic_vector(resize(since_r, 8)) when pass_r = CLEAR and count_r(1 downto 0) = 0 else
               x"00" when pass_r = CLEAR else
               std_logic_vector(carry & first(7 downto 1)) when halves = '1' else
               std_logic_vector(total(7 downto 0));

  access_times : process (clk)
  begin
    if rising_edge(clk) then
      if writes_times = '1' then
        times(to_integer(time_slot)) <= time_data;
      end if;
      carry_r(0) <= total(8);
      if halves = '1' then
        carry_r(0) <= first(0);
      end if;
    end if;
  end process access_times;

  -- ------------------------------------------------------------------ the client

  walks <= '1' when step_r = SENDER or step_r = ADDRESSING or step_r = TAG or step_r = SIZE or step_r = VALUE else '0';

  at_limit <= at_end when area_r = OPTIONS else
              '1' when area_r = FILE_NAME and place_r = FILE_PLACE+FILE_BYTES else
              '1' when area_r = SERVER_NAME and place_r = FILE_PLACE else
              '0';

  wants_broadcast    <= '1' when step_r = SENDING and state_r /= BOUND and state_r /= RENEWING else '0';
  wants_renewal      <= '1' when step_r = SENDING and state_r = RENEWING else '0';
  wants_announcement <= '1' when step_r = SENDING and state_r = BOUND else '0';

  proceed : process (clk)
    variable tries   : tries_t;
    variable pauses  : boolean;                      -- a pause begins
    variable length  : pause_t;
    variable jumps   : boolean;                      -- to another place
    variable target  : natural range 0 to 2**PLACE_BITS-1;
    variable passes  : boolean;                      -- a second passes
    variable counts  : boolean;                      -- one is counted

    procedure pause(pause_length : in natural) is
    begin
      pauses := true;
      length := to_unsigned(pause_length, PAUSE_BITS);
    end procedure pause;

    procedure jump(place : in natural) is
    begin
      jumps  := true;
      target := place;
    end procedure jump;

    procedure lose(pause_length : in natural) is
    begin
      state_r <= STARTING;
      bound_r <= '0';
      is_lost <= bound_r;
      pause(pause_length);
    end procedure lose;

    procedure ask(state : in state_t) is
    begin
      state_r <= state;
      step_r  <= MIXING;
      count_r <= (others => '0');
      tries   := (others => '0');
      pauses  := true;
    end procedure ask;

  begin
    if rising_edge(clk) then
      is_lost <= '0';
      pauses  := false;
      length  := (others => '0');
      target  := FIRST_PLACE;
      tries   := tries_r;

      -- A register with a period of 2**32 - 1, disturbed by what the line brings and by the MAC address, so that boards
      -- which start together differ. It stays in a reset: the numbers after it are not those after the last one.
      if rst_n = '1' then
        random_r <= random_r(30 downto 0)
                    & (random_r(31) xor random_r(21) xor random_r(1) xor random_r(0)
                       xor mac(to_integer(ms_r(4 downto 0)))
                       xor (s_axis_tvalid and s_axis_tdata(0)));
      end if;

      passes := false;
      counts := false;
      if tick = '1' then
        ms_r <= ms_r + 1;
        if ms_r = LAST_MS then
          ms_r    <= (others => '0');
          since_r <= since_r + 1;
          passes  := true;
        end if;
      end if;
      if is_taken = '1' then
        conflict_r <= '1';
      end if;
      proper_r <= has_server_r;
      if state_r = RENEWING then
        proper_r <= '1';
      elsif state_r = REQUESTING then
        proper_r <= has_server_r and chosen_r;
      end if;

      jumps := idles = '1';
      if comes = '1' then
        got_r <= '1';
      end if;

      if walks = '1' and ready_r = '1' and at_limit = '0' then
        count_r <= count_r + 1;
      end if;

      if step_r = RESTING then
        count_r <= (others => '0');
        if conflict_r = '1' then
          conflict_r <= '0';
          if state_r = CHECKING or bound_r = '1' then
            lose(DECLINE_PAUSE);
            step_r <= SENDING;
          end if;
        elsif second_r = '1' then
          pass_r <= ELAPSE;
          counts := true;
          if state_r = CHECKING or bound_r = '1' then
            step_r <= COUNTING;
          end if;
        elsif got_r = '1' then
          got_r        <= '0';
          writes_r     <= '0';
          type_r       <= NO_TYPE;
          overload_r   <= "00";
          has_lease_r  <= '0';
          has_server_r <= '0';
          has_renew_r  <= '0';
          has_rebind_r <= '0';
          same_r       <= '1';
          legal_r      <= '1';
          if state_r /= STARTING and state_r /= CHECKING and state_r /= BOUND then
            got_r   <= '1';
            jump(SENDER_PLACE);
            step_r  <= SENDER;
          end if;
        elsif due_r = '1' then
          if state_r = STARTING then
            if is_stopped = '1' then
              ask(SELECTING);
            end if;
          elsif state_r = CHECKING then
            state_r <= BOUND;
            bound_r <= '1';
            step_r  <= SENDING;
            tries   := (others => '0');
            pause(ANNOUNCE_PAUSE);
          elsif state_r = REQUESTING and tries_r = LAST_REQUEST then
            lose(START_PAUSE);
          -- A second announcement, but no third one.
          elsif state_r /= BOUND or tries_r = 0 then
            pauses := true;
            step_r <= SENDING;
            if tries_r /= LAST_TRY then
              tries := tries_r + 1;
            end if;
          end if;
        end if;
      elsif step_r = MIXING then
        -- What has come answers the number before.
        got_r   <= '0';
        count_r <= count_r + 1;
        if count_r = 31 then
          step_r <= SENDING;
        end if;
      elsif step_r = SENDING then
        since_r <= (others => '0');
        if is_sent = '1' then
          step_r <= RESTING;
        end if;
      elsif step_r = SENDER then
        if ready_r = '1' and count_r = MAC_BYTES-1 then
          jump(OFFER_PLACE);
          count_r <= (others => '0');
          step_r  <= ADDRESSING;
        end if;
      elsif step_r = ADDRESSING then
        if ready_r = '1' then
          if data_r /= read_known then
            same_r <= '0';
          end if;
          if count_r = 0 and (data_r = x"00" or data_r = LOOPBACK or data_r(7 downto 5) = "111") then
            legal_r <= '0';
          end if;
          if writes_known = '1' then
            address_r <= address_r(23 downto 0) & data_r;
          end if;
          if count_r = WORD_BYTES-1 then
            jump(OPTIONS_PLACE);
            area_r  <= OPTIONS;
            step_r  <= TAG;
          end if;
        end if;
      elsif step_r = TAG then
        if at_limit = '1' then
          step_r <= ENDING;
        elsif ready_r = '1' then
          if unsigned(data_r) = END_TAG then
            step_r <= ENDING;
          elsif unsigned(data_r) /= PAD_TAG then
            step_r <= SIZE;
          end if;
          option_r <= option_of(unsigned(data_r));
        end if;
      elsif step_r = SIZE then
        if at_limit = '1' then
          got_r  <= '0';
          step_r <= RESTING;
        elsif ready_r = '1' then
          size_r  <= unsigned(data_r);
          count_r <= (others => '0');
          step_r  <= VALUE;
          if unsigned(data_r) /= size_of(option_r) then
            option_r <= OTHER;
          end if;
          if unsigned(data_r) = 0 then
            step_r <= TAG;
          end if;
        end if;
      elsif step_r = VALUE then
        if at_limit = '1' then
          got_r  <= '0';
          step_r <= RESTING;
        elsif ready_r = '1' then
          size_r <= size_r - 1;
          if size_r = 1 then
            step_r <= TAG;
          end if;
          -- The flags count only if the message does, so the first byte of a value sets them.
          if option_r = MESSAGE_TYPE then
            type_r <= NO_TYPE;
            if data_r(7 downto 3) = "00000" then
              type_r <= unsigned(data_r(2 downto 0));
            end if;
          elsif option_r = OVERLOAD and area_r = OPTIONS then
            overload_r <= data_r(1 downto 0);
          elsif option_r = LEASE then
            has_lease_r <= '1';
          elsif option_r = SERVER then
            has_server_r <= '1';
            if data_r /= read_known then
              chosen_r <= '0';
            elsif count_r = 0 then
              chosen_r <= '1';
            end if;
          elsif option_r = RENEWAL then
            has_renew_r <= '1';
          elsif option_r = REBINDING then
            has_rebind_r <= '1';
          end if;
        end if;
      -- Of an area; then comes the next one.
      elsif step_r = ENDING then
        step_r  <= TAG;
        if area_r = OPTIONS and overload_r(0) = '1' then
          area_r  <= FILE_NAME;
          jump(FILE_PLACE);
        elsif area_r /= SERVER_NAME and overload_r(1) = '1' then
          area_r  <= SERVER_NAME;
          jump(NAME_PLACE);
        elsif writes_r = '0' then
          step_r <= JUDGING;
        else
          got_r   <= '0';
          count_r <= (others => '0');
          pass_r  <= CLEAR;
          step_r  <= COUNTING;
          if state_r = SELECTING then
            state_r <= REQUESTING;
            step_r  <= SENDING;
            tries   := (others => '0');
            pauses  := true;
          end if;
        end if;
      elsif step_r = JUDGING then
        writes_r <= '1';
        jump(SENDER_PLACE);
        count_r  <= (others => '0');
        if proper_r = '1' and ((state_r = SELECTING and type_r = OFFER and legal_r = '1')
                               or (state_r /= SELECTING and type_r = ACK and has_lease_r = '1' and same_r = '1')) then
          step_r <= SENDER;
        else
          got_r  <= '0';
          step_r <= RESTING;
          if state_r /= SELECTING and proper_r = '1'
             and (type_r = NAK or (type_r = ACK and has_lease_r = '1')) then
            lose(START_PAUSE);
          end if;
        end if;
      elsif step_r = COUNTING then
        count_r <= count_r + 1;
        if count_r(1 downto 0) = 3 then
          step_r <= DECIDING;
        end if;
      elsif step_r = DECIDING then
        count_r <= (others => '0');
        step_r  <= COUNTING;
        pass_r  <= after_pass(pass_r);
        if pass_r = CLEAR and has_renew_r = '1' then
          pass_r <= HALF;
        end if;
        if pass_r = REBIND
           or (has_rebind_r = '1' and (pass_r = RENEW or (pass_r = CLEAR and has_renew_r = '1'))) then
          step_r <= RESTING;
          if state_r = REQUESTING then
            state_r <= CHECKING;
            pause(CHECK_PAUSE);
          else
            state_r <= BOUND;
            tries   := to_unsigned(LAST_TRY, tries'length);
          end if;
        elsif pass_r = EXPIRED and carry_r = 1 then
          lose(START_PAUSE);
          step_r <= RESTING;
        elsif pass_r = TO_REBIND and carry_r = 1 and (state_r = BOUND or state_r = RENEWING) then
          ask(REBOUND);
        elsif pass_r = TO_RENEW then
          step_r <= RESTING;
          if carry_r = 1 and state_r = BOUND then
            ask(RENEWING);
          end if;
        end if;
      end if;

      second_r <= '0';
      if owed_r /= 0 then
        second_r <= '1';
      end if;
      if bound_r = '0' and state_r /= CHECKING then
        owed_r <= (others => '0');
      elsif passes and not counts and owed_r(owed_r'high) = '0' then
        owed_r <= owed_r + 1;
      elsif counts and not passes then
        owed_r <= owed_r - 1;
      end if;

      settles_r <= '0';
      ready_r   <= '0';
      if jumps then
        place_r <= to_unsigned(target, PLACE_BITS);
      elsif writes = '1' or (walks = '1' and ready_r = '1' and at_limit = '0') then
        place_r <= place_r + 1;
      else
        settles_r <= walks;
        ready_r   <= settles_r;
      end if;

      tries_r  <= tries;
      pauses_r <= pauses;
      pause_r  <= length;
      due_r    <= '0';
      if pauses_r and pause_r = 0 then
        wait_r <= pause_of(tries_r, random_r(MS_BITS)) & unsigned(random_r(MS_BITS-1 downto 0));
      elsif pauses_r then
        wait_r <= pause_r & unsigned(random_r(MS_BITS-1 downto 0));
      elsif wait_r = 0 and not pauses then
        due_r <= '1';
      elsif wait_r /= 0 and tick = '1' then
        wait_r <= wait_r - 1;
      end if;

      if rst_n = '0' then
        state_r    <= STARTING;
        step_r     <= RESTING;
        bound_r    <= '0';
        is_lost    <= '0';
        got_r      <= '0';
        ms_r       <= (others => '0');
        second_r   <= '0';
        conflict_r <= '0';
        due_r      <= '0';
        pauses_r   <= false;
        wait_r     <= to_unsigned(START_PAUSE, PAUSE_BITS) & unsigned(mac(MS_BITS-1 downto 0));
      end if;
    end if;
  end process proceed;

end architecture rtl;
