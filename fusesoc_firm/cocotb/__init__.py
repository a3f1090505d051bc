"""Test benches in cocotb for converters and systems, as values of messages (docs/how-to/test-with-cocotb.md).

    import cocotb
    from fusesoc_firm.cocotb import converter

    @cocotb.test()
    async def a_point_arrives(dut):
        point = await converter(dut, "geometry_msgs/Point")
        sent = point.send({"x": 1.0, "y": -2.5})
        assert await point.receive() == sent

Works with cocotb 1.9 and 2, in GHDL, Icarus Verilog and Verilator.
"""

from fusesoc_firm.cocotb.benches import ConverterBench, SystemBench, converter, system
from fusesoc_firm.cocotb.cycles import Stalls

__all__ = ["ConverterBench", "Stalls", "SystemBench", "converter", "system"]
