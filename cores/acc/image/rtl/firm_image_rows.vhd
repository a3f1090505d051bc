-- SPDX-License-Identifier: Apache-2.0
-- Cuts the data of an image into rows, and these into groups of pixels from lane 0 up. Padding and all bytes after the
-- last row are dropped. A full group leaves every cycle, wherever rows begin in the stream.
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
    group_count : out std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
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

  constant COUNT_BITS : positive := clog2(WIDTH/8+1);

  subtype count_t is unsigned(COUNT_BITS-1 downto 0);

  signal available_lanes : std_logic_vector(COUNT_BITS-1 downto 0);
  signal available       : count_t;
  signal is_last         : std_logic;
  signal take_valid      : std_logic;
  signal take            : count_t;

  signal rows_r    : unsigned(15 downto 0) := (others => '0');  -- rows to come, this one included
  signal bytes_r   : unsigned(17 downto 0) := (others => '0');  -- of the row; zero while its padding is dropped
  signal padding_r : unsigned(31 downto 0) := (others => '0');  -- to be dropped
  signal first_r   : std_logic;
  signal over_r    : std_logic;              -- the stream is over
  signal told_r    : std_logic;              -- and the end was reported

  signal in_row    : std_logic;
  signal in_gap    : std_logic;
  signal ends_row  : std_logic;
  signal ends_gap  : std_logic;
  signal wanted    : count_t;
  signal has_group : std_logic;

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
      window        => group_data,
      available     => available_lanes,
      is_last       => is_last,
      take_valid    => take_valid,
      take          => std_logic_vector(take),
      skip          => '0'
    );

  available <= unsigned(available_lanes);

  in_row   <= '1' when rows_r /= 0 and bytes_r /= 0 else '0';
  in_gap   <= '1' when rows_r /= 0 and bytes_r = 0 else '0';
  ends_row <= '1' when bytes_r <= GROUP_BYTES else '0';
  ends_gap <= '1' when padding_r <= available else '0';
  wanted   <= bytes_r(COUNT_BITS-1 downto 0) when ends_row = '1' else to_unsigned(GROUP_BYTES, COUNT_BITS);

  has_group <= '1' when rst_n = '1' and over_r = '0' and in_row = '1' and available >= wanted else '0';

  -- An incomplete row gives no group: the frame is broken, and the image is about to be withdrawn.
  choose : process (in_row, in_gap, ends_gap, has_group, group_ready, wanted, available, is_last, padding_r, over_r)
  begin
    take       <= available;
    take_valid <= not over_r;
    if in_row = '1' and has_group = '1' then
      take       <= wanted;
      take_valid <= group_ready;
    elsif in_row = '1' then
      take_valid <= is_last and not over_r;
    elsif in_gap = '1' and ends_gap = '1' then
      take <= padding_r(COUNT_BITS-1 downto 0);
    end if;
  end process choose;

  count : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        rows_r    <= unsigned(rows);
        bytes_r   <= unsigned(row_bytes);
        padding_r <= unsigned(padding);
        first_r   <= '1';
        over_r    <= is_empty;
        told_r    <= '0';
      else
        if has_group = '1' and group_ready = '1' then
          first_r <= '0';
          bytes_r <= bytes_r - wanted;
          if ends_row = '1' then
            first_r <= '1';
            if unsigned(padding) = 0 then
              rows_r  <= rows_r - 1;
              bytes_r <= unsigned(row_bytes);
            end if;
          end if;
        elsif in_gap = '1' and over_r = '0' then
          padding_r <= padding_r - available;
          if ends_gap = '1' then
            padding_r <= unsigned(padding);
            bytes_r   <= unsigned(row_bytes);
            rows_r    <= rows_r - 1;
          end if;
        end if;
        if take_valid = '1' and is_last = '1' and take = available then
          over_r <= '1';
        end if;
        if over_r = '1' and group_ready = '1' then
          told_r <= '1';
        end if;
      end if;
    end if;
  end process count;

  group_count <= std_logic_vector(wanted) when over_r = '0' else (others => '0');
  group_first <= first_r;
  group_last  <= ends_row;
  group_final <= '1' when ends_row = '1' and rows_r = 1 else '0';
  group_end   <= over_r;
  group_valid <= has_group or (rst_n and over_r and not told_r);

end architecture rtl;
