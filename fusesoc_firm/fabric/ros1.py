"""A system as a node of ROS 1 in the sockets of a W5500 or W5200: the memory of its sequencer.

The memory has the program `ros1_node.seq`, all texts that the node sends, and tries of the strings that it must know.
What is sent follows the master's and the slave's API of ROS, XML-RPC and TCPROS. Texts are pieces; pieces that several
texts share are stored once.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from ipaddress import IPv4Address
from pathlib import Path

from fusesoc_firm.fabric.sequencer import Assembler, Rom
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.printer import closure_text
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.derived.chip import MOST_TOPICS, MOST_TYPES
from fusesoc_firm.system.derived.model import DerivedSystem, Network, Topic
from fusesoc_firm.system.hardware.interconnect import CHIP_NUMBERS, rom_entity
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.render import render

_PROGRAM = Path(__file__).with_name("ros1_node.seq")
# The port at which the node listens, for XML-RPC and TCPROS.
PORT = 50000
NONE = 255

# Registers with the same address in both chips, and commands and states of a socket (the datasheets' Sn_CR and Sn_SR).
_REGISTERS = {
    "MODE": 0x00,
    "COMMAND": 0x01,
    "INTERRUPT": 0x02,
    "STATUS": 0x03,
    "PORT": 0x04,
    "PEER_ADDRESS": 0x0C,
    "PEER_PORT": 0x10,
    "TX_FREE": 0x20,
    "TX_WRITE": 0x24,
    "RX_RECEIVED": 0x26,
    "RX_READ": 0x28,
}
_COMMANDS = {
    "OPEN": 0x01,
    "LISTEN_COMMAND": 0x02,
    "CONNECT": 0x04,
    "DISCON": 0x08,
    "CLOSE": 0x10,
    "SEND": 0x20,
    "RECV": 0x40,
}
_STATES = {"LISTEN": 0x14, "SYN_RECEIVED": 0x16, "ESTABLISHED": 0x17, "CLOSE_WAIT": 0x1C}
# The register with a bit for each socket with an interrupt.
_INTERRUPTS = {5500: 0x17, 5200: 0x34}
# Numbers of the strings in headers; those of topics are the highest.
_FIRST_MD5, _ANY_MD5, _FIRST_TYPE, _ANY_TYPE, _FIRST_TOPIC = 0x01, 0x3F, 0x40, 0x7F, 0x80
assert _ANY_MD5 - _FIRST_MD5 == MOST_TYPES
assert 0x100 - _FIRST_TOPIC > MOST_TOPICS
# Words in texts are addresses with bit 15 set.
MOST_BYTES = 0x8000
_ROM_TEMPLATE = "vhdl/node_rom.vhd"
_BYTES_IN_ROW = 16
_METHODS = (
    "publisherUpdate",
    "requestTopic",
    "getPid",
    "getBusInfo",
    "getBusStats",
    "getMasterUri",
    "getSubscriptions",
    "getPublications",
    "shutdown",
    "paramUpdate",
)
_TAGS = {b"param": 1, b"/methodName": 2, b"/methodCall": 3, b"/methodResponse": 4}
# A text is sent in parts of what the chip's transmit buffer holds.
_BUFFER = 2048
_PIECE = 126
_PART = 127
_SHORTEST_WORD = 4

Text = tuple[bytes, ...]


class Direction(Enum):
    """What the node is for a topic."""

    SUBSCRIBER = "subscriber"
    PUBLISHER = "publisher"


@dataclass(frozen=True)
class Endpoint:
    """A topic by its absolute name, with its type, the type's MD5 sum, and the text of its definition."""

    topic: str
    type: str
    md5: str
    definition: str


@dataclass(frozen=True)
class Node:
    """A node: its absolute name, its place in the network, its master's, and its topics in the order of their ids."""

    name: str
    network: Network
    master: tuple[IPv4Address, int]
    subscribers: tuple[Endpoint, ...]
    publishers: tuple[Endpoint, ...]
    port: int = PORT

    @property
    def types(self) -> tuple[str, ...]:
        """All types, without repetition."""
        return tuple(dict.fromkeys(item.type for item in self.subscribers + self.publishers))

    @property
    def topics(self) -> tuple[str, ...]:
        """The names of all topics, without repetition."""
        return tuple(dict.fromkeys(item.topic for item in self.subscribers + self.publishers))

    def uri(self) -> str:
        """Return the URI of its XML-RPC server."""
        return _uri(self.network.address, self.port)


