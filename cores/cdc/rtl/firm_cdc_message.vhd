-- SPDX-License-Identifier: Apache-2.0
-- Transfers the handshake of a message, or of an array's element, between two clock domains. The source shows one level
-- per segment, and one level for the arrival of all segments. They cross to the sink and appear there in this order.
-- The sink returns the levels that it has seen, and whether it has taken the message. Both return to zero before the
-- next message, so nothing is lost or seen twice at any ratio of the clocks, and a message may be withdrawn at any
-- time.
--
-- The fields are registered in the source's domain until the sink has released them, because a source that withdraws
-- its message may change them at once. A source that never withdraws does not need this: its fields hold until
-- `s_ready`.
--
-- Streams and elements within the message cross in their own entities (firm_cdc_stream, firm_cdc_message). These must
-- not run ahead of the message: they accept nothing before `s_settled`, and the next message waits for all of them.
--
-- Constraint: fields are stable one cycle of `m_clk` before the sink reads them; limit their delay to that.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_cdc_message is
  generic (
    -- Bits of segment_valid.
    SEGMENTS : integer := 1;
    -- Bits of all fields.
    FIELD_BITS : integer := 1;
    -- The number of streams and elements within the message.
    PARTS : integer := 1
  );
  port (
    s_clk   : in std_logic;
    s_rst_n : in std_logic;

    -- From the containing message: this one may begin.
    s_enable : in std_logic := '1';

    s_fields        : in  std_logic_vector(FIELD_BITS-1 downto 0) := (others => '0');
    s_segment_valid : in  std_logic_vector(SEGMENTS-1 downto 0);
    s_valid         : in  std_logic;
    -- High for a cycle when the sink has the message.
    s_ready         : out std_logic;

    -- The sink sees every segment that the source shows.
    s_settled   : out std_logic;
    -- The sink sees nothing of the message, and nothing is in transit.
    s_idle      : out std_logic;
    s_part_idle : in  std_logic_vector(PARTS-1 downto 0) := (others => '1');

    m_clk   : in std_logic;
    m_rst_n : in std_logic;

    -- From the containing message: it is still valid.
    m_enable : in std_logic := '1';

    m_fields        : out std_logic_vector(FIELD_BITS-1 downto 0);
    m_segment_valid : out std_logic_vector(SEGMENTS-1 downto 0);
    m_valid         : out std_logic;
    m_ready         : in  std_logic
  );
end entity firm_cdc_message;

architecture rtl of firm_cdc_message is

  constant NONE      : std_logic_vector(SEGMENTS downto 0) := (others => '0');
  constant ALL_PARTS : std_logic_vector(PARTS-1 downto 0)  := (others => '1');

  -- One bit per segment; the bit above is set when all have arrived.
  subtype levels_t is std_logic_vector(SEGMENTS downto 0);

  -- Of the source's domain.
  signal request_r   : levels_t;
  signal fields_r    : std_logic_vector(FIELD_BITS-1 downto 0);
  signal withdrawn_r : std_logic;  -- the source has withdrawn the message before the sink has seen its levels
  signal returned    : std_logic_vector(SEGMENTS+1 downto 0);
  signal shown       : levels_t;
  signal done        : std_logic;
  signal is_clear    : std_logic;  -- the sink is ready for another message
  signal is_seen     : std_logic;  -- the sink has seen all requested levels
  signal begins      : std_logic;

  -- In the sink's domain: the levels that it has seen; the bit above is set when it has finished the message.
  signal requested : levels_t;
  signal answer_r  : std_logic_vector(SEGMENTS+1 downto 0);
  signal is_fallen : std_logic;  -- the message was withdrawn
  signal visible   : levels_t;

  -- Constraints name these registers, so no tool may merge, duplicate or move them.
  attribute dont_touch   : string;
  attribute preserve     : boolean;
  attribute dont_merge   : boolean;
  attribute syn_preserve : boolean;
  attribute dont_touch of request_r, answer_r   : signal is "true";
  attribute preserve of request_r, answer_r     : signal is true;
  attribute dont_merge of request_r, answer_r   : signal is true;
  attribute syn_preserve of request_r, answer_r : signal is true;

