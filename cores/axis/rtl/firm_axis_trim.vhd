-- SPDX-License-Identifier: Apache-2.0
-- Makes a frame exactly as long as its header announces: excess bytes are dropped, and a frame that ends early is
-- padded. It is placed before firm_axis_pack and has the same ports on both sides. Its output is a register; only
-- `m_ready` reaches `ready` in the same cycle. The remaining bytes are counted with 32 bits, but compared with few:
-- they are less than two beats if they were before the previous piece, or they are enough for any piece.
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
    -- `ready` of a piece that is not `last`: it depends on neither of them, and is known earlier.
    piece_ready : out std_logic;

    -- Bytes were offered beyond the end of the frame, or it ended with more than SLACK bytes missing; both are a cycle
    -- late. `is_closed`: the frame was cut, so the rest of what is offered is dropped.
    is_cut    : out std_logic;
    is_filled : out std_logic;
    is_closed : out std_logic;

    m_data  : out std_logic_vector(WIDTH-1 downto 0);
    m_count : out std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    m_last  : out std_logic;
    m_valid : out std_logic;
    m_ready : in  std_logic
  );
end entity firm_axis_trim;

architecture rtl of firm_axis_trim is

  constant LANES      : natural  := WIDTH/8;
  -- Numbers below two beats have as many bits as a count.
  constant COUNT_BITS : positive := index_bits(LANES+1);

  subtype count_t is std_logic_vector(COUNT_BITS-1 downto 0);

  -- As LUTs, since Yosys makes a carry chain of `>`; and unknown bits give no warning.
  function is_more(left, right : count_t) return std_logic is
    variable more : std_logic := '0';
  begin
    for place in 0 to COUNT_BITS-1 loop
      more := (left(place) and not right(place)) or ((left(place) or not right(place)) and more);
    end loop;
    return more;
  end function is_more;

  -- The negated number of remaining bytes, minus one: all ones means none.
  signal left_r   : unsigned(31 downto 0) := (others => '1');
  signal near_r   : std_logic;  -- less than two beats remained before the previous piece
  signal closed_r : std_logic := '0';  -- the frame was cut
  signal open_r   : std_logic;  -- no length is announced: the frame may have any length

  signal wanted  : count_t;
  signal room    : count_t;    -- the remaining bytes, if they are few
  signal exceeds : std_logic;  -- fewer bytes remain than are offered
  signal ends    : std_logic;  -- less than a beat remains: `last` can be taken
  signal lacking : unsigned(32 downto 0);

  signal valid_r : std_logic;
  signal free    : std_logic;  -- the output takes a piece

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_trim: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  wanted  <= std_logic_vector(to_unsigned(LANES, COUNT_BITS)) when last = '1' else count;
  room    <= not std_logic_vector(left_r(COUNT_BITS-1 downto 0));
  exceeds <= closed_r or (near_r and is_more(wanted, room));
  ends    <= closed_r or open_r or (near_r and not room(COUNT_BITS-1));
  free    <= m_ready or not valid_r;
  ready   <= free and (ends or not last);

  piece_ready <= free;

  announced <= std_logic_vector(not left_r);
  is_closed <= closed_r;

  hold_piece : process (clk)
  begin
    if rising_edge(clk) then
      if free = '1' then
        m_data  <= data;
        m_last  <= last and ends;
        m_count <= wanted;
        if header = '0' and exceeds = '1' then
          m_count <= room;
        end if;
        if header = '0' and (closed_r = '1' or (last = '1' and open_r = '1')) then
          m_count <= (others => '0');
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      elsif free = '1' then
        valid_r <= valid;
      end if;
    end if;
  end process hold_piece;

  m_valid <= valid_r;

  count_down : process (clk)
  begin
    if rising_edge(clk) and valid = '1' and free = '1' then
      if start = '1' then
        left_r   <= not unsigned(length);
        near_r   <= are_ones(not length(31 downto COUNT_BITS));
        open_r   <= are_ones(length);
        closed_r <= '0';
      elsif header = '0' then
        left_r   <= left_r + unsigned(wanted);
        near_r   <= are_ones(std_logic_vector(left_r(31 downto COUNT_BITS)));
        closed_r <= exceeds;
      end if;
    end if;
  end process count_down;

  lacking <= ('0' & left_r) + (SLACK + 1);

  report_fault : process (clk)
  begin
    if rising_edge(clk) then
      is_cut    <= valid and exceeds and not last and not header;
      is_filled <= valid and last and not (lacking(32) or closed_r or open_r);
    end if;
  end process report_fault;

end architecture rtl;
