-- SPDX-License-Identifier: Apache-2.0
-- Simulates the accelerator with four motors in a closed loop; each line of a file is a control period.
--
-- A line of SCENARIO is V x z H: whether a command waits at the end of the period, the command as binary digits, and
-- the shafts that are held from the beginning of the period on, wheel 3 first. A line of RESULTS is V x z S E: whether
-- the command was answered soon after the end of the period, the response, the wheels that report a stall, and the
-- encoders' errors. The reader of RESULTS checks the values. The last period's line is written when it is over.

library ieee;
use ieee.std_logic_1164.all;

library std;
use std.textio.all;

entity mobile_robot_tb is
  generic (
    SCENARIO      : string   := "scenario.txt";
    RESULTS       : string   := "results.txt";
    PWM_CYCLES    : positive := 100;
    PWM_PERIODS   : positive := 5;
    CLOCK_HZ      : positive := 5_000_000;
    KP            : natural  := 1_000;
    KI            : natural  := 110;
    KD            : natural  := 200;
    TIMEOUT       : positive := 50;
    STALL_PERIODS : positive := 20;
    FILTER        : positive := 3;
    FULL_SPEED_0  : positive := 1_600_000;
    FULL_SPEED_1  : positive := 1_500_000;
    FULL_SPEED_2  : positive := 1_550_000;
    FULL_SPEED_3  : positive := 1_200_000;
    TIME_CONSTANT : positive := 50;
    -- Cycles until a response is accepted.
    ANSWER_WAITS  : natural  := 0
  );
end entity mobile_robot_tb;

architecture test of mobile_robot_tb is

  constant PERIOD        : time     := 10 ns;
  -- Inputs change after the edge, as a netlist sees its clock some delta cycles late.
  constant DELAY         : time     := 1 ns;
  constant PERIOD_CYCLES : positive := PWM_CYCLES * PWM_PERIODS;
  -- Cycles after a tick in which its response is expected.
  constant SETTLED       : positive := 40;
  type speeds_t is array (0 to 3) of positive;
  constant FULL_SPEEDS   : speeds_t := (FULL_SPEED_0, FULL_SPEED_1, FULL_SPEED_2, FULL_SPEED_3);

  signal clk           : std_logic := '0';
  signal rst_n         : std_logic := '0';
  signal is_done       : boolean   := false;

  signal in_x          : std_logic_vector(63 downto 0) := (others => '0');
  signal in_z          : std_logic_vector(63 downto 0) := (others => '0');
  signal in_msg_valid  : std_logic := '0';
  signal in_msg_ready  : std_logic;
  signal out_x         : std_logic_vector(63 downto 0);
  signal out_z         : std_logic_vector(63 downto 0);
  signal out_valid     : std_logic_vector(0 downto 0);
  signal out_msg_ready : std_logic := '0';
  signal pwm           : std_logic_vector(3 downto 0);
  signal dir           : std_logic_vector(3 downto 0);
  signal enc_a         : std_logic_vector(3 downto 0);
  signal enc_b         : std_logic_vector(3 downto 0);
  signal enc_errors    : std_logic_vector(31 downto 0);
  signal stalled       : std_logic_vector(3 downto 0);
  signal held          : std_logic_vector(3 downto 0) := "0000";
  signal commands      : natural := 0;
  signal answers       : natural := 0;
  signal answer_x      : std_logic_vector(63 downto 0) := (others => '0');
  signal answer_z      : std_logic_vector(63 downto 0) := (others => '0');

