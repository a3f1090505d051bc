-- SPDX-License-Identifier: Apache-2.0
-- Reads and writes registers by AXI4-Lite, one access at a time; reads and writes take turns. A write of less than
-- a whole word changes nothing and is answered by SLVERR.
library ieee;
use ieee.std_logic_1164.all;

entity firm_status_axi_lite is
  generic (
    ADDRESS_BITS : positive := 16
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axi_awaddr  : in  std_logic_vector(ADDRESS_BITS-1 downto 0);
    s_axi_awprot  : in  std_logic_vector(2 downto 0);
    s_axi_awvalid : in  std_logic;
    s_axi_awready : out std_logic;
    s_axi_wdata   : in  std_logic_vector(31 downto 0);
    s_axi_wstrb   : in  std_logic_vector(3 downto 0);
    s_axi_wvalid  : in  std_logic;
    s_axi_wready  : out std_logic;
    s_axi_bresp   : out std_logic_vector(1 downto 0);
    s_axi_bvalid  : out std_logic;
    s_axi_bready  : in  std_logic;
    s_axi_araddr  : in  std_logic_vector(ADDRESS_BITS-1 downto 0);
    s_axi_arprot  : in  std_logic_vector(2 downto 0);
    s_axi_arvalid : in  std_logic;
    s_axi_arready : out std_logic;
    s_axi_rdata   : out std_logic_vector(31 downto 0);
    s_axi_rresp   : out std_logic_vector(1 downto 0);
    s_axi_rvalid  : out std_logic;
    s_axi_rready  : in  std_logic;

    -- The registers: `bus_valid` pulses, and the rest is stable until `bus_done` pulses.
    bus_valid      : out std_logic;
    bus_write      : out std_logic;
    bus_address    : out std_logic_vector(ADDRESS_BITS-1 downto 0);
    bus_write_data : out std_logic_vector(31 downto 0);
    bus_read_data  : in  std_logic_vector(31 downto 0);
    bus_done       : in  std_logic
  );
end entity firm_status_axi_lite;

architecture rtl of firm_status_axi_lite is

  constant OKAY              : std_logic_vector(1 downto 0) := "00";
  constant SUBORDINATE_ERROR : std_logic_vector(1 downto 0) := "10";

  type state_t is (WAITS, ASKS, AWAITS, ANSWERS);

  signal state_r       : state_t;
  signal is_write_r    : std_logic;
  signal address_r     : std_logic_vector(ADDRESS_BITS-1 downto 0) := (others => '0');
  signal data_r        : std_logic_vector(31 downto 0);
  signal response_r    : std_logic_vector(1 downto 0);
  signal takes_read_r  : std_logic;
  signal takes_write_r : std_logic;

begin

  serve : process (clk)
  begin
    if rising_edge(clk) then
      takes_read_r  <= '0';
      takes_write_r <= '0';
      if state_r = WAITS then
        response_r <= OKAY;
        -- The last access was a write, or no write is requested.
        if s_axi_arvalid = '1' and (is_write_r = '1' or s_axi_awvalid = '0' or s_axi_wvalid = '0') then
          takes_read_r <= '1';
          is_write_r   <= '0';
          address_r    <= s_axi_araddr;
          state_r      <= ASKS;
        elsif s_axi_awvalid = '1' and s_axi_wvalid = '1' then
          takes_write_r <= '1';
          is_write_r    <= '1';
          address_r     <= s_axi_awaddr;
          data_r        <= s_axi_wdata;
          state_r       <= ASKS;
          if s_axi_wstrb /= "1111" then
            response_r <= SUBORDINATE_ERROR;
            state_r    <= ANSWERS;
          end if;
        end if;
      elsif state_r = ASKS then
        state_r <= AWAITS;
      elsif state_r = AWAITS then
        if bus_done = '1' then
          state_r <= ANSWERS;
          if is_write_r = '0' then
            data_r <= bus_read_data;
          end if;
        end if;
      elsif state_r = ANSWERS then
        if (is_write_r = '1' and s_axi_bready = '1') or (is_write_r = '0' and s_axi_rready = '1') then
          state_r <= WAITS;
        end if;
      end if;
      if rst_n = '0' then
        state_r       <= WAITS;
        is_write_r    <= '0';
        takes_read_r  <= '0';
        takes_write_r <= '0';
      end if;
    end if;
  end process serve;

  s_axi_arready <= takes_read_r;
  s_axi_awready <= takes_write_r;
  s_axi_wready  <= takes_write_r;
  s_axi_rvalid  <= '1' when state_r = ANSWERS and is_write_r = '0' else '0';
  s_axi_rdata   <= data_r;
  s_axi_rresp   <= response_r;
  s_axi_bvalid  <= '1' when state_r = ANSWERS and is_write_r = '1' else '0';
  s_axi_bresp   <= response_r;

  bus_valid      <= '1' when state_r = ASKS else '0';
  bus_write      <= is_write_r;
  bus_address    <= address_r;
  bus_write_data <= data_r;

end architecture rtl;
