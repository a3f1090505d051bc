-- SPDX-License-Identifier: Apache-2.0
-- The accelerators of a pipeline: a source of numbers, stages that each hold one message, and a sink that counts and
-- sends every 256th message on.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity source is
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;
    out_data          : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity source;

architecture rtl of source is

  signal number_r : unsigned(31 downto 0) := (others => '0');

begin

  out_data          <= std_logic_vector(number_r);
  out_segment_valid <= "1";

  count : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        number_r <= (others => '0');
      elsif out_msg_ready = '1' then
        number_r <= number_r + 1;
      end if;
    end if;
  end process count;

end architecture rtl;

library ieee;
use ieee.std_logic_1164.all;

entity stage is
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;
    in_data           : in  std_logic_vector(31 downto 0);
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;
    out_data          : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity stage;

architecture rtl of stage is

  signal valid_r : std_logic := '0';

begin

  out_segment_valid(0) <= valid_r;
  in_msg_ready         <= not valid_r;

  hold : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        valid_r <= '0';
      elsif valid_r = '0' then
        valid_r  <= in_msg_valid;
        out_data <= in_data;
      elsif out_msg_ready = '1' then
        valid_r <= '0';
      end if;
    end if;
  end process hold;

end architecture rtl;

library ieee;
use ieee.std_logic_1164.all;

entity sink is
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;
    in_data           : in  std_logic_vector(31 downto 0);
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;
    out_data          : out std_logic_vector(31 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity sink;

architecture rtl of sink is

  signal is_sent : std_logic;

begin

  is_sent              <= '1' when in_data(7 downto 0) = x"ff" else '0';
  out_data             <= in_data;
  out_segment_valid(0) <= in_msg_valid and is_sent;
  in_msg_ready         <= out_msg_ready or not is_sent;

end architecture rtl;
