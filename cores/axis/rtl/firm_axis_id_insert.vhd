-- SPDX-License-Identifier: Apache-2.0
-- Converts ids of one byte to ids of two bytes: inserts `high` after the first byte of each frame. The frame's other
-- bytes move up by one lane, so a frame whose last beat is full gets one more beat. The paths from input to output are
-- combinational: put a register slice after it. The insertion adds no pause between beats of a frame.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_id_insert is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The upper byte of the frame's id, on every beat.
    high : in std_logic_vector(7 downto 0);

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_axis_id_insert;

architecture rtl of firm_axis_id_insert is

  signal first_r : std_logic;  -- the input's beat is the first of a frame
  signal extra_r : std_logic;  -- the input's beat has been sent, and one byte of it follows in a separate beat
  signal splits  : std_logic;  -- the input's beat becomes two beats
  signal ends    : std_logic;  -- the output's beat is the last one of the input's beat
  signal moves   : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_id_insert: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  byte_wide : if WIDTH = 8 generate
    splits       <= first_r;
    m_axis_tdata <= high when extra_r = '1' else s_axis_tdata;
    m_axis_tkeep <= "1";
  end generate byte_wide;

  wider : if WIDTH > 8 generate
    signal carry_r : std_logic_vector(7 downto 0);  -- the highest lane of the previous beat
    signal lowest  : std_logic_vector(7 downto 0);
    signal second  : std_logic_vector(7 downto 0);
  begin
    splits <= s_axis_tlast and s_axis_tkeep(WIDTH/8-1);

    keep_highest_lane : process (clk)
    begin
      if rising_edge(clk) then
        if moves = '1' then
          carry_r <= s_axis_tdata(WIDTH-1 downto WIDTH-8);
        end if;
      end if;
    end process keep_highest_lane;

    lowest <= s_axis_tdata(7 downto 0) when first_r = '1' and extra_r = '0' else carry_r;
    second <= high when first_r = '1' else s_axis_tdata(7 downto 0);

    m_axis_tdata(7 downto 0)  <= lowest;
    m_axis_tdata(15 downto 8) <= second;
    m_axis_tkeep(0)           <= '1';
    m_axis_tkeep(1)           <= (first_r or s_axis_tkeep(0)) and not extra_r;

    more_lanes : if WIDTH > 16 generate
      m_axis_tdata(WIDTH-1 downto 16)  <= s_axis_tdata(WIDTH-9 downto 8);
      m_axis_tkeep(WIDTH/8-1 downto 2) <= gated(s_axis_tkeep(WIDTH/8-2 downto 1), not extra_r);
    end generate more_lanes;
  end generate wider;

  ends  <= extra_r or not splits;
  moves <= s_axis_tvalid and m_axis_tready;

  count_beats : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        first_r <= '1';
        extra_r <= '0';
      elsif moves = '1' then
        extra_r <= not ends;
        if ends = '1' then
          first_r <= s_axis_tlast;
        end if;
      end if;
    end if;
  end process count_beats;

  s_axis_tready <= m_axis_tready and ends;
  m_axis_tvalid <= s_axis_tvalid;
  m_axis_tlast  <= s_axis_tlast and ends;
  m_axis_tuser  <= s_axis_tuser when ends = '1' else "0";

end architecture rtl;
