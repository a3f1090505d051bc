-- SPDX-License-Identifier: Apache-2.0
-- The numbers of RTPS that firm_rtps_walker and its users share (OMG DDSI-RTPS 2.5, chapter 9), and the places of a
-- submessage's fields in the record that the walker writes. `make constants` writes the numbers of RTPS from
-- fusesoc_firm/fabric/rtps.py.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_rtps_pkg is

  subtype rtps_byte_t is std_logic_vector(7 downto 0);

  -- Kinds of submessages.
  constant RTPS_PAD              : rtps_byte_t := x"01";
  constant RTPS_ACKNACK          : rtps_byte_t := x"06";
  constant RTPS_HEARTBEAT        : rtps_byte_t := x"07";
  constant RTPS_GAP              : rtps_byte_t := x"08";
  constant RTPS_INFO_TIMESTAMP   : rtps_byte_t := x"09";
  constant RTPS_INFO_DESTINATION : rtps_byte_t := x"0e";
  constant RTPS_NACK_FRAG        : rtps_byte_t := x"12";
  constant RTPS_HEARTBEAT_FRAG   : rtps_byte_t := x"13";
  constant RTPS_DATA             : rtps_byte_t := x"15";
  constant RTPS_DATA_FRAG        : rtps_byte_t := x"16";

  -- Bits of a submessage's flags.
  constant RTPS_LITTLE       : natural := 0;
  constant RTPS_FINAL        : natural := 1;  -- of ACKNACK and HEARTBEAT
  constant RTPS_INLINE       : natural := 1;  -- of DATA and DATA_FRAG
  constant RTPS_PAYLOAD      : natural := 2;  -- of DATA
  constant RTPS_KEY          : natural := 3;  -- of DATA
  constant RTPS_FRAGMENT_KEY : natural := 2;  -- of DATA_FRAG

  constant RTPS_SENTINEL    : std_logic_vector(15 downto 0) := x"0001";
  constant RTPS_KEY_HASH    : std_logic_vector(15 downto 0) := x"0070";
  constant RTPS_STATUS_INFO : std_logic_vector(15 downto 0) := x"0071";

  -- The record. Numbers are little-endian, and entities and prefixes as on the line. A sequence number has 8 bytes. The
  -- first number of a set is the highest bit of its first byte.
  constant RECORD_BITS        : positive := 8;   -- of an address
  constant RECORD_READER      : natural  := 0;   -- 4 bytes
  constant RECORD_WRITER      : natural  := 4;   -- 4 bytes
  constant RECORD_NUMBER      : natural  := 8;   -- of the sample; a heartbeat's first; a set's base; a gap's start
  constant RECORD_SECOND      : natural  := 16;  -- a heartbeat's last; a gap's base
  constant RECORD_FRAGMENT    : natural  := 24;  -- 4 bytes: the last fragment; the base of a set of fragments
  constant RECORD_COUNT       : natural  := 28;  -- 4 bytes
  constant RECORD_FRAGMENTS   : natural  := 32;  -- first (4 bytes), count (2), size of each (2), size of the sample (4)
  constant RECORD_SET_SIZE    : natural  := 44;  -- 4 bytes: bits of the set
  constant RECORD_DESTINATION : natural  := 48;  -- 12 bytes
  constant RECORD_STATUS      : natural  := 60;  -- 4 bytes
  constant RECORD_SET         : natural  := 64;  -- up to 32 bytes
  constant RECORD_KEY_HASH    : natural  := 96;  -- 16 bytes
  constant RECORD_KIND        : natural  := 112; -- 1 byte
  constant RECORD_FLAGS       : natural  := 113; -- 1 byte
  -- Of the packet.
  constant RECORD_SOURCE_MAC  : natural  := 128; -- 6 bytes, as on the line
  constant RECORD_SOURCE      : natural  := 144; -- 12 bytes: the sender's prefix
  -- The contents of a payload of discovery, which firm_rtps_locators adds.
  constant RECORD_METATRAFFIC_IP   : natural := 136; -- 4 bytes
  constant RECORD_METATRAFFIC_PORT : natural := 140; -- 2 bytes
  constant RECORD_DEFAULT_PORT     : natural := 142; -- 2 bytes
  constant RECORD_DEFAULT_IP       : natural := 156; -- 4 bytes
  constant RECORD_LEASE            : natural := 160; -- 4 bytes: seconds
  constant RECORD_UNICAST_IP       : natural := 164; -- 4 bytes
  constant RECORD_UNICAST_PORT     : natural := 168; -- 2 bytes

  -- Writers of discovery.
  constant RTPS_PARTICIPANT_WRITER   : std_logic_vector(31 downto 0) := x"000100c2";
  constant RTPS_PUBLICATIONS_WRITER  : std_logic_vector(31 downto 0) := x"000003c2";
  constant RTPS_SUBSCRIPTIONS_WRITER : std_logic_vector(31 downto 0) := x"000004c2";

  -- Parameters of discovery.
  constant RTPS_LEASE_DURATION              : std_logic_vector(15 downto 0) := x"0002";
  constant RTPS_TOPIC_NAME                  : std_logic_vector(15 downto 0) := x"0005";
  constant RTPS_TYPE_NAME                   : std_logic_vector(15 downto 0) := x"0007";
  constant RTPS_RELIABILITY                 : std_logic_vector(15 downto 0) := x"001a";
  constant RTPS_DURABILITY                  : std_logic_vector(15 downto 0) := x"001d";
  constant RTPS_PARTITION                   : std_logic_vector(15 downto 0) := x"0029";
  constant RTPS_USER_DATA                   : std_logic_vector(15 downto 0) := x"002c";
  constant RTPS_UNICAST_LOCATOR             : std_logic_vector(15 downto 0) := x"002f";
  constant RTPS_DEFAULT_UNICAST_LOCATOR     : std_logic_vector(15 downto 0) := x"0031";
  constant RTPS_METATRAFFIC_UNICAST_LOCATOR : std_logic_vector(15 downto 0) := x"0032";
  constant RTPS_ENDPOINT_GUID               : std_logic_vector(15 downto 0) := x"005a";
  constant RTPS_DATA_REPRESENTATION         : std_logic_vector(15 downto 0) := x"0073";

  constant MOST_SET_BITS : positive := 256;

  -- Bytes of a sample in a packet, and in each fragment of a longer one but the last.
  constant RTPS_FRAGMENT_BYTES : positive := 1344;
  constant RTPS_SAMPLE_BITS    : positive := 17;  -- of the size of a sample

  -- Banks of the builder's fields: one for each writer with frames, and one for all other packets. These are up to
  -- nine, so their numbers have four bits; 8 to 14 are not used.
  constant RTPS_BANK_BITS : positive := 4;
  constant RTPS_OWN_BANK  : std_logic_vector(RTPS_BANK_BITS-1 downto 0) := x"f";

  constant RTPS_CONTROL_BITS : positive := 11;  -- of an address in the program of firm_rtps_sequencer

  -- Cycles from the last word of an announcement until the result of firm_rtps_endpoint is valid.
  constant RTPS_JUDGED : positive := 7;

  -- Whether an address of the record is one of `bytes` addresses from `first` on; both are multiples of four.
  function is_in(address : std_logic_vector(RECORD_BITS-1 downto 0); first, bytes : natural) return std_logic;

end package firm_rtps_pkg;

package body firm_rtps_pkg is

  -- A comparison of words becomes smaller than one of ranges, which needs adders.
  function is_in(address : std_logic_vector(RECORD_BITS-1 downto 0); first, bytes : natural) return std_logic is
    variable found : std_logic := '0';
  begin
    for word in first/4 to (first+bytes)/4-1 loop
      if unsigned(address(RECORD_BITS-1 downto 2)) = word then
        found := '1';
      end if;
    end loop;
    return found;
  end function is_in;

end package body firm_rtps_pkg;
