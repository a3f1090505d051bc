-- SPDX-License-Identifier: Apache-2.0
-- The host with its serial adapter: frames of firm_sim_host over two lines, and back. It sends as an adapter does: with
-- pauses, and up to LAG bytes more after the other side's `rts_n` has risen. It opens the line with a break, like the
-- host's software. Simulation only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;
library firm;

entity firm_sim_uart is
  generic (
    BIT_TIME : time    := 100 ns;
    SEED     : integer := 1;
    -- The chance that it pauses before a byte and, by `uart_cts_n`, that it accepts none.
    STALL_PERCENT : integer := 0;
    LAG           : integer := 16
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Frames of the host.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tkeep  : out std_logic_vector(0 downto 0);
    m_axis_tid    : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- As named in the hardware: `uart_rxd` is the host's output.
    uart_rxd   : out std_logic;
    uart_txd   : in  std_logic;
    uart_rts_n : in  std_logic;
    uart_cts_n : out std_logic
  );
end entity firm_sim_uart;

architecture simulation of firm_sim_uart is

  signal coded_data  : std_logic_vector(7 downto 0);
  signal coded_valid : std_logic;
  signal coded_ready : std_logic;

  signal received_data  : std_logic_vector(7 downto 0);
  signal received_count : natural := 0;

begin

  send : process

    variable random_1 : positive := SEED;
    variable random_2 : positive := 7;
    variable draw     : real;
    variable lag_left : natural;

    procedure send_byte(data : in std_logic_vector(7 downto 0)) is
    begin
      uart_rxd <= '0';
      wait for BIT_TIME;
      for place in 0 to 7 loop
        uart_rxd <= data(place);
        wait for BIT_TIME;
      end loop;
      uart_rxd <= '1';
      wait for BIT_TIME;
    end procedure send_byte;

    procedure wait_for_leave is
    begin
      if uart_rts_n = '0' then
        uniform(random_1, random_2, draw);
        lag_left := integer(floor(draw * real(LAG + 1)));
      elsif lag_left > 0 then
        lag_left := lag_left - 1;
      else
        wait until uart_rts_n = '0';
      end if;
    end procedure wait_for_leave;

    variable data : std_logic_vector(7 downto 0);

  begin
    coded_ready <= '0';
    uart_rxd      <= '1';
    wait until rising_edge(clk) and rst_n = '1';
    wait for 4 * BIT_TIME;
    uart_rxd <= '0';
    wait for 12 * BIT_TIME;
    uart_rxd <= '1';
    wait for BIT_TIME;
    lag_left := 0;
    loop
      wait_for_leave;
      wait until falling_edge(clk);
      coded_ready <= '1';
      wait until rising_edge(clk) and coded_valid = '1';
      data          := coded_data;
      coded_ready <= '0';
      uniform(random_1, random_2, draw);
      if 100.0 * draw < real(STALL_PERCENT) then
        uniform(random_1, random_2, draw);
        wait for 30.0 * draw * BIT_TIME;
      end if;
      send_byte(data);
    end loop;
  end process send;

  receive : process
    variable data : std_logic_vector(7 downto 0);
  begin
    wait until falling_edge(uart_txd);
    wait for 0.5 * BIT_TIME;
    assert uart_txd = '0'
      report "firm_sim_uart: a start bit is too short" severity failure;
    for place in 0 to 7 loop
      wait for BIT_TIME;
      data(place) := uart_txd;
    end loop;
    wait for BIT_TIME;
    assert uart_txd = '1'
      report "firm_sim_uart: a stop bit is low" severity failure;
    received_data  <= data;
    received_count <= received_count + 1;
  end process receive;

  want : process
    variable random_1 : positive := SEED;
    variable random_2 : positive := 11;
    variable draw     : real;
  begin
    wait for 7 * BIT_TIME;
    -- It ends with the clock.
    wait until rising_edge(clk);
    uniform(random_1, random_2, draw);
    uart_cts_n <= '0';
    if 100.0 * draw < real(STALL_PERCENT) then
      uart_cts_n <= '1';
    end if;
  end process want;

  u_coder : entity firm.firm_sim_coder
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      data          => coded_data,
      valid         => coded_valid,
      ready         => coded_ready
    );

  u_frames : entity firm.firm_sim_frames
    port map (
      clk           => clk,
      rst_n         => rst_n,
      data          => received_data,
      count         => received_count,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tid    => m_axis_tid,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

end architecture simulation;
