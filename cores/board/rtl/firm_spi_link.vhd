-- SPDX-License-Identifier: Apache-2.0
-- The host's two streams over SPI, mode 0, highest bit first. The host is master. Frames: see firm_link_streams.
-- SPI transfers bytes in both directions at once, so each selection (spi_cs_n low) begins with a command:
--
--   00  status  then receive: room for bytes to the system (two bytes, lower first), bytes waiting for the host (two)
--   01  write   then send: bytes of frames, no more than there is room for
--   02  read    then receive: bytes of frames; after the waiting ones, 00
--   03  cut     the next written byte begins a frame: an incomplete frame is dropped
--
-- During the command, the host receives 80, plus 1 if bytes wait, plus 2 if a frame was not delivered since the last
-- cut.
-- clk samples the pins, so a period of spi_sclk takes at least 10 cycles of clk. A byte is accepted when its last bit
-- is clocked; selections may end anywhere.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;

entity firm_spi_link is
  generic (
    WIDTH   : integer := 8;
    LONGEST : integer := 2000;  -- bytes of payload of the longest frame from the host
    DEPTH   : integer := 1024  -- bytes that can wait for the host, a power of two
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    spi_sclk : in  std_logic;
    spi_cs_n : in  std_logic;
    spi_mosi : in  std_logic;
    spi_miso : out std_logic;
    spi_irq  : out std_logic;  -- bytes wait for the host

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
end entity firm_spi_link;

architecture rtl of firm_spi_link is

  subtype byte_t is std_logic_vector(7 downto 0);
  constant STATUS : byte_t := x"00";
  constant WRITE  : byte_t := x"01";
  constant READ   : byte_t := x"02";
  constant CUT    : byte_t := x"03";
  -- What the status can tell.
  constant MOST_ROOM : positive := 65535;

  -- The pins, synchronous to clk.
  signal pins          : std_logic_vector(2 downto 0);
  signal synced        : std_logic_vector(2 downto 0);
  signal sclk          : std_logic;
  signal cs_n          : std_logic;
  signal mosi          : std_logic;
  signal sclk_before_r : std_logic;  -- a cycle earlier

  signal rises : std_logic;
  signal falls : std_logic;

  signal bit_r     : natural range 0 to 7;  -- number of received bits of the byte
  signal first_r   : std_logic;             -- the byte is the selection's first
  signal in_r      : std_logic_vector(6 downto 0);
  signal out_r     : byte_t;
  signal command_r : byte_t;
  signal received  : byte_t;
  signal complete  : std_logic;  -- a byte is complete in this cycle
  signal offered_r : std_logic;  -- the outgoing byte is from the FIFO
  signal dropped_r : std_logic;  -- a frame was not delivered since the last cut
  signal status_r  : std_logic_vector(31 downto 0);  -- room and waiting bytes of one moment, what goes out next lowest

  signal rx_valid   : std_logic;
  signal rx_cut     : std_logic;
  signal room       : natural;
  signal error      : std_logic;
  signal shown_room : natural range 0 to MOST_ROOM;

  signal head_data  : byte_t;  -- the next byte for the host
  signal head_valid : std_logic;
  signal head_taken : std_logic;
  signal waiting    : natural range 0 to DEPTH;  -- bytes for the host

begin

  shown_room <= room when room < MOST_ROOM else MOST_ROOM;

  pins <= spi_mosi & spi_cs_n & spi_sclk;

  u_sync : entity firm.firm_cdc_sync
    generic map (
      BITS => 3
    )
    port map (
      clk    => clk,
      level  => pins,
      synced => synced
    );

  sclk <= synced(0);
  cs_n <= synced(1) or not rst_n;
  mosi <= synced(2);

  rises    <= not cs_n and sclk and not sclk_before_r;
  falls    <= not cs_n and sclk_before_r and not sclk;
  received <= in_r & mosi;
  complete <= '1' when rises = '1' and bit_r = 7 else '0';

  rx_valid   <= '1' when complete = '1' and first_r = '0' and command_r = WRITE else '0';
  rx_cut     <= '1' when complete = '1' and first_r = '1' and received = CUT else '0';
  head_taken <= complete and offered_r;

  shift : process (clk)

    procedure take_bit is
    begin
      in_r <= received(6 downto 0);
      if complete = '0' then
        bit_r <= bit_r + 1;
      else
        bit_r   <= 0;
        first_r <= '0';
        if first_r = '1' then
          command_r <= received;
          status_r  <= std_logic_vector(to_unsigned(waiting, 16)) & std_logic_vector(to_unsigned(shown_room, 16));
        end if;
      end if;
    end procedure take_bit;

    procedure begin_answer is
    begin
      out_r     <= x"00";
      offered_r <= '0';
      if command_r = READ and head_valid = '1' then
        out_r     <= head_data;
        offered_r <= '1';
      elsif command_r = STATUS then
        out_r    <= status_r(7 downto 0);
        status_r <= x"00" & status_r(31 downto 8);
      end if;
    end procedure begin_answer;

  begin
    if rising_edge(clk) then
      sclk_before_r <= sclk;
      if cs_n = '1' then
        bit_r     <= 0;
        first_r   <= '1';
        offered_r <= '0';
        out_r     <= "100000" & dropped_r & head_valid;
      elsif rises = '1' then
        take_bit;
      elsif falls = '1' and bit_r = 0 then
        begin_answer;
      elsif falls = '1' then
        out_r <= out_r(6 downto 0) & '0';
      end if;
      if error = '1' then
        dropped_r <= '1';
      elsif rx_cut = '1' then
        dropped_r <= '0';
      end if;
      if rst_n = '0' then
        dropped_r <= '0';
      end if;
    end if;
  end process shift;

  u_streams : entity firm.firm_link_streams
    generic map (
      WIDTH    => WIDTH,
      LONGEST  => LONGEST,
      TX_DEPTH => DEPTH
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      rx_data         => received,
      rx_valid        => rx_valid,
      rx_cut          => rx_cut,
      rx_lost         => '0',
      room            => room,
      tx_data         => head_data,
      tx_valid        => head_valid,
      tx_ready        => head_taken,
      tx_waiting      => waiting,
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
      link_error      => error,
      link_error_code => link_error_code,
      good_frames     => good_frames,
      broken_frames   => broken_frames,
      lost_frames     => lost_frames,
      refused_frames  => refused_frames
    );

  spi_miso   <= out_r(7);
  spi_irq    <= head_valid;
  link_error <= error;

end architecture rtl;
