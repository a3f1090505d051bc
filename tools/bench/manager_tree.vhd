-- SPDX-License-Identifier: Apache-2.0
-- A Manager of Managers to be placed: SIDE groups of SIDE publishers each, round robin in and among groups.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sched_pkg.all;

entity manager_tree is
  generic (
    WIDTH    : integer := 8;
    SIDE     : integer := 32;
    WATCHDOG : integer := 0
  );
  port (
    clk             : in  std_logic;
    rst_n           : in  std_logic;
    s_axis_tdata    : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep    : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser    : in  std_logic_vector(0 downto 0);
    s_axis_tvalid   : in  std_logic;
    s_axis_tlast    : in  std_logic;
    s_axis_tready   : out std_logic;
    m_axis_tdata    : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep    : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser    : out std_logic_vector(0 downto 0);
    m_axis_tid      : out std_logic_vector(15 downto 0);
    m_axis_tvalid   : out std_logic;
    m_axis_tlast    : out std_logic;
    m_axis_tready   : in  std_logic;
    sub_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    sub_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    sub_axis_tuser  : out std_logic_vector(0 downto 0);
    sub_axis_tlast  : out std_logic;
    sub_axis_tvalid : out std_logic_vector(0 downto 0);
    sub_axis_tready : in  std_logic_vector(0 downto 0);
    pub_axis_tdata  : in  std_logic_vector(SIDE*SIDE*WIDTH-1 downto 0);
    pub_axis_tkeep  : in  std_logic_vector(SIDE*SIDE*(WIDTH/8)-1 downto 0);
    pub_axis_tuser  : in  std_logic_vector(SIDE*SIDE-1 downto 0);
    pub_axis_tvalid : in  std_logic_vector(SIDE*SIDE-1 downto 0);
    pub_axis_tlast  : in  std_logic_vector(SIDE*SIDE-1 downto 0);
    pub_axis_tready : out std_logic_vector(SIDE*SIDE-1 downto 0);
    id_error        : out std_logic;
    expired         : out std_logic_vector(SIDE*SIDE-1 downto 0)
  );
end entity manager_tree;

architecture rtl of manager_tree is

  constant SIZES    : times_t(0 to SIDE-1)    := (others => SIDE);
  constant POLICIES : policies_t(0 to SIDE-1) := (others => ROUND_ROBIN);

  -- The upper byte of the id of each publisher.
  function highs_of_places return times_t is
    variable highs : times_t(0 to SIDE*SIDE-1);
  begin
    for place in highs'range loop
      highs(place) := place/256;
    end loop;
    return highs;
  end function highs_of_places;

begin

  u_tree : entity firm.firm_manager_tree
    generic map (
      WIDTH       => WIDTH,
      SUBSCRIBERS => 1,
      PUBLISHERS  => SIDE*SIDE,
      SIZES       => SIZES,
      POLICIES    => POLICIES,
      TOP_POLICY  => ROUND_ROBIN,
      HIGHS       => highs_of_places,
      WATCHDOG    => WATCHDOG
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      s_axis_tdata    => s_axis_tdata,
      s_axis_tkeep    => s_axis_tkeep,
      s_axis_tuser    => s_axis_tuser,
      s_axis_tvalid   => s_axis_tvalid,
      s_axis_tlast    => s_axis_tlast,
      s_axis_tready   => s_axis_tready,
      m_axis_tdata    => m_axis_tdata,
      m_axis_tkeep    => m_axis_tkeep,
      m_axis_tuser    => m_axis_tuser,
      m_axis_tid      => m_axis_tid,
      m_axis_tvalid   => m_axis_tvalid,
      m_axis_tlast    => m_axis_tlast,
      m_axis_tready   => m_axis_tready,
      sub_axis_tdata  => sub_axis_tdata,
      sub_axis_tkeep  => sub_axis_tkeep,
      sub_axis_tuser  => sub_axis_tuser,
      sub_axis_tlast  => sub_axis_tlast,
      sub_axis_tvalid => sub_axis_tvalid,
      sub_axis_tready => sub_axis_tready,
      pub_axis_tdata  => pub_axis_tdata,
      pub_axis_tkeep  => pub_axis_tkeep,
      pub_axis_tuser  => pub_axis_tuser,
      pub_axis_tvalid => pub_axis_tvalid,
      pub_axis_tlast  => pub_axis_tlast,
      pub_axis_tready => pub_axis_tready,
      id_error        => id_error,
      expired         => expired
    );

end architecture rtl;
