-- SPDX-License-Identifier: Apache-2.0
-- Transfers levels to another clock domain: each bit passes a chain of registers, in which it has time to settle. Every
-- bit must come directly from a register of its own domain, without logic after it. Bits that change together may
-- arrive at different times.
--
-- Constraint: the path into first_r is asynchronous (docs/how-to/use-several-clocks.md).
library ieee;
use ieee.std_logic_1164.all;

entity firm_cdc_sync is
  generic (
    BITS : integer := 1;
    -- The length of the chain of registers, 2 or more.
    STAGES : integer := 2
  );
  port (
    clk    : in  std_logic;
    level  : in  std_logic_vector(BITS-1 downto 0);
    synced : out std_logic_vector(BITS-1 downto 0)
  );
end entity firm_cdc_sync;

architecture rtl of firm_cdc_sync is

  -- The first stage has a separate name, to which constraints refer. Place all stages side by side; they must never
  -- become a shift register in RAM.
  signal first_r  : std_logic_vector(BITS-1 downto 0);
  signal stages_r : std_logic_vector((STAGES-1)*BITS-1 downto 0);

  attribute async_reg     : string;
  attribute shreg_extract : string;
  attribute preserve      : boolean;
  attribute altera_attribute : string;
  attribute async_reg of first_r, stages_r     : signal is "true";
  attribute shreg_extract of first_r, stages_r : signal is "no";
  attribute preserve of first_r, stages_r      : signal is true;
  attribute altera_attribute of first_r        : signal is
    "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS";

begin

  assert BITS >= 1
    report "firm_cdc_sync: BITS is " & integer'image(BITS) & "; legal: 1 or more"
    severity failure;
  assert STAGES >= 2
    report "firm_cdc_sync: STAGES is " & integer'image(STAGES) & "; legal: 2 or more"
    severity failure;

  pass_on : process (clk)
  begin
    if rising_edge(clk) then
      first_r                   <= level;
      stages_r(BITS-1 downto 0) <= first_r;
      for stage in 1 to STAGES-2 loop
        stages_r((stage+1)*BITS-1 downto stage*BITS) <= stages_r(stage*BITS-1 downto (stage-1)*BITS);
      end loop;
    end if;
  end process pass_on;

  synced <= stages_r((STAGES-1)*BITS-1 downto (STAGES-2)*BITS);

end architecture rtl;
