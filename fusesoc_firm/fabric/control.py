"""The program of a ROS 2 node in fabric (`ros2_node.seq`), assembled for `firm_rtps_sequencer`.

An instruction operates on little-endian numbers of 1 to 28 bytes in the sequencer's single memory. A program is text.
Each line is `label:`, an instruction with its operands, a comment after `;`, or the name of a place:

    global NAME ADDRESS       in the memory, which begins with the record of `firm_rtps_walker`
    peer NAME OFFSET          in the entry of the peer P: `P.NAME`
    entry NAME OFFSET         in the entry of the source or sink E: `E.NAME`
    table NAME OFFSET         in the table W: `W.NAME`

`field.NAME` is a field of `firm_packet_builder`, `io.NAME` another place outside the memory, and `PLACE+N` a later
byte. An operation may be followed by the number of its bytes, as in `copy.4 a, b`; without one, it is one byte.

| instruction | effect |
|---|---|
| `copy a, b`; `add`, `sub`, `and` | a := b; a := a + b and so on, with z and c |
| `cmp a, b`; `test a, b` | z and c of a - b; z of a and b |
| `mask.4 a, b` | a := a set of the first b of 32 numbers |
| `load R, b`; `store a, R` | a register P, E, W or X |
| `step R, n` | R := R + 1; z if it is n |
| `bit` | z unless number X is in the set of the record |
| `jump L`, `jump COND, L` | z, nz, c, nc; tick, early, frame, work (one of these, or a submessage); `no_` with each |
| `call L`, `return` | up to eight levels |
| `take` | takes the received part of a submessage; c if it is complete |
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint, Node
from fusesoc_firm.fabric.packets import Field, packets_of
from fusesoc_firm.fabric.rtps import Kind
from fusesoc_firm.system.derived.ethernet import MOST_DEPTH, MOST_SLOTS, kept_of, ring_slots, slot_count
from fusesoc_firm.text.render import Rendering

PROGRAM = Path(__file__).with_name("ros2_node.seq")
MOST_WORDS = 2048
WORD_BITS = 36
MOST_PEERS = 8

_OPERATIONS = "copy add sub cmp and test mask load store bit step jump call return take".split()
_SIZES = {size: code for code, size in enumerate((1, 2, 4, 8, 12, 16, 6, 28))}
_REGISTERS = "PEWX"
_SPACES = {"global": 0, "peer": 1, "entry": 2, "table": 3}
_PREFIXES = {"peer": "P.", "entry": "E.", "table": "W.", "global": ""}
_CONDITIONS = {"": 0, "z": 2, "nz": 3, "c": 4, "nc": 5}
_EVENTS = ("tick", "early", "frame", "work")
_CONDITIONS |= {name: 8 + 2 * number for number, name in enumerate(_EVENTS)}
_CONDITIONS |= {f"no_{name}": 9 + 2 * number for number, name in enumerate(_EVENTS)}
_NUMBER = 1 << 31
_OUTSIDE = 256
PORTS = {
    "key": 0x80,
    "number": 0x90,
    "note": 0x98,
    "slot": 0x99,
    "writer": 0x9A,
    "next_slot": 0x9B,
    "start": 0x9C,
    "lock": 0x9D,
    "taken": 0x9E,
    "refused": 0x9F,
    "matches": 0xA0,
    "facts": 0xA3,
    "entity": 0xA4,
    # Eight readable bytes at addresses of write-only ones.
    "next_fragment": 0x98,
    "early_number": 0xA8,
    "early_source": 0xAC,
    "frame_writer": 0xAD,
    "large": 0xAE,
    "sample": 0xAF,
    "sample_bytes": 0xB0,
    "peers": 0xB4,
    "sources": 0xB5,
    "sinks": 0xB6,
    "bank": 0xB7,
    "prepared": 0xB8,
    "look": 0xB9,
    "fragment": 0xBA,
}
"""The registers of `firm_rtps_control` outside the memory, into which `make constants` writes these addresses."""
# Tables of the node's own writers with frames, of the writer of ros_discovery_info, and of the readers.
_GRAPH, _FIRST_READER = 15, 16
# The bank of the builder's fields for all packets except prepared ones, which use their writers' banks.
_OWN_BANK, _NO_PACKET = 15, 0
_TIMES = {
    "AFTER_FAREWELL": 200,
    "SOON": 100,
    "LATER": 3000,
    "FIRST_ANNOUNCEMENTS": 5,
    "DISCOVERY_REQUEST": 200,
    "DISCOVERY_HEARTBEAT": 500,
    "USER_REQUEST": 20,
    "LONGEST_REQUEST": 320,
    "UNHEARD_REQUEST": 500,
    "USER_HEARTBEAT": 100,
    # Seconds, plus one since the first may be short.
    "USUAL_LEASE": 101,
}
# Facts about samples to send: the new one, and the one in the selected slot.
_SAMPLE_FACTS = ("IS_STARTED", "IS_LONG", "IS_LAST", "IS_BEYOND", "IS_NEW_LONG")
_FACTS = ("RELIABLE", "KNOWN", "TRANSIENT", "HAS_UNICAST", "HAS_METATRAFFIC", "HAS_DEFAULT", "GONE", "HAS_LEASE")
_OTHERS = {
    # Announcements or samples per request: peers combine more of them in one datagram, whose fragments a node without
    # reassembly drops.
    "WINDOW": 2,
    "BEYOND_WINDOW": 3,
    "MOST_REQUESTED": 8,
    "FINAL": 3,
    "NOT_FINAL": 1,
    "FINAL_FLAG": 2,
    "GRAPH": _GRAPH,
    "OWN_BANK": _OWN_BANK,
    "NO_PACKET": _NO_PACKET,
    "FIRST_READER": _FIRST_READER,
    # Parts of the ids of discovery's entities: the first two bytes, the third one, and the kind.
    "PARTICIPANTS": int.from_bytes(rtps.PARTICIPANT_WRITER[:2], "little"),
    "PUBLICATIONS": rtps.PUBLICATIONS_WRITER[2],
    "SUBSCRIPTIONS": rtps.SUBSCRIPTIONS_WRITER[2],
    "BUILTIN_WRITER": rtps.PUBLICATIONS_WRITER[3],
    "BUILTIN_READER": rtps.PUBLICATIONS_READER[3],
    **{kind.name: int(kind) for kind in Kind},
    **{name: 1 << number for names in (_FACTS, _SAMPLE_FACTS) for number, name in enumerate(names)},
}


class ProgramError(Exception):
    """An error in a program; the text contains the line."""


@dataclass(frozen=True)
class Sizes:
    """The numbers of entries in the node's tables: matched writers of peers, matched readers of peers, and peers."""

    sources: int
    sinks: int
    peers: int = MOST_PEERS

    @classmethod
    def of(cls, node: Node) -> Sizes:
        """Return the sizes for each topic of the node at each peer."""
        return cls(max(1, MOST_PEERS * len(node.readers)), MOST_PEERS * len(node.writers))


