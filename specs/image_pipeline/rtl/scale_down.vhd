-- SPDX-License-Identifier: Apache-2.0
-- Scales a mono8 image down: keeps the nearest pixels, COLUMNS_OUT of COLUMNS_IN columns and ROWS_OUT of ROWS_IN rows.
-- Pixel x of the result is pixel x*COLUMNS_IN/COLUMNS_OUT, rounded down, as in OpenCV's INTER_NEAREST. Sizes are
-- rounded up. A beat is taken every cycle, regardless of the number of kept pixels.
--
-- Pixel i is kept if a multiple of IN/OUT lies in [i, i+1), that is, if its phase, -i*OUT modulo IN, is below OUT.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity scale_down is
  generic (
    WIDTH       : integer := 8;
    -- 1920 x 1080 to 640 x 480 by default.
    COLUMNS_IN  : integer := 3;
    COLUMNS_OUT : integer := 1;
    ROWS_IN     : integer := 9;
    ROWS_OUT    : integer := 4
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
end entity scale_down;

architecture rtl of scale_down is

  constant LANES      : positive := max(1, WIDTH/8);
  constant COUNT_BITS : positive := clog2(LANES+1);
  constant SHIFT_BITS : positive := index_bits(LANES);

  -- For each pixel of a group, by how many lanes it moves down.
  type shifts_t is array (natural range 0 to LANES-1) of unsigned(SHIFT_BITS-1 downto 0);
  type counts_t is array (natural range 2 to 3) of unsigned(COUNT_BITS-1 downto 0);
  type sums_t is array (natural range 0 to LANES-1) of unsigned(COUNT_BITS-1 downto 0);

  -- The phase `steps` pixels later.
  function moved(phase, steps, size_out, size_in : natural) return natural is
    constant BACK : natural := (steps * (size_out mod size_in)) mod size_in;
  begin
    if phase >= BACK then
      return phase - BACK;
    end if;
    return phase + (size_in - BACK);
  end function moved;

  -- Yosys maps `+` to a carry chain, which is slower for so few bits.
  function added(left, right : unsigned(COUNT_BITS-1 downto 0)) return unsigned is
    variable sum   : unsigned(COUNT_BITS-1 downto 0);
    variable carry : std_logic := '0';
  begin
    for k in sum'reverse_range loop
      sum(k) := left(k) xor right(k) xor carry;
      carry  := (left(k) and right(k)) or (carry and (left(k) or right(k)));
    end loop;
    return sum;
  end function added;

  -- For each lane, the number of set bits from the lowest lane to this one: sums over 2, 4, 8 ... lanes.
  function sums_of(bits : std_logic_vector(LANES-1 downto 0)) return sums_t is
    variable sums : sums_t;
  begin
    for lane in 0 to LANES-1 loop
      sums(lane)    := (others => '0');
      sums(lane)(0) := bits(lane);
    end loop;
    for level in 0 to clog2(LANES)-1 loop
      for lane in 0 to LANES-1 loop
        if (lane / 2**level) mod 2 = 1 then
          sums(lane) := added(sums(lane), sums((lane / 2**level) * 2**level - 1));
        end if;
      end loop;
    end loop;
    return sums;
  end function sums_of;

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

  signal advance  : std_logic;
  signal column_r : natural range 0 to COLUMNS_IN-1;  -- the phase of the group's first pixel
  signal row_r    : natural range 0 to ROWS_IN-1;     -- the row's phase

  -- The input and its kept pixels; their shifts; the result.
  signal data_r   : std_logic_vector(WIDTH-1 downto 0);
  signal stays_r  : std_logic_vector(LANES-1 downto 0);
  signal placed_r : std_logic_vector(WIDTH-1 downto 0);
  signal shifts_r : shifts_t;
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
      COLUMNS_IN   => COLUMNS_IN,
      COLUMNS_OUT  => COLUMNS_OUT,
      ROWS_IN      => ROWS_IN,
      ROWS_OUT     => ROWS_OUT
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

  advance     <= result_ready or not valid_r(3);
  group_ready <= advance;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      if run = '0' then
        column_r <= 0;
        row_r    <= 0;
      elsif advance = '1' and group_valid = '1' then
        column_r <= moved(column_r, LANES, COLUMNS_OUT, COLUMNS_IN);
        if group_last = '1' then
          column_r <= 0;
          row_r    <= moved(row_r, 1, ROWS_OUT, ROWS_IN);
        end if;
      end if;
      if advance = '1' then
        data_r <= group_data;
        for lane in 0 to LANES-1 loop
          stays_r(lane) <= '0';
          if moved(column_r, lane, COLUMNS_OUT, COLUMNS_IN) < COLUMNS_OUT and row_r < ROWS_OUT
             and lane < to_integer(unsigned(group_count)) then
            stays_r(lane) <= '1';
          end if;
        end loop;
      end if;
    end if;
  end process choose;

  -- A pixel moves down by the number of dropped pixels below it.
  place : process (clk)
    variable gone : sums_t;
  begin
    if rising_edge(clk) and advance = '1' then
      placed_r <= data_r;
      gone     := sums_of(not stays_r);
      for lane in 0 to LANES-1 loop
        shifts_r(lane) <= (others => '0');
        if lane > 0 and stays_r(lane) = '1' then
          shifts_r(lane) <= gone(max(0, lane-1))(SHIFT_BITS-1 downto 0);
        end if;
      end loop;
      count_r(2) <= LANES - gone(LANES-1);
    end if;
  end process place;

  -- By powers of two, the lowest first, so that no pixel meets another one or the copy that it leaves.
  compact : process (clk)
    variable data   : std_logic_vector(WIDTH-1 downto 0);
    variable shifts : shifts_t;
  begin
    if rising_edge(clk) and advance = '1' then
      data   := placed_r;
      shifts := shifts_r;
      for stage in 0 to SHIFT_BITS-1 loop
        for lane in 0 to LANES-1-2**stage loop
          if shifts(lane + 2**stage)(stage) = '1' then
            data(8*lane+7 downto 8*lane) := data(8*(lane + 2**stage)+7 downto 8*(lane + 2**stage));
            shifts(lane)                 := shifts(lane + 2**stage);
          end if;
        end loop;
      end loop;
      result_data <= data;
      count_r(3)  <= count_r(2);
    end if;
  end process compact;

  move : process (clk)
  begin
    if rising_edge(clk) then
      if run = '0' then
        valid_r <= (others => '0');
      elsif advance = '1' then
        valid_r <= group_valid & valid_r(1 to 2);
      end if;
      if advance = '1' then
        end_r <= group_end & end_r(1 to 2);
      end if;
    end if;
  end process move;

  result_count <= std_logic_vector(count_r(3));
  result_last  <= end_r(3);
  result_valid <= valid_r(3);

end architecture rtl;
