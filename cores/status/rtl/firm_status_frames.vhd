-- SPDX-License-Identifier: Apache-2.0
-- Reads and writes registers by frames, between the host and the Manager. A request is a frame from the host with the
-- highest id, 255 or 65,535, and eight bytes: an address, with bit 31 to write, and data. The answer has the same form,
-- with the register's word before the access. It leaves between two frames of the Manager. A frame of this id that has
-- another form or is aborted is dropped. All other frames pass unchanged.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_status_frames is
  generic (
    WIDTH : integer := 8;
    -- Bytes of a frame's id, 1 or 2.
    ID_BYTES : integer := 1;
    -- 1 to 31.
    ADDRESS_BITS : integer := 16
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Until the counters are clear, frames from the host wait, so that all are counted.
    is_clear : in std_logic;

    -- The host.
    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;
    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    m_axis_tuser  : out std_logic_vector(0 downto 0);
    m_axis_tid    : out std_logic_vector(8*ID_BYTES-1 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    -- The Manager.
    inner_s_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    inner_s_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    inner_s_axis_tuser  : out std_logic_vector(0 downto 0);
    inner_s_axis_tvalid : out std_logic;
    inner_s_axis_tlast  : out std_logic;
    inner_s_axis_tready : in  std_logic;
    inner_m_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    inner_m_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    inner_m_axis_tuser  : in  std_logic_vector(0 downto 0) := "0";
    inner_m_axis_tid    : in  std_logic_vector(8*ID_BYTES-1 downto 0);
    inner_m_axis_tvalid : in  std_logic;
    inner_m_axis_tlast  : in  std_logic;
    inner_m_axis_tready : out std_logic;

    -- The registers: `bus_valid` pulses, and the rest is stable until `bus_done` pulses.
    bus_valid      : out std_logic;
    bus_write      : out std_logic;
    bus_address    : out std_logic_vector(ADDRESS_BITS-1 downto 0);
    bus_write_data : out std_logic_vector(31 downto 0);
    bus_read_data  : in  std_logic_vector(31 downto 0);
    bus_done       : in  std_logic
  );
end entity firm_status_frames;

architecture rtl of firm_status_frames is

  constant STATUS_ID   : std_logic_vector(8*ID_BYTES-1 downto 0) := (others => '1');
  constant FRAME_BYTES : positive := ID_BYTES + 12;
  -- The first bits in a request.
  constant LENGTH_BIT  : positive := 8*ID_BYTES;
  constant ADDRESS_BIT : positive := LENGTH_BIT + 32;
  constant DATA_BIT    : positive := ADDRESS_BIT + 32;
  -- A beat is shorter than an id, whose first byte alone does not distinguish a request from another frame.
  constant IS_SPLIT    : boolean  := WIDTH < 8*ID_BYTES;
  -- The payload's length, after the id.
  constant LENGTH      : std_logic_vector(31 downto 0) := (3 => '1', others => '0');
  constant LANES       : positive := max(1, WIDTH/8);
  -- Lanes that a request uses.
  constant USED_LANES  : positive := LANES - max(0, LANES-16);
  constant BEAT_BITS   : positive := 8*USED_LANES;
  constant BEATS       : positive := (FRAME_BYTES + USED_LANES - 1) / USED_LANES;
  constant FRAME_BITS  : positive := BEATS*BEAT_BITS;
  -- Bytes in the last beat of a request.
  constant LAST_BYTES  : positive := FRAME_BYTES - (BEATS-1)*USED_LANES;

  function last_keep return std_logic_vector is
    variable keep : std_logic_vector(LANES-1 downto 0) := (others => '0');
  begin
    keep(LAST_BYTES-1 downto 0) := (others => '1');
    return keep;
  end function last_keep;

  constant LAST_KEPT   : std_logic_vector(LANES-1 downto 0) := last_keep;
  constant FIRST_PLACE : std_logic_vector(BEATS-1 downto 0) := (0 => '1', others => '0');
  constant ALL_KEPT    : std_logic_vector(LANES-1 downto 0) := (others => '1');

  type state_t is (RECEIVES, ASKS, AWAITS, ANSWERS, SENDS);

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tuser  : std_logic_vector(0 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal is_first_r  : std_logic;
  signal is_status_r : std_logic;
  signal is_status   : std_logic;  -- this beat is part of a request
  -- If beats are shorter than ids: the beat may be part of a request, and the beat before it was the first byte of one.
  signal may_begin   : std_logic;
  signal has_begun_r : std_logic;
  signal returns     : std_logic;  -- it was not, so it is forwarded before this beat
  signal takes       : std_logic;

  signal state_r     : state_t;
  signal frame_r     : std_logic_vector(FRAME_BITS-1 downto 0) := (others => '0');
  signal next_frame  : std_logic_vector(FRAME_BITS-1 downto 0);
  -- After a beat of an answer, its other beats.
  signal rest_of_frame : std_logic_vector(FRAME_BITS-1 downto 0);
  signal next_place    : std_logic_vector(BEATS-1 downto 0);
  -- Bit k is '1' at beat k of a request or an answer; zeros are a request that is too long.
  signal place_r     : std_logic_vector(BEATS-1 downto 0);
  signal is_wrong_r  : std_logic;

  signal is_sending  : std_logic;
  signal is_within_r : std_logic;  -- the Manager's frame has begun, but not ended
  signal out_tvalid  : std_logic;
  signal out_tlast   : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_status_frames: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert ID_BYTES = 1 or ID_BYTES = 2
    report "firm_status_frames: ID_BYTES is " & integer'image(ID_BYTES) & "; legal: 1, 2"
    severity failure;
  assert ADDRESS_BITS >= 1 and ADDRESS_BITS <= 31
    report "firm_status_frames: ADDRESS_BITS is " & integer'image(ADDRESS_BITS) & "; legal: 1 to 31"
    severity failure;

  u_slice : entity firm.firm_axis_register_slice
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tkeep  => s_axis_tkeep,
      s_axis_tuser  => s_axis_tuser,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      m_axis_tdata  => in_tdata,
      m_axis_tkeep  => in_tkeep,
      m_axis_tuser  => in_tuser,
      m_axis_tid    => open,
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready
    );

  whole_ids : if not IS_SPLIT generate
    is_status   <= is_status_r when is_first_r = '0' else
                   '0' when ID_BYTES = 2 and in_tkeep(ID_BYTES-1) = '0' else
                   is_equal(in_tdata(8*ID_BYTES-1 downto 0), 256**ID_BYTES-1);
    may_begin   <= '0';
    returns     <= '0';
    has_begun_r <= '0';
  end generate whole_ids;

  parts_of_ids : if IS_SPLIT generate
    may_begin <= is_first_r and not has_begun_r and not in_tlast and is_equal(in_tdata(7 downto 0), 255);
    is_status <= (has_begun_r and is_equal(in_tdata(7 downto 0), 255)) when is_first_r = '1' else is_status_r;
    returns   <= has_begun_r and in_tvalid and not is_status;

    keep_first_byte : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          has_begun_r <= '0';
        elsif takes = '1' then
          has_begun_r <= may_begin;
        elsif returns = '1' and inner_s_axis_tready = '1' then
          has_begun_r <= '0';
        end if;
      end if;
    end process keep_first_byte;
  end generate parts_of_ids;

  in_tready <= '0' when is_clear = '0' or returns = '1' else
               '0' when (is_status = '1' or may_begin = '1') and state_r /= RECEIVES else
               '1' when is_status = '1' or may_begin = '1' else
               inner_s_axis_tready;
  takes     <= in_tvalid and in_tready;

  inner_s_axis_tdata  <= in_tdata when returns = '0' else (others => '1');
  inner_s_axis_tkeep  <= in_tkeep;
  inner_s_axis_tuser  <= gated(in_tuser, not returns);
  inner_s_axis_tvalid <= in_tvalid and is_clear and not is_status and not may_begin;
  inner_s_axis_tlast  <= in_tlast and not returns;

  note_kind : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        is_first_r  <= '1';
        is_status_r <= '0';
      elsif takes = '1' and may_begin = '0' then
        is_first_r  <= in_tlast;
        is_status_r <= is_status;
      elsif returns = '1' and inner_s_axis_tready = '1' then
        is_first_r  <= '0';
        is_status_r <= '0';
      end if;
    end if;
  end process note_kind;

  whole_frame : if BEATS = 1 generate
    next_frame    <= in_tdata(BEAT_BITS-1 downto 0);
    rest_of_frame <= frame_r;
    next_place    <= "0";
  end generate whole_frame;

  parts_of_frame : if BEATS > 1 generate
    next_frame    <= in_tdata(BEAT_BITS-1 downto 0) & frame_r(FRAME_BITS-1 downto BEAT_BITS);
    rest_of_frame <= frame_r(BEAT_BITS-1 downto 0) & frame_r(FRAME_BITS-1 downto BEAT_BITS);
    next_place    <= place_r(BEATS-2 downto 0) & '0';
  end generate parts_of_frame;

  serve : process (clk)
  begin
    if rising_edge(clk) then
      if state_r = RECEIVES then
        if returns = '1' then
          place_r    <= FIRST_PLACE;
          is_wrong_r <= '0';
        elsif takes = '1' and (is_status = '1' or may_begin = '1') then
          frame_r <= next_frame;
          place_r <= next_place;
          if in_tkeep /= ALL_KEPT then
            is_wrong_r <= '1';
          end if;
          if in_tlast = '1' then
            place_r    <= FIRST_PLACE;
            is_wrong_r <= '0';
            if is_wrong_r = '0' and place_r(BEATS-1) = '1' and in_tkeep = LAST_KEPT and in_tuser = "0"
               and next_frame(ADDRESS_BIT-1 downto LENGTH_BIT) = LENGTH then
              state_r <= ASKS;
            end if;
          end if;
        end if;
      elsif state_r = ASKS then
        state_r <= AWAITS;
      elsif state_r = AWAITS then
        if bus_done = '1' then
          frame_r(DATA_BIT+31 downto DATA_BIT) <= bus_read_data;
          state_r                              <= ANSWERS;
        end if;
      elsif state_r = ANSWERS then
        -- The Manager's beat on offer must not be withdrawn, and its frame not be split.
        if (inner_m_axis_tvalid = '0' and is_within_r = '0')
           or (inner_m_axis_tvalid = '1' and inner_m_axis_tlast = '1' and m_axis_tready = '1') then
          state_r <= SENDS;
        end if;
      elsif state_r = SENDS then
        if m_axis_tready = '1' then
          frame_r <= rest_of_frame;
          place_r <= next_place;
          if out_tlast = '1' then
            place_r <= FIRST_PLACE;
            state_r <= RECEIVES;
          end if;
        end if;
      end if;
      if rst_n = '0' then
        state_r    <= RECEIVES;
        place_r    <= FIRST_PLACE;
        is_wrong_r <= '0';
      end if;
    end if;
  end process serve;

  bus_valid      <= '1' when state_r = ASKS else '0';
  bus_write      <= frame_r(DATA_BIT-1);
  bus_address    <= frame_r(ADDRESS_BIT+ADDRESS_BITS-1 downto ADDRESS_BIT);
  bus_write_data <= frame_r(DATA_BIT+31 downto DATA_BIT);

  note_place : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        is_within_r <= '0';
      elsif inner_m_axis_tvalid = '1' and is_sending = '0' and m_axis_tready = '1' then
        is_within_r <= not inner_m_axis_tlast;
      end if;
    end if;
  end process note_place;

  is_sending <= '1' when state_r = SENDS else '0';
  out_tvalid <= inner_m_axis_tvalid or is_sending;

  out_tlast  <= place_r(BEATS-1) when is_sending = '1' else inner_m_axis_tlast;

  choose_data : process (is_sending, frame_r, out_tlast, inner_m_axis_tdata, inner_m_axis_tkeep, inner_m_axis_tuser,
                         inner_m_axis_tid)
  begin
    m_axis_tdata <= inner_m_axis_tdata;
    m_axis_tkeep <= inner_m_axis_tkeep;
    m_axis_tuser <= inner_m_axis_tuser;
    m_axis_tid   <= inner_m_axis_tid;
    if is_sending = '1' then
      m_axis_tdata                       <= (others => '0');
      m_axis_tdata(BEAT_BITS-1 downto 0) <= frame_r(BEAT_BITS-1 downto 0);
      m_axis_tkeep                       <= ALL_KEPT;
      m_axis_tuser                       <= "0";
      m_axis_tid                         <= STATUS_ID;
      if out_tlast = '1' then
        m_axis_tkeep <= LAST_KEPT;
      end if;
    end if;
  end process choose_data;

  m_axis_tvalid       <= out_tvalid;
  m_axis_tlast        <= out_tlast;
  inner_m_axis_tready <= m_axis_tready and not is_sending;

end architecture rtl;
