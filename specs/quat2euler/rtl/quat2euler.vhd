-- SPDX-License-Identifier: Apache-2.0
-- Converts geometry_msgs/Quaternion to geometry_msgs/Point: roll (x), pitch (y) and yaw (z) in rad.
--
-- With P = w + y, Q = w - y, R = x + z and S = z - x, the half angles come without a product:
--   alpha = atan2(R, Q), beta = atan2(S, P): roll = alpha - beta, yaw = alpha + beta
--   pitch = 2 * atan2(|P + iS|, |Q + iR|) - pi/2
-- after Bernardes and Viollet, "Quaternion to Euler angles conversion" (2022). Lengths cancel, so the
-- quaternion need not be a unit, and only angles that are undefined at the gimbal lock are ill-conditioned.
-- Two CORDIC units turn (Q, R) and (P, S); a third computes the pitch from their lengths while they process
-- the next message. The latency is 92 cycles, and a message is taken every 37.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_cordic_table.all;

entity quat2euler is
  port (
    clk               : in  std_logic;
    rst_n             : in  std_logic;

    -- float64, any length but zero; README.md lists the results of zero, infinity and NaN.
    in_x              : in  std_logic_vector(63 downto 0);
    in_y              : in  std_logic_vector(63 downto 0);
    in_z              : in  std_logic_vector(63 downto 0);
    in_w              : in  std_logic_vector(63 downto 0);
    -- Not read: the message has no variable part, so its only segment comes with the whole message.
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;

    out_x             : out std_logic_vector(63 downto 0);
    out_y             : out std_logic_vector(63 downto 0);
    out_z             : out std_logic_vector(63 downto 0);
    out_segment_valid : out std_logic_vector(0 downto 0);
    out_msg_ready     : in  std_logic
  );
end entity quat2euler;

architecture rtl of quat2euler is

  -- The largest of x, y, z, w becomes 1/2 to 1. So |P + iS| < 2.83, and twice CORDIC's gain of 1.6468
  -- leaves it below 8: sign, 3 integer and 60 fraction bits.
  constant WIDTH      : positive := 64;
  constant FRACTION   : positive := 60;
  -- Each atan2 is within 2**-34 rad, each result within 2**-33 = 1.2e-10.
  constant ITERATIONS : positive := 35;

  subtype word_t is signed(WIDTH-1 downto 0);
  subtype word_vector_t is std_logic_vector(WIDTH-1 downto 0);
  -- An angle of the CORDIC units, -pi to pi.
  subtype angle_vector_t is std_logic_vector(FRACTION+2 downto 0);

  constant FIRST_ANGLE : word_t := resize(signed('0' & arctangent(0, FRACTION)), WIDTH);

  -- The special cases of a message, which accompany its numbers from stage to stage.
  type kind_t is record
    undefined : std_logic;
    zero      : std_logic;
  end record kind_t;

  -- The angle that goes to float64 next; HOLD until the message is taken.
  type turn_t is (ROLL, YAW, PITCH, HOLD);

  -- The CORDIC units' own pi, to the bit. Signals, set bit by bit: ghdl 2.0 translates a constant of more
  -- than 32 bits to a Verilog string.
  signal quarter_pi      : word_t;
  signal half_pi         : word_t;
  signal pi              : word_t;
  signal two_pi          : word_t;

  -- x, y, z and w with a common exponent.
  signal in_numbers      : std_logic_vector(4*64-1 downto 0);
  signal block_numbers   : std_logic_vector(4*(FRACTION+1)-1 downto 0);
  signal block_valid     : std_logic;
  signal block_ready     : std_logic;
  signal block_kind      : kind_t;

  -- P, Q, R and S.
  signal sum_valid_r     : std_logic;
  signal sum_kind_r      : kind_t;
  signal sum_p_r         : word_t;
  signal sum_q_r         : word_t;
  signal sum_r_r         : word_t;
  signal sum_s_r         : word_t;

  -- alpha and beta; both units always do the same step.
  signal half_in_valid   : std_logic;
  signal half_in_ready   : std_logic;
  signal half_out_valid  : std_logic;
  signal half_out_ready  : std_logic;
  signal half_kind_r     : kind_t;
  signal alpha_in_ready  : std_logic;
  signal beta_in_ready   : std_logic;
  signal alpha_out_valid : std_logic;
  signal beta_out_valid  : std_logic;
  signal alpha           : angle_vector_t;
  signal beta            : angle_vector_t;
  signal length_qr       : word_vector_t;
  signal length_ps       : word_vector_t;

  -- Roll and yaw, not yet wrapped: the one that goes first, which is compared with a half turn in the next cycle.
  signal angles_valid_r  : std_logic;
  signal angles_kind_r   : kind_t;
  signal first_r         : word_t := (others => '0');
  signal second_r        : word_t;
  signal compared_r      : std_logic;
  signal above_r         : std_logic;
  signal below_r         : std_logic;

  signal pitch_in_ready  : std_logic;
  signal pitch_out_valid : std_logic;
  signal pitch_out_ready : std_logic;
  -- Half of pitch + pi/2.
  signal half_pitch      : angle_vector_t;

  signal turn_r          : turn_t;
  signal issue           : std_logic;
  signal angle_valid_r   : std_logic;
  signal angle_r         : word_t;
  signal float_valid     : std_logic;
  signal float           : std_logic_vector(63 downto 0);

  signal out_kind_r      : kind_t;
  signal out_count_r     : unsigned(1 downto 0);
  signal out_valid_r     : std_logic;
  signal out_x_r         : std_logic_vector(63 downto 0);
  signal out_y_r         : std_logic_vector(63 downto 0);
  signal out_z_r         : std_logic_vector(63 downto 0);

