-- SPDX-License-Identifier: Apache-2.0
-- Forwards a stream and stalls it at random in both directions; an offered beat stays until it is accepted. Simulation
-- only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;

entity firm_sim_stall is
  generic (
    WIDTH : integer := 8;
    -- Different for each instance, 1 and more.
    SEED : integer := 1;
    -- The chance of a stall in a cycle; 0 is a wire.
    STALL_PERCENT : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_sim_stall;

architecture simulation of firm_sim_stall is

  signal is_open_r : boolean := true;

begin

  assert SEED >= 1
    report "firm_sim_stall: SEED is " & integer'image(SEED) & "; legal: 1 or more"
    severity failure;

  open_and_close : process (clk)
    variable random_1 : positive := SEED;
    variable random_2 : positive := 2;
    variable draw     : real;
  begin
    if rising_edge(clk) and STALL_PERCENT > 0 then
      uniform(random_1, random_2, draw);
      if rst_n = '0' or not is_open_r or s_axis_tvalid = '0' or m_axis_tready = '1' then
        is_open_r <= 100.0 * draw >= real(STALL_PERCENT);
      end if;
    end if;
  end process open_and_close;

  m_axis_tdata  <= s_axis_tdata;
  m_axis_tkeep  <= s_axis_tkeep;
  m_axis_tlast  <= s_axis_tlast;
  m_axis_tvalid <= s_axis_tvalid when is_open_r else '0';
  s_axis_tready <= m_axis_tready when is_open_r else '0';

end architecture simulation;
