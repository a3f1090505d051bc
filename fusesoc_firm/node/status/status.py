"""Read and write the status of hardware over a transport, by frames of the status id.

    status = read_status(transport)
    print(status_text(status))

The hardware reports its dimensions, which determine its register map, so no specification is needed. Only the size of
ids must be known: `id_bytes`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle, islice

from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.frame.model import ID_BYTES
from fusesoc_firm.node.status.status_exchange import NO_ANSWER
from fusesoc_firm.node.transport.transport import Transport, TransportError
from fusesoc_firm.system.derived.model import BlockParameter
from fusesoc_firm.system.hardware.parameters import value_address, wanted_address
from fusesoc_firm.system.hardware.registers import Register
from fusesoc_firm.system.hardware.status import (
    DIGEST_ADDRESS,
    DIGEST_WORDS,
    ENDPOINT_WORDS,
    ENDPOINTS_ADDRESS,
    Features,
    Part,
    endpoint_register,
    network_words,
    status_map,
)
from fusesoc_firm.system.status_frames import answered, read_request, write_request

# A simulator may have to start first, on a busy machine.
_ANSWER_SECONDS = 20.0
_MAGIC = 0x4D524946
_VERSION = 1
_SHAPE_ADDRESS, _FEATURES_ADDRESS = 0x04, 0x28
_KNOWN_PARTS = sum(part.value for part in Part)
_EVENTS = {"id_errors": "unknown ids", "link_errors": "link errors", "lost": "uncounted faults"}
_WORDS = ("signature", "frames", "longest_wait", "stamp")
_CHANNEL_WORDS = {"frames": "frames", "longest_wait": "longest wait in cycles"}
# The highest word first.
_DIGEST_ADDRESSES = tuple(DIGEST_ADDRESS + 4 * number for number in reversed(range(DIGEST_WORDS)))


@dataclass(frozen=True)
class Status:
    """The words of all registers by name, with the registers that give them a meaning."""

    registers: Mapping[str, Register]
    words: Mapping[str, int]

    @property
    def digest(self) -> str:
        """The digest of the hardware's system, in hexadecimal digits."""
        return "".join(f"{self.words[f'digest_{number}']:08x}" for number in reversed(range(DIGEST_WORDS)))

    @property
    def has_time_stamps(self) -> bool:
        """Whether the words `cycles`, and `stamp` of each channel, exist."""
        return "cycles" in self.words

    def field(self, register: str, name: str) -> int:
        """Return the value of a field."""
        fields = {field.name: field for field in self.registers[register].fields}
        return fields[name].of(self.words[register])


def access(transport: Transport, request: bytes) -> int:
    """Send a request; return the register's word before the access. Other frames that arrive meanwhile are dropped.

    Raise `TransportError` if there is no answer.
    """
    transport.send(request)
    asked = answered(request)
    end = time.monotonic() + _ANSWER_SECONDS
    while (left := end - time.monotonic()) > 0 and (burst := transport.receive(left)) is not None:
        answer = answered(burst.data)
        if answer and asked and answer[0] == asked[0]:
            return answer[1]
    raise TransportError(NO_ANSWER)


def read_word(transport: Transport, address: int, id_bytes: int = ID_BYTES) -> int:
    """Return the word of the register at an address. May raise `TransportError`."""
    return access(transport, read_request(address, id_bytes))


def write_word(transport: Transport, address: int, word: int, id_bytes: int = ID_BYTES) -> None:
    """Write a word to the register at an address. May raise `TransportError`."""
    access(transport, write_request(address, word, id_bytes))


def read_digest(transport: Transport, id_bytes: int = ID_BYTES) -> str:
    """Return the digest of the hardware's system. May raise `TransportError`."""
    return "".join(f"{read_word(transport, address, id_bytes):08x}" for address in _DIGEST_ADDRESSES)


def read_status(transport: Transport, id_bytes: int = ID_BYTES) -> Status:
    """Read all registers. Raise `TransportError` if the hardware does not answer, or if its map is unknown."""
    read = partial(read_word, transport, id_bytes=id_bytes)
    registers = status_registers(read)
    words = {register.name: read(register.address) for register in registers}
    return Status({register.name: register for register in registers}, words)


