-- SPDX-License-Identifier: Apache-2.0
-- Finds the parameters in a payload that is a list of them, as those of discovery are (OMG DDSI-RTPS 2.5, section
-- 9.4.2.11): determines for each byte whether it belongs to a value, and of which parameter. A list ends with its
-- sentinel; a list with another encoding has no parameters.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_parameters is
  port (
    clk : in std_logic;

    -- A pulse before the first byte of a payload, then its bytes.
    begins  : in std_logic;
    s_valid : in std_logic;
    s_data  : in std_logic_vector(7 downto 0);

    -- Of the previous byte, one cycle later.
    is_value  : out std_logic;
    id        : out std_logic_vector(15 downto 0);
    size      : out std_logic_vector(15 downto 0);  -- bytes of the value; it stays for two further cycles
    place     : out std_logic_vector(15 downto 0);  -- in the value, from 0
    is_little : out std_logic;                      -- the byte order of the list
    is_last   : out std_logic;                      -- the byte is the last one of the value
    is_open   : out std_logic                       -- a list has begun, and not ended
  );
end entity firm_rtps_parameters;

architecture rtl of firm_rtps_parameters is

  constant HEAD_BYTES : positive := 4;  -- of the encoding, and of a parameter

  -- The encodings are 0002 and 0003: parameter lists, big-endian and little-endian.
  signal head_r   : unsigned(2 downto 0)  := (others => '0');  -- bytes of the encoding's header so far
  signal place_r  : unsigned(16 downto 0) := (others => '0');  -- in the parameter, its header included
  signal id_r     : std_logic_vector(15 downto 0) := (others => '0');
  signal size_r   : unsigned(15 downto 0) := (others => '0');
  signal end_r    : unsigned(16 downto 0) := (others => '0');  -- the place of its last byte
  signal little_r : std_logic;
  signal over_r   : std_logic;

  signal next_id   : std_logic_vector(15 downto 0);
  signal next_size : unsigned(15 downto 0);

begin

  next_id   <= s_data & id_r(15 downto 8) when little_r = '1' else id_r(7 downto 0) & s_data;
  next_size <= unsigned(s_data) & size_r(15 downto 8) when little_r = '1' else size_r(7 downto 0) & unsigned(s_data);

  follow : process (clk)
  begin
    if rising_edge(clk) then
      if begins = '1' then
        head_r  <= (others => '0');
        place_r <= (others => '0');
        over_r  <= '0';
      elsif s_valid = '1' and over_r = '0' then
        if head_r /= HEAD_BYTES then
          head_r <= head_r + 1;
          if head_r = 1 then
            little_r <= s_data(0);
          end if;
          if (head_r = 0 and s_data /= x"00") or (head_r = 1 and s_data(7 downto 1) /= "0000001") then
            over_r <= '1';
          end if;
        else
          place_r <= place_r + 1;
          if place_r < 2 then
            id_r <= next_id;
          elsif place_r < HEAD_BYTES then
            size_r <= next_size;
            end_r  <= resize(next_size, 17) + (HEAD_BYTES-1);
            if place_r = HEAD_BYTES-1 then
              if id_r = RTPS_SENTINEL then
                over_r <= '1';
              elsif next_size = 0 then
                place_r <= (others => '0');
              end if;
            end if;
          elsif place_r = end_r then
            place_r <= (others => '0');
          end if;
        end if;
      end if;
    end if;
  end process follow;

  show : process (clk)
  begin
    if rising_edge(clk) then
      is_value <= '0';
      if s_valid = '1' and head_r = HEAD_BYTES and place_r >= HEAD_BYTES and over_r = '0' then
        is_value <= '1';
      end if;
      place   <= std_logic_vector(resize(place_r - HEAD_BYTES, 16));
      is_last <= '0';
      if place_r = end_r then
        is_last <= '1';
      end if;
    end if;
  end process show;

  -- A further parameter begins with other bytes, so these still belong to the previous byte.
  id        <= id_r;
  size      <= std_logic_vector(size_r);
  is_little <= little_r;
  is_open   <= '1' when head_r = HEAD_BYTES and over_r = '0' else '0';

end architecture rtl;