def node_of(system: DerivedSystem, libraries: Mapping[Middleware, MessageLibrary]) -> Node:
    """Return the node of a system in the sockets of a chip."""
    library, network = libraries[ROS1], system.network
    assert network is not None
    assert network.master is not None
    space = network.namespace.rstrip("/")

    def endpoint(topic: Topic) -> Endpoint:
        message = topic.frame.message
        definitions = library.closure(message)
        name = topic.ros_name if topic.ros_name.startswith("/") else f"{space}/{topic.ros_name}"
        return Endpoint(name, str(message), signature(message, definitions), closure_text(message, definitions))

    subscribers, publishers = (tuple(map(endpoint, side)) for side in (system.subscribers, system.publishers))
    return Node(f"{space}/{network.name}", network, network.master, subscribers, publishers)


def memory_of(system: DerivedSystem, libraries: Mapping[Middleware, MessageLibrary]) -> bytes:
    """Return the bytes of the ROM of a system in the sockets of a chip; no bytes for other systems.

    Raise `InputError` if the node's texts are longer than the memory.
    """
    if system.network is None or system.network.kind not in CHIP_NUMBERS:
        return b""
    made = image(node_of(system, libraries), CHIP_NUMBERS[system.network.kind])
    if len(made) > MOST_BYTES:
        fail(
            f"the node of '{system.name}' needs {len(made)} bytes of memory for its texts",
            hint=f"{MOST_BYTES} are possible; use fewer topics, or messages with shorter definitions",
        )
    return made


def rom_files(system: DerivedSystem, libraries: Mapping[Middleware, MessageLibrary]) -> dict[str, str]:
    """Return the VHDL of a ROM with `memory_of`, by its file's name; nothing without memory. May raise `InputError`."""
    made = memory_of(system, libraries)
    if not made:
        return {}
    entity, data = rom_entity(system), [f'x"{byte:02x}"' for byte in made]
    configuration = {
        "entity": entity,
        "node": node_of(system, libraries).name,
        "byte_count": len(data),
        "rows": [", ".join(data[at : at + _BYTES_IN_ROW]) for at in range(0, len(data), _BYTES_IN_ROW)],
    }
    return {f"{entity}.vhd": render(_ROM_TEMPLATE, configuration)}


def image(node: Node, chip: int) -> bytes:
    """Return the bytes of the sequencer's ROM for a chip, 5500 or 5200."""
    rom = Rom()
    Assembler(rom, _constants(node, chip)).read(_PROGRAM.read_text(encoding="utf-8"))
    texts = _texts(node)
    _add_texts(rom, texts)
    _add_tries(rom, node)
    _add_tables(rom, node, texts)
    network = node.network
    rom.label("addresses")
    gateway = network.gateway.packed if network.gateway else bytes(4)
    rom.add(gateway + network.netmask.packed + network.mac + network.address.packed)
    rom.label("master")
    rom.add(node.master[0].packed + node.master[1].to_bytes(2, "big"))
    rom.add([0])  # the sequencer reads a byte more than it sends
    return rom.image()


def _constants(node: Node, chip: int) -> dict[str, int]:
    own = {f"OWN_{index}": byte for index, byte in enumerate(node.network.address.packed)}
    methods = {
        "PUBLISHER_UPDATE": _METHODS.index("publisherUpdate") + 1,
        "REQUEST_TOPIC": _METHODS.index("requestTopic") + 1,
        "SHUTDOWN": _METHODS.index("shutdown") + 1,
        "TEXT_METHODS": len(_METHODS) + 1,
        "TEXT_ONE": len(_METHODS) + 1,
        "TEXT_TCPROS": len(_METHODS) + 2,
        "TEXT_TOPICS": len(_METHODS) + 3,
    }
    tags = {
        "TAG_PARAMETER": _TAGS[b"param"],
        "TAG_METHOD_END": _TAGS[b"/methodName"],
        "TAG_CALL_END": _TAGS[b"/methodCall"],
        "TAG_RESPONSE_END": _TAGS[b"/methodResponse"],
    }
    fields = {
        "FIRST_MD5": _FIRST_MD5,
        "ANY_MD5": _ANY_MD5,
        "FIRST_TYPE": _FIRST_TYPE,
        "ANY_TYPE": _ANY_TYPE,
        "FIRST_TOPIC": _FIRST_TOPIC,
    }
    registrations = len(node.subscribers) + len(node.publishers)
    return {
        **_REGISTERS,
        **_COMMANDS,
        **_STATES,
        **own,
        **methods,
        **tags,
        **fields,
        "INTERRUPTS": _INTERRUPTS[chip],
        "OWN_PORT_HIGH": node.port >> 8,
        "OWN_PORT_LOW": node.port & 0xFF,
        "UNREGISTRATIONS": registrations,
        "CALLS": 2 * registrations,
    }