def status_registers(read: Callable[[int], int]) -> tuple[Register, ...]:
    """Return the registers of hardware; `read` returns the word at an address. May raise `TransportError`."""
    magic, shape = read(0), read(_SHAPE_ADDRESS)
    if magic != _MAGIC or shape >> 24 != _VERSION:
        raise TransportError(f"the hardware has another kind of status: it begins with {magic:08x} {shape:08x}")
    parts = Part(read(_FEATURES_ADDRESS) & _KNOWN_PARTS)
    endpoints = read(ENDPOINTS_ADDRESS) if Part.EXCHANGE in parts else 0
    return status_map("system", shape & 0xFFF, shape >> 12 & 0xFFF, features=Features(parts, endpoints)).registers


class StatusWatch:
    """Reads the status of hardware, each time for a limited duration, so that a slow link stays free for messages.

    `read` returns the word at an address, or raises `TransportError`. `names` are the channels' blocks, the subscribers
    first. `unanswered` counts failed accesses.
    """

    def __init__(self, read: Callable[[int], int], names: Sequence[str]) -> None:
        self.unanswered = 0
        self._read = read
        self._names = names
        self._registers: tuple[Register, ...] = ()
        self._turn: Iterator[Register] = iter(())
        self._words: dict[str, int] = {}

    def advance(self, seconds: float) -> None:
        """Read the next registers: at least one, and at most each register once."""
        end = time.monotonic() + seconds
        try:
            if not self._registers:
                found = status_registers(self._read)
                self._registers = tuple(item for item in found if not item.is_constant)
                self._turn = cycle(self._registers)
            for register in islice(self._turn, len(self._registers)):
                self._words[register.name] = self._read(register.address)
                if time.monotonic() >= end:
                    return
        except TransportError:
            self.unanswered += 1

    @property
    def counts(self) -> dict[str, int]:
        """The counts read so far, by texts for the user, without zero counts of faults."""
        found = {text: self._words[name] for name, text in _EVENTS.items() if name in self._words}
        for channel, name in zip(self._channels, self._names, strict=False):
            words = {text: self._words.get(f"{channel}.{word}") for word, text in _CHANNEL_WORDS.items()}
            found |= {f"{name} {text}": word for text, word in words.items() if word is not None}
            faults = {fault: self._words.get(f"{channel}.faults[{fault - 1}]") for fault in Fault}
            found |= {f"{name}: {fault.text}": count for fault, count in faults.items() if count}
        return found | {"accesses without an answer": self.unanswered}

    def troubles(self) -> int:
        """Return the number of faults and of failed accesses."""
        counted = (word for name, word in self._words.items() if name in _EVENTS or ".faults[" in name)
        return sum(counted) + self.unanswered

    @property
    def _channels(self) -> list[str]:
        suffix = ".frames"
        return [item.name.removesuffix(suffix) for item in self._registers if item.name.endswith(suffix)]


@dataclass(frozen=True)
class ParameterState:
    """A parameter with its value in effect at the accelerator, and the one that software wants."""

    item: BlockParameter
    value: float
    wanted: float


def read_parameters(
    transport: Transport, parameters: Iterable[BlockParameter], id_bytes: int = ID_BYTES
) -> list[ParameterState]:
    """Read the values of parameters, whose names and types the hardware does not tell. May raise `TransportError`."""

    def value(item: BlockParameter, address: int) -> float:
        return item.parameter.value(read_word(transport, address, id_bytes))

    return [
        ParameterState(item, value(item, value_address(item.number)), value(item, wanted_address(item.number)))
        for item in parameters
    ]


def parameters_text(states: Sequence[ParameterState]) -> str:
    """Return a table of parameters."""
    rows = [("parameter", "value", "type", "range")]
    for state in states:
        parameter = state.item.parameter
        value = _value_text(state.value)
        if state.wanted != state.value:
            value += f" ({_value_text(state.wanted)} is wanted)"
        rows.append((state.item.name, value, parameter.type.name, parameter.range))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    padded = (map(str.ljust, row, widths) for row in rows)
    return "\n".join("  ".join(row).rstrip() for row in padded)


def _value_text(value: float) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:.9g}"


def status_data(
    status: Status, names: Sequence[str] = (), parameters: Sequence[ParameterState] = ()
) -> dict[str, object]:
    """Return the status as data for JSON; `names` as in `status_text`."""
    shown = _shown_channels(status, names)
    own = {*_EVENTS, "cycles", *network_words()}
    code, channel = (status.field("last_fault", name) for name in ("code", "channel"))
    return {
        "digest": status.digest,
        **{name: word for name, word in status.words.items() if name in own},
        "last_fault": {"code": code, "channel": [*shown.values()][channel]} if code else None,
        "channels": [
            {
                "name": name,
                **{word: status.words[f"{channel}.{word}"] for word in _WORDS if f"{channel}.{word}" in status.words},
                "faults": {str(fault.value): count for fault, count in _counts(status, channel).items()},
            }
            for channel, name in shown.items()
        ],
        "endpoints": [
            {word: status.words[endpoint_register(number, word)] for word in ENDPOINT_WORDS}
            for number in range(status.words.get("exchange", 0))
        ],
        "parameters": [
            {
                "name": state.item.name,
                "type": state.item.parameter.type.name,
                "value": state.value,
                "wanted": state.wanted,
                "default": state.item.parameter.default,
                "range": [state.item.parameter.least, state.item.parameter.most],
            }
            for state in parameters
        ],
    }


