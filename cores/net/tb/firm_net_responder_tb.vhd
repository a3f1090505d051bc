-- SPDX-License-Identifier: Apache-2.0
-- Sends frames to the responder of the host 192.0.2.2, 02:00:00:00:00:02. A row of the file is a frame: the cycles
-- before it, whether it is aborted (0 or 1), the number of bytes, and the bytes. The replies go to a file, a row each:
-- the number of bytes, and the bytes; or `lost`.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sim_pkg.bytes_t;

entity firm_net_responder_tb is
  generic (
    DEPTH         : integer := 2048;
    FRAME_FILE    : string  := "frames.txt";
    RESULT_FILE   : string  := "replies.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- The chances per cycle of no byte, and that the reader takes nothing.
    SLOW_PERCENT  : integer := 0;
    STALL_PERCENT : integer := 0
  );
end entity firm_net_responder_tb;

architecture simulation of firm_net_responder_tb is

  -- Cycles for the reader after the last frame.
  constant LAST_CYCLES : positive := 4 * DEPTH;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic;
  signal over  : boolean;

  signal sent     : bytes_t;
  signal received : bytes_t;
  signal ready    : std_logic;
  signal is_lost  : std_logic;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_responder : entity firm.firm_net_responder
    generic map (
      DEPTH => DEPTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      mac           => x"020000000002",
      address       => x"c0000202",
      s_axis_tdata  => sent.tdata,
      s_axis_tuser  => sent.tuser,
      s_axis_tvalid => sent.tvalid,
      s_axis_tlast  => sent.tlast,
      m_axis_tdata  => received.tdata,
      m_axis_tvalid => received.tvalid,
      m_axis_tlast  => received.tlast,
      m_axis_tready => ready,
      is_lost       => is_lost
    );

  u_exchange : entity firm.firm_sim_exchange
    generic map (
      FRAME_FILE    => FRAME_FILE,
      RESULT_FILE   => RESULT_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      SLOW_PERCENT  => SLOW_PERCENT,
      STALL_PERCENT => STALL_PERCENT,
      LAST_CYCLES   => LAST_CYCLES
    )
    port map (
      clk      => clk,
      rst_n    => rst_n,
      over     => over,
      sent     => sent,
      received => received,
      ready    => ready,
      is_lost  => is_lost
    );

end architecture simulation;
