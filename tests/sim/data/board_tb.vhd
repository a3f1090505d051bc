-- A board's top level at the host's serial adapter: 12 cycles of 10 ns a bit, as 12 MHz and 1 Mbaud make them.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity board_tb is
  generic (
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;
    -- The button is pressed for a while at the start; it ends in the line's silence.
    PRESSED_CYCLES : integer := 0);
end entity board_tb;

architecture simulation of board_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal to_tdata  : std_logic_vector(7 downto 0);
  signal to_tvalid : std_logic;
  signal to_tready : std_logic;

  signal from_tdata  : std_logic_vector(7 downto 0);
  signal from_tkeep  : std_logic_vector(0 downto 0);
  signal from_tid    : std_logic_vector(7 downto 0);
  signal from_tvalid : std_logic;
  signal from_tlast  : std_logic;
  signal from_tready : std_logic;

  signal rxd   : std_logic;
  signal txd   : std_logic;
  signal led_n : std_logic;
  signal lit   : std_logic;

  signal reset_n : std_logic;

begin

  u_host : entity firm.firm_sim_host
    generic map (
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      SHOWN         => 0)
    port map (
      clk            => clk,
      rst_n          => rst_n,
      m_axis_tdata   => to_tdata,
      m_axis_tkeep   => open,
      m_axis_tvalid  => to_tvalid,
      m_axis_tlast   => open,
      m_axis_tready  => to_tready,
      s_axis_tdata   => from_tdata,
      s_axis_tkeep   => from_tkeep,
      s_axis_tid     => from_tid,
      s_axis_tvalid  => from_tvalid,
      s_axis_tlast   => from_tlast,
      s_axis_tready  => from_tready,
      frame_error(0) => lit);

  u_adapter : entity firm.firm_sim_uart
    generic map (
      BIT_TIME => 120 ns,
      SEED     => SEED)
    port map (
      clk           => clk,
      rst_n         => reset_n,
      s_axis_tdata  => to_tdata,
      s_axis_tvalid => to_tvalid,
      s_axis_tready => to_tready,
      m_axis_tdata  => from_tdata,
      m_axis_tkeep  => from_tkeep,
      m_axis_tid    => from_tid,
      m_axis_tvalid => from_tvalid,
      m_axis_tlast  => from_tlast,
      m_axis_tready => from_tready,
      uart_rxd      => rxd,
      uart_txd      => txd,
      uart_rts_n    => '0',
      uart_cts_n    => open);

  press : process
  begin
    reset_n <= '0';
    for cycle in 1 to PRESSED_CYCLES loop
      wait until rising_edge(clk);
    end loop;
    reset_n <= '1';
    wait;
  end process press;

  u_board : entity work.obstacle_icebreaker
    port map (
      clk      => clk,
      uart_rxd => rxd,
      uart_txd => txd,
      led_n    => led_n,
      reset_n  => reset_n);

  -- Before the first reset the light is anything.
  lit <= not led_n when led_n = '0' or led_n = '1' else '0';

end architecture simulation;
