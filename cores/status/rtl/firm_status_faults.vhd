-- SPDX-License-Identifier: Apache-2.0
-- Collects the faults of many channels: a fault waits in the one place of its channel, and leaves as the number of the
-- channel and the code. One leaves in three cycles, those of the lowest channels first. A second fault of a channel
-- before its first one has left is not counted, and `lost` pulses. Alone, a fault leaves within six cycles.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;

entity firm_status_faults is
  generic (
    CHANNELS : integer := 2
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Faults are taken, and may leave.
    enable    : in std_logic;
    may_leave : in std_logic;

    -- Pulses, each with four bits of code.
    frame_error      : in std_logic_vector(CHANNELS-1 downto 0);
    frame_error_code : in std_logic_vector(4*CHANNELS-1 downto 0);

    -- Pulses with a fault; channel and code stay until the next one.
    fault   : out std_logic;
    channel : out std_logic_vector(index_bits(CHANNELS)-1 downto 0);
    code    : out std_logic_vector(3 downto 0);
    -- A pulse if a fault's channel already has a waiting fault.
    lost : out std_logic
  );
end entity firm_status_faults;

architecture rtl of firm_status_faults is

  -- Channels are in rows of a power of two, so that the numbers of row and column are the channel's.
  constant CHANNEL_BITS : positive := index_bits(CHANNELS);
  constant COLUMN_BITS  : positive := max(1, CHANNEL_BITS/2);
  constant COLUMNS      : positive := 2**COLUMN_BITS;
  constant ROWS         : positive := (CHANNELS + COLUMNS - 1) / COLUMNS;
  constant PLACES       : positive := ROWS*COLUMNS;
  constant NO_ROW       : std_logic_vector(ROWS-1 downto 0) := (others => '0');
  -- As many channels as a table of six inputs can check for a fault and a waiting one that stays.
  constant CHECKED      : positive := 2;
  constant CHECKS       : positive := (CHANNELS + CHECKED - 1) / CHECKED;
  constant NO_CHECK     : std_logic_vector(CHECKS-1 downto 0) := (others => '0');

  signal waiting_r : std_logic_vector(PLACES-1 downto 0) := (others => '0');
  signal codes_r   : std_logic_vector(4*CHANNELS-1 downto 0);
  signal taken     : std_logic_vector(PLACES-1 downto 0);
  signal refused_r : std_logic_vector(CHECKS-1 downto 0);
  signal enabled_r : std_logic;

  -- A row that has a fault is found, then the fault in the row, then it leaves.
  signal row_waits   : std_logic_vector(ROWS-1 downto 0);
  signal has_row_r   : std_logic;
  signal has_r       : std_logic;
  signal row_r       : std_logic_vector(index_bits(ROWS)-1 downto 0) := (others => '0');
  signal column      : std_logic_vector(COLUMN_BITS-1 downto 0);
  signal column_r    : std_logic_vector(COLUMN_BITS-1 downto 0) := (others => '0');
  signal place       : std_logic_vector(index_bits(ROWS)+COLUMN_BITS-1 downto 0);
  signal chosen      : std_logic_vector(CHANNEL_BITS-1 downto 0);
  signal chosen_code : std_logic_vector(3 downto 0);

begin

  assert CHANNELS >= 2
    report "firm_status_faults: CHANNELS is " & integer'image(CHANNELS) & "; legal: 2 or more"
    severity failure;

  find_rows : for row in 0 to ROWS-1 generate
    row_waits(row) <= any_of(waiting_r((row+1)*COLUMNS-1 downto row*COLUMNS));
  end generate find_rows;

  u_column : entity firm.firm_sched_first_of_row
    generic map (
      ROWS    => ROWS,
      COLUMNS => COLUMNS
    )
    port map (
      request => waiting_r,
      row     => row_r,
      column  => column
    );

  place  <= row_r & column_r;
  chosen <= place(CHANNEL_BITS-1 downto 0);
  taken  <= decode(place, has_r, PLACES);

  u_code : entity firm.firm_axis_select
    generic map (
      WORDS   => CHANNELS,
      WIDTH   => 4,
      DECODED => true
    )
    port map (
      words_in => codes_r,
      index    => chosen,
      word     => chosen_code
    );

  take_faults : process (clk)
    variable refused : std_logic_vector(CHECKS-1 downto 0);
  begin
    if rising_edge(clk) then
      refused   := NO_CHECK;
      enabled_r <= enable;
      for number in 0 to CHANNELS-1 loop
        refused(number/CHECKED) := refused(number/CHECKED)
                                   or (frame_error(number) and waiting_r(number) and not taken(number));
        if waiting_r(number) = '0' or taken(number) = '1' then
          waiting_r(number) <= frame_error(number) and enable;
          if frame_error(number) = '1' then
            codes_r(4*number+3 downto 4*number) <= frame_error_code(4*number+3 downto 4*number);
          end if;
        end if;
      end loop;
      refused_r <= refused;
      if rst_n = '0' then
        waiting_r <= (others => '0');
        enabled_r <= '0';
      end if;
    end if;
  end process take_faults;

  lost <= '0' when refused_r = NO_CHECK else enabled_r;

  step : process (clk)
  begin
    if rising_edge(clk) then
      fault     <= has_r;
      has_r     <= has_row_r;
      has_row_r <= '0';
      row_r     <= first_of(row_waits);
      column_r  <= column;
      if has_row_r = '1' then
        row_r <= row_r;
      elsif has_r = '0' and row_waits /= NO_ROW then
        has_row_r <= may_leave;
      end if;
      if has_r = '1' then
        channel <= chosen;
        code    <= chosen_code;
      end if;
      if rst_n = '0' then
        fault     <= '0';
        has_r     <= '0';
        has_row_r <= '0';
        channel   <= (others => '0');
        code      <= (others => '0');
      end if;
    end if;
  end process step;

end architecture rtl;
