-- SPDX-License-Identifier: Apache-2.0
-- Computes the integral image of a mono8 image in 32SC1: each pixel is the sum of all pixels above it and to its left,
-- itself included, modulo 2**32. A sum has 4 bytes, so the output limits the throughput to WIDTH/32 pixels per cycle;
-- below 32 bits, a sum takes several beats. Block RAM stores the sums of the previous row.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity integral_image is
  generic (
    WIDTH       : integer := 8;
    -- The widest image; the result of a wider one is empty.
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
end entity integral_image;

architecture rtl of integral_image is

  constant LANES      : positive := max(1, WIDTH/8);
  constant COUNT_BITS : positive := clog2(LANES+1);
  constant PIXELS     : positive := max(1, LANES/4);  -- of a group
  constant PARTS      : positive := max(1, 4/LANES);  -- beats of a sum
  constant GROUPS     : positive := (MAX_COLUMNS + PIXELS - 1) / PIXELS;
  constant SUM_BITS   : positive := 8 + index_bits(PIXELS+1);

  subtype sums_t is std_logic_vector(32*PIXELS-1 downto 0);
  type row_t is array (natural range 0 to GROUPS-1) of sums_t;
  type partial_t is array (natural range 0 to PIXELS-1) of unsigned(SUM_BITS-1 downto 0);

  signal run          : std_logic;
  signal group_data   : std_logic_vector(WIDTH-1 downto 0);
  signal group_count  : std_logic_vector(COUNT_BITS-1 downto 0);
  signal group_last   : std_logic;
  signal group_final  : std_logic;
  signal group_end    : std_logic;
  signal group_valid  : std_logic;
  signal group_ready  : std_logic;
  signal result_data  : std_logic_vector(WIDTH-1 downto 0);
  signal result_count : std_logic_vector(COUNT_BITS-1 downto 0);
  signal result_last  : std_logic;
  signal result_valid : std_logic;
  signal result_ready : std_logic;

  signal advance  : std_logic;
  signal take     : std_logic;
  signal settled  : std_logic;                      -- the previous group is in the memory
  signal group_r  : natural range 0 to GROUPS-1;    -- of the row
  signal is_top_r : std_logic;                      -- it is the first row

  -- The sums of the previous row, read and written group by group.
  signal memory : row_t;
  signal above  : sums_t;

  -- A group: the prefix sums of its pixels, and the sum of all groups before it in the row.
  signal partial_r : partial_t;
  signal left_r    : unsigned(31 downto 0);
  signal index_r   : natural range 0 to GROUPS-1;
  signal count_r   : unsigned(COUNT_BITS-1 downto 0);
  signal top_r     : std_logic;
  signal last_r    : std_logic;
  signal final_r   : std_logic;
  signal end_r     : std_logic;
  signal valid_r   : std_logic;

  -- The result.
  signal sums         : sums_t;
  signal sums_r       : sums_t;
  signal sums_count_r : unsigned(COUNT_BITS-1 downto 0);
  signal sums_final_r : std_logic;
  signal sums_end_r   : std_logic;
  signal sums_valid_r : std_logic;
  signal part_r       : natural range 0 to PARTS;
  signal last_part    : std_logic;

begin

  out_header_seq           <= in_header_seq;
  out_header_stamp_sec     <= in_header_stamp_sec;
  out_header_stamp_nsec    <= in_header_stamp_nsec;
  out_header_stamp_nanosec <= in_header_stamp_nanosec;
  out_is_bigendian         <= (others => '0');

  u_frame : entity firm.firm_image_frame
    generic map (
      WIDTH        => WIDTH,
      GROUP_BYTES  => PIXELS,
      OUT_ENCODING => "32SC1",
      OUT_BYTES    => 4,
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
      group_count                     => group_count,
      group_first                     => open,
      group_last                      => group_last,
      group_final                     => group_final,
      group_end                       => group_end,
      group_valid                     => group_valid,
      group_ready                     => group_ready,
      result_data                     => result_data,
      result_count                    => result_count,
      result_last                     => result_last,
      result_valid                    => result_valid,
      result_ready                    => result_ready
    );

  last_part <= '1' when part_r = PARTS-1 or sums_end_r = '1' else '0';
  advance   <= (result_ready and last_part) or not sums_valid_r;
  -- If a row is one group, the next one must not be read before this one is written.
  settled     <= '0' when valid_r = '1' and end_r = '0' and index_r = group_r else '1';
  group_ready <= advance and settled;
  take        <= advance and settled and group_valid;

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' and valid_r = '1' then
        memory(index_r) <= sums;
      end if;
      if take = '1' then
        above <= memory(group_r);
      end if;
    end if;
  end process access_memory;

  add_pixels : process (clk)
    variable sum : unsigned(SUM_BITS-1 downto 0);
  begin
    if rising_edge(clk) then
      if run = '0' then
        group_r  <= 0;
        is_top_r <= '1';
        valid_r  <= '0';
      else
        if advance = '1' then
          valid_r <= take;
        end if;
        if take = '1' then
          if group_last = '1' then
            group_r  <= 0;
            is_top_r <= '0';
          elsif group_r /= GROUPS-1 then
            group_r <= group_r + 1;
          end if;
        end if;
      end if;
      if take = '1' then
        sum := (others => '0');
        for pixel in 0 to PIXELS-1 loop
          sum := sum + unsigned(group_data(8*pixel+7 downto 8*pixel));
          partial_r(pixel) <= sum;
        end loop;
        index_r <= group_r;
        count_r <= unsigned(group_count);
        top_r   <= is_top_r;
        last_r  <= group_last;
        final_r <= group_final and not group_end;
        end_r   <= group_end;
      end if;
    end if;
  end process add_pixels;

  add_rows : process (above, partial_r, left_r, top_r)
    variable sum : unsigned(31 downto 0);
  begin
    for pixel in 0 to PIXELS-1 loop
      sum := left_r + partial_r(pixel);
      if top_r = '0' then
        sum := sum + unsigned(above(32*pixel+31 downto 32*pixel));
      end if;
      sums(32*pixel+31 downto 32*pixel) <= std_logic_vector(sum);
    end loop;
  end process add_rows;

  collect : process (clk)
  begin
    if rising_edge(clk) then
      if run = '0' then
        left_r       <= (others => '0');
        sums_valid_r <= '0';
        part_r       <= 0;
      elsif advance = '1' then
        sums_valid_r <= valid_r;
        part_r       <= 0;
        if valid_r = '1' then
          left_r <= left_r + partial_r(PIXELS-1);
          if last_r = '1' then
            left_r <= (others => '0');
          end if;
        end if;
      elsif result_ready = '1' then
        part_r <= part_r + 1;
      end if;
      if advance = '1' then
        sums_r       <= sums;
        sums_count_r <= count_r;
        sums_final_r <= final_r;
        sums_end_r   <= end_r;
      end if;
    end if;
  end process collect;

  whole : if PARTS = 1 generate
    result_data  <= sums_r;
    result_count <= std_logic_vector(sums_count_r(COUNT_BITS-3 downto 0)) & "00";
  end generate whole;

  parts_of_sum : if PARTS > 1 generate
    pick : process (part_r, sums_r)
    begin
      result_data <= sums_r(WIDTH-1 downto 0);
      for part in 1 to PARTS-1 loop
        if part_r = part then
          result_data <= sums_r(WIDTH*(part+1)-1 downto WIDTH*part);
        end if;
      end loop;
    end process pick;
    result_count <= std_logic_vector(to_unsigned(LANES, COUNT_BITS)) when sums_end_r = '0' else (others => '0');
  end generate parts_of_sum;

  result_last  <= last_part and (sums_final_r or sums_end_r);
  result_valid <= sums_valid_r;

end architecture rtl;
