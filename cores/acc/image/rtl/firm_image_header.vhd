-- SPDX-License-Identifier: Apache-2.0
-- Handles a sensor_msgs/Image except its pixels: it takes all fields before the pixels, checks whether the accelerator
-- supports them, and announces the resulting image. The lengths of the result must be known with its first segment, but
-- they depend on fields after frame_id. frame_id therefore waits in a FIFO, whose size is fixed because the message has
-- no bound that could be relied on. All products are computed bit by bit, in 35 cycles per image.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_message_pkg.all;

entity firm_image_header is
  generic (
    WIDTH        : integer := 8;
    -- The encodings of input and output, each with the bytes of a pixel.
    IN_ENCODING  : string  := "mono8";
    OUT_ENCODING : string  := "mono8";
    IN_BYTES     : integer := 1;
    OUT_BYTES    : integer := 1;
    -- OUT columns (rows) result from IN columns (rows), twice as many at most; a remainder counts as a whole group.
    COLUMNS_IN  : integer := 1;
    COLUMNS_OUT : integer := 1;
    ROWS_IN     : integer := 1;
    ROWS_OUT    : integer := 1;
    -- The widest image: 65535/OUT_BYTES at most, 32767/OUT_BYTES if it becomes wider.
    MAX_COLUMNS : integer := 65535;
    -- A longer frame_id is truncated.
    FRAME_ID_BYTES : integer := 256
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

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
    in_encoding_axis_tvalid        : in  std_logic;
    in_encoding_axis_tlast         : in  std_logic;
    in_encoding_axis_tready        : out std_logic;
    in_step                        : in  std_logic_vector(31 downto 0);
    in_data_length                 : in  std_logic_vector(31 downto 0);
    in_segment_valid               : in  std_logic_vector(2 downto 0);
    in_msg_valid                   : in  std_logic;
    in_msg_ready                   : out std_logic;

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
    out_step                        : out std_logic_vector(31 downto 0);
    out_data_length                 : out std_logic_vector(31 downto 0);
    out_segment_valid               : out std_logic_vector(2 downto 0);
    out_msg_valid                   : out std_logic;
    out_msg_ready                   : in  std_logic;

    -- The pixels are processed: low between images; all values below are valid while it is high.
    run       : out std_logic;
    is_empty  : out std_logic;                      -- neither a byte of data nor a beat is available
    has_none  : out std_logic;                      -- the result has no pixels
    row_bytes : out std_logic_vector(17 downto 0);
    padding   : out std_logic_vector(31 downto 0);  -- bytes after each row
    rows      : out std_logic_vector(15 downto 0);  -- zero if all data must be dropped
    -- The resulting pixels may be offered; all of the header has been taken.
    show      : out std_logic;
    done      : in  std_logic
  );
end entity firm_image_header;

