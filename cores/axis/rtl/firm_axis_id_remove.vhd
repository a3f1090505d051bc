-- SPDX-License-Identifier: Apache-2.0
-- Converts ids of two bytes to ids of one byte: removes the second byte of each frame, which is `high` on the frame's
-- first beat. The frame's other bytes move down by one lane, so a frame whose last beat has one byte loses this beat.
-- A lane that is not kept stays one, so a broken beat reaches the receiver as a broken beat. The part stores one beat
-- and accepts a beat in every cycle; paths from input to output are combinational, as in the demux.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_id_remove is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- Valid on the first beat of a frame: the upper byte of its id, and '0' if the frame ends before this byte.
    high     : out std_logic_vector(7 downto 0);
    has_high : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_axis_id_remove;

architecture rtl of firm_axis_id_remove is

  signal first_r : std_logic;  -- the output's beat is the first of a frame
  signal held_r  : std_logic;  -- the registers below hold a beat
  signal data_r  : std_logic_vector(WIDTH-1 downto 0);
  signal keep_r  : std_logic_vector(WIDTH/8-1 downto 0);
  signal user_r  : std_logic_vector(0 downto 0);
  signal last_r  : std_logic;

  signal merges : std_logic;  -- the input's beat leaves with the held one
  signal stores : std_logic;
  signal valid  : std_logic;
  signal last   : std_logic;
  signal ready  : std_logic;
  signal moves  : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_id_remove: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  -- At 8 bits, only the first beat is held, until the second one follows; the others pass.
  byte_wide : if WIDTH = 8 generate
    merges       <= not (held_r and last_r);
    stores       <= s_axis_tvalid and first_r and not held_r;
    valid        <= (held_r and last_r) or (s_axis_tvalid and (held_r or not first_r));
    last         <= s_axis_tlast when merges = '1' else '1';
    ready        <= (first_r and not held_r) or (m_axis_tready and merges);
    high         <= s_axis_tdata;
    has_high     <= merges;
    m_axis_tdata <= data_r when held_r = '1' else s_axis_tdata;
    m_axis_tkeep <= "1";
  end generate byte_wide;

  wider : if WIDTH > 8 generate
    constant LANES : positive := WIDTH/8;
  begin
    -- A last beat with only its lowest byte is merged into the held beat. Any other last beat is sent separately, even
    -- if its tkeep is zero.
    merges   <= s_axis_tlast and s_axis_tkeep(0) and not s_axis_tkeep(1) and held_r and not last_r;
    stores   <= s_axis_tvalid and ready and not merges;
    valid    <= held_r and (last_r or s_axis_tvalid);
    last     <= last_r or merges;
    ready    <= not held_r or (m_axis_tready and valid);
    high     <= data_r(15 downto 8);
    has_high <= keep_r(1);

    m_axis_tdata(7 downto 0)             <= data_r(7 downto 0) when first_r = '1' else data_r(15 downto 8);
    m_axis_tkeep(0)                      <= keep_r(0) when first_r = '1' else keep_r(1);
    m_axis_tdata(WIDTH-1 downto WIDTH-8) <= gated(s_axis_tdata(7 downto 0), not last_r);
    m_axis_tkeep(LANES-1)                <= s_axis_tkeep(0) and not last_r;

    more_lanes : if WIDTH > 16 generate
      m_axis_tdata(WIDTH-9 downto 8) <= data_r(WIDTH-1 downto 16);
      m_axis_tkeep(LANES-2 downto 1) <= keep_r(LANES-1 downto 2);
    end generate more_lanes;
  end generate wider;

  moves <= valid and m_axis_tready;

  hold_beat : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        first_r <= '1';
        held_r  <= '0';
      else
        held_r <= stores or (held_r and not moves);
        if moves = '1' then
          first_r <= last;
        end if;
      end if;
      if stores = '1' then
        data_r <= s_axis_tdata;
        keep_r <= s_axis_tkeep;
        user_r <= s_axis_tuser;
        last_r <= s_axis_tlast;
      end if;
    end if;
  end process hold_beat;

  s_axis_tready <= ready;
  m_axis_tvalid <= valid;
  m_axis_tlast  <= last;
  m_axis_tuser  <= user_r when last_r = '1' and held_r = '1' else gated(s_axis_tuser, last);

end architecture rtl;
