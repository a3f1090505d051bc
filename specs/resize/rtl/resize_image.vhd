-- SPDX-License-Identifier: Apache-2.0
-- Makes an image twice as wide and twice as high, by bilinear interpolation between the centers of the pixels, as
-- OpenCV's INTER_LINEAR does. A pixel of the result lies a quarter of the way from one pixel of the image to the next,
-- so it has 3/4 of the one and 1/4 of the other, in both directions. Outside the image, its border is repeated.
--
-- Two rows of the result lie between two rows of the image. The first is computed while the lower row of the image
-- arrives, the second from the memory, which holds the two pixels of each column. Likewise, two pixels of the result
-- lie between two columns. They are computed in the same cycle.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity resize_image is
  generic (
    WIDTH       : integer := 64;      -- 16*BYTES or more, since two pixels leave together
    ENCODING    : string  := "rgb8";
    BYTES       : integer := 3;       -- channels of a pixel, of 8 bits each
    MAX_COLUMNS : integer := 2048
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- ROS 1 has seq and nsec, ROS 2 has nanosec: a system connects those of its message.
    in_payload_length              : in  std_logic_vector(31 downto 0);
    in_header_seq                  : in  std_logic_vector(31 downto 0) := (others => '0');
    in_header_stamp_sec            : in  std_logic_vector(31 downto 0);
    in_header_stamp_nsec           : in  std_logic_vector(31 downto 0) := (others => '0');
    in_header_stamp_nanosec        : in  std_logic_vector(31 downto 0) := (others => '0');
    in_header_frame_id_length      : in  std_logic_vector(31 downto 0);
    in_header_frame_id_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    in_header_frame_id_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_header_frame_id_axis_tvalid : in  std_logic;
    in_header_frame_id_axis_tlast  : in  std_logic;
    in_header_frame_id_axis_tready : out std_logic;
    in_height                      : in  std_logic_vector(31 downto 0);
    in_width                       : in  std_logic_vector(31 downto 0);
    in_encoding_length             : in  std_logic_vector(31 downto 0);
    in_encoding_axis_tdata         : in  std_logic_vector(WIDTH-1 downto 0);
    in_encoding_axis_tkeep         : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_encoding_axis_tvalid        : in  std_logic;
    in_encoding_axis_tlast         : in  std_logic;
    in_encoding_axis_tready        : out std_logic;
    in_is_bigendian                : in  std_logic_vector(7 downto 0);
    in_step                        : in  std_logic_vector(31 downto 0);
    in_data_length                 : in  std_logic_vector(31 downto 0);
    in_data_axis_tdata             : in  std_logic_vector(WIDTH-1 downto 0);
    in_data_axis_tkeep             : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_data_axis_tvalid            : in  std_logic;
    in_data_axis_tlast             : in  std_logic;
    in_data_axis_tready            : out std_logic;
    in_segment_valid               : in  std_logic_vector(2 downto 0);
    in_msg_valid                   : in  std_logic;
    in_msg_ready                   : out std_logic;

    out_header_seq                  : out std_logic_vector(31 downto 0);
    out_header_stamp_sec            : out std_logic_vector(31 downto 0);
    out_header_stamp_nsec           : out std_logic_vector(31 downto 0);
    out_header_stamp_nanosec        : out std_logic_vector(31 downto 0);
    out_header_frame_id_length      : out std_logic_vector(31 downto 0);
    out_header_frame_id_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    out_header_frame_id_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    out_header_frame_id_axis_tvalid : out std_logic;
    out_header_frame_id_axis_tlast  : out std_logic;
    out_header_frame_id_axis_tready : in  std_logic;
    out_height                      : out std_logic_vector(31 downto 0);
    out_width                       : out std_logic_vector(31 downto 0);
    out_encoding_length             : out std_logic_vector(31 downto 0);
    out_encoding_axis_tdata         : out std_logic_vector(WIDTH-1 downto 0);
    out_encoding_axis_tkeep         : out std_logic_vector(WIDTH/8-1 downto 0);
    out_encoding_axis_tvalid        : out std_logic;
    out_encoding_axis_tlast         : out std_logic;
    out_encoding_axis_tready        : in  std_logic;
    out_is_bigendian                : out std_logic_vector(7 downto 0);
    out_step                        : out std_logic_vector(31 downto 0);
    out_data_length                 : out std_logic_vector(31 downto 0);
    out_data_axis_tdata             : out std_logic_vector(WIDTH-1 downto 0);
    out_data_axis_tkeep             : out std_logic_vector(WIDTH/8-1 downto 0);
    out_data_axis_tvalid            : out std_logic;
    out_data_axis_tlast             : out std_logic;
    out_data_axis_tready            : in  std_logic;
    out_segment_valid               : out std_logic_vector(2 downto 0);
    out_msg_valid                   : out std_logic;
    out_msg_ready                   : in  std_logic
  );
