-- SPDX-License-Identifier: Apache-2.0
-- Starts the packets of a node: those that the program requests, and at once the packet of a new sample, if the program
-- has prepared it and the sample needs no fragments. Such a packet has a separate bank of fields, with the number of
-- the writer, so it only waits for the sample. Fields of a bank may be changed while no packet is prepared in it.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_sender is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Of the program, which waits while `waits` is high: the packet of a writer's next sample, or 0 if none is
    -- prepared, since the sample has no reader or the program sends it; the slot of the payload of the next packet; the
    -- packet to send.
    prepare_valid     : in  std_logic;
    prepare_writer    : in  std_logic_vector(2 downto 0);
    chosen_slot_valid : in  std_logic;
    send_valid        : in  std_logic;
    data              : in  std_logic_vector(7 downto 0);
    waits             : out std_logic;  -- a packet is being sent, or will be

    -- Of firm_rtps_history: a sample arrives, and is complete from the next cycle on.
    comes       : in  std_logic;
    is_new_long : in  std_logic;  -- with `comes`: it needs fragments
    writer      : in  std_logic_vector(2 downto 0);
    is_started  : out std_logic;  -- the packet of the last sample was prepared, and begins
    is_long     : out std_logic;  -- the last sample needs fragments
    shows       : out std_logic;
    shows_new   : out std_logic;  -- the last sample, and not that of `slot`
    slot        : out std_logic_vector(7 downto 0);

    -- To firm_packet_builder. `packet` is a number of fusesoc_firm.fabric.packets.
    start       : out std_logic;
    packet      : out std_logic_vector(7 downto 0);
    bank        : out std_logic_vector(RTPS_BANK_BITS-1 downto 0);
    has_payload : out std_logic;  -- the packet that leaves
    is_busy     : in  std_logic
  );
end entity firm_rtps_sender;

architecture rtl of firm_rtps_sender is

  -- The packet without a payload that has this number is never prepared.
  constant NO_PACKET : std_logic_vector(7 downto 0) := x"00";

  type packets_t is array (natural range 0 to 7) of std_logic_vector(7 downto 0);

  signal prepared    : packets_t := (others => NO_PACKET);
  signal of_writer   : std_logic_vector(7 downto 0);
  signal is_prepared : std_logic;
  signal started_r   : std_logic;
  signal long_r      : std_logic;
  signal sample_r    : std_logic;  -- a new sample's packet is to begin
  signal sample_is_r : std_logic_vector(7 downto 0) := (others => '0');
  signal asked_r     : std_logic;  -- the program's packet is to begin
  signal asked_is_r  : std_logic_vector(7 downto 0) := (others => '0');
  signal slot_r      : std_logic_vector(7 downto 0) := (others => '0');
  signal chosen_r    : std_logic;  -- the program's packet has a payload
  signal payload_r   : std_logic;
  signal begins      : std_logic;

begin

  of_writer   <= prepared(to_integer(unsigned(writer)));
  is_prepared <= '0' when of_writer = NO_PACKET else '1';
  begins      <= (sample_r or asked_r) and not is_busy;

  keep_prepared : process (clk)
  begin
    if rising_edge(clk) then
      if prepare_valid = '1' then
        prepared(to_integer(unsigned(prepare_writer))) <= data;
      end if;
    end if;
  end process keep_prepared;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      if comes = '1' then
        started_r   <= is_prepared and not is_new_long;
        long_r      <= is_new_long;
        sample_r    <= is_prepared and not is_new_long;
        sample_is_r <= of_writer;
      elsif is_busy = '0' then
        sample_r <= '0';
      end if;
      if send_valid = '1' then
        asked_r    <= '1';
        asked_is_r <= data;
      elsif is_busy = '0' and sample_r = '0' then
        asked_r <= '0';
      end if;
      if chosen_slot_valid = '1' then
        slot_r   <= data;
        chosen_r <= '1';
      elsif begins = '1' and sample_r = '0' then
        chosen_r <= '0';
      end if;
      -- Other packets have no payload.
      if is_busy = '0' then
        payload_r <= sample_r or (asked_r and chosen_r);
      end if;
      if rst_n = '0' then
        started_r <= '0';
        long_r    <= '0';
        sample_r  <= '0';
        asked_r   <= '0';
        chosen_r  <= '0';
        payload_r <= '0';
      end if;
    end if;
  end process choose;

  waits       <= is_busy or sample_r or asked_r;
  is_started  <= started_r;
  is_long     <= long_r;
  shows       <= begins;
  shows_new   <= sample_r;
  slot        <= slot_r;
  start       <= sample_r or asked_r;
  packet      <= sample_is_r when sample_r = '1' else asked_is_r;
  bank        <= '0' & writer when sample_r = '1' else RTPS_OWN_BANK;
  has_payload <= payload_r;

end architecture rtl;
