-- SPDX-License-Identifier: Apache-2.0
-- Sends the frames of several sources, one frame at a time. The waiting sources are served round robin, so that none
-- starves. A source is selected one cycle after it begins to wait, and each byte leaves one cycle later.
library ieee;
use ieee.std_logic_1164.all;

entity firm_net_merge is
  generic (
    SOURCES : integer := 2  -- 1 or more
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Source 0 in the lowest bits.
    s_axis_tdata  : in  std_logic_vector(8*SOURCES-1 downto 0);
    s_axis_tvalid : in  std_logic_vector(SOURCES-1 downto 0);
    s_axis_tlast  : in  std_logic_vector(SOURCES-1 downto 0);
    s_axis_tready : out std_logic_vector(SOURCES-1 downto 0);

    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_net_merge;

architecture rtl of firm_net_merge is

  subtype sources_t is std_logic_vector(SOURCES-1 downto 0);
  constant NO_SOURCE : sources_t := (others => '0');

  signal after_r  : sources_t;  -- the sources after that of the last frame
  signal later    : sources_t;  -- the waiting ones of them
  signal waiting  : sources_t;
  signal first    : sources_t;  -- the source to begin with, if one waits
  signal chosen_r : sources_t;  -- the source of the current frame
  signal byte     : std_logic_vector(7 downto 0);
  signal valid    : std_logic;
  signal last     : std_logic;
  signal takes    : std_logic;  -- a byte arrives
  signal valid_r  : std_logic;
  signal byte_r   : std_logic_vector(7 downto 0) := (others => '0');
  signal last_r   : std_logic;
  -- A byte that arrived while the previous one could not leave.
  signal full_r   : std_logic;
  signal spare_r  : std_logic_vector(7 downto 0) := (others => '0');
  signal final_r  : std_logic;

begin

  assert SOURCES >= 1
    report "firm_net_merge: SOURCES is " & integer'image(SOURCES) & "; legal: 1 or more"
    severity failure;

  later   <= s_axis_tvalid and after_r;
  waiting <= s_axis_tvalid when later = NO_SOURCE else later;

  find_first : process (waiting)
    variable found : std_logic;
  begin
    found := '0';
    for index in 0 to SOURCES-1 loop
      first(index) <= waiting(index) and not found;
      found        := found or waiting(index);
    end loop;
  end process find_first;

  show : process (chosen_r, s_axis_tdata)
    variable found : std_logic_vector(7 downto 0);
  begin
    found := x"00";
    for index in 0 to SOURCES-1 loop
      if chosen_r(index) = '1' then
        found := found or s_axis_tdata(8*index+7 downto 8*index);
      end if;
    end loop;
    byte <= found;
  end process show;

  valid         <= '0' when (chosen_r and s_axis_tvalid) = NO_SOURCE else '1';
  last          <= '0' when (chosen_r and s_axis_tlast) = NO_SOURCE else '1';
  takes         <= valid and not full_r;
  s_axis_tready <= chosen_r when full_r = '0' else NO_SOURCE;
  m_axis_tdata  <= byte_r;
  m_axis_tvalid <= valid_r;
  m_axis_tlast  <= last_r;

  follow : process (clk)
    variable found : std_logic;
  begin
    if rising_edge(clk) then
      if m_axis_tready = '1' or valid_r = '0' then
        byte_r  <= byte;
        last_r  <= last;
        valid_r <= takes or full_r;
        full_r  <= '0';
        if full_r = '1' then
          byte_r <= spare_r;
          last_r <= final_r;
        end if;
      elsif full_r = '0' then
        full_r  <= takes;
        spare_r <= byte;
        final_r <= last;
      end if;
      if chosen_r = NO_SOURCE then
        chosen_r <= first;
      elsif takes = '1' and last = '1' then
        chosen_r <= NO_SOURCE;
        found    := '0';
        for index in 0 to SOURCES-1 loop
          after_r(index) <= found;
          found          := found or chosen_r(index);
        end loop;
      end if;
      if rst_n = '0' then
        chosen_r <= NO_SOURCE;
        after_r  <= NO_SOURCE;
        valid_r  <= '0';
        full_r   <= '0';
      end if;
    end if;
  end process follow;

end architecture rtl;
