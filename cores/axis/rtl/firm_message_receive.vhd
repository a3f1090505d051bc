-- SPDX-License-Identifier: Apache-2.0
-- Receives the frames of firm_message_send: each one becomes a message, whose fields are stable until it is taken. The
-- next frame may begin in the cycle in which the message is taken.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_message_receive is
  generic (
    WIDTH      : integer := 8;
    FIELD_BITS : integer := 8
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    s_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    s_axis_tvalid : in  std_logic;
    s_axis_tlast  : in  std_logic;
    s_axis_tready : out std_logic;

    fields : out std_logic_vector(FIELD_BITS-1 downto 0);
    valid  : out std_logic;
    ready  : in  std_logic
  );
end entity firm_message_receive;

architecture rtl of firm_message_receive is

  -- Illegal generics end at the assertions below, which need the architecture to elaborate.
  constant LANES : positive := max(1, WIDTH);
  constant BEATS : positive := max(1, (FIELD_BITS+LANES-1) / LANES);

  -- Beats enter at the highest word, so that the first one is the lowest word of a whole message.
  signal message_r : std_logic_vector(BEATS*LANES-1 downto 0);
  signal entering  : std_logic_vector((BEATS+1)*LANES-1 downto 0);
  signal valid_r   : std_logic := '0';
  signal has_room  : std_logic;

begin

  assert is_stream_width(WIDTH)
    report "firm_message_receive: WIDTH is " & integer'image(WIDTH) & "; legal: 8, 16, 32, 64, 128, 256, 512"
    severity failure;
  assert FIELD_BITS >= 1
    report "firm_message_receive: FIELD_BITS is " & integer'image(FIELD_BITS) & "; legal: 1 or more"
    severity failure;

  has_room      <= ready or not valid_r;
  s_axis_tready <= has_room;
  entering      <= s_axis_tdata & message_r;

  fields <= message_r(FIELD_BITS-1 downto 0);
  valid  <= valid_r;

  store : process (clk)
  begin
    if rising_edge(clk) then
      if has_room = '1' then
        valid_r <= s_axis_tvalid and s_axis_tlast;
        if s_axis_tvalid = '1' then
          message_r <= entering((BEATS+1)*LANES-1 downto LANES);
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process store;

end architecture rtl;
