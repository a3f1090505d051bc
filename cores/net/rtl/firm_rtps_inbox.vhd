-- SPDX-License-Identifier: Apache-2.0
-- Stores the words of a packet until the packet is known to be good, then outputs them one by one: bytes of the fields
-- that firm_rtps_walker finds, and of the payloads of the writers of discovery, with their parameters. A fragment of
-- RTPS is not a list of parameters, so its payload is dropped.
--
-- After the last word of a submessage, the user may process it before it takes the next word.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_inbox is
  generic (
    DEPTH : integer := 1024 -- words of waiting packets, a power of two
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The prefix of the node; the first byte on the line highest.
    prefix : in std_logic_vector(95 downto 0);

    -- From firm_rtps_walker.
    field_valid   : in std_logic;
    field_address : in std_logic_vector(RECORD_BITS-1 downto 0);
    field_data    : in std_logic_vector(7 downto 0);
    payload_valid : in std_logic;
    payload_data  : in std_logic_vector(7 downto 0);
    kind          : in std_logic_vector(7 downto 0);
    is_submessage : in std_logic;
    is_whole      : in std_logic;
    is_faulty     : in std_logic;
    is_foreign    : in std_logic;
    is_aborted    : in std_logic;

    -- A word moves with `take`.
    take     : in  std_logic;
    has_word : out std_logic;
    is_end   : out std_logic;  -- the word is the last one of its submessage

    -- The word that has moved, one cycle later: a byte of a field, a byte of a payload, or none.
    is_taken  : out std_logic;
    has_field : out std_logic;
    address   : out std_logic_vector(RECORD_BITS-1 downto 0);
    data      : out std_logic_vector(7 downto 0);

    -- The submessage that arrives is for this node. Words of other submessages are dropped.
    is_mine : out std_logic;

    -- Of the submessage, from its last word on.
    writer   : out std_logic_vector(31 downto 0);
    is_large : out std_logic;  -- one of its sequence numbers has more than 32 bits
    is_gone  : out std_logic;  -- its status reports the end of the instance

    -- Of the byte of a payload, with that word: see firm_rtps_parameters.
    begins    : out std_logic;
    is_value  : out std_logic;
    id        : out std_logic_vector(15 downto 0);
    size      : out std_logic_vector(15 downto 0);
    place     : out std_logic_vector(15 downto 0);
    is_little : out std_logic;
    is_last   : out std_logic;

    -- Pulses.
    is_lost : out std_logic; -- a packet without room
    is_cut  : out std_logic  -- a payload whose list of parameters has no end
  );
end entity firm_rtps_inbox;

architecture rtl of firm_rtps_inbox is

  -- Addresses at which the record has no field.
  constant AT_PAYLOAD : std_logic_vector(RECORD_BITS-1 downto 0) := x"ff";
  constant AT_NOTHING : std_logic_vector(RECORD_BITS-1 downto 0) := x"fe";

  signal writer_r    : std_logic_vector(31 downto 0) := (others => '0');  -- of the submessage that arrives
  signal listens_r   : std_logic;                                         -- its payload is evaluated
  signal ends_packet : std_logic;
  signal word_r      : std_logic_vector(16 downto 0) := (others => '0');
  signal valid_r     : std_logic;
  signal ends_r      : std_logic;
  signal spoils_r    : std_logic_vector(0 downto 0);
  signal stored      : std_logic_vector(16 downto 0);
  signal has_stored  : std_logic;
  signal ready       : std_logic;
  signal taken_r     : std_logic_vector(16 downto 0) := (others => '0');
  signal has_r       : std_logic;
  signal takes       : std_logic;
  signal shown       : std_logic_vector(RECORD_BITS-1 downto 0);
  signal at          : unsigned(RECORD_BITS-1 downto 0);
  signal value       : std_logic_vector(7 downto 0);
  signal new_kind    : std_logic;
  signal list_valid  : std_logic;
  signal in_list     : std_logic;
  signal ended_r     : std_logic;  -- the previous word was the last one of its submessage

  signal from_r  : std_logic_vector(31 downto 0) := (others => '0');  -- its writer
  signal large_r : std_logic := '0';
  signal gone_r  : std_logic := '0';

  -- Of the packet that arrives.
  signal mine_r   : std_logic;  -- the last destination was this node, or any
  signal mine     : std_logic;  -- the arriving byte is for this node
  signal own_r    : std_logic_vector(95 downto 0) := (others => '0');  -- the prefix, turned
  signal ours_r   : std_logic;  -- the destination was this node, before this byte
  signal all_r    : std_logic;  -- the destination was zero, before this byte
  signal starts   : std_logic;  -- this is the first byte of a destination
  signal ours     : std_logic;
  signal all_zero : std_logic;

  function is_zero(byte : std_logic_vector(7 downto 0)) return std_logic is
  begin
    if byte = x"00" then
      return '1';
    end if;
    return '0';
  end function is_zero;

