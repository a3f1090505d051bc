-- The streams of firm_wiznet_link, without a chip: its ROM is a program that only moves bytes. A row of the file of
-- beats has the bytes of a beat, the bits of tkeep, tuser and tlast; the first beat is on offer from the end of the
-- reset on, and each one follows the one before without a pause. What the program gives is written, a byte and whether
-- it is the last of its frame in each row. After FRAMES frames, the simulation ends.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;

entity link_bench is
  generic (
    WIDTH   : integer := 8;
    FRAMES  : integer := 1;
    LONGEST : integer := 1000000 -- cycles
  );
end entity link_bench;

architecture simulation of link_bench is

  constant LANES : positive := WIDTH/8;

  signal clk         : std_logic := '0';
  signal rst_n       : std_logic := '0';
  signal is_over     : boolean := false;
  signal rom_address : std_logic_vector(15 downto 0);
  signal rom_data    : std_logic_vector(7 downto 0);
  signal s_tdata     : std_logic_vector(WIDTH-1 downto 0) := (others => '0');
  signal s_tkeep     : std_logic_vector(LANES-1 downto 0) := (others => '0');
  signal s_tuser     : std_logic_vector(0 downto 0) := "0";
  signal s_tvalid    : std_logic := '0';
  signal s_tlast     : std_logic := '0';
  signal s_tready    : std_logic;
  signal m_tdata     : std_logic_vector(WIDTH-1 downto 0);
  signal m_tkeep     : std_logic_vector(LANES-1 downto 0);
  signal m_tvalid    : std_logic;
  signal m_tlast     : std_logic;

  function bit_of(number : integer) return std_logic is
  begin
    if number = 1 then
      return '1';
    end if;
    return '0';
  end function bit_of;

begin

  clk <= not clk after 5 ns when not is_over else '0';

  -- A millisecond is one cycle.
  u_link : entity firm.firm_wiznet_link
    generic map (
      WIDTH    => WIDTH,
      CLOCK_HZ => 1000
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rom_address   => rom_address,
      rom_data      => rom_data,
      spi_sck       => open,
      spi_cs_n      => open,
      spi_mosi      => open,
      spi_miso      => '0',
      spi_rst_n     => open,
      m_axis_tdata  => m_tdata,
      m_axis_tkeep  => m_tkeep,
      m_axis_tuser  => open,
      m_axis_tvalid => m_tvalid,
      m_axis_tlast  => m_tlast,
      m_axis_tready => '1',
      s_axis_tdata  => s_tdata,
      s_axis_tkeep  => s_tkeep,
      s_axis_tuser  => s_tuser,
      s_axis_tvalid => s_tvalid,
      s_axis_tlast  => s_tlast,
      s_axis_tready => s_tready
    );

  show_program : process
    type bytes_t is array (0 to 255) of std_logic_vector(7 downto 0);

    file rom        : text open read_mode is "rom.txt";
    variable row    : line;
    variable value  : integer;
    variable bytes  : bytes_t := (others => (others => '0'));
    variable count  : natural := 0;
  begin
    while not endfile(rom) loop
      readline(rom, row);
      read(row, value);
      bytes(count) := std_logic_vector(to_unsigned(value, 8));
      count        := count + 1;
    end loop;
    while not is_over loop
      wait until rising_edge(clk) or is_over;
      if not is_x(rom_address) then
        rom_data <= bytes(to_integer(unsigned(rom_address(7 downto 0))));
      end if;
    end loop;
    wait;
  end process show_program;

  offer : process
    file beats     : text open read_mode is "beats.txt";
    variable row   : line;
    variable value : integer;
  begin
    for cycle in 1 to 4 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    while not endfile(beats) loop
      readline(beats, row);
      for lane in 0 to LANES-1 loop
        read(row, value);
        s_tdata(8*lane+7 downto 8*lane) <= std_logic_vector(to_unsigned(value, 8));
      end loop;
      for lane in 0 to LANES-1 loop
        read(row, value);
        s_tkeep(lane) <= bit_of(value);
      end loop;
      read(row, value);
      s_tuser(0) <= bit_of(value);
      read(row, value);
      s_tlast  <= bit_of(value);
      s_tvalid <= '1';
      wait until rising_edge(clk) and s_tready = '1';
    end loop;
    s_tvalid <= '0';
    wait;
  end process offer;

  take : process
    file results    : text open write_mode is "results.txt";
    variable row    : line;
    variable ended  : natural := 0;
    variable cycles : natural := 0;
    variable last   : natural;
  begin
    while ended < FRAMES loop
      wait until rising_edge(clk);
      cycles := cycles + 1;
      assert cycles < LONGEST
        report "frames are missing" severity failure;
      if rst_n = '1' and m_tvalid = '1' then
        for lane in 0 to LANES-1 loop
          if m_tkeep(lane) = '1' then
            last := 0;
            if m_tlast = '1' and (lane = LANES-1 or m_tkeep((lane+1) mod LANES) = '0') then
              last  := 1;
              ended := ended + 1;
            end if;
            write(row, integer'image(to_integer(unsigned(m_tdata(8*lane+7 downto 8*lane)))));
            write(row, ' ' & integer'image(last));
            writeline(results, row);
          end if;
        end loop;
      end if;
    end loop;
    is_over <= true;
    wait;
  end process take;

end architecture simulation;
