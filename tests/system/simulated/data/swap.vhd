-- SPDX-License-Identifier: Apache-2.0
-- Two fields of a Pose changed for each other. It keeps one message, so that both neighbours can go on.
library ieee;
use ieee.std_logic_1164.all;

entity swap is
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;
    in_position_x     : in  std_logic_vector(63 downto 0);
    in_position_y     : in  std_logic_vector(63 downto 0);
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;
    out_position_x    : out std_logic_vector(63 downto 0);
    out_position_y    : out std_logic_vector(63 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity swap;

architecture rtl of swap is

  signal full_r : std_logic := '0';
  signal ready  : std_logic;

begin

  -- High without a message, too.
  ready                <= not full_r or out_msg_ready;
  in_msg_ready         <= ready;
  out_segment_valid(0) <= full_r;

  keep : process (clk)
  begin
    if rising_edge(clk) then
      if ready = '1' then
        out_position_x <= in_position_y;
        out_position_y <= in_position_x;
        full_r         <= in_msg_valid;
      end if;
      if rst_n = '0' then
        full_r <= '0';
      end if;
    end if;
  end process keep;

end architecture rtl;
