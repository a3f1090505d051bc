-- SPDX-License-Identifier: Apache-2.0
-- Counts the seconds of a lease, and compares them with its server's times (RFC 2131, section 4.4.5). All times are
-- bytes in a memory, and are processed one by one. A lease begins in the second of its request, so it ends early rather
-- than late.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_net_pkg.all;

entity firm_dhcp_lease is
  port (
    clk    : in std_logic;
    rst_n  : in std_logic;
    second : in std_logic;  -- a pulse each second

    -- A lease is being requested, until the message has left: earlier times are ignored.
    is_asked : in std_logic;

    -- A byte of one of up to three times, in seconds. Places 0 to 3 are the lease, 4 to 7 the time of its renewal (T1),
    -- and 8 to 11 that of rebinding (T2), each with the highest byte first.
    told_valid : in std_logic;
    told_place : in unsigned(3 downto 0);
    told_byte  : in byte_t;

    -- Pulses, each answered by a pulse of `is_done`: the received lease begins; a pending second is counted.
    begins  : in  std_logic;
    counts  : in  std_logic;
    is_done : out std_logic;

    -- During a lease, elapsed seconds are pending until they are counted.
    is_held : in  std_logic;
    is_owed : out std_logic;

    -- After a second is counted: the lease must end, be rebound, or be renewed.
    ends    : out std_logic;
    rebinds : out std_logic;
    renews  : out std_logic
  );
end entity firm_dhcp_lease;

architecture rtl of firm_dhcp_lease is

  -- Places of the times.
  subtype place_t is unsigned(3 downto 0);
  constant LEASE_TIME   : place_t := "0000";
  constant RENEW_TIME   : place_t := "0100";
  constant REBIND_TIME  : place_t := "1000";
  constant ELAPSED_TIME : place_t := "1100";

  type times_t is array (natural range 0 to 15) of byte_t;
  signal times : times_t;

  signal has_renew_r  : std_logic;
  signal has_rebind_r : std_logic;

  signal owed_r  : unsigned(15 downto 0) := (others => '0');  -- many, since a packet may wait long for its turn
  signal owes_r  : std_logic;                               -- a second is pending
  signal since_r : unsigned(6 downto 0)  := (others => '0');  -- seconds since the message has left

  -- A pass over four bytes of times: the computation and its operands.
  -- RENEW finds half of the lease; HALF, QUARTER, EIGHTH and REBIND find seven eighths of it. CLEAR begins with the
  -- seconds since the request. ELAPSE adds a second; the others compare.
  type pass_t is (CLEAR, RENEW, HALF, QUARTER, EIGHTH, REBIND, ELAPSE, EXPIRED, TO_REBIND, TO_RENEW);
  signal pass_r       : pass_t;
  signal runs_r       : std_logic;
  signal count_r      : unsigned(2 downto 0) := (others => '0');  -- of its bytes; 4 is its end
  signal first_base   : place_t;
  signal second_base  : place_t;
  signal target_base  : place_t;
  signal halves       : std_logic;  -- the first one is halved, from its highest byte on
  signal offset       : unsigned(1 downto 0);
  signal left         : unsigned(7 downto 0);
  signal right        : unsigned(7 downto 0);
  signal total        : unsigned(8 downto 0);
  signal carry        : unsigned(0 downto 0);
  signal carry_r      : unsigned(0 downto 0) := (others => '0');
  signal late_r       : std_logic_vector(2 downto 0) := (others => '0');  -- carries of the last passes
  signal writes_times : std_logic;
  signal time_place   : place_t;
  signal time_byte    : byte_t;

  function after_pass(pass : pass_t; has_renew : std_logic) return pass_t is
  begin
    if pass = CLEAR and has_renew = '0' then
      return RENEW;
    elsif pass = CLEAR or pass = RENEW then
      return HALF;
    elsif pass = HALF then
      return QUARTER;
    elsif pass = QUARTER then
      return EIGHTH;
    elsif pass = EIGHTH then
      return REBIND;
    elsif pass = ELAPSE then
      return EXPIRED;
    elsif pass = EXPIRED then
      return TO_REBIND;
    end if;
    return TO_RENEW;
  end function after_pass;

