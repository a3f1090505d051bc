-- The status of a system of two subscribers and one publisher, which a script reads and writes by AXI4-Lite. A line
-- of the script is a letter with two hexadecimal numbers of eight digits; SEED decides when both sides of the bus stall.
--
--   r ADDRESS WORD   read; another word is a failure
--   w ADDRESS WORD   write
--   h ADDRESS WORD   write the lower half of the word, which is refused
--   f CHANNEL CODE   a fault
--   b CHANNEL CODE   two faults at once, of this channel and the next
--   s CHANNEL WAIT   a frame of one beat, which waits this long
--   m CHANNEL BEATS  a frame of so many beats, with stalls
--   t CHANNEL 0      read the time stamp of the channel's newest frame
--   c 0 0            read the counter of the time stamps
--   i CYCLES KIND    unknown ids (0) or errors of the link (1) in so many cycles
--   q 0 LEVEL        the line of interrupts has this level
--   z 0 0            a reset; the counters are not clear then
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
use std.textio.all;
library firm;

entity status_bench is
  generic (
    SCRIPT     : string  := "script.txt";
    SEED       : integer := 1;
    COUNT_BITS : integer := 4
  );
end entity status_bench;

architecture simulation of status_bench is

  subtype word_t is std_logic_vector(31 downto 0);

  signal clk       : std_logic := '0';
  signal rst_n     : std_logic := '0';
  signal is_over   : boolean := false;

  signal awaddr, araddr   : std_logic_vector(15 downto 0) := (others => '0');
  signal awvalid, awready : std_logic := '0';
  signal wdata, rdata     : word_t := (others => '0');
  signal wstrb            : std_logic_vector(3 downto 0) := "1111";
  signal wvalid, wready   : std_logic := '0';
  signal bresp, rresp     : std_logic_vector(1 downto 0);
  signal bvalid, bready   : std_logic := '0';
  signal arvalid, arready : std_logic := '0';
  signal rvalid, rready   : std_logic := '0';

  signal bus_valid, bus_write, bus_done : std_logic;
  signal bus_address                    : std_logic_vector(15 downto 0);
  signal bus_write_data, bus_read_data  : word_t;
  signal channel_address                : std_logic_vector(13 downto 0);
  signal channel_word                   : word_t;
  signal enable, is_clear               : std_logic;
  signal fault, lost, interrupt         : std_logic;
  signal fault_channel                  : std_logic_vector(11 downto 0);
  signal fault_code                     : std_logic_vector(3 downto 0);

  signal id_error, link_error : std_logic := '0';
  signal frame_error          : std_logic_vector(2 downto 0) := (others => '0');
  signal frame_error_code     : std_logic_vector(11 downto 0) := (others => '0');
  signal sub_valid, sub_ready : std_logic_vector(1 downto 0) := (others => '0');
  signal pub_valid            : std_logic_vector(0 downto 0) := (others => '0');
  signal pub_beat             : std_logic := '0';
  signal is_last              : std_logic := '1';
  signal cycles               : word_t;

  -- The cycles since reset, and what the time stamps must be.
  type stamps_t is array (0 to 2) of natural;
  signal count    : natural := 0;
  signal read_at  : natural := 0;
  signal stamps   : stamps_t := (others => 0);
  signal is_first : boolean := true;

