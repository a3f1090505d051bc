-- SPDX-License-Identifier: Apache-2.0
-- Forwards one of SOURCES streams: `source` selects it while `enable` is '1'. The multiplexer is purely combinational
-- and ignores frames: the driver of `source` keeps them whole (a scheduler), or a firm_axis_burst after it marks
-- bursts.
-- The lowest bits of an index control the first, most numerous multiplexers of a tree, so their wires are the longest.
-- Of more than 32 sources, `tvalid` and `tlast`, which return to the scheduler, have places whose numbers are the
-- indices with their halves exchanged: the wires of `tdata` then do not slow them down.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_mux is
  generic (
    WIDTH   : integer := 8;
    SOURCES : integer := 2
  );
  port (
    source : in std_logic_vector(index_bits(SOURCES)-1 downto 0);
    enable : in std_logic;

    -- Source 0 is in the lowest bits.
    s_axis_tdata  : in  std_logic_vector(SOURCES*WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(SOURCES*(WIDTH/8)-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(SOURCES-1 downto 0) := (others => '0');
    s_axis_tvalid : in  std_logic_vector(SOURCES-1 downto 0);
    s_axis_tlast  : in  std_logic_vector(SOURCES-1 downto 0);
    s_axis_tready : out std_logic_vector(SOURCES-1 downto 0);

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_axis_mux;

architecture rtl of firm_axis_mux is

  constant ID_BITS  : positive := index_bits(SOURCES);
  constant LOW_BITS : natural  := (ID_BITS / 2) * boolean'pos(SOURCES > 32);  -- exchanged with the others
  constant HIGH_END : positive := 2**(ID_BITS-LOW_BITS);
  -- One for each source; if halves are exchanged, one for each index.
  constant PLACES : integer := SOURCES + (2**ID_BITS - SOURCES) * boolean'pos(LOW_BITS > 0);
  subtype id_t is std_logic_vector(ID_BITS-1 downto 0);
  subtype places_t is std_logic_vector(PLACES-1 downto 0);

  function placed(bits : std_logic_vector(SOURCES-1 downto 0)) return std_logic_vector is
    variable found : places_t := (others => '0');
  begin
    for number in bits'range loop
      found(number / 2**LOW_BITS + number mod 2**LOW_BITS * HIGH_END) := bits(number);
    end loop;
    return found;
  end function placed;

  signal place         : id_t;
  signal placed_tvalid : places_t;
  signal placed_tlast  : places_t;
  signal chosen_tvalid : std_logic_vector(0 downto 0);
  signal chosen_tlast  : std_logic_vector(0 downto 0);
  signal take          : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_mux: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert SOURCES >= 1 and SOURCES <= 256
    report "firm_axis_mux: SOURCES is " & integer'image(SOURCES) & "; legal: 1 to 256"
    severity failure;

  u_select_tdata : entity firm.firm_axis_select
    generic map (
      WORDS   => SOURCES,
      WIDTH   => WIDTH,
      DECODED => true
    )
    port map (
      words_in => s_axis_tdata,
      index    => source,
      word     => m_axis_tdata
    );

  -- A beat of one byte is full.
  byte_wide : if WIDTH = 8 generate
    m_axis_tkeep <= "1";
  end generate byte_wide;

  wider : if WIDTH > 8 generate
    u_select_tkeep : entity firm.firm_axis_select
      generic map (
        WORDS   => SOURCES,
        WIDTH   => WIDTH/8,
        DECODED => true
      )
      port map (
        words_in => s_axis_tkeep,
        index    => source,
        word     => m_axis_tkeep
      );
  end generate wider;

  place         <= source(LOW_BITS-1 downto 0) & source(ID_BITS-1 downto LOW_BITS);
  placed_tvalid <= placed(s_axis_tvalid);
  placed_tlast  <= placed(s_axis_tlast);

  u_select_tlast : entity firm.firm_axis_select
    generic map (
      WORDS   => PLACES,
      WIDTH   => 1,
      DECODED => true
    )
    port map (
      words_in => placed_tlast,
      index    => place,
      word     => chosen_tlast
    );

  u_select_tuser : entity firm.firm_axis_select
    generic map (
      WORDS   => SOURCES,
      WIDTH   => 1,
      DECODED => true
    )
    port map (
      words_in => s_axis_tuser,
      index    => source,
      word     => m_axis_tuser
    );

  u_select_tvalid : entity firm.firm_axis_select
    generic map (
      WORDS   => PLACES,
      WIDTH   => 1,
      DECODED => true
    )
    port map (
      words_in => placed_tvalid,
      index    => place,
      word     => chosen_tvalid
    );

  take          <= enable and m_axis_tready;
  m_axis_tvalid <= enable and chosen_tvalid(0);
  m_axis_tlast  <= chosen_tlast(0);
  s_axis_tready <= decode(source, take, SOURCES);

end architecture rtl;
