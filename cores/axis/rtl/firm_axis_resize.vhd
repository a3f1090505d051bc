-- SPDX-License-Identifier: Apache-2.0
-- Converts a stream to another width, without a lost cycle at the narrower end. It holds no beat back: the last narrow
-- beat of a wide one passes in the cycle in which the wide one is taken. So when the source's last beat is taken, the
-- sink has all data, and the source's next data need not wait for this entity.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_resize is
  generic (
    S_WIDTH : integer := 8;
    M_WIDTH : integer := 64
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- While it is low, a partial beat is dropped: the message that contains the stream was withdrawn.
    is_open : in std_logic := '1';

    s_axis_tdata  : in  std_logic_vector(S_WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(S_WIDTH/8-1 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(M_WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(M_WIDTH/8-1 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_axis_resize;

architecture rtl of firm_axis_resize is

  constant WIDE   : positive := max(S_WIDTH, M_WIDTH);
  constant NARROW : positive := S_WIDTH + M_WIDTH - WIDE;
  constant PIECES : positive := WIDE / NARROW;
  constant LANES  : positive := NARROW / 8;

begin

  assert is_stream_width(S_WIDTH) and is_stream_width(M_WIDTH)
    report "firm_axis_resize: S_WIDTH is " & integer'image(S_WIDTH) & " and M_WIDTH is " & integer'image(M_WIDTH)
           & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  same : if S_WIDTH = M_WIDTH generate
    m_axis_tdata  <= s_axis_tdata;
    m_axis_tkeep  <= s_axis_tkeep;
    m_axis_tvalid <= s_axis_tvalid;
    m_axis_tlast  <= s_axis_tlast;
    s_axis_tready <= m_axis_tready;
  end generate same;

  widen : if S_WIDTH < M_WIDTH generate

    -- Ones mark the pieces that have arrived, and the next one.
    signal came_r  : std_logic_vector(PIECES-2 downto 0);
    signal is_next : std_logic_vector(PIECES-1 downto 0);
    -- The pieces before the last one; missing ones are zero.
    signal rest_r  : std_logic_vector(M_WIDTH-NARROW-1 downto 0);
    signal is_done : std_logic;  -- with this piece the beat is complete
    signal taken   : std_logic;

  begin

    is_next       <= (came_r & '1') and not ('0' & came_r);
    is_done       <= came_r(PIECES-2) or s_axis_tlast;
    s_axis_tready <= m_axis_tready or not is_done;
    taken         <= s_axis_tvalid and (m_axis_tready or not is_done);
    m_axis_tvalid <= s_axis_tvalid and is_done;
    m_axis_tlast  <= s_axis_tlast;

    join : process (came_r, is_next, rest_r, s_axis_tdata, s_axis_tkeep)
    begin
      m_axis_tdata <= std_logic_vector(resize(unsigned(rest_r), M_WIDTH));
      m_axis_tkeep <= (others => '0');
      for piece in 0 to PIECES-1 loop
        if piece < PIECES-1 then
          m_axis_tkeep(LANES*piece+LANES-1 downto LANES*piece) <= (others => came_r(piece));
        end if;
        if is_next(piece) = '1' then
          m_axis_tdata(NARROW*piece+NARROW-1 downto NARROW*piece) <= s_axis_tdata;
          m_axis_tkeep(LANES*piece+LANES-1 downto LANES*piece)    <= s_axis_tkeep;
        end if;
      end loop;
    end process join;

    store : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' or is_open = '0' or (taken = '1' and is_done = '1') then
          came_r <= (others => '0');
          rest_r <= (others => '0');
        elsif taken = '1' then
          came_r <= std_logic_vector(shift_left(unsigned(came_r), 1));
          came_r(0) <= '1';
          for piece in 0 to PIECES-2 loop
            if is_next(piece) = '1' then
              rest_r(NARROW*piece+NARROW-1 downto NARROW*piece) <= s_axis_tdata;
            end if;
          end loop;
        end if;
      end if;
    end process store;

  end generate widen;

  narrow_down : if S_WIDTH > M_WIDTH generate

    signal index_r : unsigned(clog2(PIECES)-1 downto 0);
    -- One bit per piece: no other piece of the beat follows it.
    signal ends    : std_logic_vector(PIECES-1 downto 0);
    signal is_done : std_logic_vector(0 downto 0);

  begin

    find_ends : for piece in 0 to PIECES-2 generate
      ends(piece) <= not s_axis_tkeep(LANES*(piece+1));
    end generate find_ends;
    ends(PIECES-1) <= '1';

    u_end : entity firm.firm_axis_select
      generic map (
        WORDS => PIECES,
        WIDTH => 1
      )
      port map (
        words_in => ends,
        index    => std_logic_vector(index_r),
        word     => is_done
      );

    u_data : entity firm.firm_axis_select
      generic map (
        WORDS => PIECES,
        WIDTH => M_WIDTH
      )
      port map (
        words_in => s_axis_tdata,
        index    => std_logic_vector(index_r),
        word     => m_axis_tdata
      );

    u_keep : entity firm.firm_axis_select
      generic map (
        WORDS => PIECES,
        WIDTH => LANES
      )
      port map (
        words_in => s_axis_tkeep,
        index    => std_logic_vector(index_r),
        word     => m_axis_tkeep
      );

    m_axis_tvalid <= s_axis_tvalid;
    m_axis_tlast  <= s_axis_tlast and is_done(0);
    s_axis_tready <= m_axis_tready and is_done(0);

    count : process (clk)
    begin
      if rising_edge(clk) then
        -- A beat whose valid falls in the middle of its pieces was withdrawn.
        if rst_n = '0' or is_open = '0' or s_axis_tvalid = '0' then
          index_r <= (others => '0');
        elsif m_axis_tready = '1' then
          index_r <= index_r + 1;
          if is_done = "1" then
            index_r <= (others => '0');
          end if;
        end if;
      end if;
    end process count;

  end generate narrow_down;

end architecture rtl;
