"""Benches of one converter and of a system."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fusesoc_firm.cocotb.cycles import Cycles, Part, Stalls
from fusesoc_firm.cocotb.message_side import Fields, MessageSink, MessageSource
from fusesoc_firm.cocotb.streams import Sink, Source
from fusesoc_firm.frame.codec import decode, encode, pack_frame
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import LENGTH_BYTES, Frame
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived.model import Converter, DerivedSystem
from fusesoc_firm.system.message_sources import load_beside

LIMIT = 100_000
"""The number of cycles that a bench waits for a message."""
_BYTE_LANES = 1


class ConverterBench:
    """A bench of a converter of a message of fixed size: `send` and `receive` are at its two sides."""

    def __init__(self, dut: Any, frame: Frame, stalls: Stalls) -> None:
        if not frame.is_fixed_size:
            raise ValueError(f"{frame.message} has a variable size; test its converter in a system, with 'system'")
        self._frame, self._cycles = frame, Cycles(dut)
        fields = Fields(dut, frame)
        self._source: Source | None = None
        self._sink: Sink | None = None
        self._received: deque[Any]
        self._faults: deque[int] = deque()
        if hasattr(dut, "s_axis_tdata"):
            self._source = Source(dut, "s_axis", stalls.of_part())
            taken = MessageSink(dut, fields, stalls.of_part())
            self._has_id = len(dut.s_axis_tkeep) > _BYTE_LANES
            self._received, self._faults = taken.messages, taken.faults
            self._parts: tuple[Part, ...] = (self._source, taken)
            self._inputs = [f"s_axis_{name}" for name in ("tdata", "tkeep", "tuser", "tvalid", "tlast")] + ["msg_ready"]
        else:
            self._offered = MessageSource(dut, fields, stalls.of_part())
            self._sink = Sink(dut, "m_axis", stalls.of_part())
            self._received = self._sink.frames
            self._parts = (self._offered, self._sink)
            self._inputs = ["m_axis_tready", "segment_valid", *fields.names]

    async def start(self) -> None:
        """Drive all inputs, reset the converter, and begin."""
        await self._cycles.start(self._inputs, self._parts)

    def send(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """Send a message after the earlier ones; return it with all fields, rounded as on the wire.

        Raise `CodecError` for a value that does not fit.
        """
        payload = encode(self._frame, completed(self._frame, message))
        if self._source:
            self.send_payload(payload)
        else:
            self._offered.send(decode(self._frame, payload))
        return decode(self._frame, payload)

    def send_payload(self, payload: bytes) -> None:
        """Send any payload to a subscriber."""
        if self._source is None:
            raise ValueError("a publisher has no stream to send a payload to")
        frame = pack_frame(0, payload)
        self._source.send(frame if self._has_id else frame[1:])

    async def receive(self, limit: int = LIMIT) -> dict[str, Any]:
        """Return the next message. Raise `AssertionError` for a broken frame, and after `limit` cycles."""
        found = await self._cycles.first(self._received, limit, "no message arrived", self._check)
        return found if self._source else decode(self._frame, found[1 + LENGTH_BYTES :])

    async def receive_fault(self, limit: int = LIMIT) -> int:
        """Return the code of the next broken frame. Raise `AssertionError` after `limit` cycles."""
        code = await self._cycles.first(self._faults, limit, "no fault was reported", lambda: None)
        return int(code)

    def _check(self) -> None:
        if self._faults:
            code = self._faults.popleft()
            text = next((fault.text for fault in Fault if fault == code), "")
            raise AssertionError(f"frame_error with code {code}: {text}")
        if self._sink and self._sink.aborted:
            raise AssertionError("the publisher aborted a frame")


class SystemBench:
    """A bench of a system, as its host: `send` and `receive` name the blocks of the specification."""

    def __init__(self, dut: Any, system: DerivedSystem, stalls: Stalls) -> None:
        if not hasattr(dut, "s_axis_tdata"):
            raise ValueError("the streams of the system are not ports: simulate it without its link or network")
        if system.scheduling.is_preemptive:
            raise ValueError("the frames of a preemptive scheduler come in parts: use 'firm sim'")
        self._id_bytes = system.id_bytes
        self._subscribers = {item.block: item for item in system.subscribers}
        self._publishers = {item.block: item for item in system.publishers}
        self._clocks = [f"clk_{clock.name}" for clock in system.clocks]
        self._source = Source(dut, "s_axis", stalls.of_part())
        self._sink = Sink(dut, "m_axis", stalls.of_part())
        self._received: dict[int, deque[bytes]] = {item.id: deque() for item in system.publishers}
        self._cycles = Cycles(dut)

    async def start(self, inputs: Sequence[str]) -> None:
        """Drive all inputs of the streams, and the further `inputs`, with 0; reset the system, and begin."""
        streams = [f"s_axis_{name}" for name in ("tdata", "tkeep", "tuser", "tvalid", "tlast")] + ["m_axis_tready"]
        await self._cycles.start([*streams, *inputs], (self._source, self._sink), self._clocks)

    def send(self, block: str, message: Mapping[str, Any]) -> dict[str, Any]:
        """Send a message to a subscriber; return it with all fields, rounded as on the wire.

        Raise `CodecError` for a value that does not fit, and `ValueError` for an unknown block.
        """
        subscriber = _block(self._subscribers, block, "subscriber")
        payload = encode(subscriber.frame, completed(subscriber.frame, message))
        self._source.send(pack_frame(subscriber.id, payload, self._id_bytes))
        return decode(subscriber.frame, payload)

    def rounded(self, block: str, message: Mapping[str, Any]) -> dict[str, Any]:
        """Return a publisher's message with all fields, rounded as on the wire."""
        frame = _block(self._publishers, block, "publisher").frame
        return decode(frame, encode(frame, completed(frame, message)))

    async def receive(self, block: str, limit: int = LIMIT) -> dict[str, Any]:
        """Return the next message of a publisher. Raise `AssertionError` after `limit` cycles."""
        publisher = _block(self._publishers, block, "publisher")
        queue = self._received[publisher.id]
        frame = await self._cycles.first(queue, limit, f"'{block}' sent no message", self._sort)
        return decode(publisher.frame, frame[self._id_bytes + LENGTH_BYTES :])

    def _sort(self) -> None:
        """Give each frame to its publisher."""
        if self._sink.aborted:
            raise AssertionError("the system aborted a frame")
        while self._sink.frames:
            frame = self._sink.frames.popleft()
            number = int.from_bytes(frame[: self._id_bytes], "little")
            if number not in self._received:
                raise AssertionError(f"the system sent a frame with the unknown id {number}")
            self._received[number].append(frame)