@dataclass(frozen=True)
class Ring:
    """The slots of a writer in the history: a power of two, including one for the incoming sample."""

    base: int
    size: int


def rings_of(node: Node) -> tuple[Ring, ...]:
    """Return the slots of each writer with frames. Raises ValueError if they do not fit."""
    sizes = [ring_slots(item.quality) for item in node.writers[1:]]
    for item in node.writers[1:]:
        kept = kept_of(item.quality)
        if kept > MOST_DEPTH:
            raise ValueError(f"{item.topic} keeps {kept} samples; at most {MOST_DEPTH} are kept")
    if sum(sizes) > MOST_SLOTS:
        raise ValueError(f"the writers need {sum(sizes)} slots for their samples; there are at most {MOST_SLOTS}")
    bases = dict.fromkeys(range(len(sizes)), 0)
    used = 0
    # The larger ones first, so that each begins at a multiple of its size.
    for number in sorted(bases, key=lambda number: -sizes[number]):
        bases[number] = used
        used += sizes[number]
    return tuple(Ring(bases[number], size) for number, size in enumerate(sizes))


def slots_of(node: Node) -> int:
    """Return the number of slots of the history, a power of two."""
    return slot_count(sum(ring.size for ring in rings_of(node)))


def generics_of(node: Node, sizes: Sizes) -> dict[str, int]:
    """Return the generics of `firm_rtps_node` that match the program."""
    return {
        "WRITERS": len(node.writers),
        "READERS": len(node.readers),
        "SOURCES": sizes.sources,
        "SINKS": sizes.sinks,
        "SLOTS": slots_of(node),
    }


def words_of(node: Node, sizes: Sizes) -> list[int]:
    """Return the words of a node's program."""
    return _assembled(node, sizes)[0]


def main_of(node: Node) -> int:
    """Return the address of the program's loop."""
    return _assembled(node, Sizes.of(node))[1]["main"]


def _assembled(node: Node, sizes: Sizes) -> tuple[list[int], dict[str, int]]:
    """The words of a program, and the addresses of its labels."""
    assembler = _Assembler(_constants(node, sizes))
    text = PROGRAM.read_text(encoding="utf-8")
    return assembler.words(f"{text}\n{_tables(node)}"), assembler.labels


def memory_of_control(node: Node, entity: str, sizes: Sizes) -> Rendering:
    """Return the memory of a node's program, as an entity for `firm_rtps_node` with the same generics."""
    words = [f'"{word:0{WORD_BITS}b}"' for word in words_of(node, sizes)]
    return Rendering(
        "vhdl/control.vhd",
        {
            "entity": entity,
            "node": node.network.name,
            "generics": [{"name": name, "value": value} for name, value in generics_of(node, sizes).items()],
            "word_count": len(words),
            "rows": [", ".join(words[at : at + 2]) for at in range(0, len(words), 2)],
        },
    )


