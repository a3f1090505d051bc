-- SPDX-License-Identifier: Apache-2.0
-- Replaces a pair of converters after the Manager: accepts frames without id, like a subscriber, and returns them with
-- ID, like a publisher. It stalls at random on both sides. Simulation only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;

entity firm_sim_echo is
  generic (
    WIDTH : integer := 8;
    ID    : natural := 0;
    -- Beats between the two sides.
    DEPTH : integer := 16;
    SEED  : integer := 1;
    -- The chance of a stall in a cycle, on each side.
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
end entity firm_sim_echo;

architecture simulation of firm_sim_echo is

  signal taken_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal taken_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal taken_tvalid : std_logic;
  signal taken_tlast  : std_logic;
  signal taken_tready : std_logic;

  signal kept_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal kept_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal kept_tvalid : std_logic;
  signal kept_tlast  : std_logic;
  signal kept_tready : std_logic;

  signal sent_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal sent_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal sent_tvalid : std_logic;
  signal sent_tlast  : std_logic;
  signal sent_tready : std_logic;

  signal first_r : std_logic;  -- the next beat sent is the first of a frame

begin

  u_stall_in : entity firm.firm_sim_stall
    generic map (
      WIDTH         => WIDTH,
      SEED          => 2*SEED,
      STALL_PERCENT => STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tkeep  => s_axis_tkeep,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      m_axis_tdata  => taken_tdata,
      m_axis_tkeep  => taken_tkeep,
      m_axis_tvalid => taken_tvalid,
      m_axis_tlast  => taken_tlast,
      m_axis_tready => taken_tready
    );

  u_fifo : entity firm.firm_axis_fifo
    generic map (
      WIDTH => WIDTH,
      DEPTH => DEPTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => taken_tdata,
      s_axis_tkeep  => taken_tkeep,
      s_axis_tvalid => taken_tvalid,
      s_axis_tlast  => taken_tlast,
      s_axis_tready => taken_tready,
      m_axis_tdata  => kept_tdata,
      m_axis_tkeep  => kept_tkeep,
      m_axis_tvalid => kept_tvalid,
      m_axis_tlast  => kept_tlast,
      m_axis_tready => kept_tready
    );

  find_first : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        first_r <= '1';
      elsif sent_tvalid = '1' and sent_tready = '1' then
        first_r <= sent_tlast;
      end if;
    end if;
  end process find_first;

  sent_tvalid <= kept_tvalid;

  -- The id is a separate beat before the first one.
  byte_wide : if WIDTH = 8 generate
    sent_tdata  <= std_logic_vector(to_unsigned(ID, 8)) when first_r = '1' else kept_tdata;
    sent_tkeep  <= "1";
    sent_tlast  <= '0' when first_r = '1' else kept_tlast;
    kept_tready <= '0' when first_r = '1' else sent_tready;
  end generate byte_wide;

  -- The id goes into the invalid lane of the first beat.
  wider : if WIDTH > 8 generate
    sent_tdata(WIDTH-1 downto 8) <= kept_tdata(WIDTH-1 downto 8);
    sent_tdata(7 downto 0)       <= std_logic_vector(to_unsigned(ID, 8)) when first_r = '1' else kept_tdata(7 downto 0);
    sent_tkeep                   <= kept_tkeep;
    sent_tlast                   <= kept_tlast;
    kept_tready                  <= sent_tready;
  end generate wider;

  u_stall_out : entity firm.firm_sim_stall
    generic map (
      WIDTH         => WIDTH,
      SEED          => 2*SEED + 1,
      STALL_PERCENT => STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => sent_tdata,
      s_axis_tkeep  => sent_tkeep,
      s_axis_tvalid => sent_tvalid,
      s_axis_tlast  => sent_tlast,
      s_axis_tready => sent_tready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

end architecture simulation;
