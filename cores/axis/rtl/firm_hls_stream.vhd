-- SPDX-License-Identifier: Apache-2.0
-- Converts the elements that an HLS kernel writes as into a FIFO (`ap_fifo`) to the stream of a string or an array, an
-- element per cycle. The kernel writes after the length is known; elements beyond the length are dropped.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;

entity firm_hls_stream is
  generic (
    -- Of an element: 8, 16, 32 or 64.
    BITS  : integer := 8;
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- While it is low, no message is in progress.
    is_open : in std_logic;

    length       : in std_logic_vector(31 downto 0);
    length_valid : in std_logic;

    din    : in  std_logic_vector(BITS-1 downto 0);
    full_n : out std_logic;
    write  : in  std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_hls_stream;

architecture rtl of firm_hls_stream is

  signal runs    : std_logic;
  signal count_r : unsigned(31 downto 0);
  signal is_over : std_logic;  -- all elements have arrived
  signal is_last : std_logic;
  signal enters  : std_logic;

  signal slice_ready    : std_logic;
  signal element_tdata  : std_logic_vector(BITS-1 downto 0);
  signal element_tkeep  : std_logic_vector(BITS/8-1 downto 0);
  signal element_tvalid : std_logic;
  signal element_tlast  : std_logic;
  signal element_tready : std_logic;

  constant FULL : std_logic_vector(BITS/8-1 downto 0) := (others => '1');

begin

  runs    <= rst_n and is_open;
  is_over <= '1' when count_r = unsigned(length) else '0';
  is_last <= '1' when count_r + 1 = unsigned(length) else '0';
  full_n  <= length_valid and (slice_ready or is_over);
  enters  <= write and length_valid and not is_over;

  count : process (clk)
  begin
    if rising_edge(clk) then
      if runs = '0' then
        count_r <= (others => '0');
      elsif enters = '1' and slice_ready = '1' then
        count_r <= count_r + 1;
      end if;
    end if;
  end process count;

  -- This cuts a possible path in the kernel from `full_n` to `write`.
  u_slice : entity firm.firm_axis_register_slice
    generic map (
      WIDTH => BITS
    )
    port map (
      clk           => clk,
      rst_n         => runs,
      s_axis_tdata  => din,
      s_axis_tkeep  => FULL,
      s_axis_tvalid => enters,
      s_axis_tlast  => is_last,
      s_axis_tready => slice_ready,
      m_axis_tdata  => element_tdata,
      m_axis_tkeep  => element_tkeep,
      m_axis_tuser  => open,
      m_axis_tid    => open,
      m_axis_tvalid => element_tvalid,
      m_axis_tlast  => element_tlast,
      m_axis_tready => element_tready
    );

  u_resize : entity firm.firm_axis_resize
    generic map (
      S_WIDTH => BITS,
      M_WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      is_open       => is_open,
      s_axis_tdata  => element_tdata,
      s_axis_tkeep  => element_tkeep,
      s_axis_tvalid => element_tvalid,
      s_axis_tlast  => element_tlast,
      s_axis_tready => element_tready,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

end architecture rtl;
