-- SPDX-License-Identifier: Apache-2.0
-- All parts of an accelerator for sensor_msgs/Image except the pixel processing: it receives and sends the message,
-- outputs the pixels as groups, and receives the results as bytes. No image is stored; only the beats in the window and
-- in the packer wait, so pixels leave at the rate at which they arrive.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;

entity firm_image_frame is
  generic (
    WIDTH        : integer := 8;
    GROUP_BYTES  : integer := 1;
    IN_ENCODING  : string  := "mono8";
    OUT_ENCODING : string  := "mono8";
    IN_BYTES     : integer := 1;
    OUT_BYTES    : integer := 1;
    COLUMNS_IN   : integer := 1;
    COLUMNS_OUT  : integer := 1;
    ROWS_IN      : integer := 1;
    ROWS_OUT     : integer := 1;
    MAX_COLUMNS  : integer := 65535
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    in_header_frame_id_length      : in  std_logic_vector(31 downto 0);
    in_header_frame_id_axis_tdata  : in  std_logic_vector(WIDTH-1 downto 0);
    in_header_frame_id_axis_tkeep  : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_header_frame_id_axis_tvalid : in  std_logic;
    in_header_frame_id_axis_tlast  : in  std_logic;
    in_header_frame_id_axis_tready : out std_logic;
    in_height                      : in  std_logic_vector(31 downto 0);
    in_width                       : in  std_logic_vector(31 downto 0);
    in_encoding_length             : in  std_logic_vector(31 downto 0);
    in_encoding_axis_tdata         : in  std_logic_vector(WIDTH-1 downto 0);
    in_encoding_axis_tvalid        : in  std_logic;
    in_encoding_axis_tlast         : in  std_logic;
    in_encoding_axis_tready        : out std_logic;
    in_step                        : in  std_logic_vector(31 downto 0);
    in_data_length                 : in  std_logic_vector(31 downto 0);
    in_data_axis_tdata             : in  std_logic_vector(WIDTH-1 downto 0);
    in_data_axis_tkeep             : in  std_logic_vector(WIDTH/8-1 downto 0);
    in_data_axis_tvalid            : in  std_logic;
    in_data_axis_tlast             : in  std_logic;
    in_data_axis_tready            : out std_logic;
    in_segment_valid               : in  std_logic_vector(2 downto 0);
    in_msg_valid                   : in  std_logic;
    in_msg_ready                   : out std_logic;

    out_header_frame_id_length      : out std_logic_vector(31 downto 0);
    out_header_frame_id_axis_tdata  : out std_logic_vector(WIDTH-1 downto 0);
    out_header_frame_id_axis_tkeep  : out std_logic_vector(WIDTH/8-1 downto 0);
    out_header_frame_id_axis_tvalid : out std_logic;
    out_header_frame_id_axis_tlast  : out std_logic;
    out_header_frame_id_axis_tready : in  std_logic;
    out_height                      : out std_logic_vector(31 downto 0);
    out_width                       : out std_logic_vector(31 downto 0);
    out_encoding_length             : out std_logic_vector(31 downto 0);
    out_encoding_axis_tdata         : out std_logic_vector(WIDTH-1 downto 0);
    out_encoding_axis_tkeep         : out std_logic_vector(WIDTH/8-1 downto 0);
    out_encoding_axis_tvalid        : out std_logic;
    out_encoding_axis_tlast         : out std_logic;
    out_encoding_axis_tready        : in  std_logic;
    out_step                        : out std_logic_vector(31 downto 0);
    out_data_length                 : out std_logic_vector(31 downto 0);
    out_data_axis_tdata             : out std_logic_vector(WIDTH-1 downto 0);
    out_data_axis_tkeep             : out std_logic_vector(WIDTH/8-1 downto 0);
    out_data_axis_tvalid            : out std_logic;
    out_data_axis_tlast             : out std_logic;
    out_data_axis_tready            : in  std_logic;
    out_segment_valid               : out std_logic_vector(2 downto 0);
    out_msg_valid                   : out std_logic;
    out_msg_ready                   : in  std_logic;

    -- High while the pixels of an image pass: low is a reset for all state that depends on pixels.
    run : out std_logic;

    -- As at firm_image_rows.
    group_data  : out std_logic_vector(WIDTH-1 downto 0);
    group_count : out std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    group_first : out std_logic;
    group_last  : out std_logic;
    group_final : out std_logic;
    group_end   : out std_logic;
    group_valid : out std_logic;
    group_ready : in  std_logic;

    -- The processed pixels, as at firm_axis_pack; `result_last` follows `group_end`, without bytes. It may also arrive
    -- with the image's last bytes, which then do not wait for it.
    result_data  : in  std_logic_vector(WIDTH-1 downto 0);
    result_count : in  std_logic_vector(clog2(WIDTH/8+1)-1 downto 0);
    result_last  : in  std_logic;
    result_valid : in  std_logic;
    result_ready : out std_logic
  );
end entity firm_image_frame;

architecture rtl of firm_image_frame is

  signal running   : std_logic;
  signal is_empty  : std_logic;
  signal has_none  : std_logic;
  signal row_bytes : std_logic_vector(17 downto 0);
  signal padding   : std_logic_vector(31 downto 0);
  signal rows      : std_logic_vector(15 downto 0);
  signal show      : std_logic;
  signal done_r    : std_logic;

  signal data_valid   : std_logic;
  signal data_ready   : std_logic;
  signal packed_valid : std_logic;
  signal packed_last  : std_logic;
  signal packed_ready : std_logic;

