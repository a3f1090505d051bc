-- SPDX-License-Identifier: Apache-2.0
-- Decodes consistent overhead byte stuffing (COBS; S. Cheshire and M. Baker, 1999): a zero byte ends each frame, and
-- occurs nowhere else, so a receiver finds the next frame after any fault. A byte in, at most one byte out; nothing
-- stalls. Rows without a byte between two zeros are ignored.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_cobs_decoder is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Pulses, at most one of them in a cycle.
    coded_data  : in std_logic_vector(7 downto 0);
    coded_valid : in std_logic;
    coded_lost  : in std_logic;  -- bytes were lost
    coded_cut   : in std_logic;  -- the next byte begins a frame

    data  : out std_logic_vector(7 downto 0);
    valid : out std_logic;
    -- A pulse after the last byte of each frame, with its faults.
    ends     : out std_logic;
    is_wrong : out std_logic;  -- the bytes are not valid COBS
    is_lost  : out std_logic  -- bytes were lost
  );
end entity firm_cobs_decoder;

architecture rtl of firm_cobs_decoder is

  subtype byte_t is std_logic_vector(7 downto 0);
  constant ZERO       : byte_t := x"00";
  constant FULL_BLOCK : byte_t := x"ff";

  signal begun_r : std_logic;  -- a frame has begun
  signal lost_r  : std_logic;  -- and has lost bytes
  signal left_r  : unsigned(7 downto 0);  -- remaining bytes of the block; at zero, the code of the next one follows
  signal due_r   : std_logic;             -- a zero is between this block and the next one

begin

  decode : process (clk)

    procedure end_frame is
    begin
      ends     <= begun_r;
      is_wrong <= '0';
      if left_r /= 0 then
        is_wrong <= '1';
      end if;
      is_lost <= lost_r or coded_cut;
      begun_r <= '0';
      lost_r  <= '0';
      left_r  <= (others => '0');
      due_r   <= '0';
    end procedure end_frame;

    procedure take_byte is
    begin
      begun_r <= '1';
      if left_r = 0 then
        left_r <= unsigned(coded_data) - 1;
        data   <= ZERO;
        valid  <= due_r;
        due_r  <= '1';
        if coded_data = FULL_BLOCK then
          due_r <= '0';
        end if;
      else
        left_r <= left_r - 1;
        data   <= coded_data;
        valid  <= '1';
      end if;
    end procedure take_byte;

  begin
    if rising_edge(clk) then
      valid <= '0';
      ends  <= '0';
      if coded_cut = '1' or (coded_valid = '1' and coded_data = ZERO) then
        end_frame;
      elsif coded_lost = '1' then
        begun_r <= '1';
        lost_r  <= '1';
      elsif coded_valid = '1' then
        take_byte;
      end if;
      if rst_n = '0' then
        valid   <= '0';
        ends    <= '0';
        begun_r <= '0';
        lost_r  <= '0';
        left_r  <= (others => '0');
        due_r   <= '0';
      end if;
    end if;
  end process decode;

end architecture rtl;