# Texts, by their labels.


def _texts(node: Node) -> dict[str, Text]:
    one = b"<i4>1</i4>"
    answers: list[Text] = [
        _fault("no such method"),
        _answer((b"<i4>0</i4>",)),
        _answer(
            _list(_value(b"TCPROS"), _value(str(node.network.address).encode()), _value(b"<i4>%d</i4>" % node.port))
        ),
        _answer((one,)),
        _answer(_list()),
        _answer(_list(*[_value(*_list())] * 3)),
        _answer((_uri(*node.master).encode(),)),
        _answer(
            _list(
                *(_value(*_list(_value(item.topic.encode()), _value(item.type.encode()))) for item in node.subscribers)
            )
        ),
        _answer(
            _list(
                *(_value(*_list(_value(item.topic.encode()), _value(item.type.encode()))) for item in node.publishers)
            )
        ),
        _answer((b"<i4>0</i4>",)),
        _answer((b"<i4>0</i4>",)),
        _answer((b"<i4>0</i4>",), code=0),
    ]
    texts = {f"answer_{index}": text for index, text in enumerate(answers)}
    texts |= {f"call_{index}": text for index, text in enumerate(_calls(node))}
    name = f"callerid={node.name}"
    for index, item in enumerate(node.subscribers):
        protocols = _list(_value(*_list(_value(b"TCPROS"))))
        texts[f"request_{index}"] = _call("requestTopic", node.name.encode(), item.topic.encode(), protocols)
        fields = (f"md5sum={item.md5}", "tcp_nodelay=1", f"topic={item.topic}", f"type={item.type}")
        texts[f"greeting_{index}"] = _header(name, *fields)
    for index, item in enumerate(node.publishers):
        definition = f"message_definition={item.definition}"
        lines = ("latching=0", f"md5sum={item.md5}", definition, f"topic={item.topic}", f"type={item.type}")
        texts[f"header_{index}"] = _header(name, *lines)
    texts["refusal"] = _header("error=topic, type or md5sum is not that of the publisher")
    return texts


def _calls(node: Node) -> Iterable[Text]:
    """Return the calls to the master: first those that unregister the node from before a reset, then the others."""
    name, uri = node.name.encode(), node.uri().encode()
    for kind, items in ((b"Publisher", node.publishers), (b"Subscriber", node.subscribers)):
        for item in items:
            yield _call("unregister" + kind.decode(), name, item.topic.encode(), uri)
    for kind, items in ((b"Publisher", node.publishers), (b"Subscriber", node.subscribers)):
        for item in items:
            yield _call("register" + kind.decode(), name, item.topic.encode(), item.type.encode(), uri)


def _uri(address: IPv4Address, port: int) -> str:
    return f"http://{address}:{port}/"


def _value(*text: bytes) -> Text:
    return (b"<value>", *text, b"</value>")


def _list(*values: Text) -> Text:
    return (b"<array><data>", *(piece for value in values for piece in value), b"</data></array>")


def _http(first: bytes, body: Text) -> Text:
    length = sum(map(len, body))
    return (first, b"Content-Type: text/xml\r\nContent-Length: ", b"%d" % length, b"\r\n\r\n", *body)


def _call(method: str, *parameters: bytes | Text) -> Text:
    body: list[bytes] = [b'<?xml version="1.0"?><methodCall><methodName>', method.encode(), b"</methodName><params>"]
    for item in parameters:
        body += [b"<param><value>", *((item,) if isinstance(item, bytes) else item), b"</value></param>"]
    return _http(b"POST / HTTP/1.0\r\n", (*body, b"</params></methodCall>"))


def _response(body: Text) -> Text:
    begin, end = b'<?xml version="1.0"?><methodResponse>', b"</methodResponse>"
    return _http(b"HTTP/1.0 200 OK\r\n", (begin, *body, end))


