-- SPDX-License-Identifier: Apache-2.0
-- A number to a text of so many letters, from a to z and again. The response to a number that is 7 modulo 8 is faulty.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity falter is
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
end entity falter;

architecture rtl of falter is

  constant LANES : positive := WIDTH/8;

  -- none, pauses, stops, ends early, goes on, is silent
  constant FAULT : string   := "none";
  constant PAUSE : positive := 300;

  signal sent_r   : natural range 0 to 2**16+64 := 0;
  signal paused_r : natural range 0 to PAUSE := 0;
  signal total    : natural range 0 to 2**16-1;
  signal limit    : natural range 0 to 2**17-1;  -- letters that are sent
  signal is_sick  : boolean;
  signal is_held  : boolean;
  signal offers   : std_logic;

begin

  total   <= to_integer(unsigned(in_data)) when in_msg_valid = '1' else 0;
  is_sick <= in_msg_valid = '1' and total mod 8 = 7;
  limit   <= total / 2 when is_sick and FAULT = "ends early" else
             2 * total when is_sick and FAULT = "goes on" else
             total;
  is_held <= is_sick and 2 * sent_r >= total and (FAULT = "stops" or (FAULT = "pauses" and paused_r < PAUSE));
  offers  <= '0' when is_held or (is_sick and FAULT = "is silent") else in_msg_valid;

  out_data_length      <= std_logic_vector(to_unsigned(total, 32));
  out_segment_valid(0) <= '0' when is_sick and FAULT = "is silent" else in_msg_valid;
  out_data_axis_tvalid <= offers when sent_r < limit else '0';
  out_data_axis_tlast  <= '1' when sent_r + LANES >= limit else '0';
  out_msg_valid        <= offers when sent_r >= limit else '0';
  in_msg_ready         <= out_msg_ready;

  write_letters : process (sent_r, limit)
  begin
    for lane in 0 to LANES-1 loop
      out_data_axis_tdata(8*lane+7 downto 8*lane) <=
        std_logic_vector(to_unsigned(character'pos('a') + (sent_r + lane) mod 26, 8));
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
        sent_r   <= 0;
        paused_r <= 0;
      elsif is_held and paused_r < PAUSE then
        paused_r <= paused_r + 1;
      elsif offers = '1' and sent_r < limit and out_data_axis_tready = '1' then
        sent_r <= sent_r + LANES;
      end if;
    end if;
  end process count_letters;

end architecture rtl;