begin

  -- ------------------------------------------------------------------ seconds

  count_seconds : process (clk)
  begin
    if rising_edge(clk) then
      owes_r <= '0';
      if owed_r /= 0 then
        owes_r <= '1';
      end if;
      if is_held = '0' then
        owed_r <= (others => '0');
      elsif second = '1' and counts = '0' and owed_r(owed_r'high) = '0' then
        owed_r <= owed_r + 1;
      elsif counts = '1' and second = '0' then
        owed_r <= owed_r - 1;
      end if;

      if second = '1' then
        since_r <= since_r + 1;
      end if;
      if told_valid = '1' and told_place(3 downto 2) = RENEW_TIME(3 downto 2) then
        has_renew_r <= '1';
      elsif told_valid = '1' and told_place(3 downto 2) = REBIND_TIME(3 downto 2) then
        has_rebind_r <= '1';
      end if;
      if is_asked = '1' then
        since_r      <= (others => '0');
        has_renew_r  <= '0';
        has_rebind_r <= '0';
      end if;
    end if;
  end process count_seconds;

  is_owed <= owes_r and is_held;

  -- ------------------------------------------------------------------ times

  halves <= '1' when pass_r = RENEW or pass_r = HALF or pass_r = QUARTER or pass_r = EIGHTH else
            '0';
  first_base  <= ELAPSED_TIME when pass_r >= ELAPSE else
                 REBIND_TIME when pass_r = QUARTER or pass_r = EIGHTH else
                 LEASE_TIME;
  second_base <= LEASE_TIME when pass_r = EXPIRED else
                 RENEW_TIME when pass_r = TO_RENEW else
                 REBIND_TIME;
  target_base <= RENEW_TIME when pass_r = RENEW else
                 ELAPSED_TIME when pass_r = CLEAR or pass_r = ELAPSE else
                 REBIND_TIME;
  -- The lowest byte is the last one.
  offset <= count_r(1 downto 0) when halves = '1' else not count_r(1 downto 0);
  left   <= unsigned(times(to_integer(first_base + offset)));
  right  <= x"00" when pass_r = ELAPSE else not unsigned(times(to_integer(second_base + offset)));
  carry  <= carry_r when count_r(1 downto 0) /= 0 else
            "0" when halves = '1' else
            "1";
  total  <= resize(left, 9) + right + carry;

  writes_times <= not count_r(2) when runs_r = '1' and pass_r <= ELAPSE else told_valid;
  time_place   <= target_base + offset when runs_r = '1' else told_place;
  time_byte    <= told_byte when runs_r = '0' else
                  std_logic_vector(resize(since_r, 8)) when pass_r = CLEAR and count_r(1 downto 0) = 0 else
                  x"00" when pass_r = CLEAR else
                  std_logic_vector(carry & left(7 downto 1)) when halves = '1' else
                  std_logic_vector(total(7 downto 0));

  access_times : process (clk)
  begin
    if rising_edge(clk) then
      if writes_times = '1' then
        times(to_integer(time_place)) <= time_byte;
      end if;
      carry_r(0) <= total(8);
      if halves = '1' then
        carry_r(0) <= left(0);
      end if;
    end if;
  end process access_times;

  run : process (clk)
  begin
    if rising_edge(clk) then
      is_done <= '0';
      if runs_r = '0' then
        count_r <= (others => '0');
        pass_r  <= ELAPSE;
        if begins = '1' then
          pass_r <= CLEAR;
        end if;
        runs_r <= begins or counts;
      elsif count_r(2) = '0' then
        count_r <= count_r + 1;
      else
        count_r <= (others => '0');
        pass_r  <= after_pass(pass_r, has_renew_r);
        late_r  <= late_r(1 downto 0) & carry_r(0);
        if pass_r = REBIND or pass_r = TO_RENEW
           or (has_rebind_r = '1' and (pass_r = RENEW or (pass_r = CLEAR and has_renew_r = '1'))) then
          runs_r  <= '0';
          is_done <= '1';
        end if;
      end if;
      if rst_n = '0' then
        runs_r  <= '0';
        is_done <= '0';
      end if;
    end if;
  end process run;

  ends    <= late_r(2);
  rebinds <= late_r(1);
  renews  <= late_r(0);

end architecture rtl;
