# What the IP of Vivado is like that block designs use: pins, interfaces and properties.
#
# Each `ip NAME {...}` lists, with its source, what is used here and what may be mistaken for it. Where a guide does not
# list the names of parameters and pins, they are those of scripts of public projects, many of them written by Vivado.
#
#   property NAME DEFAULT LEGAL              LEGAL is a list of values, or a range of numbers as {LOW .. HIGH}
#   pin NAME I|O KIND WIDTH ?CONDITION?      KIND is data, clock or reset_n; a width may be {LOW .. HIGH}
#   interface NAME master|slave ?CONDITION?  memory-mapped AXI of any kind
#   space NAME, segment NAME                 of addresses: what a master sees, what a slave gives
#   rule CONDITION                           between properties
#   automation SETTINGS                      of its rule of block automation
#
# Widths and conditions are expressions of properties. Input clocks and resets have to be connected unless KIND ends
# with '?'; an interface has to be if it is there.

# PG082 (Processing System 7, 5.5) and UG585; names as in presets of boards. One master is on unless it is switched off.
ip processing_system7 {
  foreach number {0 1 2 3} {
    property PCW_EN_CLK${number}_PORT [expr {$number == 0}] {0 1}
    property PCW_FPGA${number}_PERIPHERAL_FREQMHZ 50 {0.1 .. 250}
    pin FCLK_CLK$number O clock 1 "\$PCW_EN_CLK${number}_PORT"
  }
  pin FCLK_RESET0_N O reset_n 1
  foreach {number default} {0 1 1 0} {
    property PCW_USE_M_AXI_GP$number $default {0 1}
    interface M_AXI_GP$number master "\$PCW_USE_M_AXI_GP$number"
    pin M_AXI_GP${number}_ACLK I clock 1 "\$PCW_USE_M_AXI_GP$number"
  }
  foreach number {0 1 2 3} {
    property PCW_USE_S_AXI_HP$number 0 {0 1}
    interface S_AXI_HP$number slave "\$PCW_USE_S_AXI_HP$number"
    pin S_AXI_HP${number}_ACLK I clock 1 "\$PCW_USE_S_AXI_HP$number"
  }
  property PCW_USE_FABRIC_INTERRUPT 0 {0 1}
  property PCW_IRQ_F2P_INTR 0 {0 1}
  pin IRQ_F2P I data {1 .. 16} {$PCW_USE_FABRIC_INTERRUPT && $PCW_IRQ_F2P_INTR}
  space Data
  automation {make_external {"FIXED_IO, DDR"} apply_board_preset {0 1} Master {Disable} Slave {Disable}}
}

# PG201 (Zynq UltraScale+ MPSoC Processing System, 3.5) and UG1085. Two masters are on unless they are switched off. The
# limit of frequencies is only there to find a wrong unit.
ip zynq_ultra_ps_e {
  foreach number {0 1 2 3} {
    property PSU__FPGA_PL${number}_ENABLE [expr {$number == 0}] {0 1}
    property PSU__CRL_APB__PL${number}_REF_CTRL__FREQMHZ 100 {0.1 .. 600}
    pin pl_clk$number O clock 1 "\$PSU__FPGA_PL${number}_ENABLE"
  }
  pin pl_resetn0 O reset_n 1
  foreach {number name clock default} {
    0 M_AXI_HPM0_FPD maxihpm0_fpd_aclk 1
    1 M_AXI_HPM1_FPD maxihpm1_fpd_aclk 1
    2 M_AXI_HPM0_LPD maxihpm0_lpd_aclk 0
  } {
    property PSU__USE__M_AXI_GP$number $default {0 1}
    interface $name master "\$PSU__USE__M_AXI_GP$number"
    pin $clock I clock 1 "\$PSU__USE__M_AXI_GP$number"
  }
  foreach {number name clock} {
    0 S_AXI_HPC0_FPD saxihpc0_fpd_aclk
    1 S_AXI_HPC1_FPD saxihpc1_fpd_aclk
    2 S_AXI_HP0_FPD saxihp0_fpd_aclk
    3 S_AXI_HP1_FPD saxihp1_fpd_aclk
  } {
    property PSU__USE__S_AXI_GP$number 0 {0 1}
    interface $name slave "\$PSU__USE__S_AXI_GP$number"
    pin $clock I clock 1 "\$PSU__USE__S_AXI_GP$number"
  }
  property PSU__USE__IRQ0 0 {0 1}
  pin pl_ps_irq0 I data {1 .. 8} {$PSU__USE__IRQ0}
  space Data
  automation {apply_board_preset {0 1}}
}

