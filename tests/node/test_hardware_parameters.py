"""The parameters of accelerators in a node: values that are refused, hardware that is reset or holds a message."""

from __future__ import annotations

import random
import struct
import subprocess
from contextlib import nullcontext
from pathlib import Path
from typing import Any, cast

import pytest
import yaml

from fusesoc_firm.node.engine import hardware_parameters as module
from fusesoc_firm.node.engine.hardware_parameters import HardwareParameters
from fusesoc_firm.node.interface.description import NodeDescription, hardware_parameters
from fusesoc_firm.node.node import HardwareListener
from fusesoc_firm.node.reopening import checked
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.system.status_frames import WRITE, answered, status_answer
from fusesoc_firm.text.diagnostics import InputError
from tests.node.drivers import compile_c_driver, cpp_driver
from tests.seeds import seeded

PARAMETERS = hardware_parameters(
    ("filter", "gain", "float32", 1.0, 0.0, 10.0),
    ("filter", "order", "uint8", 2, 1, 8),
)
GAIN, ORDER = 0x100, 0x108
ONE = 0x3F800000


class Hardware:
    """Registers of two parameters; a block that `holds` a message lets no value take effect."""

    def __init__(self, most_accesses: int = 10**6) -> None:
        self.holds = False
        self._left = most_accesses
        self.reset()

    def reset(self) -> None:
        self.words = {GAIN: ONE, GAIN + 4: ONE, ORDER: 2, ORDER + 4: 2}

    def access(self, request: bytes) -> int:
        self._left -= 1
        if self._left < 0:
            raise TransportError("no answer")
        found = answered(request)
        assert found
        address = found[0] & ~WRITE
        before = self.words[address]
        if found[0] & WRITE:
            self.words[address] = found[1]
            if not self.holds:
                self.words[address + 4] = found[1]
        return before


def test_a_value_is_in_effect_when_it_is_set() -> None:
    hardware, parameters = Hardware(), HardwareParameters(PARAMETERS, {})
    assert parameters.set({"filter.gain": 2.0, "filter.order": 8}, hardware.access) == ""
    assert hardware.words == {GAIN: 0x40000000, GAIN + 4: 0x40000000, ORDER: 8, ORDER + 4: 8}
    hardware.reset()
    parameters.restore(hardware.access)
    assert hardware.words[GAIN + 4] == 0x40000000
    assert hardware.words[ORDER + 4] == 8


def test_all_or_none_are_set() -> None:
    hardware, parameters = Hardware(), HardwareParameters(PARAMETERS, {})
    reason = parameters.set({"filter.gain": 2.0, "filter.order": 9}, hardware.access)
    assert reason == "9 is outside of the range; legal: 1 to 8"
    assert hardware.words[GAIN] == ONE
    assert parameters.values == {"filter.gain": 1.0, "filter.order": 2}


def test_a_block_that_holds_a_message_keeps_its_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_EFFECT_SECONDS", 0.05)
    hardware, parameters = Hardware(), HardwareParameters(PARAMETERS, {})
    hardware.holds = True
    reason = parameters.set({"filter.gain": 2.0}, hardware.access)
    assert reason == "'filter' holds a message, so 'filter.gain' is not in effect"
    assert hardware.words == {GAIN: ONE, GAIN + 4: ONE, ORDER: 2, ORDER + 4: 2}
    assert parameters.values["filter.gain"] == 1.0


def test_hardware_that_does_not_answer() -> None:
    hardware, parameters = Hardware(most_accesses=2), HardwareParameters(PARAMETERS, {})
    reason = parameters.set({"filter.gain": 2.0, "filter.order": 4}, hardware.access)
    assert reason == "no answer; no answer"
    assert parameters.values == {"filter.gain": 1.0, "filter.order": 2}


