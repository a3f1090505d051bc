-- SPDX-License-Identifier: Apache-2.0
-- Writes the fields of a submessage to the record, and from a payload of discovery the locators of the peer or its
-- endpoint (the first of each kind for UDP over IPv4), and the lease.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_locators is
  port (
    clk : in std_logic;

    -- Words of firm_rtps_inbox, each of them once, and the parameters in them.
    s_valid   : in std_logic;
    has_field : in std_logic;
    address   : in std_logic_vector(RECORD_BITS-1 downto 0);
    data      : in std_logic_vector(7 downto 0);
    begins    : in std_logic;
    is_value  : in std_logic;
    id        : in std_logic_vector(15 downto 0);
    size      : in std_logic_vector(15 downto 0);
    place     : in std_logic_vector(15 downto 0);
    is_little : in std_logic;
    is_last   : in std_logic;

    record_valid   : out std_logic;  -- one cycle later
    record_address : out std_logic_vector(RECORD_BITS-1 downto 0);
    record_data    : out std_logic_vector(7 downto 0);

    -- The contents of the payload.
    has_metatraffic : out std_logic;
    has_default     : out std_logic;
    has_unicast     : out std_logic;
    has_lease       : out std_logic
  );
end entity firm_rtps_locators;

architecture rtl of firm_rtps_locators is

  constant LOCATOR_BYTES : natural := 24;

  signal at               : unsigned(15 downto 0);  -- the place in a parameter
  signal word             : unsigned(13 downto 0);  -- of four bytes in it
  signal comes            : std_logic;
  signal of_metatraffic_r : std_logic;
  signal of_default_r     : std_logic;
  signal of_unicast_r     : std_logic;
  signal of_lease_r       : std_logic;
  signal udp_r            : std_logic;              -- the locator is one for UDP over IPv4, so far
  signal metatraffic_r    : std_logic := '0';
  signal default_r        : std_logic := '0';
  signal unicast_r        : std_logic := '0';
  signal lease_r          : std_logic := '0';
  signal is_metatraffic   : std_logic;
  signal is_default       : std_logic;
  signal is_unicast       : std_logic;
  signal is_lease         : std_logic;

begin

  at    <= unsigned(place);
  word  <= unsigned(place(15 downto 2));
  comes <= s_valid and is_value;

  -- Id and size are valid before the first byte of the value.
  note_parameter : process (clk)
  begin
    if rising_edge(clk) then
      of_metatraffic_r <= '0';
      of_default_r     <= '0';
      of_unicast_r     <= '0';
      of_lease_r       <= '0';
      if unsigned(size) = LOCATOR_BYTES then
        if id = RTPS_METATRAFFIC_UNICAST_LOCATOR then
          of_metatraffic_r <= '1';
        elsif id = RTPS_DEFAULT_UNICAST_LOCATOR then
          of_default_r <= '1';
        elsif id = RTPS_UNICAST_LOCATOR then
          of_unicast_r <= '1';
        end if;
      end if;
      if id = RTPS_LEASE_DURATION and unsigned(size(15 downto 3)) /= 0 then
        of_lease_r <= '1';
      end if;
    end if;
  end process note_parameter;

  is_metatraffic <= of_metatraffic_r and not metatraffic_r;
  is_default     <= of_default_r and not default_r;
  is_unicast     <= of_unicast_r and not unicast_r;
  is_lease       <= of_lease_r and not lease_r;

  note : process (clk)
    variable expected : std_logic_vector(7 downto 0);
  begin
    if rising_edge(clk) then
      if comes = '1' then
        -- The kind of a locator for UDP over IPv4 is 1; its port has the two higher bytes 0.
        expected := x"00";
        if (at = 0 and is_little = '1') or (at = 3 and is_little = '0') then
          expected := x"01";
        end if;
        if word = 0 then
          udp_r <= '0';
          if data = expected and (at = 0 or udp_r = '1') then
            udp_r <= '1';
          end if;
        elsif word = 1 and at(1) = is_little and data /= x"00" then
          udp_r <= '0';
        end if;
        if is_last = '1' then
          metatraffic_r <= metatraffic_r or (is_metatraffic and udp_r);
          default_r     <= default_r or (is_default and udp_r);
          unicast_r     <= unicast_r or (is_unicast and udp_r);
          lease_r       <= lease_r or is_lease;
        end if;
      end if;
      if begins = '1' then
        metatraffic_r <= '0';
        default_r     <= '0';
        unicast_r     <= '0';
        lease_r       <= '0';
      end if;
    end if;
  end process note;

  -- Ports are high byte first in the record, as on the line, and the lease is little-endian.
  write_record : process (clk)
    variable ip_place    : natural range 0 to 2**RECORD_BITS-1;
    variable port_place  : natural range 0 to 2**RECORD_BITS-1;
    variable is_locator  : std_logic;
    variable lease_place : unsigned(1 downto 0);
  begin
    if rising_edge(clk) then
      ip_place   := RECORD_METATRAFFIC_IP;
      port_place := RECORD_METATRAFFIC_PORT;
      if is_default = '1' then
        ip_place   := RECORD_DEFAULT_IP;
        port_place := RECORD_DEFAULT_PORT;
      elsif is_unicast = '1' then
        ip_place   := RECORD_UNICAST_IP;
        port_place := RECORD_UNICAST_PORT;
      end if;
      is_locator  := is_metatraffic or is_default or is_unicast;
      lease_place := at(1 downto 0);
      if is_little = '0' then
        lease_place := not at(1 downto 0);
      end if;
      record_valid   <= '0';
      record_address <= address;
      record_data    <= data;
      if has_field = '1' then
        record_valid <= s_valid;
      elsif is_lease = '1' and word = 0 then
        record_valid   <= comes;
        record_address <= std_logic_vector(to_unsigned(RECORD_LEASE, RECORD_BITS) + lease_place);
      elsif is_locator = '1' and udp_r = '1' and word = 5 then
        record_valid   <= comes;
        record_address <= std_logic_vector(to_unsigned(ip_place, RECORD_BITS) + at(1 downto 0));
      elsif is_locator = '1' and udp_r = '1' and word = 1 and at(1) /= is_little then
        record_valid   <= comes;
        record_address <= std_logic_vector(to_unsigned(port_place, RECORD_BITS));
        if at(0) /= is_little then
          record_address <= std_logic_vector(to_unsigned(port_place+1, RECORD_BITS));
        end if;
      end if;
    end if;
  end process write_record;

  has_metatraffic <= metatraffic_r;
  has_default     <= default_r;
  has_unicast     <= unicast_r;
  has_lease       <= lease_r;

end architecture rtl;
