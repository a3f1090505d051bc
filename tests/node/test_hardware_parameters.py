"""The parameters of accelerators in a node: values that are refused, hardware that is reset or holds a message."""

from __future__ import annotations

import pytest

from fusesoc_firm.node.engine import hardware_parameters as module
from fusesoc_firm.node.engine.hardware_parameters import HardwareParameters
from fusesoc_firm.node.interface.description import hardware_parameters
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.system.status_frames import WRITE, answered
from fusesoc_firm.text.diagnostics import InputError

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


def test_an_illegal_first_value() -> None:
    expected = "the parameter 'filter.gain' cannot be set: 11.0 is outside of the range; legal: 0 to 10"
    with pytest.raises(InputError, match=expected):
        HardwareParameters(PARAMETERS, {"filter.gain": 11.0})
