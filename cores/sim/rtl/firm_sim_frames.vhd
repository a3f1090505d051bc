-- SPDX-License-Identifier: Apache-2.0
-- The host's end of a link, receiving: it decodes frames (COBS), checks their lengths and checksums, and passes each on
-- when it is complete. A broken frame ends the simulation. The memory is unbounded. Simulation only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_sim_link_pkg.all;

entity firm_sim_frames is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The last received byte, and the number of received bytes; they may change at any time, but at most once per
    -- cycle.
    data  : in std_logic_vector(7 downto 0);
    count : in natural;

    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tkeep  : out std_logic_vector(0 downto 0);
    m_axis_tid    : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_sim_frames;

architecture simulation of firm_sim_frames is

  constant HEADER_BYTES : positive := 5;

  type item_t;
  type item_ptr_t is access item_t;
  type item_t is record
    data      : std_logic_vector(7 downto 0);
    tid       : std_logic_vector(7 downto 0);
    is_last   : boolean;
    next_item : item_ptr_t;
  end record item_t;

  signal valid_r : std_logic := '0';

begin

  frame : process (clk)

    -- All waiting bytes, those of complete frames first.
    variable first  : item_ptr_t;
    variable newest : item_ptr_t;
    variable whole  : natural := 0;  -- bytes of complete frames

    variable taken  : natural := 0;  -- coded bytes so far
    variable left   : natural := 0;  -- remaining coded bytes of the block
    variable is_due : boolean := false;  -- a zero is between this block and the next one
    variable bytes  : natural := 0;  -- of the incoming frame, with its checksum
    variable header : unsigned(8*HEADER_BYTES-1 downto 0);
    variable crc    : crc_t   := CRC_START;

    impure function frame_bytes return natural is
    begin
      return HEADER_BYTES + to_integer(header(8*HEADER_BYTES-1 downto 8));
    end function frame_bytes;

    procedure take_byte(byte : in std_logic_vector(7 downto 0)) is
      variable item : item_ptr_t;
    begin
      crc := next_crc(crc, byte);
      if bytes < HEADER_BYTES then
        header(8*bytes+7 downto 8*bytes) := unsigned(byte);
      end if;
      bytes := bytes + 1;
      if bytes <= HEADER_BYTES or bytes <= frame_bytes then
        item := new item_t'(byte, std_logic_vector(header(7 downto 0)), false, null);
        if first = null then
          first := item;
        else
          newest.next_item := item;
        end if;
        newest := item;
      end if;
    end procedure take_byte;

    procedure end_frame is
    begin
      assert left = 0 and bytes >= HEADER_BYTES + CHECKSUM_BYTES and crc = CRC_RESIDUE
        report "firm_sim_frames: the system sent a frame whose code or checksum is wrong"
        severity failure;
      assert bytes = frame_bytes + CHECKSUM_BYTES
        report "firm_sim_frames: the system sent a frame whose length is wrong"
        severity failure;
      newest.is_last := true;
      whole          := whole + frame_bytes;
      bytes          := 0;
      is_due         := false;
      crc            := CRC_START;
    end procedure end_frame;

    procedure decode_byte is
    begin
      if data = x"00" then
        end_frame;
      elsif left = 0 then
        if is_due then
          take_byte(x"00");
        end if;
        left   := to_integer(unsigned(data)) - 1;
        is_due := data /= x"ff";
      else
        left := left - 1;
        take_byte(data);
      end if;
    end procedure decode_byte;

    procedure show_byte is
      variable shown : item_ptr_t;
    begin
      valid_r <= '0';
      if whole > 0 then
        shown        := first;
        first        := shown.next_item;
        whole        := whole - 1;
        valid_r      <= '1';
        m_axis_tdata <= shown.data;
        m_axis_tid   <= shown.tid;
        m_axis_tlast <= '0';
        if shown.is_last then
          m_axis_tlast <= '1';
        end if;
        deallocate(shown);
      end if;
    end procedure show_byte;

  begin
    if rising_edge(clk) and rst_n = '1' then
      if taken /= count then
        taken := taken + 1;
        decode_byte;
      end if;
      if valid_r = '0' or m_axis_tready = '1' then
        show_byte;
      end if;
    end if;
  end process frame;

  m_axis_tkeep  <= "1";
  m_axis_tvalid <= valid_r;

end architecture simulation;
