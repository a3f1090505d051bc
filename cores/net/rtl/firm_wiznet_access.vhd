-- SPDX-License-Identifier: Apache-2.0
-- Reads and writes the registers and buffers of a W5500 or W5200 as SPI frames. Addresses of buffers are the chip's
-- free-running 16-bit pointers: where they cross the end of a buffer, they wrap, for which an access to the W5200 is
-- divided into two frames.
--
-- An access begins with a request. A write then takes `request_length` bytes from s_axis; a read sends the same number
-- to m_axis. `is_done` is a pulse after the last of them, when the next request is accepted. The bus waits while either
-- side stalls.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;

entity firm_wiznet_access is
  generic (
    CHIP         : integer := 5500;  -- or 5200
    BUFFER_BYTES : integer := 2048;  -- of each buffer of each socket: 1024, 2048
    -- Those of firm_spi_master.
    MODE       : integer := 0;
    HALF_BIT   : integer := 2;
    READ_DELAY : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Stable until `request_ready`. The space: "00" common registers, "01" a socket's registers, "10" its transmit
    -- buffer, "11" its receive buffer.
    request_valid   : in  std_logic;
    request_ready   : out std_logic;
    request_write   : in  std_logic;
    request_space   : in  std_logic_vector(1 downto 0);
    request_socket  : in  std_logic_vector(2 downto 0);
    request_address : in  std_logic_vector(15 downto 0);
    request_length  : in  std_logic_vector(11 downto 0);  -- bytes, 1 to BUFFER_BYTES
    is_done         : out std_logic;

    -- Bytes to write.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tready : out std_logic;

    -- Bytes that were read.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tready : in  std_logic;

    spi_sck  : out std_logic;
    spi_cs_n : out std_logic;
    spi_mosi : out std_logic;
    spi_miso : in  std_logic
  );
end entity firm_wiznet_access;

architecture rtl of firm_wiznet_access is

  constant IS_FLAT : boolean := CHIP = 5200;  -- one address space, and lengths in the header

  function bytes_of_header return positive is
  begin
    if IS_FLAT then
      return 4;
    end if;
    return 3;
  end function bytes_of_header;

  constant HEADER_BYTES : positive := bytes_of_header;

  constant COMMON    : std_logic_vector(1 downto 0) := "00";
  constant REGISTERS : std_logic_vector(1 downto 0) := "01";
  constant TRANSMIT  : std_logic_vector(1 downto 0) := "10";

  type state_t is (IDLE, MEASURE, HEADER, DATA, FINISH);
  signal state_r : state_t;

  signal write_r   : std_logic;
  signal space_r   : std_logic_vector(1 downto 0);
  signal socket_r  : std_logic_vector(2 downto 0);
  signal address_r : unsigned(15 downto 0);
  signal left_r    : unsigned(11 downto 0);                   -- bytes of the access that the master has not taken
  signal frame_r   : unsigned(11 downto 0);                   -- those of this frame
  signal index_r   : natural range 0 to HEADER_BYTES-1;       -- of the header's byte
  signal pending_r : natural range 0 to 2;                    -- bytes that the master has taken and not returned
  signal skip_r    : natural range 0 to HEADER_BYTES;         -- bytes to return that answer the header

  signal offset     : unsigned(15 downto 0);  -- in the buffer
  signal until_wrap : unsigned(11 downto 0);
  signal flat       : unsigned(15 downto 0);
  signal control    : std_logic_vector(7 downto 0);

  signal header_data : std_logic_vector(7 downto 0);
  signal tx_data     : std_logic_vector(7 downto 0);
  signal tx_valid    : std_logic;
  signal tx_last     : std_logic;
  signal tx_ready    : std_logic;
  signal tx_taken    : std_logic;
  signal rx_data     : std_logic_vector(7 downto 0);
  signal rx_valid    : std_logic;

  signal stored_r       : std_logic_vector(7 downto 0);
  signal stored_valid_r : std_logic;