def _answer(value: Text, code: int = 1) -> Text:
    values = _list(_value(b"<i4>%d</i4>" % code), _value(), _value(*value))
    return _response((b"<params><param><value>", *values, b"</value></param></params>"))


def _fault(message: str) -> Text:
    code = b"<fault><value><struct><member><name>faultCode</name><value><i4>-1</i4></value></member>"
    text = b"<member><name>faultString</name><value>%s</value></member></struct></value></fault>" % message.encode()
    return _response((code, text))


def _header(*fields: str) -> Text:
    """A header of TCPROS: its length, and each field with its own."""
    encoded = [field.encode() for field in fields]
    length = sum(4 + len(field) for field in encoded)
    body = [piece for field in encoded for piece in (struct.pack("<I", len(field)), field)]
    return (struct.pack("<I", length), *body)


# The memory.


def _add_texts(rom: Rom, texts: Mapping[str, Text]) -> None:
    """Append all texts, after the pieces that several of them share."""
    counts = Counter(piece for text in texts.values() for piece in _pieces(text))
    words = [piece for piece, count in counts.items() if count > 1 and len(piece) >= _SHORTEST_WORD]
    for index, word in enumerate(words):
        rom.label(f"word_{index}")
        rom.add([len(word), *word])
    places = {word: rom.labels[f"word_{index}"] for index, word in enumerate(words)}
    for label, text in texts.items():
        rom.label(label)
        _add_text(rom, text, places)


def _pieces(text: Text) -> Iterable[bytes]:
    """The pieces of a text, divided where they are too long."""
    for piece in text:
        for begin in range(0, len(piece), _PIECE):
            yield piece[begin : begin + _PIECE]


def _add_text(rom: Rom, text: Text, places: Mapping[bytes, int]) -> None:
    room, literal = _BUFFER, b""

    def end_literal() -> None:
        nonlocal literal
        for begin in range(0, len(literal), _PIECE):
            part = literal[begin : begin + _PIECE]
            rom.add([len(part), *part])
        literal = b""

    for piece in _pieces(text):
        if len(piece) > room:
            end_literal()
            rom.add([_PART])
            room = _BUFFER
        room -= len(piece)
        if piece in places:
            end_literal()
            rom.add((0x8000 | places[piece]).to_bytes(2, "big"))
        else:
            literal += piece
    end_literal()
    rom.add([0])


def _add_tries(rom: Rom, node: Node) -> None:
    numbers = _constants(node, 5500)
    known = {method.encode(): index for index, method in enumerate(_METHODS, 1)}
    known |= {b"1": numbers["TEXT_ONE"], b"TCPROS": numbers["TEXT_TCPROS"]}
    known |= {topic.encode(): index for index, topic in enumerate(node.topics, numbers["TEXT_TOPICS"])}
    rom.add_trie("texts", known)
    rom.add_trie("tags", _TAGS)
    fields = {b"md5sum=*": _ANY_MD5, b"type=*": _ANY_TYPE}
    md5 = {item.type: item.md5 for item in node.subscribers + node.publishers}
    for index, name in enumerate(node.types):
        fields[f"md5sum={md5[name]}".encode()] = _FIRST_MD5 + index
        fields[f"type={name}".encode()] = _FIRST_TYPE + index
    for index, topic in enumerate(node.topics):
        fields[f"topic={topic}".encode()] = _FIRST_TOPIC + index
    rom.add_trie("header_fields", fields)


def _add_tables(rom: Rom, node: Node, texts: Mapping[str, Text]) -> None:
    for table in ("answer", "call", "request", "greeting", "header"):
        rom.add_table(f"{table}s", [label for label in texts if label.startswith(f"{table}_")])
    subscribers, publishers = node.subscribers, node.publishers
    rom.label("subscriber_of")
    rom.add(_index_of(subscribers, topic) for topic in node.topics)
    rom.label("publisher_of")
    rom.add(_index_of(publishers, topic) for topic in node.topics)
    rom.label("subscriber_type")
    rom.add(node.types.index(item.type) for item in subscribers)
    rom.label("publisher_type")
    rom.add(node.types.index(item.type) for item in publishers)
    rom.label("call_topics")
    registrations = len(subscribers) + len(publishers)
    rom.add([NONE] * (registrations + len(publishers)) + [*range(len(subscribers))])


def _index_of(items: Sequence[Endpoint], topic: str) -> int:
    return next((index for index, item in enumerate(items) if item.topic == topic), NONE)
