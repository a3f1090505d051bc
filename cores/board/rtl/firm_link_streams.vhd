-- SPDX-License-Identifier: Apache-2.0
-- Connects a host link, which carries bytes, to a system's two streams of frames. Bytes from the host wait in a FIFO,
-- are divided into frames by their announced lengths, and fill beats. Beats to the host are sent byte by byte. The
-- host's bytes cannot be stalled here: the driver of the link must observe `room`. If bytes are lost, by the link or
-- for lack of room, the current frame is cut and all later bytes, whose meaning is unknown, are dropped. This lasts
-- until the host resynchronises, by its own cut or by TIMEOUT cycles of silence. Silence always cuts an incomplete
-- frame.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_link_streams is
  generic (
    WIDTH   : integer := 8;
    DEPTH   : integer := 1024;  -- bytes from the host that can wait
    TIMEOUT : integer := 0    -- 0: silence has no effect
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    rx_data  : in  std_logic_vector(7 downto 0);
    rx_valid : in  std_logic;   -- a pulse with each byte
    rx_cut   : in  std_logic;   -- a pulse: the next byte begins a frame
    rx_lost  : in  std_logic;   -- a pulse: bytes were lost
    room     : out natural range 0 to DEPTH;

    tx_data  : out std_logic_vector(7 downto 0);
    tx_valid : out std_logic;
    tx_ready : in  std_logic;

    -- Frames to the system.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- Frames from the system.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- Pulses when bytes start to be dropped.
    link_error : out std_logic
  );
end entity firm_link_streams;

architecture rtl of firm_link_streams is

  constant LANES      : positive := WIDTH/8;
  constant COUNT_BITS : positive := clog2(LANES+1);
  -- The counts of one byte and of zero bytes.
  constant ONE        : std_logic_vector(COUNT_BITS-1 downto 0) := (0 => '1', others => '0');
  constant NONE       : std_logic_vector(COUNT_BITS-1 downto 0) := (others => '0');

  signal dropping_r : std_logic;                           -- bytes were lost, and the host has not resynchronised
  signal cut_r      : std_logic;                           -- a cut must be stored
  signal silence_r  : natural range 0 to max(TIMEOUT, 1);  -- cycles until silence causes a cut; 0 when it has
  signal silent     : std_logic;                           -- it does in this cycle
  signal is_stored  : std_logic;                           -- the received byte is kept
  signal lost       : std_logic;
  signal stored_r   : natural range 0 to DEPTH;            -- items in the FIFO

  signal put_valid : std_logic;
  signal put_ready : std_logic;

  signal item_data  : std_logic_vector(7 downto 0);
  signal item_cut   : std_logic;
  signal item_valid : std_logic;
  signal item_ready : std_logic;
  signal item_taken : std_logic;

  signal framed_byte  : std_logic_vector(7 downto 0);
  signal framed_data  : std_logic_vector(WIDTH-1 downto 0);
  signal framed_last  : std_logic;
  signal framed_valid : std_logic;
  signal framed_ready : std_logic;

  signal window    : std_logic_vector(WIDTH-1 downto 0);
  signal available : std_logic_vector(COUNT_BITS-1 downto 0);
  signal has_byte  : std_logic;
  signal take      : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_link_streams: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert DEPTH >= 16
    report "firm_link_streams: DEPTH is " & integer'image(DEPTH) & "; legal: 16 or more"
    severity failure;
  assert TIMEOUT >= 0
    report "firm_link_streams: TIMEOUT is " & integer'image(TIMEOUT) & "; legal: 0 or more"
    severity failure;

  -- ------------------------------------------------------------------ from the host

  -- The last place is reserved for the cut that follows when all others are in use.
  is_stored <= '1' when rx_valid = '1' and dropping_r = '0' and cut_r = '0' and stored_r < DEPTH-1 else '0';
  lost      <= rx_lost or (rx_valid and not is_stored);
  put_valid <= '1' when is_stored = '1' or (cut_r = '1' and rx_valid = '0' and stored_r < DEPTH) else '0';
  silent    <= '1' when silence_r = 1 and rx_valid = '0' else '0';

  guard : process (clk)
  begin
    if rising_edge(clk) then
      link_error <= lost and not dropping_r;
      if put_valid = '1' and put_ready = '1' and is_stored = '0' then
        cut_r <= '0';
      end if;
      if TIMEOUT > 0 then
        if rx_valid = '1' then
          silence_r <= TIMEOUT;
        elsif silence_r /= 0 then
          silence_r <= silence_r - 1;
        end if;
      end if;
      if rx_cut = '1' or silent = '1' then
        dropping_r <= '0';
        cut_r      <= '1';
      end if;
      if lost = '1' then
        dropping_r <= '1';
        if dropping_r = '0' then
          cut_r <= '1';
        end if;
      end if;
      if rst_n = '0' then
        link_error <= '0';
        dropping_r <= '0';
        cut_r      <= '0';
        silence_r  <= 0;
      end if;
    end if;
  end process guard;

  count : process (clk)
  begin
    if rising_edge(clk) then
      if (put_valid and put_ready) = '1' and item_taken = '0' then
        stored_r <= stored_r + 1;
      elsif (put_valid and put_ready) = '0' and item_taken = '1' then
        stored_r <= stored_r - 1;
      end if;
      if rst_n = '0' then
        stored_r <= 0;
      end if;
    end if;
  end process count;

  -- `tlast` marks a cut.
  u_fifo : entity firm.firm_axis_fifo
    generic map (
      WIDTH => 8,
      DEPTH => DEPTH
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      s_axis_tdata    => rx_data,
      s_axis_tkeep(0) => '1',
      s_axis_tvalid   => put_valid,
      s_axis_tlast    => cut_r,
      s_axis_tready   => put_ready,
      m_axis_tdata    => item_data,
      m_axis_tkeep    => open,
      m_axis_tvalid   => item_valid,
      m_axis_tlast    => item_cut,
      m_axis_tready   => item_ready
    );

  item_taken <= item_valid and item_ready;

  u_framer : entity firm.firm_link_framer
    port map (
      clk        => clk,
      rst_n      => rst_n,
      item_data  => item_data,
      item_cut   => item_cut,
      item_valid => item_valid,
      item_ready => item_ready,
      data       => framed_byte,
      last       => framed_last,
      valid      => framed_valid,
      ready      => framed_ready
    );

  fill_lane : process (framed_byte)
  begin
    framed_data             <= (others => '0');
    framed_data(7 downto 0) <= framed_byte;
  end process fill_lane;

  u_pack : entity firm.firm_axis_pack
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      data          => framed_data,
      count         => ONE,
      last          => framed_last,
      valid         => framed_valid,
      ready         => framed_ready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

  -- ------------------------------------------------------------------ to the host

  u_window : entity firm.firm_axis_window
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tkeep  => s_axis_tkeep,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      window        => window,
      available     => available,
      is_last       => open,
      take_valid    => take,
      take          => ONE,
      skip          => '0'
    );

  has_byte <= '0' when available = NONE else '1';
  take     <= has_byte and tx_ready;

  room     <= 0 when stored_r >= DEPTH-1 else DEPTH-1 - stored_r;
  tx_data  <= window(7 downto 0);
  tx_valid <= has_byte;

end architecture rtl;
