"""A system as a node of ROS 1 in the sockets of a W5500 or W5200: the memory of its sequencer.

The memory has the program `ros1_node.seq`, all texts that the node sends, and tries of the strings that it recognises.
Messages follow the master's and the slave's API of ROS, XML-RPC and TCPROS. Texts are pieces; pieces that several texts
share are stored once.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from ipaddress import IPv4Address
from pathlib import Path

from fusesoc_firm.fabric.sequencer import Assembler, Rom
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import InterfaceKind
from fusesoc_firm.message.printer import closure_text
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.derived.chip import MOST_TOPICS, MOST_TYPES
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, Network, Service
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
    "TX_READ": 0x22,
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
    "SEND_KEEP": 0x22,
    "RECV": 0x40,
}
_STATES = {"LISTEN": 0x14, "SYN_RECEIVED": 0x16, "ESTABLISHED": 0x17, "CLOSE_WAIT": 0x1C}
# The differences between the chips: the register with an interrupt bit for each socket, the PHY's register with its
# link bit, and the interrupt after which a W5200 may need another SEND.
_CHIPS = {
    5500: {"INTERRUPTS": 0x17, "LINK": 0x2E, "LINK_IS_UP": 0x01, "SENT_AGAIN": 0},
    5200: {"INTERRUPTS": 0x34, "LINK": 0x35, "LINK_IS_UP": 0x20, "SENT_AGAIN": 0x10},
}
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
# A text is sent in parts of at most the chip's transmit buffer.
_BUFFER = 2048
_PIECE = 124
_PART = 127
_SHORTEST_WORD = 4
# The sequencer's unit of time in seconds, and the longest time until an alarm in these units.
_UNIT = 0.064
_LONGEST_PERIOD = 125


class Insert(IntEnum):
    """The texts inserted during transmission, with their codes in the ROM."""

    REFUSED = 125
    UNKNOWN = 126


_INSERTED_BYTES = {Insert.REFUSED: 4, Insert.UNKNOWN: 1}
Piece = bytes | Insert
Text = tuple[Piece, ...]


@dataclass(frozen=True)
class Endpoint:
    """A topic by its absolute name, with its type, the type's MD5 sum, and the text of its definition."""

    topic: str
    type: str
    md5: str
    definition: str


@dataclass(frozen=True)
class Server:
    """A service by its absolute name, with its type and MD5 sum, and the ids of its frames.

    The hardware answers within `time_limit` seconds.
    """

    name: str
    type: str
    md5: str
    request: int
    response: int
    time_limit: float


@dataclass(frozen=True)
class Node:
    """A node: its absolute name, its place in the network, its master's, its topics and services.

    The topics of each direction have the ids that services do not use, in order.
    """

    name: str
    network: Network
    master: tuple[IPv4Address, int]
    subscribers: tuple[Endpoint, ...]
    publishers: tuple[Endpoint, ...]
    services: tuple[Server, ...] = ()
    port: int = PORT

    @property
    def types(self) -> tuple[str, ...]:
        """The types of all topics, without repetition."""
        return tuple(dict.fromkeys(item.type for item in self.subscribers + self.publishers))

    @property
    def sums(self) -> tuple[str, ...]:
        """All MD5 sums, without repetition: several types may have the same one."""
        return tuple(dict.fromkeys(item.md5 for item in (*self.to_hardware.values(), *self.from_hardware.values())))

    @property
    def topics(self) -> tuple[str, ...]:
        """The names of all topics, without repetition."""
        return tuple(dict.fromkeys(item.topic for item in self.subscribers + self.publishers))

    @property
    def to_hardware(self) -> dict[int, Endpoint | Server]:
        """The topics and services of frames to the hardware, by id."""
        return _by_id(self.subscribers, {item.request: item for item in self.services})

    @property
    def from_hardware(self) -> dict[int, Endpoint | Server]:
        """The topics and services of frames from the hardware, by id."""
        return _by_id(self.publishers, {item.response: item for item in self.services})

    def uri(self) -> str:
        """Return the URI of its XML-RPC server."""
        return _uri(self.network.address, self.port)

    def service_uri(self) -> str:
        """Return the URI of its services."""
        return f"rosrpc://{self.network.address}:{self.port}"