begin

  u_dut : entity work.mobile_robot
    generic map (
      CLOCK_HZ      => CLOCK_HZ,
      PWM_CYCLES    => PWM_CYCLES,
      PWM_PERIODS   => PWM_PERIODS,
      KP            => KP,
      KI            => KI,
      KD            => KD,
      TIMEOUT       => TIMEOUT,
      STALL_PERIODS => STALL_PERIODS,
      FILTER        => FILTER
    )
    port map (
      clk               => clk,
      rst_n             => rst_n,
      in_linear_x       => in_x,
      in_angular_z      => in_z,
      in_segment_valid  => "1",
      in_msg_valid      => in_msg_valid,
      in_msg_ready      => in_msg_ready,
      out_linear_x      => out_x,
      out_angular_z     => out_z,
      out_segment_valid => out_valid,
      out_msg_ready     => out_msg_ready,
      pwm               => pwm,
      dir               => dir,
      enc_a             => enc_a,
      enc_b             => enc_b,
      enc_errors        => enc_errors,
      stalled           => stalled
    );

  wheels : for k in 0 to 3 generate
    u_motor : entity work.motor
      generic map (
        PWM_CYCLES    => PWM_CYCLES,
        FULL_SPEED    => FULL_SPEEDS(k),
        TIME_CONSTANT => TIME_CONSTANT
      )
      port map (
        clk   => clk,
        rst_n => rst_n,
        pwm   => pwm(k),
        dir   => dir(k),
        held  => held(k),
        enc_a => enc_a(k),
        enc_b => enc_b(k)
      );
  end generate wheels;

  clk <= not clk after PERIOD / 2 when not is_done else '0';

  play : process
    file     scenario_file : text open read_mode is SCENARIO;
    file     result_file   : text open write_mode is RESULTS;
    variable vector        : line;
    variable is_command    : bit;
    variable x, z          : bit_vector(63 downto 0);
    variable shafts        : bit_vector(3 downto 0);
    variable is_first      : boolean := true;
    variable before        : natural := 0;

    procedure cycles(number : natural) is
    begin
      for k in 1 to number loop
        wait until rising_edge(clk);
      end loop;
    end procedure cycles;

    -- Of the period that has ended.
    procedure write_result is
      variable result : line;
    begin
      write(result, boolean'pos(answers /= before));
      before := answers;
      write(result, ' ');
      write(result, to_bitvector(answer_x));
      write(result, ' ');
      write(result, to_bitvector(answer_z));
      write(result, ' ');
      write(result, to_bitvector(stalled));
      write(result, ' ');
      write(result, to_bitvector(enc_errors));
      writeline(result_file, result);
    end procedure write_result;
  begin
    cycles(4);
    rst_n <= '1' after DELAY;
    -- Ticks are the edges PERIOD_CYCLES, 2*PERIOD_CYCLES, ... without reset. The motors' periods begin after edge 1.
    cycles(1);
    while not endfile(scenario_file) loop
      readline(scenario_file, vector);
      read(vector, is_command);
      read(vector, x);
      read(vector, z);
      read(vector, shafts);
      held <= to_stdlogicvector(shafts);
      -- A command is read for two cycles after its tick.
      cycles(2);
      in_msg_valid <= to_stdulogic(is_command) after DELAY;
      in_x         <= to_stdlogicvector(x) after DELAY;
      in_z         <= to_stdlogicvector(z) after DELAY;
      cycles(SETTLED - 2);
      if not is_first then
        write_result;
      end if;
      is_first := false;
      cycles(PERIOD_CYCLES - SETTLED);
    end loop;
    cycles(SETTLED);
    write_result;
    is_done <= true;
    wait;
  end process play;

  count : process (clk)
  begin
    if rising_edge(clk) and in_msg_valid = '1' and in_msg_ready = '1' then
      commands <= commands + 1;
    end if;
  end process count;

  take : process
    variable x, z : std_logic_vector(63 downto 0);
  begin
    wait until rising_edge(clk) and out_valid = "1";
    x := out_x;
    z := out_z;
    for k in 1 to ANSWER_WAITS loop
      wait until rising_edge(clk);
    end loop;
    out_msg_ready <= '1' after DELAY;
    wait until rising_edge(clk);
    out_msg_ready <= '0' after DELAY;
    assert out_valid = "1" and out_x = x and out_z = z
      report "mobile_robot_tb: an answer changed while it waited"
      severity failure;
    assert commands = answers + 1
      report "mobile_robot_tb: a command was taken while an answer waited"
      severity failure;
    answers  <= answers + 1;
    answer_x <= out_x;
    answer_z <= out_z;
  end process take;

end architecture test;
