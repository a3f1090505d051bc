-- SPDX-License-Identifier: Apache-2.0
-- Drives the four motors of a skid-steer robot by geometry_msgs/Twist, and returns the twist that encoders measure.
--
-- Once per control period, the encoders' counts and a waiting command are taken. The command becomes the speeds that
-- the wheels of each side should have, each wheel's controller computes its duty, and the response is the
-- twist of the period that just ended. Without a command for TIMEOUT periods, the robot stops. While a response is not
-- taken, no command is taken either.
--
-- A command waits for the end of a period, and the next one waits in the converter. Nothing is lost: back-pressure
-- stalls a host that sends more often.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity mobile_robot is
  generic (
    CLOCK_HZ        : positive := 100_000_000;
    -- Cycles of a PWM period, 20 kHz, and PWM periods of a control period, 10 kHz.
    PWM_CYCLES      : positive := 5_000;
    PWM_PERIODS     : positive := 2;
    -- Between the middles of the left and the right wheels; effective, as a skid-steer robot's wheels slip.
    TRACK_WIDTH_UM  : positive := 400_000;
    WHEEL_RADIUS_UM : positive := 100_000;
    -- 512 lines, four edges each, with a gear of 100: 33 counts per period at 1 m/s.
    COUNTS_PER_TURN : positive := 204_800;
    -- The limit of a wheel's setpoint in counts per period: 1.23 m/s.
    SPEED_LIMIT     : positive := 40;
    -- Cycles of duty for one count per period, in units of 2**-8. For a motor of 48 counts per period at full duty, K,
    -- and a time constant of ten periods, T: KP = T/(K (4 + 1.5)) for a loop of 4 periods and a delay of 1.5, KI =
    -- KP/T and a tenth more.
    KP              : natural  := 50_000;
    KI              : natural  := 5_500;
    KD              : natural  := 10_000;
    -- Periods: 0.5 s without a command; 20 ms at full duty without a count.
    TIMEOUT         : positive := 5_000;
    STALL_PERIODS   : positive := 200;
    -- Samples of an encoder that must agree.
    FILTER          : positive := 4
  );
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;

    -- float64, m/s and rad/s.
    in_linear_x       : in  std_logic_vector(63 downto 0);
    in_angular_z      : in  std_logic_vector(63 downto 0);
    -- Not read: the message has no variable part, so its only segment comes with the whole message.
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;

    out_linear_x      : out std_logic_vector(63 downto 0);
    out_angular_z     : out std_logic_vector(63 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic;

    -- Front left, front right, rear left, rear right, the first one lowest.
    pwm               : out std_logic_vector(3 downto 0);
    dir               : out std_logic_vector(3 downto 0);
    enc_a             : in  std_logic_vector(3 downto 0);
    enc_b             : in  std_logic_vector(3 downto 0);
    -- Errors of each encoder, eight bits, and wheels that do not turn at full duty.
    enc_errors        : out std_logic_vector(31 downto 0);
    stalled           : out std_logic_vector(3 downto 0)
  );
end entity mobile_robot;

architecture rtl of mobile_robot is

  constant WHEELS         : positive := 4;
  -- Cycles after the tick: more than the conversion of a command to speeds takes.
  constant COMMAND_CYCLES : positive := 12;

  signal position_r     : natural range 0 to PWM_CYCLES-1;
  signal position       : std_logic_vector(14 downto 0);
  -- The last cycle of a PWM period, and of a control period.
  signal pwm_last_r     : std_logic;
  signal tick_r         : std_logic;
  signal period_r       : natural range 0 to PWM_PERIODS-1;

  signal counts         : std_logic_vector(8*WHEELS-1 downto 0);
  signal counts_r       : std_logic_vector(8*WHEELS-1 downto 0);
  signal taking         : std_logic;
  -- The first and the second cycle of a command's work.
  signal taken_r        : std_logic_vector(1 downto 0);
  signal silence_r      : natural range 0 to TIMEOUT;

  signal left           : std_logic_vector(15 downto 0);
  signal right          : std_logic_vector(15 downto 0);
  signal left_r         : std_logic_vector(15 downto 0);
  signal right_r        : std_logic_vector(15 downto 0);
  signal is_commanded   : std_logic;
  signal is_measured    : std_logic;
  signal x              : std_logic_vector(63 downto 0);
  signal z              : std_logic_vector(63 downto 0);
  signal out_valid_r    : std_logic;
  -- Cycles since the tick, until the controllers start.
  signal wait_r         : natural range 0 to COMMAND_CYCLES;
  signal start          : std_logic;

