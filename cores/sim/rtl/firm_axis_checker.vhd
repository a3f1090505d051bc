-- SPDX-License-Identifier: Apache-2.0
-- Checks the rules of AXI-Stream, and those of our frames, on a stream of a simulation. It has no outputs: it reports
-- each violation with the stream's name and the rule, at its time.
--
-- A rule is checked at rising edges of `clk`, with the values before them. In reset only the rule `reset` applies.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.is_stream_width;
use firm.firm_sim_check_pkg.all;

entity firm_axis_checker is
  generic (
    WIDTH     : integer := 8;
    USER_BITS : integer := 1;
    -- The stream, in reports.
    NAME : string;
    -- `failure` ends the simulation with the first violation.
    LEVEL : severity_level := error;

    -- What is checked.
    --
    -- A beat that is offered does not change until it is accepted.
    STABLE : boolean := true;
    -- `tvalid` and `tready` are '0' or '1', and so are `tkeep`, `tlast` and the bytes kept of a beat.
    KNOWN : boolean := true;
    -- So is `tready` without a beat; false where `tready` depends on `tlast`, which then has no value.
    IDLE_READY : boolean := true;
    -- `tkeep` is contiguous from byte 0, not empty, and full before the last beat.
    KEEP : boolean := true;
    -- The last beat may have no byte: the only beat of a stream without bytes.
    MAY_BE_EMPTY : boolean := false;
    -- `tvalid` is low from the second edge of a reset on.
    RESET : boolean := true;
    -- `tuser(0)`, which aborts a frame, is high on a last beat only. For streams with `tuser`.
    ABORT : boolean := false
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    axis_tdata  : in std_logic_vector(WIDTH-1 downto 0);
    axis_tkeep  : in std_logic_vector(WIDTH/8-1 downto 0);
    axis_tuser  : in std_logic_vector(USER_BITS-1 downto 0) := (others => '0');
    axis_tvalid : in std_logic;
    axis_tlast  : in std_logic;
    axis_tready : in std_logic
  );
end entity firm_axis_checker;

architecture simulation of firm_axis_checker is

  constant RULES : rules_t := (STABLE, KNOWN, IDLE_READY, KEEP, MAY_BE_EMPTY, RESET, ABORT);

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_checker: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert USER_BITS >= 1
    report "firm_axis_checker: USER_BITS is " & integer'image(USER_BITS) & "; legal: 1 and more"
    severity failure;

  check_stream(clk, rst_n, axis_tdata, axis_tkeep, axis_tuser, axis_tvalid, axis_tlast, axis_tready, NAME,
               LEVEL, RULES);

end architecture simulation;
