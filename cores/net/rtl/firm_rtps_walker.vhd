-- SPDX-License-Identifier: Apache-2.0
-- Parses RTPS packets while they arrive (OMG DDSI-RTPS 2.5, sections 8.3 and 9.4): writes the fields of each submessage
-- to a record, and forwards the payloads of samples. Both byte orders give the same record.
--
-- A submessage of another kind is skipped. A wrong length or number ends the packet there; the submessages before it
-- are valid. The validity of the whole packet is known at its end.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_walker is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Payloads of firm_udp_receiver.
    s_axis_tdata  : in std_logic_vector(7 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;
    source_mac    : in std_logic_vector(47 downto 0);

    -- A byte of the record, at an address of firm_rtps_pkg.
    field_valid   : out std_logic;
    field_address : out std_logic_vector(RECORD_BITS-1 downto 0);
    field_data    : out std_logic_vector(7 downto 0);

    -- A byte of a sample's payload. Inline parameters are not a part of it.
    payload_valid : out std_logic;
    payload_data  : out std_logic_vector(7 downto 0);

    -- Of the submessage, from its first field to its end.
    kind       : out std_logic_vector(7 downto 0);
    flags      : out std_logic_vector(7 downto 0);
    has_key    : out std_logic;  -- its inline parameters have a key hash
    has_status : out std_logic;  -- its inline parameters have a status

    -- A pulse after the last byte of a submessage.
    is_submessage : out std_logic;

    -- One pulse at the end of each packet.
    is_whole   : out std_logic;
    is_faulty  : out std_logic;  -- the submessages before the fault are valid
    is_foreign : out std_logic;  -- not RTPS 2
    is_aborted : out std_logic   -- the whole packet is invalid
  );
end entity firm_rtps_walker;

