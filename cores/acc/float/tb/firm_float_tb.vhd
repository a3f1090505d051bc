-- SPDX-License-Identifier: Apache-2.0
-- Tests an operation on floating-point numbers, fed by firm_sim_operation. The first operand is in the highest bits of
-- a line; flags, if any, follow a result.

library ieee;
use ieee.std_logic_1164.all;

library firm;

entity firm_float_tb is
  generic (
    VECTORS           : string   := "vectors.txt";
    RESULTS           : string   := "results.txt";
    EXPECTED          : string   := "";
    -- add, subtract, multiply, multiply_add, divide, square_root, compare, clamp, resize, to_fixed, from_fixed, sincos,
    -- low_pass or pid.
    OPERATION         : string   := "add";
    EXPONENT_BITS     : positive := 11;
    MANTISSA_BITS     : positive := 52;
    -- Of the result of resize.
    OUT_EXPONENT_BITS : positive := 8;
    OUT_MANTISSA_BITS : positive := 23;
    -- Of fixed-point numbers.
    WIDTH             : positive := 32;
    FRACTION          : natural  := 0;
    IS_SIGNED         : boolean  := true;
    TRUNCATES         : boolean  := false;
    -- Of add, subtract and multiply.
    IS_SHORT          : boolean  := false;
    SEED              : positive := 1;
    -- Cycles of 100 in which one side of the handshake stalls.
    STALLS            : natural  := 30
  );
end entity firm_float_tb;

architecture test of firm_float_tb is

  constant PERIOD : time     := 10 ns;
  constant NUMBER : positive := EXPONENT_BITS + MANTISSA_BITS + 1;

  function in_width return positive is
  begin
    if OPERATION = "pid" then
      return 8*NUMBER;
    elsif OPERATION = "multiply_add" or OPERATION = "clamp" or OPERATION = "low_pass" then
      return 3*NUMBER;
    elsif OPERATION = "from_fixed" then
      return WIDTH;
    elsif OPERATION = "square_root" or OPERATION = "resize" or OPERATION = "to_fixed" or OPERATION = "sincos" or
          OPERATION = "exp" or OPERATION = "log" then
      return NUMBER;
    end if;
    return 2*NUMBER;
  end function in_width;

  function out_width return positive is
  begin
    if OPERATION = "resize" then
      return OUT_EXPONENT_BITS + OUT_MANTISSA_BITS + 1;
    elsif OPERATION = "to_fixed" then
      return WIDTH + 2;
    elsif OPERATION = "compare" then
      return 4;
    elsif OPERATION = "sincos" then
      return 2*NUMBER;
    end if;
    return NUMBER;
  end function out_width;

  constant IN_BITS  : positive := in_width;
  constant OUT_BITS : positive := out_width;

  signal clk       : std_logic := '0';
  signal rst_n     : std_logic := '0';
  signal is_done   : boolean   := false;

  signal in_valid  : std_logic;
  signal in_ready  : std_logic;
  signal operands  : std_logic_vector(IN_BITS-1 downto 0);
  signal out_valid : std_logic;
  signal out_ready : std_logic;
  signal result    : std_logic_vector(OUT_BITS-1 downto 0);

