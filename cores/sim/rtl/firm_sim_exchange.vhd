-- SPDX-License-Identifier: Apache-2.0
-- Plays the rows of a file as frames of bytes, and compares the frames of a second stream with those of another file:
-- firm_sim_rows and firm_sim_record, for a part that answers. Simulation only.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_sim_exchange is
  generic (
    FRAME_FILE    : string;
    RESULT_FILE   : string;
    EXPECTED_FILE : string;
    SEED          : integer;
    SLOW_PERCENT  : integer;
    STALL_PERCENT : integer := 0;
    LAST_CYCLES   : natural;
    SHOWS_USER    : boolean := false
  );
  port (
    clk   : in  std_logic;
    rst_n : out std_logic;
    over  : out boolean;

    sent     : out bytes_t;
    received : in  bytes_t;
    ready    : out std_logic;

    is_dropped : in std_logic := '0';
    is_lost    : in std_logic := '0'
  );
end entity firm_sim_exchange;

architecture simulation of firm_sim_exchange is

  signal runs  : std_logic;
  signal ended : boolean;

begin

  rst_n <= runs;
  over  <= ended;

  u_rows : entity firm.firm_sim_rows
    generic map (
      FRAME_FILE   => FRAME_FILE,
      SEED         => SEED,
      SLOW_PERCENT => SLOW_PERCENT,
      LAST_CYCLES  => LAST_CYCLES
    )
    port map (
      clk           => clk,
      rst_n         => runs,
      m_axis_tdata  => sent.tdata,
      m_axis_tuser  => sent.tuser,
      m_axis_tvalid => sent.tvalid,
      m_axis_tlast  => sent.tlast,
      over          => ended
    );

  u_record : entity firm.firm_sim_record
    generic map (
      RESULT_FILE   => RESULT_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      SHOWS_USER    => SHOWS_USER
    )
    port map (
      clk           => clk,
      rst_n         => runs,
      over          => ended,
      s_axis_tdata  => received.tdata,
      s_axis_tuser  => received.tuser,
      s_axis_tvalid => received.tvalid,
      s_axis_tlast  => received.tlast,
      s_axis_tready => ready,
      is_dropped    => is_dropped,
      is_lost       => is_lost
    );

end architecture simulation;