begin

  position          <= std_logic_vector(to_unsigned(position_r, position'length));
  start             <= '1' when wait_r = COMMAND_CYCLES else '0';
  taking            <= tick_r and in_msg_valid and not out_valid_r;
  in_msg_ready      <= taken_r(1);
  out_segment_valid <= (others => out_valid_r);
  out_linear_x      <= x;
  out_angular_z     <= z;

  assert PWM_CYCLES >= 32 and PWM_CYCLES <= 32767
    report "mobile_robot: PWM_CYCLES is " & integer'image(PWM_CYCLES) & ", legal: 32 to 32767"
    severity failure;

  time_base : process (clk)
  begin
    if rising_edge(clk) then
      pwm_last_r <= '0';
      tick_r     <= '0';
      if position_r = PWM_CYCLES-2 then
        pwm_last_r <= '1';
        if period_r = PWM_PERIODS-1 then
          tick_r <= '1';
        end if;
      end if;
      if pwm_last_r = '0' then
        position_r <= position_r + 1;
      else
        position_r <= 0;
        if tick_r = '1' then
          period_r <= 0;
        else
          period_r <= period_r + 1;
        end if;
      end if;
      if tick_r = '1' then
        wait_r <= 1;
      elsif start = '1' then
        wait_r <= 0;
      elsif wait_r /= 0 then
        wait_r <= wait_r + 1;
      end if;
      if rst_n = '0' then
        position_r <= 0;
        period_r   <= 0;
        pwm_last_r <= '0';
        tick_r     <= '0';
        wait_r     <= 0;
      end if;
    end if;
  end process time_base;

  command : process (clk)
  begin
    if rising_edge(clk) then
      taken_r <= taken_r(0) & taking;
      if tick_r = '1' then
        counts_r <= counts;
        if taking = '1' then
          silence_r <= 0;
        elsif silence_r /= TIMEOUT then
          silence_r <= silence_r + 1;
        end if;
      end if;
      if is_commanded = '1' then
        left_r  <= left;
        right_r <= right;
      elsif silence_r = TIMEOUT then
        left_r  <= (others => '0');
        right_r <= (others => '0');
      end if;
      if is_measured = '1' then
        out_valid_r <= '1';
      elsif out_msg_ready = '1' then
        out_valid_r <= '0';
      end if;
      if rst_n = '0' then
        taken_r     <= "00";
        silence_r   <= 0;
        left_r      <= (others => '0');
        right_r     <= (others => '0');
        out_valid_r <= '0';
      end if;
    end if;
  end process command;

  u_kinematics : entity work.skid_steer
    generic map (
      CLOCK_HZ        => CLOCK_HZ,
      PERIOD_CYCLES   => PWM_CYCLES * PWM_PERIODS,
      TRACK_WIDTH_UM  => TRACK_WIDTH_UM,
      WHEEL_RADIUS_UM => WHEEL_RADIUS_UM,
      COUNTS_PER_TURN => COUNTS_PER_TURN,
      SPEED_LIMIT     => SPEED_LIMIT
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_start   => taken_r(0),
      in_x       => in_linear_x,
      in_z       => in_angular_z,
      in_done    => is_commanded,
      in_left    => left,
      in_right   => right,
      out_start  => taken_r(0),
      out_counts => counts_r,
      out_done   => is_measured,
      out_x      => x,
      out_z      => z
    );

  each_wheel : for k in 0 to WHEELS-1 generate
    signal setpoint : std_logic_vector(15 downto 0);
    signal duty     : std_logic_vector(15 downto 0);
  begin
    setpoint <= left_r when k mod 2 = 0 else right_r;

    u_decoder : entity work.quadrature_decoder
      generic map (
        FILTER     => FILTER,
        COUNT_BITS => 8
      )
      port map (
        clk    => clk,
        rst_n  => rst_n,
        enc_a  => enc_a(k),
        enc_b  => enc_b(k),
        sample => tick_r,
        count  => counts(8*k+7 downto 8*k),
        errors => enc_errors(8*k+7 downto 8*k)
      );

    u_pid : entity work.wheel_pid
      generic map (
        LIMIT         => PWM_CYCLES,
        STALL_PERIODS => STALL_PERIODS,
        KP            => KP,
        KI            => KI,
        KD            => KD
      )
      port map (
        clk      => clk,
        rst_n    => rst_n,
        start    => start,
        setpoint => setpoint,
        speed    => counts_r(8*k+7 downto 8*k),
        duty     => duty,
        stalled  => stalled(k)
      );

    u_pwm : entity work.pwm_driver
      port map (
        clk      => clk,
        rst_n    => rst_n,
        position => position,
        is_last  => pwm_last_r,
        duty     => duty,
        pwm      => pwm(k),
        dir      => dir(k)
      );
  end generate each_wheel;

end architecture rtl;