architecture rtl of firm_rtps_walker is

  -- A step is a field or several ones; ITEM is the head of a parameter. SKIP, SET, ITEM and VALUE may be missing.
  type step_t is (
    PROTOCOL, SOURCE, HEAD,
    EXTRA, ENDS, NUMBER, SECOND, FRAGMENT, FRAGMENTS, SET_SIZE, SET, COUNT, DESTINATION,
    SKIP, ITEM, VALUE,
    PAYLOAD, REST, FOREIGN, FAULTY
  );
  -- Kinds of submessages that are evaluated.
  constant OF_DATA      : natural := 0;
  constant OF_FRAG      : natural := 1;
  constant OF_GAP       : natural := 2;
  constant OF_HEARTBEAT : natural := 3;
  constant OF_ACKNACK   : natural := 4;
  constant OF_NACK_FRAG : natural := 5;
  constant OF_BEAT_FRAG : natural := 6;
  constant OF_TARGET    : natural := 7;  -- INFO_DST
  subtype kinds_t is std_logic_vector(OF_TARGET downto 0);

  -- The current one is '1'.
  type steps_t is array (step_t) of std_logic;

  constant PROTOCOL_BYTES : positive := 8;
  constant MAC_BYTES      : positive := 6;
  constant PREFIX_BYTES   : positive := 12;
  constant HEAD_BYTES     : positive := 4;
  constant WORD_BYTES     : positive := 4;
  constant NUMBER_BYTES   : positive := 8;
  constant ENDS_BYTES     : positive := 8;
  constant HASH_BYTES     : positive := 16;
  constant STATUS_BYTES   : positive := 4;
  -- Bytes from the field with the offset of the inline parameters to the parameters, without a further field.
  constant DATA_BYTES      : positive := 16;
  constant DATA_FRAG_BYTES : positive := 28;
  constant FRAGMENTS_BYTES : positive := 12;

  subtype size_t is unsigned(15 downto 0);

  type protocol_t is array (0 to PROTOCOL_BYTES-1) of std_logic_vector(7 downto 0);
  constant RTPS_2        : protocol_t := (x"52", x"54", x"50", x"53", x"02", others => x"00");
  constant CHECKED_BYTES : positive   := 5;  -- the minor version and the vendor are any

  -- ------------------------------------------------------------------ the byte, and what it means as the end of a step
  signal byte_r     : std_logic_vector(7 downto 0) := (others => '0');
  signal valid_r    : std_logic;
  signal end_r      : std_logic;
  signal abort_r    : std_logic;
  signal recent_r   : std_logic_vector(15 downto 0) := (others => '0');  -- the bytes before it, the last one lowest
  signal half       : std_logic_vector(15 downto 0);  -- the arriving byte and the previous one
  signal word       : std_logic_vector(31 downto 0);  -- the arriving byte and the three before it
  signal id         : std_logic_vector(15 downto 0);  -- of a parameter, whose head ends with the arriving byte
  signal half_r     : size_t := (others => '0');
  signal less_r     : size_t := (others => '0');      -- half_r - 1
  signal zero_r     : std_logic;                      -- half_r is zero, or one
  signal one_r      : std_logic;
  signal short_r    : std_logic;                      -- too few bytes in DATA, or in DATA_FRAG
  signal shorter_r  : std_logic;
  signal none_r     : std_logic;                      -- the set is empty, or too large
  signal much_r     : std_logic;
  signal set_r      : unsigned(3 downto 0) := (others => '0');  -- its words, less one
  signal sentinel_r : std_logic;
  signal hash_id_r  : std_logic;                      -- a key hash, or a status, with enough bytes
  signal state_id_r : std_logic;

  signal step_r  : steps_t;
  signal place_r : unsigned(4 downto 0) := (others => '0');  -- in the step; it stays at 31
  signal left_r  : size_t := (others => '0');                -- bytes of the step after this one
  signal last_r  : std_logic;                                -- this byte is the last one of its step

  -- Of the submessage.
  signal kind_r       : std_logic_vector(7 downto 0) := (others => '0');
  signal kinds_r      : kinds_t;                    -- which one of those that are read, from its third byte on
  signal flags_r      : std_logic_vector(7 downto 0) := (others => '0');
  signal body_r       : size_t := (others => '0');  -- bytes of it, this one included
  signal final_r      : std_logic;                  -- this byte is its last one
  signal open_r       : std_logic;                  -- it ends with the packet
  signal known_r      : std_logic;                  -- its kind is one of those that are read
  signal free_r       : std_logic;                  -- a length of 0 is one, of its kind
  signal double_r     : std_logic;                  -- it has both a payload and a key
  signal further_r    : size_t := (others => '0');  -- bytes before the inline parameters
  signal before_r     : size_t := (others => '0');  -- further_r - 1
  signal few_r        : std_logic;                  -- further_r is zero, or one
  signal single_r     : std_logic;
  signal has_key_r    : std_logic;
  signal has_status_r : std_logic;
  signal hash_r       : std_logic;  -- the parameter is the first key hash
  signal status_r     : std_logic;  -- the parameter is the first status

  -- The step after one of two bytes or more, unless its bytes determine it; and its size, less one.
  signal plan          : steps_t;
  signal planned_r     : steps_t;
  signal plan_less_r   : unsigned(3 downto 0) := (others => '0');
  signal plan_done_r   : std_logic;  -- it needs no byte
  signal has_payload_r : std_logic;  -- a payload or a key is after the inline parameters
  signal fields_end    : std_logic;  -- the step is the last one of DATA or DATA_FRAG before SKIP

  signal is_little  : std_logic;
  signal next_step  : steps_t;                        -- if this byte is the last one of its step
  signal next_less  : size_t;                         -- its bytes, less one
  signal next_one   : std_logic;                      -- it has one byte
  signal next_done  : std_logic;                      -- it needs no byte
  signal wrong      : std_logic;                      -- if this byte is the last one of its step
  signal in_body    : std_logic;
  signal ends_body  : std_logic;
  signal is_done    : std_logic;                      -- the submessage needs no byte after this one

  function only(step : step_t) return steps_t is
    variable found : steps_t := (others => '0');
  begin
    found(step) := '1';
    return found;
  end function only;

  function equals(name, wanted : std_logic_vector(7 downto 0)) return std_logic is
  begin
    if name = wanted then
      return '1';
    end if;
    return '0';
  end function equals;

  function kinds_of(name : std_logic_vector(7 downto 0)) return kinds_t is
    variable found : kinds_t;
  begin
    found(OF_DATA)      := equals(name, RTPS_DATA);
    found(OF_FRAG)      := equals(name, RTPS_DATA_FRAG);
    found(OF_GAP)       := equals(name, RTPS_GAP);
    found(OF_HEARTBEAT) := equals(name, RTPS_HEARTBEAT);
    found(OF_ACKNACK)   := equals(name, RTPS_ACKNACK);
    found(OF_NACK_FRAG) := equals(name, RTPS_NACK_FRAG);
    found(OF_BEAT_FRAG) := equals(name, RTPS_HEARTBEAT_FRAG);
    found(OF_TARGET)    := equals(name, RTPS_INFO_DESTINATION);
    return found;
  end function kinds_of;

  -- The successor of a step that depends only on the kind.
  function next_of(step : steps_t; kinds : kinds_t) return steps_t is
    variable found     : steps_t := (others => '0');
    variable data      : std_logic;
    variable frag      : std_logic;
    variable gap       : std_logic;
    variable heartbeat : std_logic;
    variable acknack   : std_logic;
    variable nack_frag : std_logic;
    variable beat_frag : std_logic;
    variable target    : std_logic;
    variable begins    : std_logic;  -- with the entities
  begin
    data      := kinds(OF_DATA);
    frag      := kinds(OF_FRAG);
    gap       := kinds(OF_GAP);
    heartbeat := kinds(OF_HEARTBEAT);
    acknack   := kinds(OF_ACKNACK);
    nack_frag := kinds(OF_NACK_FRAG);
    beat_frag := kinds(OF_BEAT_FRAG);
    target    := kinds(OF_TARGET);
    begins    := gap or heartbeat or acknack or nack_frag or beat_frag;

    found(SOURCE)      := step(PROTOCOL);
    found(HEAD)        := step(SOURCE);
    found(EXTRA)       := step(HEAD) and (data or frag);
    found(ENDS)        := step(EXTRA) or (step(HEAD) and begins);
    found(DESTINATION) := step(HEAD) and target;
    found(NUMBER)      := step(ENDS);
    found(FRAGMENTS)   := step(NUMBER) and frag;
    found(SECOND)      := step(NUMBER) and (heartbeat or gap);
    found(FRAGMENT)    := step(NUMBER) and (nack_frag or beat_frag);
    found(SET_SIZE)    := (step(NUMBER) and acknack) or (step(SECOND) and gap) or (step(FRAGMENT) and nack_frag);
    found(COUNT)       := (step(SECOND) and heartbeat) or (step(FRAGMENT) and beat_frag)
                          or ((step(SET_SIZE) or step(SET)) and not gap);
    found(ITEM)        := step(VALUE);
    found(PAYLOAD)     := step(PAYLOAD);
    found(REST)        := (step(HEAD) and not (data or frag or begins or target))
                          or ((step(SET_SIZE) or step(SET)) and gap)
                          or step(COUNT) or step(DESTINATION) or step(REST);
    return found;
  end function next_of;

  -- A byte of a MAC address.
  function selected(mac : std_logic_vector(47 downto 0); place : unsigned(2 downto 0)) return std_logic_vector is
    variable found : std_logic_vector(7 downto 0) := mac(7 downto 0);
  begin
    for index in 0 to MAC_BYTES-2 loop
      if place = index then
        found := mac(47-8*index downto 40-8*index);
      end if;
    end loop;
    return found;
  end function selected;

  -- The bytes of a step with a fixed size, less one; of those without an end, any.
  function less_of(step : steps_t) return unsigned is
    variable less : unsigned(3 downto 0) := to_unsigned(WORD_BYTES-1, 4);
  begin
    less(2) := step(ENDS) or step(NUMBER) or step(SECOND);
    less(3) := step(SOURCE) or step(DESTINATION) or step(FRAGMENTS);
    return less;
  end function less_of;

