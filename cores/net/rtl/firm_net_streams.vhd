-- SPDX-License-Identifier: Apache-2.0
-- Connects a system's two streams of frames, of any width, to streams of bytes: those of a node in fabric.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_net_streams is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Frames of the node, never aborted.
    to_tdata  : in  std_logic_vector(7 downto 0);
    to_tvalid : in  std_logic;
    to_tlast  : in  std_logic;
    to_tready : out std_logic;

    -- The same, to the system.
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

    -- The same, to the node. A frame that ends without a byte is aborted or broken; a void byte has the mark.
    from_tdata  : out std_logic_vector(7 downto 0);
    from_tuser  : out std_logic_vector(0 downto 0);
    from_tvalid : out std_logic;
    from_tlast  : out std_logic;
    from_tready : in  std_logic
  );
end entity firm_net_streams;

architecture rtl of firm_net_streams is

begin

  assert is_stream_width(WIDTH)
    report "firm_net_streams: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  bytes : if WIDTH = 8 generate
    from_tdata    <= s_axis_tdata;
    from_tuser    <= s_axis_tuser;
    from_tvalid   <= s_axis_tvalid;
    from_tlast    <= s_axis_tlast;
    s_axis_tready <= from_tready;
    m_axis_tdata  <= to_tdata;
    m_axis_tkeep  <= "1";
    m_axis_tuser  <= "0";
    m_axis_tvalid <= to_tvalid;
    m_axis_tlast  <= to_tlast;
    to_tready     <= m_axis_tready;
  end generate bytes;

  words : if WIDTH > 8 generate

    constant COUNT_BITS : positive := clog2(WIDTH/8+1);
    -- The counts of one byte and of zero bytes.
    constant ONE        : std_logic_vector(COUNT_BITS-1 downto 0) := (0 => '1', others => '0');
    constant NONE       : std_logic_vector(COUNT_BITS-1 downto 0) := (others => '0');

    signal lanes     : std_logic_vector(WIDTH-1 downto 0);
    signal window    : std_logic_vector(WIDTH-1 downto 0);
    signal available : std_logic_vector(COUNT_BITS-1 downto 0);
    signal is_last   : std_logic;  -- the frame ends with the available bytes
    signal valid     : std_logic;
    signal take      : std_logic;

    signal ends_aborted : std_logic;
    signal ends_broken  : std_logic;

  begin

    fill_lane : process (to_tdata)
    begin
      lanes             <= (others => '0');
      lanes(7 downto 0) <= to_tdata;
    end process fill_lane;

    u_pack : entity firm.firm_axis_pack
      generic map (
        WIDTH => WIDTH
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        data          => lanes,
        count         => ONE,
        last          => to_tlast,
        valid         => to_tvalid,
        ready         => to_tready,
        m_axis_tdata  => m_axis_tdata,
        m_axis_tkeep  => m_axis_tkeep,
        m_axis_tuser  => m_axis_tuser,
        m_axis_tvalid => m_axis_tvalid,
        m_axis_tlast  => m_axis_tlast,
        m_axis_tready => m_axis_tready
      );

    u_window : entity firm.firm_axis_window
      generic map (
        WIDTH => WIDTH
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => s_axis_tdata,
        s_axis_tkeep  => s_axis_tkeep,
        s_axis_tuser  => s_axis_tuser,
        s_axis_tvalid => s_axis_tvalid,
        s_axis_tlast  => s_axis_tlast,
        s_axis_tready => s_axis_tready,
        window        => window,
        available     => available,
        is_last       => is_last,
        is_aborted    => ends_aborted,
        is_broken     => ends_broken,
        shown         => open,
        ends          => open,
        take_valid    => take,
        take          => ONE,
        skip          => '0'
      );

    from_tdata    <= window(7 downto 0);
    from_tuser(0) <= ends_aborted or ends_broken;
    from_tlast    <= is_last when available = NONE or available = ONE else '0';
    from_tvalid   <= valid;

    valid <= is_last when available = NONE else '1';
    take  <= valid and from_tready;

  end generate words;

end architecture rtl;
