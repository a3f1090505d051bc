-- SPDX-License-Identifier: Apache-2.0
-- The clock, the reset and the SPI slave (mode 0) of a simulated board, whose bytes another program exchanges. It
-- reports at file descriptor 4:
--
--     r          the chip's reset begins
--     s CYCLES   the chip select becomes active, after a number of cycles (4 bytes, the lowest first)
--     a          the next byte of the slave is needed
--     t BYTE     a byte of the master
--     d          the chip select becomes inactive
--
-- and reads a byte at file descriptor 3 after each 's', whose value is ignored, and after each 'a'. The simulation ends
-- with the file. `firm live` starts it (docs/reference/network.md).
library ieee;
use ieee.std_logic_1164.all;

entity firm_sim_chip is
  port (
    clk   : out std_logic;
    rst_n : out std_logic;

    spi_sck   : in  std_logic;
    spi_cs_n  : in  std_logic;
    spi_mosi  : in  std_logic;
    spi_miso  : out std_logic;
    spi_rst_n : in  std_logic
  );
end entity firm_sim_chip;

architecture simulation of firm_sim_chip is

  constant HALF_PERIOD  : time     := 5 ns;
  constant RESET_CYCLES : positive := 8;
  constant MOST_CYCLES  : natural  := integer'high;

  type pipe_t is file of character;

  -- VHDL-93 cannot flush a file, so the C library does: `fflush(NULL)`.
  procedure flush_all_files(zero : in integer) is
  begin
    assert false
      report "firm_sim_chip: this simulator does not support VHPIDIRECT, so it cannot flush files" severity failure;
  end procedure flush_all_files;

  attribute foreign : string;
  attribute foreign of flush_all_files : procedure is "VHPIDIRECT libc.so.6 fflush";

begin

  chip : process

    file answers : pipe_t;
    file reports : pipe_t;

    variable answer  : character;
    variable is_over : boolean := false;
    variable bits    : natural := 0;                                  -- of the present byte
    variable cycles  : natural := 0;                                  -- since the last frame of SPI
    variable taken   : std_logic_vector(7 downto 0);
    variable shown   : std_logic_vector(7 downto 0) := (others => '0');
    variable sck     : std_logic := '0';                              -- of the cycle before
    variable cs_n    : std_logic := '1';
    variable reset_n : std_logic := '0';

    procedure open_pipes is
      variable status_3 : file_open_status;
      variable status_4 : file_open_status;
    begin
      file_open(status_3, answers, "/dev/fd/3", read_mode);
      file_open(status_4, reports, "/dev/fd/4", write_mode);
      assert status_3 = open_ok and status_4 = open_ok
        report "firm_sim_chip: file descriptors 3 and 4 are not open; firm live starts this simulator"
        severity failure;
    end procedure open_pipes;

    procedure next_byte is
    begin
      flush_all_files(0);
      is_over := endfile(answers);
      if not is_over then
        read(answers, answer);
      end if;
    end procedure next_byte;

    procedure load is
      variable number : natural;
    begin
      write(reports, 'a');
      next_byte;
      number := character'pos(answer);
      for place in shown'reverse_range loop
        shown(place) := '0';
        if number mod 2 = 1 then
          shown(place) := '1';
        end if;
        number := number / 2;
      end loop;
    end procedure load;

    procedure change_select is
      variable rest : natural;
    begin
      assert bits = 0
        report "firm_sim_chip: a frame of the SPI ends within a byte" severity failure;
      if spi_cs_n = '0' then
        write(reports, 's');
        rest := cycles;
        for place in 0 to 3 loop
          write(reports, character'val(rest mod 256));
          rest := rest / 256;
        end loop;
        cycles := 0;
        next_byte;
        load;
      else
        write(reports, 'd');
        flush_all_files(0);
      end if;
    end procedure change_select;

    procedure change_clock is
      variable number : natural := 0;
    begin
      if spi_sck = '1' then
        taken := taken(6 downto 0) & spi_mosi;
        bits  := bits + 1;
        if bits = 8 then
          for place in taken'range loop
            number := 2*number;
            if taken(place) = '1' then
              number := number + 1;
            end if;
          end loop;
          write(reports, 't');
          write(reports, character'val(number));
          bits := 0;
        end if;
      elsif bits /= 0 then
        shown := shown(6 downto 0) & '0';
      else
        load;
      end if;
    end procedure change_clock;

  begin
    open_pipes;
    clk      <= '0';
    rst_n    <= '0';
    spi_miso <= '0';
    for cycle in 1 to RESET_CYCLES loop
      wait for HALF_PERIOD;
      clk <= '1';
      wait for HALF_PERIOD;
      clk <= '0';
    end loop;
    rst_n <= '1';
    while not is_over loop
      wait for HALF_PERIOD;
      clk <= '1';
      wait for HALF_PERIOD;
      clk <= '0';
      if cycles < MOST_CYCLES then
        cycles := cycles + 1;
      end if;
      -- The slave sees what the system sees at the next rising edge.
      if spi_rst_n = '0' and reset_n /= '0' then
        write(reports, 'r');
      end if;
      if spi_cs_n /= cs_n then
        change_select;
      end if;
      if spi_cs_n = '0' and spi_sck /= sck then
        change_clock;
      end if;
      cs_n     := spi_cs_n;
      sck      := spi_sck;
      reset_n  := spi_rst_n;
      spi_miso <= '0';
      if spi_cs_n = '0' then
        spi_miso <= shown(7);
      end if;
    end loop;
    wait;
  end process chip;

end architecture simulation;
