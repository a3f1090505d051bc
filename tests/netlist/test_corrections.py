"""Corrections of a netlist add nets of their own."""

from __future__ import annotations

from fusesoc_firm.netlist.corrections import correct
from fusesoc_firm.netlist.model import Instance, Module, Net, Port


def comparison(number: int, vector: Net) -> list[Instance]:
    """`vector > 9` as GHDL writes it for an integer: extended to 32 bits; its nets are `number` and the next two."""
    extended, constant, result = Net(number, 32), Net(number + 1, 32), Net(number + 2, 1)
    return [
        Instance(f"e{number}", "$uextend", "", [], [vector], [extended]),
        Instance(f"c{number}", "$const_UB32", "", ["n=9"], [], [constant]),
        Instance(f"g{number}", "$ugt", "", [], [extended, constant], [result]),
    ]


def test_new_nets_have_numbers_of_their_own() -> None:
    """GHDL 5 numbers the ports of some modules after the gates."""
    vector, reset = Net(50, 4), Net(33, 1)
    gates = [gate for number in (20, 23, 26, 29) for gate in comparison(number, vector)]
    ports = [Port("rst_n", 1), Port("a", 4)]
    module = Module("m", inputs=ports, instances=gates, is_defined=True, arguments=[reset, vector])
    correct({"m": module})
    comparisons = [gate for gate in module.instances if gate.kind == "$ugt"]
    assert [gate.inputs[0] for gate in comparisons] == [vector] * 4
    numbers = [net.number for gate in module.instances for net in gate.outputs]
    assert len({*numbers, reset.number, vector.number}) == len(numbers) + 2
