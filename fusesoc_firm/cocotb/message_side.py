"""The message side of a converter of fixed size: values of messages at its ports."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from fusesoc_firm.cocotb.cycles import number_of
from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.values import leaf_of, packed, put_leaf, unpacked


class Fields:
    """The ports of a message's fields."""

    def __init__(self, dut: Any, frame: Frame) -> None:
        self._ports = [(getattr(dut, port.name), port) for port in field_ports(frame)]

    @property
    def names(self) -> list[str]:
        """The names of the ports."""
        return [port.name for _, port in self._ports]

    def drive(self, message: dict[str, Any]) -> None:
        """Set the ports to the values of a whole message."""
        for handle, port in self._ports:
            handle.value = _bits(port, leaf_of(message, port.field, 0))

    def read(self) -> dict[str, Any]:
        """Return the message at the ports."""
        message: dict[str, Any] = {}
        for handle, port in self._ports:
            put_leaf(message, port.field.path, iter(_elements(port, number_of(handle))))
        return message


class MessageSource:
    """Offers messages at the ports of a publisher."""

    def __init__(self, dut: Any, fields: Fields, pauses: Callable[[], bool]) -> None:
        self._valid, self._ready = dut.segment_valid, dut.msg_ready
        self._fields, self._pauses = fields, pauses
        self._messages: deque[dict[str, Any]] = deque()
        self._is_offered = self._is_taken = False

    def send(self, message: dict[str, Any]) -> None:
        """Offer a message after the earlier ones."""
        self._messages.append(message)

    def drive(self) -> None:
        """Offer the next message, or pause; the fields stay until the frame has been sent."""
        if self._is_taken:
            self._messages.popleft()
            self._is_offered = False
        if not self._is_offered and self._messages and not self._pauses():
            self._is_offered = True
            self._fields.drive(self._messages[0])
        self._valid.value = int(self._is_offered)

    def sample(self) -> None:
        """See whether the message is taken."""
        self._is_taken = self._is_offered and bool(number_of(self._ready))


class MessageSink:
    """Takes messages from the ports of a subscriber; `messages` are the taken ones, `faults` the codes of others."""

    def __init__(self, dut: Any, fields: Fields, pauses: Callable[[], bool]) -> None:
        self._valid, self._ready = dut.msg_valid, dut.msg_ready
        self._error, self._code = dut.frame_error, dut.frame_error_code
        self._fields, self._pauses = fields, pauses
        self._is_ready = False
        self.messages: deque[dict[str, Any]] = deque()
        self.faults: deque[int] = deque()

    def drive(self) -> None:
        """Be ready, or pause."""
        self._is_ready = not self._pauses()
        self._ready.value = int(self._is_ready)

    def sample(self) -> None:
        """Take a message, and note a fault."""
        if number_of(self._error):
            self.faults.append(number_of(self._code))
        if self._is_ready and number_of(self._valid):
            self.messages.append(self._fields.read())


def _bits(port: FieldPort, values: list[Any]) -> int:
    if port.field.type.bits == 1:
        return sum(bool(value) << place for place, value in enumerate(values))
    return int.from_bytes(packed(port.field.type.code, values), "little")


def _elements(port: FieldPort, bits: int) -> list[Any]:
    type_, count = port.field.type, port.field.count
    if type_.bits == 1:
        return [bool(bits >> place & 1) for place in range(count)]
    return list(unpacked(type_.code, bits.to_bytes(count * type_.size, "little")))
