-- SPDX-License-Identifier: Apache-2.0
-- Finds the ends of frames in a byte stream from their announced lengths. The input consists of bytes and cuts. A cut
-- ends an incomplete frame, so that its converter reports it as broken; between frames it has no effect. A byte that is
-- not the last of its frame is held until the next item tells whether a cut follows.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_link_framer is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    item_data  : in  std_logic_vector(7 downto 0);
    item_cut   : in  std_logic;  -- the item is a cut, not a byte
    item_valid : in  std_logic;
    item_ready : out std_logic;

    data  : out std_logic_vector(7 downto 0);
    last  : out std_logic;
    valid : out std_logic;
    ready : in  std_logic
  );
end entity firm_link_framer;

architecture rtl of firm_link_framer is

  constant LENGTH_BYTES : positive := 4;

  -- The position of the next byte in the frame: the id, the bytes of the length, then any byte of the payload.
  subtype place_t is natural range 0 to LENGTH_BYTES+1;
  constant ID_PLACE    : place_t := 0;
  constant LAST_LENGTH : place_t := LENGTH_BYTES;
  constant PAYLOAD     : place_t := LENGTH_BYTES + 1;

  signal place_r     : place_t;
  signal remaining_r : unsigned(8*LENGTH_BYTES-1 downto 0);  -- bytes of the payload still to come
  signal remaining   : unsigned(8*LENGTH_BYTES-1 downto 0);  -- the same after the item, if it is a byte
  signal is_last     : std_logic;                            -- the item is the last byte of its frame

  signal data_r : std_logic_vector(7 downto 0);
  signal held_r : std_logic;  -- data_r holds a byte
  signal last_r : std_logic;  -- and it is the last of its frame

  signal item_ready_out : std_logic;

begin

  remaining <= remaining_r - 1 when place_r = PAYLOAD else
               unsigned(item_data) & remaining_r(remaining_r'high downto 8);
  is_last   <= '1' when place_r >= LAST_LENGTH and remaining = 0 else '0';

  item_ready_out <= ready or not held_r;

  frame : process (clk)
  begin
    if rising_edge(clk) then
      if item_ready_out = '1' then
        held_r <= item_valid and not item_cut;
        -- Without an item, only a last byte was there to be taken.
        if held_r = '1' and last_r = '0' and item_valid = '0' then
          held_r <= '1';
        end if;
      end if;
      if item_ready_out = '1' and item_valid = '1' then
        data_r      <= item_data;
        last_r      <= is_last;
        remaining_r <= remaining;
        if item_cut = '1' or is_last = '1' then
          place_r <= ID_PLACE;
        elsif place_r /= PAYLOAD then
          place_r <= place_r + 1;
        end if;
      end if;
      if rst_n = '0' then
        place_r <= ID_PLACE;
        held_r  <= '0';
      end if;
    end if;
  end process frame;

  item_ready <= item_ready_out;
  data       <= data_r;
  valid      <= held_r and (last_r or item_valid);
  last       <= last_r or item_cut;

end architecture rtl;
