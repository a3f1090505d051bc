-- SPDX-License-Identifier: Apache-2.0
-- Runs the program of a node in fabric (fusesoc_firm.fabric.control): instructions that copy, compare and add numbers
-- of 1 to 28 bytes in one memory, two cycles for each byte and four for each instruction. A jump takes two cycles, or
-- one if it is not taken. The memory holds the record of firm_rtps_walker and all tables.
--
-- An instruction is `operation (5 bits) | size (3) | destination (14) | source (14)`. An operand is a mode (2 bits)
-- and a place (12): in the memory itself, or in the entry that register P, E or W selects. If the lowest bit of the
-- operation is set, the source is a number.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_sequencer is
  generic (
    ENTRIES : integer := 64 -- that register E selects, 1 to 192
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- The program: a memory that shows the word one cycle after `program_enable`, and keeps it.
    program_enable  : out std_logic;
    program_address : out std_logic_vector(RTPS_CONTROL_BITS-1 downto 0);
    program_word    : in  std_logic_vector(35 downto 0);

    -- Words of firm_rtps_inbox, which TAKE moves up to the end of a submessage, and what they write to the record.
    take           : out std_logic;
    has_word       : in  std_logic;
    is_end         : in  std_logic;
    record_valid   : in  std_logic;  -- up to two cycles after its word
    record_address : in  std_logic_vector(RECORD_BITS-1 downto 0);
    record_data    : in  std_logic_vector(7 downto 0);

    -- Addresses 256 to 511 of the memory are outside. A read's data follow its address at once. While `hold` is high,
    -- everything waits.
    port_index         : out std_logic_vector(7 downto 0);  -- register E
    port_next          : out std_logic;                     -- a byte is written one cycle later
    port_next_address  : out std_logic_vector(7 downto 0);
    port_write_address : out std_logic_vector(7 downto 0);
    port_write_data    : out std_logic_vector(7 downto 0);
    port_read_address  : out std_logic_vector(7 downto 0);
    port_read_data     : in  std_logic_vector(7 downto 0);
    hold               : in  std_logic;

    conditions : in std_logic_vector(3 downto 0)  -- of jumps
  );
end entity firm_rtps_sequencer;

