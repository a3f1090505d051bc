-- SPDX-License-Identifier: Apache-2.0
-- One echo per channel, after a Manager whose publishers are at the places 0, 1 and so on, or REVERSED. A subscriber
-- without publisher drops all frames, and a publisher without subscriber sends none. The streams of two channels are
-- checked on each side, since each checker takes time. Simulation only.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sim_check_pkg.all;

entity firm_sim_echoes is
  generic (
    WIDTH       : integer := 8;
    SUBSCRIBERS : integer := 2;
    PUBLISHERS  : integer := 2;
    REVERSED    : boolean := false;
    SEED        : integer := 1;
    -- The chance of a stall in a cycle, on each side of an echo.
    STALL_PERCENT : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- As at firm_manager.
    sub_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    sub_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    sub_tlast  : in  std_logic;
    sub_tvalid : in  std_logic_vector(SUBSCRIBERS-1 downto 0);
    sub_tready : out std_logic_vector(SUBSCRIBERS-1 downto 0);

    pub_tdata  : out std_logic_vector(PUBLISHERS*WIDTH-1 downto 0);
    pub_tkeep  : out std_logic_vector(PUBLISHERS*WIDTH/8-1 downto 0);
    pub_tvalid : out std_logic_vector(PUBLISHERS-1 downto 0);
    pub_tlast  : out std_logic_vector(PUBLISHERS-1 downto 0);
    pub_tready : in  std_logic_vector(PUBLISHERS-1 downto 0)
  );
end entity firm_sim_echoes;

architecture simulation of firm_sim_echoes is

  function place_of(publisher : natural) return natural is
  begin
    if REVERSED then
      return PUBLISHERS - 1 - publisher;
    end if;
    return publisher;
  end function place_of;

  signal taken : std_logic_vector(SUBSCRIBERS-1 downto 0);
  signal tdata : std_logic_vector(PUBLISHERS*WIDTH-1 downto 0);
  signal tkeep : std_logic_vector(PUBLISHERS*WIDTH/8-1 downto 0);
  signal valid : std_logic_vector(PUBLISHERS-1 downto 0);
  signal tlast : std_logic_vector(PUBLISHERS-1 downto 0);

begin

  sub_tready <= taken;
  pub_tdata  <= tdata;
  pub_tkeep  <= tkeep;
  pub_tvalid <= valid;
  pub_tlast  <= tlast;

  channels : for channel in 0 to SUBSCRIBERS-1 generate
    echo : if channel < PUBLISHERS generate
      constant PLACE : natural := place_of(channel);
    begin
      u_echo : entity firm.firm_sim_echo
        generic map (
          WIDTH         => WIDTH,
          ID            => channel mod 256,
          SEED          => SEED + channel,
          STALL_PERCENT => STALL_PERCENT
        )
        port map (
          clk           => clk,
          rst_n         => rst_n,
          s_axis_tdata  => sub_tdata,
          s_axis_tkeep  => sub_tkeep,
          s_axis_tvalid => sub_tvalid(channel),
          s_axis_tlast  => sub_tlast,
          s_axis_tready => taken(channel),
          m_axis_tdata  => tdata((PLACE+1)*WIDTH-1 downto PLACE*WIDTH),
          m_axis_tkeep  => tkeep((PLACE+1)*WIDTH/8-1 downto PLACE*WIDTH/8),
          m_axis_tvalid => valid(PLACE),
          m_axis_tlast  => tlast(PLACE),
          m_axis_tready => pub_tready(PLACE)
        );
    end generate echo;
    silent : if channel >= PUBLISHERS generate
      taken(channel) <= '1';
    end generate silent;
  end generate channels;

  speechless : for channel in SUBSCRIBERS to PUBLISHERS-1 generate
    constant PLACE : natural := place_of(channel);
  begin
    tdata((PLACE+1)*WIDTH-1 downto PLACE*WIDTH)     <= (others => '0');
    tkeep((PLACE+1)*WIDTH/8-1 downto PLACE*WIDTH/8) <= (others => '0');
    valid(PLACE)                                    <= '0';
    tlast(PLACE)                                    <= '0';
  end generate speechless;

  -- The first beat to a subscriber lacks the byte of the id.
  checked_subscribers : for channel in 0 to SUBSCRIBERS-1 generate
    first : if channel < 2 generate
      check_stream(clk, rst_n, sub_tdata, sub_tkeep, sub_tvalid(channel), sub_tlast, taken(channel),
                   "to subscriber " & integer'image(channel),
                   (keep => WIDTH = 8, may_be_empty => false, abort => false, others => true));
    end generate first;
  end generate checked_subscribers;

  checked_publishers : for channel in 0 to PUBLISHERS-1 generate
    first : if channel < 2 generate
      check_stream(clk, rst_n, tdata((channel+1)*WIDTH-1 downto channel*WIDTH),
                   tkeep((channel+1)*WIDTH/8-1 downto channel*WIDTH/8), valid(channel), tlast(channel),
                   pub_tready(channel), "from publisher " & integer'image(channel));
    end generate first;
  end generate checked_publishers;

end architecture simulation;
