"""The parameters of a system's accelerators, which a node sets in the hardware.

    parameters = HardwareParameters(description.parameters, {"filter.gain": 2.0})
    parameters.restore(access)                              # after each reset of the hardware
    reason = parameters.set({"filter.gain": 3.0}, access)   # "" if it is in effect

`access` passes a request of the status to the hardware and returns the word of the answer.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.system.derived.model import BlockParameter
from fusesoc_firm.system.hardware.parameters import value_address, wanted_address
from fusesoc_firm.system.status_frames import read_request, write_request
from fusesoc_firm.text.diagnostics import fail

Access = Callable[[bytes], int]
# A value takes effect when the accelerator has accepted its message.
_EFFECT_SECONDS = 2.0
_AGAIN_SECONDS = 0.002


class HardwareParameters:
    """The values of all parameters; the hardware begins with the defaults after each reset."""

    def __init__(self, parameters: Sequence[BlockParameter], values: Mapping[str, Any]) -> None:
        """Use these first values. Raise `InputError` for an illegal one."""
        self.parameters = {item.name: item for item in parameters}
        self.values: dict[str, Any] = {item.name: item.parameter.default for item in parameters}
        self._lock = threading.Lock()
        for name, value in values.items():
            if reason := self._fault(name, value):
                fail(f"the parameter '{name}' cannot be set: {reason}")
            self.values[name] = value

    def restore(self, access: Access) -> None:
        """Set all values in hardware after a reset. May raise `TransportError`."""
        with self._lock:
            for name, value in self.values.items():
                if value != self.parameters[name].parameter.default:
                    self._put(name, value, access)

    def set(self, values: Mapping[str, Any], access: Access) -> str:
        """Set values, all or none; return the reason why they are refused, or an empty text."""
        for name, value in values.items():
            if reason := self._fault(name, value):
                return reason
        with self._lock:
            before = {name: self.values[name] for name in values}
            try:
                for name, value in values.items():
                    self._put(name, value, access)
            except TransportError as error:
                return self._undone(before, access, str(error))
            self.values.update(values)
        return ""

    def _undone(self, before: Mapping[str, Any], access: Access, reason: str) -> str:
        """Want the values from before; return the reason of the failure."""
        try:
            for name, value in before.items():
                item = self.parameters[name]
                access(write_request(wanted_address(item.number), item.parameter.word(value)))
        except TransportError as error:
            return f"{reason}; {error}"
        return reason

    def _fault(self, name: str, value: Any) -> str:
        try:
            self.parameters[name].parameter.word(value)
        except ValueError as error:
            return str(error)
        return ""

    def _put(self, name: str, value: Any, access: Access) -> None:
        """Write a value, and wait until it is in effect. Raise `TransportError` if it is not, after some time."""
        item = self.parameters[name]
        word = item.parameter.word(value)
        access(write_request(wanted_address(item.number), word))
        end = time.monotonic() + _EFFECT_SECONDS
        while access(read_request(value_address(item.number))) != word:
            if time.monotonic() > end:
                raise TransportError(f"'{item.block}' holds a message, so '{name}' is not in effect")
            time.sleep(_AGAIN_SECONDS)
