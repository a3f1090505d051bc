-- SPDX-License-Identifier: Apache-2.0
-- Applies the Sobel filter to a mono8 image: |Gx| + |Gy|, 255 at most, with Gx and Gy of 3 x 3 pixels. Outside the
-- image, its outermost pixels are repeated, so the border has no artificial edge. A beat of pixels is taken every
-- cycle; block RAM stores the two previous rows, and a row leaves while the next one arrives.
--
-- Each column of three pixels counts twice: s = a + 2 b + c for Gx = s(x+1) - s(x-1), d = c - a for
-- Gy = d(x-1) + 2 d(x) + d(x+1). A group of pixels needs a column of the groups on both sides of it, so it waits for
-- the next one. After the last row, the memory is read once more, followed by an empty group.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity sobel is
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
end entity sobel;

architecture rtl of sobel is

  constant LANES      : positive := max(1, WIDTH/8);
  constant COUNT_BITS : positive := clog2(LANES+1);
  constant GROUPS     : positive := (MAX_COLUMNS + LANES - 1) / LANES;

  subtype pixels_t is std_logic_vector(WIDTH-1 downto 0);
  type rows_t is array (natural range 0 to GROUPS-1) of std_logic_vector(2*WIDTH-1 downto 0);

  subtype smooth_t is signed(11 downto 0);
  type smooths_t is array (natural range 0 to LANES-1) of smooth_t;

  -- The progress of an image: its rows arrive; the last row is computed; the last group leaves; the end is sent.
  type phase_t is (ROWS, LAST_ROW, LAST_GROUP, TELL_END);

  -- The attributes of a group: whether it gives a result, and its pixels.
  type group_t is record
    gives : std_logic;
    first : std_logic;
    last  : std_logic;
    count : unsigned(COUNT_BITS-1 downto 0);
  end record group_t;

  -- The column at a lane.
  function smoothed(a, b, c : std_logic_vector(7 downto 0)) return smooth_t is
  begin
    return signed(resize(unsigned(a), 12)) + signed(resize(unsigned(b & '0'), 12)) + signed(resize(unsigned(c), 12));
  end function smoothed;

  function difference(a, c : std_logic_vector(7 downto 0)) return smooth_t is
  begin
    return signed(resize(unsigned(c), 12)) - signed(resize(unsigned(a), 12));
  end function difference;

  function magnitude(value : smooth_t) return smooth_t is
  begin
    if value(11) = '1' then
      return -value;
    end if;
    return value;
  end function magnitude;

  signal run          : std_logic;
  signal group_data   : std_logic_vector(WIDTH-1 downto 0);
  signal group_count  : std_logic_vector(COUNT_BITS-1 downto 0);
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
  signal settled : std_logic;  -- the previous group is in the memory
  signal offered : std_logic;  -- a group, arriving or of the last row
  signal take    : std_logic;

  signal phase_r      : phase_t;
  signal index_r      : natural range 0 to GROUPS-1;            -- of the group in its row
  signal last_index_r : natural range 0 to GROUPS-1;            -- of a row's last one
  signal last_count_r : std_logic_vector(COUNT_BITS-1 downto 0);
  signal is_last      : std_logic;
  signal rows_r       : natural range 0 to 2;                   -- rows received, at most two

  -- The two previous rows, the later one low.
  signal memory  : rows_t;
  signal earlier : std_logic_vector(2*WIDTH-1 downto 0);

  -- A group of the arriving row.
  signal data_r    : pixels_t;
  signal address_r : natural range 0 to GROUPS-1;
  signal group_r   : group_t;
  signal second_r  : std_logic;  -- exactly one row was received
  signal lowest_r  : std_logic;  -- all rows were received
  signal valid_r   : std_logic;

  -- The same with the pixels above it, and its columns.
  signal ahead_r       : group_t;
  signal ahead_valid_r : std_logic;
  signal upper_r       : pixels_t;
  signal middle_r      : pixels_t;
  signal lower_r       : pixels_t;
  signal ahead_s       : smooths_t;
  signal ahead_d       : smooths_t;

  -- The group before it, whose result is computed, and the column before that group.
  signal here_r   : group_t;
  signal here_s   : smooths_t;
  signal here_d   : smooths_t;
  signal behind_s : smooth_t;
  signal behind_d : smooth_t;

  -- Gx and Gy, then the result.
  signal x_r        : smooths_t;
  signal y_r        : smooths_t;
  signal xy_count_r : unsigned(COUNT_BITS-1 downto 0);
  signal xy_end_r   : std_logic;
  signal xy_valid_r : std_logic;
  signal count_r    : unsigned(COUNT_BITS-1 downto 0);
  signal end_r      : std_logic;
  signal out_r      : std_logic;

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

  advance <= result_ready or not out_r;
  -- If a row is one group, the next one must not be read before this one is written.
  settled <= '0' when valid_r = '1' and address_r = index_r else '1';
  is_last <= group_last when phase_r = ROWS else
             '1' when index_r = last_index_r else
             '0';

  offered <= group_valid and not group_end when phase_r = ROWS else
             '1' when phase_r = LAST_ROW or phase_r = LAST_GROUP else
             '0';

  take        <= offered and advance and settled;
  group_ready <= advance and settled when phase_r = ROWS else '0';

  proceed : process (clk)
  begin
    if rising_edge(clk) then
      if run = '0' then
        phase_r <= ROWS;
        index_r <= 0;
        rows_r  <= 0;
      else
        if take = '1' then
          index_r <= 0;
          if is_last = '0' then
            index_r <= index_r + 1;
          end if;
          if phase_r = ROWS and group_last = '1' then
            last_index_r <= index_r;
            last_count_r <= group_count;
            if rows_r /= 2 then
              rows_r <= rows_r + 1;
            end if;
          end if;
        end if;
        if phase_r = ROWS and group_valid = '1' and group_end = '1' and advance = '1' and settled = '1' then
          phase_r <= LAST_ROW;
          if rows_r = 0 then
            phase_r <= TELL_END;
          end if;
        elsif phase_r = LAST_ROW and take = '1' and is_last = '1' then
          phase_r <= LAST_GROUP;
        elsif phase_r = LAST_GROUP and take = '1' then
          phase_r <= TELL_END;
        end if;
      end if;
    end if;
  end process proceed;

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' and valid_r = '1' then
        memory(address_r) <= earlier(WIDTH-1 downto 0) & data_r;
      end if;
      if take = '1' then
        earlier <= memory(index_r);
      end if;
    end if;
  end process access_memory;

  take_group : process (clk)
  begin
    if rising_edge(clk) then
      if run = '0' then
        valid_r <= '0';
      elsif advance = '1' then
        valid_r <= take;
      end if;
      if take = '1' then
        data_r        <= group_data;
        address_r     <= index_r;
        group_r.gives <= '1';
        if rows_r = 0 or phase_r = LAST_GROUP then
          group_r.gives <= '0';
        end if;
        group_r.first <= '0';
        if index_r = 0 then
          group_r.first <= '1';
        end if;
        group_r.last  <= is_last;
        group_r.count <= to_unsigned(LANES, COUNT_BITS);
        if is_last = '1' then
          group_r.count <= unsigned(last_count_r);
          if phase_r = ROWS then
            group_r.count <= unsigned(group_count);
          end if;
        end if;
        second_r <= '0';
        if rows_r = 1 then
          second_r <= '1';
        end if;
        lowest_r <= '0';
        if phase_r /= ROWS then
          lowest_r <= '1';
        end if;
      end if;
    end if;
  end process take_group;

  -- A register after the memory, whose output is late in its cycle.
  align_rows : process (clk)
  begin
    if rising_edge(clk) then
      if run = '0' then
        ahead_valid_r <= '0';
      elsif advance = '1' then
        ahead_valid_r <= valid_r;
      end if;
      if advance = '1' then
        ahead_r  <= group_r;
        upper_r  <= earlier(2*WIDTH-1 downto WIDTH);
        middle_r <= earlier(WIDTH-1 downto 0);
        lower_r  <= data_r;
        if second_r = '1' then
          upper_r <= earlier(WIDTH-1 downto 0);
        end if;
        if lowest_r = '1' then
          lower_r <= earlier(WIDTH-1 downto 0);
        end if;
      end if;
    end if;
  end process align_rows;

  columns : for lane in 0 to LANES-1 generate
    ahead_s(lane) <= smoothed(upper_r(8*lane+7 downto 8*lane), middle_r(8*lane+7 downto 8*lane),
                              lower_r(8*lane+7 downto 8*lane));
    ahead_d(lane) <= difference(upper_r(8*lane+7 downto 8*lane), lower_r(8*lane+7 downto 8*lane));
  end generate columns;

  filter : process (clk)
    variable left_s  : smooth_t;
    variable left_d  : smooth_t;
    variable right_s : smooth_t;
    variable right_d : smooth_t;
  begin
    if rising_edge(clk) then
      if run = '0' then
        here_r.gives <= '0';
        xy_valid_r   <= '0';
      elsif advance = '1' then
        xy_valid_r <= '0';
        xy_end_r   <= '0';
        if ahead_valid_r = '1' then
          here_r     <= ahead_r;
          xy_valid_r <= here_r.gives;
        elsif phase_r = TELL_END and valid_r = '0' then
          -- The last group is on its way.
          xy_valid_r <= '1';
          xy_end_r   <= '1';
        end if;
      end if;
      if advance = '1' and ahead_valid_r = '1' then
        here_s     <= ahead_s;
        here_d     <= ahead_d;
        behind_s   <= here_s(LANES-1);
        behind_d   <= here_d(LANES-1);
        xy_count_r <= here_r.count;
        for lane in 0 to LANES-1 loop
          if lane > 0 then
            left_s := here_s(max(0, lane-1));
            left_d := here_d(max(0, lane-1));
          elsif here_r.first = '1' then
            left_s := here_s(0);
            left_d := here_d(0);
          else
            left_s := behind_s;
            left_d := behind_d;
          end if;
          if here_r.last = '1' and here_r.count = lane+1 then
            right_s := here_s(lane);
            right_d := here_d(lane);
          elsif lane < LANES-1 then
            right_s := here_s((lane+1) mod LANES);
            right_d := here_d((lane+1) mod LANES);
          else
            right_s := ahead_s(0);
            right_d := ahead_d(0);
          end if;
          x_r(lane) <= right_s - left_s;
          y_r(lane) <= left_d + shift_left(here_d(lane), 1) + right_d;
        end loop;
      end if;
    end if;
  end process filter;

  measure : process (clk)
    variable sum : smooth_t;
  begin
    if rising_edge(clk) then
      if run = '0' then
        out_r <= '0';
      elsif advance = '1' then
        out_r <= xy_valid_r;
      end if;
      if advance = '1' then
        count_r <= xy_count_r;
        end_r   <= xy_end_r;
        for lane in 0 to LANES-1 loop
          sum := magnitude(x_r(lane)) + magnitude(y_r(lane));
          result_data(8*lane+7 downto 8*lane) <= std_logic_vector(sum(7 downto 0));
          if (sum(8) or sum(9) or sum(10)) = '1' then
            result_data(8*lane+7 downto 8*lane) <= (others => '1');
          end if;
        end loop;
      end if;
    end if;
  end process measure;

  result_count <= std_logic_vector(count_r) when end_r = '0' else (others => '0');
  result_last  <= end_r;
  result_valid <= out_r;

end architecture rtl;
