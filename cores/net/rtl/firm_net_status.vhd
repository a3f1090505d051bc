-- SPDX-License-Identifier: Apache-2.0
-- Reads and writes the status of a system by UDP datagrams. A request has the payload of a frame of the status id, an
-- address and a word. The frame is passed to the system, and the system's answer is returned to the sender.
--
-- The reply is the request with the parties exchanged, and without a checksum of UDP, so the checksum of IPv4 holds.
-- One request is in progress at a time; others meanwhile are dropped, and their senders repeat them.
--
-- There is no time-out, since an answer always comes: firm_status_frames accepts every request sent here, and the
-- registers answer an access to any address. A frame in progress from the system delays the answer.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_net_status is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- This host, the first byte on the line highest.
    mac     : in std_logic_vector(47 downto 0);
    address : in std_logic_vector(31 downto 0);

    -- All frames of firm_mac_receiver.
    s_axis_tdata  : in std_logic_vector(7 downto 0);
    s_axis_tuser  : in std_logic_vector(0 downto 0);
    s_axis_tvalid : in std_logic;
    s_axis_tlast  : in std_logic;

    -- Frames to the system.
    request_tdata  : out std_logic_vector(7 downto 0);
    request_tvalid : out std_logic;
    request_tlast  : out std_logic;
    request_tready : in  std_logic;

    -- The system's frames of the status id, taken at once: one for each request.
    answer_tdata  : in std_logic_vector(7 downto 0);
    answer_tvalid : in std_logic;
    answer_tlast  : in std_logic;

    -- Replies; within one, there is a byte in each cycle.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_net_status;

