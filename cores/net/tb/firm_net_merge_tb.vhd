-- SPDX-License-Identifier: Apache-2.0
-- Sends the frames of two sources through firm_net_merge. A row of a file is a frame as firm_sim_rows plays it, without
-- a pause before it; one of the results is the number of bytes, and the bytes.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_net_merge_tb is
  generic (
    FIRST_FILE    : string  := "first.txt";
    SECOND_FILE   : string  := "second.txt";
    RESULT_FILE   : string  := "merged.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- The chances per cycle of no byte, and that the reader takes nothing.
    SLOW_PERCENT  : integer := 0;
    STALL_PERCENT : integer := 0
  );
end entity firm_net_merge_tb;

architecture simulation of firm_net_merge_tb is

  type two_t is array (0 to 1) of boolean;

  signal clk     : std_logic := '0';
  signal rst_n   : std_logic_vector(1 downto 0);
  signal is_over : two_t;
  signal over    : boolean;

  signal s_tdata  : std_logic_vector(15 downto 0);
  signal s_tvalid : std_logic_vector(1 downto 0);
  signal s_tlast  : std_logic_vector(1 downto 0);
  signal s_tready : std_logic_vector(1 downto 0);

  signal tdata  : std_logic_vector(7 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;
  signal tready : std_logic;

  function file_of(stream : natural) return string is
  begin
    if stream = 0 then
      return FIRST_FILE;
    end if;
    return SECOND_FILE;
  end function file_of;

begin

  clk  <= not clk after 4 ns when not over else '0';
  over <= is_over(0) and is_over(1);

  streams : for stream in 0 to 1 generate

    u_rows : entity firm.firm_sim_rows
      generic map (
        FRAME_FILE   => file_of(stream),
        SEED         => SEED + stream,
        SLOW_PERCENT => SLOW_PERCENT,
        GAP_CYCLES   => 0
      )
      port map (
        clk           => clk,
        rst_n         => rst_n(stream),
        m_axis_tdata  => s_tdata(8*stream+7 downto 8*stream),
        m_axis_tuser  => open,
        m_axis_tvalid => s_tvalid(stream),
        m_axis_tlast  => s_tlast(stream),
        m_axis_tready => s_tready(stream),
        over          => is_over(stream)
      );

  end generate streams;

  u_merge : entity firm.firm_net_merge
    generic map (
      SOURCES => 2
    )
    port map (
      clk           => clk,
      rst_n         => rst_n(0),
      s_axis_tdata  => s_tdata,
      s_axis_tvalid => s_tvalid,
      s_axis_tlast  => s_tlast,
      s_axis_tready => s_tready,
      m_axis_tdata  => tdata,
      m_axis_tvalid => tvalid,
      m_axis_tlast  => tlast,
      m_axis_tready => tready
    );

  u_record : entity firm.firm_sim_record
    generic map (
      RESULT_FILE   => RESULT_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n(0),
      over          => over,
      s_axis_tdata  => tdata,
      s_axis_tvalid => tvalid,
      s_axis_tlast  => tlast,
      s_axis_tready => tready
    );

end architecture simulation;
