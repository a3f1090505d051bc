-- The message side of a publisher in simulation: what gives values, and what gives a stream. Each reads a file of
-- lines that begin with the number of the message that they belong to. `message` is the one that is being sent: what is
-- left of an earlier one is dropped, and told.
library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

-- The fields and lengths of a message or of an element: a line is `message last withdraw bits`. The segments become
-- valid one after the other, each after a random time. Where `withdraw` is not 0, the values go after so many cycles.
entity value_source is
  generic (
    SOURCE_FILE   : string;
    BITS          : natural;
    SEGMENTS      : positive;
    SEED          : positive;
    STALL_PERCENT : natural
  );
  port (
    clk       : in  std_logic;
    rst_n     : in  std_logic;
    message   : in  natural;
    values    : out std_logic_vector(BITS-1 downto 0);
    valid     : out std_logic_vector(SEGMENTS-1 downto 0);
    -- All segments are valid.
    whole     : out std_logic;
    last      : out std_logic;
    ready     : in  std_logic;
    -- The number of the next message: one more once it was taken or withdrawn.
    following : out natural;
    finished  : out std_logic
  );
end entity;

architecture simulation of value_source is
begin

  give : process
    file source        : text open read_mode is SOURCE_FILE;
    variable line_text : line;
    variable number    : natural;
    variable is_last   : bit;
    variable lifetime  : natural;
    variable content   : bit_vector(BITS-1 downto 0);
    variable random_1  : positive := SEED;
    variable random_2  : positive := 5;
    variable draw      : real;
    variable shown     : natural;
    variable age       : natural;
  begin
    valid     <= (others => '0');
    whole     <= '0';
    last      <= 'X';
    following <= 0;
    finished  <= '0';
    wait until rising_edge(clk) and rst_n = '1';
    while not endfile(source) loop
      readline(source, line_text);
      read(line_text, number);
      read(line_text, is_last);
      read(line_text, lifetime);
      read(line_text, content);
      if message > number then
        print("left of message " & integer'image(number));
        next;
      end if;
      values <= to_stdlogicvector(content);
      last   <= to_stdulogic(is_last);
      shown  := 0;
      age    := 0;
      loop
        uniform(random_1, random_2, draw);
        while shown < SEGMENTS and 100.0 * draw >= real(STALL_PERCENT) loop
          valid(shown) <= '1';
          shown        := shown + 1;
          uniform(random_1, random_2, draw);
        end loop;
        if shown = SEGMENTS then
          whole <= '1';
        end if;
        wait until rising_edge(clk);
        age := age + 1;
        if message > number then
          print("left of message " & integer'image(number));
          exit;
        end if;
        exit when ready = '1' or age = lifetime;
      end loop;
      valid     <= (others => '0');
      whole     <= '0';
      last      <= 'X';
      values    <= (others => 'U');
      following <= number + 1;
      -- What was withdrawn is low for a cycle at least.
      if lifetime > 0 or 100.0 * draw < real(STALL_PERCENT) then
        wait until rising_edge(clk);
      end if;
    end loop;
    finished <= '1';
    wait;
  end process;

end architecture;

library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

-- A string or an array of numbers: a line is `message last keep data`.
entity stream_source is
  generic (
    SOURCE_FILE   : string;
    WIDTH         : positive;
    SEED          : positive;
    STALL_PERCENT : natural
  );
  port (
    clk      : in  std_logic;
    rst_n    : in  std_logic;
    message  : in  natural;
    tdata    : out std_logic_vector(WIDTH-1 downto 0);
    tkeep    : out std_logic_vector(WIDTH/8-1 downto 0);
    tvalid   : out std_logic;
    tlast    : out std_logic;
    tready   : in  std_logic;
    finished : out std_logic
  );
end entity;

architecture simulation of stream_source is
begin

  give : process
    file source        : text open read_mode is SOURCE_FILE;
    variable line_text : line;
    variable number    : natural;
    variable is_last   : bit;
    variable keep      : bit_vector(WIDTH/8-1 downto 0);
    variable content   : bit_vector(WIDTH-1 downto 0);
    variable random_1  : positive := SEED;
    variable random_2  : positive := 6;
    variable draw      : real;
  begin
    tvalid   <= '0';
    tdata    <= (others => 'X');
    tkeep    <= (others => 'X');
    tlast    <= 'X';
    finished <= '0';
    wait until rising_edge(clk) and rst_n = '1';
    while not endfile(source) loop
      readline(source, line_text);
      read(line_text, number);
      read(line_text, is_last);
      read(line_text, keep);
      read(line_text, content);
      if message > number then
        print("left of message " & integer'image(number));
        next;
      end if;
      uniform(random_1, random_2, draw);
      while 100.0 * draw < real(STALL_PERCENT) loop
        wait until rising_edge(clk);
        uniform(random_1, random_2, draw);
      end loop;
      tvalid <= '1';
      tdata  <= to_stdlogicvector(content);
      tkeep  <= to_stdlogicvector(keep);
      tlast  <= to_stdulogic(is_last);
      loop
        wait until rising_edge(clk);
        if message > number then
          print("left of message " & integer'image(number));
          exit;
        end if;
        exit when tready = '1';
      end loop;
      tvalid <= '0';
      tdata  <= (others => 'X');
      tkeep  <= (others => 'X');
      tlast  <= 'X';
    end loop;
    finished <= '1';
    wait;
  end process;

end architecture;

library ieee;
use ieee.std_logic_1164.all;
use ieee.math_real.all;
use std.textio.all;
library firm;
use firm.firm_sim_pkg.all;

-- Takes the frames and prints each in hex, as parts of LONGEST_LINE digits and what is left, with the cycle of its last
-- beat; form and stability of the stream are checked.
entity frame_sink is
  generic (
    WIDTH         : positive;
    SEED          : positive;
    STALL_PERCENT : natural;
    -- Ready only once `tvalid` was seen, which must not wait for it.
    LATE_READY    : boolean
  );
  port (
    clk    : in  std_logic;
    rst_n  : in  std_logic;
    tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    tuser  : in  std_logic_vector(0 downto 0);
    tvalid : in  std_logic;
    tlast  : in  std_logic;
    tready : out std_logic
  );
end entity;

architecture simulation of frame_sink is

  constant LONGEST_LINE : positive := 128;
  signal ready_r : std_logic := '0';

begin

  tready <= ready_r;

  take : process
    variable random_1 : positive := SEED;
    variable random_2 : positive := 7;
    variable draw     : real;
    variable cycle    : natural := 0;
    variable beats    : natural := 0;
    variable is_stuck : boolean := false;
    variable data     : std_logic_vector(WIDTH-1 downto 0);
    variable keep     : std_logic_vector(WIDTH/8-1 downto 0);
    variable was_last : std_logic;
    variable text     : line;
    variable size     : natural;
  begin
    wait until rising_edge(clk) and rst_n = '1';
    loop
      uniform(random_1, random_2, draw);
      ready_r <= '0';
      if 100.0 * draw >= real(STALL_PERCENT) and (is_stuck or not LATE_READY) then
        ready_r <= '1';
      end if;
      wait until rising_edge(clk);
      cycle := cycle + 1;
      assert tvalid = '0' or tvalid = '1' report "tvalid is undefined" severity failure;
      assert not is_stuck or (tvalid = '1' and tlast = was_last and tkeep = keep)
        report "a beat goes or changes before it is taken" severity failure;
      if tvalid = '1' then
        assert is_defined(tkeep) and (tlast = '0' or tlast = '1')
          report "tkeep or tlast is undefined" severity failure;
        size := 0;
        for lane in 0 to WIDTH/8-1 loop
          if tkeep(lane) = '1' then
            assert size = lane report "tkeep has a gap" severity failure;
            assert is_defined(tdata(8*lane+7 downto 8*lane)) report "a byte is undefined" severity failure;
            assert not is_stuck or tdata(8*lane+7 downto 8*lane) = data(8*lane+7 downto 8*lane)
              report "a byte changes before it is taken" severity failure;
            size := size + 1;
            if ready_r = '1' then
              write(text, to_hex(tdata(8*lane+7 downto 8*lane)));
              -- A line is copied with each byte that it gets.
              if text'length = LONGEST_LINE then
                print("part " & text.all);
                deallocate(text);
              end if;
            end if;
          end if;
        end loop;
        assert size > 0 report "a beat has no byte" severity failure;
        assert size = WIDTH/8 or tlast = '1' report "a beat inside a frame is not full" severity failure;
        if ready_r = '1' then
          beats := beats + 1;
          if tlast = '1' then
            if tuser = "1" then
              print("aborted");
            end if;
            if text = null then
              print("frame ");
            else
              print("frame " & text.all);
            end if;
            print("beats " & integer'image(beats) & " cycle " & integer'image(cycle));
            deallocate(text);
            beats := 0;
          end if;
        end if;
      end if;
      is_stuck := tvalid = '1' and ready_r = '0';
      data     := tdata;
      keep     := tkeep;
      was_last := tlast;
    end loop;
  end process;

end architecture;