def _constants(node: Node, sizes: Sizes) -> dict[str, int]:
    numbers = {name: number for number, name in enumerate(packets_of(node))}
    firsts = {
        "packet.writers_first": numbers["writer_1"] - 1,
        "packet.readers_first": numbers["writers_told"],
    }
    return {
        **_TIMES,
        **_OTHERS,
        **{f"packet.{name}": number for name, number in numbers.items()},
        **firsts,
        "PEERS": sizes.peers,
        "SOURCES": sizes.sources,
        "FIRST_SINK": sizes.sources,
        "END_SINKS": sizes.sources + sizes.sinks,
        "WRITERS": len(node.writers),
        "READERS": len(node.readers),
        "FRAME_WRITERS": len(node.writers) - 1,
        "END_READERS": _FIRST_READER + len(node.readers),
        "FIRST_WRITER_BIT": 1 << len(node.readers),
    }


def _tables(node: Node) -> str:
    """The part of the program that writes the constants of the node's endpoints."""
    lines = ["begin_tables:"]
    for number, (item, ring) in enumerate(zip(node.writers[1:], rings_of(node), strict=True)):
        lines += [*_endpoint(number, item), *_writer(item)]
        lines += [f"copy W.base, {ring.base}", f"copy W.mask, {ring.size - 1}"]
        lines += [f"copy io.writer, {number}", f"copy io.next_slot, {ring.base + (1 & (ring.size - 1))}"]
    lines += [*_endpoint(_GRAPH, node.writers[0]), *_writer(node.writers[0]), "copy.4 W.number, 1"]
    for number, item in enumerate(node.readers, _FIRST_READER):
        lines += [*_endpoint(number, item), f"copy W.reliable, {int(item.quality.is_reliable)}"]
    return "\n".join([*lines, "return"])


def _endpoint(table: int, item: Endpoint) -> Iterator[str]:
    yield f"load W, {table}"
    first, second = struct.unpack("<2H", item.entity)
    yield from (f"copy.2 W.entity, {first}", f"copy.2 W.entity+2, {second}")


def _writer(item: Endpoint) -> Iterator[str]:
    # Two bytes: `depth` and `transient`.
    yield f"copy.2 W.depth, {kept_of(item.quality) | item.quality.is_transient_local << 8}"


class _Assembler:
    """Converts the text of a program to words."""

    def __init__(self, constants: Mapping[str, int]) -> None:
        self._constants = constants
        self._places = {
            **{f"field.{item.name}": _OUTSIDE + item.address for item in Field},
            **{f"io.{name}": _OUTSIDE + place for name, place in PORTS.items()},
        }
        self.labels: dict[str, int] = {}

    def words(self, text: str) -> list[int]:
        """The words of a program."""
        instructions: list[tuple[int, list[str]]] = []
        for number, line in enumerate(text.splitlines(), 1):
            words = line.partition(";")[0].replace(",", " ").split()
            if words[:1] and words[0] in _SPACES:
                self._places[_PREFIXES[words[0]] + words[1]] = _SPACES[words[0]] << 12 | int(words[2])
            elif words and words[0].endswith(":"):
                self.labels[words[0][:-1]] = len(instructions)
            elif words:
                instructions.append((number, words))
        if len(instructions) > MOST_WORDS:
            raise ProgramError(f"the program has {len(instructions)} words; at most {MOST_WORDS} fit")
        return list(chain.from_iterable(self._checked(number, words) for number, words in instructions))

    def _checked(self, number: int, words: list[str]) -> list[int]:
        try:
            return [self._word(*words)]
        except (KeyError, ValueError, TypeError) as error:
            raise ProgramError(f"{PROGRAM.name}:{number}: {' '.join(words)}: {error}") from error

    def _word(self, name: str, *operands: str) -> int:
        operation, _, size = name.partition(".")
        head = _OPERATIONS.index(operation) << 32 | _SIZES[int(size or 1)] << 28
        match operation, operands:
            case (("return" | "take" | "bit"), ()):
                return head
            case "jump", (*condition, label):
                return head | _CONDITIONS["".join(condition)] << 14 | self.labels[label]
            case "call", (label,):
                return head | self.labels[label]
            case "step", (register, end):
                return head | _REGISTERS.index(register) << 14 | self._value(end)
            case "load", (register, source):
                return head | _REGISTERS.index(register) << 14 | self._source(source)
            case "store", (place, register):
                return head | self._place(place) << 14 | _REGISTERS.index(register)
            case _, (place, source):
                return head | self._place(place) << 14 | self._source(source)
        raise ValueError("the operands are wrong")

    def _value(self, text: str) -> int:
        value = self._constants[text] if text in self._constants else int(text)
        if not 0 <= value < 1 << 14:
            raise ValueError(f"{text} is {value}; legal: 0 to {(1 << 14) - 1}")
        return value

    def _place(self, text: str) -> int:
        name, _, more = text.partition("+")
        return self._places[name] + int(more or 0)

    def _source(self, text: str) -> int:
        if text.partition("+")[0] in self._places:
            return self._place(text)
        return _NUMBER | self._value(text)
