-- SPDX-License-Identifier: Apache-2.0
-- Reads the messages of servers for firm_dhcp_client, and holds their contents (RFC 2131, 2132). An arriving message is
-- stored in a memory and read twice: first to check it, then to take its contents. A broken or unwanted message
-- therefore has no effect.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_net_pkg.all;

entity firm_dhcp_reader is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    mac : in std_logic_vector(47 downto 0);  -- of this host, the first byte on the line highest

    -- All frames of firm_mac_receiver; after a last beat, six cycles are without a beat.
    s_axis_tdata  : in std_logic_vector(7 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;

    -- While `draws` is high, up to `is_drawn`, the number of requests is drawn from random bytes. Messages until then
    -- answer the previous number, and are dropped.
    draws    : in  std_logic;
    random   : in  byte_t;
    is_drawn : out std_logic;

    -- `has_message`: a message waits until `reads` is high, and is read then. Without `is_wanted`, it is dropped.
    is_wanted    : in  std_logic;
    is_selecting : in  std_logic;  -- an offer is wanted, whose address is taken; other messages' addresses are compared
    has_message  : out std_logic;
    reads        : in  std_logic;

    -- The message can be checked for one cycle, in which `takes` starts the second reading. When `has_message` falls,
    -- `is_taken` is set if it was taken.
    is_judged    : out std_logic;
    takes        : in  std_logic;
    is_taken     : out std_logic;
    message_type : out unsigned(2 downto 0);  -- 0 for an unknown one
    has_lease    : out std_logic;
    has_server   : out std_logic;
    is_chosen    : out std_logic;  -- the server is that of the offer taken
    is_fitting   : out std_logic;  -- an offer's address is that of a host; another message has the address of the offer

    -- The times of a message that is taken, for firm_dhcp_lease.
    told_valid : out std_logic;
    told_place : out unsigned(3 downto 0);
    told_byte  : out byte_t;

    -- The known values: bytes 0 to 3 are the address, 4 to 7 the server, 8 to 11 the number of requests, and 12 to 17
    -- the MAC address of the message's sender.
    known_place : in  unsigned(4 downto 0);
    known_byte  : out byte_t;
    address     : out std_logic_vector(31 downto 0)
  );
end entity firm_dhcp_reader;