def _by_id(topics: Collection[Endpoint], services: Mapping[int, Server]) -> dict[int, Endpoint | Server]:
    rest = iter(topics)
    return {number: services.get(number) or next(rest) for number in range(len(topics) + len(services))}


def node_of(system: DerivedSystem, libraries: Mapping[Middleware, MessageLibrary]) -> Node:
    """Return the node of a system in the sockets of a chip."""
    library, network = libraries[ROS1], system.network
    assert network is not None
    assert network.master is not None
    space = network.namespace.rstrip("/")

    def absolute(name: str) -> str:
        return name if name.startswith("/") else f"{space}/{name}"

    def endpoint(topic: Converter) -> Endpoint:
        message = topic.frame.message
        definitions = library.closure(message)
        sum_, text = signature(message, definitions), closure_text(message, definitions)
        return Endpoint(absolute(topic.ros_name), str(message), sum_, text)

    def server(service: Service) -> Server:
        interface = library.interface(service.type, InterfaceKind.SERVICE)
        assert interface is not None, "the system could be derived"
        sum_ = signature(service.type, library.joint_closure(interface.messages), InterfaceKind.SERVICE)
        ids = ids_of[service.request], ids_of[service.response]
        return Server(absolute(service.ros_name), str(service.type), sum_, *ids, service.time_limit)

    ids_of = {item.block: item.id for item in (*system.subscribers, *system.publishers)}
    sides = (system.subscribers, system.publishers)
    subscribers, publishers = (tuple(endpoint(item) for item in side if not item.service) for side in sides)
    services = tuple(map(server, system.services))
    return Node(f"{space}/{network.name}", network, network.master, subscribers, publishers, services)


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
    rom.label("failure")
    rom.add(_FAILURE)
    network = node.network
    rom.label("addresses")
    gateway = network.gateway.packed if network.gateway else bytes(4)
    rom.add(gateway + network.netmask.packed + network.mac + network.address.packed)
    rom.label("master")
    rom.add(node.master[0].packed + node.master[1].to_bytes(2, "big"))
    rom.add([0])  # the sequencer reads one byte more than it sends
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
        "TEXT_HOSTS": len(_METHODS) + 3,
        "TEXT_TOPICS": len(_METHODS) + 3 + len(node.network.hosts),
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
    registrations = len(node.subscribers) + len(node.publishers) + len(node.services)
    return {
        **_REGISTERS,
        **_COMMANDS,
        **_STATES,
        **own,
        **methods,
        **tags,
        **fields,
        **_CHIPS[chip],
        "FAILURE_BYTES": len(_FAILURE),
        "OWN_PORT_HIGH": node.port >> 8,
        "OWN_PORT_LOW": node.port & 0xFF,
        "UNREGISTRATIONS": registrations,
        "CALLS": 2 * registrations,
    }


# Texts, by their labels.


def _texts(node: Node) -> dict[str, Text]:
    texts = {f"answer_{index}": text for index, text in enumerate(_answers(node))}
    texts |= {f"call_{index}": text for index, text in enumerate(_calls(node))}
    name = f"callerid={node.name}"
    for number, item in node.to_hardware.items():
        if isinstance(item, Server):
            types = (f"request_type={item.type}Request", f"response_type={item.type}Response")
            texts[f"greeting_{number}"] = _header(name, f"md5sum={item.md5}", *types, f"type={item.type}")
        else:
            protocols = _list(_value(*_list(_value(b"TCPROS"))))
            texts[f"request_{number}"] = _call("requestTopic", node.name.encode(), item.topic.encode(), protocols)
            fields = (f"md5sum={item.md5}", "tcp_nodelay=1", f"topic={item.topic}", f"type={item.type}")
            texts[f"greeting_{number}"] = _header(name, *fields)
    for number, item in node.from_hardware.items():
        if isinstance(item, Endpoint):
            definition = f"message_definition={item.definition}"
            lines = ("latching=0", f"md5sum={item.md5}", definition, f"topic={item.topic}", f"type={item.type}")
            texts[f"header_{number}"] = _header(name, *lines)
    texts["refusal"] = _header("error=topic, service, type or md5sum is not that of the node")
    return texts


