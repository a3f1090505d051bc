-- SPDX-License-Identifier: Apache-2.0
-- A table of keys: compares its entries with a key that arrives byte by byte. A key has a head, which is compared once,
-- and a tail, which may be compared again with another value.
--
-- An entry that is written while a key arrives does not match that key.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_net_keys is
  generic (
    ENTRIES   : integer := 8;  -- 1 to 64
    KEY_BYTES : integer := 16; -- 2 to 16
    TAIL      : integer := 12  -- the place of the tail, 1 to KEY_BYTES-1
  );
  port (
    clk : in std_logic;

    -- A byte of a key. The bytes arrive in order; those of another tail follow without the head.
    s_valid : in std_logic;
    s_place : in std_logic_vector(3 downto 0);
    s_data  : in std_logic_vector(7 downto 0);

    used    : in  std_logic_vector(ENTRIES-1 downto 0);  -- the entries that may match
    matches : out std_logic_vector(ENTRIES-1 downto 0);  -- from two cycles after the last byte on

    -- Writes a byte of the key of these entries.
    writes      : in std_logic_vector(ENTRIES-1 downto 0);
    write_place : in std_logic_vector(3 downto 0);
    write_data  : in std_logic_vector(7 downto 0)
  );
end entity firm_net_keys;

architecture rtl of firm_net_keys is

  constant MOST_ENTRIES : positive := 64;
  constant MOST_BYTES   : positive := 16;

  subtype mask_t is std_logic_vector(ENTRIES-1 downto 0);
  type memory_t is array (natural range 0 to MOST_BYTES-1) of std_logic_vector(7 downto 0);

  signal valid_r : std_logic;
  signal place_r : unsigned(3 downto 0) := (others => '0');
  signal data_r  : std_logic_vector(7 downto 0);
  signal equal   : mask_t;
  signal heads_r : mask_t;  -- entries with equal heads so far
  signal tails_r : mask_t;  -- and those with equal tails so far

begin

  assert ENTRIES >= 1 and ENTRIES <= MOST_ENTRIES
    report "firm_net_keys: ENTRIES is " & integer'image(ENTRIES) & "; legal: 1 to " & integer'image(MOST_ENTRIES)
    severity failure;
  assert KEY_BYTES >= 2 and KEY_BYTES <= MOST_BYTES
    report "firm_net_keys: KEY_BYTES is " & integer'image(KEY_BYTES) & "; legal: 2 to " & integer'image(MOST_BYTES)
    severity failure;
  assert TAIL >= 1 and TAIL < KEY_BYTES
    report "firm_net_keys: TAIL is " & integer'image(TAIL) & "; legal: 1 to " & integer'image(KEY_BYTES-1)
    severity failure;

  all_entries : for entry in 0 to ENTRIES-1 generate

    signal memory : memory_t;
    signal key_r  : std_logic_vector(7 downto 0);

  begin

    access_key : process (clk)
    begin
      if rising_edge(clk) then
        if s_valid = '1' then
          key_r <= memory(to_integer(unsigned(s_place)));
        end if;
        if writes(entry) = '1' then
          memory(to_integer(unsigned(write_place))) <= write_data;
        end if;
      end if;
    end process access_key;

    equal(entry) <= '1' when key_r = data_r else '0';

  end generate all_entries;

  compare : process (clk)
  begin
    if rising_edge(clk) then
      valid_r <= s_valid;
      place_r <= unsigned(s_place);
      data_r  <= s_data;
      if valid_r = '1' then
        if place_r < TAIL then
          heads_r <= heads_r and equal;
          if place_r = 0 then
            heads_r <= used and equal;
          end if;
        else
          tails_r <= tails_r and equal;
          if place_r = TAIL then
            tails_r <= heads_r and equal;
          end if;
        end if;
      end if;
      for entry in writes'range loop
        if writes(entry) = '1' then
          heads_r(entry) <= '0';
          tails_r(entry) <= '0';
        end if;
      end loop;
    end if;
  end process compare;

  matches <= tails_r and used;

end architecture rtl;
