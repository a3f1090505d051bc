-- SPDX-License-Identifier: Apache-2.0
-- Transfers a word to another clock domain each time that it changes. The sink sees only words that the source has
-- shown, each as a whole; words that the source shows for a shorter time than a transfer may be skipped, but never the
-- last one.
--
-- Constraint: that of firm_cdc_message.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_cdc_word is
  generic (
    -- The word at the sink after reset.
    INITIAL : std_logic_vector(31 downto 0) := (others => '0')
  );
  port (
    s_clk   : in std_logic;
    s_rst_n : in std_logic;
    s_word  : in std_logic_vector(31 downto 0);

    m_clk   : in  std_logic;
    m_rst_n : in  std_logic;
    m_word  : out std_logic_vector(31 downto 0)
  );
end entity firm_cdc_word;

architecture rtl of firm_cdc_word is

  signal sent_r   : std_logic_vector(31 downto 0);  -- the word in transit, or the last one
  signal offers_r : std_logic_vector(0 downto 0);
  signal is_taken : std_logic;
  signal arrived  : std_logic_vector(31 downto 0);
  signal arrives  : std_logic;
  signal word_r   : std_logic_vector(31 downto 0);

begin

  offer : process (s_clk)
  begin
    if rising_edge(s_clk) then
      if is_taken = '1' then
        offers_r <= "0";
      elsif offers_r = "0" and s_word /= sent_r then
        sent_r   <= s_word;
        offers_r <= "1";
      end if;
      if s_rst_n = '0' then
        sent_r   <= INITIAL;
        offers_r <= "0";
      end if;
    end if;
  end process offer;

  u_message : entity firm.firm_cdc_message
    generic map (
      FIELD_BITS => 32
    )
    port map (
      s_clk           => s_clk,
      s_rst_n         => s_rst_n,
      s_fields        => sent_r,
      s_segment_valid => offers_r,
      s_valid         => offers_r(0),
      s_ready         => is_taken,
      s_settled       => open,
      s_idle          => open,
      m_clk           => m_clk,
      m_rst_n         => m_rst_n,
      m_fields        => arrived,
      m_segment_valid => open,
      m_valid         => arrives,
      m_ready         => '1'
    );

  keep : process (m_clk)
  begin
    if rising_edge(m_clk) then
      if arrives = '1' then
        word_r <= arrived;
      end if;
      if m_rst_n = '0' then
        word_r <= INITIAL;
      end if;
    end if;
  end process keep;

  m_word <= word_r;

end architecture rtl;