def _shown_channels(status: Status, names: Sequence[str]) -> dict[str, str]:
    """Return the names to show by channel."""
    subscribers, publishers = (status.field("shape", name) for name in ("subscribers", "publishers"))
    channels = [f"subscriber[{number}]" for number in range(subscribers)]
    channels += [f"publisher[{number}]" for number in range(publishers)]
    return dict(zip(channels, names or channels, strict=True))


def status_text(status: Status, names: Sequence[str] = ()) -> str:
    """Return the status as text, with the texts of the counted codes.

    `names` are the channels' blocks, the subscribers first.
    """
    shown = _shown_channels(status, names)
    channels = [*shown]
    width = max(map(len, shown.values()))
    lines = [f"digest {status.digest}", _events(status, shown, channels), *_network(status)]
    if status.has_time_stamps:
        lines.append(f"cycle {status.words['cycles']}; stamps: a subscriber's first beat, a publisher's last beat")
    stamp = f"  {'stamp':>10}" if status.has_time_stamps else ""
    lines += [f"{'':{width}}  signature    frames   longest wait{stamp}  faults"]
    for channel, name in shown.items():
        words = {word: status.words[f"{channel}.{word}"] for word in ("signature", "frames", "longest_wait")}
        faults = ", ".join(_faults(status, channel)) or "none"
        stamp = f"  {_stamp(status, channel):>10}" if status.has_time_stamps else ""
        lines.append(
            f"{name:{width}}  {words['signature']:08x}  {words['frames']:9}  {words['longest_wait']:6} cycles{stamp}"
            f"  {faults}"
        )
    lines += _endpoints(status)
    counted = sorted({fault for channel in channels for fault in _counts(status, channel)})
    return "\n".join(lines + [f"code {fault.value}: {fault.text}" for fault in counted])


def _stamp(status: Status, channel: str) -> str:
    """Return the time stamp of a channel, which is not valid before its first frame."""
    return str(status.words[f"{channel}.stamp"]) if status.words[f"{channel}.frames"] else "-"


def _faults(status: Status, channel: str) -> list[str]:
    return [f"{count} of code {fault.value}" for fault, count in _counts(status, channel).items()]


def _counts(status: Status, channel: str) -> dict[Fault, int]:
    """Return the count of each fault of a channel that is not zero."""
    counts = {fault: status.words[f"{channel}.faults[{fault - 1}]"] for fault in Fault}
    return {fault: count for fault, count in counts.items() if count}


def _events(status: Status, shown: Mapping[str, str], channels: Sequence[str]) -> str:
    code, channel = (status.field("last_fault", name) for name in ("code", "channel"))
    last = f"code {code} of {shown[channels[channel]]}" if code else "none"
    counts = ", ".join(f"{text} {status.words[name]}" for name, text in _EVENTS.items())
    return f"last fault: {last}; {counts}"


def _network(status: Status) -> list[str]:
    """Return a line for each counter of a node's network that is not zero, or one line about all."""
    counts = {text: status.words[name] for name, text in network_words().items() if name in status.words}
    counted = [f"network: {count} times {text}" for text, count in counts.items() if count]
    return counted or ["network: no faults"] * bool(counts)


def _endpoints(status: Status) -> Iterator[str]:
    """Yield a line for each endpoint of an exchange."""
    for number in range(status.words.get("exchange", 0)):
        counts = [f"{word} {status.words[endpoint_register(number, word)]}" for word in ENDPOINT_WORDS]
        yield f"endpoint {number}: {', '.join(counts)}"


def check_digest(transport: Transport, expected: str, system: str, id_bytes: int = ID_BYTES) -> None:
    """Raise `TransportError` if the hardware is not that of a system, whose digest is `expected`."""
    found = read_digest(transport, id_bytes)
    if found != expected:
        raise TransportError(
            f"the hardware is not that of '{system}': its digest is {found}, and the specification's is {expected}"
        )
