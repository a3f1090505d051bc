-- A design as another project might have it: an asynchronous reset, active high, and a clock enable.
library ieee;
use ieee.std_logic_1164.all;

entity stage is
  port (
    clk       : in  std_logic;
    reset     : in  std_logic;
    enable    : in  std_logic;
    valid     : in  std_logic;
    value     : in  std_logic_vector(191 downto 0);
    out_valid : out std_logic;
    out_value : out std_logic_vector(191 downto 0)
  );
end entity stage;

architecture rtl of stage is
begin

  advance : process (clk, reset)
  begin
    if reset = '1' then
      out_valid <= '0';
    elsif rising_edge(clk) then
      if enable = '1' then
        out_valid <= valid;
        out_value <= value;
      end if;
    end if;
  end process advance;

end architecture rtl;

-- The accelerator around it.
library ieee;
use ieee.std_logic_1164.all;

entity adapted is
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
    out_msg_ready     : in  std_logic
  );
end entity adapted;

architecture rtl of adapted is

  signal reset     : std_logic;
  signal enable    : std_logic;
  signal value     : std_logic_vector(191 downto 0);
  signal out_valid : std_logic;
  signal out_value : std_logic_vector(191 downto 0);

begin

  -- `rst_n` comes from a register of this clock, so its inverse has no glitches, and ends with an edge.
  reset <= not rst_n;
  -- The design moves on unless its result waits for the publisher.
  enable       <= out_msg_ready or not out_valid;
  in_msg_ready <= in_msg_valid and enable;
  value        <= in_x & in_y & in_z;

  u_stage : entity work.stage
    port map (
      clk       => clk,
      reset     => reset,
      enable    => enable,
      valid     => in_msg_valid,
      value     => value,
      out_valid => out_valid,
      out_value => out_value
    );

  out_segment_valid(0)  <= out_valid;
  out_x                 <= out_value(191 downto 128);
  out_y                 <= out_value(127 downto 64);
  out_z                 <= out_value(63 downto 0);

end architecture rtl;
