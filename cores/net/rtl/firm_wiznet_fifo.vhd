-- SPDX-License-Identifier: Apache-2.0
-- A FIFO of 64 bytes, which reports to its reader that it holds the next 64 bytes of a frame or the frame's end, and to
-- its writer that it is empty. Neither therefore waits in the middle of a transfer.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_wiznet_fifo is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    is_empty : out std_logic;
    has_part : out std_logic
  );
end entity firm_wiznet_fifo;

architecture rtl of firm_wiznet_fifo is

  -- The output holds one byte; of the memory's places, one is never used.
  type memory_t is array (0 to 63) of std_logic_vector(9 downto 0);
  signal memory_r : memory_t;

  signal write_r : unsigned(5 downto 0);
  signal read_r  : unsigned(5 downto 0);
  signal level_r : unsigned(5 downto 0);                 -- bytes in the memory
  signal ends_r  : unsigned(6 downto 0);                 -- ends of frames, that at the output included
  signal valid_r : std_logic;
  signal shown_r : std_logic_vector(9 downto 0);

  signal write : std_logic;
  signal read  : std_logic;                              -- from the memory to the output
  signal ready : std_logic;
  signal entry : std_logic;                              -- an end enters
  signal leave : std_logic;                              -- an end leaves

  -- A write needs room and a read needs a byte, so they never have the same address.
  attribute syn_ramstyle of memory_r      : signal is "no_rw_check";
  attribute rw_addr_collision of memory_r : signal is "no";

begin

  ready <= '0' when level_r = 63 else rst_n;              -- in reset, the source waits
  write <= s_axis_tvalid and ready;
  read  <= '1' when level_r /= 0 and (valid_r = '0' or m_axis_tready = '1') else '0';
  entry <= write and s_axis_tlast;
  leave <= valid_r and m_axis_tready and shown_r(8);

  s_axis_tready   <= ready;
  m_axis_tdata    <= shown_r(7 downto 0);
  m_axis_tlast    <= shown_r(8);
  m_axis_tuser(0) <= shown_r(9);
  m_axis_tvalid   <= valid_r;
  is_empty        <= '1' when valid_r = '0' and level_r = 0 else '0';
  has_part        <= '1' when valid_r = '1' and (level_r = 63 or ends_r /= 0) else '0';

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if write = '1' then
        memory_r(to_integer(write_r)) <= s_axis_tuser & s_axis_tlast & s_axis_tdata;
      end if;
      if read = '1' then
        shown_r <= memory_r(to_integer(read_r));
      end if;
    end if;
  end process access_memory;

  count : process (clk)
  begin
    if rising_edge(clk) then
      if write = '1' then
        write_r <= write_r + 1;
      end if;
      if read = '1' then
        read_r  <= read_r + 1;
        valid_r <= '1';
      elsif m_axis_tready = '1' then
        valid_r <= '0';
      end if;
      if write = '1' and read = '0' then
        level_r <= level_r + 1;
      elsif write = '0' and read = '1' then
        level_r <= level_r - 1;
      end if;
      if entry = '1' and leave = '0' then
        ends_r <= ends_r + 1;
      elsif entry = '0' and leave = '1' then
        ends_r <= ends_r - 1;
      end if;
      if rst_n = '0' then
        write_r <= (others => '0');
        read_r  <= (others => '0');
        level_r <= (others => '0');
        ends_r  <= (others => '0');
        valid_r <= '0';
      end if;
    end if;
  end process count;

end architecture rtl;
