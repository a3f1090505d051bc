-- SPDX-License-Identifier: Apache-2.0
-- The host's two streams over a serial line: eight data bits, no parity, one stop bit; frames as firm_link_streams
-- says. A break from the host drops an incomplete frame. uart_rts_n rises when little room remains, early enough for
-- the bytes that an adapter still sends.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_uart_link is
  generic (
    WIDTH    : integer := 8;
    CLOCK_HZ : integer := 100000000;
    BAUD     : integer := 1000000;
    LONGEST  : integer := 2000  -- bytes of payload of the longest frame from the host
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- As at a modem: a low rts_n lets the host send, a low cts_n lets this side send.
    uart_rxd   : in  std_logic;
    uart_txd   : out std_logic;
    uart_rts_n : out std_logic;
    uart_cts_n : in  std_logic := '0';

    -- Frames to the system.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- Frames from the system.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- A pulse for each frame from the host that is not delivered, and the counts of frames from the host, as
    -- firm_link_streams has them.
    link_error      : out std_logic;
    link_error_code : out std_logic_vector(3 downto 0);
    good_frames     : out std_logic_vector(31 downto 0);
    broken_frames   : out std_logic_vector(31 downto 0);
    lost_frames     : out std_logic_vector(31 downto 0);
    refused_frames  : out std_logic_vector(31 downto 0)
  );
end entity firm_uart_link;

architecture rtl of firm_uart_link is

  -- The cycles of a bit, rounded to nearest.
  function divisor_of(hertz : integer; bits_per_second : integer) return integer is
  begin
    if bits_per_second < 1 then
      return 0;
    end if;
    return (hertz + bits_per_second/2) / bits_per_second;
  end function divisor_of;

  constant DIVISOR : integer := divisor_of(CLOCK_HZ, BAUD);
  -- An adapter sees rts_n late; the usual ones send up to 16 bytes more.
  constant RESERVE : positive := 32;

  signal rx_data  : std_logic_vector(7 downto 0);
  signal rx_valid : std_logic;
  signal rx_break : std_logic;
  signal rx_wrong : std_logic;
  signal room     : natural;

  signal tx_data  : std_logic_vector(7 downto 0);
  signal tx_valid : std_logic;
  signal tx_ready : std_logic;

begin

  assert BAUD >= 1 and CLOCK_HZ / 4 >= BAUD
    report "firm_uart_link: BAUD is " & integer'image(BAUD) & "; legal: 1 to a quarter of CLOCK_HZ"
    severity failure;
  -- More than half a bit of error at the tenth bit would misread it; the host's clock may use the other half of the
  -- margin.
  assert abs (CLOCK_HZ - DIVISOR*BAUD) <= CLOCK_HZ/40
    report "firm_uart_link: " & integer'image(DIVISOR) & " cycles of CLOCK_HZ are no bit at BAUD " & integer'image(BAUD)
           & ", it is off by more than 2.5 %"
    severity failure;

  u_receiver : entity firm.firm_uart_receiver
    generic map (
      DIVISOR => DIVISOR
    )
    port map (
      clk      => clk,
      rst_n    => rst_n,
      uart_rxd => uart_rxd,
      data     => rx_data,
      valid    => rx_valid,
      is_break => rx_break,
      is_wrong => rx_wrong
    );

  u_streams : entity firm.firm_link_streams
    generic map (
      WIDTH   => WIDTH,
      LONGEST => LONGEST,
      SPARE   => RESERVE + 1
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      rx_data         => rx_data,
      rx_valid        => rx_valid,
      rx_cut          => rx_break,
      rx_lost         => rx_wrong,
      room            => room,
      tx_data         => tx_data,
      tx_valid        => tx_valid,
      tx_ready        => tx_ready,
      tx_waiting      => open,
      m_axis_tdata    => m_axis_tdata,
      m_axis_tkeep    => m_axis_tkeep,
      m_axis_tuser    => m_axis_tuser,
      m_axis_tvalid   => m_axis_tvalid,
      m_axis_tlast    => m_axis_tlast,
      m_axis_tready   => m_axis_tready,
      s_axis_tdata    => s_axis_tdata,
      s_axis_tkeep    => s_axis_tkeep,
      s_axis_tuser    => s_axis_tuser,
      s_axis_tvalid   => s_axis_tvalid,
      s_axis_tlast    => s_axis_tlast,
      s_axis_tready   => s_axis_tready,
      link_error      => link_error,
      link_error_code => link_error_code,
      good_frames     => good_frames,
      broken_frames   => broken_frames,
      lost_frames     => lost_frames,
      refused_frames  => refused_frames
    );

  u_transmitter : entity firm.firm_uart_transmitter
    generic map (
      DIVISOR => DIVISOR
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      data       => tx_data,
      valid      => tx_valid,
      ready      => tx_ready,
      uart_txd   => uart_txd,
      uart_cts_n => uart_cts_n
    );

  ask_for_bytes : process (clk)
  begin
    if rising_edge(clk) then
      uart_rts_n <= '1';
      if room > RESERVE and rst_n = '1' then
        uart_rts_n <= '0';
      end if;
    end if;
  end process ask_for_bytes;

end architecture rtl;
