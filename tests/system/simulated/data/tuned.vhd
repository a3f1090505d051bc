-- SPDX-License-Identifier: Apache-2.0
-- Answers a number with gain * number + offset, or its complement, after 100 cycles in which it holds the message. If a
-- parameter changes while it holds a message, the answer is -1.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity tuned is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    in_data          : in  std_logic_vector(31 downto 0);
    in_segment_valid : in  std_logic_vector(0 downto 0);
    in_msg_valid     : in  std_logic;
    in_msg_ready     : out std_logic;

    out_data          : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic;

    gain   : in std_logic_vector(7 downto 0);
    offset : in std_logic_vector(31 downto 0);
    invert : in std_logic
  );
end entity tuned;

architecture rtl of tuned is

  constant HOLD : natural := 100;

  signal held_r    : natural range 0 to HOLD;
  signal gain_r    : std_logic_vector(7 downto 0);
  signal offset_r  : std_logic_vector(31 downto 0);
  signal invert_r  : std_logic;
  signal is_same_r : std_logic;
  signal answer_r  : std_logic_vector(31 downto 0);
  signal is_done   : std_logic;
  signal sends_r   : std_logic;

begin

  is_done <= '1' when held_r = HOLD and sends_r = '0' else '0';

  count : process (clk)
    variable sum : signed(39 downto 0);
  begin
    if rising_edge(clk) then
      if in_msg_valid = '0' or is_done = '1' then
        held_r    <= 0;
        is_same_r <= '1';
      elsif held_r /= HOLD then
        held_r <= held_r + 1;
        if held_r = 0 then
          gain_r   <= gain;
          offset_r <= offset;
          invert_r <= invert;
        elsif gain /= gain_r or offset /= offset_r or invert /= invert_r then
          is_same_r <= '0';
        end if;
      end if;
      if out_msg_ready = '1' then
        sends_r <= '0';
      end if;
      if is_done = '1' then
        sends_r <= '1';
        sum     := signed(in_data) * signed(gain_r);
        sum     := sum + signed(offset_r);
        answer_r <= std_logic_vector(sum(31 downto 0));
        if invert_r = '1' then
          answer_r <= not std_logic_vector(sum(31 downto 0));
        end if;
        if is_same_r = '0' then
          answer_r <= (others => '1');
        end if;
      end if;
      if rst_n = '0' then
        held_r  <= 0;
        sends_r <= '0';
      end if;
    end if;
  end process count;

  in_msg_ready      <= is_done;
  out_data          <= answer_r;
  out_segment_valid <= (0 => sends_r);

end architecture rtl;
