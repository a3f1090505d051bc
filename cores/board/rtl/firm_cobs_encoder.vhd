-- SPDX-License-Identifier: Apache-2.0
-- Encodes frames with consistent overhead byte stuffing (COBS) and ends each with a zero byte. A code precedes the
-- bytes that it counts, so they wait in a ring: a place is reserved for the code, which is written when the block ends.
-- Bytes leave when their block has ended.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_cobs_encoder is
  generic (
    DEPTH : integer := 512  -- bytes of the ring, a power of two
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    data  : in  std_logic_vector(7 downto 0);
    last  : in  std_logic;
    valid : in  std_logic;
    ready : out std_logic;

    coded_data  : out std_logic_vector(7 downto 0);
    coded_valid : out std_logic;
    coded_ready : in  std_logic;
    waiting     : out natural range 0 to DEPTH  -- bytes that can leave
  );
end entity firm_cobs_encoder;

architecture rtl of firm_cobs_encoder is

  constant PLACE_BITS : positive := clog2(max(DEPTH, 2));

  subtype byte_t is std_logic_vector(7 downto 0);
  subtype place_t is unsigned(PLACE_BITS-1 downto 0);
  constant ZERO : byte_t   := x"00";
  -- The code of a block of the maximum length, which no zero follows.
  constant FULL : positive := 255;

  type memory_t is array (natural range 0 to 2**PLACE_BITS-1) of byte_t;
  signal memory : memory_t;

  type state_t is (TAKING, CLOSING, ENDING, DELIMITING);
  signal state_r : state_t;

  -- Known in simulation before the first reset, for numeric_std would warn.
  signal code_place_r : place_t := (others => '0');  -- kept for the block's code; all bytes before it can leave
  signal write_r      : place_t := (others => '0');  -- of the block's next byte
  signal read_r       : place_t := (others => '0');

  signal size     : place_t := (others => '0');  -- of the block with its code: the value of the code
  signal has_room : std_logic;
  signal take     : std_logic;
  signal seal     : std_logic;  -- the code is written, and the next block begins
  signal step     : std_logic;

  signal place : place_t;
  signal byte  : byte_t;

  signal filled  : std_logic;
  signal fetch   : std_logic;
  signal coded_r : byte_t;
  signal valid_r : std_logic;

  -- Bytes that can leave lie between the read place and that of the next code; writes are beyond.
  attribute syn_ramstyle of memory      : signal is "no_rw_check";
  attribute rw_addr_collision of memory : signal is "no";

begin

  assert DEPTH >= 512 and DEPTH <= 32768 and 2**PLACE_BITS = DEPTH
    report "firm_cobs_encoder: DEPTH is " & integer'image(DEPTH) & "; legal: a power of two from 512 to 32768"
    severity failure;

  size     <= write_r - code_place_r;
  has_room <= '0' when write_r + 1 = read_r else '1';
  take     <= '1' when valid = '1' and state_r = TAKING and has_room = '1' else '0';
  seal     <= '1' when state_r /= TAKING or data = ZERO else '0';
  step     <= '1' when take = '1' or (state_r /= TAKING and has_room = '1') else '0';

  place <= code_place_r when seal = '1' else write_r;
  byte  <= ZERO when state_r = DELIMITING else
           std_logic_vector(size(7 downto 0)) when seal = '1' else
           data;

  filled <= '0' when read_r = code_place_r else '1';
  fetch  <= filled and (coded_ready or not valid_r);

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if step = '1' then
        memory(to_integer(place)) <= byte;
      end if;
      if fetch = '1' then
        coded_r <= memory(to_integer(read_r));
      end if;
    end if;
  end process access_memory;

  encode : process (clk)
  begin
    if rising_edge(clk) then
      if step = '1' then
        write_r <= write_r + 1;
        if seal = '1' then
          code_place_r <= write_r;
        end if;
        if take = '1' and last = '1' then
          state_r <= ENDING;
        elsif take = '1' and seal = '0' and size = FULL-1 then
          state_r <= CLOSING;
        elsif state_r = ENDING then
          state_r <= DELIMITING;
        else
          state_r <= TAKING;
        end if;
      end if;
      if fetch = '1' then
        read_r <= read_r + 1;
      end if;
      valid_r <= fetch or (valid_r and not coded_ready);
      if rst_n = '0' then
        state_r      <= TAKING;
        code_place_r <= to_unsigned(0, PLACE_BITS);
        write_r      <= to_unsigned(1, PLACE_BITS);
        read_r       <= to_unsigned(0, PLACE_BITS);
        valid_r      <= '0';
      end if;
    end if;
  end process encode;

  ready       <= '1' when state_r = TAKING and has_room = '1' else '0';
  coded_data  <= coded_r;
  coded_valid <= valid_r;
  waiting     <= to_integer(place_t'(code_place_r - read_r)) + 1 when valid_r = '1' else
                 to_integer(place_t'(code_place_r - read_r));

end architecture rtl;
