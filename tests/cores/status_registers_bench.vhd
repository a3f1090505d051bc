-- Reads the registers of a status beside a Manager of Managers, whose channels have ones in all other words. A line of
-- the script is an address of five hexadecimal digits and the word of eight that is expected there.
library ieee;
use ieee.std_logic_1164.all;
use std.textio.all;
library firm;

entity status_registers_bench is
  generic (
    SCRIPT : string := "script.txt"
  );
end entity status_registers_bench;

architecture simulation of status_registers_bench is

  signal clk           : std_logic := '0';
  signal rst_n         : std_logic := '0';
  signal is_over       : boolean := false;
  signal bus_valid     : std_logic := '0';
  signal bus_address   : std_logic_vector(19 downto 0) := (others => '0');
  signal bus_read_data : std_logic_vector(31 downto 0);
  signal bus_done      : std_logic;
  signal zeros         : std_logic_vector(31 downto 0) := (others => '0');
  signal ones          : std_logic_vector(31 downto 0) := (others => '1');

begin

  clk <= not clk after 5 ns when not is_over else '0';

  u_registers : entity firm.wide_status
    port map (
      clk                          => clk,
      rst_n                        => rst_n,
      bus_valid                    => bus_valid,
      bus_write                    => '0',
      bus_address                  => bus_address,
      bus_write_data               => zeros,
      bus_read_data                => bus_read_data,
      bus_done                     => bus_done,
      channel_address              => open,
      channel_word                 => ones,
      control_count                => open,
      interrupt_enable_frame_error => open,
      interrupt_enable_id_error    => open,
      interrupt_enable_link_error  => open,
      interrupt_enable_lost        => open,
      last_fault_code              => zeros(3 downto 0),
      last_fault_channel           => zeros(11 downto 0),
      id_errors_count              => '0',
      link_errors_count            => '0',
      lost_count                   => '0',
      interrupt_frame_error_set    => '0',
      interrupt_id_error_set       => '0',
      interrupt_link_error_set     => '0',
      interrupt_lost_set           => '0',
      interrupt                    => open
    );

  read_all : process

    file lines        : text open read_mode is SCRIPT;
    variable row      : line;
    variable char     : character;
    variable address  : std_logic_vector(19 downto 0);
    variable expected : std_logic_vector(31 downto 0);
    variable count    : natural := 0;

    procedure read_digits(word : out std_logic_vector) is
      constant DIGITS      : string := "0123456789abcdef";
      constant DIGIT_COUNT : natural := word'length/4;
      variable found       : std_logic_vector(word'length-1 downto 0);
      variable number      : natural;
    begin
      for digit in 1 to DIGIT_COUNT loop
        read(row, char);
        for index in DIGITS'range loop
          if DIGITS(index) = char then
            number := index - 1;
          end if;
        end loop;
        found := found(found'high-4 downto 0) & "0000";
        for place in 0 to 3 loop
          if (number / 2**place) mod 2 = 1 then
            found(place) := '1';
          end if;
        end loop;
      end loop;
      word := found;
    end procedure read_digits;

  begin
    for cycle in 1 to 3 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    while not endfile(lines) loop
      readline(lines, row);
      read_digits(address);
      read(row, char);
      read_digits(expected);
      bus_address <= address;
      bus_valid   <= '1';
      wait until rising_edge(clk);
      bus_valid <= '0';
      wait until rising_edge(clk) and bus_done = '1';
      assert bus_read_data = expected
        report "line " & integer'image(count+1) & " reads another word" severity error;
      count := count + 1;
    end loop;
    write(output, "PASS " & integer'image(count) & LF);
    is_over <= true;
    wait;
  end process read_all;

end architecture simulation;
