-- SPDX-License-Identifier: Apache-2.0
-- Checks the rules of AXI-Stream, and those of our frames, on a stream of a simulation, by a concurrent call in a bench
-- or by the entity firm_axis_checker. A rule is checked at rising edges of `clk`, with the values before them. In reset
-- only the rule `reset` applies. Simulation only.
library ieee;
use ieee.std_logic_1164.all;

package firm_sim_check_pkg is

  -- What is checked, as the generics of firm_axis_checker.
  type rules_t is record
    stable       : boolean;
    known        : boolean;
    idle_ready   : boolean;
    keep         : boolean;
    may_be_empty : boolean;
    reset        : boolean;
    abort        : boolean;
  end record rules_t;

  -- Of a stream without `tuser`.
  constant USUAL_RULES : rules_t := (may_be_empty => false, abort => false, others => true);

  procedure check_stream(
    signal   clk    : in std_logic;
    signal   rst_n  : in std_logic;
    signal   tdata  : in std_logic_vector;
    signal   tkeep  : in std_logic_vector;
    signal   tuser  : in std_logic_vector;
    signal   tvalid : in std_logic;
    signal   tlast  : in std_logic;
    signal   tready : in std_logic;
    constant name   : in string;
    constant level  : in severity_level;
    constant rules  : in rules_t
  );

  -- For benches: a violation ends the simulation.
  procedure check_stream(
    signal   clk    : in std_logic;
    signal   rst_n  : in std_logic;
    signal   tdata  : in std_logic_vector;
    signal   tkeep  : in std_logic_vector;
    signal   tvalid : in std_logic;
    signal   tlast  : in std_logic;
    signal   tready : in std_logic;
    constant name   : in string;
    constant rules  : in rules_t := USUAL_RULES
  );

end package firm_sim_check_pkg;

