-- SPDX-License-Identifier: Apache-2.0
-- Obtains the address of a board by DHCP (RFC 2131), probes it before its use (RFC 5227), and keeps it. Its packets are
-- programs of firm_packet_builder, which fusesoc_firm.fabric.dhcp creates; `own_byte` supplies their variable bytes.
-- firm_dhcp_reader reads the messages of servers, and firm_dhcp_lease counts the seconds of the leases that they grant.
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

    -- For the builder: the number of a byte, and the byte. Bits 6 to 5 of `own_select` are 0 for the byte that bits 4
    -- to 0 select, 1 for the same or 0 while the board has no address, 2 for the same or 0 in a message without a
    -- selected server and address, and 3 for the number in bits 4 to 0 with bit 4 repeated, or 0 in such a message.
    own_select : in  std_logic_vector(6 downto 0);
    own_byte   : out std_logic_vector(7 downto 0);

    -- The address, constant while `is_bound` or `is_checking`. While `is_checking`, it is probed for.
    address     : out std_logic_vector(31 downto 0);
    is_bound    : out std_logic;
    is_checking : out std_logic;
    is_taken    : in  std_logic;  -- a pulse if another host has the address
    is_stopped  : in  std_logic;  -- the users of the last address are at rest
    is_lost     : out std_logic   -- a pulse when the board loses its address
  );
end entity firm_dhcp_client;

architecture rtl of firm_dhcp_client is

  -- Bytes that firm_dhcp_reader does not hold: the end of a message that lacks some options (0 in the others), and the
  -- type of the message.
  constant END_PLACE  : natural := 30;
  constant TYPE_PLACE : natural := 31;
  constant END_TAG    : natural := 255;

  subtype type_t is unsigned(2 downto 0);
  constant DISCOVER : type_t := "001";
  constant OFFER    : type_t := "010";
  constant REQUEST  : type_t := "011";
  constant DECLINE  : type_t := "100";
  constant ACK      : type_t := "101";
  constant NAK      : type_t := "110";

  -- STARTING: without an address, until the pause is over. The others wait for an offer, for the lease, for a host with
  -- the same address, for the time of renewal, for the server, and for any server.
  type state_t is (STARTING, SELECTING, REQUESTING, CHECKING, BOUND, RENEWING, REBOUND);
  type step_t is (RESTING, MIXING, SENDING, READING, BEGINNING, COUNTING);

  signal state_r : state_t;
  signal step_r  : step_t;
  signal bound_r : std_logic;

  -- Of firm_dhcp_reader.
  signal draws        : std_logic;
  signal is_drawn     : std_logic;
  signal is_wanted    : std_logic;
  signal is_selecting : std_logic;
  signal has_message  : std_logic;
  signal reads        : std_logic;
  signal is_judged    : std_logic;
  signal takes        : std_logic;
  signal is_taken_up  : std_logic;
  signal message_type : type_t;
  signal has_lease    : std_logic;
  signal has_server   : std_logic;
  signal is_chosen    : std_logic;
  signal is_fitting   : std_logic;
  signal proper_r     : std_logic;  -- the message is from a server that may answer
  signal told_valid   : std_logic;
  signal told_place   : unsigned(3 downto 0);
  signal told_byte    : byte_t;
  signal own_place    : unsigned(4 downto 0);
  signal own_known    : byte_t;
  -- Of the leaving message, until its end.
  signal own_type_r   : type_t := DISCOVER;
  signal chooses_r    : std_logic;  -- it contains the address and the server

  -- Of firm_dhcp_lease.
  signal second   : std_logic;
  signal is_asked : std_logic;
  signal begins_r : std_logic;
  signal counts_r : std_logic;
  signal is_done  : std_logic;
  signal is_held  : std_logic;
  signal is_owed  : std_logic;
  signal ends     : std_logic;
  signal rebinds  : std_logic;
  signal renews   : std_logic;

  -- ------------------------------------------------------------------ time

  constant MS_BITS    : natural := 10;
  constant LAST_MS    : natural := 999;
  constant PAUSE_BITS : natural := 7;
  subtype tries_t is unsigned(2 downto 0);
  -- Pauses, in 1024 ms, to which up to 1023 ms are added.
  subtype pause_t is unsigned(PAUSE_BITS-1 downto 0);
  constant START_PAUSE    : natural := 1;
  constant DECLINE_PAUSE  : natural := 10;
  constant CHECK_PAUSE    : natural := 5;
  constant ANNOUNCE_PAUSE : natural := 2;
  constant LAST_TRY       : natural := 4;
  constant LAST_REQUEST   : natural := 2;

  signal ms_r       : unsigned(MS_BITS-1 downto 0) := (others => '0');
  signal conflict_r : std_logic;
  signal random_r   : std_logic_vector(31 downto 0) := (others => '1');
  signal wait_r     : unsigned(PAUSE_BITS+MS_BITS-1 downto 0) := (others => '0');
  signal due_r      : std_logic;
  signal pauses_r   : boolean;                     -- a pause begins
  signal pause_r    : pause_t := (others => '0');  -- its length; 0 for that before the next try
  signal tries_r    : tries_t := (others => '0');

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

