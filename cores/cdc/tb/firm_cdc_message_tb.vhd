-- SPDX-License-Identifier: Apache-2.0
-- Sends messages of variable size between two clocks: a field, a stream, and an array of elements, each with a field
-- and a stream. Lengths and bytes derive from the message's number, which is its first field, so the sink can predict
-- them. It checks at every edge that valid fields are stable, that the order of events at the source is kept, and that
-- a withdrawn message has no effect. After a withdrawal, the source drives 'X'.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
library firm;

entity firm_cdc_message_tb is
  generic (
    S_WIDTH     : integer := 8;
    M_WIDTH     : integer := 8;
    S_PERIOD_PS : integer := 10000;
    M_PERIOD_PS : integer := 10000;
    SEED        : integer := 1;
    MESSAGES    : integer := 300;  -- at most 65535
    -- The chance per cycle that an end does nothing.
    STALL_PERCENT : integer := 0;
    -- The chance that a message is withdrawn.
    WITHDRAW_PERCENT : integer := 0;
    -- The chance of a reset of one cycle during a message.
    RESET_PERCENT : integer := 0;
    -- The domain of the reset.
    IS_RESET_AT_SINK : boolean := false
  );
end entity firm_cdc_message_tb;

architecture simulation of firm_cdc_message_tb is

  constant SEGMENTS   : positive := 3;
  constant FIELD_BITS : positive := 32;
  constant S_LANES    : positive := S_WIDTH/8;
  constant M_LANES    : positive := M_WIDTH/8;

  subtype field_t is std_logic_vector(FIELD_BITS-1 downto 0);
  constant UNKNOWN : field_t := (others => 'X');

  signal s_clk     : std_logic := '0';
  signal m_clk     : std_logic;
  signal first_rst : std_logic := '0';
  signal pulse_rst : std_logic := '1';
  signal s_rst_n   : std_logic;
  signal m_rst_n   : std_logic;
  signal finished  : boolean := false;

  signal s_fields        : field_t := UNKNOWN;
  signal s_segment_valid : std_logic_vector(SEGMENTS-1 downto 0) := (others => '0');
  signal s_valid         : std_logic := '0';
  signal s_ready         : std_logic;
  signal s_settled       : std_logic;
  signal m_fields        : field_t;
  signal m_segment_valid : std_logic_vector(SEGMENTS-1 downto 0);
  signal m_valid         : std_logic;
  signal m_ready         : std_logic := '0';

  signal s_element_fields  : field_t := UNKNOWN;
  signal s_element_segment : std_logic_vector(0 downto 0) := "0";
  signal s_element_valid   : std_logic := '0';
  signal s_element_ready   : std_logic;
  signal s_element_settled : std_logic;
  signal m_element_fields  : field_t;
  signal m_element_segment : std_logic_vector(0 downto 0);
  signal m_element_valid   : std_logic;
  signal m_element_ready   : std_logic := '0';

  -- Stream 0 is the message's, stream 1 an element's.
  type data_t is array (0 to 1) of std_logic_vector(S_WIDTH-1 downto 0);
  type keep_t is array (0 to 1) of std_logic_vector(S_WIDTH/8-1 downto 0);
  type m_data_t is array (0 to 1) of std_logic_vector(M_WIDTH-1 downto 0);
  type m_keep_t is array (0 to 1) of std_logic_vector(M_WIDTH/8-1 downto 0);
  signal s_tdata  : data_t;
  signal s_tkeep  : keep_t;
  signal s_tvalid : std_logic_vector(0 to 1) := "00";
  signal s_tlast  : std_logic_vector(0 to 1) := "00";
  signal s_tready : std_logic_vector(0 to 1);
  signal m_tdata  : m_data_t;
  signal m_tkeep  : m_keep_t;
  signal m_tvalid : std_logic_vector(0 to 1);
  signal m_tlast  : std_logic_vector(0 to 1);
  signal m_tready : std_logic_vector(0 to 1) := "00";

  signal element_idle   : std_logic;
  signal stream_idle    : std_logic;
  signal element_stream : std_logic;

  -- State of the source's messages: the last one withdrawn or lost in a reset, and the number taken.
  signal withdrawn : natural := 0;
  signal given     : natural := 0;
  signal taken     : natural := 0;

  function length_of(message, element : natural) return natural is
  begin
    if message mod 10 = 0 and element = 0 then
      return 100;
    end if;
    return (message * 7 + element * 13) mod 23;
  end function length_of;

  function elements_of(message : natural) return natural is
  begin
    return message mod 4;
  end function elements_of;

  function byte_of(message, element, place : natural) return std_logic_vector is
  begin
    return std_logic_vector(to_unsigned((message * 101 + element * 31 + place * 7) mod 256, 8));
  end function byte_of;

  -- The number, and bits that derive from it.
  function fields_of(message, element : natural) return std_logic_vector is
  begin
    return std_logic_vector(to_unsigned((message * 251 + element * 17) mod 65536, 16) & to_unsigned(message, 16));
  end function fields_of;