architecture rtl of firm_rtps_sequencer is

  -- The memory has 2048 bytes below the entries, and is a power of two.
  function bits_of(number : integer) return positive is
  begin
    if number > 64 then
      return 13;
    end if;
    return 12;
  end function bits_of;

  constant MOST_ENTRIES : positive := 192;
  constant MEMORY_BITS  : positive := bits_of(ENTRIES);
  constant ADDRESS_BITS : positive := 13;
  constant STACK_BITS   : positive := 3;

  -- The lowest bit is that of a number as the source.
  constant OP_COPY   : std_logic_vector(3 downto 0) := "0000";
  constant OP_ADD    : std_logic_vector(3 downto 0) := "0001";
  constant OP_SUB    : std_logic_vector(3 downto 0) := "0010";
  constant OP_CMP    : std_logic_vector(3 downto 0) := "0011";  -- SUB without a result
  constant OP_AND    : std_logic_vector(3 downto 0) := "0100";
  constant OP_TEST   : std_logic_vector(3 downto 0) := "0101";  -- AND without a result
  constant OP_MASK   : std_logic_vector(3 downto 0) := "0110";  -- a set of this many first numbers
  constant OP_LOAD   : std_logic_vector(3 downto 0) := "0111";  -- a register
  constant OP_STORE  : std_logic_vector(3 downto 0) := "1000";  -- a register
  constant OP_BIT    : std_logic_vector(3 downto 0) := "1001";  -- tests number X of the record's set
  constant OP_STEP   : std_logic_vector(3 downto 0) := "1010";  -- a register: add one, compare with a number
  constant OP_JUMP   : std_logic_vector(3 downto 0) := "1011";
  constant OP_CALL   : std_logic_vector(3 downto 0) := "1100";
  constant OP_RETURN : std_logic_vector(3 downto 0) := "1101";
  constant OP_TAKE   : std_logic_vector(3 downto 0) := "1110";

  constant IN_PEER  : std_logic_vector(1 downto 0) := "01";
  constant IN_ENTRY : std_logic_vector(1 downto 0) := "10";
  constant IN_TABLE : std_logic_vector(1 downto 0) := "11";

  subtype byte_t is std_logic_vector(7 downto 0);
  subtype address_t is unsigned(ADDRESS_BITS-1 downto 0);
  subtype program_t is unsigned(RTPS_CONTROL_BITS-1 downto 0);
  type memory_t is array (natural range 0 to 2**MEMORY_BITS-1) of byte_t;
  type stack_t is array (natural range 0 to 2**STACK_BITS-1) of program_t;

  signal memory : memory_t := (others => (others => '0'));
  signal stack  : stack_t;

  -- BEGIN_READ reads the first byte of the destination, SOURCE one of the source, DESTINATION the next one of the
  -- destination. Each byte is computed in the cycle after DESTINATION, and written in the one after that.
  type state_t is (FETCH, LATCH, DECODE, BEGIN_READ, SOURCE, DESTINATION, COMPUTE, WRITE, TAKING);
  signal state_r : state_t;
  signal depth_r : unsigned(STACK_BITS-1 downto 0) := (others => '0');
  signal zero_r  : std_logic;
  signal carry_r : std_logic;

  -- The instruction after `word_r` is fetched while that one runs.
  signal word_r    : std_logic_vector(35 downto 0) := (others => '0');
  signal shown_r   : program_t := (others => '0');  -- the address of `program_word`
  signal program_r : program_t := (others => '0');  -- the one after it
  signal address   : program_t;
  signal fetches   : std_logic;
  signal turns     : std_logic;                     -- a jump, a call or a return
  signal is_over   : std_logic;                     -- the next instruction begins

  -- Registers. The entries of P have 64 bytes, those of E 32 and those of W 16.
  signal peer_r  : unsigned(2 downto 0) := (others => '0');
  signal entry_r : unsigned(7 downto 0) := (others => '0');
  signal table_r : unsigned(5 downto 0) := (others => '0');
  signal index_r : unsigned(7 downto 0) := (others => '0');

  -- ------------------------------------------------------------------ the instruction
  signal kind      : std_logic_vector(3 downto 0);
  signal is_number : std_logic;
  signal size      : unsigned(4 downto 0);  -- bytes, less one
  signal chosen    : unsigned(1 downto 0);  -- register: P, E, W, X
  signal held      : unsigned(7 downto 0);  -- what it holds
  signal stepped   : unsigned(7 downto 0);
  signal flag      : std_logic;
  signal is_true   : std_logic;

  -- ------------------------------------------------------------------ bytes that are read
  signal to_r       : address_t := (others => '0');
  signal from_r     : address_t := (others => '0');
  signal place_r    : unsigned(4 downto 0) := (others => '0');
  signal read_place : address_t;
  signal memory_r   : byte_t := (others => '0');
  signal outside_r  : std_logic;                          -- the byte is not in the memory
  signal port_r     : byte_t := (others => '0');
  signal constant_r : byte_t := (others => '0');          -- the source, if it is neither in the memory nor outside
  signal is_held    : std_logic;                          -- the source is such a byte
  signal left_r     : byte_t := (others => '0');
  signal right_r    : byte_t := (others => '0');

  -- ------------------------------------------------------------------ the byte that is computed
  signal computes_r : std_logic;
  signal last_r     : std_logic;
  signal at_r       : address_t := (others => '0');
  signal count_r    : unsigned(4 downto 0) := (others => '0');  -- its place
  signal is_first   : std_logic;
  signal is_kept    : std_logic;
  signal carry_in   : std_logic;
  signal sum        : unsigned(8 downto 0);
  signal result     : byte_t;
  signal has_result : std_logic;

  -- ------------------------------------------------------------------ the byte that is written
  signal ends_r      : std_logic;
  signal writes_r    : std_logic;
  signal begins_r    : std_logic;  -- it is the first one
  signal place_2_r   : address_t := (others => '0');
  signal result_r    : byte_t := (others => '0');
  signal write_place : address_t;
  signal write_data  : byte_t;

  function address_of(operand : std_logic_vector(13 downto 0); peer : unsigned(2 downto 0);
    entry : unsigned(7 downto 0); table : unsigned(5 downto 0)) return address_t is
    variable place : address_t := resize(unsigned(operand(11 downto 0)), ADDRESS_BITS);
  begin
    if operand(13 downto 12) = IN_PEER then
      place := "0010" & peer & place(5 downto 0);
    elsif operand(13 downto 12) = IN_ENTRY then
      -- From 2048 on, 64 entries later.
      place := (entry(7 downto 6) + 1) & entry(5 downto 0) & place(4 downto 0);
    elsif operand(13 downto 12) = IN_TABLE then
      -- From 512 on, so that tables 32 to 63 are in the entries of peers.
      place := "00" & (table(5)) & (not table(5)) & table(4 downto 0) & place(3 downto 0);
    end if;
    return place;
  end function address_of;

  -- The next byte of a number, none of which crosses a multiple of 256.
  function following(place : address_t) return address_t is
  begin
    return place(ADDRESS_BITS-1 downto 8) & (place(7 downto 0) + 1);
  end function following;

  -- Byte `place` of a set of the first `count` of 32 numbers; the first one is the highest bit of the last byte.
  function set_byte(count : unsigned(7 downto 0); place : unsigned(1 downto 0)) return byte_t is
    variable whole : unsigned(5 downto 0);
    variable bits  : byte_t := (others => '0');
  begin
    whole := "0000" & not place;
    for index in 0 to 7 loop
      if (count(5 downto 3) > whole(2 downto 0))
         or (count(5 downto 3) = whole(2 downto 0) and count(2 downto 0) > 7-index) then
        bits(index) := '1';
      end if;
    end loop;
    return bits;
  end function set_byte;