begin

  -- ------------------------------------------------------------------ what is for this node

  starts   <= '1' when unsigned(field_address) = RECORD_DESTINATION else '0';
  ours     <= (ours_r or starts) and is_zero(field_data xor own_r(95 downto 88));
  all_zero <= (all_r or starts) and is_zero(field_data);
  -- A packet is for this node until it names a destination.
  mine     <= '1' when field_valid = '1' and unsigned(field_address) = RECORD_SOURCE_MAC else mine_r;
  is_mine  <= mine_r;

  note_destination : process (clk)
  begin
    if rising_edge(clk) then
      if field_valid = '1' then
        if unsigned(field_address) = RECORD_SOURCE_MAC then
          mine_r <= '1';
        elsif unsigned(field_address) = RECORD_KIND then
          own_r <= prefix;
        elsif is_in(field_address, RECORD_DESTINATION, 12) = '1' then
          own_r  <= own_r(87 downto 0) & own_r(95 downto 88);
          ours_r <= ours;
          all_r  <= all_zero;
          if unsigned(field_address) = RECORD_DESTINATION+11 then
            mine_r <= ours or all_zero;
          end if;
        end if;
      end if;
    end if;
  end process note_destination;

  -- ------------------------------------------------------------------ words of packets

  ends_packet <= is_whole or is_faulty or is_foreign or is_aborted;

  write_word : process (clk)
  begin
    if rising_edge(clk) then
      if field_valid = '1' and is_in(field_address, RECORD_WRITER, 4) = '1' then
        writer_r <= writer_r(23 downto 0) & field_data;
      end if;
      listens_r <= '0';
      if kind = RTPS_DATA and (writer_r = RTPS_PARTICIPANT_WRITER or writer_r = RTPS_PUBLICATIONS_WRITER
                               or writer_r = RTPS_SUBSCRIPTIONS_WRITER) then
        listens_r <= '1';
      end if;
      word_r(16)          <= is_submessage and mine;
      word_r(15 downto 8) <= AT_NOTHING;
      word_r(7 downto 0)  <= payload_data;
      if field_valid = '1' then
        word_r(7 downto 0) <= field_data;
      end if;
      if field_valid = '1' and mine = '1' then
        word_r(15 downto 8) <= field_address;
      elsif payload_valid = '1' and listens_r = '1' and mine = '1' then
        word_r(15 downto 8) <= AT_PAYLOAD;
      end if;
      -- Submessages for another node are not stored, but each packet needs its end.
      valid_r     <= ends_packet or (mine and (field_valid or is_submessage or (payload_valid and listens_r)));
      ends_r      <= ends_packet;
      spoils_r(0) <= is_foreign or is_aborted;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process write_word;

  u_store : entity firm.firm_mac_store
    generic map (
      DEPTH     => DEPTH,
      DATA_BITS => 17
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => word_r,
      s_axis_tuser  => spoils_r,
      s_axis_tvalid => valid_r,
      s_axis_tlast  => ends_r,
      m_axis_tdata  => stored,
      m_axis_tvalid => has_stored,
      m_axis_tlast  => open,
      m_axis_tready => ready,
      is_lost       => is_lost
    );

  ready <= take or not has_r;

  hold_word : process (clk)
  begin
    if rising_edge(clk) then
      if ready = '1' then
        taken_r <= stored;
        has_r   <= has_stored;
      end if;
      if rst_n = '0' then
        has_r <= '0';
      end if;
    end if;
  end process hold_word;

  takes    <= take and has_r;
  shown    <= taken_r(15 downto 8);
  at       <= unsigned(shown);
  value    <= taken_r(7 downto 0);
  has_word <= has_r;
  is_end   <= taken_r(16);

  show_word : process (clk)
  begin
    if rising_edge(clk) then
      is_taken  <= takes;
      has_field <= '1';
      if shown = AT_PAYLOAD or shown = AT_NOTHING then
        has_field <= '0';
      end if;
      address <= shown;
      data    <= value;
      begins  <= new_kind;
      if rst_n = '0' then
        is_taken <= '0';
      end if;
    end if;
  end process show_word;

  -- ------------------------------------------------------------------ the submessage

  note_submessage : process (clk)
  begin
    if rising_edge(clk) then
      if takes = '1' then
        if at = RECORD_KIND then
          gone_r  <= '0';
          large_r <= '0';
        elsif is_in(shown, RECORD_WRITER, 4) = '1' then
          from_r <= from_r(23 downto 0) & value;
        elsif is_in(shown, RECORD_NUMBER, 16) = '1' and at(2) = '1' then
          large_r <= large_r or not is_zero(value);
        elsif at = RECORD_STATUS+3 then
          gone_r <= value(0) or value(1);
        end if;
      end if;
    end if;
  end process note_submessage;

  writer   <= from_r;
  is_large <= large_r;
  is_gone  <= gone_r;

  -- ------------------------------------------------------------------ parameters

  new_kind   <= '1' when takes = '1' and at = RECORD_KIND else '0';
  list_valid <= '1' when takes = '1' and shown = AT_PAYLOAD else '0';

  u_parameters : entity firm.firm_rtps_parameters
    port map (
      clk       => clk,
      begins    => new_kind,
      s_valid   => list_valid,
      s_data    => value,
      is_value  => is_value,
      id        => id,
      size      => size,
      place     => place,
      is_little => is_little,
      is_last   => is_last,
      is_open   => in_list
    );

  -- The last word may be the last byte of the list.
  note_end : process (clk)
  begin
    if rising_edge(clk) then
      ended_r <= takes and taken_r(16) and rst_n;
    end if;
  end process note_end;

  is_cut <= ended_r and in_list;

end architecture rtl;