def _answers(node: Node) -> list[Text]:
    """The answers of the slave API: a fault, then those of all methods in their order, and that of an unknown topic."""
    own = str(node.network.address).encode()
    counts: Text = (b"refused peers: ", Insert.REFUSED, b", unknown host: ", Insert.UNKNOWN)

    def topics(items: Iterable[Endpoint]) -> Text:
        return _list(*(_value(*_list(_value(item.topic.encode()), _value(item.type.encode()))) for item in items))

    return [
        _fault("no such method"),
        _answer((b"<i4>0</i4>",)),
        _answer(_list(_value(b"TCPROS"), _value(own), _value(b"<i4>%d</i4>" % node.port))),
        _answer((b"<i4>1</i4>",)),
        _answer(_list()),
        _answer(_list(*[_value(*_list())] * 3), message=counts),
        _answer((_uri(*node.master).encode(),)),
        _answer(topics(node.subscribers)),
        _answer(topics(node.publishers)),
        _answer((b"<i4>0</i4>",)),
        _answer((b"<i4>0</i4>",)),
        _answer((b"<i4>0</i4>",), code=0),
    ]


def _calls(node: Node) -> Iterable[Text]:
    """Return the calls to the master: first those that undo a registration before a reset, then the others."""
    name, uri, services = node.name.encode(), node.uri().encode(), node.service_uri().encode()
    kinds = ((b"Publisher", node.publishers), (b"Subscriber", node.subscribers))
    for kind, items in kinds:
        for item in items:
            yield _call("unregister" + kind.decode(), name, item.topic.encode(), uri)
    for service in node.services:
        yield _call("unregisterService", name, service.name.encode(), services)
    for kind, items in kinds:
        for item in items:
            yield _call("register" + kind.decode(), name, item.topic.encode(), item.type.encode(), uri)
    for service in node.services:
        yield _call("registerService", name, service.name.encode(), services, uri)


def _uri(address: IPv4Address, port: int) -> str:
    return f"http://{address}:{port}/"


def _value(*text: Piece) -> Text:
    return (b"<value>", *text, b"</value>")


def _list(*values: Text) -> Text:
    return (b"<array><data>", *(piece for value in values for piece in value), b"</data></array>")


def _http(first: bytes, body: Text) -> Text:
    length = sum(map(_size, body))
    return (first, b"Content-Type: text/xml\r\nContent-Length: ", b"%d" % length, b"\r\n\r\n", *body)


def _call(method: str, *parameters: bytes | Text) -> Text:
    body: list[Piece] = [b'<?xml version="1.0"?><methodCall><methodName>', method.encode(), b"</methodName><params>"]
    for item in parameters:
        body += [b"<param><value>", *((item,) if isinstance(item, bytes) else item), b"</value></param>"]
    return _http(b"POST / HTTP/1.0\r\n", (*body, b"</params></methodCall>"))


def _response(body: Text) -> Text:
    begin, end = b'<?xml version="1.0"?><methodResponse>', b"</methodResponse>"
    return _http(b"HTTP/1.0 200 OK\r\n", (begin, *body, end))


def _answer(value: Text, code: int = 1, message: Text = ()) -> Text:
    values = _list(_value(b"<i4>%d</i4>" % code), _value(*message), _value(*value))
    return _response((b"<params><param><value>", *values, b"</value></param></params>"))


def _fault(message: str) -> Text:
    code = b"<fault><value><struct><member><name>faultCode</name><value><i4>-1</i4></value></member>"
    text = b"<member><name>faultString</name><value>%s</value></member></struct></value></fault>" % message.encode()
    return _response((code, text))


def _header(*fields: str) -> Text:
    """A header of TCPROS: its length, and each field with its length."""
    encoded = [field.encode() for field in fields]
    length = sum(4 + len(field) for field in encoded)
    body = [piece for field in encoded for piece in (struct.pack("<I", len(field)), field)]
    return (struct.pack("<I", length), *body)


def _failed(reason: bytes) -> bytes:
    """The response to a call that has failed."""
    return b"\0" + struct.pack("<I", len(reason)) + reason


_FAILURE = _failed(b"the hardware did not answer")


# The memory.


def _add_texts(rom: Rom, texts: Mapping[str, Text]) -> None:
    """Append all texts, after the pieces that several of them share."""
    counts = Counter(piece for text in texts.values() for piece in _pieces(text) if isinstance(piece, bytes))
    words = [piece for piece, count in counts.items() if count > 1 and len(piece) >= _SHORTEST_WORD]
    for index, word in enumerate(words):
        rom.label(f"word_{index}")
        rom.add([len(word), *word])
    places = {word: rom.labels[f"word_{index}"] for index, word in enumerate(words)}
    for label, text in texts.items():
        rom.label(label)
        _add_text(rom, text, places)