async def converter(
    dut: Any, message: str, *, ros: int = 2, paths: Sequence[str] = (), stalls: Stalls | None = None
) -> ConverterBench:
    """Start a bench of a converter: `message` is the type's name, `paths` are folders of definitions.

    Raise `InputError` for an unknown message, and `ValueError` for a message of variable size.
    """
    name = parse_name(message)
    library = MessageLibrary(middleware_of(ros), tuple(map(Path, paths)), os.environ)
    bench = ConverterBench(dut, frame_of(name, library.closure(name)), stalls or Stalls())
    await bench.start()
    return bench


async def system(
    dut: Any, specification: str, *, inputs: Sequence[str] = (), stalls: Stalls | None = None
) -> SystemBench:
    """Start a bench of the system of a specification; its pins that are `inputs` are driven with 0.

    Raise `InputError` for a faulty specification, and `ValueError` for a system without ports of streams.
    """
    loaded = load_beside(Path(specification), needs_sources=False)
    bench = SystemBench(dut, loaded.system, stalls or Stalls())
    await bench.start(inputs)
    return bench


def _block(known: Mapping[str, Converter], block: str, what: str) -> Converter:
    if block not in known:
        raise ValueError(f"'{block}' is not a {what}; legal: {', '.join(known)}")
    return known[block]
