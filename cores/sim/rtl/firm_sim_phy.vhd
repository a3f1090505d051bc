-- SPDX-License-Identifier: Apache-2.0
-- The clock, the reset and the PHY of a simulated board, whose frames another program exchanges. BITS of a byte cross
-- in each cycle, the lowest ones first: 8 for a GMII, 4 for an MII, 2 for an RMII. With IS_DDR, they cross at both
-- edges: 4 for an RGMII, whose control pins are rx_dv and tx_en. Frames have preamble and checksum.
-- It reports at file descriptor 4:
--
--     w CYCLES   a frame to the system may begin, after a number of cycles (4 bytes, the lowest first)
--     b BYTE     a byte of the system's frame
--     e          the end of this frame
--
-- After each 'w', it reads at file descriptor 3: the number of bytes of the frame (2 bytes, the lowest first; 0
-- without a frame), and these bytes. The simulation ends where the file ends, a frame that is not whole with it.
-- `firm live` starts it (docs/reference/ethernet.md).
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_sim_phy is
  generic (
    BITS   : integer := 8;    -- 2, 4 or 8
    IS_DDR : boolean := false -- with 4 bits
  );
  port (
    clk   : out std_logic;
    rst_n : out std_logic;

    rx_dv : out std_logic;
    rxd   : out std_logic_vector(BITS-1 downto 0);
    tx_en : in  std_logic;
    txd   : in  std_logic_vector(BITS-1 downto 0)
  );
end entity firm_sim_phy;

architecture simulation of firm_sim_phy is

  constant HALF_PERIOD  : time     := 5 ns;
  constant QUARTER      : time     := HALF_PERIOD / 2;
  constant RESET_CYCLES : positive := 8;
  constant QUIET_CYCLES : positive := 200;
  constant GAP_CYCLES   : positive := 12 * 8 / BITS;
  constant MOST_BYTES   : positive := 65536;

  type pipe_t is file of character;
  type bytes_t is array (natural range <>) of std_logic_vector(7 downto 0);

  -- VHDL-93 can neither flush a file nor end the simulation without an error, so the C library does: `fflush(NULL)` and
  -- `exit(0)`.
  procedure flush_all_files(zero : in integer) is
  begin
    assert false
      report "firm_sim_phy: this simulator does not support VHPIDIRECT, so it cannot flush files" severity failure;
  end procedure flush_all_files;

  procedure end_simulation(status : in integer) is
  begin
    assert false
      report "firm_sim_phy: this simulator does not support VHPIDIRECT, so it ends with an error" severity failure;
  end procedure end_simulation;

  attribute foreign : string;
  attribute foreign of flush_all_files : procedure is "VHPIDIRECT libc.so.6 fflush";
  attribute foreign of end_simulation  : procedure is "VHPIDIRECT libc.so.6 exit";

begin

  assert BITS = 2 or BITS = 4 or BITS = 8
    report "firm_sim_phy: BITS is " & integer'image(BITS) & "; legal: 2, 4, 8"
    severity failure;
  assert BITS = 4 or not IS_DDR
    report "firm_sim_phy: BITS is " & integer'image(BITS) & "; legal with IS_DDR: 4"
    severity failure;

  phy : process

    file answers : pipe_t;
    file reports : pipe_t;

    variable line       : bytes_t(0 to MOST_BYTES-1);
    variable size       : natural := 0;               -- of the frame to the system
    variable place      : natural := 0;
    variable bits_shown : natural := 0;               -- of its byte
    variable rest       : natural := QUIET_CYCLES;    -- remaining cycles without a frame
    variable cycles     : natural := 0;               -- since the last request
    variable shown      : std_logic_vector(7 downto 0);
    variable taken      : std_logic_vector(7 downto 0) := (others => '0');
    variable bits_taken : natural := 0;
    variable is_inside  : boolean := false;           -- a frame of the system is in progress

    procedure open_pipes is
      variable status_3 : file_open_status;
      variable status_4 : file_open_status;
    begin
      file_open(status_3, answers, "/dev/fd/3", read_mode);
      file_open(status_4, reports, "/dev/fd/4", write_mode);
      assert status_3 = open_ok and status_4 = open_ok
        report "firm_sim_phy: file descriptors 3 and 4 are not open; firm live starts this simulator"
        severity failure;
    end procedure open_pipes;

    procedure next_byte(number : out natural) is
      variable answer : character;
    begin
      if endfile(answers) then
        end_simulation(0);
      end if;
      read(answers, answer);
      number := character'pos(answer);
    end procedure next_byte;

    procedure ask is
      variable left : natural;
      variable low  : natural;
      variable high : natural;
    begin
      write(reports, 'w');
      left := cycles;
      for byte in 0 to 3 loop
        write(reports, character'val(left mod 256));
        left := left / 256;
      end loop;
      flush_all_files(0);
      cycles := 0;
      next_byte(low);
      next_byte(high);
      size := low + 256*high;
      for index in 0 to size-1 loop
        next_byte(low);
        line(index) := std_logic_vector(to_unsigned(low, 8));
      end loop;
      place      := 0;
      bits_shown := 0;
      rest       := GAP_CYCLES;
      if size = 0 then
        rest := QUIET_CYCLES;
      end if;
    end procedure ask;

    procedure take is
    begin
      if tx_en = '1' then
        is_inside  := true;
        taken      := txd & taken(7 downto BITS);
        bits_taken := bits_taken + BITS;
        if bits_taken = 8 then
          write(reports, 'b');
          write(reports, character'val(to_integer(unsigned(taken))));
          bits_taken := 0;
        end if;
      elsif is_inside then
        write(reports, 'e');
        flush_all_files(0);
        is_inside  := false;
        bits_taken := 0;
      end if;
    end procedure take;

    procedure show is
    begin
      if place = size and rest = 0 then
        ask;
      end if;
      rx_dv <= '0';
      rxd   <= (rxd'range => '0');
      if place /= size then
        shown := line(place);
        rx_dv <= '1';
        rxd   <= shown(bits_shown+BITS-1 downto bits_shown);
        bits_shown := bits_shown + BITS;
        if bits_shown = 8 then
          bits_shown := 0;
          place      := place + 1;
        end if;
      else
        rest := rest - 1;
      end if;
    end procedure show;

    procedure exchange is
    begin
      take;
      show;
    end procedure exchange;

    -- The first nibble of a byte is shown around the rising edge, and taken while the clock is high.
    procedure pass_cycle_of_both_edges is
    begin
      wait for QUARTER;
      exchange;
      wait for QUARTER;
      clk <= '1';
      wait for QUARTER;
      exchange;
      wait for QUARTER;
      clk <= '0';
    end procedure pass_cycle_of_both_edges;

    procedure pass_cycle is
    begin
      wait for HALF_PERIOD;
      clk <= '1';
      wait for HALF_PERIOD;
      clk <= '0';
      exchange;
    end procedure pass_cycle;

  begin
    open_pipes;
    clk   <= '0';
    rst_n <= '0';
    rx_dv <= '0';
    rxd   <= (rxd'range => '0');
    for cycle in 1 to RESET_CYCLES loop
      wait for HALF_PERIOD;
      clk <= '1';
      wait for HALF_PERIOD;
      clk <= '0';
    end loop;
    rst_n <= '1';
    loop
      cycles := cycles + 1;
      if IS_DDR then
        pass_cycle_of_both_edges;
      else
        pass_cycle;
      end if;
    end loop;
  end process phy;

end architecture simulation;
