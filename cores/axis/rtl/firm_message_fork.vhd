-- SPDX-License-Identifier: Apache-2.0
-- Distributes one message to several sinks. Each sink accepts it independently; the source is released when all have
-- accepted it. A sink's valid does not wait for another sink's ready, so no sink delays the others by more than one
-- message.
-- The beats of a stream and the elements of an array can be such messages, too.
library ieee;
use ieee.std_logic_1164.all;

entity firm_message_fork is
  generic (
    SINKS : integer := 2;
    -- The number of bits in segment_valid; they are hidden from a sink that has the message.
    SEGMENTS : integer := 1
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- It may fall without source_ready: the message is then withdrawn, even from sinks that have it.
    source_valid         : in  std_logic;
    source_ready         : out std_logic;
    source_segment_valid : in  std_logic_vector(SEGMENTS-1 downto 0) := (others => '0');

    sink_valid         : out std_logic_vector(SINKS-1 downto 0);
    sink_ready         : in  std_logic_vector(SINKS-1 downto 0);
    -- The first sink has the lowest bits.
    sink_segment_valid : out std_logic_vector(SINKS*SEGMENTS-1 downto 0)
  );
end entity firm_message_fork;

architecture rtl of firm_message_fork is

  constant ALL_SINKS : std_logic_vector(SINKS-1 downto 0) := (others => '1');

  signal has_it_r : std_logic_vector(SINKS-1 downto 0) := (others => '0');  -- sinks that took the message already
  signal taking   : std_logic_vector(SINKS-1 downto 0);
  signal is_done  : std_logic;

begin

  assert SINKS >= 1
    report "firm_message_fork: SINKS is " & integer'image(SINKS) & "; legal: 1 or more"
    severity failure;
  assert SEGMENTS >= 1
    report "firm_message_fork: SEGMENTS is " & integer'image(SEGMENTS) & "; legal: 1 or more"
    severity failure;

  offer : for sink in 0 to SINKS-1 generate
    sink_valid(sink) <= source_valid and not has_it_r(sink);
    taking(sink)     <= source_valid and not has_it_r(sink) and sink_ready(sink);

    sink_segment_valid(SEGMENTS*(sink+1)-1 downto SEGMENTS*sink)
      <= source_segment_valid when has_it_r(sink) = '0' else (others => '0');
  end generate offer;

  is_done      <= '1' when source_valid = '1' and (has_it_r or taking) = ALL_SINKS else '0';
  source_ready <= is_done;

  remember : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' or is_done = '1' or source_valid = '0' then
        has_it_r <= (others => '0');
      else
        has_it_r <= has_it_r or taking;
      end if;
    end if;
  end process remember;

end architecture rtl;