begin

  adds : if OPERATION = "add" or OPERATION = "subtract" generate
    signal subtracts : std_logic;
  begin

    subtracts <= '1' when OPERATION = "subtract" else '0';

    u_dut : entity firm.firm_float_add
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS,
        IS_SHORT      => IS_SHORT
      )
      port map (
        clk         => clk,
        rst_n       => rst_n,
        in_valid    => in_valid,
        in_ready    => in_ready,
        in_a        => operands(2*NUMBER-1 downto NUMBER),
        in_b        => operands(NUMBER-1 downto 0),
        in_subtract => subtracts,
        out_valid   => out_valid,
        out_ready   => out_ready,
        out_number  => result
      );

  end generate adds;

  multiplies : if OPERATION = "multiply" generate

    u_dut : entity firm.firm_float_multiply
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS,
        IS_SHORT      => IS_SHORT
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_a       => operands(2*NUMBER-1 downto NUMBER),
        in_b       => operands(NUMBER-1 downto 0),
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate multiplies;

  multiplies_and_adds : if OPERATION = "multiply_add" generate

    u_dut : entity firm.firm_float_multiply_add
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_a       => operands(3*NUMBER-1 downto 2*NUMBER),
        in_b       => operands(2*NUMBER-1 downto NUMBER),
        in_c       => operands(NUMBER-1 downto 0),
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate multiplies_and_adds;

  divides : if OPERATION = "divide" generate

    u_dut : entity firm.firm_float_divide
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_a       => operands(2*NUMBER-1 downto NUMBER),
        in_b       => operands(NUMBER-1 downto 0),
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate divides;

  extracts : if OPERATION = "square_root" generate

    u_dut : entity firm.firm_float_square_root
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_number  => operands,
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate extracts;

  compares : if OPERATION = "compare" generate

    u_dut : entity firm.firm_float_compare
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        in_valid      => in_valid,
        in_ready      => in_ready,
        in_a          => operands(2*NUMBER-1 downto NUMBER),
        in_b          => operands(NUMBER-1 downto 0),
        out_valid     => out_valid,
        out_ready     => out_ready,
        out_less      => result(3),
        out_equal     => result(2),
        out_greater   => result(1),
        out_unordered => result(0)
      );

  end generate compares;

  clamps : if OPERATION = "clamp" generate

    u_dut : entity firm.firm_float_clamp
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_number  => operands(3*NUMBER-1 downto 2*NUMBER),
        in_low     => operands(2*NUMBER-1 downto NUMBER),
        in_high    => operands(NUMBER-1 downto 0),
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate clamps;

  resizes : if OPERATION = "resize" generate

    u_dut : entity firm.firm_float_resize
      generic map (
        IN_EXPONENT_BITS  => EXPONENT_BITS,
        IN_MANTISSA_BITS  => MANTISSA_BITS,
        OUT_EXPONENT_BITS => OUT_EXPONENT_BITS,
        OUT_MANTISSA_BITS => OUT_MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_number  => operands,
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate resizes;

  converts_to_fixed : if OPERATION = "to_fixed" generate

    u_dut : entity firm.firm_float_to_fixed
      generic map (
        WIDTH         => WIDTH,
        FRACTION      => FRACTION,
        IS_SIGNED     => IS_SIGNED,
        TRUNCATES     => TRUNCATES,
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        in_valid      => in_valid,
        in_ready      => in_ready,
        in_number     => operands,
        out_valid     => out_valid,
        out_ready     => out_ready,
        out_number    => result(OUT_BITS-1 downto 2),
        out_overflow  => result(1),
        out_undefined => result(0)
      );

  end generate converts_to_fixed;

  converts_from_fixed : if OPERATION = "from_fixed" generate

    u_dut : entity firm.firm_fixed_to_float
      generic map (
        WIDTH         => WIDTH,
        FRACTION      => FRACTION,
        IS_SIGNED     => IS_SIGNED,
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_number  => operands,
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate converts_from_fixed;

  turns : if OPERATION = "sincos" generate

    u_dut : entity firm.firm_float_sincos
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_angle   => operands,
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_sine   => result(2*NUMBER-1 downto NUMBER),
        out_cosine => result(NUMBER-1 downto 0)
      );

  end generate turns;

  measures_angles : if OPERATION = "atan2" generate

    u_dut : entity firm.firm_float_atan2
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_y       => operands(2*NUMBER-1 downto NUMBER),
        in_x       => operands(NUMBER-1 downto 0),
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate measures_angles;

  raises : if OPERATION = "exp" generate

    u_dut : entity firm.firm_float_exp
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_number  => operands,
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate raises;

  takes_logarithms : if OPERATION = "log" generate

    u_dut : entity firm.firm_float_log
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_number  => operands,
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate takes_logarithms;

  filters : if OPERATION = "low_pass" generate

    u_dut : entity firm.firm_float_low_pass
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk        => clk,
        rst_n      => rst_n,
        in_valid   => in_valid,
        in_ready   => in_ready,
        in_number  => operands(3*NUMBER-1 downto 2*NUMBER),
        in_weight  => operands(2*NUMBER-1 downto NUMBER),
        in_restart => operands(0),
        out_valid  => out_valid,
        out_ready  => out_ready,
        out_number => result
      );

  end generate filters;

  controls : if OPERATION = "pid" generate

    u_dut : entity firm.firm_float_pid
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk         => clk,
        rst_n       => rst_n,
        in_valid    => in_valid,
        in_ready    => in_ready,
        in_setpoint => operands(8*NUMBER-1 downto 7*NUMBER),
        in_measured => operands(7*NUMBER-1 downto 6*NUMBER),
        in_kp       => operands(6*NUMBER-1 downto 5*NUMBER),
        in_ki       => operands(5*NUMBER-1 downto 4*NUMBER),
        in_kd       => operands(4*NUMBER-1 downto 3*NUMBER),
        in_low      => operands(3*NUMBER-1 downto 2*NUMBER),
        in_high     => operands(2*NUMBER-1 downto NUMBER),
        in_restart  => operands(0),
        out_valid   => out_valid,
        out_ready   => out_ready,
        out_number  => result
      );

  end generate controls;

  clk   <= not clk after PERIOD / 2 when not is_done else '0';
  rst_n <= '1' after 4 * PERIOD;

  u_operation : entity firm.firm_sim_operation
    generic map (
      VECTORS  => VECTORS,
      RESULTS  => RESULTS,
      EXPECTED => EXPECTED,
      IN_BITS  => IN_BITS,
      OUT_BITS => OUT_BITS,
      SEED     => SEED,
      STALLS   => STALLS
    )
    port map (
      clk       => clk,
      rst_n     => rst_n,
      is_done   => is_done,
      in_valid  => in_valid,
      in_ready  => in_ready,
      operands  => operands,
      out_valid => out_valid,
      out_ready => out_ready,
      result    => result
    );

end architecture test;
