-- SPDX-License-Identifier: Apache-2.0
-- A Manager of Managers to be proved: its publishers are in two groups, and those of the second have the upper byte 1.
-- With a WATCHDOG, stopped publishers are cut off.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sched_pkg.all;

entity small_tree is
  generic (
    PUBLISHERS : integer := 4;
    WATCHDOG   : integer := 0
  );
  port (
    clk             : in  std_logic;
    rst_n           : in  std_logic;
    m_axis_tdata    : out std_logic_vector(7 downto 0);
    m_axis_tuser    : out std_logic_vector(0 downto 0);
    m_axis_tid      : out std_logic_vector(15 downto 0);
    m_axis_tvalid   : out std_logic;
    m_axis_tlast    : out std_logic;
    m_axis_tready   : in  std_logic;
    pub_axis_tdata  : in  std_logic_vector(PUBLISHERS*8-1 downto 0);
    pub_axis_tuser  : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tvalid : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tlast  : in  std_logic_vector(PUBLISHERS-1 downto 0);
    pub_axis_tready : out std_logic_vector(PUBLISHERS-1 downto 0);
    expired         : out std_logic_vector(PUBLISHERS-1 downto 0)
  );
end entity small_tree;

architecture rtl of small_tree is

  constant HALF     : positive           := PUBLISHERS/2;
  constant SIZES    : times_t(0 to 1)    := (HALF, PUBLISHERS-HALF);
  constant POLICIES : policies_t(0 to 1) := (ROUND_ROBIN, FIXED_PRIORITY);

  function highs_of_places return times_t is
    variable highs : times_t(0 to PUBLISHERS-1) := (others => 0);
  begin
    for place in HALF to PUBLISHERS-1 loop
      highs(place) := 1;
    end loop;
    return highs;
  end function highs_of_places;

begin

  u_tree : entity firm.firm_manager_tree
    generic map (
      WIDTH       => 8,
      SUBSCRIBERS => 1,
      PUBLISHERS  => PUBLISHERS,
      SIZES       => SIZES,
      POLICIES    => POLICIES,
      TOP_POLICY  => ROUND_ROBIN,
      HIGHS       => highs_of_places,
      WATCHDOG    => WATCHDOG
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      s_axis_tdata    => (others => '0'),
      s_axis_tkeep    => (others => '1'),
      s_axis_tuser    => "0",
      s_axis_tvalid   => '0',
      s_axis_tlast    => '0',
      s_axis_tready   => open,
      m_axis_tdata    => m_axis_tdata,
      m_axis_tkeep    => open,
      m_axis_tuser    => m_axis_tuser,
      m_axis_tid      => m_axis_tid,
      m_axis_tvalid   => m_axis_tvalid,
      m_axis_tlast    => m_axis_tlast,
      m_axis_tready   => m_axis_tready,
      sub_axis_tdata  => open,
      sub_axis_tkeep  => open,
      sub_axis_tuser  => open,
      sub_axis_tlast  => open,
      sub_axis_tvalid => open,
      sub_axis_tready => "1",
      pub_axis_tdata  => pub_axis_tdata,
      pub_axis_tkeep  => (others => '1'),
      pub_axis_tuser  => pub_axis_tuser,
      pub_axis_tvalid => pub_axis_tvalid,
      pub_axis_tlast  => pub_axis_tlast,
      pub_axis_tready => pub_axis_tready,
      id_error        => open,
      expired         => expired
    );

end architecture rtl;