begin

  clk <= not clk after 5 ns when not is_over else '0';

  keep_time : process (clk)
  begin
    if rising_edge(clk) then
      if rst_n = '1' then
        count <= count + 1;
      end if;
      if bus_valid = '1' then
        read_at <= count;
      end if;
      for number in 0 to 1 loop
        if sub_valid(number) = '1' and sub_ready(number) = '1' then
          is_first <= is_last = '1';
          if is_first then
            stamps(number) <= count + 1;
          end if;
        end if;
      end loop;
      if pub_beat = '1' and is_last = '1' then
        stamps(2) <= count + 1;
      end if;
    end if;
  end process keep_time;

  play : process

    file lines_in     : text open read_mode is SCRIPT;
    variable line_in  : line;
    variable action   : character;
    variable first    : word_t;
    variable second   : word_t;
    variable number   : natural;
    variable row      : natural := 0;
    variable seed_1   : positive := SEED;
    variable seed_2   : positive := 1;
    variable duration : natural;

    procedure read_word(word : out word_t) is
      variable digit : character;
      variable value : word_t := (others => '0');
    begin
      read(line_in, digit);
      for place in 7 downto 0 loop
        read(line_in, digit);
        if digit <= '9' then
          value(4*place+3 downto 4*place) :=
            std_logic_vector(to_unsigned(character'pos(digit) - character'pos('0'), 4));
        else
          value(4*place+3 downto 4*place) :=
            std_logic_vector(to_unsigned(character'pos(digit) - character'pos('a') + 10, 4));
        end if;
      end loop;
      word := value;
    end procedure read_word;

    procedure pause is
      variable chance : real;
    begin
      uniform(seed_1, seed_2, chance);
      for cycle in 1 to integer(floor(4.0 * chance)) loop
        wait until rising_edge(clk);
      end loop;
    end procedure pause;

    procedure write_word(strobe : std_logic_vector(3 downto 0); response : std_logic_vector(1 downto 0)) is
    begin
      pause;
      awaddr  <= first(15 downto 0);
      awvalid <= '1';
      pause;
      wdata   <= second;
      wstrb   <= strobe;
      wvalid  <= '1';
      wait until rising_edge(clk) and awready = '1' and wready = '1';
      awvalid <= '0';
      wvalid  <= '0';
      pause;
      bready <= '1';
      wait until rising_edge(clk) and bvalid = '1';
      bready <= '0';
      assert bresp = response
        report "line " & integer'image(row) & ": another response" severity failure;
    end procedure write_word;

  begin
    for cycle in 1 to 8 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    wait until rising_edge(clk) and is_clear = '1';
    while not endfile(lines_in) loop
      readline(lines_in, line_in);
      row := row + 1;
      read(line_in, action);
      read_word(first);
      read_word(second);
      number := to_integer(unsigned(first(15 downto 0)));
      duration := to_integer(unsigned(second(15 downto 0)));
      case action is
        when 'r' | 't' | 'c' =>
          -- Whatever happened is counted by now.
          for cycle in 1 to 8 loop
            wait until rising_edge(clk);
          end loop;
          pause;
          araddr <= first(15 downto 0);
          if action = 't' then
            araddr <= std_logic_vector(to_unsigned(16#803C# + 64 * number, 16));
          elsif action = 'c' then
            araddr <= x"0024";
          end if;
          arvalid <= '1';
          wait until rising_edge(clk) and arready = '1';
          arvalid <= '0';
          pause;
          rready <= '1';
          wait until rising_edge(clk) and rvalid = '1';
          rready <= '0';
          if action = 't' then
            second := std_logic_vector(to_unsigned(stamps(number), 32));
          elsif action = 'c' then
            second := std_logic_vector(to_unsigned(read_at, 32));
          end if;
          assert rdata = second and rresp = "00"
            report "line " & integer'image(row) & ": read "
                   & integer'image(to_integer(unsigned(rdata(30 downto 16)))) & " * 65536 + "
                   & integer'image(to_integer(unsigned(rdata(15 downto 0)))) severity failure;
        when 'w' =>
          write_word("1111", "00");
        when 'h' =>
          write_word("0011", "10");
        when 'f' | 'b' =>
          frame_error(number)                           <= '1';
          frame_error_code(4*number+3 downto 4*number) <= second(3 downto 0);
          if action = 'b' then
            frame_error(number+1)                           <= '1';
            frame_error_code(4*number+7 downto 4*number+4) <= second(3 downto 0);
          end if;
          wait until rising_edge(clk);
          frame_error      <= (others => '0');
          frame_error_code <= (others => '0');
        when 's' =>
          if number < 2 then
            sub_valid(number) <= '1';
          else
            pub_valid(0) <= '1';
          end if;
          for cycle in 1 to duration loop
            wait until rising_edge(clk);
          end loop;
          if number < 2 then
            sub_ready(number) <= '1';
          else
            pub_beat <= '1';
          end if;
          wait until rising_edge(clk);
          sub_valid <= (others => '0');
          sub_ready <= (others => '0');
          pub_valid <= (others => '0');
          pub_beat  <= '0';
        when 'm' =>
          for beat in 1 to duration loop
            pause;
            if beat < duration then
              is_last <= '0';
            end if;
            if number < 2 then
              sub_valid(number) <= '1';
              pause;
              sub_ready(number) <= '1';
            else
              pub_valid(0) <= '1';
              pause;
              pub_beat <= '1';
            end if;
            wait until rising_edge(clk);
            sub_valid <= (others => '0');
            sub_ready <= (others => '0');
            pub_valid <= (others => '0');
            pub_beat  <= '0';
            is_last   <= '1';
          end loop;
        when 'i' =>
          if duration = 0 then
            id_error <= '1';
          else
            link_error <= '1';
          end if;
          for cycle in 1 to to_integer(unsigned(first(30 downto 0))) loop
            wait until rising_edge(clk);
          end loop;
          id_error   <= '0';
          link_error <= '0';
        when 'z' =>
          rst_n <= '0';
          for cycle in 1 to 4 loop
            wait until rising_edge(clk);
          end loop;
          rst_n <= '1';
          wait until rising_edge(clk);
          assert is_clear = '0'
            report "line " & integer'image(row) & ": the counters are already clear" severity failure;
        when others =>
          for cycle in 1 to 8 loop
            wait until rising_edge(clk);
          end loop;
          assert interrupt = second(0)
            report "line " & integer'image(row) & ": the line of interrupts has another level" severity failure;
      end case;
    end loop;
    report "PASS " & integer'image(row) severity note;
    is_over <= true;
    wait;
  end process play;

  u_bus : entity firm.firm_status_axi_lite
    port map (
      clk            => clk,
      rst_n          => rst_n,
      s_axi_awaddr   => awaddr,
      s_axi_awprot   => "000",
      s_axi_awvalid  => awvalid,
      s_axi_awready  => awready,
      s_axi_wdata    => wdata,
      s_axi_wstrb    => wstrb,
      s_axi_wvalid   => wvalid,
      s_axi_wready   => wready,
      s_axi_bresp    => bresp,
      s_axi_bvalid   => bvalid,
      s_axi_bready   => bready,
      s_axi_araddr   => araddr,
      s_axi_arprot   => "000",
      s_axi_arvalid  => arvalid,
      s_axi_arready  => arready,
      s_axi_rdata    => rdata,
      s_axi_rresp    => rresp,
      s_axi_rvalid   => rvalid,
      s_axi_rready   => rready,
      bus_valid      => bus_valid,
      bus_write      => bus_write,
      bus_address    => bus_address,
      bus_write_data => bus_write_data,
      bus_read_data  => bus_read_data,
      bus_done       => bus_done
    );

  u_registers : entity work.bench_status
    port map (
      clk                          => clk,
      rst_n                        => rst_n,
      bus_valid                    => bus_valid,
      bus_write                    => bus_write,
      bus_address                  => bus_address,
      bus_write_data               => bus_write_data,
      bus_read_data                => bus_read_data,
      bus_done                     => bus_done,
      channel_address              => channel_address,
      channel_word                 => channel_word,
      control_count                => enable,
      cycles_count                 => cycles,
      interrupt_enable_frame_error => open,
      interrupt_enable_id_error    => open,
      interrupt_enable_link_error  => open,
      interrupt_enable_lost        => open,
      last_fault_code              => fault_code,
      last_fault_channel           => fault_channel,
      id_errors_count              => id_error,
      link_errors_count            => link_error,
      lost_count                   => lost,
      interrupt_frame_error_set    => fault,
      interrupt_id_error_set       => id_error,
      interrupt_link_error_set     => link_error,
      interrupt_lost_set           => lost,
      interrupt                    => interrupt
    );

  u_counters : entity firm.firm_status_counters
    generic map (
      SUBSCRIBERS => 2,
      PUBLISHERS  => 1,
      COUNT_BITS  => COUNT_BITS,
      WAIT_BITS   => 16,
      TIME_STAMPS => true
    )
    port map (
      clk              => clk,
      rst_n            => rst_n,
      enable           => enable,
      is_clear         => is_clear,
      sub_axis_tvalid  => sub_valid,
      sub_axis_tready  => sub_ready,
      sub_axis_tlast   => is_last,
      pub_axis_tvalid  => pub_valid,
      sched_beat       => pub_beat,
      sched_last       => is_last,
      sched_select     => "0",
      frame_error      => frame_error,
      frame_error_code => frame_error_code,
      fault            => fault,
      fault_channel    => fault_channel,
      fault_code       => fault_code,
      lost             => lost,
      cycles           => cycles,
      read_address     => channel_address(12 downto 0),
      read_word        => channel_word
    );

end architecture simulation;