begin

  assert SEGMENTS >= 1
    report "firm_cdc_message: SEGMENTS is " & integer'image(SEGMENTS) & "; legal: 1 or more"
    severity failure;
  assert FIELD_BITS >= 1
    report "firm_cdc_message: FIELD_BITS is " & integer'image(FIELD_BITS) & "; legal: 1 or more"
    severity failure;
  assert PARTS >= 1
    report "firm_cdc_message: PARTS is " & integer'image(PARTS) & "; legal: 1 or more"
    severity failure;

  -- The source's domain

  u_return : entity firm.firm_cdc_sync
    generic map (
      BITS => SEGMENTS+2
    )
    port map (
      clk    => s_clk,
      level  => answer_r,
      synced => returned
    );

  shown    <= returned(SEGMENTS downto 0);
  done     <= returned(SEGMENTS+1);
  is_clear <= '1' when shown = NONE and done = '0' and s_part_idle = ALL_PARTS else '0';
  is_seen  <= '1' when shown(SEGMENTS-1 downto 0) = request_r(SEGMENTS-1 downto 0) else '0';
  begins   <= s_enable and is_clear;

  ask : process (s_clk)
  begin
    if rising_edge(s_clk) then
      if s_rst_n = '0' or done = '1' then
        request_r   <= (others => '0');
        withdrawn_r <= '0';
      elsif request_r(0) = '1' and (withdrawn_r = '1' or s_segment_valid(0) = '0') then
        -- A level falls only after it was seen, so no pulse can be lost.
        withdrawn_r <= '1';
        if is_seen = '1' then
          request_r   <= (others => '0');
          withdrawn_r <= '0';
        end if;
      elsif s_segment_valid(0) = '1' and (request_r(0) = '1' or begins = '1') then
        request_r <= s_valid & s_segment_valid;
        fields_r  <= s_fields;
      end if;
    end if;
  end process ask;

  s_ready   <= request_r(0) and done and not withdrawn_r;
  s_settled <= '1' when request_r(0) = '1' and withdrawn_r = '0' and done = '0'
                        and shown(SEGMENTS-1 downto 0) = s_segment_valid else
               '0';
  s_idle    <= '1' when request_r(0) = '0' and shown = NONE and done = '0' else '0';

  -- The sink's domain

  u_request : entity firm.firm_cdc_sync
    generic map (
      BITS => SEGMENTS+1
    )
    port map (
      clk    => m_clk,
      level  => request_r,
      synced => requested
    );

  -- Levels that rise or fall together may arrive at different times, in any order. Each is shown only after those
  -- before it, and none after the first of them has fallen. During a reset, which may already be over for the sink, the
  -- levels are those from before it.
  is_fallen <= '1' when (answer_r(SEGMENTS downto 0) and not requested) /= NONE else '0';

  order : process (requested, m_rst_n, m_enable, answer_r, is_fallen)
    variable before : std_logic;
  begin
    before := m_rst_n and m_enable and not answer_r(SEGMENTS+1) and not is_fallen;
    for place in 0 to SEGMENTS loop
      before         := before and requested(place);
      visible(place) <= before;
    end loop;
  end process order;

  answer : process (m_clk)
  begin
    if rising_edge(m_clk) then
      if m_rst_n = '0' then
        answer_r <= (others => '0');
      else
        answer_r(SEGMENTS downto 0) <= requested;
        if requested = NONE then
          answer_r(SEGMENTS+1) <= '0';
        elsif is_fallen = '1' or (visible(SEGMENTS) = '1' and m_ready = '1') then
          answer_r(SEGMENTS+1) <= '1';
        end if;
      end if;
    end if;
  end process answer;

  m_fields        <= fields_r;
  m_segment_valid <= visible(SEGMENTS-1 downto 0);
  m_valid         <= visible(SEGMENTS);

end architecture rtl;