begin

  assert ENTRIES >= 1 and ENTRIES <= MOST_ENTRIES
    report "firm_rtps_sequencer: ENTRIES is " & integer'image(ENTRIES) & "; legal: 1 to "
           & integer'image(MOST_ENTRIES)
    severity failure;

  kind      <= word_r(35 downto 32);
  is_number <= word_r(31);
  chosen    <= unsigned(word_r(15 downto 14));

  choose_size : process (word_r)
  begin
    size <= to_unsigned(27, 5);
    if word_r(30 downto 28) = "000" then
      size <= to_unsigned(0, 5);
    elsif word_r(30 downto 28) = "001" then
      size <= to_unsigned(1, 5);
    elsif word_r(30 downto 28) = "010" then
      size <= to_unsigned(3, 5);
    elsif word_r(30 downto 28) = "011" then
      size <= to_unsigned(7, 5);
    elsif word_r(30 downto 28) = "100" then
      size <= to_unsigned(11, 5);
    elsif word_r(30 downto 28) = "101" then
      size <= to_unsigned(15, 5);
    elsif word_r(30 downto 28) = "110" then
      size <= to_unsigned(5, 5);
    end if;
  end process choose_size;

  held    <= resize(peer_r, 8) when chosen = 0 else
             entry_r when chosen = 1 else
             resize(table_r, 8) when chosen = 2 else
             index_r;
  stepped <= held + 1;

  -- ------------------------------------------------------------------ the order of things

  -- Of a jump: bits 17 to 15 are the condition, and bit 14 inverts it.
  choose_condition : process (word_r, zero_r, carry_r, conditions)
  begin
    flag <= '1';
    if word_r(17) = '1' then
      flag <= conditions(to_integer(unsigned(word_r(16 downto 15))));
    elsif word_r(16 downto 15) = "01" then
      flag <= zero_r;
    elsif word_r(16 downto 15) = "10" then
      flag <= carry_r;
    end if;
  end process choose_condition;

  is_true <= flag xor word_r(14);
  turns   <= '0' when state_r /= DECODE else
             is_true when kind = OP_JUMP else
             '1' when kind = OP_CALL or kind = OP_RETURN else
             '0';
  is_over <= '1' when state_r = LATCH or state_r = WRITE else
             not has_word or is_end when state_r = TAKING else
             not is_true when state_r = DECODE and kind = OP_JUMP else
             '1' when state_r = DECODE and kind = OP_STEP else
             '0';

  address <= program_r when turns = '0' else
             stack(to_integer(depth_r - 1)) when kind = OP_RETURN else
             unsigned(word_r(RTPS_CONTROL_BITS-1 downto 0));
  fetches <= '0' when hold = '1' else
             '1' when state_r = FETCH else
             turns or is_over;

  program_enable  <= fetches;
  program_address <= std_logic_vector(address);
  take            <= '1' when state_r = TAKING else '0';

  run : process (clk)
  begin
    if rising_edge(clk) then
      if fetches = '1' then
        shown_r   <= address;
        program_r <= address + 1;
      end if;
      if hold = '0' then
        if is_over = '1' then
          word_r <= program_word;
        end if;
        if is_over = '1' then
          state_r <= DECODE;
        elsif state_r = FETCH or turns = '1' then
          state_r <= LATCH;
        elsif state_r = DECODE then
          state_r <= BEGIN_READ;
          if kind = OP_TAKE then
            state_r <= TAKING;
          end if;
        elsif state_r = BEGIN_READ then
          state_r <= SOURCE;
        elsif state_r = SOURCE then
          state_r <= DESTINATION;
        elsif state_r = DESTINATION then
          state_r <= SOURCE;
          if last_r = '1' then
            state_r <= COMPUTE;
          end if;
        elsif state_r = COMPUTE then
          state_r <= WRITE;
        end if;
        if state_r = DECODE then
          if kind = OP_CALL then
            depth_r <= depth_r + 1;
          elsif kind = OP_RETURN then
            depth_r <= depth_r - 1;
          elsif kind = OP_STEP then
            if chosen = 0 then
              peer_r <= stepped(2 downto 0);
            elsif chosen = 1 then
              entry_r <= stepped;
            elsif chosen = 2 then
              table_r <= stepped(5 downto 0);
            else
              index_r <= stepped;
            end if;
            zero_r <= '0';
            if stepped = unsigned(word_r(7 downto 0)) then
              zero_r <= '1';
            end if;
          end if;
        elsif state_r = TAKING then
          carry_r <= has_word and is_end;
        end if;
        if computes_r = '1' then
          carry_r <= sum(8) xor is_kept;
        end if;
        if ends_r = '1' then
          zero_r <= '0';
          if unsigned(result_r) = 0 then
            zero_r <= zero_r or begins_r;
          end if;
          if kind = OP_LOAD then
            if chosen = 0 then
              peer_r <= unsigned(result_r(2 downto 0));
            elsif chosen = 1 then
              entry_r <= unsigned(result_r);
            elsif chosen = 2 then
              table_r <= unsigned(result_r(5 downto 0));
            else
              index_r <= unsigned(result_r);
            end if;
          end if;
        end if;
      end if;
      if rst_n = '0' then
        state_r   <= FETCH;
        program_r <= (others => '0');
        depth_r   <= (others => '0');
      end if;
    end if;
  end process run;

  keep_return : process (clk)
  begin
    if rising_edge(clk) then
      if state_r = DECODE and kind = OP_CALL then
        stack(to_integer(depth_r)) <= shown_r;
      end if;
    end if;
  end process keep_return;

  -- ------------------------------------------------------------------ bytes that are read

  read_place <= from_r when state_r = SOURCE else to_r;

  port_read_address <= port_r;
  is_held           <= '1' when is_number = '1' or kind = OP_BIT or kind = OP_STORE else '0';

  read_bytes : process (clk)
  begin
    if rising_edge(clk) then
      if hold = '0' then
        memory_r  <= memory(to_integer(read_place(MEMORY_BITS-1 downto 0)));
        port_r    <= std_logic_vector(read_place(7 downto 0));
        outside_r <= '0';
        if read_place(ADDRESS_BITS-1 downto 8) = 1 then
          outside_r <= '1';
        end if;
        if state_r = DECODE then
          place_r <= (others => '0');
          to_r    <= address_of(word_r(27 downto 14), peer_r, entry_r, table_r);
          if kind = OP_BIT then
            to_r <= to_unsigned(RECORD_SET/32, 8) & index_r(7 downto 3);
          end if;
          from_r  <= address_of(word_r(13 downto 0), peer_r, entry_r, table_r);
        elsif state_r = SOURCE then
          left_r <= memory_r;
          if outside_r = '1' then
            left_r <= port_read_data;
          end if;
          to_r    <= following(to_r);
          place_r <= place_r + 1;
          at_r    <= to_r;
          count_r <= place_r;
          last_r  <= '0';
          if place_r = size then
            last_r <= '1';
          end if;
          if kind /= OP_MASK then
            from_r <= following(from_r);
          end if;
        elsif state_r = DESTINATION then
          if is_held = '1' then
            right_r <= constant_r;
          elsif outside_r = '1' then
            right_r <= port_read_data;
          else
            right_r <= memory_r;
          end if;
        end if;
      end if;
    end if;
  end process read_bytes;

  hold_constant : process (clk)
  begin
    if rising_edge(clk) and state_r = SOURCE and hold = '0' then
      constant_r <= (others => '0');
      if kind = OP_BIT then
        for index in 0 to 7 loop
          if index_r(2 downto 0) = 7-index then
            constant_r(index) <= '1';
          end if;
        end loop;
      elsif kind = OP_STORE then
        if word_r(1 downto 0) = "00" then
          constant_r(2 downto 0) <= std_logic_vector(peer_r);
        elsif word_r(1 downto 0) = "01" then
          constant_r <= std_logic_vector(entry_r);
        elsif word_r(1 downto 0) = "10" then
          constant_r(5 downto 0) <= std_logic_vector(table_r);
        else
          constant_r <= std_logic_vector(index_r);
        end if;
      elsif place_r = 0 then
        constant_r <= word_r(7 downto 0);
      elsif place_r = 1 then
        constant_r(5 downto 0) <= word_r(13 downto 8);
      end if;
    end if;
  end process hold_constant;

  -- ------------------------------------------------------------------ bytes that are computed

  -- A difference is a sum with the inverted number, whose carry is the inverse of a borrow.
  is_first <= '1' when count_r = 0 else '0';
  is_kept  <= '1' when kind = OP_SUB or kind = OP_CMP else '0';
  carry_in <= is_kept when is_first = '1' else carry_r xor is_kept;

  add : process (left_r, right_r, is_kept, carry_in)
    variable term  : unsigned(7 downto 0);
    variable carry : unsigned(0 downto 0);
  begin
    carry(0) := carry_in;
    term     := unsigned(right_r);
    if is_kept = '1' then
      term := not unsigned(right_r);
    end if;
    sum <= resize(unsigned(left_r), 9) + term + carry;
  end process add;

  result <= std_logic_vector(sum(7 downto 0)) when kind = OP_ADD or is_kept = '1' else
            left_r and right_r when kind = OP_AND or kind = OP_TEST or kind = OP_BIT else
            set_byte(unsigned(right_r), count_r(1 downto 0)) when kind = OP_MASK else
            right_r;

  has_result <= '0' when kind = OP_CMP or kind = OP_TEST or kind = OP_BIT or kind = OP_LOAD else computes_r;

  port_next         <= has_result when at_r(ADDRESS_BITS-1 downto 8) = 1 else '0';
  port_next_address <= std_logic_vector(at_r(7 downto 0));

  compute_byte : process (clk)
  begin
    if rising_edge(clk) then
      if hold = '0' then
        computes_r <= '0';
        if state_r = DESTINATION then
          computes_r <= '1';
        end if;
        ends_r    <= computes_r;
        writes_r  <= has_result;
        begins_r  <= is_first;
        place_2_r <= at_r;
        result_r  <= result;
      end if;
      if rst_n = '0' then
        computes_r <= '0';
        ends_r     <= '0';
        writes_r   <= '0';
      end if;
    end if;
  end process compute_byte;

  -- ------------------------------------------------------------------ bytes that are written

  port_write_address <= std_logic_vector(place_2_r(7 downto 0));
  port_write_data    <= result_r;
  port_index         <= std_logic_vector(entry_r);

  -- The data moved by TAKE are written before the first byte of the next instruction.
  write_place <= "00000" & unsigned(record_address) when record_valid = '1' else place_2_r;
  write_data  <= record_data when record_valid = '1' else result_r;

  write_bytes : process (clk)
  begin
    if rising_edge(clk) then
      if record_valid = '1' or writes_r = '1' then
        memory(to_integer(write_place(MEMORY_BITS-1 downto 0))) <= write_data;
      end if;
    end if;
  end process write_bytes;

end architecture rtl;
