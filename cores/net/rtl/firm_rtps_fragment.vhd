-- SPDX-License-Identifier: Apache-2.0
-- Finds the fragments of a sample in the history: where one begins, how long it is, and whether it is the last one.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_rtps_pkg.all;

entity firm_rtps_fragment is
  port (
    clk : in std_logic;

    -- Another sample is selected; `size` is its size two cycles later. Its first fragment is then selected.
    looks : in std_logic;
    size  : in unsigned(RTPS_SAMPLE_BITS-1 downto 0);

    -- The number of a fragment in the sample, from 0 on.
    number_valid : in std_logic;
    number       : in std_logic_vector(5 downto 0);

    -- Of the sample, from three cycles after `looks` on. The program reads is_long in the first one of these.
    sample_bytes : out unsigned(RTPS_SAMPLE_BITS-1 downto 0);
    is_long      : out std_logic;  -- it has more bytes than a fragment

    -- Of the fragment, five cycles after `looks`, and four after its number. If is_beyond, `bytes` is invalid.
    start        : out unsigned(RTPS_SAMPLE_BITS-1 downto 0);
    bytes        : out unsigned(10 downto 0);
    is_last_part : out std_logic;
    is_beyond    : out std_logic
  );
end entity firm_rtps_fragment;

architecture rtl of firm_rtps_fragment is

  -- A fragment has 21 times 64 bytes: 16 and 4 and 1, as `find` adds them.
  constant BLOCK_COUNT : positive := 21;

  subtype size_t is unsigned(RTPS_SAMPLE_BITS-1 downto 0);

  signal looks_r  : std_logic;
  signal shown_r  : std_logic;  -- `size` is that of the sample
  signal size_r   : size_t := (others => '0');
  signal number_r : unsigned(5 downto 0) := (others => '0');
  signal start_r  : size_t := (others => '0');
  signal left_r   : unsigned(RTPS_SAMPLE_BITS downto 0) := (others => '0');  -- bytes from there on, as a signed number

begin

  assert RTPS_FRAGMENT_BYTES = 64*BLOCK_COUNT
    report "firm_rtps_fragment: a fragment has " & integer'image(RTPS_FRAGMENT_BYTES) & " bytes; legal: "
           & integer'image(64*BLOCK_COUNT)
    severity failure;
  assert 2**number'length*RTPS_FRAGMENT_BYTES >= 2**(RTPS_SAMPLE_BITS-1)
    report "firm_rtps_fragment: a sample has more fragments than there are numbers"
    severity failure;

  find : process (clk)
    variable blocks : unsigned(10 downto 0);
  begin
    if rising_edge(clk) then
      looks_r <= looks;
      shown_r <= looks_r;
      if shown_r = '1' then
        size_r  <= size;
        is_long <= '0';
        if size > RTPS_FRAGMENT_BYTES then
          is_long <= '1';
        end if;
      end if;
      if looks = '1' then
        number_r <= (others => '0');
      elsif number_valid = '1' then
        number_r <= unsigned(number);
      end if;
      blocks    := ("0" & number_r & "0000") + ("000" & number_r & "00") + ("00000" & number_r);
      start_r      <= blocks & "000000";
      left_r       <= ('0' & size_r) - ('0' & start_r);
      bytes        <= left_r(10 downto 0);
      is_last_part <= '1';
      is_beyond    <= left_r(RTPS_SAMPLE_BITS);
      if left_r = 0 then
        is_beyond <= '1';
      end if;
      if left_r(RTPS_SAMPLE_BITS) = '0' and left_r > RTPS_FRAGMENT_BYTES then
        bytes        <= to_unsigned(RTPS_FRAGMENT_BYTES, 11);
        is_last_part <= '0';
      end if;
    end if;
  end process find;

  sample_bytes <= size_r;
  start        <= start_r;

end architecture rtl;
