-- SPDX-License-Identifier: Apache-2.0
-- Sends frames to the status of the host 192.0.2.2, 02:00:00:00:00:02. A row of the file is a frame: the cycles before
-- it, whether it is aborted (0 or 1), the number of bytes, and the bytes. The system answers a frame with each byte of
-- its payload's word inverted. The replies go to a file, a row each: the number of bytes, and the bytes.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sim_pkg.bytes_t;
use firm.firm_sim_random_pkg.stall;

entity firm_net_status_tb is
  generic (
    FRAME_FILE    : string  := "frames.txt";
    RESULT_FILE   : string  := "replies.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- The chances per cycle of no byte, and that the reader or the system takes nothing.
    SLOW_PERCENT  : integer := 0;
    STALL_PERCENT : integer := 0
  );
end entity firm_net_status_tb;

architecture simulation of firm_net_status_tb is

  -- Cycles for the reader after the last frame.
  constant LAST_CYCLES : positive := 1000;

  -- A frame of the status id: the id, the length, an address and a word.
  constant WORD_PLACE  : positive := 9;
  constant FRAME_BYTES : positive := 13;
  type frame_t is array (natural range 0 to FRAME_BYTES-1) of std_logic_vector(7 downto 0);

  signal clk   : std_logic := '0';
  signal rst_n : std_logic;
  signal over  : boolean;

  signal sent     : bytes_t;
  signal received : bytes_t;
  signal ready    : std_logic;

  signal request_tdata  : std_logic_vector(7 downto 0);
  signal request_tvalid : std_logic;
  signal request_tlast  : std_logic;
  signal request_tready : std_logic := '0';
  signal answer_tdata   : std_logic_vector(7 downto 0) := x"00";
  signal answer_tvalid  : std_logic := '0';
  signal answer_tlast   : std_logic := '0';

begin

  clk <= not clk after 4 ns when not over else '0';

  u_status : entity firm.firm_net_status
    port map (
      clk            => clk,
      rst_n          => rst_n,
      mac            => x"020000000002",
      address        => x"c0000202",
      s_axis_tdata   => sent.tdata,
      s_axis_tuser   => sent.tuser,
      s_axis_tvalid  => sent.tvalid,
      s_axis_tlast   => sent.tlast,
      request_tdata  => request_tdata,
      request_tvalid => request_tvalid,
      request_tlast  => request_tlast,
      request_tready => request_tready,
      answer_tdata   => answer_tdata,
      answer_tvalid  => answer_tvalid,
      answer_tlast   => answer_tlast,
      m_axis_tdata   => received.tdata,
      m_axis_tvalid  => received.tvalid,
      m_axis_tlast   => received.tlast,
      m_axis_tready  => ready
    );

  stall(clk, SEED, 7, STALL_PERCENT, request_tready);

  answer : process
    variable frame : frame_t;
    variable size  : natural;
  begin
    size := 0;
    loop
      wait until rising_edge(clk);
      next when rst_n = '0' or request_tvalid = '0' or request_tready = '0';
      assert size < FRAME_BYTES
        report "a request is too long" severity failure;
      frame(size) := request_tdata;
      size        := size + 1;
      exit when request_tlast = '1';
    end loop;
    assert size = FRAME_BYTES
      report "a request is too short" severity failure;
    for place in frame'range loop
      answer_tdata <= frame(place);
      if place >= WORD_PLACE then
        answer_tdata <= not frame(place);
      end if;
      answer_tvalid <= '1';
      answer_tlast  <= '0';
      if place = FRAME_BYTES-1 then
        answer_tlast <= '1';
      end if;
      wait until rising_edge(clk);
      answer_tvalid <= '0';
      if place mod 3 = SEED mod 3 then
        wait until rising_edge(clk);
      end if;
    end loop;
  end process answer;

  u_exchange : entity firm.firm_sim_exchange
    generic map (
      FRAME_FILE    => FRAME_FILE,
      RESULT_FILE   => RESULT_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      SLOW_PERCENT  => SLOW_PERCENT,
      STALL_PERCENT => STALL_PERCENT,
      LAST_CYCLES   => LAST_CYCLES
    )
    port map (
      clk      => clk,
      rst_n    => rst_n,
      over     => over,
      sent     => sent,
      received => received,
      ready    => ready
    );

end architecture simulation;
