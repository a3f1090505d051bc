-- SPDX-License-Identifier: Apache-2.0
-- Sends frames as the bytes of a GMII, with preamble, padding to 60 bytes, frame check sequence (FCS) and the gap of 12
-- bytes. The first byte of the preamble follows the first beat by one cycle. A frame that cannot be sent completely is
-- invalidated, so that every receiver drops it: it ends with an inverted FCS and `tx_er`. This applies to an aborted
-- frame, to a frame in which the source pauses, and to a frame longer than LONGEST.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_mac_transmitter is
  generic (
    LONGEST : integer := 1514  -- bytes of the longest frame, from the addresses to the payload
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- From the destination address to the payload. Within a frame, a beat must be valid whenever `tready` is high.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- The line; it changes after the cycles in which `tx_step` is high.
    tx_step : in  std_logic := '1';
    tx_en   : out std_logic;
    tx_er   : out std_logic;
    txd     : out std_logic_vector(7 downto 0);

    -- Pulses at the end of a frame.
    is_sent    : out std_logic;
    is_spoiled : out std_logic
  );
end entity firm_mac_transmitter;

architecture rtl of firm_mac_transmitter is

  constant PREAMBLE_BYTE : std_logic_vector(7 downto 0) := x"55";
  constant START_BYTE    : std_logic_vector(7 downto 0) := x"d5";
  -- Bytes on the line.
  constant PREAMBLE_BYTES : positive := 7;
  constant FCS_BYTES      : positive := 4;
  constant GAP_BYTES      : positive := 12;
  constant SHORTEST       : positive := 60;  -- without FCS
  constant COUNT_BITS     : positive := clog2(LONGEST+1);

  type state_t is (IDLE, PREAMBLE, FRAME, PADDING, FCS, GAP);
  signal state_r : state_t;

  signal left_r    : natural range 0 to GAP_BYTES-1;  -- bytes of preamble, FCS or gap after this one
  signal count_r   : natural range 0 to LONGEST;      -- bytes of the frame so far, with padding
  signal spoiled_r : std_logic;
  signal drain_r   : std_logic;                       -- the source's frame is dropped up to its end

  signal taken      : std_logic;  -- an accepted beat of the frame being sent
  signal is_final   : std_logic;  -- no byte of the source follows on the line
  signal is_padded  : std_logic;  -- no padding follows
  signal sum        : std_logic_vector(31 downto 0);
  signal sum_clear  : std_logic;
  signal sum_valid  : std_logic;
  signal sum_data   : std_logic_vector(7 downto 0);
  signal fcs_byte   : std_logic_vector(7 downto 0);

begin

  assert LONGEST >= 60 and LONGEST <= 9000
    report "firm_mac_transmitter: LONGEST is " & integer'image(LONGEST) & "; legal: 60 to 9000"
    severity failure;

  s_axis_tready <= '1' when drain_r = '1' else
                   tx_step when state_r = FRAME else
                   '0';

  taken     <= s_axis_tvalid and tx_step when state_r = FRAME else '0';
  is_final  <= '1' when s_axis_tlast = '1' or count_r = LONGEST-1 else '0';
  is_padded <= not is_below(std_logic_vector(to_unsigned(count_r, COUNT_BITS)), SHORTEST-1);

  -- A byte that equals the register's lowest one shifts the register by a byte.
  sum_data  <= s_axis_tdata when state_r = FRAME else
               not sum(7 downto 0) when state_r = FCS else
               (others => '0');
  sum_valid <= taken when state_r = FRAME else
               tx_step when state_r = PADDING or state_r = FCS else
               '0';
  sum_clear <= '1' when state_r = PREAMBLE else '0';
  fcs_byte  <= not sum(7 downto 0) when spoiled_r = '1' else sum(7 downto 0);

  u_crc : entity firm.firm_crc32
    port map (
      clk      => clk,
      clear    => sum_clear,
      data     => sum_data,
      valid    => sum_valid,
      value    => sum,
      is_right => open
    );

  advance : process (clk)

    procedure begin_fcs is
    begin
      state_r <= FCS;
      left_r  <= FCS_BYTES-1;
    end procedure begin_fcs;

    procedure take_beat is
    begin
      count_r <= count_r + 1;
      if is_final = '1' then
        spoiled_r <= s_axis_tuser(0) or not s_axis_tlast;
        drain_r   <= not s_axis_tlast;
        if is_padded = '1' then
          begin_fcs;
        else
          state_r <= PADDING;
        end if;
      end if;
    end procedure take_beat;

  begin
    if rising_edge(clk) then
      if drain_r = '1' and s_axis_tvalid = '1' and s_axis_tlast = '1' then
        drain_r <= '0';
      end if;
      if tx_step = '1' then
        if left_r /= 0 then
          left_r <= left_r - 1;
        end if;
        if state_r = IDLE then
          count_r   <= 0;
          spoiled_r <= '0';
          left_r    <= PREAMBLE_BYTES-1;
          if s_axis_tvalid = '1' and drain_r = '0' then
            state_r <= PREAMBLE;
          end if;
        elsif state_r = PREAMBLE then
          if left_r = 0 then
            state_r <= FRAME;
          end if;
        elsif state_r = FRAME then
          if s_axis_tvalid = '1' then
            take_beat;
          else
            -- The line does not wait: it shows any byte.
            spoiled_r <= '1';
            drain_r   <= '1';
            begin_fcs;
          end if;
        elsif state_r = PADDING then
          count_r <= count_r + 1;
          if is_padded = '1' then
            begin_fcs;
          end if;
        elsif left_r = 0 then
          state_r <= IDLE;
          if state_r = FCS then
            state_r <= GAP;
            left_r  <= GAP_BYTES-1;
          end if;
        end if;
      end if;
      if rst_n = '0' then
        state_r <= IDLE;
        drain_r <= '0';
        left_r  <= 0;
      end if;
    end if;
  end process advance;

  show : process (clk)
  begin
    if rising_edge(clk) then
      is_sent    <= '0';
      is_spoiled <= '0';
      if tx_step = '1' then
        tx_en <= '1';
        tx_er <= '0';
        txd   <= PREAMBLE_BYTE;
        if state_r = IDLE then
          tx_en <= s_axis_tvalid and not drain_r;
        elsif state_r = PREAMBLE then
          if left_r = 0 then
            txd <= START_BYTE;
          end if;
        elsif state_r = FRAME then
          txd <= s_axis_tdata;
        elsif state_r = PADDING then
          txd <= (others => '0');
        elsif state_r = FCS then
          txd   <= fcs_byte;
          tx_er <= spoiled_r;
          if left_r = 0 then
            is_sent    <= not spoiled_r;
            is_spoiled <= spoiled_r;
          end if;
        else
          tx_en <= '0';
        end if;
      end if;
      if rst_n = '0' then
        tx_en      <= '0';
        tx_er      <= '0';
        is_sent    <= '0';
        is_spoiled <= '0';
      end if;
    end if;
  end process show;

end architecture rtl;
