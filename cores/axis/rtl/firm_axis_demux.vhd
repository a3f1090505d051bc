-- SPDX-License-Identifier: Apache-2.0
-- Removes the id from a frame and routes the rest to one of DESTINATIONS. Data is broadcast, only `tvalid` and
-- `tready` are decoded. At 8 bits the id's beat ends here. Wider streams keep the beat, with an invalid lowest lane
-- (the bytes are still there, `tkeep` is unchanged), so that nothing needs realignment. A frame with an unknown id, or
-- with only an id at 8 bits, is dropped, and `id_error` pulses in the cycle after its first beat. The paths from input
-- to output are combinational: put a register slice in front. For ids of two bytes, the upper one, which a
-- firm_axis_id_remove has removed, is `high`.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_demux is
  generic (
    WIDTH        : integer := 8;
    DESTINATIONS : integer := 2
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Valid on the first beat of a frame: the upper byte of the id, and whether the frame has one.
    high     : in std_logic_vector(7 downto 0) := x"00";
    has_high : in std_logic                    := '1';

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- Shared by all destinations.
    m_axis_tdata : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser : out std_logic_vector(0 downto 0);
    m_axis_tlast : out std_logic;
    -- One bit per destination.
    m_axis_tvalid : out std_logic_vector(DESTINATIONS-1 downto 0);
    m_axis_tready : in  std_logic_vector(DESTINATIONS-1 downto 0);

    -- The same beats, for a listener: offered, accepted, and the number of their destination.
    offered  : out std_logic;
    beat     : out std_logic;
    selected : out std_logic_vector(index_bits(DESTINATIONS)-1 downto 0);

    id_error : out std_logic
  );
end entity firm_axis_demux;

architecture rtl of firm_axis_demux is

  constant INDEX_BITS_USED : positive := index_bits(DESTINATIONS);

  signal first_r : std_logic;  -- the next beat is the first of a frame
  signal index_r : std_logic_vector(INDEX_BITS_USED-1 downto 0);
  signal known_r : std_logic;

  signal id       : std_logic_vector(15 downto 0);  -- the lowest lane, read as an id
  signal known_id : std_logic;                      -- it belongs to a destination
  signal index    : std_logic_vector(INDEX_BITS_USED-1 downto 0);
  signal forward  : std_logic;  -- this beat goes to a destination
  signal valid    : std_logic;
  signal ready    : std_logic_vector(0 downto 0);
  signal taken    : std_logic;

  signal s_axis_tready_out : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_demux: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert DESTINATIONS >= 1 and DESTINATIONS <= 65536
    report "firm_axis_demux: DESTINATIONS is " & integer'image(DESTINATIONS) & "; legal: 1 to 65536"
    severity failure;

  id       <= high & s_axis_tdata(7 downto 0);
  known_id <= is_below(id, DESTINATIONS) and has_high;

  byte_wide : if WIDTH = 8 generate
    index   <= index_r;
    forward <= known_r and not first_r;
  end generate byte_wide;

  wider : if WIDTH > 8 generate
    index   <= id(INDEX_BITS_USED-1 downto 0) when first_r = '1' else index_r;
    forward <= known_id when first_r = '1' else known_r;
  end generate wider;

  u_select_ready : entity firm.firm_axis_select
    generic map (
      WORDS   => DESTINATIONS,
      WIDTH   => 1,
      DECODED => true
    )
    port map (
      words_in => m_axis_tready,
      index    => index,
      word     => ready
    );

  valid             <= s_axis_tvalid and forward;
  s_axis_tready_out <= ready(0) or not forward;
  taken             <= s_axis_tvalid and s_axis_tready_out;

  remember_destination : process (clk)
  begin
    if rising_edge(clk) then
      id_error <= '0';
      if rst_n = '0' then
        first_r <= '1';
      elsif taken = '1' then
        first_r <= s_axis_tlast;
        if first_r = '1' then
          id_error <= not known_id;
          if WIDTH = 8 and s_axis_tlast = '1' then
            id_error <= '1';
          end if;
        end if;
      end if;
      if first_r = '1' then
        index_r <= id(INDEX_BITS_USED-1 downto 0);
        known_r <= known_id;
      end if;
    end if;
  end process remember_destination;

  offered  <= valid;
  beat     <= valid and ready(0);
  selected <= index;

  s_axis_tready <= s_axis_tready_out;
  m_axis_tdata  <= s_axis_tdata;
  m_axis_tkeep  <= s_axis_tkeep;
  m_axis_tuser  <= s_axis_tuser;
  m_axis_tlast  <= s_axis_tlast;
  m_axis_tvalid <= decode(index, valid, DESTINATIONS);

end architecture rtl;
