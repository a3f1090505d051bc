-- SPDX-License-Identifier: Apache-2.0
-- Sends packets to the walker. A row of the file is a packet: the cycles before it, whether it is aborted (0 or 1), the
-- number of bytes, and the bytes. Results go to a file. A submessage is `submessage`, its kind and flags, whether it
-- has a key hash and a status, the number of fields' bytes, an address and a value for each, in the order of addresses,
-- the number of the payload's bytes, and these. The end of a packet is `whole`, `faulty`, `foreign` or `aborted`.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_rtps_pkg.all;
use firm.firm_sim_pkg.all;

entity firm_rtps_walker_tb is
  generic (
    FRAME_FILE    : string  := "packets.txt";
    RESULT_FILE   : string  := "submessages.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    SLOW_PERCENT  : integer := 0  -- the chance per cycle of no byte
  );
end entity firm_rtps_walker_tb;

architecture simulation of firm_rtps_walker_tb is

  signal clk   : std_logic := '0';
  signal rst_n : std_logic;
  signal over  : boolean;

  signal s_tdata  : std_logic_vector(7 downto 0);
  signal s_tuser  : std_logic_vector(0 downto 0);
  signal s_tvalid : std_logic;
  signal s_tlast  : std_logic;

  signal field_valid   : std_logic;
  signal field_address : std_logic_vector(RECORD_BITS-1 downto 0);
  signal field_data    : std_logic_vector(7 downto 0);
  signal payload_valid : std_logic;
  signal payload_data  : std_logic_vector(7 downto 0);
  signal kind          : std_logic_vector(7 downto 0);
  signal flags         : std_logic_vector(7 downto 0);
  signal has_key       : std_logic;
  signal has_status    : std_logic;
  signal is_submessage : std_logic;
  signal is_whole      : std_logic;
  signal is_faulty     : std_logic;
  signal is_foreign    : std_logic;
  signal is_aborted    : std_logic;

begin

  clk <= not clk after 4 ns when not over else '0';

  u_walker : entity firm.firm_rtps_walker
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_tdata,
      s_axis_tuser  => s_tuser,
      s_axis_tvalid => s_tvalid,
      s_axis_tlast  => s_tlast,
      source_mac    => x"020000000001",
      field_valid   => field_valid,
      field_address => field_address,
      field_data    => field_data,
      payload_valid => payload_valid,
      payload_data  => payload_data,
      kind          => kind,
      flags         => flags,
      has_key       => has_key,
      has_status    => has_status,
      is_submessage => is_submessage,
      is_whole      => is_whole,
      is_faulty     => is_faulty,
      is_foreign    => is_foreign,
      is_aborted    => is_aborted
    );

  u_rows : entity firm.firm_sim_rows
    generic map (
      FRAME_FILE   => FRAME_FILE,
      SEED         => SEED,
      SLOW_PERCENT => SLOW_PERCENT,
      GAP_CYCLES   => 0
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
    type fields_t is array (natural range 0 to 2**RECORD_BITS-1) of integer;

    file results     : text open write_mode is RESULT_FILE;
    file expected    : text open read_mode is existing(EXPECTED_FILE);
    variable row     : line;
    variable fields  : fields_t := (others => -1);
    variable content : line;
    variable listed  : line;
    variable bytes   : natural := 0;
    variable written : natural := 0;

    procedure write_flag(flag : in std_logic) is
    begin
      if flag = '1' then
        write(row, string'(" 1"));
      else
        write(row, string'(" 0"));
      end if;
    end procedure write_flag;

    procedure forget is
    begin
      fields  := (others => -1);
      bytes   := 0;
      written := 0;
      if content /= null then
        deallocate(content);
      end if;
    end procedure forget;

    procedure end_packet(verdict : in string) is
    begin
      write(row, verdict);
      write_result(results, expected, EXPECTED_FILE, row);
      forget;
    end procedure end_packet;

  begin
    while not over loop
      wait until rising_edge(clk) or over;
      next when over or rst_n = '0';
      if field_valid = '1' then
        fields(to_integer(unsigned(field_address))) := to_integer(unsigned(field_data));
      end if;
      if payload_valid = '1' then
        bytes := bytes + 1;
        write(content, ' ' & integer'image(to_integer(unsigned(payload_data))));
      end if;
      if is_submessage = '1' then
        write(row, "submessage " & integer'image(to_integer(unsigned(kind))));
        write(row, ' ' & integer'image(to_integer(unsigned(flags))));
        write_flag(has_key);
        write_flag(has_status);
        for address in fields'range loop
          if fields(address) /= -1 then
            written := written + 1;
            write(listed, ' ' & integer'image(address) & ' ' & integer'image(fields(address)));
          end if;
        end loop;
        write(row, ' ' & integer'image(written) & listed.all & ' ' & integer'image(bytes));
        if bytes /= 0 then
          write(row, content.all);
        end if;
        deallocate(listed);
        write_result(results, expected, EXPECTED_FILE, row);
        forget;
      end if;
      if is_whole = '1' then
        end_packet("whole");
      end if;
      if is_faulty = '1' then
        end_packet("faulty");
      end if;
      if is_foreign = '1' then
        end_packet("foreign");
      end if;
      if is_aborted = '1' then
        end_packet("aborted");
      end if;
    end loop;
    assert endfile(expected)
      report EXPECTED_FILE & " has more lines than there are results" severity failure;
    print("PASS");
    wait;
  end process record_results;

end architecture simulation;
