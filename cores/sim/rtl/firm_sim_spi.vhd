-- SPDX-License-Identifier: Apache-2.0
-- The host as the master of an SPI link: frames of firm_sim_host, and back. It reads the status, writes as many bytes
-- as there is room for, reads the waiting bytes, and repeats; selections are cut short at random unless STALL_PERCENT
-- is 0. Simulation only.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use ieee.math_real.all;
library firm;

entity firm_sim_spi is
  generic (
    PERIOD : time    := 100 ns;  -- of spi_sclk
    SEED   : integer := 1;
    -- The chance that it pauses before a byte, and that it ends a selection within one.
    STALL_PERCENT : integer := 0
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    -- Frames of the host.
    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tkeep  : out std_logic_vector(0 downto 0);
    m_axis_tid    : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    spi_sclk : out std_logic;
    spi_cs_n : out std_logic;
    spi_mosi : out std_logic;
    spi_miso : in  std_logic;
    spi_irq  : in  std_logic
  );
end entity firm_sim_spi;

architecture simulation of firm_sim_spi is

  subtype byte_t is std_logic_vector(7 downto 0);

  signal coded_data  : std_logic_vector(7 downto 0);
  signal coded_valid : std_logic;
  signal coded_ready : std_logic;

  signal received_data  : byte_t;
  signal received_count : natural := 0;

begin

  master : process

    variable random_1 : positive := SEED;
    variable random_2 : positive := 13;

    variable answer  : byte_t;
    variable room    : natural;
    variable waiting : natural;
    variable unsent  : byte_t;
    variable has_one : boolean := false;  -- `unsent` was taken from the host, and not written yet

    impure function happens return boolean is
      variable draw : real;
    begin
      uniform(random_1, random_2, draw);
      return 100.0 * draw < real(STALL_PERCENT);
    end function happens;

    procedure pause is
      variable draw : real;
    begin
      uniform(random_1, random_2, draw);
      wait for 20.0 * draw * PERIOD;
    end procedure pause;

    procedure send_bits(data : in byte_t; bits : in natural := 8) is
    begin
      for place in 7 downto 8 - bits loop
        spi_mosi <= data(place);
        wait for PERIOD / 2;
        spi_sclk      <= '1';
        answer(place) := spi_miso;
        wait for PERIOD / 2;
        spi_sclk <= '0';
      end loop;
    end procedure send_bits;

    procedure begin_selection(command : in byte_t) is
    begin
      spi_cs_n <= '0';
      wait for PERIOD;
      send_bits(command);
      assert answer(7 downto 1) = "1000000"
        report "firm_sim_spi: the answer to a command begins with an unknown byte, or bytes were dropped"
        severity failure;
    end procedure begin_selection;

    procedure end_selection is
    begin
      wait for PERIOD / 2;
      spi_cs_n <= '1';
      spi_mosi <= 'X';
      wait for 2 * PERIOD;
    end procedure end_selection;

    procedure ask_status is
      variable status : std_logic_vector(31 downto 0);
    begin
      begin_selection(x"00");
      for number in 0 to 3 loop
        send_bits(x"FF");
        status(8*number+7 downto 8*number) := answer;
      end loop;
      room    := to_integer(unsigned(status(15 downto 0)));
      waiting := to_integer(unsigned(status(31 downto 16)));
      end_selection;
    end procedure ask_status;

    procedure write_bytes is
    begin
      begin_selection(x"01");
      while room > 0 loop
        if not has_one then
          exit when coded_valid /= '1';
          wait until falling_edge(clk);
          coded_ready <= '1';
          wait until rising_edge(clk);
          unsent        := coded_data;
          has_one       := true;
          coded_ready <= '0';
          wait until rising_edge(clk);
        end if;
        if happens then
          pause;
        end if;
        if happens then
          -- An incompletely clocked byte is ignored.
          send_bits(unsent, 5);
          exit;
        end if;
        send_bits(unsent);
        has_one := false;
        room    := room - 1;
      end loop;
      end_selection;
    end procedure write_bytes;

    procedure read_bytes is
    begin
      begin_selection(x"02");
      while waiting > 0 loop
        if happens then
          send_bits(x"FF", 3);
          exit;
        end if;
        send_bits(x"FF");
        received_data  <= answer;
        received_count <= received_count + 1;
        waiting        := waiting - 1;
      end loop;
      end_selection;
    end procedure read_bytes;

  begin
    coded_ready <= '0';
    spi_cs_n      <= '1';
    spi_sclk      <= '0';
    wait until rising_edge(clk) and rst_n = '1';
    wait for 4 * PERIOD;
    begin_selection(x"03");
    end_selection;
    loop
      if coded_valid /= '1' and not has_one and spi_irq = '0' then
        wait until coded_valid = '1' or spi_irq = '1';
      end if;
      ask_status;
      if (coded_valid = '1' or has_one) and room > 0 then
        write_bytes;
      end if;
      if waiting > 0 then
        read_bytes;
      end if;
    end loop;
  end process master;

  u_coder : entity firm.firm_sim_coder
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tvalid => s_axis_tvalid,
      s_axis_tlast  => s_axis_tlast,
      s_axis_tready => s_axis_tready,
      data          => coded_data,
      valid         => coded_valid,
      ready         => coded_ready
    );

  u_frames : entity firm.firm_sim_frames
    port map (
      clk           => clk,
      rst_n         => rst_n,
      data          => received_data,
      count         => received_count,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tkeep  => m_axis_tkeep,
      m_axis_tid    => m_axis_tid,
      m_axis_tvalid => m_axis_tvalid,
      m_axis_tlast  => m_axis_tlast,
      m_axis_tready => m_axis_tready
    );

end architecture simulation;
