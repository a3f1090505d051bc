-- SPDX-License-Identifier: Apache-2.0
-- The publisher of awkward_msgs/Large (ROS 1): all messages have different values. Every second one is withdrawn, in
-- turns after a random time, unless its frame ends before, and when only the last beat is left. Each beat is compared,
-- and only the end of a whole frame takes the message.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;

entity withdrawn_publisher_tb is
  generic (
    WIDTH    : integer := 64;
    SEED     : integer := 1;
    MESSAGES : integer := 60
  );
end entity withdrawn_publisher_tb;

architecture sim of withdrawn_publisher_tb is

  constant PAYLOAD : positive := 1123;
  constant BITS    : positive := 8 * (5 + PAYLOAD);
  constant BEATS   : positive := (BITS + WIDTH - 1) / WIDTH;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal done  : boolean   := false;

  signal data  : std_logic_vector(8959 downto 0) := (others => '0');
  signal flag  : std_logic                       := '0';
  signal tail  : std_logic_vector(15 downto 0)   := (others => '0');
  signal valid : std_logic_vector(0 downto 0)    := "0";
  signal taken : std_logic;

  signal tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal tuser  : std_logic_vector(0 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;
  signal tready : std_logic := '0';

  signal frame : std_logic_vector(BEATS*WIDTH-1 downto 0);

begin

  clk   <= not clk after 5 ns when not done else '0';
  rst_n <= '1' after 42 ns;

  u_publisher : entity work.awkward_msgs_large_to_axis
    generic map (
      ID => 7
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      data          => data,
      flag          => flag,
      tail          => tail,
      segment_valid => valid,
      msg_ready     => taken,
      m_axis_tdata  => tdata,
      m_axis_tkeep  => tkeep,
      m_axis_tuser  => tuser,
      m_axis_tvalid => tvalid,
      m_axis_tlast  => tlast,
      m_axis_tready => tready
    );

  assemble : process (data, flag, tail)
  begin
    frame                   <= (others => '0');
    frame(39 downto 0)      <= std_logic_vector(to_unsigned(PAYLOAD, 32)) & x"07";
    frame(8999 downto 40)   <= data;
    frame(9000)             <= flag;
    frame(9023 downto 9008) <= tail;
  end process assemble;

  -- Inputs change after an edge, and are sampled with the outputs before the next one.
  play : process
    variable seed_1   : positive := SEED;
    variable seed_2   : positive := 1;
    variable number   : real;
    variable lifetime : integer;
    variable position : natural;
    variable ended    : boolean;
    variable frames   : natural  := 0;
    variable aborted  : natural  := 0;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    for message in 1 to MESSAGES loop
      for word in 0 to 559 loop
        uniform(seed_1, seed_2, number);
        data(16*word+15 downto 16*word) <= std_logic_vector(to_unsigned(integer(floor(number * 65536.0)), 16));
      end loop;
      flag     <= data(0);
      tail     <= data(31 downto 16);
      valid    <= "1";
      position := 0;
      ended    := false;
      lifetime := -1;
      if message mod 4 = 2 then
        uniform(seed_1, seed_2, number);
        lifetime := 1 + integer(floor(number * 2.0 * real(BEATS)));
      end if;
      loop
        uniform(seed_1, seed_2, number);
        tready <= '0';
        if number < 0.6 then
          tready <= '1';
        end if;
        wait until falling_edge(clk);
        assert (taken = '1') = (tvalid = '1' and tready = '1' and tlast = '1' and tuser = "0")
          report "a message is taken without the end of its whole frame, or not at it" severity failure;
        if tvalid = '1' and tready = '1' then
          if tuser = "1" then
            assert valid = "0" and position > 0 and tlast = '1'
              report "an abort that nobody asked for" severity failure;
            aborted := aborted + 1;
          else
            assert tdata = frame((position+1)*WIDTH-1 downto position*WIDTH)
              report "wrong beat " & integer'image(position) & " of message " & integer'image(message)
              severity failure;
            assert (tlast = '1') = (position = BEATS-1)
              report "wrong end" severity failure;
            if tlast = '1' then
              frames := frames + 1;
            end if;
          end if;
          position := position + 1;
          ended    := tlast = '1';
        end if;
        wait until rising_edge(clk);
        exit when ended or (valid = "0" and position = 0);
        lifetime := lifetime - 1;
        if lifetime = 0 or (message mod 4 = 0 and position = BEATS-1) then
          valid <= "0";
        end if;
      end loop;
      valid <= "0";
    end loop;
    report "frames " & integer'image(frames) & ", aborted " & integer'image(aborted);
    done <= true;
    wait;
  end process play;

end architecture sim;