begin

  -- ------------------------------------------------------------------ messages of servers

  draws        <= '1' when step_r = MIXING else '0';
  is_wanted    <= '0' when state_r = STARTING or state_r = CHECKING or state_r = BOUND else '1';
  is_selecting <= '1' when state_r = SELECTING else '0';
  reads        <= '1' when step_r = READING else '0';
  takes        <= '0' when proper_r = '0' or is_fitting = '0' else
                  '1' when state_r = SELECTING and message_type = OFFER else
                  has_lease when state_r /= SELECTING and message_type = ACK else
                  '0';

  u_reader : entity firm.firm_dhcp_reader
    port map (
      clk           => clk,
      rst_n         => rst_n,
      mac           => mac,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tuser  => s_axis_tuser,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      draws         => draws,
      random        => random_r(7 downto 0),
      is_drawn      => is_drawn,
      is_wanted     => is_wanted,
      is_selecting  => is_selecting,
      has_message   => has_message,
      reads         => reads,
      is_judged     => is_judged,
      takes         => takes,
      is_taken      => is_taken_up,
      message_type  => message_type,
      has_lease     => has_lease,
      has_server    => has_server,
      is_chosen     => is_chosen,
      is_fitting    => is_fitting,
      told_valid    => told_valid,
      told_place    => told_place,
      told_byte     => told_byte,
      known_place   => own_place,
      known_byte    => own_known,
      address       => address
    );

  -- ------------------------------------------------------------------ messages to servers

  own_place <= unsigned(own_select(4 downto 0));

  note_type : process (clk)
  begin
    if rising_edge(clk) then
      own_type_r <= REQUEST;
      chooses_r  <= '0';
      if state_r = SELECTING then
        own_type_r <= DISCOVER;
      elsif state_r = REQUESTING then
        chooses_r <= '1';
      elsif state_r = STARTING then
        own_type_r <= DECLINE;
        chooses_r  <= '1';
      end if;
    end if;
  end process note_type;

  show : process (own_select, own_place, own_known, own_type_r, bound_r, chooses_r)
    variable byte : byte_t;
  begin
    byte := own_known;
    if own_place = END_PLACE and own_type_r = DECLINE then
      byte := std_logic_vector(to_unsigned(END_TAG, 8));
    elsif own_place = END_PLACE then
      byte := (others => '0');
    elsif own_place = TYPE_PLACE then
      byte := std_logic_vector(resize(own_type_r, 8));
    end if;
    if own_select(6 downto 5) = "11" then
      byte := "00" & own_select(4) & own_select(4 downto 0);
    end if;
    if (own_select(6 downto 5) = "01" and bound_r = '0') or (own_select(6) = '1' and chooses_r = '0') then
      byte := (others => '0');
    end if;
    own_byte <= byte;
  end process show;

  is_bound    <= bound_r;
  is_checking <= '1' when state_r = CHECKING else '0';

  -- ------------------------------------------------------------------ the lease

  second   <= tick when ms_r = LAST_MS else '0';
  is_asked <= '1' when step_r = SENDING else '0';
  is_held  <= '1' when bound_r = '1' or state_r = CHECKING else '0';

  u_lease : entity firm.firm_dhcp_lease
    port map (
      clk        => clk,
      rst_n      => rst_n,
      second     => second,
      is_asked   => is_asked,
      told_valid => told_valid,
      told_place => told_place,
      told_byte  => told_byte,
      begins     => begins_r,
      counts     => counts_r,
      is_done    => is_done,
      is_held    => is_held,
      is_owed    => is_owed,
      ends       => ends,
      rebinds    => rebinds,
      renews     => renews
    );

  -- ------------------------------------------------------------------ the client

  wants_broadcast    <= '1' when step_r = SENDING and state_r /= BOUND and state_r /= RENEWING else '0';
  wants_renewal      <= '1' when step_r = SENDING and state_r = RENEWING else '0';
  wants_announcement <= '1' when step_r = SENDING and state_r = BOUND else '0';

  proceed : process (clk)
    variable tries  : tries_t;
    variable pauses : boolean;  -- a pause begins
    variable length : pause_t;

    procedure pause(pause_length : in natural) is
    begin
      pauses := true;
      length := to_unsigned(pause_length, PAUSE_BITS);
    end procedure pause;

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
      tries   := (others => '0');
      pauses  := true;
    end procedure ask;

  begin
    if rising_edge(clk) then
      is_lost  <= '0';
      begins_r <= '0';
      counts_r <= '0';
      pauses   := false;
      length   := (others => '0');
      tries    := tries_r;

      -- A shift register with a period of 2**32 - 1, perturbed by received bytes and by the MAC address, so that boards
      -- which start together differ. A reset does not clear it, so its numbers do not repeat after a reset.
      if rst_n = '1' then
        random_r <= random_r(30 downto 0)
                    & (random_r(31) xor random_r(21) xor random_r(1) xor random_r(0)
                       xor mac(to_integer(ms_r(4 downto 0)))
                       xor (s_axis_tvalid and s_axis_tdata(0)));
      end if;

      if second = '1' then
        ms_r <= (others => '0');
      elsif tick = '1' then
        ms_r <= ms_r + 1;
      end if;
      if is_taken = '1' then
        conflict_r <= '1';
      end if;
      proper_r <= has_server;
      if state_r = RENEWING then
        proper_r <= '1';
      elsif state_r = REQUESTING then
        proper_r <= has_server and is_chosen;
      end if;

      if step_r = RESTING then
        if conflict_r = '1' then
          conflict_r <= '0';
          if state_r = CHECKING or bound_r = '1' then
            lose(DECLINE_PAUSE);
            step_r <= SENDING;
          end if;
        elsif is_owed = '1' then
          counts_r <= '1';
          step_r   <= COUNTING;
        -- Without `is_wanted`, the reader will drop it.
        elsif has_message = '1' and is_wanted = '1' then
          step_r <= READING;
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
          -- A second announcement, but not a third one.
          elsif state_r /= BOUND or tries_r = 0 then
            pauses := true;
            step_r <= SENDING;
            if tries_r /= LAST_TRY then
              tries := tries_r + 1;
            end if;
          end if;
        end if;
      elsif step_r = MIXING then
        if is_drawn = '1' then
          step_r <= SENDING;
        end if;
      elsif step_r = SENDING then
        if is_sent = '1' then
          step_r <= RESTING;
        end if;
      elsif step_r = READING then
        if is_judged = '1' then
          if state_r /= SELECTING and proper_r = '1'
             and (message_type = NAK or (message_type = ACK and has_lease = '1' and is_fitting = '0')) then
            lose(START_PAUSE);
          end if;
        elsif has_message = '0' then
          step_r <= RESTING;
          if is_taken_up = '1' and state_r = SELECTING then
            state_r <= REQUESTING;
            step_r  <= SENDING;
            tries   := (others => '0');
            pauses  := true;
          elsif is_taken_up = '1' then
            begins_r <= '1';
            step_r   <= BEGINNING;
          end if;
        end if;
      elsif step_r = BEGINNING then
        if is_done = '1' then
          step_r <= RESTING;
          if state_r = REQUESTING then
            state_r <= CHECKING;
            pause(CHECK_PAUSE);
          else
            state_r <= BOUND;
            tries   := to_unsigned(LAST_TRY, tries'length);
          end if;
        end if;
      elsif step_r = COUNTING then
        if is_done = '1' then
          step_r <= RESTING;
          if ends = '1' then
            lose(START_PAUSE);
          elsif rebinds = '1' and (state_r = BOUND or state_r = RENEWING) then
            ask(REBOUND);
          elsif renews = '1' and state_r = BOUND then
            ask(RENEWING);
          end if;
        end if;
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
        ms_r       <= (others => '0');
        begins_r   <= '0';
        counts_r   <= '0';
        conflict_r <= '0';
        due_r      <= '0';
        pauses_r   <= false;
        wait_r     <= to_unsigned(START_PAUSE, PAUSE_BITS) & unsigned(mac(MS_BITS-1 downto 0));
      end if;
    end if;
  end process proceed;

end architecture rtl;
