-- SPDX-License-Identifier: Apache-2.0
-- The host's end of a link, sending: it appends the checksum to each frame and encodes the frame (COBS). Simulation
-- only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_sim_link_pkg.all;

entity firm_sim_coder is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    data  : out std_logic_vector(7 downto 0);
    valid : out std_logic;
    ready : in  std_logic
  );
end entity firm_sim_coder;

architecture simulation of firm_sim_coder is

  constant FULL_BLOCK  : positive := 254;
  constant QUEUE_BYTES : positive := 1024;
  -- Bytes are taken from the host while fewer than this number wait: enough for the time in which a block fills, and
  -- few enough for the host never to wait longer than its watchdog.
  constant FEW         : positive := 16;

  subtype byte_t is std_logic_vector(7 downto 0);
  type bytes_t is array (natural range <>) of byte_t;

  signal ready_r : std_logic := '0';
  signal valid_r : std_logic := '0';

begin

  encode : process (clk)

    variable queue : bytes_t(0 to QUEUE_BYTES-1);
    variable first : natural := 0;
    variable count : natural := 0;

    variable content : bytes_t(0 to FULL_BLOCK-1);
    variable size    : natural := 0;
    variable is_open : boolean := true;  -- the frame does not end with the last block that was written
    variable crc     : crc_t   := CRC_START;

    procedure put(byte : in byte_t) is
    begin
      queue((first + count) mod QUEUE_BYTES) := byte;
      count                                  := count + 1;
    end procedure put;

    procedure end_block is
    begin
      put(std_logic_vector(to_unsigned(size + 1, 8)));
      for place in 0 to size-1 loop
        put(content(place));
      end loop;
      size := 0;
    end procedure end_block;

    procedure add(byte : in byte_t) is
    begin
      is_open := true;
      if byte = x"00" then
        end_block;
      else
        content(size) := byte;
        size          := size + 1;
        if size = FULL_BLOCK then
          end_block;
          is_open := false;
        end if;
      end if;
    end procedure add;

    procedure end_frame is
      variable checksum : crc_t := not crc;
    begin
      for place in 0 to CHECKSUM_BYTES-1 loop
        add(checksum(8*place+7 downto 8*place));
      end loop;
      if is_open then
        end_block;
      end if;
      put(x"00");
      is_open := true;
      crc     := CRC_START;
    end procedure end_frame;

  begin
    if rising_edge(clk) and rst_n = '1' then
      if s_axis_tvalid = '1' and ready_r = '1' then
        crc := next_crc(crc, s_axis_tdata);
        add(s_axis_tdata);
        if s_axis_tlast = '1' then
          end_frame;
        end if;
      end if;
      if valid_r = '0' or ready = '1' then
        valid_r <= '0';
        if count > 0 then
          valid_r <= '1';
          data    <= queue(first);
          first   := (first + 1) mod QUEUE_BYTES;
          count   := count - 1;
        end if;
      end if;
      ready_r <= '0';
      if count < FEW then
        ready_r <= '1';
      end if;
    end if;
  end process encode;

  s_axis_tready <= ready_r;
  valid         <= valid_r;

end architecture simulation;