architecture rtl of firm_dhcp_reader is

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
  constant ALL_HOSTS : bytes_t(FIRST_PLACE to FIRST_PLACE+MAC_BYTES-1) := (others => x"ff");
  constant MAGIC     : bytes_t(MAGIC_PLACE to MAGIC_PLACE+3) := (x"63", x"82", x"53", x"63");
  constant FRAGMENT  : byte_t := x"3f";                             -- the flag for more fragments, and the offset
  constant LOOPBACK  : byte_t := x"7f";
  constant GROUP_BIT : natural := 0;

  -- Slots of `known`.
  subtype slot_t is unsigned(4 downto 0);
  constant OFFERED_SLOT : natural := 0;
  constant SERVER_SLOT  : natural := 4;
  constant XID_SLOT     : natural := 8;
  constant SENDER_SLOT  : natural := 12;

  type frame_t is array (natural range 0 to 2**PLACE_BITS-1) of byte_t;
  type known_t is array (natural range 0 to 31) of byte_t;
  signal frame : frame_t;
  signal known : known_t;

  -- ------------------------------------------------------------------ options

  constant PAD_TAG      : natural := 0;
  constant LEASE_TAG    : natural := 51;
  constant OVERLOAD_TAG : natural := 52;
  constant TYPE_TAG     : natural := 53;
  constant SERVER_TAG   : natural := 54;
  constant RENEW_TAG    : natural := 58;
  constant REBIND_TAG   : natural := 59;
  constant END_TAG      : natural := 255;
  constant WORD_BYTES   : natural := 4;

  type option_t is (OTHER, LEASE, OVERLOAD, MESSAGE_KIND, SERVER, RENEWAL, REBINDING);
  type area_t is (OPTIONS, FILE_NAME, SERVER_NAME);
  type step_t is (RESTING, SENDER, ADDRESSING, TAG, SIZE, VALUE, ENDING, JUDGING);

  -- The arriving frame, and the place in it, also when it is read.
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
  signal idles     : std_logic;  -- no frame is arriving or waiting
  signal writes    : std_logic;
  signal comes     : std_logic;  -- it was a reply to this host
  signal got_r     : std_logic;  -- a message waits to be read

  signal step_r    : step_t;
  signal shown_r   : byte_t := (others => '0');  -- the byte at the previous place
  signal data_r    : byte_t := (others => '0');  -- the same one cycle later, since the memory outputs late
  signal settles_r : std_logic;
  signal ready_r   : std_logic;  -- it is the byte at the place
  signal walks     : std_logic;  -- the frame is read
  signal at_limit  : std_logic;
  signal area_r    : area_t;
  signal writes_r  : std_logic;  -- the message is read for the second time
  signal option_r  : option_t;
  signal size_r    : unsigned(7 downto 0) := (others => '0');  -- remaining bytes of the option
  signal count_r   : unsigned(4 downto 0) := (others => '0');

  -- Of the message.
  signal type_r       : unsigned(2 downto 0) := (others => '0');
  signal overload_r   : std_logic_vector(1 downto 0) := (others => '0');
  signal has_lease_r  : std_logic;
  signal has_server_r : std_logic;
  signal chosen_r     : std_logic;
  signal same_r       : std_logic;  -- it has the board's known address
  signal legal_r      : std_logic;  -- it has an address of a host
  signal address_r    : std_logic_vector(31 downto 0) := (others => '0');

  -- Slots that are written and read.
  signal writes_known : std_logic;
  signal known_slot   : slot_t;
  signal known_data   : byte_t;
  signal read_slot    : slot_t;
  signal read_known   : byte_t;
  signal is_server    : std_logic;
  signal is_time      : std_logic;

  function option_of(number : unsigned(7 downto 0)) return option_t is
  begin
    if number = LEASE_TAG then
      return LEASE;
    elsif number = OVERLOAD_TAG then
      return OVERLOAD;
    elsif number = TYPE_TAG then
      return MESSAGE_KIND;
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
    if option = OVERLOAD or option = MESSAGE_KIND then
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
        wrong := differs(to_integer(place_r), s_axis_tdata, TYPE_IPV4)
                 or differs(to_integer(place_r), s_axis_tdata, VERSION)
                 or differs(to_integer(place_r), s_axis_tdata, UDP)
                 or differs(to_integer(place_r), s_axis_tdata, PORT_68)
                 or differs(to_integer(place_r), s_axis_tdata, REPLY)
                 or differs(to_integer(place_r), s_axis_tdata, MAGIC)
                 or differs(to_integer(place_r), s_axis_tdata, placed(mac, HARDWARE_PLACE))
                 or (place_r = SENDER_PLACE and (s_axis_tdata(GROUP_BIT) = '1' or (direct_r or all_r) = '0'))
                 or (place_r = FRAGMENT_PLACE and (s_axis_tdata and FRAGMENT) /= x"00")
                 or (place_r = FRAGMENT_PLACE+1 and s_axis_tdata /= x"00")
                 or (place_r(PLACE_BITS-1 downto 2) = XID_PLACE/4 and s_axis_tdata /= read_known);
        if differs(to_integer(place_r), s_axis_tdata, placed(mac, FIRST_PLACE)) then
          direct_r <= '0';
        end if;
        if differs(to_integer(place_r), s_axis_tdata, ALL_HOSTS) then
          all_r <= '0';
        end if;
        if wrong then
          meant_r <= '0';
        end if;
      end if;
      -- An arriving frame may be an answer to the previous number.
      if ended_r = '1' or draws = '1' then
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
      else
        shown_r <= frame(to_integer(place_r));
      end if;
      data_r <= shown_r;
    end if;
  end process access_frame;

  -- ------------------------------------------------------------------ what is known

  writes_known <= count_r(2) and count_r(1) and count_r(0) when draws = '1' else
                  writes_r and ready_r when step_r = SENDER else
                  writes_r and ready_r and is_selecting when step_r = ADDRESSING else
                  writes_r and ready_r and is_server and not at_limit when step_r = VALUE else
                  '0';

  known_slot <= to_unsigned(XID_SLOT, 5) + count_r(4 downto 3) when draws = '1' else
                to_unsigned(SENDER_SLOT, 5) + count_r(2 downto 0) when step_r = SENDER else
                to_unsigned(OFFERED_SLOT, 5) + count_r(1 downto 0) when step_r = ADDRESSING else
                to_unsigned(SERVER_SLOT, 5) + count_r(1 downto 0);
  known_data <= random when draws = '1' else data_r;
  is_server  <= '1' when option_r = SERVER else '0';
  is_drawn   <= '1' when count_r = 31 else '0';

  -- An arriving frame is compared with the number of the request; during reading, it is compared with the address and
  -- the server.
  read_slot  <= to_unsigned(SERVER_SLOT, 5) + count_r(1 downto 0) when step_r = VALUE else
                to_unsigned(OFFERED_SLOT, 5) + count_r(1 downto 0) when got_r = '1' else
                to_unsigned(XID_SLOT, 5) + place_r(1 downto 0);
  read_known <= known(to_integer(read_slot));
  known_byte <= known(to_integer(known_place));
  address    <= address_r;

  access_known : process (clk)
  begin
    if rising_edge(clk) then
      if writes_known = '1' then
        known(to_integer(known_slot)) <= known_data;
      end if;
    end if;
  end process access_known;

  -- ------------------------------------------------------------------ the message

  is_time    <= '1' when option_r = LEASE or option_r = RENEWAL or option_r = REBINDING else '0';
  told_valid <= writes_r and ready_r and is_time and not at_limit when step_r = VALUE else '0';
  told_place <= "00" & count_r(1 downto 0) when option_r = LEASE else
                "01" & count_r(1 downto 0) when option_r = RENEWAL else
                "10" & count_r(1 downto 0);
  told_byte  <= data_r;

  has_message  <= got_r;
  is_judged    <= '1' when step_r = JUDGING else '0';
  is_taken     <= writes_r;
  message_type <= type_r;
  has_lease    <= has_lease_r;
  has_server   <= has_server_r;
  is_chosen    <= chosen_r;
  is_fitting   <= legal_r when is_selecting = '1' else same_r;

  walks <= '1' when step_r = SENDER or step_r = ADDRESSING or step_r = TAG or step_r = SIZE or step_r = VALUE else '0';

  at_limit <= at_end when area_r = OPTIONS else
              '1' when area_r = FILE_NAME and place_r = FILE_PLACE+FILE_BYTES else
              '1' when area_r = SERVER_NAME and place_r = FILE_PLACE else
              '0';

  read_message : process (clk)
    variable jumps  : boolean;  -- to another place
    variable target : natural range 0 to 2**PLACE_BITS-1;

    procedure jump(place : in natural) is
    begin
      jumps  := true;
      target := place;
    end procedure jump;

  begin
    if rising_edge(clk) then
      jumps  := idles = '1';
      target := FIRST_PLACE;
      if comes = '1' then
        got_r <= '1';
      end if;
      if walks = '1' and ready_r = '1' and at_limit = '0' then
        count_r <= count_r + 1;
      end if;

      if step_r = RESTING then
        count_r <= (others => '0');
        if draws = '1' then
          count_r <= count_r + 1;
        end if;
        if draws = '1' or is_wanted = '0' then
          got_r <= '0';
        elsif got_r = '1' and reads = '1' then
          writes_r     <= '0';
          type_r       <= (others => '0');
          overload_r   <= "00";
          has_lease_r  <= '0';
          has_server_r <= '0';
          same_r       <= '1';
          legal_r      <= '1';
          jump(SENDER_PLACE);
          step_r <= SENDER;
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
            area_r <= OPTIONS;
            step_r <= TAG;
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
          -- The flags are used only with a valid message, so the first byte of a value may set them.
          if option_r = MESSAGE_KIND then
            type_r <= (others => '0');
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
          end if;
        end if;
      -- Of an area; then comes the next one.
      elsif step_r = ENDING then
        step_r <= TAG;
        if area_r = OPTIONS and overload_r(0) = '1' then
          area_r <= FILE_NAME;
          jump(FILE_PLACE);
        elsif area_r /= SERVER_NAME and overload_r(1) = '1' then
          area_r <= SERVER_NAME;
          jump(NAME_PLACE);
        elsif writes_r = '0' then
          step_r <= JUDGING;
        else
          got_r  <= '0';
          step_r <= RESTING;
        end if;
      elsif step_r = JUDGING then
        jump(SENDER_PLACE);
        count_r  <= (others => '0');
        writes_r <= takes;
        step_r   <= SENDER;
        if takes = '0' then
          got_r  <= '0';
          step_r <= RESTING;
        end if;
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

      if rst_n = '0' then
        step_r <= RESTING;
        got_r  <= '0';
      end if;
    end if;
  end process read_message;

end architecture rtl;
