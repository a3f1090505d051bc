-- SPDX-License-Identifier: Apache-2.0
-- Sends frames to the receiver of the host 192.0.2.2, 02:00:00:00:00:02, in the group 239.255.0.1, with the ports 7400,
-- 7410 and 7411. A row of the file is a frame: the cycles before it, whether it is aborted (0 or 1), the number of
-- bytes, and the bytes. Results go to a file, a row each: `datagram` or `aborted`, the port's number, the sender's MAC
-- address, address and port in bytes, and the payload's size and bytes; `fragment`; or `broken`.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

entity firm_udp_receiver_tb is
  generic (
    FRAME_FILE    : string  := "frames.txt";
    RESULT_FILE   : string  := "datagrams.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    SLOW_PERCENT  : integer := 0  -- the chance per cycle of no byte
  );
end entity firm_udp_receiver_tb;

architecture simulation of firm_udp_receiver_tb is

  constant PORTS : positive := 3;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic;
  signal over  : boolean;

  signal s_tdata  : std_logic_vector(7 downto 0);
  signal s_tuser  : std_logic_vector(0 downto 0);
  signal s_tvalid : std_logic;
  signal s_tlast  : std_logic;

  signal m_tdata        : std_logic_vector(7 downto 0);
  signal m_tuser        : std_logic_vector(0 downto 0);
  signal m_tvalid       : std_logic;
  signal m_tlast        : std_logic;
  signal source_mac     : std_logic_vector(47 downto 0);
  signal source_address : std_logic_vector(31 downto 0);
  signal source_port    : std_logic_vector(15 downto 0);
  signal port_match     : std_logic_vector(PORTS-1 downto 0);
  signal is_fragment    : std_logic;
  signal is_broken      : std_logic;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_receiver : entity firm.firm_udp_receiver
    generic map (
      PORTS => PORTS
    )
    port map (
      clk            => clk,
      rst_n          => rst_n,
      mac            => x"020000000002",
      address        => x"c0000202",
      group_ip       => x"efff0001",
      udp_ports      => x"1cf31cf21ce8",
      s_axis_tdata   => s_tdata,
      s_axis_tuser   => s_tuser,
      s_axis_tvalid  => s_tvalid,
      s_axis_tlast   => s_tlast,
      m_axis_tdata   => m_tdata,
      m_axis_tuser   => m_tuser,
      m_axis_tvalid  => m_tvalid,
      m_axis_tlast   => m_tlast,
      source_mac     => source_mac,
      source_address => source_address,
      source_port    => source_port,
      port_match     => port_match,
      is_fragment    => is_fragment,
      is_broken      => is_broken
    );

  u_rows : entity firm.firm_sim_rows
    generic map (
      FRAME_FILE   => FRAME_FILE,
      SEED         => SEED,
      SLOW_PERCENT => SLOW_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => s_tdata,
      m_axis_tuser  => s_tuser,
      m_axis_tvalid => s_tvalid,
      m_axis_tlast  => s_tlast,
      over          => over
    );

  record_results : process
    file results     : text open write_mode is RESULT_FILE;
    file expected    : text open read_mode is existing(EXPECTED_FILE);
    variable row     : line;
    variable content : line;
    variable size    : natural := 0;

    procedure write_bytes(word : in std_logic_vector) is
      constant BITS : std_logic_vector(0 to word'length-1) := word;
    begin
      for index in natural range 0 to word'length/8-1 loop
        write(row, ' ' & integer'image(to_integer(unsigned(BITS(8*index to 8*index+7)))));
      end loop;
    end procedure write_bytes;

  begin
    while not over loop
      wait until rising_edge(clk) or over;
      next when over or rst_n = '0';
      if m_tvalid = '1' then
        size := size + 1;
        write(content, ' ' & integer'image(to_integer(unsigned(m_tdata))));
      end if;
      if m_tvalid = '1' and m_tlast = '1' then
        if m_tuser(0) = '1' then
          write(row, string'("aborted"));
        else
          write(row, string'("datagram"));
        end if;
        for index in port_match'range loop
          if port_match(index) = '1' then
            write(row, ' ' & integer'image(index));
          end if;
        end loop;
        write_bytes(source_mac & source_address & source_port);
        write(row, ' ' & integer'image(size) & content.all);
        write_result(results, expected, EXPECTED_FILE, row);
        deallocate(content);
        size := 0;
      end if;
      if is_fragment = '1' then
        write(row, string'("fragment"));
        write_result(results, expected, EXPECTED_FILE, row);
      end if;
      if is_broken = '1' then
        write(row, string'("broken"));
        write_result(results, expected, EXPECTED_FILE, row);
      end if;
    end loop;
    assert size = 0
      report "a datagram without an end" severity failure;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are results" severity failure;
    print("PASS");
    wait;
  end process record_results;

end architecture simulation;