# PG021 (AXI DMA, 7.1): User Parameters, Port Descriptions.
ip axi_dma {
  property c_include_sg 1 {0 1}
  property c_sg_include_stscntrl_strm 1 {0 1}
  property c_sg_length_width 14 {8 .. 26}
  property c_addr_width 32 {32 .. 64}
  property c_m_axi_mm2s_data_width 32 {32 64 128 256 512 1024}
  property c_m_axis_mm2s_tdata_width 32 {8 16 32 64 128 256 512 1024}
  property c_m_axi_s2mm_data_width 32 {32 64 128 256 512 1024}
  property c_s_axis_s2mm_tdata_width 32 {8 16 32 64 128 256 512 1024}
  rule {$c_m_axis_mm2s_tdata_width <= $c_m_axi_mm2s_data_width}
  rule {$c_s_axis_s2mm_tdata_width <= $c_m_axi_s2mm_data_width}
  pin s_axi_lite_aclk I clock 1
  pin m_axi_sg_aclk I clock 1 {$c_include_sg}
  pin m_axi_mm2s_aclk I clock 1
  pin m_axi_s2mm_aclk I clock 1
  pin axi_resetn I reset_n 1
  pin mm2s_prmry_reset_out_n O reset_n 1
  pin s2mm_prmry_reset_out_n O reset_n 1
  pin mm2s_introut O data 1
  pin s2mm_introut O data 1
  foreach {name from to width} {
    m_axis_mm2s O I $c_m_axis_mm2s_tdata_width
    s_axis_s2mm I O $c_s_axis_s2mm_tdata_width
  } {
    pin ${name}_tdata $from data $width
    pin ${name}_tkeep $from data "$width / 8"
    pin ${name}_tvalid $from data 1
    pin ${name}_tlast $from data 1
    pin ${name}_tready $to data 1
  }
  interface S_AXI_LITE slave
  interface M_AXI_SG master {$c_include_sg}
  interface M_AXI_MM2S master
  interface M_AXI_S2MM master
  segment S_AXI_LITE/Reg
}

# PG247 (SmartConnect, 1.0): Design Parameters, Global Port Signals.
ip smartconnect {
  property NUM_SI 2 {1 .. 16}
  property NUM_MI 1 {1 .. 16}
  property NUM_CLKS 1 {1 .. 33}
  property HAS_ARESETN 1 {0 1}
  pin aclk I clock 1
  pin aresetn I reset_n 1 {$HAS_ARESETN}
  for {set number 0} {$number < 16} {incr number} {
    interface [format S%02d_AXI $number] slave "\$NUM_SI > $number"
    interface [format M%02d_AXI $number] master "\$NUM_MI > $number"
  }
}

# PG164 (Processor System Reset Module, 5.0): Port Descriptions, Design Parameters.
ip proc_sys_reset {
  property C_EXT_RST_WIDTH 4 {1 .. 16}
  property C_AUX_RST_WIDTH 4 {1 .. 16}
  property C_EXT_RESET_HIGH 1 {0 1}
  property C_AUX_RESET_HIGH 1 {0 1}
  pin slowest_sync_clk I clock 1
  # Vivado sets C_EXT_RESET_HIGH by what is connected.
  pin ext_reset_in I reset_n 1
  # Its polarity is a parameter. What is connected here is low, so the pin is there for one that is low.
  pin aux_reset_in I reset_n? 1 {!$C_AUX_RESET_HIGH}
  pin mb_reset O data 1
  pin bus_struct_reset O data 1
  pin peripheral_reset O data 1
  pin interconnect_aresetn O reset_n 1
  pin peripheral_aresetn O reset_n 1
}

# PB041 (Concat, 2.1); UG994 for the inline utility with the same properties and pins.
foreach name {xlconcat ilconcat} {
  ip $name {
    property NUM_PORTS 2 {1 .. 32}
    for {set number 0} {$number < 32} {incr number} {
      pin In$number I data 1 "\$NUM_PORTS > $number"
    }
    pin dout O data {$NUM_PORTS}
  }
}
