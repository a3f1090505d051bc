-- SPDX-License-Identifier: Apache-2.0
-- A router whose routes are numbers, for the proofs: bit `input*PORTS+output` of TURNS is a turn, for which the number
-- of the output is the destination. The destination PORTS has the turns of COPIES.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_noc_pkg.all;

entity noc_router_case is
  generic (
    PORTS  : positive := 2;
    TURNS  : natural  := 6;
    COPIES : natural  := 0;
    DEPTH  : positive := 2
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_beat        : in  std_logic_vector(PORTS*4-1 downto 0);
    s_destination : in  std_logic_vector(PORTS*3-1 downto 0);
    s_last        : in  std_logic_vector(PORTS-1 downto 0);
    s_valid       : in  std_logic_vector(PORTS-1 downto 0);
    s_ready       : out std_logic_vector(PORTS-1 downto 0);

    m_beat        : out std_logic_vector(PORTS*4-1 downto 0);
    m_destination : out std_logic_vector(PORTS*3-1 downto 0);
    m_last        : out std_logic_vector(PORTS-1 downto 0);
    m_valid       : out std_logic_vector(PORTS-1 downto 0);
    m_ready       : in  std_logic_vector(PORTS-1 downto 0)
  );
end entity noc_router_case;

architecture rtl of noc_router_case is

  function has_bit(number, place : natural) return boolean is
  begin
    return (number / 2**place) mod 2 = 1;
  end function has_bit;

  function bits_of(number : natural) return natural is
    variable count : natural := 0;
  begin
    for place in 0 to PORTS*PORTS-1 loop
      if has_bit(number, place) then
        count := count + 1;
      end if;
    end loop;
    return count;
  end function bits_of;

  function routes_of_case return routes_t is
    variable routes : routes_t(0 to bits_of(TURNS)+bits_of(COPIES)-1);
    variable count  : natural := 0;
  begin
    for place in 0 to PORTS*PORTS-1 loop
      if has_bit(TURNS, place) then
        routes(count) := (place / PORTS, place mod PORTS, place mod PORTS);
        count         := count + 1;
      end if;
      if has_bit(COPIES, place) then
        routes(count) := (place / PORTS, PORTS, place mod PORTS);
        count         := count + 1;
      end if;
    end loop;
    return routes;
  end function routes_of_case;

begin

  u_router : entity firm.firm_noc_router
    generic map (
      BITS      => 4,
      DEST_BITS => 3,
      PORTS     => PORTS,
      DEPTH     => DEPTH,
      ROUTES    => routes_of_case
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_beat        => s_beat,
      s_destination => s_destination,
      s_last        => s_last,
      s_valid       => s_valid,
      s_ready       => s_ready,
      m_beat        => m_beat,
      m_destination => m_destination,
      m_last        => m_last,
      m_valid       => m_valid,
      m_ready       => m_ready
    );

end architecture rtl;
