-- SPDX-License-Identifier: Apache-2.0
-- Sends each message of fixed size as a frame of full beats: its fields as one word, the lowest bits first, without a
-- header. The message may be sent several times, to one destination after the other. It is taken into a register that
-- turns by one beat at a time, so that it is whole again at the end of a frame; no path is longer for a longer message.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_message_send is
  generic (
    WIDTH      : integer := 8;
    FIELD_BITS : integer := 8;
    -- The frames of a message.
    COPIES : integer := 1
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    fields : in  std_logic_vector(FIELD_BITS-1 downto 0);
    valid  : in  std_logic;
    ready  : out std_logic;

    m_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    m_axis_tdest  : out std_logic_vector(index_bits(COPIES)-1 downto 0);  -- the number of the copy, from 0
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic
  );
end entity firm_message_send;

architecture rtl of firm_message_send is

  -- Illegal generics end at the assertions below, which need the architecture to elaborate.
  constant LANES : positive := max(1, WIDTH);
  constant BEATS : positive := max(1, (FIELD_BITS+LANES-1) / LANES);
  constant BITS  : positive := BEATS*LANES;

  signal message    : std_logic_vector(BITS-1 downto 0);  -- with zeros after its fields
  signal message_r  : std_logic_vector(BITS-1 downto 0);  -- the beat on m_axis is lowest
  signal turned     : std_logic_vector(BITS-1 downto 0);
  signal valid_r    : std_logic := '0';
  signal last_r     : std_logic := '0';  -- it is the last beat of a copy
  signal ends_r     : std_logic := '0';  -- it is the last beat of the last copy
  signal position_r : unsigned(index_bits(BEATS)-1 downto 0) := (others => '0');
  signal copy_r     : unsigned(index_bits(COPIES)-1 downto 0) := (others => '0');
  signal advances   : std_logic;
  signal loads      : std_logic;  -- if it advances

  -- '1' if a condition holds.
  function bit_of(condition : boolean) return std_logic is
  begin
    if condition then
      return '1';
    end if;
    return '0';
  end function bit_of;

begin

  assert is_stream_width(WIDTH)
    report "firm_message_send: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert FIELD_BITS >= 1
    report "firm_message_send: FIELD_BITS is " & integer'image(FIELD_BITS) & "; legal: 1 or more"
    severity failure;
  assert COPIES >= 1
    report "firm_message_send: COPIES is " & integer'image(COPIES) & "; legal: 1 or more"
    severity failure;

  message(FIELD_BITS-1 downto 0) <= fields;

  padding : if BITS > FIELD_BITS generate
    message(BITS-1 downto FIELD_BITS) <= (others => '0');
  end generate padding;

  one_beat : if BEATS = 1 generate
    turned <= message_r;
  end generate one_beat;

  several_beats : if BEATS > 1 generate
    turned <= message_r(LANES-1 downto 0) & message_r(BITS-1 downto LANES);
  end generate several_beats;

  advances <= not valid_r or m_axis_tready;
  loads    <= not valid_r or ends_r;

  ready         <= advances and loads;
  m_axis_tdata  <= message_r(WIDTH-1 downto 0);
  m_axis_tdest  <= std_logic_vector(copy_r);
  m_axis_tvalid <= valid_r;
  m_axis_tlast  <= last_r;

  -- The choice depends on two registers only, so that it is one LUT for each bit.
  turn : process (clk)
  begin
    if rising_edge(clk) then
      if advances = '1' then
        if loads = '1' then
          message_r <= message;
        else
          message_r <= turned;
        end if;
      end if;
    end if;
  end process turn;

  count : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        valid_r <= '0';
      elsif advances = '1' then
        if loads = '1' then
          valid_r    <= valid;
          last_r     <= bit_of(BEATS = 1);
          ends_r     <= bit_of(BEATS = 1 and COPIES = 1);
          position_r <= (others => '0');
          copy_r     <= (others => '0');
        elsif BEATS = 1 then
          ends_r <= bit_of(copy_r = max(0, COPIES-2));
          copy_r <= copy_r + 1;
        else
          last_r     <= bit_of(position_r = max(0, BEATS-2));
          ends_r     <= bit_of(position_r = max(0, BEATS-2) and copy_r = COPIES-1);
          position_r <= position_r + 1;
          if last_r = '1' then
            position_r <= (others => '0');
            copy_r     <= copy_r + 1;
          end if;
        end if;
      end if;
    end if;
  end process count;

end architecture rtl;