package body firm_sim_check_pkg is

  -- The beat at an edge.
  type beat_t is record
    tvalid : std_logic;
    tlast  : std_logic;
    tready : std_logic;
  end record beat_t;

  -- From one edge to the next. If a beat is waiting, it was offered and not accepted.
  type watch_t is record
    was_reset  : boolean;
    is_waiting : boolean;
    tlast      : std_logic;
  end record watch_t;

  constant BEGINNING : watch_t := (false, false, '0');

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
  function is_contiguous(tkeep : std_logic_vector) return boolean is
    alias lanes_kept : std_logic_vector(tkeep'length-1 downto 0) is tkeep;
  begin
    for lane in 1 to lanes_kept'high loop
      if lanes_kept(lane) = '1' and lanes_kept(lane-1) = '0' then
        return false;
      end if;
    end loop;
    return true;
  end function is_contiguous;

  procedure check_edge(
    rst_n    : in std_logic;
    tdata    : in std_logic_vector;
    tkeep    : in std_logic_vector;
    tuser    : in std_logic_vector;
    beat     : in beat_t;
    name     : in string;
    level    : in severity_level;
    rules    : in rules_t;
    watch    : inout watch_t;
    tdata_at : inout std_logic_vector;
    tkeep_at : inout std_logic_vector;
    tuser_at : inout std_logic_vector
  ) is
    alias    data : std_logic_vector(tdata'length-1 downto 0) is tdata;
    alias    kept : std_logic_vector(tkeep'length-1 downto 0) is tkeep;
    alias    user : std_logic_vector(tuser'length-1 downto 0) is tuser;
    constant FULL : std_logic_vector(tkeep'length-1 downto 0) := (others => '1');
    constant NONE : std_logic_vector(tkeep'length-1 downto 0) := (others => '0');

    procedure check(is_right : in boolean; rule : in string; fault : in string) is
    begin
      assert is_right report "firm_axis_checker: " & name & ": " & rule & ": " & fault severity level;
    end procedure check;

    procedure check_stable is
    begin
      check(beat.tvalid /= '0', "stable", "tvalid fell before tready");
      if beat.tvalid = '1' then
        check(tdata = tdata_at, "stable", "tdata changed before tready");
        check(tkeep = tkeep_at, "stable", "tkeep changed before tready");
        check(beat.tlast = watch.tlast, "stable", "tlast changed before tready");
        check(tuser = tuser_at, "stable", "tuser changed before tready");
      end if;
    end procedure check_stable;

    procedure check_known is
    begin
      check(is_known(beat.tvalid), "known", "tvalid is neither '0' nor '1'");
      check(is_known(beat.tready) or (beat.tvalid = '0' and not rules.idle_ready), "known",
            "tready is neither '0' nor '1'");
      if beat.tvalid = '1' then
        check(is_known(tkeep), "known", "a bit of tkeep is neither '0' nor '1'");
        check(is_known(beat.tlast), "known", "tlast is neither '0' nor '1'");
        check(not rules.abort or is_known(user(0)), "known", "tuser(0) is neither '0' nor '1'");
        for lane in kept'reverse_range loop
          check(kept(lane) /= '1' or is_known(data(8*lane+7 downto 8*lane)), "known",
                "a bit of byte " & integer'image(lane) & " is neither '0' nor '1'");
        end loop;
      end if;
    end procedure check_known;

    procedure check_keep is
    begin
      check(is_contiguous(tkeep), "keep", "tkeep has a gap");
      check(kept /= NONE or (rules.may_be_empty and beat.tlast = '1'), "keep", "tkeep is empty");
      check(kept = FULL or beat.tlast /= '0' or kept = NONE or not is_contiguous(tkeep), "keep",
            "tkeep is not full before the last beat");
    end procedure check_keep;

  begin
    if rst_n /= '1' then
      check(not rules.reset or not watch.was_reset or beat.tvalid = '0', "reset", "tvalid is not low in reset");
      watch.is_waiting := false;
    else
      if rules.stable and watch.is_waiting then
        check_stable;
      end if;
      if rules.known then
        check_known;
      end if;
      if beat.tvalid = '1' and rules.keep and is_known(tkeep) then
        check_keep;
      end if;
      if beat.tvalid = '1' and rules.abort then
        check(user(0) /= '1' or beat.tlast /= '0', "abort", "tuser(0) is high before the last beat");
      end if;
      watch.is_waiting := beat.tvalid = '1' and beat.tready = '0';
      watch.tlast      := beat.tlast;
      tdata_at         := tdata;
      tkeep_at         := tkeep;
      tuser_at         := tuser;
    end if;
    watch.was_reset := rst_n /= '1';
  end procedure check_edge;

  procedure check_stream(
    signal   clk    : in std_logic;
    signal   rst_n  : in std_logic;
    signal   tdata  : in std_logic_vector;
    signal   tkeep  : in std_logic_vector;
    signal   tuser  : in std_logic_vector;
    signal   tvalid : in std_logic;
    signal   tlast  : in std_logic;
    signal   tready : in std_logic;
    constant name   : in string;
    constant level  : in severity_level;
    constant rules  : in rules_t
  ) is
    variable watch    : watch_t := BEGINNING;
    variable tdata_at : std_logic_vector(tdata'length-1 downto 0);
    variable tkeep_at : std_logic_vector(tkeep'length-1 downto 0);
    variable tuser_at : std_logic_vector(tuser'length-1 downto 0);
  begin
    loop
      wait until rising_edge(clk);
      check_edge(rst_n, tdata, tkeep, tuser, (tvalid, tlast, tready), name, level, rules, watch, tdata_at, tkeep_at,
                 tuser_at);
    end loop;
  end procedure check_stream;

  procedure check_stream(
    signal   clk    : in std_logic;
    signal   rst_n  : in std_logic;
    signal   tdata  : in std_logic_vector;
    signal   tkeep  : in std_logic_vector;
    signal   tvalid : in std_logic;
    signal   tlast  : in std_logic;
    signal   tready : in std_logic;
    constant name   : in string;
    constant rules  : in rules_t := USUAL_RULES
  ) is
    constant NO_USER  : std_logic_vector(0 downto 0) := "0";
    variable watch    : watch_t := BEGINNING;
    variable tdata_at : std_logic_vector(tdata'length-1 downto 0);
    variable tkeep_at : std_logic_vector(tkeep'length-1 downto 0);
    variable tuser_at : std_logic_vector(NO_USER'range);
  begin
    loop
      wait until rising_edge(clk);
      check_edge(rst_n, tdata, tkeep, NO_USER, (tvalid, tlast, tready), name, failure, rules, watch, tdata_at, tkeep_at,
                 tuser_at);
    end loop;
  end procedure check_stream;

end package body firm_sim_check_pkg;
