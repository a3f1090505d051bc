-- SPDX-License-Identifier: Apache-2.0
-- Sends frames from a file, cut into random pieces, through the packer to a sink with random stalls. The output goes to
-- a file, one line per frame in hex; the bench checks form and stability of the stream.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sim_check_pkg.all;
use firm.firm_sim_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_axis_pack_tb is
  generic (
    WIDTH         : integer := 8;
    STIMULUS_FILE : string  := "stimulus.txt";
    PACKED_FILE   : string  := "packed.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- The chances per cycle that nothing is offered, and that the sink takes nothing.
    SOURCE_STALL_PERCENT : integer := 0;
    SINK_STALL_PERCENT   : integer := 0;
    -- `random`: a piece has 0 bytes to all lanes, and the end may come without a byte. `full`: all pieces up to a
    -- frame's last one are full. `shifted`: they are full after a first one of a random number.
    PIECES : string := "random";
    -- An empty frame precedes each frame, and must have no effect.
    EMPTY_FRAMES : boolean := false;
    -- The sink is ready only after `tvalid`, which must not wait for it.
    LATE_READY : boolean := false;
    WATCHDOG   : integer := 1000
  );
end entity firm_axis_pack_tb;

architecture simulation of firm_axis_pack_tb is

  constant LANES      : positive := WIDTH/8;
  constant COUNT_BITS : positive := clog2(LANES+1);

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';

  signal data  : std_logic_vector(WIDTH-1 downto 0);
  signal count : std_logic_vector(COUNT_BITS-1 downto 0);
  signal last  : std_logic;
  signal valid : std_logic := '0';
  signal ready : std_logic;

  signal tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal tkeep  : std_logic_vector(LANES-1 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;
  signal tready : std_logic := '0';

  signal frames_sent : natural := 0;
  signal all_sent    : boolean := false;
  signal is_done     : boolean := false;

begin

  clk <= not clk after 5 ns when not is_done else '0';

  u_pack : entity firm.firm_axis_pack
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      data          => data,
      count         => count,
      last          => last,
      valid         => valid,
      ready         => ready,
      m_axis_tdata  => tdata,
      m_axis_tkeep  => tkeep,
      m_axis_tvalid => tvalid,
      m_axis_tlast  => tlast,
      m_axis_tready => tready
    );

  send : process
    variable content  : frame_file_t;
    variable frame    : frame_ptr_t;
    variable place    : natural;
    variable size     : natural;
    variable is_ended : boolean;
    variable offers   : natural := 0;
    variable waits    : natural := 0;
    variable ends_now : natural;
    variable random   : random_t := seeded(SEED, 3);

    -- The expected `data` and `count` until they are taken.
    procedure offer(is_end : in boolean) is
    begin
      valid <= '1';
      last  <= '0';
      if is_end then
        last <= '1';
      end if;
      loop
        wait until rising_edge(clk);
        exit when ready = '1';
        waits := waits + 1;
      end loop;
      offers := offers + 1;
      wait until falling_edge(clk);
      valid <= '0';
      data  <= (others => 'X');
      count <= (others => 'X');
      last  <= 'X';
    end procedure offer;

  begin
    read_stimulus_file(STIMULUS_FILE, content);
    end_reset(clk, '0', rst_n);
    wait until falling_edge(clk) and ready = '1';
    frame := content.first;
    while frame /= null loop
      place    := 0;
      is_ended := false;
      if EMPTY_FRAMES then
        count <= (others => '0');
        offer(true);
      end if;
      while not is_ended loop
        pause(clk, '0', random, SOURCE_STALL_PERCENT);
        size := LANES;
        if PIECES = "random" then
          draw(random, LANES, size);
        elsif PIECES = "shifted" and place = 0 then
          draw(random, LANES-1, size);
          size := size + 1;
        end if;
        if size > frame.size - place then
          size := frame.size - place;
        end if;
        data <= (others => 'X');
        for lane in 0 to size-1 loop
          data(8*lane+7 downto 8*lane) <= to_byte(frame.bytes(place+lane+1));
        end loop;
        place    := place + size;
        is_ended := place = frame.size;
        if is_ended and PIECES = "random" then
          draw(random, 2, ends_now);
          is_ended := ends_now > 0;
        end if;
        count    <= std_logic_vector(to_unsigned(size, COUNT_BITS));
        offer(is_ended);
      end loop;
      frames_sent <= frames_sent + 1;
      frame := frame.next_frame;
    end loop;
    all_sent <= true;
    print(integer'image(offers) & " pieces, " & integer'image(waits) & " waits");
    wait;
  end process send;

  receive : process
    file lines          : text open write_mode is PACKED_FILE;
    file wanted_file    : text open read_mode is existing(EXPECTED_FILE);
    variable bytes      : line;
    variable frames     : natural := 0;  -- finished
    variable beats      : natural := 0;
    variable gaps       : natural := 0;  -- cycles without a beat between the first and the last one
    variable new_gaps   : natural := 0;
    variable watch      : natural := 0;
    variable is_stalled : boolean := false;
    variable stalled    : std_logic_vector(WIDTH+LANES+1 downto 0);
    variable is_ending  : boolean;  -- lanes from here on are empty
    variable random     : random_t := seeded(SEED, 5);
  begin
    wait until rst_n = '1';
    while not (all_sent and frames = frames_sent) loop
      draw_ready(random, SINK_STALL_PERCENT, tready);
      if LATE_READY and tvalid = '0' then
        tready <= '0';
      end if;
      wait until rising_edge(clk);
      assert is_defined(tvalid & "") report "tvalid is undefined" severity failure;
      assert not is_stalled or stalled = tvalid & tlast & tkeep & tdata
        report "the stream changed during a stall" severity failure;
      is_stalled := tvalid = '1' and tready = '0';
      stalled    := tvalid & tlast & tkeep & tdata;
      watch      := watch + 1;
      assert watch < WATCHDOG report "nothing comes" severity failure;
      if tvalid = '0' and beats > 0 then
        new_gaps := new_gaps + 1;
      elsif tvalid = '1' and tready = '1' then
        watch    := 0;
        beats    := beats + 1;
        gaps     := gaps + new_gaps;
        new_gaps := 0;
        assert is_defined(tkeep) and is_defined(tlast & "") report "tkeep or tlast is undefined" severity failure;
        assert tkeep(0) = '1' report "an empty beat" severity failure;
        is_ending := false;
        for lane in 0 to LANES-1 loop
          if tkeep(lane) = '1' then
            assert not is_ending report "tkeep is not contiguous" severity failure;
            write(bytes, to_hex(tdata(8*lane+7 downto 8*lane)));
          else
            assert tlast = '1' report "a beat before the last is not full" severity failure;
            is_ending := true;
          end if;
        end loop;
        if tlast = '1' then
          write_result(lines, wanted_file, EXPECTED_FILE, bytes);
          frames := frames + 1;
        end if;
      end if;
      wait until falling_edge(clk);
    end loop;
    print(integer'image(beats) & " beats, " & integer'image(gaps) & " gaps");
    assert endfile(wanted_file) report "results are missing" severity failure;
    print("PASS");
    is_done <= true;
    wait;
  end process receive;

  check_stream(clk, rst_n, tdata, tkeep, tvalid, tlast, tready, "out");

end architecture simulation;