def _size(piece: Piece) -> int:
    return _INSERTED_BYTES[piece] if isinstance(piece, Insert) else len(piece)


def _pieces(text: Text) -> Iterable[Piece]:
    """The pieces of a text, divided where they are too long."""
    for piece in text:
        if isinstance(piece, Insert):
            yield piece
        else:
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
        if _size(piece) > room:
            end_literal()
            rom.add([_PART])
            room = _BUFFER
        room -= _size(piece)
        if isinstance(piece, Insert):
            end_literal()
            rom.add([piece])
        elif piece in places:
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
    hosts = node.network.hosts
    known |= {f"http://{host.name}:".encode(): index for index, host in enumerate(hosts, numbers["TEXT_HOSTS"])}
    known |= {topic.encode(): index for index, topic in enumerate(node.topics, numbers["TEXT_TOPICS"])}
    rom.add_trie("texts", known)
    rom.add_trie("tags", _TAGS)
    fields = {"md5sum=*": _ANY_MD5, "type=*": _ANY_TYPE}
    fields |= {f"md5sum={item}": index for index, item in enumerate(node.sums, _FIRST_MD5)}
    fields |= {f"type={name}": index for index, name in enumerate(node.types, _FIRST_TYPE)}
    names = [*(f"topic={topic}" for topic in node.topics), *(f"service={item.name}" for item in node.services)]
    fields |= {name: index for index, name in enumerate(names, _FIRST_TOPIC)}
    rom.add_trie("header_fields", {text.encode(): index for text, index in fields.items()})


def _add_tables(rom: Rom, node: Node, texts: Mapping[str, Text]) -> None:
    for table in ("answer", "call"):
        rom.add_table(f"{table}s", [label for label in texts if label.startswith(f"{table}_")])
    taken, given = node.to_hardware, node.from_hardware
    for table, numbers in (("request", taken), ("greeting", taken), ("header", given)):
        labels = [f"{table}_{number}" for number in numbers]
        # Some tables have no text for services; these entries are never read.
        rom.add_table(f"{table}s", [label if label in texts else "refusal" for label in labels])
    limits = [_periods(item.time_limit) if isinstance(item, Server) else (0, 0) for item in taken.values()]
    tables: dict[str, Iterable[int]] = {
        "subscriber_of": [_id_of(taken, topic) for topic in node.topics],
        "publisher_of": [_id_of(given, topic) for topic in node.topics],
        "request_for": [*[NONE] * len(node.topics), *(item.request for item in node.services)],
        "request_of": [item.request if isinstance(item, Server) else NONE for item in given.values()],
        "subscriber_sum": [node.sums.index(item.md5) for item in taken.values()],
        "publisher_sum": [node.sums.index(item.md5) for item in given.values()],
        "publisher_type": [0 if isinstance(item, Server) else node.types.index(item.type) for item in given.values()],
        "time_limits": [periods for periods, _ in limits],
        "time_periods": [units for _, units in limits],
        "call_topics": _topics_of_calls(node),
    }
    tables |= {f"hosts_{index}": [item.address.packed[index] for item in node.network.hosts] for index in range(4)}
    for label, data in tables.items():
        rom.label(label)
        rom.add(data)


def _topics_of_calls(node: Node) -> list[int]:
    """For each of `_calls`, the id of the topic whose publishers the answer lists."""
    registrations = len(node.publishers) + len(node.subscribers) + len(node.services)
    before, after = registrations + len(node.publishers), len(node.services)
    ids = [number for number, item in node.to_hardware.items() if isinstance(item, Endpoint)]
    return [*[NONE] * before, *ids, *[NONE] * after]


def _periods(seconds: float) -> tuple[int, int]:
    """Return a number of periods, and the units of each, that cover a time limit; the first unit may be short."""
    units = math.ceil(seconds / _UNIT) + 1
    periods = math.ceil(units / _LONGEST_PERIOD)
    return periods, math.ceil(units / periods)


def _id_of(items: Mapping[int, Endpoint | Server], topic: str) -> int:
    found = (number for number, item in items.items() if isinstance(item, Endpoint) and item.topic == topic)
    return next(found, NONE)
