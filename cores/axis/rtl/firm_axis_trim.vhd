-- SPDX-License-Identifier: Apache-2.0
-- Checks that a frame has the length in its header. A frame that is shorter or longer, or whose source reports a fault,
-- ends with an abort at once, and the remaining input is dropped. It is placed before firm_axis_pack and has the same
-- ports on both sides. Its output is a register; only `m_ready` reaches `ready` in the same cycle. The remaining bytes
-- are counted with 32 bits, but compared with few: they are less than two beats if they were before the previous piece,
-- or they are enough for any piece.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_trim is
  generic (
    WIDTH : integer := 8;
    -- The number of bytes that padding may add.
    SLACK : natural := 0;
    -- The greatest length, less than 2**30; 0: any. A frame that announces more is aborted after its first bytes.
    MAX_LENGTH : natural := 0
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

    -- As at firm_axis_pack, but `last` comes without bytes: the frame ends before it. The lanes of `data` are then its
    -- padding, and must be zeros. `abort` comes with `last`. A pulse of `fault` aborts the frame, too; it comes after
    -- the header and not after `last`.
    data  : in  std_logic_vector(WIDTH-1 downto 0);
    count : in  std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    last  : in  std_logic;
    abort : in  std_logic := '0';
    fault : in  std_logic := '0';
    valid : in  std_logic;
    ready : out std_logic;
    -- `ready` of a piece that is not `last`: it depends on neither of them, and is known earlier.
    piece_ready : out std_logic;

    -- Bytes were offered beyond the frame's end, or it ended with more bytes missing than padding may add; both are a
    -- cycle late. `is_closed`: the frame was aborted, so the rest of what is offered is dropped. `is_refused` pulses in
    -- the cycle after `start` for a length above MAX_LENGTH.
    is_cut     : out std_logic;
    is_lacking : out std_logic;
    is_closed  : out std_logic;
    is_refused : out std_logic;

    m_data  : out std_logic_vector(WIDTH-1 downto 0);
    m_count : out std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    m_last  : out std_logic;
    m_abort : out std_logic;
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
  signal left_r    : unsigned(31 downto 0) := (others => '1');
  signal near_r    : std_logic;         -- less than two beats remained before the previous piece
  signal open_r    : std_logic;         -- no length is announced: the frame may have any length
  signal closed_r  : std_logic := '0';  -- the frame was aborted
  signal failed_r  : std_logic := '0';  -- it still has to be aborted
  signal is_failed : std_logic;
  signal cut_r     : std_logic;
  signal stuck_r   : std_logic;         -- the frame should end, but lacks a beat and more
  signal started_r : std_logic;         -- the frame has just begun
  signal refused   : std_logic;         -- its length is too large

  signal wanted  : count_t;
  signal room    : count_t;    -- the remaining bytes, if they are few
  signal exceeds : std_logic;  -- fewer bytes remain than are offered
  signal ends    : std_logic;  -- less than a beat remains: `last` can be taken
  signal sum     : unsigned(32 downto 0);
  signal lacks   : std_logic;  -- more remains than padding

  signal valid_r : std_logic;
  signal free    : std_logic;  -- the output takes a piece

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_trim: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  wanted  <= std_logic_vector(to_unsigned(LANES, COUNT_BITS)) when last = '1' else count;
  room    <= not std_logic_vector(left_r(COUNT_BITS-1 downto 0));
  exceeds <= near_r and is_more(wanted, room);
  ends    <= closed_r or open_r or (near_r and not room(COUNT_BITS-1));
  sum     <= ('0' & left_r) + (SLACK + 1);
  lacks   <= not (sum(32) or closed_r or open_r);
  free    <= m_ready or not valid_r;
  ready   <= free and (ends or not last);

  piece_ready <= free;

  announced <= std_logic_vector(not left_r);
  is_closed <= closed_r;

  unlimited : if MAX_LENGTH = 0 generate
    refused <= '0';
  end generate unlimited;

  limited : if MAX_LENGTH > 0 generate
    constant LIMIT_BITS : positive := index_bits(MAX_LENGTH+1);
    signal is_short     : std_logic;  -- the length has few bits
    signal is_legal     : std_logic;
  begin
    is_short <= are_ones(std_logic_vector(left_r(31 downto LIMIT_BITS)));
    is_legal <= is_short and is_below(not std_logic_vector(left_r(LIMIT_BITS-1 downto 0)), MAX_LENGTH+1);
    refused  <= started_r and not (is_legal or open_r);
  end generate limited;

  is_refused <= refused;

  -- All of these are valid a cycle after a piece that is not the frame's last one.
  is_failed <= (fault or refused or cut_r or stuck_r or failed_r) and not closed_r;

  hold_piece : process (clk)
  begin
    if rising_edge(clk) then
      if free = '1' then
        m_data  <= data;
        m_last  <= (last and ends) or is_failed;
        m_abort <= (last and (abort or lacks)) or is_failed;
        m_count <= wanted;
        if header = '0' and exceeds = '1' then
          m_count <= room;
        end if;
        if is_failed = '1' or (header = '0' and (abort = '1' or (last = '1' and open_r = '1'))) then
          m_count <= (others => '0');
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      elsif free = '1' then
        valid_r <= is_failed or (valid and (start or not closed_r));
      end if;
    end if;
  end process hold_piece;

  m_valid <= valid_r;

  count_down : process (clk)
  begin
    if rising_edge(clk) and valid = '1' and free = '1' then
      if start = '1' then
        left_r <= not unsigned(length);
        near_r <= are_ones(not length(31 downto COUNT_BITS));
        open_r <= are_ones(length);
      elsif header = '0' then
        left_r <= left_r + unsigned(wanted);
        near_r <= are_ones(std_logic_vector(left_r(31 downto COUNT_BITS)));
      end if;
    end if;
  end process count_down;

  follow_abort : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        started_r <= '0';
        closed_r  <= '0';
        failed_r  <= '0';
        cut_r     <= '0';
        stuck_r   <= '0';
      else
        started_r <= valid and free and start;
        cut_r     <= valid and exceeds and not last and not header and not closed_r;
        stuck_r   <= valid and last and lacks and not ends;
        if free = '1' then
          failed_r <= '0';
          closed_r <= is_failed or (closed_r and not (valid and start));
        else
          failed_r <= is_failed;
        end if;
      end if;
      is_lacking <= valid and last and lacks and not is_failed;
    end if;
  end process follow_abort;

  is_cut <= cut_r;

end architecture rtl;
