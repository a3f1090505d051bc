-- A point passes unchanged; the pin `alive` shows the reset of the accelerator's clock.
library ieee;
use ieee.std_logic_1164.all;

entity alive is
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;
    in_x              : in  std_logic_vector(63 downto 0);
    in_y              : in  std_logic_vector(63 downto 0);
    in_z              : in  std_logic_vector(63 downto 0);
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;
    out_x             : out std_logic_vector(63 downto 0);
    out_y             : out std_logic_vector(63 downto 0);
    out_z             : out std_logic_vector(63 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic;
    alive             : out std_logic
  );
end entity alive;

architecture rtl of alive is
begin

  alive             <= rst_n;
  out_x             <= in_x;
  out_y             <= in_y;
  out_z             <= in_z;
  out_segment_valid <= in_segment_valid;
  in_msg_ready      <= out_msg_ready;

end architecture rtl;
