-- SPDX-License-Identifier: Apache-2.0
-- Runs nine coroutines in turn over the accesses of firm_wiznet_access: one for each socket of the chip, and one for
-- shared tasks. The program, its texts and its tries are in a ROM outside. README.md lists the instructions.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_wiznet_sequencer is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    ms : in std_logic;  -- a pulse in each millisecond

    rom_address : out std_logic_vector(15 downto 0);
    rom_data    : in  std_logic_vector(7 downto 0);

    -- Frames from the Manager, and to it. After the last byte of an aborted frame, the program reads zeros until it
    -- checks for the abort.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;
    has_part      : in  std_logic;  -- the next 64 bytes of a frame are there, or its end
    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;
    is_taken      : in  std_logic;  -- the Manager has accepted all bytes, so there is room for 64

    -- To firm_wiznet_access: requests, bytes to write, bytes that were read.
    request_valid   : out std_logic;
    request_ready   : in  std_logic;
    request_write   : out std_logic;
    request_space   : out std_logic_vector(1 downto 0);
    request_socket  : out std_logic_vector(2 downto 0);
    request_address : out std_logic_vector(15 downto 0);
    request_length  : out std_logic_vector(11 downto 0);
    is_done         : in  std_logic;
    write_data      : out std_logic_vector(7 downto 0);
    write_valid     : out std_logic;
    write_ready     : in  std_logic;
    read_data       : in  std_logic_vector(7 downto 0);
    read_valid      : in  std_logic;
    read_ready      : out std_logic
  );
end entity firm_wiznet_sequencer;

architecture rtl of firm_wiznet_sequencer is

  subtype byte_t is std_logic_vector(7 downto 0);

  constant DO_YIELD     : byte_t := x"00";
  constant DO_PAGE      : byte_t := x"01";
  constant DO_OWN       : byte_t := x"02";
  constant DO_BIT       : byte_t := x"03";
  constant DO_TIME      : byte_t := x"04";
  constant DO_FETCH     : byte_t := x"05";
  constant DO_COUNT     : byte_t := x"06";
  constant DO_TAKE      : byte_t := x"07";
  constant DO_GIVE      : byte_t := x"08";
  constant DO_GIVE_LAST : byte_t := x"09";
  constant DO_STORE     : byte_t := x"48";
  constant DO_RETURN    : byte_t := x"50";
  constant DO_POINT     : byte_t := x"51";
  constant DO_TEXT      : byte_t := x"52";
  constant DO_MATCH     : byte_t := x"53";
  constant DO_MATCHED   : byte_t := x"54";
  constant DO_POINTED   : byte_t := x"55";
  constant DO_TEXTED    : byte_t := x"56";
  constant DO_FILL      : byte_t := x"57";
  constant DO_AT        : byte_t := x"86";
  constant DO_LOOKUP    : byte_t := x"87";
  constant DO_ABORTED   : byte_t := x"88";
  constant DO_BUSY      : byte_t := x"89";
  constant DO_CALL      : byte_t := x"c0";
  constant DO_WRITE     : byte_t := x"c2";

  -- The lowest bits of instructions that compute, and of jumps.
  constant OF_LOAD    : std_logic_vector(2 downto 0) := "000";
  constant OF_SUB     : std_logic_vector(2 downto 0) := "010";
  constant OF_COMPARE : std_logic_vector(2 downto 0) := "011";
  constant OF_AND     : std_logic_vector(2 downto 0) := "100";
  constant OF_OR      : std_logic_vector(2 downto 0) := "101";
  constant OF_SUBC    : std_logic_vector(2 downto 0) := "111";

  constant SIDE_MEMORY : std_logic_vector(1 downto 0) := "00";
  constant SIDE_ROM    : std_logic_vector(1 downto 0) := "01";

  constant LAST_PAGE : unsigned(3 downto 0) := "1000";

  type state_t is (
    OPCODE, DECODE, OPERAND, EXECUTE, COMPUTE, LOAD_HIGH, LOAD_LOW, STORE_HIGH, STORE_LOW, LOADED, MARK, MARKED,
    TARGET_HIGH, TARGET_LOW, NUMBERED, FILLING, PRESENT, OFFER, RECEIVE, FINISH
  );
  signal state_r : state_t;

  type memory_t is array (0 to 511) of byte_t;
  signal memory_r      : memory_t := (others => (others => '0'));
  signal memory_data   : byte_t;
  signal memory_input  : byte_t;
  signal memory_write  : std_logic;
  signal memory_at     : std_logic_vector(8 downto 0);

  signal operation_r : byte_t;
  signal operands_r  : std_logic_vector(23 downto 0);
  signal left_r      : unsigned(7 downto 0);            -- remaining operands or bytes

  signal next_r    : unsigned(15 downto 0);             -- address of the next byte of the program
  signal text_r    : unsigned(15 downto 0);
  signal pointer_r : unsigned(15 downto 0);
  signal word_r    : unsigned(15 downto 0);             -- a field of 16 bits, or a place in a trie
  signal high_r    : byte_t;
  signal field     : unsigned(15 downto 0);
  signal count_r   : unsigned(7 downto 0);
  signal a_r       : byte_t;
  signal zero_r    : std_logic;
  signal carry_r   : std_logic;
  signal own_r     : unsigned(3 downto 0);              -- page of the coroutine
  signal page_r    : unsigned(3 downto 0);              -- page of fields and socket
  signal time_r    : unsigned(13 downto 0);             -- in ms
  signal aborted_r : std_logic;                         -- the Manager's frame

  signal name       : unsigned(7 downto 0);
  signal value      : byte_t;
  signal sum        : unsigned(8 downto 0);
  signal result     : byte_t;
  signal is_buffer  : std_logic;
  signal side       : std_logic_vector(1 downto 0);
  signal length     : unsigned(7 downto 0);
  signal is_jump    : std_logic;
  signal to_manager : std_logic;
  signal is_read    : std_logic;
  signal wants_byte : std_logic;
  signal has_byte   : std_logic;
  signal new_byte   : byte_t;
  signal is_filled  : std_logic;
  signal a_of_page  : byte_t;