begin

  u_header : entity firm.firm_image_header
    generic map (
      WIDTH        => WIDTH,
      IN_ENCODING  => IN_ENCODING,
      OUT_ENCODING => OUT_ENCODING,
      IN_BYTES     => IN_BYTES,
      OUT_BYTES    => OUT_BYTES,
      COLUMNS_IN   => COLUMNS_IN,
      COLUMNS_OUT  => COLUMNS_OUT,
      ROWS_IN      => ROWS_IN,
      ROWS_OUT     => ROWS_OUT,
      MAX_COLUMNS  => MAX_COLUMNS
    )
    port map (
      clk                             => clk,
      rst_n                           => rst_n,
      in_header_frame_id_length       => in_header_frame_id_length,
      in_header_frame_id_axis_tdata   => in_header_frame_id_axis_tdata,
      in_header_frame_id_axis_tkeep   => in_header_frame_id_axis_tkeep,
      in_header_frame_id_axis_tvalid  => in_header_frame_id_axis_tvalid,
      in_header_frame_id_axis_tlast   => in_header_frame_id_axis_tlast,
      in_header_frame_id_axis_tready  => in_header_frame_id_axis_tready,
      in_height                       => in_height,
      in_width                        => in_width,
      in_encoding_length              => in_encoding_length,
      in_encoding_axis_tdata          => in_encoding_axis_tdata,
      in_encoding_axis_tvalid         => in_encoding_axis_tvalid,
      in_encoding_axis_tlast          => in_encoding_axis_tlast,
      in_encoding_axis_tready         => in_encoding_axis_tready,
      in_step                         => in_step,
      in_data_length                  => in_data_length,
      in_segment_valid                => in_segment_valid,
      in_msg_valid                    => in_msg_valid,
      in_msg_ready                    => in_msg_ready,
      out_header_frame_id_length      => out_header_frame_id_length,
      out_header_frame_id_axis_tdata  => out_header_frame_id_axis_tdata,
      out_header_frame_id_axis_tkeep  => out_header_frame_id_axis_tkeep,
      out_header_frame_id_axis_tvalid => out_header_frame_id_axis_tvalid,
      out_header_frame_id_axis_tlast  => out_header_frame_id_axis_tlast,
      out_header_frame_id_axis_tready => out_header_frame_id_axis_tready,
      out_height                      => out_height,
      out_width                       => out_width,
      out_encoding_length             => out_encoding_length,
      out_encoding_axis_tdata         => out_encoding_axis_tdata,
      out_encoding_axis_tkeep         => out_encoding_axis_tkeep,
      out_encoding_axis_tvalid        => out_encoding_axis_tvalid,
      out_encoding_axis_tlast         => out_encoding_axis_tlast,
      out_encoding_axis_tready        => out_encoding_axis_tready,
      out_step                        => out_step,
      out_data_length                 => out_data_length,
      out_segment_valid               => out_segment_valid,
      out_msg_valid                   => out_msg_valid,
      out_msg_ready                   => out_msg_ready,
      run                             => running,
      is_empty                        => is_empty,
      has_none                        => has_none,
      row_bytes                       => row_bytes,
      padding                         => padding,
      rows                            => rows,
      show                            => show,
      done                            => done_r
    );

  data_valid          <= in_data_axis_tvalid and running;
  in_data_axis_tready <= data_ready and running;

  u_rows : entity firm.firm_image_rows
    generic map (
      WIDTH       => WIDTH,
      GROUP_BYTES => GROUP_BYTES
    )
    port map (
      clk           => clk,
      rst_n         => running,
      is_empty      => is_empty,
      row_bytes     => row_bytes,
      padding       => padding,
      rows          => rows,
      s_axis_tdata  => in_data_axis_tdata,
      s_axis_tkeep  => in_data_axis_tkeep,
      s_axis_tvalid => data_valid,
      s_axis_tlast  => in_data_axis_tlast,
      s_axis_tready => data_ready,
      group_data    => group_data,
      group_count   => group_count,
      group_first   => group_first,
      group_last    => group_last,
      group_final   => group_final,
      group_end     => group_end,
      group_valid   => group_valid,
      group_ready   => group_ready
    );

  u_pack : entity firm.firm_axis_pack
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => running,
      data          => result_data,
      count         => result_count,
      last          => result_last,
      valid         => result_valid,
      ready         => result_ready,
      m_axis_tdata  => out_data_axis_tdata,
      m_axis_tkeep  => out_data_axis_tkeep,
      m_axis_tvalid => packed_valid,
      m_axis_tlast  => packed_last,
      m_axis_tready => packed_ready
    );

  packed_ready         <= out_data_axis_tready and show;
  out_data_axis_tvalid <= packed_valid and show;
  out_data_axis_tlast  <= packed_last;
  run                  <= running;

  -- Without a pixel, nothing is packed.
  note_end : process (clk)
  begin
    if rising_edge(clk) then
      if running = '0' then
        done_r <= '0';
      elsif (packed_valid = '1' and packed_last = '1' and packed_ready = '1')
         or (has_none = '1' and result_valid = '1' and result_last = '1') then
        done_r <= '1';
      end if;
    end if;
  end process note_end;

end architecture rtl;
