-- SPDX-License-Identifier: Apache-2.0
-- Sends frames from a file, cut into random pieces after their header, through the trimmer to a sink that stalls. The
-- four bytes after a frame's first one are its announced length, which may differ from its real one. The output goes to
-- a file, one line per frame: the bytes in hex; of an aborted frame, those of the header, `aborted`, and `cut` or
-- `lacking` if the trimmer reported it.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sim_pkg.all;
use firm.firm_sim_random_pkg.all;

entity firm_axis_trim_tb is
  generic (
    WIDTH         : integer := 8;
    SLACK         : natural := 0;
    STIMULUS_FILE : string  := "stimulus.txt";
    TRIMMED_FILE  : string  := "trimmed.txt";
    EXPECTED_FILE : string  := "";
    SEED          : integer := 1;
    -- The chances per cycle that nothing is offered, and that nothing is taken.
    SOURCE_STALL_PERCENT : integer := 0;
    SINK_STALL_PERCENT   : integer := 0;
    -- All pieces up to a frame's last one are full; otherwise, they have 0 and more bytes.
    FULL_PIECES : boolean := false;
    WATCHDOG    : integer := 1000
  );
end entity firm_axis_trim_tb;

architecture simulation of firm_axis_trim_tb is

  constant LANES        : positive := WIDTH/8;
  constant COUNT_BITS   : positive := clog2(LANES+1);
  constant HEADER_BYTES : positive := 5;

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';

  signal length     : std_logic_vector(31 downto 0)           := (others => '0');
  signal start      : std_logic                               := '0';
  signal header     : std_logic                               := '0';
  signal announced  : std_logic_vector(31 downto 0);
  signal data       : std_logic_vector(WIDTH-1 downto 0)      := (others => '0');
  signal count      : std_logic_vector(COUNT_BITS-1 downto 0) := (others => '0');
  signal last       : std_logic                               := '0';
  signal valid      : std_logic                               := '0';
  signal ready      : std_logic;
  signal is_cut     : std_logic;
  signal is_lacking : std_logic;

  signal m_data  : std_logic_vector(WIDTH-1 downto 0);
  signal m_count : std_logic_vector(COUNT_BITS-1 downto 0);
  signal m_last  : std_logic;
  signal m_abort : std_logic;
  signal m_valid : std_logic;
  signal m_ready : std_logic := '0';

  signal frames_taken : natural := 0;
  signal is_done      : boolean := false;

begin

  clk <= not clk after 5 ns when not is_done else '0';

  u_trim : entity firm.firm_axis_trim
    generic map (
      WIDTH => WIDTH,
      SLACK => SLACK
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      length     => length,
      start      => start,
      header     => header,
      announced  => announced,
      data       => data,
      count      => count,
      last       => last,
      valid      => valid,
      ready      => ready,
      is_cut     => is_cut,
      is_lacking => is_lacking,
      m_data     => m_data,
      m_count    => m_count,
      m_last     => m_last,
      m_abort    => m_abort,
      m_valid    => m_valid,
      m_ready    => m_ready
    );

  send : process
    variable content : frame_file_t;
    variable frame   : frame_ptr_t;
    variable place   : natural;
    variable size    : natural;
    variable said    : std_logic_vector(31 downto 0);
    variable frames  : natural  := 0;
    variable waits   : natural  := 0;
    variable random  : random_t := seeded(SEED, 3);

    procedure offer is
    begin
      pause(clk, '0', random, SOURCE_STALL_PERCENT);
      valid <= '1';
      loop
        wait until rising_edge(clk);
        exit when ready = '1';
        waits := waits + 1;
      end loop;
      wait until falling_edge(clk);
      valid <= '0';
      data  <= (others => 'X');
    end procedure offer;

  begin
    read_stimulus_file(STIMULUS_FILE, content);
    end_reset(clk, '0', rst_n);
    frame := content.first;
    while frame /= null loop
      for part in 0 to 3 loop
        said(8*part+7 downto 8*part) := to_byte(frame.bytes(part+2));
      end loop;
      place := 0;
      while place < frame.size loop
        header <= '0';
        start  <= '0';
        length <= not said;
        size   := LANES;
        if place < HEADER_BYTES then
          header <= '1';
          -- With a narrow stream, the port is valid only with the first bytes.
          if place = 0 then
            start  <= '1';
            length <= said;
          else
            assert announced = said report "announced is another length" severity failure;
          end if;
          size := HEADER_BYTES - place;
          if size > LANES then
            size := LANES;
          end if;
        elsif not FULL_PIECES then
          draw(random, LANES, size);
        end if;
        if size > frame.size - place then
          size := frame.size - place;
        end if;
        data <= (others => 'X');
        for lane in 0 to size-1 loop
          data(8*lane+7 downto 8*lane) <= to_byte(frame.bytes(place+lane+1));
        end loop;
        count <= std_logic_vector(to_unsigned(size, COUNT_BITS));
        place := place + size;
        offer;
      end loop;
      header <= '0';
      start  <= '0';
      last   <= '1';
      data   <= (others => '0');
      count  <= (others => '0');
      offer;
      last   <= '0';
      frame  := frame.next_frame;
      frames := frames + 1;
    end loop;
    while frames_taken < frames loop
      wait until falling_edge(clk);
    end loop;
    print(integer'image(waits) & " waits");
    print("PASS");
    is_done <= true;
    wait;
  end process send;

  take : process
    file lines            : text open write_mode is TRIMMED_FILE;
    file wanted_file      : text open read_mode is existing(EXPECTED_FILE);
    variable bytes        : line;
    variable remains      : line;
    variable watch        : natural := 0;
    variable was_cut      : boolean := false;
    variable was_lacking  : boolean := false;
    variable random       : random_t := seeded(SEED, 5);
  begin
    wait until rst_n = '1';
    loop
      draw_ready(random, SINK_STALL_PERCENT, m_ready);
      wait until rising_edge(clk);
      watch := watch + 1;
      assert watch < WATCHDOG report "nothing comes" severity failure;
      was_cut     := was_cut or is_cut = '1';
      was_lacking := was_lacking or is_lacking = '1';
      if m_valid = '1' and m_ready = '1' then
        watch := 0;
        for lane in 0 to to_integer(unsigned(m_count))-1 loop
          assert is_defined(m_data(8*lane+7 downto 8*lane)) report "a byte is undefined" severity failure;
          write(bytes, to_hex(m_data(8*lane+7 downto 8*lane)));
        end loop;
        if m_last = '1' then
          if m_abort = '1' then
            remains := new string'(bytes(1 to 2*HEADER_BYTES) & " aborted");
            deallocate(bytes);
            bytes := remains;
          end if;
          if was_cut then
            write(bytes, string'(" cut"));
          end if;
          if was_lacking then
            write(bytes, string'(" lacking"));
          end if;
          write_result(lines, wanted_file, EXPECTED_FILE, bytes);
          frames_taken <= frames_taken + 1;
          was_cut     := false;
          was_lacking := false;
        end if;
      end if;
      wait until falling_edge(clk);
    end loop;
  end process take;

end architecture simulation;
