-- The records of aborted frames, between the two streams of a simulated host at the end of a pipe.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity abort_record_bench is
  generic (
    WIDTH         : integer := 8;
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0
  );
end entity;

architecture simulation of abort_record_bench is

  signal clk, rst_n : std_logic;

  signal in_tdata, out_tdata   : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep, out_tkeep   : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tuser              : std_logic_vector(0 downto 0);
  signal in_tid, out_tid       : std_logic_vector(7 downto 0);
  signal in_tvalid, out_tvalid : std_logic;
  signal in_tlast, out_tlast   : std_logic;
  signal in_tready, out_tready : std_logic;

begin

  u_host : entity firm.firm_sim_pipe
    generic map (WIDTH => WIDTH, SEED => SEED, STALL_PERCENT => STALL_PERCENT)
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => in_tdata,
      m_axis_tkeep  => in_tkeep,
      m_axis_tuser  => in_tuser,
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready,
      s_axis_tdata  => out_tdata,
      s_axis_tkeep  => out_tkeep,
      s_axis_tid    => out_tid,
      s_axis_tvalid => out_tvalid,
      s_axis_tlast  => out_tlast,
      s_axis_tready => out_tready
    );

  u_in_tid : entity firm.firm_sim_tid
    generic map (WIDTH => WIDTH)
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => in_tdata,
      axis_tvalid => in_tvalid,
      axis_tlast  => in_tlast,
      axis_tready => in_tready,
      axis_tid    => in_tid
    );

  u_out_tid : entity firm.firm_sim_tid
    generic map (WIDTH => WIDTH)
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => out_tdata,
      axis_tvalid => out_tvalid,
      axis_tlast  => out_tlast,
      axis_tready => out_tready,
      axis_tid    => out_tid
    );

  u_records : entity firm.firm_axis_abort_record
    generic map (WIDTH => WIDTH)
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => in_tdata,
      s_axis_tkeep  => in_tkeep,
      s_axis_tuser  => in_tuser,
      s_axis_tid    => in_tid,
      s_axis_tvalid => in_tvalid,
      s_axis_tlast  => in_tlast,
      s_axis_tready => in_tready,
      m_axis_tdata  => out_tdata,
      m_axis_tkeep  => out_tkeep,
      m_axis_tvalid => out_tvalid,
      m_axis_tlast  => out_tlast,
      m_axis_tready => out_tready
    );

  u_check : entity firm.firm_axis_checker
    generic map (WIDTH => WIDTH, NAME => "out", LEVEL => failure)
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => out_tdata,
      axis_tkeep  => out_tkeep,
      axis_tvalid => out_tvalid,
      axis_tlast  => out_tlast,
      axis_tready => out_tready
    );

end architecture;