architecture rtl of firm_image_header is

  constant LANES     : positive := max(1, WIDTH/8);
  constant SIZE_BITS : positive := 16;

  -- The number of beats of a text, a letter of it, and a beat; zeros follow its end.
  function beats_of(text : string) return positive is
  begin
    return (text'length + LANES - 1) / LANES;
  end function beats_of;

  function letter_of(text : string; index : natural) return std_logic_vector is
    constant LETTERS : string(1 to text'length) := text;
  begin
    if index >= LETTERS'length then
      return x"00";
    end if;
    return std_logic_vector(to_unsigned(character'pos(LETTERS(index + 1)), 8));
  end function letter_of;

  function beat_of(text : string; beat : natural) return std_logic_vector is
    variable result : std_logic_vector(WIDTH-1 downto 0);
  begin
    for lane in 0 to LANES-1 loop
      result(8*lane+7 downto 8*lane) := letter_of(text, LANES*beat + lane);
    end loop;
    return result;
  end function beat_of;

  -- The maximum number of columns or rows that result in at most 65,535.
  function most(size_in, size_out : integer) return positive is
  begin
    if size_out > size_in then
      return 32767;
    end if;
    return 65535;
  end function most;

  constant WIDEST_COLUMNS : positive := most(COLUMNS_IN, COLUMNS_OUT)/OUT_BYTES;
  constant MAX_ROWS       : positive := most(ROWS_IN, ROWS_OUT);

  constant IN_BEATS       : positive := beats_of(IN_ENCODING);
  constant OUT_BEATS      : positive := beats_of(OUT_ENCODING);
  constant FRAME_ID_BEATS : positive := max(2, FRAME_ID_BYTES/LANES);

  -- FRAME_ID to SIZES take the message's parts, MULTIPLY and ROUND_UP check its sizes and scale them, MULTIPLY_OUT
  -- computes the length of the result, SEND lasts until the message is over.
  type state_t is (IDLE, FRAME_ID, ENCODING, SIZES, MULTIPLY, ROUND_UP, MULTIPLY_OUT, SEND);

  -- One dimension of the image, times OUT/IN, from the highest bit on.
  type scaled_t is record
    left      : unsigned(SIZE_BITS-1 downto 0);  -- remaining bits
    quotient  : unsigned(SIZE_BITS-1 downto 0);
    remainder : unsigned(SIZE_BITS downto 0);
  end record scaled_t;

  procedure scale(signal value : inout scaled_t; constant numerator, denominator : in positive) is
    variable sum   : unsigned(SIZE_BITS+1 downto 0);
    variable digit : unsigned(1 downto 0);
  begin
    sum := value.remainder & '0';
    if value.left(SIZE_BITS-1) = '1' then
      sum := sum + numerator;
    end if;
    digit := "00";
    if numerator > denominator and sum >= 3*denominator then
      digit := "11";
      sum   := sum - 3*denominator;
    elsif sum >= 2*denominator then
      digit := "10";
      sum   := sum - 2*denominator;
    elsif sum >= denominator then
      digit := "01";
      sum   := sum - denominator;
    end if;
    value.left      <= value.left(SIZE_BITS-2 downto 0) & '0';
    value.remainder <= sum(SIZE_BITS downto 0);
    value.quotient  <= (value.quotient(SIZE_BITS-2 downto 0) & '0') + digit;
  end procedure scale;

  -- A remainder counts as a whole.
  function rounded_up(value : scaled_t) return unsigned is
  begin
    if value.remainder /= 0 then
      return value.quotient + 1;
    end if;
    return value.quotient;
  end function rounded_up;

  signal state_r    : state_t;
  signal is_there   : std_logic;  -- a valid message that was not withdrawn
  signal matches_r  : std_logic;  -- the encoding is the supported one
  signal beat_r     : natural range 0 to max(IN_BEATS, OUT_BEATS);
  signal bit_r      : natural range 0 to SIZE_BITS-1;

  signal columns_r      : scaled_t;
  signal rows_r         : scaled_t;
  signal out_columns_r  : unsigned(SIZE_BITS-1 downto 0);
  signal out_rows_r     : unsigned(SIZE_BITS-1 downto 0);
  signal factor_r       : unsigned(SIZE_BITS-1 downto 0);
  signal product_r      : unsigned(SIZE_BITS+31 downto 0);
  signal multiplicand   : unsigned(31 downto 0);
  signal out_step_bytes : unsigned(31 downto 0);
  signal in_row_bytes   : unsigned(17 downto 0);

  signal row_bytes_r       : unsigned(17 downto 0) := (others => '0');
  signal padding_r         : unsigned(31 downto 0) := (others => '0');
  signal overlaps_r        : std_logic;  -- rows are longer than their step: the padding is negative
  signal is_legal_r        : std_logic;  -- they are not, and the image is not too large
  signal rows_to_work_on_r : std_logic_vector(15 downto 0) := (others => '0');
  signal is_empty_r        : std_logic;

  signal store_rst_n        : std_logic;
  signal store_valid        : std_logic;
  signal store_ready        : std_logic;
  signal store_last         : std_logic;
  signal stored_r           : natural range 0 to FRAME_ID_BEATS;
  signal frame_id_ready     : std_logic;
  signal frame_id_valid     : std_logic;
  signal frame_id_last      : std_logic;
  signal frame_id_taken     : std_logic;
  signal frame_id_length    : std_logic_vector(31 downto 0);
  signal frame_id_open      : std_logic;
  signal frame_id_pop       : std_logic;
  signal frame_id_sent_r    : std_logic;
  signal encoding_last      : std_logic;
  signal encoding_sent_r    : std_logic;
  signal is_sending         : std_logic;
  signal is_complete        : std_logic;

begin

  assert FRAME_ID_BYTES >= 2*LANES and FRAME_ID_BYTES mod LANES = 0
    report "firm_image_header: FRAME_ID_BYTES is " & integer'image(FRAME_ID_BYTES) & "; legal: two full beats or more"
    severity failure;
  assert COLUMNS_IN >= 1 and COLUMNS_IN <= 65535 and COLUMNS_OUT >= 1 and (COLUMNS_OUT+1)/2 <= COLUMNS_IN
    report "firm_image_header: COLUMNS_OUT is " & integer'image(COLUMNS_OUT) & "; legal: 1 to 2*COLUMNS_IN"
    severity failure;
  assert ROWS_IN >= 1 and ROWS_IN <= 65535 and ROWS_OUT >= 1 and (ROWS_OUT+1)/2 <= ROWS_IN
    report "firm_image_header: ROWS_OUT is " & integer'image(ROWS_OUT) & "; legal: 1 to 2*ROWS_IN"
    severity failure;
  assert MAX_COLUMNS >= 1 and MAX_COLUMNS <= WIDEST_COLUMNS
    report "firm_image_header: MAX_COLUMNS is " & integer'image(MAX_COLUMNS) & "; legal: 1 to "
           & integer'image(WIDEST_COLUMNS) & ", as OUT_BYTES, COLUMNS_IN and COLUMNS_OUT are"
    severity failure;

  is_there   <= in_segment_valid(0);
  is_sending <= is_there when state_r = SEND else '0';

  -- frame_id enters the store, and leaves it when all lengths are known.
  store_rst_n    <= '0' when state_r = IDLE or rst_n = '0' else '1';
  frame_id_ready <= '1' when state_r = FRAME_ID and (store_ready = '1' or stored_r = FRAME_ID_BEATS) else '0';
  frame_id_taken <= frame_id_ready and in_header_frame_id_axis_tvalid;
  store_valid    <= in_header_frame_id_axis_tvalid when state_r = FRAME_ID and stored_r /= FRAME_ID_BEATS else '0';
  store_last     <= '1' when in_header_frame_id_axis_tlast = '1' or stored_r = FRAME_ID_BEATS-1 else '0';

  frame_id_length <= in_header_frame_id_length
                     when state_r = SEND and unsigned(in_header_frame_id_length) < FRAME_ID_BYTES else
                     std_logic_vector(to_unsigned(FRAME_ID_BYTES, 32));
  frame_id_open   <= is_sending and not frame_id_sent_r;
  frame_id_pop    <= frame_id_open and out_header_frame_id_axis_tready;

  in_header_frame_id_axis_tready  <= frame_id_ready;
  out_header_frame_id_axis_tvalid <= frame_id_valid and frame_id_open;
  out_header_frame_id_axis_tlast  <= frame_id_last;

  u_frame_id : entity firm.firm_axis_fifo
    generic map (
      WIDTH => WIDTH,
      DEPTH => FRAME_ID_BEATS
    )
    port map (
      clk           => clk,
      rst_n         => store_rst_n,
      s_axis_tdata  => in_header_frame_id_axis_tdata,
      s_axis_tkeep  => in_header_frame_id_axis_tkeep,
      s_axis_tvalid => store_valid,
      s_axis_tlast  => store_last,
      s_axis_tready => store_ready,
      m_axis_tdata  => out_header_frame_id_axis_tdata,
      m_axis_tkeep  => out_header_frame_id_axis_tkeep,
      m_axis_tvalid => frame_id_valid,
      m_axis_tlast  => frame_id_last,
      m_axis_tready => frame_id_pop
    );

  in_encoding_axis_tready <= '1' when state_r = ENCODING and in_segment_valid(1) = '1' else '0';

  in_row_bytes   <= resize(unsigned(in_width(SIZE_BITS-1 downto 0)) * to_unsigned(IN_BYTES, 3), 18);
  out_step_bytes <= resize(out_columns_r * to_unsigned(OUT_BYTES, 3), 32);
  multiplicand   <= out_step_bytes when state_r = MULTIPLY_OUT else unsigned(in_step);

  proceed : process (clk)
    variable gap : unsigned(32 downto 0);
  begin
    if rising_edge(clk) then
      if state_r = IDLE then
        state_r         <= FRAME_ID;
        stored_r        <= 0;
        beat_r          <= 0;
        matches_r       <= '1';
        frame_id_sent_r <= '0';
        encoding_sent_r <= '0';

      elsif state_r = FRAME_ID then
        if frame_id_taken = '1' and stored_r /= FRAME_ID_BEATS then
          stored_r <= stored_r + 1;
        end if;
        if unsigned(in_header_frame_id_length) = 0 then
          frame_id_sent_r <= '1';
          state_r         <= ENCODING;
        elsif frame_id_taken = '1' and in_header_frame_id_axis_tlast = '1' then
          state_r <= ENCODING;
        end if;

      elsif state_r = ENCODING then
        if in_segment_valid(1) = '1' then
          if unsigned(in_encoding_length) /= IN_ENCODING'length then
            matches_r <= '0';
          end if;
          if unsigned(in_encoding_length) = 0 then
            state_r <= SIZES;
          elsif in_encoding_axis_tvalid = '1' then
            for beat in 0 to IN_BEATS-1 loop
              if beat_r = beat and not is_equal(in_encoding_axis_tdata, beat_of(IN_ENCODING, beat)) then
                matches_r <= '0';
              end if;
            end loop;
            if beat_r /= IN_BEATS then
              beat_r <= beat_r + 1;
            end if;
            if in_encoding_axis_tlast = '1' then
              state_r <= SIZES;
            end if;
          end if;
        end if;

      elsif state_r = SIZES then
        beat_r         <= 0;
        bit_r          <= 0;
        product_r      <= (others => '0');
        factor_r       <= unsigned(in_height(SIZE_BITS-1 downto 0));
        rows_r.left    <= unsigned(in_height(SIZE_BITS-1 downto 0));
        columns_r.left <= unsigned(in_width(SIZE_BITS-1 downto 0));
        rows_r.quotient     <= (others => '0');
        rows_r.remainder    <= (others => '0');
        columns_r.quotient  <= (others => '0');
        columns_r.remainder <= (others => '0');
        if in_segment_valid(2) = '1' then
          state_r <= MULTIPLY;
        end if;

      elsif state_r = MULTIPLY or state_r = MULTIPLY_OUT then
        -- One after the other, since there are enough cycles.
        if state_r = MULTIPLY then
          gap         := unsigned('0' & in_step) - row_bytes_r;
          row_bytes_r <= in_row_bytes;
          padding_r   <= gap(31 downto 0);
          overlaps_r  <= gap(32);
          is_legal_r  <= '0';
          if overlaps_r = '0' and unsigned(in_height) <= MAX_ROWS and unsigned(in_width) <= MAX_COLUMNS then
            is_legal_r <= '1';
          end if;
        end if;
        scale(rows_r, ROWS_OUT, ROWS_IN);
        scale(columns_r, COLUMNS_OUT, COLUMNS_IN);
        factor_r  <= factor_r(SIZE_BITS-2 downto 0) & '0';
        product_r <= product_r(SIZE_BITS+30 downto 0) & '0';
        if factor_r(SIZE_BITS-1) = '1' then
          product_r <= (product_r(SIZE_BITS+30 downto 0) & '0') + multiplicand;
        end if;
        if bit_r /= SIZE_BITS-1 then
          bit_r <= bit_r + 1;
        else
          bit_r <= 0;
          if state_r = MULTIPLY then
            state_r <= ROUND_UP;
          else
            state_r <= SEND;
          end if;
        end if;

      elsif state_r = ROUND_UP then
        out_columns_r <= (others => '0');
        out_rows_r    <= (others => '0');
        factor_r      <= (others => '0');
        product_r     <= (others => '0');
        rows_to_work_on_r <= (others => '0');
        is_empty_r        <= '0';
        if unsigned(in_data_length) = 0 then
          is_empty_r <= '1';
        end if;
        if matches_r = '1' and is_legal_r = '1' and product_r = unsigned(in_data_length) then
          out_columns_r <= rounded_up(columns_r);
          out_rows_r    <= rounded_up(rows_r);
          factor_r      <= rounded_up(rows_r);
          if unsigned(in_width) /= 0 then
            rows_to_work_on_r <= in_height(SIZE_BITS-1 downto 0);
          end if;
        end if;
        state_r <= MULTIPLY_OUT;

      else
        if frame_id_valid = '1' and frame_id_last = '1' and frame_id_pop = '1' then
          frame_id_sent_r <= '1';
        end if;
        if frame_id_sent_r = '1' and encoding_sent_r = '0' and out_encoding_axis_tready = '1' then
          beat_r          <= beat_r + 1;
          encoding_sent_r <= encoding_last;
        end if;
        if is_complete = '1' and out_msg_ready = '1' then
          state_r <= IDLE;
        end if;
      end if;

      if rst_n = '0' or is_there = '0' then
        state_r <= IDLE;
      end if;
    end if;
  end process proceed;

  encoding_last <= '1' when beat_r = OUT_BEATS-1 else '0';

  -- Lane by lane, because GHDL 2.0 writes constants of more than 32 bits to Verilog as strings.
  show_encoding : for lane in 0 to LANES-1 generate
    show_lane : process (beat_r)
    begin
      out_encoding_axis_tdata(8*lane+7 downto 8*lane) <= x"00";
      out_encoding_axis_tkeep(lane)                   <= '0';
      for beat in 0 to OUT_BEATS-1 loop
        if beat_r = beat and LANES*beat + lane < OUT_ENCODING'length then
          out_encoding_axis_tdata(8*lane+7 downto 8*lane) <= letter_of(OUT_ENCODING, LANES*beat + lane);
          out_encoding_axis_tkeep(lane)                   <= '1';
        end if;
      end loop;
    end process show_lane;
  end generate show_encoding;

  out_encoding_axis_tvalid <= is_sending and frame_id_sent_r and not encoding_sent_r;
  out_encoding_axis_tlast  <= encoding_last;

  is_complete <= is_sending and in_msg_valid and frame_id_sent_r and encoding_sent_r and done;

  out_header_frame_id_length <= frame_id_length;
  out_height                 <= std_logic_vector(resize(out_rows_r, 32));
  out_width                  <= std_logic_vector(resize(out_columns_r, 32));
  out_encoding_length        <= std_logic_vector(to_unsigned(OUT_ENCODING'length, 32));
  out_step                   <= std_logic_vector(out_step_bytes);
  out_data_length            <= std_logic_vector(product_r(31 downto 0));
  out_segment_valid          <= (others => is_sending);
  out_msg_valid              <= is_complete;
  in_msg_ready               <= is_complete and out_msg_ready;

  run       <= '1' when state_r = SEND else '0';
  is_empty  <= is_empty_r;
  has_none  <= '1' when state_r = SEND and product_r(31 downto 0) = 0 else '0';
  row_bytes <= std_logic_vector(row_bytes_r);
  padding   <= std_logic_vector(padding_r);
  rows      <= rows_to_work_on_r;
  show      <= is_sending and encoding_sent_r;

end architecture rtl;
