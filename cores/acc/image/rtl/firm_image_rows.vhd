-- SPDX-License-Identifier: Apache-2.0
-- Cuts the data of an image into rows, and these into groups of pixels from lane 0 up. Padding and all bytes after the
-- last row are dropped. A full group leaves every cycle, wherever rows begin in the stream, and comes from a register.
-- The number of bytes taken next, and whether they end the row or its padding, is known a cycle earlier.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_image_rows is
  generic (
    WIDTH       : integer := 8;
    -- The bytes of every group except the last of a row, at most WIDTH/8.
    GROUP_BYTES : integer := 1
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;  -- low between images, while the sizes below change

    is_empty  : in std_logic;  -- the stream has no beat
    row_bytes : in std_logic_vector(17 downto 0);
    padding   : in std_logic_vector(31 downto 0);
    rows      : in std_logic_vector(15 downto 0);

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    -- Lanes from `group_count` on are undefined.
    group_data  : out std_logic_vector(WIDTH-1 downto 0);
    group_count : out std_logic_vector(clog2(WIDTH/8+1)-1 downto 0) := (others => '0');
    group_first : out std_logic;  -- of a row
    group_last  : out std_logic;  -- of a row
    group_final : out std_logic;  -- of the image: it is the last one with pixels
    -- Marks the image's end, without a group: the stream is over. It comes once, even if the stream is too short.
    group_end   : out std_logic;
    group_valid : out std_logic;
    group_ready : in  std_logic
  );
end entity firm_image_rows;

architecture rtl of firm_image_rows is

  constant LANES      : positive := max(1, WIDTH/8);
  constant COUNT_BITS : positive := clog2(WIDTH/8+1);

  subtype count_t is unsigned(COUNT_BITS-1 downto 0);
  subtype size_t is unsigned(31 downto 0);
  -- The next bytes in the window: of a row, of its padding, or after the last row.
  type section_t is (ROW, GAP, REST);

  signal window    : std_logic_vector(WIDTH-1 downto 0);
  signal available : std_logic_vector(COUNT_BITS-1 downto 0);
  signal is_last   : std_logic;
  signal shown     : std_logic;
  signal ends      : std_logic;

  signal section_r : section_t;
  signal wanted_r  : count_t := (others => '0');               -- bytes that are taken next
  signal behind_r  : size_t := (others => '0');                -- the section's remaining bytes after them
  signal closes_r  : std_logic;                                -- none remain
  signal rows_r    : unsigned(15 downto 0) := (others => '0'); -- remaining rows, including this one
  signal first_r   : std_logic;
  signal short_r   : std_logic;                                -- the stream ends before all these bytes
  signal over_r    : std_logic;                                -- the stream is over
  signal told_r    : std_logic;                                -- and its end was reported

  signal is_final   : std_logic;                               -- no row follows
  signal take_group : std_logic;
  signal take_valid : std_logic;
  signal is_free    : std_logic;                               -- the output takes a group

  signal valid_r    : std_logic;

begin

  assert GROUP_BYTES >= 1 and GROUP_BYTES <= WIDTH/8
    report "firm_image_rows: GROUP_BYTES is " & integer'image(GROUP_BYTES) & "; legal: 1 to WIDTH/8"
    severity failure;

  u_window : entity firm.firm_axis_window
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tkeep  => s_axis_tkeep,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      window        => window,
      available     => available,
      is_last       => is_last,
      shown         => shown,
      ends          => ends,
      take_valid    => take_valid,
      take          => std_logic_vector(wanted_r),
      skip          => '0'
    );

  is_free  <= group_ready or not valid_r;
  is_final <= '1' when rows_r = 1 else '0';

  -- An incomplete row gives no group: the frame is broken, and the image is about to be withdrawn. After the last row,
  -- the stream may end with fewer bytes than are wanted.
  take_group <= shown and is_free and not over_r when section_r = ROW else '0';
  take_valid <= take_group when section_r = ROW and shown = '1' else
                (shown or is_last) and not over_r when section_r = REST else
                (shown or short_r) and not over_r;

  note_end : process (clk)
  begin
    if rising_edge(clk) then
      short_r <= '0';
      if take_valid = '0' and is_last = '1' and unsigned(available) < wanted_r then
        short_r <= '1';
      end if;
      if take_valid = '1' and (shown = '0' or ends = '1') then
        over_r <= is_last or short_r or ends;
      end if;
      if over_r = '1' and is_free = '1' then
        told_r <= '1';
      end if;
      if rst_n = '0' then
        short_r <= '0';
        over_r  <= is_empty;
        told_r  <= '0';
      end if;
    end if;
  end process note_end;

  -- The bytes taken next: of this section, or of the following one.
  plan : process (clk)
    variable section : section_t;
    variable size    : size_t;
    variable most    : count_t;
  begin
    if rising_edge(clk) and (rst_n = '0' or take_valid = '1') then
      section := section_r;
      size    := behind_r;
      if rst_n = '0' or (closes_r = '1' and (section_r /= ROW or unsigned(padding) = 0)) then
        section := ROW;
        size    := resize(unsigned(row_bytes), size'length);
        rows_r  <= rows_r - 1;
        if is_final = '1' then
          section := REST;
        end if;
      elsif closes_r = '1' then
        section := GAP;
        size    := unsigned(padding);
      end if;
      if rst_n = '0' then
        section := ROW;
        rows_r  <= unsigned(rows);
        if unsigned(rows) = 0 then
          section := REST;
        end if;
      end if;

      most := to_unsigned(LANES, COUNT_BITS);
      if section = ROW then
        most := to_unsigned(GROUP_BYTES, COUNT_BITS);
      end if;
      section_r <= section;
      wanted_r  <= most;
      behind_r  <= size - most;
      closes_r  <= '0';
      if section /= REST and size <= most then
        wanted_r <= size(COUNT_BITS-1 downto 0);
        closes_r <= '1';
      end if;
    end if;
  end process plan;

  offer : process (clk)
  begin
    if rising_edge(clk) then
      if is_free = '1' then
        valid_r     <= take_group or (over_r and not told_r);
        group_data  <= window;
        group_count <= std_logic_vector(wanted_r);
        group_first <= first_r;
        group_last  <= closes_r;
        group_final <= closes_r and is_final;
        group_end   <= over_r;
        if over_r = '1' then
          group_count <= (others => '0');
        end if;
      end if;
      if take_group = '1' then
        first_r <= closes_r;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
        first_r <= '1';
      end if;
    end if;
  end process offer;

  group_valid <= valid_r;

end architecture rtl;
