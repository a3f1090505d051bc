-- SPDX-License-Identifier: Apache-2.0
-- Tests a CORDIC, fed by firm_sim_operation. A line of VECTORS is an angle, or x and y; a line of RESULTS is cosine and
-- sine, or magnitude and angle.

library ieee;
use ieee.std_logic_1164.all;

library firm;

entity firm_cordic_tb is
  generic (
    VECTORS    : string   := "vectors.txt";
    RESULTS    : string   := "results.txt";
    EXPECTED   : string   := "";
    -- sincos or vectoring.
    OPERATION  : string   := "vectoring";
    WIDTH      : positive := 64;  -- of vectoring
    FRACTION   : positive := 60;
    ITERATIONS : positive := 35;
    SEED       : positive := 1;
    -- Cycles of 100 in which one side of the handshake stalls. An operation takes about as long as a stall.
    STALLS     : natural  := 97
  );
end entity firm_cordic_tb;

architecture test of firm_cordic_tb is

  constant PERIOD : time := 10 ns;

  function bits_of(of_sincos, of_vectoring : positive) return positive is
  begin
    if OPERATION = "sincos" then
      return of_sincos;
    end if;
    return of_vectoring;
  end function bits_of;

  constant IN_BITS   : positive := bits_of(FRACTION + 3, 2*WIDTH);
  -- The second number of a result.
  constant LAST_BITS : positive := bits_of(FRACTION + 2, FRACTION + 3);
  constant OUT_BITS  : positive := bits_of(FRACTION + 2, WIDTH) + LAST_BITS;

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

  assert OPERATION = "sincos" or OPERATION = "vectoring"
    report "firm_cordic_tb: OPERATION is " & OPERATION & "; legal: sincos, vectoring"
    severity failure;

  sincos : if OPERATION = "sincos" generate
    u_dut : entity firm.firm_cordic_sincos
      generic map (
        FRACTION   => FRACTION,
        ITERATIONS => ITERATIONS
      )
      port map (
        clk       => clk,
        rst_n     => rst_n,
        in_valid  => in_valid,
        in_ready  => in_ready,
        in_angle  => operands,
        out_valid => out_valid,
        out_ready => out_ready,
        out_cos   => result(OUT_BITS-1 downto LAST_BITS),
        out_sin   => result(LAST_BITS-1 downto 0)
      );
  end generate sincos;

  vectoring : if OPERATION = "vectoring" generate
    u_dut : entity firm.firm_cordic_vectoring
      generic map (
        WIDTH      => WIDTH,
        FRACTION   => FRACTION,
        ITERATIONS => ITERATIONS
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        in_valid      => in_valid,
        in_ready      => in_ready,
        in_x          => operands(2*WIDTH-1 downto WIDTH),
        in_y          => operands(WIDTH-1 downto 0),
        out_valid     => out_valid,
        out_ready     => out_ready,
        out_magnitude => result(OUT_BITS-1 downto LAST_BITS),
        out_angle     => result(LAST_BITS-1 downto 0)
      );
  end generate vectoring;

  clk   <= not clk after PERIOD / 2 when not is_done else '0';
  rst_n <= '1' after 4 * PERIOD;

  u_operation : entity firm.firm_sim_operation
    generic map (
      VECTORS   => VECTORS,
      RESULTS   => RESULTS,
      EXPECTED  => EXPECTED,
      IN_BITS   => IN_BITS,
      OUT_BITS  => OUT_BITS,
      LAST_BITS => LAST_BITS,
      SEED      => SEED,
      STALLS    => STALLS
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
