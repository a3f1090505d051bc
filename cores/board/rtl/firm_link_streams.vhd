-- SPDX-License-Identifier: Apache-2.0
-- Connects a host link, which carries bytes, to a system's two streams of frames. On the link, a frame is
-- COBS(id, length, payload, CRC-32 of these) and a zero byte. A frame from the host is held until its checksum is
-- right, and never passed on otherwise; so a lost, additional or wrong byte costs its frame, and the next one only if
-- it was the zero byte between them. The host's bytes cannot be stalled here: the driver of the link must observe
-- `room`.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_fault_pkg.all;

entity firm_link_streams is
  generic (
    WIDTH    : integer := 8;
    LONGEST  : integer := 2000;  -- bytes of payload of the longest frame from the host
    SPARE    : integer := 1;     -- bytes from the host that find room beside this frame
    TX_DEPTH : integer := 512    -- bytes that can wait for the host, a power of two
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Pulses, at most one of them in a cycle.
    rx_data  : in  std_logic_vector(7 downto 0);
    rx_valid : in  std_logic;  -- with each byte
    rx_cut   : in  std_logic;  -- the next byte begins a frame
    rx_lost  : in  std_logic;  -- bytes were lost
    room     : out natural;

    tx_data    : out std_logic_vector(7 downto 0);
    tx_valid   : out std_logic;
    tx_ready   : in  std_logic;
    tx_waiting : out natural range 0 to TX_DEPTH;

    -- Frames to the system.
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- Frames from the system. An aborted frame ends with a wrong checksum, so that the host drops it.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- A pulse for each frame from the host that is not delivered: code 12 if it was broken or bytes were lost, 7 if it
    -- is longer than LONGEST.
    link_error      : out std_logic;
    link_error_code : out std_logic_vector(3 downto 0);
    -- Frames from the host since reset: delivered; with a wrong checksum; with bytes that are known to be lost; too
    -- long.
    good_frames    : out std_logic_vector(31 downto 0);
    broken_frames  : out std_logic_vector(31 downto 0);
    lost_frames    : out std_logic_vector(31 downto 0);
    refused_frames : out std_logic_vector(31 downto 0)
  );
end entity firm_link_streams;