architecture rtl of firm_net_status is

  -- The port of the status, below those of RTPS: 7399.
  constant PORT_NUMBER : std_logic_vector(15 downto 0) := x"1ce7";
  constant STATUS_ID   : std_logic_vector(7 downto 0) := x"ff";

  -- Places in a frame, of the first byte of a field.
  constant TYPE_PLACE     : natural := 12;
  constant VERSION_PLACE  : natural := 14;
  constant LENGTH_PLACE   : natural := 16;
  constant FRAGMENT_PLACE : natural := 20;
  constant PROTOCOL_PLACE : natural := 23;
  constant SOURCE_PLACE   : natural := 26;
  constant TARGET_PLACE   : natural := 30;
  constant PORTS_PLACE    : natural := 34;
  constant PORT_PLACE     : natural := 36;
  constant SIZE_PLACE     : natural := 38;  -- of the datagram
  constant CHECKSUM_PLACE : natural := 40;
  constant PAYLOAD_PLACE  : natural := 42;
  constant END_PLACE      : natural := 50;
  constant MAC_BYTES      : natural := 6;

  constant TYPE_IPV4    : std_logic_vector(15 downto 0) := x"0800";
  constant VERSION      : std_logic_vector(7 downto 0) := x"45";  -- without options
  constant UDP          : std_logic_vector(7 downto 0) := x"11";
  constant PACKET_BYTES : std_logic_vector(15 downto 0) := x"0024";
  constant SIZE_BYTES   : std_logic_vector(15 downto 0) := x"0010";

  -- A frame of the system: the id, the length, the payload.
  constant LENGTH_BYTES  : natural := 4;
  constant PAYLOAD_BYTES : natural := 8;
  constant HEAD_BYTES    : natural := 1+LENGTH_BYTES;
  constant FRAME_BYTES   : natural := HEAD_BYTES+PAYLOAD_BYTES;

  subtype byte_t is std_logic_vector(7 downto 0);
  subtype place_t is unsigned(5 downto 0);
  type memory_t is array (natural range 0 to 63) of byte_t;
  type state_t is (LISTENING, ASKING, WAITING, REPLYING);

  signal memory  : memory_t;
  signal state_r : state_t;

  -- ------------------------------------------------------------------ the frame that comes
  signal place_r  : place_t;  -- stays at END_PLACE
  signal recent_r : std_logic_vector(39 downto 0) := (others => '0');
  signal meant_r  : std_logic;  -- it is a request, so far

  -- ------------------------------------------------------------------ the frame to the system, its answer, the reply
  signal step_r       : place_t;
  signal writes       : std_logic;
  signal write_place  : place_t;
  signal write_data   : byte_t;
  signal step_place   : place_t;
  signal step_shift   : place_t;
  signal read_data    : byte_t;

  -- A number of places, forwards or back, modulo 64.
  function shift(places : integer) return place_t is
  begin
    return to_unsigned(places mod 64, place_t'length);
  end function shift;

  -- From the place of a byte of the reply to its place in the request.
  function way_back(place : place_t) return place_t is
  begin
    if place < MAC_BYTES then
      return shift(MAC_BYTES);
    elsif place < 2*MAC_BYTES then
      return shift(-MAC_BYTES);
    elsif place < SOURCE_PLACE then
      return shift(0);
    elsif place < TARGET_PLACE then
      return shift(TARGET_PLACE-SOURCE_PLACE);
    elsif place < PORTS_PLACE then
      return shift(SOURCE_PLACE-TARGET_PLACE);
    elsif place < PORT_PLACE then
      return shift(PORT_PLACE-PORTS_PLACE);
    elsif place < SIZE_PLACE then
      return shift(PORTS_PLACE-PORT_PLACE);
    end if;
    return shift(0);
  end function way_back;

begin

  -- ------------------------------------------------------------------ the request

  match : process (clk)
    variable recent : std_logic_vector(47 downto 0);
  begin
    if rising_edge(clk) then
      if s_axis_tvalid = '1' then
        recent   := recent_r & s_axis_tdata;
        recent_r <= recent(39 downto 0);
        if place_r = 0 then
          meant_r <= '0';
          if state_r = LISTENING then
            meant_r <= '1';
          end if;
        -- A multicast address is not a valid source address.
        elsif (place_r = MAC_BYTES-1 and recent /= mac)
              or (place_r = MAC_BYTES and s_axis_tdata(0) = '1')
              or (place_r = TYPE_PLACE+1 and recent(15 downto 0) /= TYPE_IPV4)
              or (place_r = VERSION_PLACE and s_axis_tdata /= VERSION)
              or (place_r = LENGTH_PLACE+1 and recent(15 downto 0) /= PACKET_BYTES)
              or (place_r = FRAGMENT_PLACE+1 and unsigned(recent(13 downto 0)) /= 0)
              or (place_r = PROTOCOL_PLACE and s_axis_tdata /= UDP)
              or (place_r = TARGET_PLACE+3 and recent(31 downto 0) /= address)
              or (place_r = PORT_PLACE+1 and recent(15 downto 0) /= PORT_NUMBER)
              or (place_r = SIZE_PLACE+1 and recent(15 downto 0) /= SIZE_BYTES) then
          meant_r <= '0';
        end if;
        if s_axis_tlast = '1' then
          place_r <= (others => '0');
        elsif place_r /= END_PLACE then
          place_r <= place_r + 1;
        end if;
      end if;
      if rst_n = '0' then
        place_r <= (others => '0');
        meant_r <= '0';
      end if;
    end if;
  end process match;

  -- ------------------------------------------------------------------ the way of a request

  proceed : process (clk)
  begin
    if rising_edge(clk) then
      if state_r = LISTENING then
        step_r <= (others => '0');
        -- The shortest frame has more bytes than are checked.
        if s_axis_tvalid = '1' and s_axis_tlast = '1' and s_axis_tuser(0) = '0' and meant_r = '1'
           and place_r = END_PLACE then
          state_r <= ASKING;
        end if;
      elsif state_r = ASKING and request_tready = '1' then
        step_r <= step_r + 1;
        if step_r = FRAME_BYTES-1 then
          step_r  <= (others => '0');
          state_r <= WAITING;
        end if;
      elsif state_r = WAITING and answer_tvalid = '1' then
        step_r <= step_r + 1;
        if answer_tlast = '1' then
          step_r  <= (others => '0');
          state_r <= REPLYING;
        end if;
      elsif state_r = REPLYING and m_axis_tready = '1' then
        step_r <= step_r + 1;
        if step_r = END_PLACE-1 then
          state_r <= LISTENING;
        end if;
      end if;
      if rst_n = '0' then
        state_r <= LISTENING;
      end if;
    end if;
  end process proceed;

  -- The request, then the payload of the answer in its place.
  writes      <= s_axis_tvalid when state_r = LISTENING else answer_tvalid;
  write_place <= place_r when state_r = LISTENING else step_place;
  write_data  <= s_axis_tdata when state_r = LISTENING else answer_tdata;
  step_place  <= step_r + step_shift;
  step_shift  <= way_back(step_r) when state_r = REPLYING else shift(PAYLOAD_PLACE-HEAD_BYTES);
  read_data   <= memory(to_integer(step_place));

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if writes = '1' and write_place < END_PLACE
         and (state_r = LISTENING or (state_r = WAITING and step_r >= HEAD_BYTES)) then
        memory(to_integer(write_place)) <= write_data;
      end if;
    end if;
  end process access_memory;

  request_tvalid <= '1' when state_r = ASKING else '0';
  request_tlast  <= '1' when step_r = FRAME_BYTES-1 else '0';
  request_tdata  <= STATUS_ID when step_r = 0 else
                    std_logic_vector(to_unsigned(PAYLOAD_BYTES, 8)) when step_r = 1 else
                    x"00" when step_r < HEAD_BYTES else
                    read_data;

  m_axis_tvalid <= '1' when state_r = REPLYING else '0';
  m_axis_tlast  <= '1' when step_r = END_PLACE-1 else '0';
  m_axis_tdata  <= x"00" when step_r = CHECKSUM_PLACE or step_r = CHECKSUM_PLACE+1 else
                   read_data;

end architecture rtl;
