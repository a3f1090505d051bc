-- SPDX-License-Identifier: Apache-2.0
-- Checks the rules of AXI-Stream, and those of our frames, on a stream of a simulation. It has no outputs: it reports
-- each violation with the stream's name and the rule, at its time.
--
-- A rule is checked at rising edges of `clk`, with the values before them. In reset only the rule `reset` applies.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.is_stream_width;

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

  constant LANES : positive := WIDTH/8;
  constant FULL  : std_logic_vector(LANES-1 downto 0) := (others => '1');
  constant NONE  : std_logic_vector(LANES-1 downto 0) := (others => '0');

  function is_known(value : std_logic) return boolean is
  begin
    return value = '0' or value = '1';
  end function is_known;

  function is_known(values : std_logic_vector) return boolean is
  begin
    for place in values'range loop
      if not is_known(values(place)) then
        return false;
      end if;
    end loop;
    return true;
  end function is_known;

  -- Whether no lane is kept above one that is not.
  function is_contiguous(lanes_kept : std_logic_vector(LANES-1 downto 0)) return boolean is
  begin
    for lane in 1 to LANES-1 loop
      if lanes_kept(lane) = '1' and lanes_kept(lane-1) = '0' then
        return false;
      end if;
    end loop;
    return true;
  end function is_contiguous;

  procedure check(is_right : in boolean; rule : in string; fault : in string) is
  begin
    assert is_right report "firm_axis_checker: " & NAME & ": " & rule & ": " & fault severity LEVEL;
  end procedure check;

begin

  assert is_stream_width(WIDTH)
    report "firm_axis_checker: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert USER_BITS >= 1
    report "firm_axis_checker: USER_BITS is " & integer'image(USER_BITS) & "; legal: 1 and more"
    severity failure;

  watch : process (clk)
    variable was_reset  : boolean := false;
    -- A beat was offered and not accepted.
    variable is_waiting : boolean := false;
    variable tdata      : std_logic_vector(WIDTH-1 downto 0);
    variable tkeep      : std_logic_vector(LANES-1 downto 0);
    variable tuser      : std_logic_vector(USER_BITS-1 downto 0);
    variable tlast      : std_logic;

    procedure check_stable is
    begin
      check(axis_tvalid /= '0', "stable", "tvalid fell before tready");
      if axis_tvalid = '1' then
        check(axis_tdata = tdata, "stable", "tdata changed before tready");
        check(axis_tkeep = tkeep, "stable", "tkeep changed before tready");
        check(axis_tlast = tlast, "stable", "tlast changed before tready");
        check(axis_tuser = tuser, "stable", "tuser changed before tready");
      end if;
    end procedure check_stable;

    procedure check_known is
    begin
      check(is_known(axis_tvalid), "known", "tvalid is neither '0' nor '1'");
      check(is_known(axis_tready) or (axis_tvalid = '0' and not IDLE_READY), "known", "tready is neither '0' nor '1'");
      if axis_tvalid = '1' then
        check(is_known(axis_tkeep), "known", "a bit of tkeep is neither '0' nor '1'");
        check(is_known(axis_tlast), "known", "tlast is neither '0' nor '1'");
        check(not ABORT or is_known(axis_tuser(0)), "known", "tuser(0) is neither '0' nor '1'");
        for lane in 0 to LANES-1 loop
          check(axis_tkeep(lane) /= '1' or is_known(axis_tdata(8*lane+7 downto 8*lane)), "known",
                "a bit of byte " & integer'image(lane) & " is neither '0' nor '1'");
        end loop;
      end if;
    end procedure check_known;

    procedure check_keep is
    begin
      check(is_contiguous(axis_tkeep), "keep", "tkeep has a gap");
      check(axis_tkeep /= NONE or (MAY_BE_EMPTY and axis_tlast = '1'), "keep", "tkeep is empty");
      check(axis_tkeep = FULL or axis_tlast /= '0' or axis_tkeep = NONE or not is_contiguous(axis_tkeep), "keep",
            "tkeep is not full before the last beat");
    end procedure check_keep;

  begin
    if rising_edge(clk) then
      if rst_n /= '1' then
        check(not RESET or not was_reset or axis_tvalid = '0', "reset", "tvalid is not low in reset");
        is_waiting := false;
      else
        if STABLE and is_waiting then
          check_stable;
        end if;
        if KNOWN then
          check_known;
        end if;
        if axis_tvalid = '1' and KEEP and is_known(axis_tkeep) then
          check_keep;
        end if;
        if axis_tvalid = '1' and ABORT then
          check(axis_tuser(0) /= '1' or axis_tlast /= '0', "abort", "tuser(0) is high before the last beat");
        end if;
        is_waiting := axis_tvalid = '1' and axis_tready = '0';
        tdata      := axis_tdata;
        tkeep      := axis_tkeep;
        tuser      := axis_tuser;
        tlast      := axis_tlast;
      end if;
      was_reset := rst_n /= '1';
    end if;
  end process watch;

end architecture simulation;