begin

  s_clk     <= not s_clk after S_PERIOD_PS * 500 fs when not finished else '0';
  first_rst <= '1' after S_PERIOD_PS * 3 ps;

  u_clock : entity firm.firm_sim_clock
    generic map (
      PERIOD_PS => M_PERIOD_PS,
      SEED      => SEED
    )
    port map (
      reference => s_clk,
      clk       => m_clk
    );

  resets : block
    signal rst_n        : std_logic;
    signal main_clk     : std_logic;
    signal other_clk    : std_logic;
    signal seen         : std_logic;
    signal released     : std_logic;
    signal synced_rst_n : std_logic;
  begin

    rst_n     <= first_rst and pulse_rst;
    main_clk  <= m_clk when IS_RESET_AT_SINK else s_clk;
    other_clk <= s_clk when IS_RESET_AT_SINK else m_clk;

    u_seen : entity firm.firm_cdc_reset
      port map (
        clk          => other_clk,
        rst_n        => rst_n,
        synced_rst_n => seen
      );

    u_released : entity firm.firm_cdc_reset
      port map (
        clk          => main_clk,
        rst_n        => rst_n,
        may_end      => seen,
        synced_rst_n => released
      );

    u_synced : entity firm.firm_cdc_reset
      port map (
        clk          => other_clk,
        rst_n        => rst_n,
        may_end      => released,
        synced_rst_n => synced_rst_n
      );

    s_rst_n <= synced_rst_n when IS_RESET_AT_SINK else released;
    m_rst_n <= released when IS_RESET_AT_SINK else synced_rst_n;

    -- A cycle of its domain, at any time.
    pulse : process
      variable random_1 : positive := SEED;
      variable random_2 : positive := 13;
      variable draw     : real;
    begin
      wait on s_fields until s_segment_valid(0) = '1';
      uniform(random_1, random_2, draw);
      if draw * 100.0 < real(RESET_PERCENT) then
        for cycle in 1 to integer(draw * 10000.0) mod 100 loop
          wait until rising_edge(main_clk);
        end loop;
        wait until rising_edge(main_clk);
        pulse_rst <= '0';
        wait until rising_edge(main_clk);
        pulse_rst <= '1';
      end if;
    end process pulse;

  end block resets;

  u_message : entity firm.firm_cdc_message
    generic map (
      SEGMENTS   => SEGMENTS,
      FIELD_BITS => FIELD_BITS,
      PARTS      => 2
    )
    port map (
      s_clk           => s_clk,
      s_rst_n         => s_rst_n,
      s_fields        => s_fields,
      s_segment_valid => s_segment_valid,
      s_valid         => s_valid,
      s_ready         => s_ready,
      s_settled       => s_settled,
      s_idle          => open,
      s_part_idle(0)  => stream_idle,
      s_part_idle(1)  => element_idle,
      m_clk           => m_clk,
      m_rst_n         => m_rst_n,
      m_fields        => m_fields,
      m_segment_valid => m_segment_valid,
      m_valid         => m_valid,
      m_ready         => m_ready
    );

  u_stream : entity firm.firm_cdc_stream
    generic map (
      S_WIDTH => S_WIDTH,
      M_WIDTH => M_WIDTH
    )
    port map (
      s_clk         => s_clk,
      s_rst_n       => s_rst_n,
      s_open        => s_segment_valid(0),
      s_enable      => s_settled,
      s_idle        => stream_idle,
      s_axis_tdata  => s_tdata(0),
      s_axis_tkeep  => s_tkeep(0),
      s_axis_tvalid => s_tvalid(0),
      s_axis_tlast  => s_tlast(0),
      s_axis_tready => s_tready(0),
      m_clk         => m_clk,
      m_rst_n       => m_rst_n,
      m_open        => m_segment_valid(0),
      m_axis_tdata  => m_tdata(0),
      m_axis_tkeep  => m_tkeep(0),
      m_axis_tvalid => m_tvalid(0),
      m_axis_tlast  => m_tlast(0),
      m_axis_tready => m_tready(0)
    );

  u_element : entity firm.firm_cdc_message
    generic map (
      FIELD_BITS => FIELD_BITS
    )
    port map (
      s_clk           => s_clk,
      s_rst_n         => s_rst_n,
      s_enable        => s_settled,
      s_fields        => s_element_fields,
      s_segment_valid => s_element_segment,
      s_valid         => s_element_valid,
      s_ready         => s_element_ready,
      s_settled       => s_element_settled,
      s_idle          => element_idle,
      s_part_idle(0)  => element_stream,
      m_clk           => m_clk,
      m_rst_n         => m_rst_n,
      m_enable        => m_segment_valid(0),
      m_fields        => m_element_fields,
      m_segment_valid => m_element_segment,
      m_valid         => m_element_valid,
      m_ready         => m_element_ready
    );

  u_element_stream : entity firm.firm_cdc_stream
    generic map (
      S_WIDTH => S_WIDTH,
      M_WIDTH => M_WIDTH
    )
    port map (
      s_clk         => s_clk,
      s_rst_n       => s_rst_n,
      s_open        => s_element_segment(0),
      s_enable      => s_element_settled,
      s_idle        => element_stream,
      s_axis_tdata  => s_tdata(1),
      s_axis_tkeep  => s_tkeep(1),
      s_axis_tvalid => s_tvalid(1),
      s_axis_tlast  => s_tlast(1),
      s_axis_tready => s_tready(1),
      m_clk         => m_clk,
      m_rst_n       => m_rst_n,
      m_open        => m_element_segment(0),
      m_axis_tdata  => m_tdata(1),
      m_axis_tkeep  => m_tkeep(1),
      m_axis_tvalid => m_tvalid(1),
      m_axis_tlast  => m_tlast(1),
      m_axis_tready => m_tready(1)
    );

  give : process
    variable random_1 : positive := SEED;
    variable random_2 : positive := 17;
    variable is_over  : boolean;   -- the message was withdrawn or reset
    variable left     : integer;   -- cycles until it is withdrawn; negative: never
    variable number   : natural;

    procedure draw_percent(percent : in integer; happens : out boolean) is
      variable draw : real;
    begin
      uniform(random_1, random_2, draw);
      happens := draw * 100.0 < real(percent);
    end procedure draw_percent;

    procedure let_go is
    begin
      s_fields          <= UNKNOWN;
      s_segment_valid   <= (others => '0');
      s_valid           <= '0';
      s_element_fields  <= UNKNOWN;
      s_element_segment <= "0";
      s_element_valid   <= '0';
      s_tvalid          <= "00";
      s_tdata           <= (others => (others => 'X'));
      s_tkeep           <= (others => (others => 'X'));
      s_tlast           <= "XX";
    end procedure let_go;

    procedure cycle is
    begin
      wait until rising_edge(s_clk);
      -- A complete message is no longer withdrawn.
      if s_rst_n = '0' or (left = 0 and s_valid = '0') then
        is_over := true;
      end if;
      left := left - 1;
    end procedure cycle;

    procedure pause is
      variable stalls : boolean;
    begin
      draw_percent(STALL_PERCENT, stalls);
      while stalls and not is_over loop
        cycle;
        draw_percent(STALL_PERCENT, stalls);
      end loop;
    end procedure pause;

    procedure send(stream, element : in natural) is
      variable place : natural := 0;
    begin
      while place < length_of(number, element) and not is_over loop
        pause;
        exit when is_over;
        s_tdata(stream) <= (others => '0');
        s_tkeep(stream) <= (others => '0');
        for lane in 0 to S_LANES-1 loop
          exit when place + lane = length_of(number, element);
          s_tdata(stream)(8*lane+7 downto 8*lane) <= byte_of(number, element, place + lane);
          s_tkeep(stream)(lane)                   <= '1';
        end loop;
        s_tvalid(stream) <= '1';
        s_tlast(stream)  <= '0';
        if place + S_LANES >= length_of(number, element) then
          s_tlast(stream) <= '1';
        end if;
        loop
          cycle;
          exit when is_over or s_tready(stream) = '1';
        end loop;
        s_tvalid(stream) <= '0';
        s_tdata(stream)  <= (others => 'X');
        place            := place + S_LANES;
      end loop;
    end procedure send;

    procedure send_element(element : in positive) is
    begin
      pause;
      if not is_over then
        s_element_fields  <= fields_of(number, element);
        s_element_segment <= "1";
        send(1, element);
        pause;
      end if;
      if not is_over then
        s_element_valid <= '1';
        loop
          cycle;
          exit when is_over or s_element_ready = '1';
        end loop;
        s_element_valid   <= '0';
        s_element_segment <= "0";
        s_element_fields  <= UNKNOWN;
      end if;
    end procedure send_element;

    variable happens : boolean;
    variable draw    : real;
  begin
    let_go;
    for message in 1 to MESSAGES loop
      number := message;
      while s_rst_n /= '1' loop
        wait until rising_edge(s_clk);
      end loop;
      is_over := false;
      left    := -1;
      draw_percent(WITHDRAW_PERCENT, happens);
      if happens then
        uniform(random_1, random_2, draw);
        left := integer(draw * draw * 150.0);
      end if;
      pause;
      if not is_over then
        s_fields           <= fields_of(message, 0);
        s_segment_valid(0) <= '1';
        pause;
        send(0, 0);
      end if;
      if not is_over then
        s_segment_valid(1) <= '1';
        for element in 1 to elements_of(message) loop
          send_element(element);
        end loop;
        pause;
      end if;
      if not is_over then
        s_segment_valid <= (others => '1');
        s_valid         <= '1';
        loop
          cycle;
          exit when is_over or s_ready = '1';
        end loop;
      end if;
      if is_over then
        withdrawn <= message;
        let_go;
        wait until rising_edge(s_clk);
      else
        given <= given + 1;
        -- With the next message at once, the bits of the first segment stay.
        let_go;
      end if;
    end loop;
    for waited in 1 to 100 loop
      wait until rising_edge(s_clk);
    end loop;
    for waited in 1 to 100 loop
      wait until rising_edge(m_clk);
    end loop;
    assert taken = given or (RESET_PERCENT > 0 and taken > given)
      report integer'image(taken) & " messages taken of " & integer'image(given) severity failure;
    assert WITHDRAW_PERCENT + RESET_PERCENT > 0 or given = MESSAGES
      report "only " & integer'image(given) & " messages were given" severity failure;
    report "PASS " & integer'image(given) & " messages in " & integer'image(now / (S_PERIOD_PS * 1 ps)) & " cycles";
    finished <= true;
    wait;
  end process give;

  take : process (m_clk)
    variable random_1   : positive := SEED;
    variable random_2   : positive := 23;
    variable number     : natural  := 0;
    variable is_shown   : boolean  := false;
    variable was_taken  : boolean  := false;
    variable place      : natural;             -- bytes of the message's stream
    variable element    : natural;             -- the present or next one; from 1
    variable is_element : boolean  := false;   -- it is shown
    variable in_element : natural;             -- bytes of its stream

    -- Without a message the sink takes nothing.
    procedure draw_ready(signal ready : out std_logic) is
      variable draw : real;
    begin
      uniform(random_1, random_2, draw);
      ready <= '1';
      if draw * 100.0 < real(STALL_PERCENT) or not is_shown then
        ready <= '0';
      end if;
    end procedure draw_ready;

    procedure check(is_right : in boolean; what : in string) is
    begin
      assert is_right report "message " & integer'image(number) & ": " & what severity failure;
    end procedure check;

    procedure take_beat(stream, part : in natural; first : inout natural) is
    begin
      for lane in 0 to M_LANES-1 loop
        if first + lane < length_of(number, part) then
          check(m_tkeep(stream)(lane) = '1', "a byte is missing");
          check(m_tdata(stream)(8*lane+7 downto 8*lane) = byte_of(number, part, first + lane), "a byte is wrong");
        else
          check(m_tkeep(stream)(lane) = '0', "a byte too many");
        end if;
      end loop;
      first := first + M_LANES;
      check((m_tlast(stream) = '1') = (first >= length_of(number, part)), "tlast is wrong");
    end procedure take_beat;

    procedure begin_message is
    begin
      check(to_integer(unsigned(m_fields(15 downto 0))) > number, "comes again");
      number     := to_integer(unsigned(m_fields(15 downto 0)));
      place      := 0;
      element    := 1;
      is_element := false;
    end procedure begin_message;

    procedure watch_element is
    begin
      if m_element_segment = "1" and not is_element then
        in_element := 0;
      end if;
      if m_element_segment = "1" then
        check(m_segment_valid(1) = '1', "an element is ahead of the segment before it");
        check(element <= elements_of(number), "an element too many");
        check(m_element_fields = fields_of(number, element), "the fields of an element are wrong");
      else
        check(not is_element or withdrawn >= number, "an element was withdrawn");
        check(m_element_valid = '0' and m_tvalid(1) = '0', "something without an element");
      end if;
      is_element := m_element_segment = "1";
      if m_tvalid(1) = '1' and m_tready(1) = '1' then
        take_beat(1, element, in_element);
      end if;
      if m_element_valid = '1' then
        check(in_element >= length_of(number, element), "an element is ahead of its stream");
        if m_element_ready = '1' then
          element    := element + 1;
          is_element := false;
        end if;
      end if;
    end procedure watch_element;

    procedure watch_message is
    begin
      if not is_shown then
        begin_message;
      end if;
      check(m_fields = fields_of(number, 0), "its fields are wrong");
      if m_tvalid(0) = '1' and m_tready(0) = '1' then
        check(m_segment_valid(1) = '0', "a beat behind the stream");
        take_beat(0, 0, place);
      end if;
      check(m_segment_valid(1) = '0' or place >= length_of(number, 0), "a segment is ahead of the stream before it");
      watch_element;
      check(m_segment_valid(2) = '0' or element > elements_of(number), "a segment is ahead of the elements before it");
      if m_valid = '1' then
        check(m_segment_valid = "111", "it is complete without all segments");
        check(withdrawn < number or RESET_PERCENT > 0, "it is complete, but withdrawn");
        if m_ready = '1' then
          taken     <= taken + 1;
          was_taken := true;
        end if;
      end if;
    end procedure watch_message;

  begin
    if rising_edge(m_clk) then
      if m_rst_n = '1' then
        if m_segment_valid(0) = '1' then
          check(not was_taken, "it is still there when it was taken");
          watch_message;
        else
          check(not is_shown or was_taken or withdrawn >= number, "it is gone, but not withdrawn");
          check(m_segment_valid = "000" and m_valid = '0' and m_element_segment = "0" and m_element_valid = '0'
                and m_tvalid = "00", "something without a message");
          was_taken := false;
        end if;
        is_shown := m_segment_valid(0) = '1';
      else
        check(m_segment_valid = "000" and m_valid = '0' and m_element_segment = "0" and m_element_valid = '0'
              and m_tvalid = "00", "something in a reset");
        is_shown  := false;
        was_taken := false;
      end if;
      draw_ready(m_ready);
      draw_ready(m_element_ready);
      draw_ready(m_tready(0));
      draw_ready(m_tready(1));
    end if;
  end process take;

  watchdog : process
    variable before : natural;
  begin
    while not finished loop
      before := given + withdrawn;
      wait for (S_PERIOD_PS + M_PERIOD_PS) * 20 ns;
      assert finished or given + withdrawn > before
        report "nothing in a long time behind message " & integer'image(given) severity failure;
    end loop;
    wait;
  end process watchdog;

end architecture simulation;
