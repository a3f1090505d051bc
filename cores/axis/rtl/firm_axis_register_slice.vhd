-- SPDX-License-Identifier: Apache-2.0
-- Cuts every path of a stream at the full rate of a beat per cycle. All outputs are registered, including
-- `s_axis_tready`. As this is a cycle late, a second register holds the beat that arrives when the output has just
-- stalled. `m_axis_tid` is the frame's id, the lowest byte of its first beat, on every beat; adding it here needs
-- neither logic nor a second register. `tuser` carries any other data: with a frame, bit 0 of the last beat marks an
-- aborted one. Either costs nothing if left open.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_register_slice is
  generic (
    WIDTH     : integer := 8;
    USER_BITS : integer := 1
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(USER_BITS-1 downto 0) := (others => '0');
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(USER_BITS-1 downto 0);
    m_axis_tid    : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_axis_register_slice;

architecture rtl of firm_axis_register_slice is

  type beat_t is record
    tdata : std_logic_vector(WIDTH-1 downto 0);
    tkeep : std_logic_vector(WIDTH/8-1 downto 0);
    tuser : std_logic_vector(USER_BITS-1 downto 0);
    tlast : std_logic;
  end record beat_t;

  signal arriving  : beat_t;
  signal next_beat : beat_t;
  signal output_r  : beat_t;
  signal skid_r    : beat_t;
  signal id_r      : std_logic_vector(7 downto 0);
  signal valid_r   : std_logic;
  signal ready_r   : std_logic;

  signal skidded   : std_logic;  -- skid_r holds a beat
  signal available : std_logic;  -- next_beat is valid
  signal move      : std_logic;  -- the output is free for it

begin

  assert USER_BITS >= 1
    report "firm_axis_register_slice: USER_BITS is " & integer'image(USER_BITS) & "; legal: 1 or more"
    severity failure;
  assert is_stream_width(WIDTH)
    report "firm_axis_register_slice: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  arriving.tdata <= s_axis_tdata;
  arriving.tkeep <= s_axis_tkeep;
  arriving.tuser <= s_axis_tuser;
  arriving.tlast <= s_axis_tlast;

  -- `ready_r` is low without a beat in the output only in reset.
  skidded   <= valid_r and not ready_r;
  next_beat <= skid_r when skidded = '1' else arriving;
  available <= skidded or (s_axis_tvalid and ready_r);
  move      <= m_axis_tready or not valid_r;

  move_beats : process (clk)
  begin
    if rising_edge(clk) then
      if ready_r = '1' then
        skid_r <= arriving;
      end if;
      -- Without a beat, the moved data are ignored, so that the path to the many registers is short.
      if move = '1' then
        output_r <= next_beat;
      end if;
      -- But the output keeps its last beat's `tlast`, which marks the next one as a first one.
      if available = '0' then
        output_r.tlast <= output_r.tlast;
      elsif move = '1' and output_r.tlast = '1' then
        id_r <= next_beat.tdata(7 downto 0);
      end if;
      if rst_n = '0' then
        output_r.tlast <= '1';
      end if;
    end if;
  end process move_beats;

  track_beats : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        valid_r <= '0';
        ready_r <= '0';
      elsif move = '1' then
        valid_r <= available;
        ready_r <= '1';
      elsif s_axis_tvalid = '1' then
        ready_r <= '0';
      end if;
    end if;
  end process track_beats;

  s_axis_tready <= ready_r;
  m_axis_tdata  <= output_r.tdata;
  m_axis_tkeep  <= output_r.tkeep;
  m_axis_tuser  <= output_r.tuser;
  m_axis_tid    <= id_r;
  m_axis_tlast  <= output_r.tlast;
  m_axis_tvalid <= valid_r;

end architecture rtl;