def test_a_node_without_access_to_the_registers() -> None:
    """A simulator of a system with registers for AXI4-Lite has none; defaults need no access."""
    description = NodeDescription("robot", 8, (), (), (), digest="0" * 32, has_status_registers=True)
    opened: list[HardwareListener] = []

    def open_transport(listener: HardwareListener) -> Any:
        opened.append(listener)

    for values, is_legal in (({}, True), ({"filter.gain": 1.0}, True), ({"filter.gain": 2.0}, False)):
        opener = checked(open_transport, description, parameters=HardwareParameters(PARAMETERS, values))
        opened.clear()
        with nullcontext() if is_legal else pytest.raises(TransportError, match="the node has no access to the reg"):
            opener(cast("HardwareListener", None))
        assert bool(opened) == is_legal


def test_an_illegal_first_value() -> None:
    expected = "the parameter 'filter.gain' cannot be set: 11.0 is outside of the range; legal: 0 to 10"
    with pytest.raises(InputError, match=expected):
        HardwareParameters(PARAMETERS, {"filter.gain": 11.0})


# --- other languages -------------------------------------------------------------------------------------------------


@pytest.mark.one_in(2)
def test_cpp_takes_and_refuses_the_same() -> None:
    """Values of all types, in ranges and beyond, and hardware that answers a limited number of accesses."""
    chance = random.Random(seeded(20261201))
    cases = [case(chance) for _ in range(300)]
    lines = [" ".join(map(str, (*parameter, text, accesses))) for parameter, text, accesses in cases]
    for (parameter, text, accesses), line in zip(cases, cpp_driver("parameters").answers(lines), strict=True):
        (made,) = hardware_parameters(("block", "value", *parameter))
        word = made.parameter.word(bool(made.parameter.default) if parameter[0] == "bool" else made.parameter.default)
        hardware = Hardware(accesses)
        hardware.words = {GAIN: word, GAIN + 4: word}
        parameters = HardwareParameters([made], {})
        reason = parameters.set({"block.value": yaml.safe_load(text)}, hardware.access)
        found, value, told = line.split(" ", 2)
        assert int(found) == hardware.words[GAIN + 4], (parameter, text, accesses, line)
        assert float(value) == float(parameters.values["block.value"]), (parameter, text, accesses, line)
        assert bool(told) == bool(reason), (parameter, text, accesses, line)
        assert told.partition("; legal")[2] == reason.partition("; legal")[2]


def case(chance: random.Random) -> tuple[tuple[str, float, float, float], str, int]:
    """A parameter as type, default and range, the text of a value, and a number of accesses."""
    type_ = chance.choice(["bool", "int8", "uint8", "int16", "uint16", "int32", "uint32", "float32"])
    if type_ == "bool":
        return (type_, chance.randint(0, 1), 0, 1), chance.choice(["true", "false", "1", "0.5"]), 9
    if type_ == "float32":
        numbers = sorted(struct.unpack("<3f", struct.pack("<3f", *(chance.uniform(-100, 100) for _ in range(3)))))
        text = chance.choice(["true", "7", repr(chance.uniform(-150, 150)), repr(numbers[0]), "-0.0"])
        return (type_, numbers[1], numbers[0], numbers[2]), text, chance.choice([0, 1, 9])
    least = 0 if type_[0] == "u" else -100
    numbers = sorted(chance.randint(least, 100) for _ in range(3))
    text = chance.choice(["true", "2.5", str(chance.randint(-150, 150)), str(numbers[2])])
    return (type_, numbers[1], numbers[0], numbers[2]), text, chance.choice([0, 1, 9])


def test_c_sets_a_parameter(tmp_path: Path) -> None:
    sources = ["firm/firm_frame.c", "firm/firm_status.c"]
    driver = compile_c_driver("parameters", tmp_path, sources, [], {})
    hardware = Hardware()
    command: list[str | Path] = [driver.program, "1", "7"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdin and program.stdout
        for line in program.stdout:
            if line.startswith("="):
                assert line == "= effect 7\n"
                continue
            request = bytes.fromhex(line)
            asked = answered(request)
            assert asked
            program.stdin.write(f"{status_answer(asked[0], hardware.access(request)).hex()}\n")
            program.stdin.flush()
    assert program.returncode == 0
    assert hardware.words[ORDER + 4] == 7