begin

  -- The memory. A field of 16 bits has its high byte first.
  name      <= unsigned(operands_r(7 downto 0)) + 1 when state_r = LOAD_HIGH or state_r = STORE_LOW else
               unsigned(operands_r(7 downto 0));
  memory_at <= std_logic_vector(page_r) & std_logic_vector(name(4 downto 0)) when name < 32 else
               '1' & std_logic_vector(name);

  memory_write <= '1' when state_r = STORE_HIGH or state_r = STORE_LOW else
                  '1' when state_r = EXECUTE and operation_r = DO_STORE else
                  is_filled when state_r = FILLING else
                  is_read when side = SIDE_MEMORY else
                  '0';
  memory_input <= std_logic_vector(word_r(15 downto 8)) when state_r = STORE_HIGH else
                  std_logic_vector(word_r(7 downto 0)) when state_r = STORE_LOW else
                  a_r when state_r = EXECUTE else
                  new_byte when state_r = FILLING else
                  read_data;

  field <= unsigned(high_r) & unsigned(memory_data);

  access_memory : process (clk)
  begin
    if rising_edge(clk) then
      if memory_write = '1' then
        memory_r(to_integer(unsigned(memory_at))) <= memory_input;
      end if;
      memory_data <= memory_r(to_integer(unsigned(memory_at)));
    end if;
  end process access_memory;

  rom_address <= std_logic_vector(text_r) when state_r = PRESENT or state_r = OFFER or
                                               (state_r = EXECUTE and operation_r = DO_FETCH) else
                 std_logic_vector(unsigned(operands_r(15 downto 0)) + unsigned(a_r)) when state_r = EXECUTE and
                                                                                          operation_r = DO_LOOKUP else
                 std_logic_vector(word_r) when state_r = MARK or state_r = MARKED or state_r = TARGET_HIGH else
                 std_logic_vector(next_r);

  -- The results of instructions. Bit 5 selects a number instead of a field.
  value  <= operands_r(7 downto 0) when operation_r(5) = '1' else memory_data;
  sum    <= ('0' & unsigned(a_r)) - unsigned('0' & value) - ("00000000" & (carry_r and operation_r(2)))
            when operation_r(2 downto 0) = OF_SUB or operation_r(2 downto 0) = OF_COMPARE or
                 operation_r(2 downto 0) = OF_SUBC else
            ('0' & unsigned(a_r)) + unsigned('0' & value) + ("00000000" & (carry_r and operation_r(2)));
  result <= value when operation_r(2 downto 0) = OF_LOAD else
            a_r and value when operation_r(2 downto 0) = OF_AND else
            a_r or value when operation_r(2 downto 0) = OF_OR else
            std_logic_vector(sum(7 downto 0));

  is_jump <= aborted_r when operation_r = DO_ABORTED else
             not is_taken when operation_r = DO_BUSY else
             '1' when operation_r(2 downto 0) = "000" else
             zero_r when operation_r(2 downto 0) = "001" else
             not zero_r when operation_r(2 downto 0) = "010" else
             carry_r when operation_r(2 downto 0) = "011" else
             not carry_r when operation_r(2 downto 0) = "100" else
             has_part or aborted_r;

  power_of_page : process (page_r)
  begin
    a_of_page <= (others => '0');
    a_of_page(to_integer(page_r(2 downto 0))) <= '1';
  end process power_of_page;

  -- Transfers.
  is_buffer <= operands_r(23);
  side      <= operands_r(21 downto 20);
  length    <= count_r when is_buffer = '1' else ("0000" & unsigned(operands_r(19 downto 16))) + 1;

  request_valid   <= '1' when state_r = EXECUTE and operation_r(7 downto 6) = "11" and operation_r /= DO_CALL else '0';
  request_write   <= '1' when operation_r = DO_WRITE else '0';
  request_space   <= operands_r(23 downto 22);
  request_socket  <= std_logic_vector(page_r(2 downto 0));
  request_address <= std_logic_vector(pointer_r) when is_buffer = '1' else x"00" & operands_r(15 downto 8);
  request_length  <= "0000" & std_logic_vector(length);

  write_data  <= rom_data when side = SIDE_ROM else memory_data;
  write_valid <= '1' when state_r = OFFER else '0';

  to_manager <= side(1);
  read_ready <= '0' when state_r /= RECEIVE else
                m_axis_tready when to_manager = '1' else
                '1';
  is_read    <= '1' when state_r = RECEIVE and read_valid = '1' and (to_manager = '0' or m_axis_tready = '1') else '0';

  m_axis_tdata  <= read_data when state_r = RECEIVE else a_r;
  m_axis_tvalid <= read_valid and to_manager when state_r = RECEIVE else
                   '1' when state_r = EXECUTE and (operation_r = DO_GIVE or operation_r = DO_GIVE_LAST) else
                   '0';
  m_axis_tlast  <= '1' when operation_r = DO_GIVE_LAST else
                   '1' when state_r = RECEIVE and side(0) = '1' and left_r = 1 else
                   '0';

  wants_byte    <= '1' when state_r = FILLING else
                   '1' when state_r = EXECUTE and operation_r = DO_TAKE else
                   '0';
  has_byte      <= s_axis_tvalid or aborted_r;
  new_byte      <= (others => '0') when aborted_r = '1' else s_axis_tdata;
  s_axis_tready <= wants_byte and not aborted_r;
  is_filled     <= '1' when state_r = FILLING and has_byte = '1' else '0';

  run : process (clk)

    procedure set_a (
      constant data : in byte_t
    ) is
    begin
      a_r    <= data;
      zero_r <= '0';
      if data = x"00" then
        zero_r <= '1';
      end if;
    end procedure set_a;

    procedure advance is
    begin
      operands_r(7 downto 0) <= std_logic_vector(unsigned(operands_r(7 downto 0)) + 1);
      left_r                 <= left_r - 1;
    end procedure advance;

  begin
    if rising_edge(clk) then
      if ms = '1' then
        time_r <= time_r + 1;
      end if;
      if state_r = EXECUTE and operation_r = DO_ABORTED then
        aborted_r <= '0';
      elsif wants_byte = '1' and s_axis_tvalid = '1' and s_axis_tlast = '1' and s_axis_tuser = "1" then
        aborted_r <= '1';
      end if;
      case state_r is
        when OPCODE =>

          next_r  <= next_r + 1;
          state_r <= DECODE;
        when DECODE =>

          operation_r <= rom_data;
          left_r      <= "000000" & unsigned(rom_data(7 downto 6));
          if rom_data(7 downto 6) = "00" then
            state_r <= EXECUTE;
          else
            next_r  <= next_r + 1;
            state_r <= OPERAND;
          end if;
        when OPERAND =>

          operands_r <= operands_r(15 downto 0) & rom_data;
          left_r     <= left_r - 1;
          if left_r = 1 then
            state_r <= EXECUTE;
          else
            next_r <= next_r + 1;
          end if;
        when EXECUTE =>

          state_r <= OPCODE;
          case operation_r(7 downto 6) is
            when "00" =>

              case operation_r is
                when DO_YIELD =>

                  page_r                 <= own_r;
                  word_r                 <= next_r;
                  operands_r(7 downto 0) <= (others => '0');
                  state_r                <= STORE_HIGH;
                when DO_PAGE =>

                  page_r <= unsigned(a_r(3 downto 0));
                when DO_OWN =>

                  page_r <= own_r;
                when DO_BIT =>

                  a_r <= a_of_page;
                when DO_TIME =>

                  a_r <= std_logic_vector(time_r(13 downto 6));
                when DO_FETCH =>

                  text_r  <= text_r + 1;
                  state_r <= LOADED;
                when DO_COUNT =>

                  count_r <= unsigned(a_r);
                when DO_TAKE =>

                  a_r <= new_byte;
                  if has_byte = '0' then
                    state_r <= EXECUTE;
                  end if;
                when others =>

                  if m_axis_tready = '0' then
                    state_r <= EXECUTE;
                  end if;
              end case;
            when "01" =>

              word_r <= pointer_r;
              left_r <= count_r;
              if operation_r(5) = '1' or operation_r(4 downto 3) = "00" then
                state_r <= COMPUTE;
              elsif operation_r = DO_POINTED then
                state_r <= STORE_HIGH;
              elsif operation_r = DO_TEXTED then
                word_r  <= text_r;
                state_r <= STORE_HIGH;
              elsif operation_r = DO_FILL then
                state_r <= FILLING;
              elsif operation_r /= DO_STORE then
                state_r <= LOAD_HIGH;
              end if;
            when "10" =>

              if operation_r = DO_AT then
                text_r <= unsigned(operands_r(15 downto 0));
              elsif operation_r = DO_LOOKUP then
                state_r <= LOADED;
              elsif is_jump = '1' then
                next_r <= unsigned(operands_r(15 downto 0));
              end if;
            when others =>

              left_r <= length;
              if operation_r = DO_CALL then
                word_r                 <= next_r;
                next_r                 <= unsigned(operands_r(15 downto 0));
                operands_r(7 downto 0) <= operands_r(23 downto 16);
                state_r                <= STORE_HIGH;
              elsif request_ready = '0' then
                state_r <= EXECUTE;
              elsif operation_r = DO_WRITE then
                state_r <= PRESENT;
              else
                state_r <= RECEIVE;
              end if;
          end case;
        when COMPUTE =>

          if operation_r(2 downto 0) /= OF_COMPARE then
            a_r <= result;
          end if;
          zero_r <= '0';
          if (operation_r(2 downto 0) = OF_COMPARE and sum(7 downto 0) = 0) or
             (operation_r(2 downto 0) /= OF_COMPARE and result = x"00") then
            zero_r <= '1';
          end if;
          if operation_r(2 downto 0) /= OF_LOAD and operation_r(2 downto 0) /= OF_AND and
             operation_r(2 downto 0) /= OF_OR then
            carry_r <= sum(8);
          end if;
          state_r <= OPCODE;
        when LOADED =>

          set_a(rom_data);
          state_r <= OPCODE;
        when LOAD_HIGH =>

          high_r  <= memory_data;
          state_r <= LOAD_LOW;
        when LOAD_LOW =>

          word_r  <= field;
          state_r <= OPCODE;
          if operation_r = DO_POINT then
            pointer_r <= field;
          elsif operation_r = DO_TEXT then
            text_r <= field;
          elsif operation_r = DO_RETURN or operation_r = DO_YIELD then
            next_r <= field;
          elsif (high_r or memory_data) /= x"00" then
            state_r <= MARK;
          elsif operation_r = DO_MATCHED then
            set_a(x"00");
          end if;
        when STORE_HIGH =>

          state_r <= STORE_LOW;
        when STORE_LOW =>

          state_r <= OPCODE;
          if operation_r = DO_YIELD then
            own_r  <= own_r + 1;
            page_r <= own_r + 1;
            if own_r = LAST_PAGE then
              own_r  <= (others => '0');
              page_r <= (others => '0');
            end if;
            operation_r <= DO_RETURN;
            state_r     <= EXECUTE;
          end if;

        -- A place in a trie: a choice (bit 7) and two bytes of the next place, a character, or an end and its number.
        when MARK =>

          word_r  <= word_r + 1;
          state_r <= MARKED;
        when MARKED =>

          if rom_data(7) = '1' and (operation_r = DO_MATCHED or '0' & rom_data(6 downto 0) /= a_r) then
            word_r  <= word_r + 2;
            state_r <= MARK;
          elsif rom_data(7) = '1' then
            word_r  <= word_r + 1;
            state_r <= TARGET_HIGH;
          elsif operation_r = DO_MATCH then
            if rom_data /= a_r or a_r = x"00" then
              word_r <= (others => '0');
            end if;
            state_r <= STORE_HIGH;
          elsif rom_data = x"00" then
            state_r <= NUMBERED;
          else
            set_a(x"00");
            state_r <= OPCODE;
          end if;
        when TARGET_HIGH =>

          high_r  <= rom_data;
          state_r <= TARGET_LOW;
        when TARGET_LOW =>

          word_r  <= unsigned(high_r) & unsigned(rom_data);
          state_r <= STORE_HIGH;
        when NUMBERED =>

          set_a(rom_data);
          state_r <= OPCODE;

        when FILLING =>

          if is_filled = '1' then
            advance;
            if left_r = 1 then
              state_r <= OPCODE;
            end if;
          end if;
        when PRESENT =>

          state_r <= OFFER;
        when OFFER =>

          if write_ready = '1' then
            advance;
            if is_buffer = '1' then
              pointer_r <= pointer_r + 1;
            end if;
            if side = SIDE_ROM then
              text_r <= text_r + 1;
            end if;
            state_r <= PRESENT;
            if left_r = 1 then
              state_r <= FINISH;
            end if;
          end if;
        when RECEIVE =>

          if is_read = '1' then
            advance;
            if is_buffer = '1' then
              pointer_r <= pointer_r + 1;
            end if;
            if left_r = 1 then
              state_r <= FINISH;
            end if;
          end if;
        when FINISH =>

          if is_done = '1' then
            state_r <= OPCODE;
          end if;
      end case;
      if rst_n = '0' then
        state_r    <= OPCODE;
        operands_r <= (others => '0');
        next_r     <= (others => '0');
        own_r      <= LAST_PAGE;
        page_r     <= LAST_PAGE;
        time_r     <= (others => '0');
        aborted_r  <= '0';
      end if;
    end if;
  end process run;

end architecture rtl;
