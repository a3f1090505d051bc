"""Messages of DHCP for the board 02:00:00:00:00:02, and what its client makes of them (RFC 2131, RFC 2132)."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from tests.cores.ethernet import checksum
from tests.cores.requests import MAC

DISCOVER, OFFER, REQUEST, DECLINE, ACK, NAK = range(1, 7)
LEASE, OVERLOAD, TYPE, SERVER, RENEWAL, REBINDING = 51, 52, 53, 54, 58, 59
SERVER_ADDRESS, SERVER_MAC, ADDRESS = bytes([192, 0, 2, 1]), bytes.fromhex("020000000001"), bytes([192, 0, 2, 50])
BROADCAST = b"\xff" * 6
_MAGIC = bytes.fromhex("63825363")
# The bytes of the client's number, and the same with other bits, for the bench.
NUMBER, OTHER_NUMBER = tuple(range(256, 260)), tuple(range(260, 264))
_NAME_PLACE, _FILE_PLACE, _OPTIONS_PLACE = 44, 108, 240
_SIZES = {LEASE: 4, OVERLOAD: 1, TYPE: 1, SERVER: 4, RENEWAL: 4, REBINDING: 4}

Options = list[tuple[int, bytes]]


def listed(options: Options) -> bytes:
    """Options as on the line, without an end."""
    return b"".join(bytes([tag, len(value)]) + value for tag, value in options)


@dataclass(frozen=True)
class Message:
    """A message of a server; `options` have their end, if there is one. `extra` bytes are after the packet."""

    options: bytes
    number: tuple[int, ...] = NUMBER
    address: bytes = ADDRESS
    name: bytes = bytes(64)
    file: bytes = bytes(128)
    operation: int = 2
    hardware: tuple[int, int] = (1, 6)
    owner: bytes = MAC
    magic: bytes = _MAGIC
    mac: bytes = MAC
    sender: bytes = SERVER_MAC
    target: bytes = ADDRESS
    port: int = 68
    kind: bytes = b"\x08\0"
    version: int = 0x45
    fragment: int = 0
    protocol: int = 17
    longer: int = 0
    extra: int = 0
    is_aborted: bool = False

    def frame(self) -> list[int]:
        """The frame without FCS; numbers above 255 are for the bench."""
        fixed = struct.pack(">BBBB", self.operation, *self.hardware, 0)
        rest = bytes(8) + self.address + bytes(8) + self.owner.ljust(16, b"\0") + self.name + self.file
        rest += self.magic + self.options
        size = len(fixed) + 4 + len(rest) + 8
        udp = struct.pack(">HHHH", 67, self.port, size, 0)
        header = struct.pack(
            ">BBHHHBBH", self.version, 0, 20 + size + self.longer, 7, self.fragment, 64, self.protocol, 0
        )
        header += SERVER_ADDRESS + self.target
        header = header[:10] + checksum(header).to_bytes(2) + header[12:]
        head = self.mac + self.sender + self.kind + header + udp + fixed
        return [*head, *self.number, *rest, *bytes(self.extra)]

    def row(self) -> str:
        """A row for the bench."""
        frame = self.frame()
        return " ".join(map(str, (0, int(self.is_aborted), len(frame), *frame))) + "\n"


@dataclass
class Meaning:
    """What a message says."""

    type: int = 0
    values: dict[int, bytes] = field(default_factory=dict)
    overload: int = 0


def meaning(message: Message) -> Meaning | None:
    """What a message says, or None if it is not for the board or broken."""
    proper = replace(message, options=b"", name=b"", file=b"", address=b"", target=b"", sender=b"", is_aborted=False)
    usual = replace(Message(b"", name=b"", file=b"", address=b"", target=b"", sender=b""), extra=message.extra)
    is_proper = replace(proper, mac=MAC) == usual and message.mac in (MAC, BROADCAST)
    if not is_proper or message.is_aborted or message.sender[0] & 1 or message.longer:
        return None
    found = Meaning()
    areas = [message.options]
    for number, area in enumerate(_areas(message, found, areas)):
        for tag, value in area:
            if tag in _SIZES and len(value) == _SIZES[tag]:
                if tag == TYPE:
                    found.type = value[0] if value[0] < 8 else 0
                elif tag == OVERLOAD:
                    found.overload = value[0] & 3 if number == 0 else found.overload
                else:
                    found.values[tag] = value
    return None if found.type < 0 else found


def _areas(message: Message, found: Meaning, areas: list[bytes]) -> Iterator[Options]:
    """The options of each area; the type is negative after one that is broken."""
    while areas:
        options = _parsed(areas.pop(0))
        if options is None:
            found.type = -1
            return
        yield options
        if areas == [] and found.overload & 1:
            found.overload &= 2
            areas.append(message.file)
        elif areas == [] and found.overload & 2:
            found.overload = 0
            areas.append(message.name)


def _parsed(area: bytes) -> Options | None:
    """The options of an area, or None if one is cut."""
    options, place = [], 0
    while place < len(area) and area[place] != 255:
        if area[place] == 0:
            place += 1
            continue
        size = area[place + 1] if place + 1 < len(area) else 0
        if place + 2 + size > len(area):
            return None
        options.append((area[place], area[place + 2 : place + 2 + size]))
        place += 2 + size
    return options


def is_offer(message: Message) -> bool:
    """Whether the client requests what the message offers."""
    found = meaning(message)
    first = message.address[0]
    is_host = first not in (0, 127) and first < 224
    return found is not None and found.type == OFFER and SERVER in found.values and is_host


def answer(message: Message, address: bytes = ADDRESS, server: bytes = SERVER_ADDRESS) -> str:
    """What a client that asks a server for an address gets: "lease", "no", or nothing."""
    found = meaning(message)
    if found is None or found.values.get(SERVER) != server:
        return ""
    if found.type not in (ACK, NAK) or (found.type == ACK and LEASE not in found.values):
        return ""
    return "lease" if found.type == ACK and message.address == address else "no"


def offer(kind: int = OFFER, seconds: int = 60, **changes: object) -> Message:
    """A usual message; `server` is the address that it tells, or nothing."""
    times, server = changes.pop("times", ()), changes.pop("server", SERVER_ADDRESS)
    assert isinstance(server, bytes)
    assert isinstance(times, tuple)
    options = [(TYPE, bytes([kind])), *([(SERVER, server)] if server else []), (LEASE, seconds.to_bytes(4))]
    options += [(tag, value.to_bytes(4)) for tag, value in zip((RENEWAL, REBINDING), times, strict=False)]
    made: Mapping[str, object] = {"options": listed(options) + b"\xff", **changes}
    return Message(**made)  # type: ignore[arg-type]


def random_message(chance: random.Random, kinds: tuple[int, ...]) -> Message:
    """A message of a server, half of which have something unusual or wrong."""
    options: Options = [(TYPE, bytes([chance.choice(kinds)])), (LEASE, chance.randbytes(4))]
    options.append((SERVER, bytes([192, 0, 2, chance.choice((1, 1, 1, 1, 2))])))
    options += [(tag, chance.randbytes(4)) for tag in (RENEWAL, REBINDING) if chance.random() < 0.5]
    options += [(chance.choice((1, 3, 12, 43)), chance.randbytes(chance.randrange(9))) for _ in range(3)]
    if chance.random() < 0.3:
        tag = chance.choice((*_SIZES, 0xFE))
        options.append((tag, chance.randbytes(chance.choice((0, 1, 2, 3, 4, 5, 8)))))
    if chance.random() < 0.2:
        del options[chance.randrange(3)]
    chance.shuffle(options)
    message = Message(b"", address=bytes([192, 0, 2, chance.choice((50, 51))]), extra=chance.choice((0, 0, 1, 20)))
    if chance.random() < 0.4:
        message = _overloaded(chance, message, options)
    else:
        message = replace(message, options=_area(chance, options))
    if chance.random() < 0.4:
        message = _changed(chance, message)
    return message


def _area(chance: random.Random, options: Options) -> bytes:
    """Options with pads between them, mostly with an end, after which there may be anything."""
    text = b"".join(bytes(chance.choice((0, 0, 1, 3))) + listed([option]) for option in options)
    return text + chance.choice((b"\xff", b"\xff", b"\xff" + chance.randbytes(9), b"\0", b""))


def _overloaded(chance: random.Random, message: Message, options: Options) -> Message:
    """Some of the options are in the fields of names, at their ends or before."""
    cut = sorted(chance.randrange(len(options) + 1) for _ in range(2))
    parts = options[: cut[0]], options[cut[0] : cut[1]], options[cut[1] :]
    if chance.random() < 0.4:
        # It has no effect there.
        parts[1].insert(0, (OVERLOAD, bytes([chance.randrange(4)])))
    first = listed(parts[0]) + listed([(OVERLOAD, bytes([chance.choice((1, 2, 3, 3, 3))]))]) + b"\xff"
    file, name = (_area(chance, part) for part in parts[1:])
    return replace(message, options=first, file=file.ljust(128, b"\0")[:128], name=name.ljust(64, b"\0")[:64])


def _changed(chance: random.Random, message: Message) -> Message:
    changes: tuple[dict[str, object], ...] = (
        {"number": OTHER_NUMBER},
        {"number": (*NUMBER[:3], OTHER_NUMBER[3])},
        {"address": bytes([chance.choice((0, 127, 224, 255, 10)), 0, 2, 50])},
        {"operation": 1},
        {"hardware": chance.choice(((6, 6), (1, 5)))},
        {"owner": MAC[:5] + b"\3"},
        {"magic": chance.choice((b"\x63\x82\x53\x62", bytes(4)))},
        {"mac": chance.choice((BROADCAST, MAC[:5] + b"\3", b"\xff" * 5 + b"\xfe"))},
        {"sender": b"\3" + SERVER_MAC[1:]},
        {"port": chance.choice((67, 69, 68 + 256))},
        {"kind": b"\x08\x06"},
        {"version": chance.choice((0x46, 0x65))},
        {"fragment": chance.choice((0x2000, 1))},
        {"protocol": 6},
        {"longer": 1 + message.extra},
        {"is_aborted": True},
        {"options": message.options[: chance.randrange(len(message.options) + 1)]},
    )
    return replace(message, **chance.choice(changes))  # type: ignore[arg-type]
