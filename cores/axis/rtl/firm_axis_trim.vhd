-- SPDX-License-Identifier: Apache-2.0
-- Makes a frame exactly as long as its header announces: excess bytes are dropped, and a frame that ends early is
-- padded. It is placed before firm_axis_pack and has the same ports on both sides; all paths through it are
-- combinational. One adder does both: it counts up to zero, and its carry tells when more is offered than remains.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_trim is
  generic (
    WIDTH : integer := 8;
    -- The number of padding bytes that is not a fault.
    SLACK : natural := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The number of bytes that must follow the header. `start` takes it together with the first bytes of a frame. Bytes
    -- marked by `header` belong to the header and are not counted; until its end, `announced` is the length that was
    -- taken.
    length    : in  std_logic_vector(31 downto 0);
    start     : in  std_logic;
    header    : in  std_logic;
    announced : out std_logic_vector(31 downto 0);

    -- As at firm_axis_pack, but `last` comes without bytes: the frame ends before it. The lanes of `data` then pad a
    -- frame that is too short, and must be zeros.
    data  : in  std_logic_vector(WIDTH-1 downto 0);
    count : in  std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    last  : in  std_logic;
    valid : in  std_logic;
    ready : out std_logic;

    -- Bytes are offered beyond the end of the frame, or it ended with more than SLACK bytes missing.
    is_cut    : out std_logic;
    is_filled : out std_logic;

    m_data  : out std_logic_vector(WIDTH-1 downto 0);
    m_count : out std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    m_last  : out std_logic;
    m_valid : out std_logic;
    m_ready : in  std_logic
  );
end entity firm_axis_trim;

architecture rtl of firm_axis_trim is

  constant LANES      : natural  := WIDTH/8;
  constant COUNT_BITS : positive := index_bits(LANES+1);

  -- The negated number of remaining bytes, minus one: all ones means none.
  signal left_r : unsigned(31 downto 0) := (others => '1');

  signal wanted  : unsigned(COUNT_BITS-1 downto 0);
  signal sum     : unsigned(32 downto 0);
  signal exceeds : std_logic;  -- fewer bytes remain than are offered
  signal open_r  : std_logic;  -- no length is announced: the frame may have any length
  signal ends    : std_logic;  -- the frame ends in this cycle, if it is taken
  signal lacking : unsigned(32 downto 0);

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_trim: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  wanted  <= to_unsigned(LANES, COUNT_BITS) when last = '1' else unsigned(count);
  sum     <= ('0' & left_r) + wanted;
  exceeds <= sum(32);
  ends    <= last and (exceeds or open_r);

  pass : process (header, exceeds, wanted, left_r, last, open_r)
  begin
    m_count <= std_logic_vector(wanted);
    if header = '0' and exceeds = '1' then
      m_count <= std_logic_vector(not left_r(COUNT_BITS-1 downto 0));
    end if;
    if last = '1' and open_r = '1' then
      m_count <= (others => '0');
    end if;
  end process pass;

  announced <= std_logic_vector(not left_r);

  m_data  <= data;
  m_last  <= ends;
  m_valid <= valid;
  ready   <= m_ready and (ends or not last);

  lacking   <= ('0' & left_r) + (SLACK + 1);
  is_cut    <= valid and exceeds and not last and not header;
  is_filled <= valid and last and not lacking(32) and not open_r;

  count_down : process (clk)
  begin
    if rising_edge(clk) and valid = '1' and m_ready = '1' then
      if start = '1' then
        left_r <= not unsigned(length);
        open_r <= '0';
        if unsigned(not length) = 0 then
          open_r <= '1';
        end if;
      elsif header = '0' then
        left_r <= sum(31 downto 0);
        if exceeds = '1' or ends = '1' then
          left_r <= (others => '1');
        end if;
      end if;
    end if;
  end process count_down;

end architecture rtl;
