"""The processors in FPGAs as Vivado blocks: the names of IPs, pins and properties.

Sources: Zynq-7000, PG082 (Processing System 7) and UG585; Zynq UltraScale+, PG201 and UG1085.
"""

from __future__ import annotations

from dataclasses import dataclass

# The number of clocks that a processor provides for the logic.
MOST_CLOCKS = 4


@dataclass(frozen=True)
class Processor:
    """A processor in an FPGA; in names, `{}` is a placeholder for the number of a clock, counted from 0.

    `clock` is a clock's pin and `timing_clock` the clock's name in timing constraints. `frequency` and `clock_switch`
    are properties of the clock. `control` is the master for registers; `base` is the address of the DMA engine's
    registers. `memory` is the `memory_width`-bit slave through which the engine accesses the processor's memory. Master
    and slave are listed with their clock pins.
    """

    ip: str
    automation: str
    clock: str
    timing_clock: str
    frequency: str
    clock_switch: str
    reset: str
    control: str
    control_clock: str
    memory: str
    memory_clock: str
    memory_width: int
    interrupts: str
    properties: tuple[tuple[str, int], ...]
    base: str


PROCESSORS = {
    "zynq7000": Processor(
        ip="processing_system7",
        automation='make_external "FIXED_IO, DDR" Master "Disable" Slave "Disable"',
        clock="FCLK_CLK{}",
        timing_clock="clk_fpga_{}",
        frequency="PCW_FPGA{}_PERIPHERAL_FREQMHZ",
        clock_switch="PCW_EN_CLK{}_PORT",
        reset="FCLK_RESET0_N",
        control="M_AXI_GP0",
        control_clock="M_AXI_GP0_ACLK",
        memory="S_AXI_HP0",
        memory_clock="S_AXI_HP0_ACLK",
        memory_width=64,
        interrupts="IRQ_F2P",
        properties=(
            ("PCW_USE_M_AXI_GP0", 1),
            ("PCW_USE_M_AXI_GP1", 0),
            ("PCW_USE_S_AXI_HP0", 1),
            ("PCW_USE_FABRIC_INTERRUPT", 1),
            ("PCW_IRQ_F2P_INTR", 1),
        ),
        base="0x40400000",
    ),
    "zynqmp": Processor(
        ip="zynq_ultra_ps_e",
        automation="",
        clock="pl_clk{}",
        timing_clock="clk_pl_{}",
        frequency="PSU__CRL_APB__PL{}_REF_CTRL__FREQMHZ",
        clock_switch="PSU__FPGA_PL{}_ENABLE",
        reset="pl_resetn0",
        control="M_AXI_HPM0_FPD",
        control_clock="maxihpm0_fpd_aclk",
        memory="S_AXI_HP0_FPD",
        memory_clock="saxihp0_fpd_aclk",
        memory_width=128,
        interrupts="pl_ps_irq0",
        # Boards' presets enable masters that are not connected here.
        properties=(
            ("PSU__USE__M_AXI_GP0", 1),
            ("PSU__USE__M_AXI_GP1", 0),
            ("PSU__USE__M_AXI_GP2", 0),
            ("PSU__USE__S_AXI_GP2", 1),
            ("PSU__USE__IRQ0", 1),
        ),
        base="0xA0000000",
    ),
}