begin

  assert CHIP = 5500 or CHIP = 5200
    report "firm_wiznet_access: CHIP is " & integer'image(CHIP) & "; legal: 5200 and 5500"
    severity failure;
  assert BUFFER_BYTES = 1024 or BUFFER_BYTES = 2048
    report "firm_wiznet_access: BUFFER_BYTES is " & integer'image(BUFFER_BYTES) & "; legal: 1024 and 2048"
    severity failure;

  request_ready <= '1' when state_r = IDLE else '0';

  offset     <= address_r and to_unsigned(BUFFER_BYTES-1, 16);
  until_wrap <= BUFFER_BYTES - offset(11 downto 0);

  -- The chip's datasheet, memory map: the buffers of the sockets are one after another.
  flat <= address_r when space_r = COMMON else
          unsigned(std_logic_vector'("01000") & socket_r) & address_r(7 downto 0) when space_r = REGISTERS else
          x"8000" + offset + resize(unsigned(socket_r) * to_unsigned(BUFFER_BYTES, 12), 16) when space_r = TRANSMIT else
          x"c000" + offset + resize(unsigned(socket_r) * to_unsigned(BUFFER_BYTES, 12), 16);

  control(7 downto 3) <= "00000" when space_r = COMMON else socket_r & space_r;
  control(2)          <= write_r;
  control(1 downto 0) <= "00";  -- a frame of any length

  block_header : if not IS_FLAT generate
  begin
    header_data <= std_logic_vector(address_r(15 downto 8)) when index_r = 0 else
                   std_logic_vector(address_r(7 downto 0)) when index_r = 1 else
                   control;
  end generate block_header;

  flat_header : if IS_FLAT generate
  begin
    header_data <= std_logic_vector(flat(15 downto 8)) when index_r = 0 else
                   std_logic_vector(flat(7 downto 0)) when index_r = 1 else
                   write_r & "000" & std_logic_vector(frame_r(11 downto 8)) when index_r = 2 else
                   std_logic_vector(frame_r(7 downto 0));
  end generate flat_header;

  tx_data <= header_data when state_r = HEADER else
             s_axis_tdata when write_r = '1' else
             (others => '0');
  tx_valid <= '1' when state_r = HEADER else
              '0' when state_r /= DATA else
              s_axis_tvalid when write_r = '1' else
              '1' when pending_r = 0 and stored_valid_r = '0' else
              '0';
  tx_last       <= '1' when state_r = DATA and frame_r = 1 else '0';
  tx_taken      <= tx_valid and tx_ready;
  s_axis_tready <= tx_ready and write_r when state_r = DATA else '0';

  u_master : entity firm.firm_spi_master
    generic map (
      MODE       => MODE,
      HALF_BIT   => HALF_BIT,
      READ_DELAY => READ_DELAY
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => tx_data,
      s_axis_tvalid => tx_valid,
      s_axis_tlast  => tx_last,
      s_axis_tready => tx_ready,
      m_axis_tdata  => rx_data,
      m_axis_tvalid => rx_valid,
      m_axis_tlast  => open,
      spi_sck       => spi_sck,
      spi_cs_n      => spi_cs_n,
      spi_mosi      => spi_mosi,
      spi_miso      => spi_miso
    );

  make_frames : process (clk)
  begin
    if rising_edge(clk) then
      is_done <= '0';
      if state_r = IDLE then
        write_r   <= request_write;
        space_r   <= request_space;
        socket_r  <= request_socket;
        address_r <= unsigned(request_address);
        left_r    <= unsigned(request_length);
        if request_valid = '1' then
          state_r <= MEASURE;
        end if;
      elsif state_r = MEASURE then
        frame_r <= left_r;
        if IS_FLAT and space_r(1) = '1' and left_r > until_wrap then
          frame_r <= until_wrap;
        end if;
        index_r <= 0;
        if pending_r = 0 then
          state_r <= HEADER;
        end if;
      elsif state_r = HEADER then
        if tx_taken = '1' then
          if index_r = HEADER_BYTES-1 then
            state_r <= DATA;
          else
            index_r <= index_r + 1;
          end if;
        end if;
      elsif state_r = DATA then
        if tx_taken = '1' then
          address_r <= address_r + 1;
          left_r    <= left_r - 1;
          frame_r   <= frame_r - 1;
          if left_r = 1 then
            state_r <= FINISH;
          elsif frame_r = 1 then
            state_r <= MEASURE;
          end if;
        end if;
      elsif pending_r = 0 and stored_valid_r = '0' then
        is_done <= '1';
        state_r <= IDLE;
      end if;
      if rst_n = '0' then
        state_r <= IDLE;
        is_done <= '0';
      end if;
    end if;
  end process make_frames;

  take_answers : process (clk)
  begin
    if rising_edge(clk) then
      if tx_taken = '1' and rx_valid = '0' then
        pending_r <= pending_r + 1;
      elsif tx_taken = '0' and rx_valid = '1' then
        pending_r <= pending_r - 1;
      end if;
      if m_axis_tready = '1' then
        stored_valid_r <= '0';
      end if;
      if state_r = MEASURE and pending_r = 0 then
        skip_r <= HEADER_BYTES;
      elsif rx_valid = '1' and skip_r /= 0 then
        skip_r <= skip_r - 1;
      elsif rx_valid = '1' then
        stored_r       <= rx_data;
        stored_valid_r <= not write_r;
      end if;
      if rst_n = '0' then
        pending_r      <= 0;
        stored_valid_r <= '0';
      end if;
    end if;
  end process take_answers;

  m_axis_tdata  <= stored_r;
  m_axis_tvalid <= stored_valid_r;

end architecture rtl;
