-- SPDX-License-Identifier: Apache-2.0
-- Converts an image in rgb8 to mono8: (77 R + 150 G + 29 B + 128) / 256, rounded down. These are the weights of
-- ITU-R BT.601 in 1/256. Their sum is 256, so gray is unchanged, white is 255, and no limiter is needed.
-- A beat is taken every cycle. Pixels span beats, so up to two bytes are kept for the next beat.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity rgb_to_gray is
  generic (
    WIDTH : integer := 8
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
end entity rgb_to_gray;

architecture rtl of rgb_to_gray is

  constant LANES      : positive := max(1, WIDTH/8);
  constant COUNT_BITS : positive := clog2(LANES+1);
  constant PIXELS     : positive := (LANES+2)/3;  -- that end in a group, at most

  type pixels_t is array (natural range 0 to PIXELS-1) of std_logic_vector(23 downto 0);
  type weighted_t is array (natural range 0 to PIXELS-1) of unsigned(15 downto 0);
  type counts_t is array (natural range 1 to 3) of unsigned(COUNT_BITS-1 downto 0);

  -- Shifted and added: three pixels a cycle would take nine DSP blocks.
  function weighted(value : std_logic_vector(7 downto 0); weight : natural) return unsigned is
    variable sum : unsigned(15 downto 0) := (others => '0');
  begin
    for place in 0 to 7 loop
      if (weight / 2**place) mod 2 = 1 then
        sum := sum + shift_left(resize(unsigned(value), 16), place);
      end if;
    end loop;
    return sum;
  end function weighted;

  signal run          : std_logic;
  signal group_data   : std_logic_vector(WIDTH-1 downto 0);
  signal group_count  : std_logic_vector(COUNT_BITS-1 downto 0);
  signal group_end    : std_logic;
  signal group_valid  : std_logic;
  signal group_ready  : std_logic;
  signal result_data  : std_logic_vector(WIDTH-1 downto 0);
  signal result_count : std_logic_vector(COUNT_BITS-1 downto 0);
  signal result_last  : std_logic;
  signal result_valid : std_logic;
  signal result_ready : std_logic;

  signal advance : std_logic;

  signal joined     : std_logic_vector(8*LANES+31 downto 0);  -- the group after the two bytes before it
  signal previous_r : std_logic_vector(15 downto 0);
  signal carried_r  : natural range 0 to 2;                   -- how many of the two belong to the next pixel

  -- Pixels, their weighted parts, and the result.
  signal pixels_r : pixels_t;
  signal red_r    : weighted_t;
  signal green_r  : weighted_t;
  signal blue_r   : weighted_t;
  signal count_r  : counts_t;
  signal end_r    : std_logic_vector(1 to 3);
  signal valid_r  : std_logic_vector(1 to 3);

begin

  out_header_seq           <= in_header_seq;
  out_header_stamp_sec     <= in_header_stamp_sec;
  out_header_stamp_nsec    <= in_header_stamp_nsec;
  out_header_stamp_nanosec <= in_header_stamp_nanosec;
  out_is_bigendian         <= (others => '0');

  u_frame : entity firm.firm_image_frame
    generic map (
      WIDTH        => WIDTH,
      GROUP_BYTES  => LANES,
      IN_ENCODING  => "rgb8",
      OUT_ENCODING => "mono8",
      IN_BYTES     => 3
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
      group_count                     => group_count,
      group_first                     => open,
      group_last                      => open,
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

  joined      <= x"0000" & group_data & previous_r;
  advance     <= result_ready or not valid_r(3);
  group_ready <= advance;

  -- A row ends with a pixel, so nothing is carried into the next one.
  find_pixels : process (clk)
  begin
    if rising_edge(clk) then
      if run = '0' then
        carried_r <= 0;
      elsif advance = '1' and group_valid = '1' then
        -- A table, as chained sums and comparisons are slower.
        for carried in 0 to 2 loop
          for bytes in 0 to LANES loop
            if carried_r = carried and unsigned(group_count) = bytes then
              carried_r  <= (carried + bytes) mod 3;
              count_r(1) <= to_unsigned((carried + bytes) / 3, COUNT_BITS);
            end if;
          end loop;
        end loop;
        previous_r <= joined(8*LANES+15 downto 8*LANES);
        for pixel in 0 to PIXELS-1 loop
          if carried_r = 0 then
            pixels_r(pixel) <= joined(24*pixel+39 downto 24*pixel+16);
          elsif carried_r = 1 then
            pixels_r(pixel) <= joined(24*pixel+31 downto 24*pixel+8);
          else
            pixels_r(pixel) <= joined(24*pixel+23 downto 24*pixel);
          end if;
        end loop;
      end if;
    end if;
  end process find_pixels;

  weigh : process (clk)
    variable gray : unsigned(15 downto 0);
  begin
    if rising_edge(clk) then
      if run = '0' then
        valid_r <= (others => '0');
      elsif advance = '1' then
        valid_r <= group_valid & valid_r(1 to 2);
      end if;
      if advance = '1' then
        end_r        <= group_end & end_r(1 to 2);
        count_r(2)   <= count_r(1);
        count_r(3)   <= count_r(2);
        result_data  <= (others => '0');
        for pixel in 0 to PIXELS-1 loop
          red_r(pixel)   <= weighted(pixels_r(pixel)(7 downto 0), 77);
          green_r(pixel) <= weighted(pixels_r(pixel)(15 downto 8), 150);
          blue_r(pixel)  <= weighted(pixels_r(pixel)(23 downto 16), 29);

          gray := red_r(pixel) + green_r(pixel) + blue_r(pixel) + 128;
          result_data(8*pixel+7 downto 8*pixel) <= std_logic_vector(gray(15 downto 8));
        end loop;
      end if;
    end if;
  end process weigh;

  result_count <= std_logic_vector(count_r(3));
  result_last  <= end_r(3);
  result_valid <= valid_r(3);

end architecture rtl;