end entity resize_image;

architecture rtl of resize_image is

  constant COUNT_BITS : positive := clog2(WIDTH/8+1);

  subtype pixel_t is std_logic_vector(8*BYTES-1 downto 0);
  subtype column_t is std_logic_vector(16*BYTES-1 downto 0);
  type memory_t is array (natural range 0 to MAX_COLUMNS-1) of column_t;

  -- A pixel's channels, times four.
  type fourfold_t is array (natural range 0 to BYTES-1) of unsigned(9 downto 0);

  -- A row of the image arrives; the second row of the result is computed; the last row of the result is computed; its
  -- last pixel leaves; the end is sent.
  type phase_t is (COMING, SECOND, LAST, LAST_PIXEL, TELL_END, OVER);

  -- The content of a stage: a column of the result, maybe the first of the image or a row; the last pixel; the end.
  type step_t is record
    valid    : std_logic;
    gives    : std_logic;
    is_first : std_logic;
    is_left  : std_logic;  -- at the left border
    is_pixel : std_logic;
    is_end   : std_logic;
  end record step_t;

  constant NOTHING : step_t := (others => '0');

  -- The bytes of pixels.
  function count_of(pixels : natural) return std_logic_vector is
  begin
    return std_logic_vector(resize(to_unsigned(pixels*BYTES, 8), COUNT_BITS));
  end function count_of;

  -- 3/4 of one pixel and 1/4 of another.
  function blended(near, far : pixel_t) return fourfold_t is
    variable result : fourfold_t;
  begin
    for channel in 0 to BYTES-1 loop
      result(channel) := resize(unsigned(far(8*channel+7 downto 8*channel)), 10)
                         + unsigned(near(8*channel+7 downto 8*channel))
                         + unsigned(near(8*channel+7 downto 8*channel) & '0');
    end loop;
    return result;
  end function blended;

  -- The same, rounded to the nearest, halves up.
  function rounded(near, far : fourfold_t) return pixel_t is
    variable sum    : unsigned(11 downto 0);
    variable result : pixel_t;
  begin
    for channel in 0 to BYTES-1 loop
      sum := resize(far(channel), 12) + near(channel) + (near(channel) & '0') + 8;
      result(8*channel+7 downto 8*channel) := std_logic_vector(sum(11 downto 4));
    end loop;
    return result;
  end function rounded;

  signal run          : std_logic;
  signal group_data   : std_logic_vector(WIDTH-1 downto 0);
  signal group_last   : std_logic;
  signal group_end    : std_logic;
  signal group_valid  : std_logic;
  signal group_ready  : std_logic;
  signal result_data  : std_logic_vector(WIDTH-1 downto 0);
  signal result_count : std_logic_vector(COUNT_BITS-1 downto 0);
  signal result_last  : std_logic;
  signal result_valid : std_logic;
  signal result_ready : std_logic;

  signal advance : std_logic;
  signal settled : std_logic;  -- the column that is read next is in the memory
  signal offered : std_logic;  -- a step, of the arriving row or of the memory
  signal take    : std_logic;
  signal is_last : std_logic;  -- the column is its row's last one

  signal phase_r       : phase_t;
  signal column_r      : natural range 0 to MAX_COLUMNS-1;
  signal last_column_r : natural range 0 to MAX_COLUMNS-1;
  signal is_top_r      : std_logic;  -- no row of the image has arrived
  signal is_begun_r    : std_logic;  -- a pixel of the result was computed

  -- The upper pixel of a column is high.
  signal memory : memory_t;
  signal stored : column_t;

  -- A step; its column is in `stored`, or in `stored` and `pixel_r`.
  signal taken_r   : step_t;
  signal pixel_r   : pixel_t;
  signal address_r : natural range 0 to MAX_COLUMNS-1;
  signal source_r  : phase_t;
  signal fills_r   : std_logic;  -- the column has one pixel, which counts for both

  -- The pixels of the column, nearer and farther; its place in the result's row, and that of the column before it.
  signal chosen_r  : step_t;
  signal near_r    : pixel_t;
  signal far_r     : pixel_t;
  signal blended_r : step_t;
  signal here_r    : fourfold_t;
  signal behind_r  : fourfold_t;
  signal valid_r   : std_logic;