architecture rtl of firm_link_streams is

  constant LANES      : positive := WIDTH/8;
  constant COUNT_BITS : positive := clog2(LANES+1);
  -- The counts of one byte and of zero bytes.
  constant ONE        : std_logic_vector(COUNT_BITS-1 downto 0) := (0 => '1', others => '0');
  constant NONE       : std_logic_vector(COUNT_BITS-1 downto 0) := (others => '0');

  constant CHECKSUM_BYTES : positive := 4;

  signal decoded_data  : std_logic_vector(7 downto 0);
  signal decoded_valid : std_logic;
  signal decoded_end   : std_logic;
  signal is_wrong      : std_logic;
  signal is_lost       : std_logic;

  signal is_good    : std_logic;
  signal is_broken  : std_logic;
  signal is_missing : std_logic;
  signal is_refused : std_logic;

  signal good_r    : unsigned(31 downto 0);
  signal broken_r  : unsigned(31 downto 0);
  signal missing_r : unsigned(31 downto 0);
  signal refused_r : unsigned(31 downto 0);

  signal stored_byte  : std_logic_vector(7 downto 0);
  signal stored_data  : std_logic_vector(WIDTH-1 downto 0);
  signal stored_last  : std_logic;
  signal stored_valid : std_logic;
  signal stored_ready : std_logic;

  signal window     : std_logic_vector(WIDTH-1 downto 0);
  signal available  : std_logic_vector(COUNT_BITS-1 downto 0);
  signal is_last    : std_logic;  -- the frame ends with the available bytes
  signal is_aborted : std_logic;
  signal has_byte   : std_logic;
  signal take       : std_logic;

  signal summing_r  : std_logic;                           -- the bytes of the checksum are sent
  signal abort_r    : std_logic;                           -- of a frame that was aborted
  signal left_r     : natural range 0 to CHECKSUM_BYTES-1;  -- of them, after this one
  signal sum        : std_logic_vector(31 downto 0);
  signal sum_clear  : std_logic;
  signal sum_data   : std_logic_vector(7 downto 0);
  signal send_data  : std_logic_vector(7 downto 0);
  signal send_last  : std_logic;
  signal send_valid : std_logic;
  signal send_ready : std_logic;
  signal sent       : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_link_streams: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  -- ------------------------------------------------------------------ from the host

  u_decoder : entity firm.firm_cobs_decoder
    port map (
      clk         => clk,
      rst_n       => rst_n,
      coded_data  => rx_data,
      coded_valid => rx_valid,
      coded_lost  => rx_lost,
      coded_cut   => rx_cut,
      data        => decoded_data,
      valid       => decoded_valid,
      ends        => decoded_end,
      is_wrong    => is_wrong,
      is_lost     => is_lost
    );

  u_store : entity firm.firm_link_store
    generic map (
      LONGEST => LONGEST,
      SPARE   => SPARE
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      data       => decoded_data,
      valid      => decoded_valid,
      ends       => decoded_end,
      is_wrong   => is_wrong,
      is_lost    => is_lost,
      m_data     => stored_byte,
      m_last     => stored_last,
      m_valid    => stored_valid,
      m_ready    => stored_ready,
      room       => room,
      is_good    => is_good,
      is_broken  => is_broken,
      is_missing => is_missing,
      is_refused => is_refused
    );

  fill_lane : process (stored_byte)
  begin
    stored_data             <= (others => '0');
    stored_data(7 downto 0) <= stored_byte;
  end process fill_lane;

  u_pack : entity firm.firm_axis_pack
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      data          => stored_data,
      count         => ONE,
      last          => stored_last,
      valid         => stored_valid,
      ready         => stored_ready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tuser  => m_axis_tuser,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

  count : process (clk)
  begin
    if rising_edge(clk) then
      if is_good = '1' then
        good_r <= good_r + 1;
      end if;
      if is_broken = '1' then
        broken_r <= broken_r + 1;
      end if;
      if is_missing = '1' then
        missing_r <= missing_r + 1;
      end if;
      if is_refused = '1' then
        refused_r <= refused_r + 1;
      end if;
      if rst_n = '0' then
        good_r    <= (others => '0');
        broken_r  <= (others => '0');
        missing_r <= (others => '0');
        refused_r <= (others => '0');
      end if;
    end if;
  end process count;

  link_error      <= is_broken or is_missing or is_refused;
  link_error_code <= TOO_LONG when is_refused = '1' else BAD_CHECKSUM;
  good_frames     <= std_logic_vector(good_r);
  broken_frames   <= std_logic_vector(broken_r);
  lost_frames     <= std_logic_vector(missing_r);
  refused_frames  <= std_logic_vector(refused_r);

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
      s_axis_tuser  => s_axis_tuser,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      window        => window,
      available     => available,
      is_last       => is_last,
      is_aborted    => is_aborted,
      shown         => open,
      ends          => open,
      take_valid    => take,
      take          => ONE,
      skip          => '0'
    );

  has_byte   <= '0' when available = NONE else '1';
  send_valid <= has_byte or summing_r;
  send_data  <= window(7 downto 0) when summing_r = '0' else
                not sum(7 downto 0) when abort_r = '1' else
                sum(7 downto 0);
  send_last  <= '1' when summing_r = '1' and left_r = 0 else '0';
  sent       <= send_valid and send_ready;
  take       <= has_byte and send_ready and not summing_r;

  -- A byte that equals the register's lowest one shifts the register by a byte.
  sum_data  <= not sum(7 downto 0) when summing_r = '1' else window(7 downto 0);
  sum_clear <= (sent and send_last) or not rst_n;

  u_crc : entity firm.firm_crc32
    port map (
      clk      => clk,
      clear    => sum_clear,
      data     => sum_data,
      valid    => sent,
      value    => sum,
      is_right => open
    );

  append_checksum : process (clk)
  begin
    if rising_edge(clk) then
      if sent = '1' and summing_r = '1' then
        summing_r <= not send_last;
        if left_r /= 0 then
          left_r <= left_r - 1;
        end if;
      elsif sent = '1' and is_last = '1' and available = ONE then
        summing_r <= '1';
        abort_r   <= is_aborted;
        left_r    <= CHECKSUM_BYTES-1;
      end if;
      if rst_n = '0' then
        summing_r <= '0';
      end if;
    end if;
  end process append_checksum;

  u_encoder : entity firm.firm_cobs_encoder
    generic map (
      DEPTH => TX_DEPTH
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      data        => send_data,
      last        => send_last,
      valid       => send_valid,
      ready       => send_ready,
      coded_data  => tx_data,
      coded_valid => tx_valid,
      coded_ready => tx_ready,
      waiting     => tx_waiting
    );

end architecture rtl;