begin

  is_little <= flags_r(RTPS_LITTLE);
  half      <= s_axis_tdata & byte_r when is_little = '1' else byte_r & s_axis_tdata;
  word      <= s_axis_tdata & byte_r & recent_r(7 downto 0) & recent_r(15 downto 8) when is_little = '1' else
               recent_r & byte_r & s_axis_tdata;
  id        <= recent_r(7 downto 0) & recent_r(15 downto 8) when is_little = '1' else recent_r;

  take_byte : process (clk)
  begin
    if rising_edge(clk) then
      valid_r <= s_axis_tvalid;
      if s_axis_tvalid = '1' then
        byte_r     <= s_axis_tdata;
        end_r      <= s_axis_tlast;
        abort_r    <= s_axis_tuser(0);
        recent_r   <= recent_r(7 downto 0) & byte_r;
        half_r     <= unsigned(half);
        less_r     <= unsigned(half) - 1;
        zero_r     <= '0';
        one_r      <= '0';
        short_r    <= '0';
        shorter_r  <= '0';
        none_r     <= '0';
        much_r     <= '0';
        sentinel_r <= '0';
        hash_id_r  <= '0';
        state_id_r <= '0';
        set_r      <= unsigned(word(8 downto 5));
        if word(4 downto 0) = "00000" then
          set_r <= unsigned(word(8 downto 5)) - 1;
        end if;
        if unsigned(half) = 0 then
          zero_r <= '1';
        end if;
        if unsigned(half) = 1 then
          one_r <= '1';
        end if;
        -- short_r: fewer than 16 bytes; shorter_r: fewer than 28; much_r: more than 256 sequence numbers. Comparisons
        -- of parts need no adders.
        if unsigned(half(15 downto 4)) = 0 then
          short_r <= '1';
        end if;
        if unsigned(half(15 downto 5)) = 0 and half(4 downto 2) /= "111" then
          shorter_r <= '1';
        end if;
        if unsigned(word) = 0 then
          none_r <= '1';
        end if;
        if unsigned(word(31 downto 9)) /= 0 or (word(8) = '1' and word(7 downto 0) /= x"00") then
          much_r <= '1';
        end if;
        if id = RTPS_SENTINEL then
          sentinel_r <= '1';
        end if;
        if id = RTPS_KEY_HASH and unsigned(half(15 downto 4)) /= 0 then
          hash_id_r <= '1';
        end if;
        if id = RTPS_STATUS_INFO and unsigned(half(15 downto 2)) /= 0 then
          state_id_r <= '1';
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process take_byte;

  -- ------------------------------------------------------------------ the order of the steps

  fields_end <= step_r(FRAGMENTS) when kinds_r(OF_FRAG) = '1' else
                step_r(NUMBER) when kinds_r(OF_DATA) = '1' else
                '0';

  choose_plan : process (step_r, kinds_r, flags_r, few_r, fields_end, has_payload_r)
  begin
    plan <= next_of(step_r, kinds_r);
    if fields_end = '1' then
      plan          <= (others => '0');
      plan(SKIP)    <= not few_r;
      plan(ITEM)    <= few_r and flags_r(RTPS_INLINE);
      plan(PAYLOAD) <= few_r and not flags_r(RTPS_INLINE) and has_payload_r;
      plan(REST)    <= few_r and not (flags_r(RTPS_INLINE) or has_payload_r);
    end if;
  end process choose_plan;

  make_plan : process (clk)
  begin
    if rising_edge(clk) then
      has_payload_r <= '1';
      if kinds_r(OF_DATA) = '1' then
        has_payload_r <= flags_r(RTPS_PAYLOAD) or flags_r(RTPS_KEY);
      end if;
      planned_r   <= plan;
      plan_less_r <= less_of(plan);
      plan_done_r <= plan(PAYLOAD) or plan(REST);
    end if;
  end process make_plan;

  -- VALUE and SKIP may have one byte, so the step after them is not planned in advance.
  choose : process (step_r, kinds_r, flags_r, planned_r, plan_less_r, plan_done_r, has_payload_r, before_r, single_r,
                    less_r, set_r, zero_r, one_r, short_r, shorter_r, none_r, much_r, sentinel_r, free_r, double_r)
    variable has_value : std_logic;
    variable has_set   : std_logic;
    variable leaves    : std_logic;  -- the inline parameters are over
    variable repeats   : std_logic;  -- another head is next
    variable unplanned : std_logic;
    variable found     : steps_t;
  begin
    has_value := step_r(ITEM) and not (sentinel_r or zero_r);
    has_set   := step_r(SET_SIZE) and not none_r;
    leaves    := (step_r(ITEM) and sentinel_r) or (step_r(SKIP) and not flags_r(RTPS_INLINE));
    repeats   := step_r(HEAD) and free_r and zero_r;
    unplanned := step_r(ITEM) or step_r(VALUE) or step_r(SKIP) or has_set or repeats;

    found := (others => '0');
    for step in steps_t'range loop
      found(step) := planned_r(step) and not unplanned;
    end loop;
    found(ITEM)    := found(ITEM) or step_r(VALUE) or (step_r(ITEM) and zero_r and not sentinel_r)
                      or (step_r(SKIP) and flags_r(RTPS_INLINE));
    found(VALUE)   := has_value;
    found(SET)     := has_set;
    found(PAYLOAD) := found(PAYLOAD) or (leaves and has_payload_r);
    found(REST)    := found(REST) or (leaves and not has_payload_r);
    found(HEAD)    := found(HEAD) or repeats;
    next_step      <= found;

    next_less <= to_unsigned(WORD_BYTES-1, 16);
    next_one  <= '0';
    if has_value = '1' then
      next_less <= less_r;
      next_one  <= one_r;
    elsif has_set = '1' then
      next_less <= "0000000000" & set_r & "11";
    elsif unplanned = '0' and planned_r(SKIP) = '1' then
      next_less <= before_r;
      next_one  <= single_r;
    elsif unplanned = '0' then
      next_less <= resize(plan_less_r, 16);
    end if;

    next_done <= leaves or (plan_done_r and not unplanned);
    wrong     <= (step_r(HEAD) and double_r) or (step_r(EXTRA) and short_r) or (step_r(SET_SIZE) and much_r);
    if kinds_r(OF_FRAG) = '1' then
      wrong <= step_r(EXTRA) and shorter_r;
    end if;
  end process choose;

  in_body   <= not (step_r(PROTOCOL) or step_r(SOURCE) or step_r(HEAD) or step_r(FOREIGN) or step_r(FAULTY));
  ends_body <= final_r or (open_r and end_r);
  is_done   <= step_r(PAYLOAD) or step_r(REST) or (last_r and next_done and not wrong);

  -- After the end of the packet or a fault, these numbers are invalid.
  count_bytes : process (clk)

    procedure begin_step(less : size_t; is_one : std_logic) is
    begin
      place_r <= (others => '0');
      left_r  <= less;
      last_r  <= is_one;
    end procedure begin_step;

  begin
    if rising_edge(clk) then
      if valid_r = '1' then
        if end_r = '1' then
          begin_step(to_unsigned(PROTOCOL_BYTES-1, 16), '0');
        elsif ends_body = '1' then
          begin_step(to_unsigned(HEAD_BYTES-1, 16), '0');
        elsif last_r = '1' then
          begin_step(next_less, next_one);
        else
          left_r <= left_r - 1;
          if left_r = 1 then
            last_r <= '1';
          end if;
          if place_r /= 31 then
            place_r <= place_r + 1;
          end if;
        end if;
      end if;
      if rst_n = '0' then
        begin_step(to_unsigned(PROTOCOL_BYTES-1, 16), '0');
      end if;
    end if;
  end process count_bytes;

  count_body : process (clk)
  begin
    if rising_edge(clk) then
      if valid_r = '1' then
        final_r <= '0';
        if step_r(HEAD) = '1' then
          body_r  <= half_r;
          final_r <= last_r and one_r;
          open_r  <= last_r and zero_r;
        elsif in_body = '1' then
          body_r <= body_r - 1;
          if body_r = 2 then
            final_r <= not open_r;
          end if;
        end if;
        if end_r = '1' then
          final_r <= '0';
          open_r  <= '0';
        end if;
      end if;
      -- A reset may come within a submessage.
      if rst_n = '0' then
        final_r <= '0';
        open_r  <= '0';
      end if;
    end if;
  end process count_body;

  walk : process (clk)
  begin
    if rising_edge(clk) then
      if valid_r = '1' then
        if step_r(FOREIGN) = '1' or step_r(FAULTY) = '1' then
          null;
        elsif ends_body = '1' then
          step_r <= only(FAULTY);
          if is_done = '1' then
            step_r <= only(HEAD);
          end if;
        elsif last_r = '1' then
          step_r <= next_step;
          if wrong = '1' then
            step_r <= only(FAULTY);
          end if;
        end if;
        if step_r(PROTOCOL) = '1' and byte_r /= RTPS_2(to_integer(place_r(2 downto 0)))
           and place_r < CHECKED_BYTES then
          step_r <= only(FOREIGN);
        end if;
        if end_r = '1' then
          step_r <= only(PROTOCOL);
        end if;
      end if;
      if rst_n = '0' then
        step_r <= only(PROTOCOL);
      end if;
    end if;
  end process walk;

  -- ------------------------------------------------------------------ the submessage

  read_head : process (clk)
    variable least : size_t;
  begin
    if rising_edge(clk) then
      kinds_r <= kinds_of(kind_r);
      known_r <= '1';
      if unsigned(kinds_r) = 0 then
        known_r <= '0';
      end if;
      free_r <= '0';
      if kind_r = RTPS_PAD or kind_r = RTPS_INFO_TIMESTAMP then
        free_r <= '1';
      end if;
      double_r <= '0';
      if kinds_r(OF_DATA) = '1' then
        double_r <= flags_r(RTPS_PAYLOAD) and flags_r(RTPS_KEY);
      end if;
      before_r <= further_r - 1;
      few_r    <= '0';
      single_r <= '0';
      if further_r = 0 then
        few_r <= '1';
      end if;
      if further_r = 1 then
        single_r <= '1';
      end if;
      if valid_r = '1' then
        if step_r(HEAD) = '1' then
          has_key_r    <= '0';
          has_status_r <= '0';
          if place_r = 0 then
            kind_r <= byte_r;
          elsif place_r = 1 then
            flags_r <= byte_r;
          end if;
        elsif step_r(EXTRA) = '1' then
          least := to_unsigned(DATA_BYTES, 16);
          if kinds_r(OF_FRAG) = '1' then
            least := to_unsigned(DATA_FRAG_BYTES, 16);
          end if;
          further_r <= half_r - least;
        elsif step_r(ITEM) = '1' then
          hash_r   <= hash_id_r and not has_key_r;
          status_r <= state_id_r and not has_status_r;
        elsif step_r(VALUE) = '1' and last_r = '1' then
          has_key_r    <= has_key_r or hash_r;
          has_status_r <= has_status_r or status_r;
        end if;
      end if;
    end if;
  end process read_head;

  write_record : process (clk)

    subtype address_t is unsigned(RECORD_BITS-1 downto 0);

    variable written : std_logic;
    variable base    : natural range 0 to 2**RECORD_BITS-1;
    variable data    : std_logic_vector(7 downto 0);
    variable big     : address_t;  -- bits of the place that differ from those in the record, if it is big-endian
    variable little  : address_t;

  begin
    if rising_edge(clk) then
      written := '1';
      base    := 0;
      data    := byte_r;
      big     := to_unsigned(WORD_BYTES-1, RECORD_BITS);
      little  := (others => '0');
      if step_r(PROTOCOL) = '1' then
        -- This cycle records nothing of the packet, which leaves time for its sender.
        base := RECORD_SOURCE_MAC;
        big  := (others => '0');
        data := selected(source_mac, place_r(2 downto 0));
        if place_r >= MAC_BYTES then
          written := '0';
        end if;
      elsif step_r(SOURCE) = '1' then
        base := RECORD_SOURCE;
        big  := (others => '0');
      elsif step_r(HEAD) = '1' then
        base := RECORD_KIND;
        big  := (others => '0');
        if place_r >= 2 then
          written := '0';
        end if;
      elsif step_r(ENDS) = '1' then
        base := RECORD_READER;
        big  := (others => '0');
      elsif step_r(DESTINATION) = '1' then
        base := RECORD_DESTINATION;
        big  := (others => '0');
      elsif step_r(NUMBER) = '1' or step_r(SECOND) = '1' then
        base := RECORD_NUMBER;
        if step_r(SECOND) = '1' then
          base := RECORD_SECOND;
        end if;
        big    := to_unsigned(NUMBER_BYTES-1, RECORD_BITS);
        little := to_unsigned(WORD_BYTES, RECORD_BITS);
      elsif step_r(FRAGMENT) = '1' then
        base := RECORD_FRAGMENT;
      elsif step_r(COUNT) = '1' then
        base := RECORD_COUNT;
      elsif step_r(FRAGMENTS) = '1' then
        base := RECORD_FRAGMENTS;
        if place_r(2) = '1' then
          -- Two numbers of two bytes.
          big := to_unsigned(1, RECORD_BITS);
        end if;
      elsif step_r(SET_SIZE) = '1' then
        base := RECORD_SET_SIZE;
      elsif step_r(SET) = '1' then
        base   := RECORD_SET;
        big    := (others => '0');
        little := to_unsigned(WORD_BYTES-1, RECORD_BITS);
      elsif step_r(VALUE) = '1' and hash_r = '1' and place_r < HASH_BYTES then
        base := RECORD_KEY_HASH;
        big  := (others => '0');
      elsif step_r(VALUE) = '1' and status_r = '1' and place_r < STATUS_BYTES then
        base := RECORD_STATUS;
        big  := (others => '0');
      else
        written := '0';
      end if;
      if is_little = '1' and step_r(PROTOCOL) = '0' and step_r(SOURCE) = '0' and step_r(HEAD) = '0' then
        big := little;
      end if;
      field_valid   <= written and valid_r and rst_n;
      field_address <= std_logic_vector(to_unsigned(base, RECORD_BITS) or (resize(place_r, RECORD_BITS) xor big));
      field_data    <= data;
    end if;
  end process write_record;

  forward : process (clk)
  begin
    if rising_edge(clk) then
      payload_valid <= '0';
      payload_data  <= byte_r;
      is_submessage <= '0';
      if step_r(PAYLOAD) = '1' then
        payload_valid <= valid_r and rst_n;
      end if;
      if in_body = '1' then
        is_submessage <= valid_r and ends_body and is_done and known_r and rst_n;
      end if;
    end if;
  end process forward;

  kind       <= kind_r;
  flags      <= flags_r;
  has_key    <= has_key_r;
  has_status <= has_status_r;

  -- ------------------------------------------------------------------ the end of the packet

  judge : process (clk)
    variable whole   : std_logic;
    variable strange : std_logic;
  begin
    if rising_edge(clk) then
      whole   := in_body and ends_body and is_done;
      strange := '0';
      if step_r(SOURCE) = '1' then
        whole   := last_r;
        strange := not last_r;
      elsif step_r(PROTOCOL) = '1' or step_r(FOREIGN) = '1' then
        strange := '1';
      elsif step_r(HEAD) = '1' and zero_r = '1' and (free_r = '1' or planned_r(REST) = '1') then
        whole := last_r;
      end if;
      is_whole   <= '0';
      is_faulty  <= '0';
      is_foreign <= '0';
      is_aborted <= '0';
      if valid_r = '1' and end_r = '1' and rst_n = '1' then
        is_aborted <= abort_r;
        is_whole   <= whole and not abort_r;
        is_foreign <= strange and not abort_r;
        is_faulty  <= not (whole or strange or abort_r);
      end if;
    end if;
  end process judge;

end architecture rtl;
