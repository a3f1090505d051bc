-- SPDX-License-Identifier: Apache-2.0
-- The master of an SPI bus with one slave, in mode 0 or 3: bits change at falling edges of the clock and are read at
-- rising ones, the highest first. The beats of a frame are the bytes to the slave; for each of them, a byte is
-- received. spi_cs_n is low during a frame, also while the source pauses between two bytes, and high for at least one
-- bit's time between frames.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_spi_master is
  generic (
    MODE     : integer := 0;  -- 0, or 3: spi_sck is high between frames
    HALF_BIT : integer := 2;  -- cycles of each level of spi_sck
    -- Cycles from the rising edge at the pin to the one at which the slave's bit is read, for slaves and wires that are
    -- slow: 0 to 2*HALF_BIT-1.
    READ_DELAY : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Bytes to the slave.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- The byte from the slave for each of them, with `tlast` of the frame. It is not held.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;

    spi_sck  : out std_logic;
    spi_cs_n : out std_logic;
    spi_mosi : out std_logic;
    spi_miso : in  std_logic
  );
end entity firm_spi_master;

architecture rtl of firm_spi_master is

  -- The register of spi_sck delays its edge by a cycle, and the synchroniser what is read at this edge.
  constant SYNC_STAGES : positive := 2;
  constant DELAY       : natural  := SYNC_STAGES + READ_DELAY;

  function level_between_frames return std_logic is
  begin
    if MODE = 3 then
      return '1';
    end if;
    return '0';
  end function level_between_frames;

  constant IDLE_LEVEL : std_logic := level_between_frames;

  type state_t is (WAITING, SELECTED, LOW, HIGH, ENDING, GAP);
  signal state_r : state_t;

  signal cycles_r : natural range 0 to 2*HALF_BIT-1;  -- that the state still takes
  signal bits_r   : natural range 0 to 7;             -- that follow this one
  signal send_r   : std_logic_vector(7 downto 0);     -- the highest bit is at the pin
  signal last_r   : std_logic;                        -- no byte of the frame follows

  signal is_free  : std_logic;  -- the next byte can begin after this cycle
  signal is_read  : std_logic;  -- a rising edge
  signal is_ended : std_logic;  -- that of a byte's last bit

  -- Rising edges on their way to the cycle in which their bit is read.
  signal read_r  : std_logic_vector(DELAY downto 0);
  signal ended_r : std_logic_vector(DELAY downto 0);
  signal lasts_r : std_logic_vector(DELAY downto 0);

  signal received_r : std_logic_vector(7 downto 0);
  signal miso       : std_logic_vector(0 downto 0);

begin

  assert MODE = 0 or MODE = 3
    report "firm_spi_master: MODE is " & integer'image(MODE) & "; legal: 0 and 3"
    severity failure;
  assert HALF_BIT >= 1 and HALF_BIT <= 65536
    report "firm_spi_master: HALF_BIT is " & integer'image(HALF_BIT) & "; legal: 1 to 65536"
    severity failure;
  assert READ_DELAY >= 0 and READ_DELAY < 2*HALF_BIT
    report "firm_spi_master: READ_DELAY is " & integer'image(READ_DELAY) & "; legal: 0 to 2*HALF_BIT-1"
    severity failure;

  is_read  <= '1' when state_r = LOW and cycles_r = 0 else '0';
  is_ended <= is_read when bits_r = 0 else '0';

  is_free <= '0' when cycles_r /= 0 else
             '1' when state_r = SELECTED else
             not last_r when state_r = HIGH and bits_r = 0 else
             '0';
  s_axis_tready <= is_free;

  clock_bits : process (clk)

    procedure begin_level (level : state_t) is
    begin
      state_r  <= level;
      cycles_r <= HALF_BIT-1;
    end procedure begin_level;

  begin
    if rising_edge(clk) then
      if cycles_r /= 0 then
        cycles_r <= cycles_r - 1;
      elsif state_r = WAITING then
        if s_axis_tvalid = '1' then
          begin_level(SELECTED);
        end if;
      elsif state_r = LOW then
        begin_level(HIGH);
      elsif state_r = HIGH then
        if bits_r /= 0 then
          begin_level(LOW);
          bits_r <= bits_r - 1;
          send_r <= send_r(6 downto 0) & '0';
        elsif last_r = '1' then
          begin_level(ENDING);
        else
          state_r <= SELECTED;
        end if;
      elsif state_r = ENDING then
        state_r  <= GAP;
        cycles_r <= 2*HALF_BIT-1;
      elsif state_r = GAP then
        state_r <= WAITING;
      end if;
      if is_free = '1' and s_axis_tvalid = '1' then
        begin_level(LOW);
        bits_r <= 7;
        send_r <= s_axis_tdata;
        last_r <= s_axis_tlast;
      end if;
      if rst_n = '0' then
        state_r  <= GAP;
        cycles_r <= 2*HALF_BIT-1;
      end if;
    end if;
  end process clock_bits;

  -- The pins change one cycle after the state.
  drive_pins : process (clk)
  begin
    if rising_edge(clk) then
      spi_sck  <= IDLE_LEVEL;
      spi_cs_n <= '0';
      spi_mosi <= send_r(7);
      if state_r = LOW then
        spi_sck <= '0';
      elsif state_r = HIGH then
        spi_sck <= '1';
      elsif state_r = WAITING or state_r = GAP then
        spi_cs_n <= '1';
      end if;
    end if;
  end process drive_pins;

  u_sync : entity firm.firm_cdc_sync
    generic map (
      BITS   => 1,
      STAGES => SYNC_STAGES
    )
    port map (
      clk      => clk,
      level(0) => spi_miso,
      synced   => miso
    );

  read_bits : process (clk)
  begin
    if rising_edge(clk) then
      read_r  <= read_r(DELAY-1 downto 0) & is_read;
      ended_r <= ended_r(DELAY-1 downto 0) & is_ended;
      lasts_r <= lasts_r(DELAY-1 downto 0) & last_r;
      if read_r(DELAY) = '1' then
        received_r <= received_r(6 downto 0) & miso(0);
      end if;
      m_axis_tvalid <= read_r(DELAY) and ended_r(DELAY);
      m_axis_tlast  <= lasts_r(DELAY);
      if rst_n = '0' then
        read_r        <= (others => '0');
        m_axis_tvalid <= '0';
      end if;
    end if;
  end process read_bits;

  m_axis_tdata <= received_r;

end architecture rtl;
