-- SPDX-License-Identifier: Apache-2.0
-- Receives Ethernet frames from the bytes of a GMII. It removes preamble and frame check sequence (FCS), and aborts
-- each frame that is broken or too long: one with a wrong FCS, with fewer than 64 bytes, or with an error of the PHY.
-- The four bytes of the FCS wait in a delay line, so the last byte of a frame leaves when the result is known.
--
-- The line has no back-pressure, so `m_axis` has no `tready`: the sink accepts each beat at once.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_mac_receiver is
  generic (
    LONGEST : integer := 1514  -- bytes of the longest frame, from the addresses to the payload
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The line; it counts in the cycles in which `rx_step` is high.
    rx_step : in std_logic := '1';
    rx_dv   : in std_logic;
    rx_er   : in std_logic := '0';
    rxd     : in std_logic_vector(7 downto 0);

    -- From the destination address to the payload, with padding.
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;

    -- For each burst of `rx_dv`, one of these pulses; a good frame's and a broken one's are with the last beat.
    is_good   : out std_logic;
    is_broken : out std_logic;
    is_long   : out std_logic
  );
end entity firm_mac_receiver;

architecture rtl of firm_mac_receiver is

  constant PREAMBLE_BYTE : std_logic_vector(7 downto 0) := x"55";
  constant START_BYTE    : std_logic_vector(7 downto 0) := x"d5";
  constant FCS_BYTES     : positive := 4;
  constant SHORTEST      : positive := 64;  -- with FCS
  constant COUNT_BITS    : positive := clog2(LONGEST+FCS_BYTES+1);

  -- SKIPPED lasts until the end of the burst, which has already had its pulse.
  type state_t is (IDLE, PREAMBLE, FRAME, SKIPPED);
  signal state_r : state_t;

  -- The last bytes, the newest one first: those of the FCS, if the frame ends now, and the one before them.
  type delay_t is array (0 to FCS_BYTES) of std_logic_vector(7 downto 0);
  signal delay_r : delay_t;
  signal count_r : natural range 0 to LONGEST+FCS_BYTES;  -- bytes so far
  signal count   : std_logic_vector(COUNT_BITS-1 downto 0);
  signal error_r : std_logic;                             -- the PHY reported an error in the frame

  signal takes_byte : std_logic;  -- a byte of the frame arrives
  signal ends       : std_logic;  -- the frame has ended before this byte of the line
  signal overflows  : std_logic;  -- the frame is longer than LONGEST with this byte
  signal has_byte   : std_logic;  -- the oldest byte of the delay line belongs to the frame
  signal clear      : std_logic;
  signal is_right   : std_logic;
  signal is_whole   : std_logic;

begin

  assert LONGEST >= 60 and LONGEST <= 9000
    report "firm_mac_receiver: LONGEST is " & integer'image(LONGEST) & "; legal: 60 to 9000"
    severity failure;

  takes_byte <= rx_step and rx_dv when state_r = FRAME else '0';
  ends       <= rx_step and not rx_dv when state_r = FRAME else '0';
  overflows  <= takes_byte when count_r = LONGEST+FCS_BYTES else '0';
  count      <= std_logic_vector(to_unsigned(count_r, COUNT_BITS));
  has_byte   <= not is_below(count, FCS_BYTES+1);
  is_whole   <= is_right and not (error_r or is_below(count, SHORTEST));
  clear      <= '0' when state_r = FRAME else '1';

  u_crc : entity firm.firm_crc32
    port map (
      clk      => clk,
      clear    => clear,
      data     => rxd,
      valid    => takes_byte,
      value    => open,
      is_right => is_right
    );

  follow : process (clk)
  begin
    if rising_edge(clk) then
      if rx_step = '0' then
        null;
      elsif rx_dv = '0' then
        state_r <= IDLE;
      elsif state_r = IDLE or state_r = PREAMBLE then
        count_r <= 0;
        error_r <= '0';
        if rx_er = '1' then
          state_r <= SKIPPED;
        elsif rxd = PREAMBLE_BYTE then
          state_r <= PREAMBLE;
        elsif rxd = START_BYTE then
          state_r <= FRAME;
        else
          state_r <= SKIPPED;
        end if;
      elsif overflows = '1' then
        state_r <= SKIPPED;
      elsif state_r = FRAME then
        count_r <= count_r + 1;
        error_r <= error_r or rx_er;
      end if;
      -- A burst in progress at the end of a reset is not a frame.
      if rst_n = '0' then
        state_r <= SKIPPED;
        count_r <= 0;
      end if;
    end if;
  end process follow;

  delay : process (clk)
  begin
    if rising_edge(clk) and takes_byte = '1' then
      delay_r(0)              <= rxd;
      delay_r(1 to FCS_BYTES) <= delay_r(0 to FCS_BYTES-1);
    end if;
  end process delay;

  show : process (clk)
  begin
    if rising_edge(clk) then
      m_axis_tdata    <= delay_r(FCS_BYTES);
      m_axis_tvalid   <= (takes_byte or ends) and has_byte;
      m_axis_tlast    <= ends or overflows;
      m_axis_tuser(0) <= (ends and not is_whole) or overflows;
      if rst_n = '0' then
        m_axis_tvalid <= '0';
      end if;
    end if;
  end process show;

  judge : process (clk)
  begin
    if rising_edge(clk) then
      is_good   <= ends and is_whole;
      is_broken <= ends and not is_whole;
      is_long   <= overflows;
      -- A burst without a start of a frame.
      if rx_step = '1' and state_r = PREAMBLE and rx_dv = '0' then
        is_broken <= '1';
      elsif rx_step = '1' and (state_r = IDLE or state_r = PREAMBLE) and rx_dv = '1' then
        if rx_er = '1' or (rxd /= PREAMBLE_BYTE and rxd /= START_BYTE) then
          is_broken <= '1';
        end if;
      end if;
      if rst_n = '0' then
        is_good   <= '0';
        is_broken <= '0';
        is_long   <= '0';
      end if;
    end if;
  end process judge;

end architecture rtl;