begin

  assert WIDTH >= 16*BYTES
    report "resize_image: WIDTH is " & integer'image(WIDTH) & "; legal: " & integer'image(16*BYTES) & " or more"
    severity failure;

  out_header_seq           <= in_header_seq;
  out_header_stamp_sec     <= in_header_stamp_sec;
  out_header_stamp_nsec    <= in_header_stamp_nsec;
  out_header_stamp_nanosec <= in_header_stamp_nanosec;
  out_is_bigendian         <= (others => '0');

  u_frame : entity firm.firm_image_frame
    generic map (
      WIDTH        => WIDTH,
      GROUP_BYTES  => BYTES,
      IN_ENCODING  => ENCODING,
      OUT_ENCODING => ENCODING,
      IN_BYTES     => BYTES,
      OUT_BYTES    => BYTES,
      COLUMNS_OUT  => 2,
      ROWS_OUT     => 2,
      MAX_COLUMNS  => MAX_COLUMNS
    )
    port map (
      clk                             => clk,
      rst_n                           => rst_n,
      in_header_frame_id_length       => in_header_frame_id_length,
      in_header_frame_id_axis_tdata   => in_header_frame_id_axis_tdata,
      in_header_frame_id_axis_tkeep   => in_header_frame_id_axis_tkeep,
      in_header_frame_id_axis_tvalid  => in_header_frame_id_axis_tvalid,
      in_header_frame_id_axis_tlast   => in_header_frame_id_axis_tlast,
      in_header_frame_id_axis_tready  => in_header_frame_id_axis_tready,
      in_height                       => in_height,
      in_width                        => in_width,
      in_encoding_length              => in_encoding_length,
      in_encoding_axis_tdata          => in_encoding_axis_tdata,
      in_encoding_axis_tvalid         => in_encoding_axis_tvalid,
      in_encoding_axis_tlast          => in_encoding_axis_tlast,
      in_encoding_axis_tready         => in_encoding_axis_tready,
      in_step                         => in_step,
      in_data_length                  => in_data_length,
      in_data_axis_tdata              => in_data_axis_tdata,
      in_data_axis_tkeep              => in_data_axis_tkeep,
      in_data_axis_tvalid             => in_data_axis_tvalid,
      in_data_axis_tlast              => in_data_axis_tlast,
      in_data_axis_tready             => in_data_axis_tready,
      in_segment_valid                => in_segment_valid,
      in_msg_valid                    => in_msg_valid,
      in_msg_ready                    => in_msg_ready,
      out_header_frame_id_length      => out_header_frame_id_length,
      out_header_frame_id_axis_tdata  => out_header_frame_id_axis_tdata,
      out_header_frame_id_axis_tkeep  => out_header_frame_id_axis_tkeep,
      out_header_frame_id_axis_tvalid => out_header_frame_id_axis_tvalid,
      out_header_frame_id_axis_tlast  => out_header_frame_id_axis_tlast,
      out_header_frame_id_axis_tready => out_header_frame_id_axis_tready,
      out_height                      => out_height,
      out_width                       => out_width,
      out_encoding_length             => out_encoding_length,
      out_encoding_axis_tdata         => out_encoding_axis_tdata,
      out_encoding_axis_tkeep         => out_encoding_axis_tkeep,
      out_encoding_axis_tvalid        => out_encoding_axis_tvalid,
      out_encoding_axis_tlast         => out_encoding_axis_tlast,
      out_encoding_axis_tready        => out_encoding_axis_tready,
      out_step                        => out_step,
      out_data_length                 => out_data_length,
      out_data_axis_tdata             => out_data_axis_tdata,
      out_data_axis_tkeep             => out_data_axis_tkeep,
      out_data_axis_tvalid            => out_data_axis_tvalid,
      out_data_axis_tlast             => out_data_axis_tlast,
      out_data_axis_tready            => out_data_axis_tready,
      out_segment_valid               => out_segment_valid,
      out_msg_valid                   => out_msg_valid,
      out_msg_ready                   => out_msg_ready,
      run                             => run,
      group_data                      => group_data,
      group_count                     => open,
      group_first                     => open,
      group_last                      => group_last,
      group_final                     => open,
      group_end                       => group_end,
      group_valid                     => group_valid,
      group_ready                     => group_ready,
      result_data                     => result_data,
      result_count                    => result_count,
      result_last                     => result_last,
      result_valid                    => result_valid,
      result_ready                    => result_ready
    );

  advance <= result_ready or not valid_r;
  -- A column that was taken is written a cycle later.
  settled <= '0' when taken_r.valid = '1' and address_r = column_r else '1';
  is_last <= group_last when phase_r = COMING else
             '1' when column_r = last_column_r else
             '0';

  offered <= group_valid and not group_end when phase_r = COMING else
             '0' when phase_r = OVER else
             '1';

  take        <= offered and advance and settled;
  group_ready <= advance and settled when phase_r = COMING else '0';

  proceed : process (clk)
  begin
    if rising_edge(clk) then
      if take = '1' then
        if phase_r = COMING then
          last_column_r <= column_r;
        end if;
        if is_last = '1' then
          column_r <= 0;
          is_top_r <= '0';
        else
          column_r <= column_r + 1;
        end if;
        if phase_r = LAST_PIXEL then
          phase_r <= TELL_END;
        elsif phase_r = TELL_END then
          phase_r <= OVER;
        elsif is_last = '1' and phase_r = COMING then
          phase_r <= SECOND;
        elsif is_last = '1' and phase_r = SECOND then
          phase_r <= COMING;
        elsif is_last = '1' then
          phase_r <= LAST_PIXEL;
        end if;
      elsif phase_r = COMING and group_valid = '1' and group_end = '1' and advance = '1' and settled = '1' then
        column_r <= 0;
        phase_r  <= LAST;
        if is_top_r = '1' then
          phase_r <= TELL_END;
        end if;
      end if;
      if run = '0' then
        phase_r  <= COMING;
        column_r <= 0;
        is_top_r <= '1';
      end if;
    end if;
  end process proceed;

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' and taken_r.valid = '1' and source_r = COMING then
        memory(address_r) <= stored(8*BYTES-1 downto 0) & pixel_r;
        if fills_r = '1' then
          memory(address_r) <= pixel_r & pixel_r;
        end if;
      end if;
      if take = '1' then
        stored <= memory(column_r);
      end if;
    end if;
  end process access_memory;

  take_step : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        taken_r   <= NOTHING;
        pixel_r   <= group_data(8*BYTES-1 downto 0);
        address_r <= column_r;
        source_r  <= phase_r;
        fills_r   <= is_top_r;
        if take = '1' then
          taken_r.valid <= '1';
          if phase_r = LAST_PIXEL then
            taken_r.is_pixel <= '1';
          elsif phase_r = TELL_END then
            taken_r.is_end <= '1';
          elsif phase_r /= COMING or is_top_r = '0' then
            taken_r.gives    <= '1';
            taken_r.is_first <= not is_begun_r;
            is_begun_r       <= '1';
            if column_r = 0 then
              taken_r.is_left <= '1';
            end if;
          end if;
        end if;
      end if;
      if run = '0' then
        taken_r    <= NOTHING;
        is_begun_r <= '0';
      end if;
    end if;
  end process take_step;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        chosen_r <= taken_r;
        near_r   <= stored(8*BYTES-1 downto 0);
        far_r    <= stored(8*BYTES-1 downto 0);
        if source_r = COMING then
          far_r <= pixel_r;
        elsif source_r = SECOND then
          far_r <= stored(16*BYTES-1 downto 8*BYTES);
        end if;
      end if;
      if run = '0' then
        chosen_r <= NOTHING;
      end if;
    end if;
  end process choose;

  blend_rows : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        blended_r <= chosen_r;
        if chosen_r.gives = '1' then
          here_r <= blended(near_r, far_r);
        end if;
        if blended_r.gives = '1' then
          behind_r <= here_r;
        end if;
      end if;
      if run = '0' then
        blended_r <= NOTHING;
      end if;
    end if;
  end process blend_rows;

  -- A row begins with the last pixel of the one before it.
  blend_columns : process (clk)
    variable left, right : pixel_t;
    variable pixels      : column_t;
  begin
    if rising_edge(clk) then
      if advance = '1' then
        left  := rounded(behind_r, here_r);
        right := rounded(here_r, behind_r);
        if blended_r.is_left = '1' or blended_r.is_pixel = '1' then
          left  := rounded(behind_r, behind_r);
          right := rounded(here_r, here_r);
        end if;
        pixels       := right & left;
        result_count <= count_of(2);
        if blended_r.is_first = '1' then
          pixels       := right & right;
          result_count <= count_of(1);
        elsif blended_r.is_pixel = '1' then
          result_count <= count_of(1);
        elsif blended_r.is_end = '1' then
          result_count <= count_of(0);
        end if;
        result_data <= std_logic_vector(resize(unsigned(pixels), WIDTH));
        result_last <= blended_r.is_end;
        valid_r     <= blended_r.gives or blended_r.is_pixel or blended_r.is_end;
      end if;
      if run = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process blend_columns;

  result_valid <= valid_r;

end architecture rtl;
