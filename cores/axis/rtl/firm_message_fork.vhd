-- SPDX-License-Identifier: Apache-2.0
-- Gives one message to several sinks. Each takes it in its own time; the source is released when all have it. A sink's
-- valid does not wait for another sink's ready, so none can hold up the others for longer than one message.
library ieee;
use ieee.std_logic_1164.all;

entity firm_message_fork is
  generic (
    SINKS : integer := 2);
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    source_valid : in  std_logic;
    source_ready : out std_logic;

    sink_valid : out std_logic_vector(SINKS-1 downto 0);
    sink_ready : in  std_logic_vector(SINKS-1 downto 0));
end entity firm_message_fork;

architecture rtl of firm_message_fork is

  constant ALL_SINKS : std_logic_vector(SINKS-1 downto 0) := (others => '1');

  signal has_it_r : std_logic_vector(SINKS-1 downto 0) := (others => '0');  -- sinks that took the message already
  signal taking   : std_logic_vector(SINKS-1 downto 0);
  signal release  : std_logic;

begin

  assert SINKS >= 1
    report "firm_message_fork: SINKS is " & integer'image(SINKS) & "; legal: 1 and more"
    severity failure;

  offer : for sink in 0 to SINKS-1 generate
    sink_valid(sink) <= source_valid and not has_it_r(sink);
    taking(sink)     <= source_valid and not has_it_r(sink) and sink_ready(sink);
  end generate offer;

  release      <= '1' when source_valid = '1' and (has_it_r or taking) = ALL_SINKS else '0';
  source_ready <= release;

  remember : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' or release = '1' then
        has_it_r <= (others => '0');
      else
        has_it_r <= has_it_r or taking;
      end if;
    end if;
  end process remember;

end architecture rtl;
