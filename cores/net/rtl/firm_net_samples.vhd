-- SPDX-License-Identifier: Apache-2.0
-- Takes the payloads out of the Manager's frames `id | length | payload`, and holds each one until it is whole: that of
-- an aborted frame is forgotten.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_net_samples is
  generic (
    DEPTH : integer := 256  -- bytes, a power of two, 4 and more; a payload with as many is dropped
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in  std_logic_vector(7 downto 0);
    s_axis_tuser  : in  std_logic_vector(0 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    m_axis_tdata  : out std_logic_vector(7 downto 0);
    m_axis_tvalid : out std_logic;
    m_axis_tlast  : out std_logic;
    m_axis_tready : in  std_logic;

    is_long : out std_logic  -- a pulse for each payload that is dropped
  );
end entity firm_net_samples;

architecture rtl of firm_net_samples is

  constant HEAD_BYTES : positive := 5;

  signal place_r : natural range 0 to HEAD_BYTES;  -- of the byte; HEAD_BYTES: in the payload
  signal held_r  : std_logic;                      -- a payload waits, or may wait
  signal ready   : std_logic;
  signal moves   : std_logic;
  signal stores  : std_logic;
  signal dropped : std_logic;
  signal valid   : std_logic;
  signal last    : std_logic;

begin

  ready         <= not held_r;
  s_axis_tready <= ready;
  moves         <= s_axis_tvalid and ready;
  stores        <= moves when place_r = HEAD_BYTES else '0';

  follow : process (clk)
  begin
    if rising_edge(clk) then
      if moves = '1' then
        if place_r /= HEAD_BYTES then
          place_r <= place_r + 1;
        end if;
        if s_axis_tlast = '1' then
          place_r <= 0;
          held_r  <= stores and not s_axis_tuser(0);
        end if;
      end if;
      if dropped = '1' or (valid = '1' and last = '1' and m_axis_tready = '1') then
        held_r <= '0';
      end if;
      if rst_n = '0' then
        place_r <= 0;
        held_r  <= '0';
      end if;
    end if;
  end process follow;

  u_store : entity firm.firm_mac_store
    generic map (
      DEPTH => DEPTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => s_axis_tdata,
      s_axis_tuser  => s_axis_tuser,
      s_axis_tvalid => stores,
      s_axis_tlast  => s_axis_tlast,
      m_axis_tdata  => m_axis_tdata,
      m_axis_tvalid => valid,
      m_axis_tlast  => last,
      m_axis_tready => m_axis_tready,
      is_lost       => dropped
    );

  m_axis_tvalid <= valid;
  m_axis_tlast  <= last;
  is_long       <= dropped;

end architecture rtl;