begin

  multiples : for k in quarter_pi'range generate
    quarter_pi(k) <= FIRST_ANGLE(k);
  end generate multiples;
  half_pi <= shift_left(quarter_pi, 1);
  pi      <= shift_left(quarter_pi, 2);
  two_pi  <= shift_left(quarter_pi, 3);

  out_x                <= out_x_r;
  out_y                <= out_y_r;
  out_z                <= out_z_r;
  out_segment_valid(0) <= out_valid_r;

  in_numbers <= in_w & in_z & in_y & in_x;

  u_block : entity firm.firm_float64_to_block
    generic map (
      COUNT    => 4,
      FRACTION => FRACTION
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => in_msg_valid,
      in_ready      => in_msg_ready,
      in_numbers    => in_numbers,
      out_valid     => block_valid,
      out_ready     => block_ready,
      out_numbers   => block_numbers,
      out_exponent  => open,
      out_undefined => block_kind.undefined,
      out_zero      => block_kind.zero
    );

  block_ready   <= not sum_valid_r or half_in_ready;
  half_in_valid <= sum_valid_r;
  half_in_ready <= alpha_in_ready and beta_in_ready;

  sums : process (clk)
    variable x : word_t;
    variable y : word_t;
    variable z : word_t;
    variable w : word_t;
  begin
    if rising_edge(clk) then
      if block_ready = '1' then
        sum_valid_r <= block_valid;
        sum_kind_r  <= block_kind;
        x           := resize(signed(block_numbers(FRACTION downto 0)), WIDTH);
        y           := resize(signed(block_numbers(2*FRACTION+1 downto FRACTION+1)), WIDTH);
        z           := resize(signed(block_numbers(3*FRACTION+2 downto 2*FRACTION+2)), WIDTH);
        w           := resize(signed(block_numbers(4*FRACTION+3 downto 3*FRACTION+3)), WIDTH);
        sum_p_r     <= w + y;
        sum_q_r     <= w - y;
        sum_r_r     <= x + z;
        sum_s_r     <= z - x;
      end if;
      if rst_n = '0' then
        sum_valid_r <= '0';
      end if;
    end if;
  end process sums;

  u_alpha : entity firm.firm_cordic_vectoring
    generic map (
      WIDTH      => WIDTH,
      FRACTION   => FRACTION,
      ITERATIONS => ITERATIONS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => half_in_valid,
      in_ready      => alpha_in_ready,
      in_x          => std_logic_vector(sum_q_r),
      in_y          => std_logic_vector(sum_r_r),
      out_valid     => alpha_out_valid,
      out_ready     => half_out_ready,
      out_magnitude => length_qr,
      out_angle     => alpha
    );

  u_beta : entity firm.firm_cordic_vectoring
    generic map (
      WIDTH      => WIDTH,
      FRACTION   => FRACTION,
      ITERATIONS => ITERATIONS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => half_in_valid,
      in_ready      => beta_in_ready,
      in_x          => std_logic_vector(sum_p_r),
      in_y          => std_logic_vector(sum_s_r),
      out_valid     => beta_out_valid,
      out_ready     => half_out_ready,
      out_magnitude => length_ps,
      out_angle     => beta
    );

  -- Here, lengths and angles take separate paths. A pitch leaves its unit after its roll and yaw left
  -- `angles`, so if that unit is free, `angles` is free, too.
  half_out_valid <= alpha_out_valid and beta_out_valid;
  half_out_ready <= half_out_valid and pitch_in_ready;

  angles : process (clk)
  begin
    if rising_edge(clk) then
      if half_in_valid = '1' and half_in_ready = '1' then
        half_kind_r <= sum_kind_r;
      end if;
      compared_r <= angles_valid_r;
      if half_out_ready = '1' then
        angles_valid_r <= '1';
        angles_kind_r  <= half_kind_r;
        first_r        <= resize(signed(alpha), WIDTH) - signed(beta);
        second_r       <= resize(signed(alpha), WIDTH) + signed(beta);
      elsif compared_r = '1' and turn_r = ROLL then
        first_r    <= second_r;
        compared_r <= '0';
      elsif compared_r = '1' and turn_r = YAW then
        angles_valid_r <= '0';
        compared_r     <= '0';
      end if;
      if rst_n = '0' then
        angles_valid_r <= '0';
        compared_r     <= '0';
      end if;
    end if;
  end process angles;

  compare : process (clk)
  begin
    if rising_edge(clk) then
      above_r <= '0';
      below_r <= '0';
      if first_r > pi then
        above_r <= '1';
      elsif first_r <= -pi then
        below_r <= '1';
      end if;
    end if;
  end process compare;

  u_pitch : entity firm.firm_cordic_vectoring
    generic map (
      WIDTH      => WIDTH,
      FRACTION   => FRACTION,
      ITERATIONS => ITERATIONS
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      in_valid      => half_out_valid,
      in_ready      => pitch_in_ready,
      in_x          => length_qr,
      in_y          => length_ps,
      out_valid     => pitch_out_valid,
      out_ready     => pitch_out_ready,
      out_magnitude => open,
      out_angle     => half_pitch
    );

  pitch_out_ready <= '1' when turn_r = PITCH else '0';

  issue <= compared_r when turn_r = ROLL or turn_r = YAW else
           pitch_out_valid when turn_r = PITCH else
           '0';

  -- Roll and yaw go while the third unit still works, into output registers that are empty by then.
  proceed : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '0' then
        turn_r <= ROLL;
      elsif turn_r = HOLD then
        if out_valid_r = '1' and out_msg_ready = '1' then
          turn_r <= ROLL;
        end if;
      elsif issue = '1' then
        if turn_r = ROLL then
          turn_r <= YAW;
        elsif turn_r = YAW then
          turn_r <= PITCH;
        else
          turn_r <= HOLD;
        end if;
      end if;
    end if;
  end process proceed;

  wrap : process (clk)
    variable raw    : word_t;
    variable offset : word_t;
  begin
    if rising_edge(clk) then
      angle_valid_r <= issue and rst_n;
      if issue = '1' then
        raw    := first_r;
        offset := (others => '0');
        if turn_r = PITCH then
          raw    := signed(half_pitch & '0');
          offset := -half_pi;
        elsif above_r = '1' then
          offset := -two_pi;
        elsif below_r = '1' then
          offset := two_pi;
        end if;
        angle_r <= raw + offset;
      end if;
    end if;
  end process wrap;

  u_float : entity firm.firm_fixed_to_float64
    generic map (
      FRACTION => FRACTION
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      in_valid   => angle_valid_r,
      in_number  => std_logic_vector(angle_r),
      out_valid  => float_valid,
      out_number => float
    );

  -- The outputs are a shift register: roll enters first, pitch last.
  outputs : process (clk)
  begin
    if rising_edge(clk) then
      if turn_r = ROLL then
        out_kind_r <= angles_kind_r;
      end if;
      if float_valid = '1' then
        out_x_r <= out_z_r;
        out_z_r <= out_y_r;
        out_y_r <= float;
        if out_kind_r.undefined = '1' then
          -- The quiet NaN; in slices, as ghdl 2.0 synthesises X"7FF8000000000000" to zeros.
          out_y_r               <= (others => '0');
          out_y_r(62 downto 51) <= (others => '1');
        elsif out_kind_r.zero = '1' then
          out_y_r <= (others => '0');
        end if;
      end if;
      if rst_n = '0' then
        out_count_r <= "00";
        out_valid_r <= '0';
      elsif float_valid = '1' then
        if out_count_r = 2 then
          out_count_r <= "00";
          out_valid_r <= '1';
        else
          out_count_r <= out_count_r + 1;
        end if;
      elsif out_msg_ready = '1' then
        out_valid_r <= '0';
      end if;
    end if;
  end process outputs;

end architecture rtl;
