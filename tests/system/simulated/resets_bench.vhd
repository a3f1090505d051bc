-- Resets of any length and at any time, also while a clock stands, to a system of three unrelated clocks.
--
-- Each domain's reset begins with `rst_n`, without an edge, and ends at an edge of the domain's own clock, the third
-- after `rst_n` at the earliest.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;

entity resets_bench is
  generic (
    SEED      : integer := 1;
    RESETS    : integer := 100;
    OWN_PS    : integer := 10000;
    FAST_PS   : integer := 3331;
    SLOW_PS   : integer := 41700
  );
end entity resets_bench;

architecture simulation of resets_bench is

  subtype domains_t is std_logic_vector(2 downto 0);

  constant ALL_OF_THEM : domains_t := (others => '1');

  signal clocks     : domains_t := (others => '0');
  signal stands     : domains_t := (others => '0');
  signal rst_n      : std_logic := '0';
  signal alive      : domains_t;
  signal is_running : boolean   := true;

  function half_period(domain : natural) return time is
  begin
    case domain is
      when 0      => return OWN_PS * 500 fs;
      when 1      => return FAST_PS * 500 fs;
      when others => return SLOW_PS * 500 fs;
    end case;
  end function half_period;

begin

  domains : for domain in domains_t'range generate

    tick : process
    begin
      while is_running loop
        wait for half_period(domain);
        clocks(domain) <= not clocks(domain) and not stands(domain);
      end loop;
      wait;
    end process tick;

    watch : process (clocks(domain), rst_n, alive(domain))
      variable edge  : time    := 0 fs;
      variable edges : natural := 0;
    begin
      if rising_edge(clocks(domain)) then
        edge  := now;
        edges := edges + 1;
      end if;
      if rst_n = '0' then
        edges := 0;
      end if;
      if rising_edge(alive(domain)) then
        assert now = edge
          report "domain " & integer'image(domain) & " left its reset without an edge of its clock" severity failure;
        assert edges >= 3
          report "domain " & integer'image(domain) & " left its reset after " & integer'image(edges) & " edges"
          severity failure;
      end if;
    end process watch;

  end generate domains;

  u_system : entity work.resets_system
    port map (
      clk              => clocks(0),
      rst_n            => rst_n,
      clk_fast         => clocks(1),
      clk_slow         => clocks(2),
      s_axis_tdata     => (others => '0'),
      s_axis_tkeep     => (others => '1'),
      s_axis_tvalid    => '0',
      s_axis_tlast     => '0',
      s_axis_tready    => open,
      m_axis_tdata     => open,
      m_axis_tkeep     => open,
      m_axis_tid       => open,
      m_axis_tvalid    => open,
      m_axis_tlast     => open,
      m_axis_tready    => '1',
      own_alive        => alive(0),
      quick_alive      => alive(1),
      lazy_alive       => alive(2),
      id_error         => open,
      frame_error      => open,
      frame_error_code => open
    );

  main : process
    variable random_1 : positive := SEED;
    variable random_2 : positive := 7;
    variable draw     : real;

    impure function up_to(most : real) return time is
    begin
      uniform(random_1, random_2, draw);
      return (1.0 + most * draw) * 1 ps;
    end function up_to;

  begin
    for number in 1 to RESETS loop
      uniform(random_1, random_2, draw);
      if draw < 0.5 then
        stands(number mod 3) <= '1';
        wait for up_to(100000.0);
      end if;
      rst_n <= '0';
      wait for 1 ps;
      assert alive = "000"
        report "a reset waits for an edge" severity failure;
      wait for up_to(60000.0);
      rst_n  <= '1';
      wait for up_to(60000.0);
      stands <= (others => '0');
      wait until alive = ALL_OF_THEM for 2 us;
      assert alive = ALL_OF_THEM
        report "a reset does not end" severity failure;
      wait for up_to(20000.0);
    end loop;
    report "PASS " & integer'image(RESETS) severity note;
    is_running <= false;
    wait;
  end process main;

end architecture simulation;
