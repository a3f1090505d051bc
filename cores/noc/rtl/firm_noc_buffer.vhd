-- SPDX-License-Identifier: Apache-2.0
-- The input buffer of a router, of DEPTH words. It takes and gives a word in each cycle, with a latency of one cycle.
-- No path leads through it. A word has control bits, on which decisions depend, so they leave from a register. Its
-- payload leaves through a multiplexer, or the read port of a memory: so the late `m_ready` need not reach all its
-- registers.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_noc_buffer is
  generic (
    BITS         : integer := 8;
    CONTROL_BITS : integer := 1;
    -- 2: in registers; a larger power of two: in memories with asynchronous read ports.
    DEPTH : integer := 2
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_payload : in  std_logic_vector(BITS-1 downto 0);
    s_control : in  std_logic_vector(CONTROL_BITS-1 downto 0);
    s_valid   : in  std_logic;
    s_ready   : out std_logic;

    m_payload : out std_logic_vector(BITS-1 downto 0);
    m_control : out std_logic_vector(CONTROL_BITS-1 downto 0);
    m_valid   : out std_logic;
    m_ready   : in  std_logic  -- only if `m_valid` is high
  );
end entity firm_noc_buffer;

architecture rtl of firm_noc_buffer is

  signal control_r : std_logic_vector(CONTROL_BITS-1 downto 0);
  signal second    : std_logic_vector(CONTROL_BITS-1 downto 0);  -- of the second word
  signal valid_r   : std_logic;                                  -- there is a word
  signal more      : std_logic;                                  -- there are at least two
  signal ready_r   : std_logic;
  signal is_free   : std_logic;                                  -- the first word leaves, or there is none

begin

  assert BITS >= 1
    report "firm_noc_buffer: BITS is " & integer'image(BITS) & "; legal: 1 or more"
    severity failure;
  assert CONTROL_BITS >= 1
    report "firm_noc_buffer: CONTROL_BITS is " & integer'image(CONTROL_BITS) & "; legal: 1 or more"
    severity failure;
  assert DEPTH >= 2 and DEPTH = 2**clog2(DEPTH)
    report "firm_noc_buffer: DEPTH is " & integer'image(DEPTH) & "; legal: powers of two from 2 on"
    severity failure;

  is_free <= m_ready or not valid_r;

  -- The second word is the first one in the next cycle, or else the one that enters.
  move_control : process (clk)
  begin
    if rising_edge(clk) then
      if is_free = '1' then
        control_r <= s_control;
        if more = '1' then
          control_r <= second;
        end if;
      end if;
    end if;
  end process move_control;

  -- A word arrives in `newer_r`. If it does not leave in the next cycle, it goes to `older_r`.
  in_registers : if DEPTH = 2 generate
    signal newer_r    : std_logic_vector(BITS-1 downto 0);
    signal older_r    : std_logic_vector(BITS-1 downto 0);
    signal is_newer_r : std_logic;  -- the first word is the newer one
    signal is_older_r : std_logic;  -- the inverse; apart from it, since each of them drives a whole payload
    signal second_r   : std_logic_vector(CONTROL_BITS-1 downto 0);
    signal is_full_r  : std_logic;  -- `ready_r` is low; apart from it, since that drives many registers
  begin
    move_words : process (clk)
    begin
      if rising_edge(clk) then
        if ready_r = '1' then
          newer_r  <= s_payload;
          second_r <= s_control;
        end if;
        if is_newer_r = '1' then
          older_r <= newer_r;
        end if;
        is_newer_r <= is_free;
        is_older_r <= not is_free;
      end if;
    end process move_words;

    count_words : process (clk)
    begin
      if rising_edge(clk) then
        if rst_n = '0' then
          valid_r   <= '0';
          ready_r   <= '1';
          is_full_r <= '0';
        elsif is_free = '1' then
          valid_r   <= s_valid or is_full_r;
          ready_r   <= '1';
          is_full_r <= '0';
        elsif s_valid = '1' then
          ready_r   <= '0';
          is_full_r <= '1';
        end if;
      end if;
    end process count_words;

    m_payload <= older_r when is_older_r = '1' else newer_r;
    second    <= second_r;
    more      <= is_full_r;
  end generate in_registers;

  in_memory : if DEPTH > 2 generate
    subtype pointer_t is unsigned(clog2(DEPTH)-1 downto 0);

    type payloads_t is array (0 to DEPTH-1) of std_logic_vector(BITS-1 downto 0);
    type controls_t is array (0 to DEPTH-1) of std_logic_vector(CONTROL_BITS-1 downto 0);
    signal payloads : payloads_t;
    signal controls : controls_t;
    signal write_r  : pointer_t := (others => '0');
    signal first_r  : pointer_t := (others => '0');  -- the place of the first word
    signal second_r : pointer_t := (others => '0');  -- the place after it
    signal more_r   : std_logic;
    signal enters   : std_logic;
  begin
    enters <= s_valid and ready_r;

    move_words : process (clk)
    begin
      if rising_edge(clk) then
        if enters = '1' then
          payloads(to_integer(write_r)) <= s_payload;
          controls(to_integer(write_r)) <= s_control;
          write_r                       <= write_r + 1;
        end if;
        if m_ready = '1' then
          first_r  <= second_r;
          second_r <= second_r + 1;
        end if;
        if rst_n = '0' then
          write_r  <= to_unsigned(0, clog2(DEPTH));
          first_r  <= to_unsigned(0, clog2(DEPTH));
          second_r <= to_unsigned(1, clog2(DEPTH));
        end if;
      end if;
    end process move_words;

    count_words : process (clk)
    begin
      if rising_edge(clk) then
        if enters = '1' and m_ready = '0' then
          valid_r <= '1';
          more_r  <= valid_r;
          if write_r + 1 = first_r then
            ready_r <= '0';
          end if;
        elsif enters = '0' and m_ready = '1' then
          valid_r <= more_r;
          ready_r <= '1';
          if second_r + 1 = write_r then
            more_r <= '0';
          end if;
        end if;
        if rst_n = '0' then
          valid_r <= '0';
          more_r  <= '0';
          ready_r <= '1';
        end if;
      end if;
    end process count_words;

    m_payload <= payloads(to_integer(first_r));
    second    <= controls(to_integer(second_r));
    more      <= more_r;
  end generate in_memory;

  s_ready   <= ready_r;
  m_control <= control_r;
  m_valid   <= valid_r;

end architecture rtl;
