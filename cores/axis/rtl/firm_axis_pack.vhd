-- SPDX-License-Identifier: Apache-2.0
-- Packs frames that arrive as any number of bytes per cycle into full beats. The last 1 to LANES bytes of a frame wait
-- in `rest_r` until more arrive or the frame ends, so the end may be signalled later, without a byte. A rotation of
-- radix 4 aligns arriving bytes after the waiting ones; excess bytes are then already in the lanes where the next beat
-- needs them. While a tail leaves, the next frame enters: only `m_axis_tready` ever stalls the input, a cycle late,
-- since a register slice holds the output.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_axis_pack is
  generic (
    WIDTH : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Lanes 0 to `count`-1 are appended to the frame. They are held until `ready`.
    data  : in  std_logic_vector(WIDTH-1 downto 0);
    count : in  std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    -- The frame ends with these bytes, or with earlier ones if `count` is 0. A frame without any byte is not sent.
    -- `abort` marks the end of a broken frame, which is not sent if it fits a beat of
    -- several bytes.
    last  : in  std_logic;
    abort : in  std_logic := '0';
    valid : in  std_logic;
    ready : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_axis_pack;

architecture rtl of firm_axis_pack is

  constant LANES      : natural  := WIDTH/8;
  constant SHIFT_BITS : natural  := clog2(LANES);
  constant COUNT_BITS : positive := index_bits(LANES+1);
  constant BYTES_BITS : positive := index_bits(LANES);

  subtype count_t is unsigned(COUNT_BITS-1 downto 0);

  signal rest_r  : std_logic_vector(WIDTH-1 downto 0);
  signal advance : std_logic;  -- the slice takes the available bytes

  signal beat_data  : std_logic_vector(WIDTH-1 downto 0);
  signal beat_abort : std_logic;
  signal beat_last  : std_logic;
  signal beat_valid : std_logic;
  -- The slice carries the number of a beat's bytes, 0 for all lanes, since that needs fewer registers than `tkeep`; and
  -- whether the beat is aborted, lowest.
  signal beat_bytes : std_logic_vector(BYTES_BITS-1 downto 0);
  signal beat_user  : std_logic_vector(BYTES_BITS downto 0);
  signal sent_user  : std_logic_vector(BYTES_BITS downto 0);

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_pack: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;

  -- The waiting byte is the beat; it is complete as soon as the input determines whether it is the last one.
  byte_wide : if WIDTH = 8 generate

    signal waiting_r : std_logic;  -- rest_r holds a byte
    signal ended_r   : std_logic;  -- and it is a frame's last one
    signal abort_r   : std_logic;  -- and the frame is aborted
    signal shown     : std_logic;

  begin

    shown <= waiting_r and (ended_r or (valid and (count(0) or last)));

    hold_byte : process (clk)
    begin
      if rising_edge(clk) then
        if advance = '1' and valid = '1' and count(0) = '1' then
          rest_r <= data;
        end if;
        if rst_n = '0' then
          waiting_r <= '0';
          ended_r   <= '0';
        elsif advance = '1' then
          waiting_r <= (valid and count(0)) or (waiting_r and not shown);
          ended_r   <= valid and count(0) and last;
          abort_r   <= abort;
        end if;
      end if;
    end process hold_byte;

    beat_data  <= rest_r;
    beat_bytes <= "0";
    beat_valid <= shown;
    beat_last  <= ended_r or not count(0);
    beat_abort <= abort_r when ended_r = '1' else abort and not count(0);

  end generate byte_wide;

  wider : if WIDTH > 8 generate

    -- Moves all lanes up by `shift`; the highest ones wrap to lane 0.
    function rotated(lanes_in : std_logic_vector; shift : unsigned) return std_logic_vector is
      variable moved : std_logic_vector(WIDTH-1 downto 0);
      variable digit : std_logic_vector(1 downto 0);

      -- Bits of a step of stage n, which moves by 0 to 3 of them. Yosys maps it best with the widest step first.
      function step_of(stage : positive) return positive is
      begin
        return 8 * max(1, LANES / 4**stage);
      end function step_of;

    begin
      moved := lanes_in;
      for stage in 1 to SHIFT_BITS/2 loop
        digit := std_logic_vector(shift(SHIFT_BITS-2*stage+1 downto SHIFT_BITS-2*stage));
        if digit = "01" then
          moved := moved(WIDTH-1-step_of(stage) downto 0) & moved(WIDTH-1 downto WIDTH-step_of(stage));
        elsif digit = "10" then
          moved := moved(WIDTH-1-2*step_of(stage) downto 0) & moved(WIDTH-1 downto WIDTH-2*step_of(stage));
        elsif digit = "11" then
          moved := moved(WIDTH-1-3*step_of(stage) downto 0) & moved(WIDTH-1 downto WIDTH-3*step_of(stage));
        end if;
      end loop;
      if SHIFT_BITS mod 2 = 1 then
        if shift(0) = '1' then
          moved := moved(WIDTH-9 downto 0) & moved(WIDTH-1 downto WIDTH-8);
        end if;
      end if;
      return moved;
    end function rotated;

    signal waiting_r : count_t;                          -- the bytes in rest_r, from lane 0 up
    signal tail_r    : std_logic;                        -- they end a frame
    signal abort_r   : std_logic;                        -- with an abort
    signal begun_r   : std_logic;                        -- a beat of their frame has left
    signal shift_r   : unsigned(SHIFT_BITS-1 downto 0);  -- the lane of the next byte

    signal turned   : std_logic_vector(WIDTH-1 downto 0);  -- the input, rotated to its lanes
    signal waits    : std_logic_vector(LANES-1 downto 0);  -- the lanes of rest_r that hold a byte
    signal arriving : count_t;
    signal filled   : unsigned(COUNT_BITS downto 0);       -- the bytes of the arriving frame
    signal overflow : std_logic;                           -- they exceed a beat

  begin

    turned   <= rotated(data, shift_r);
    arriving <= unsigned(count) when valid = '1' else (others => '0');
    filled   <= resize(arriving, COUNT_BITS+1) when tail_r = '1' else
                resize(arriving, COUNT_BITS+1) + waiting_r;
    overflow <= not is_below(std_logic_vector(filled), LANES+1);

    fill_lanes : for lane in 0 to LANES-1 generate
      waits(lane)     <= not is_below(std_logic_vector(waiting_r), lane+1);
      beat_data(8*lane+7 downto 8*lane) <= rest_r(8*lane+7 downto 8*lane) when waits(lane) = '1' else
                                           turned(8*lane+7 downto 8*lane);
    end generate fill_lanes;

    beat_last  <= tail_r;
    beat_abort <= tail_r and abort_r;
    beat_valid <= tail_r or overflow;
    beat_bytes <= gated(std_logic_vector(waiting_r(SHIFT_BITS-1 downto 0)), tail_r);

    move_bytes : process (clk)
    begin
      if rising_edge(clk) and advance = '1' then
        for lane in 0 to LANES-1 loop
          if overflow = '1' or tail_r = '1' or waits(lane) = '0' then
            rest_r(8*lane+7 downto 8*lane) <= turned(8*lane+7 downto 8*lane);
          end if;
        end loop;
      end if;
    end process move_bytes;

    count_bytes : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          waiting_r <= (others => '0');
          tail_r    <= '0';
          shift_r   <= (others => '0');
          begun_r   <= '0';
        elsif advance = '1' then
          waiting_r <= filled(COUNT_BITS-1 downto 0);
          if overflow = '1' then
            waiting_r <= resize(filled - LANES, COUNT_BITS);
          end if;
          shift_r <= filled(SHIFT_BITS-1 downto 0);
          tail_r  <= '0';
          abort_r <= abort;
          begun_r <= begun_r or overflow;
          if valid = '1' and last = '1' then
            shift_r <= (others => '0');
            begun_r <= '0';
            if abort = '1' and begun_r = '0' and overflow = '0' then
              waiting_r <= (others => '0');
            elsif filled /= 0 then
              tail_r <= '1';
            end if;
          end if;
        end if;
      end if;
    end process count_bytes;

  end generate wider;

  -- The assert reports another width.
  legal : if is_stream_width(WIDTH) generate

    beat_user       <= beat_bytes & beat_abort;
    m_axis_tuser(0) <= sent_user(0);

    mark_lanes : for lane in 0 to LANES-1 generate
      m_axis_tkeep(lane) <= is_equal(sent_user(BYTES_BITS downto 1), 0) or
                            not is_below(sent_user(BYTES_BITS downto 1), lane+1);
    end generate mark_lanes;

    u_slice : entity firm.firm_axis_register_slice
      generic map (
        WIDTH     => WIDTH,
        USER_BITS => BYTES_BITS+1
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => beat_data,
        s_axis_tkeep  => (others => '1'),
        s_axis_tuser  => beat_user,
        s_axis_tvalid => beat_valid,
        s_axis_tlast  => beat_last,
        s_axis_tready => advance,
        m_axis_tdata  => m_axis_tdata,
        m_axis_tkeep  => open,
        m_axis_tuser  => sent_user,
        m_axis_tid    => open,
        m_axis_tvalid => m_axis_tvalid,
        m_axis_tlast  => m_axis_tlast,
        m_axis_tready => m_axis_tready
      );

  end generate legal;

  ready <= advance;

end architecture rtl;
