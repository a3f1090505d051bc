-- SPDX-License-Identifier: Apache-2.0
-- A number to a text of so many letters, from a to z and again. The number modulo 8 tells what is wrong: 4 has no
-- response, 5 has one that pauses in its middle, 6 has one that ends early, and 7 one that goes on.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity mischief is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk                  : in  std_logic;
    rst_n                : in  std_logic;
    in_data              : in  std_logic_vector(15 downto 0);
    in_segment_valid     : in  std_logic_vector(0 downto 0);
    in_msg_valid         : in  std_logic;
    in_msg_ready         : out std_logic;
    out_data_length      : out std_logic_vector(31 downto 0);
    out_data_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    out_data_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    out_data_axis_tvalid : out std_logic;
    out_data_axis_tlast  : out std_logic;
    out_data_axis_tready : in  std_logic;
    out_segment_valid    : out std_logic_vector(0 downto 0);
    out_msg_valid        : out std_logic;
    out_msg_ready        : in  std_logic
  );
end entity mischief;

architecture rtl of mischief is

  constant LANES : positive := WIDTH/8;
  constant PAUSE : positive := 1500;

  signal total     : unsigned(15 downto 0);
  signal limit     : unsigned(16 downto 0);  -- letters that are sent
  signal sent_r    : unsigned(16 downto 0) := (others => '0');
  signal paused_r  : natural range 0 to PAUSE := 0;
  signal letter_r  : natural range 0 to 25 := 0;
  signal is_silent : std_logic;
  signal is_held   : std_logic;
  signal offers    : std_logic;
  signal has_more  : std_logic;

begin

  total     <= unsigned(in_data);
  is_silent <= '1' when total(2 downto 0) = 4 else '0';
  limit     <= "00" & total(15 downto 1) when total(2 downto 0) = 6 else
               total & '0' when total(2 downto 0) = 7 else
               '0' & total;
  is_held   <= '1' when total(2 downto 0) = 5 and sent_r >= total(15 downto 1) and paused_r < PAUSE else '0';
  offers    <= in_msg_valid and not (is_held or is_silent);
  has_more  <= '1' when sent_r < limit else '0';

  out_data_length      <= x"0000" & in_data;
  out_segment_valid(0) <= in_msg_valid and not is_silent;
  out_data_axis_tvalid <= offers and has_more;
  out_data_axis_tlast  <= '1' when sent_r + LANES >= limit else '0';
  out_msg_valid        <= offers and not has_more;
  in_msg_ready         <= out_msg_ready or (in_msg_valid and is_silent);

  write_letters : process (sent_r, letter_r, limit)
    variable letter : natural range 0 to 25 + LANES;
  begin
    for lane in 0 to LANES-1 loop
      letter := (letter_r + lane mod 26) mod 26;
      out_data_axis_tdata(8*lane+7 downto 8*lane) <= std_logic_vector(to_unsigned(character'pos('a') + letter, 8));
      out_data_axis_tkeep(lane) <= '0';
      if sent_r + lane < limit then
        out_data_axis_tkeep(lane) <= '1';
      end if;
    end loop;
  end process write_letters;

  count_letters : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' or out_msg_ready = '1' then
        sent_r   <= (others => '0');
        letter_r <= 0;
        paused_r <= 0;
      elsif in_msg_valid = '1' and is_held = '1' then
        paused_r <= paused_r + 1;
      elsif offers = '1' and has_more = '1' and out_data_axis_tready = '1' then
        sent_r   <= sent_r + LANES;
        letter_r <= (letter_r + LANES mod 26) mod 26;
      end if;
    end if;
  end process count_letters;

end architecture rtl;
