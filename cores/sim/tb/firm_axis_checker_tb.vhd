-- SPDX-License-Identifier: Apache-2.0
-- Sends a stream of random frames with random handshakes and one fault, at a random time. Values that no rule
-- constrains are 'X': the stream without a beat, and bytes that are not kept.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;
library firm;

entity firm_axis_checker_tb is
  generic (
    WIDTH : integer := 16;
    SEED  : integer := 1;
    -- The fault: none, or the rule and its violation, as in `break`.
    FAULT : string := "none";
    -- A rule that is not checked.
    UNCHECKED     : string  := "none";
    MAY_BE_EMPTY  : boolean := false;
    VALID_PERCENT : integer := 70;
    READY_PERCENT : integer := 50
  );
end entity firm_axis_checker_tb;

architecture simulation of firm_axis_checker_tb is

  constant LANES  : positive := WIDTH/8;
  constant CYCLES : positive := 4000;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';

  signal tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal tkeep  : std_logic_vector(LANES-1 downto 0);
  signal tuser  : std_logic_vector(1 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;
  signal tready : std_logic;

begin

  u_checker : entity firm.firm_axis_checker
    generic map (
      WIDTH        => WIDTH,
      USER_BITS    => 2,
      NAME         => "random frames",
      STABLE       => UNCHECKED /= "stable",
      KNOWN        => UNCHECKED /= "known",
      KEEP         => UNCHECKED /= "keep",
      MAY_BE_EMPTY => MAY_BE_EMPTY,
      RESET        => UNCHECKED /= "reset",
      ABORT        => UNCHECKED /= "abort"
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => tdata,
      axis_tkeep  => tkeep,
      axis_tuser  => tuser,
      axis_tvalid => tvalid,
      axis_tlast  => tlast,
      axis_tready => tready
    );

  play : process
    variable random_1   : positive := SEED;
    variable random_2   : positive := 29;
    variable has_broken : boolean  := FAULT = "none";
    variable from_cycle : natural;
    variable is_offered : boolean  := false;
    variable is_waiting : boolean;              -- since an earlier cycle
    -- The offered beat.
    variable bytes      : std_logic_vector(WIDTH-1 downto 0);
    variable lanes_kept : positive;
    variable kept       : std_logic_vector(LANES-1 downto 0);
    variable user       : std_logic_vector(1 downto 0);
    variable last       : std_logic;
    variable ready      : std_logic := '0';

    impure function draw(values : positive) return natural is
      variable part : real;
    begin
      uniform(random_1, random_2, part);
      return integer(trunc(part * real(values)));
    end function draw;

    impure function drawn_bit(percent : natural) return std_logic is
    begin
      if draw(100) < percent then
        return '1';
      end if;
      return '0';
    end function drawn_bit;

    procedure draw_beat is
    begin
      last       := drawn_bit(30);
      user       := drawn_bit(50) & (last and drawn_bit(20));
      lanes_kept := LANES;
      if last = '1' then
        lanes_kept := 1 + draw(LANES);
      end if;
      kept                        := (others => '0');
      kept(lanes_kept-1 downto 0) := (others => '1');
      bytes                       := (others => 'X');
      for place in 0 to 8*lanes_kept-1 loop
        bytes(place) := drawn_bit(50);
      end loop;
    end procedure draw_beat;

    procedure offer is
    begin
      tvalid <= '0';
      tdata  <= (others => 'X');
      tkeep  <= (others => 'X');
      tuser  <= (others => 'X');
      tlast  <= 'X';
      tready <= ready;
      if is_offered then
        tvalid <= '1';
        tdata  <= bytes;
        tkeep  <= kept;
        tuser  <= user;
        tlast  <= last;
      end if;
    end procedure offer;

    -- Break a beat that is waiting.
    procedure break_waiting is
    begin
      has_broken := true;
      if FAULT = "stable tvalid" then
        tvalid <= '0';
      elsif FAULT = "stable tdata" then
        tdata(0) <= not bytes(0);
      elsif FAULT = "stable tkeep" and last = '1' and lanes_kept > 1 then
        tkeep(lanes_kept-1) <= '0';
      elsif FAULT = "stable tlast" and lanes_kept = LANES then
        tlast    <= not last;
        tuser(0) <= '0';
      elsif FAULT = "stable tuser" then
        tuser(1) <= not user(1);
      else
        has_broken := false;
      end if;
    end procedure break_waiting;

    -- Break a beat that is accepted at once.
    procedure break_accepted is
    begin
      has_broken := true;
      if FAULT = "known tvalid" then
        tvalid <= 'X';
      elsif FAULT = "known tready" then
        tready <= 'U';
      elsif FAULT = "known tdata" then
        tdata(draw(8)) <= 'X';
      elsif FAULT = "known tkeep" then
        tkeep(LANES-1) <= 'X';
      elsif FAULT = "known tlast" then
        tlast <= 'U';
      elsif FAULT = "known tuser" then
        tuser(0) <= 'X';
      elsif FAULT = "keep gap" and last = '1' and lanes_kept > 1 then
        tkeep(0) <= '0';
      elsif FAULT = "keep partial" and last = '0' then
        tkeep(LANES-1) <= '0';
      elsif FAULT = "keep empty" and last = '1' then
        tkeep <= (others => '0');
      elsif FAULT = "abort" and last = '0' then
        tuser(0) <= '1';
      else
        has_broken := false;
      end if;
    end procedure break_accepted;

  begin
    report "SEED is " & integer'image(SEED);
    from_cycle := 20 + draw(CYCLES/8);
    for cycle in 1 to CYCLES loop
      is_waiting := is_offered and ready = '0';
      if not is_waiting then
        is_offered := draw(100) < VALID_PERCENT;
        draw_beat;
      end if;
      ready := drawn_bit(READY_PERCENT);
      rst_n <= '1';
      -- Also a reset in the middle.
      if cycle <= 4 or (cycle > CYCLES/4 and cycle <= CYCLES/4 + 4) then
        rst_n      <= '0';
        is_offered := false;
      end if;
      offer;
      if FAULT = "reset" and cycle = CYCLES/4 + 2 then
        tvalid     <= '1';
        has_broken := true;
      elsif cycle >= from_cycle and not has_broken then
        if is_waiting then
          break_waiting;
        elsif is_offered and ready = '1' then
          break_accepted;
        end if;
      end if;
      wait for 5 ns;
      clk <= '1';
      wait for 5 ns;
      clk <= '0';
    end loop;
    assert has_broken
      report "the fault '" & FAULT & "' was not made" severity failure;
    report "PASS " & integer'image(CYCLES) & " cycles";
    wait;
  end process play;

end architecture simulation;
