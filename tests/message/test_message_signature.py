"""MD5 sums and RIHS01 hashes: known ones, the rules one by one, and those of rosbags, genmsg.

genmsg is compared where it can be imported. The environment variable CORPUS names a folder with
`ros1/<package>/msg/*.msg` and `ros2/...`.
"""

from __future__ import annotations

import contextlib
import os
import random
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import (
    ArrayType,
    FieldType,
    MessageDefinition,
    MessageName,
    MessageType,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.parser import parse_message, parse_name
from fusesoc_firm.message.signature import md5, rihs01, signature
from fusesoc_firm.message.stores import DistributionStore
from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from tests.typestores import typestore

CORPUS = os.environ.get("CORPUS", "")
needs_corpus = pytest.mark.skipif(not CORPUS, reason="CORPUS names no folder")

Definitions = dict[MessageName, MessageDefinition]


def define(ros: Middleware, **texts: str) -> Definitions:
    """Messages of the package `my_msgs`."""
    diagnostics = Diagnostics()
    names = {name: MessageName("my_msgs", name) for name in texts}
    found = {names[n]: parse_message(text, names[n], ros, f"{n}.msg", diagnostics) for n, text in texts.items()}
    diagnostics.raise_if_any()
    return found


MINE = MessageName("my_msgs", "Mine")


def md5_of(text: str, **others: str) -> str:
    return md5(MINE, define(ROS1, Mine=text, **others))


def rihs01_of(text: str, **others: str) -> str:
    return rihs01(MINE, define(ROS2, Mine=text, **others))


# --- known signatures --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "expected"),  # as in the messages that Debian's ros_comm 1.15 generates
    [
        ("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1"),
        ("std_msgs/Empty", "d41d8cd98f00b204e9800998ecf8427e"),
        ("std_msgs/Header", "2176decaecbce78abc3b96ef049fabed"),
        ("sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743"),
        ("sensor_msgs/PointCloud2", "1158d486dd51d683ce2f1be655c3c181"),
        ("sensor_msgs/NavSatFix", "2d3a8cd499b9b4a0249fb98fd05cfa48"),
        ("nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
        ("actionlib_msgs/GoalStatus", "d388f9b87b3c471f784434d671988d4a"),
        ("diagnostic_msgs/DiagnosticArray", "60810da900de1dd6ddd437c3503511da"),
    ],
)
def test_known_md5_sums(name: str, expected: str) -> None:
    library = MessageLibrary(ROS1)
    assert signature(parse_name(name), library.closure(parse_name(name))) == expected


@pytest.mark.parametrize(
    ("name", "expected"),  # as in the type descriptions of ROS 2's packages
    [
        ("std_msgs/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        ("std_msgs/Empty", "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312"),
        ("std_msgs/Char", "3ad2d04dd29ba19d04b16659afa3ccaedd691914b02a64e82e252f2fa6a586a9"),
        ("std_msgs/Header", "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"),
        ("sensor_msgs/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
        ("sensor_msgs/PointCloud2", "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"),
        ("nav_msgs/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
        ("service_msgs/ServiceEventInfo", "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45"),
        ("diagnostic_msgs/DiagnosticArray", "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"),
    ],
)
def test_known_hashes(name: str, expected: str) -> None:
    library = MessageLibrary(ROS2)
    assert signature(parse_name(name), library.closure(parse_name(name))) == f"RIHS01_{expected}"


STRINGS = """
string string_value
string string_value_default1 "Hello world!"
string string_value_default2 "Hello'world!"
string string_value_default3 'Hello"world!'
string string_value_default4 'Hello\\'world!'
string string_value_default5 "Hello\\"world!"
string STRING_CONST="Hello world!"
string<=22 bounded_string_value
string<=22 bounded_string_value_default1 "Hello world!"
string<=22 bounded_string_value_default2 "Hello'world!"
string<=22 bounded_string_value_default3 'Hello"world!'
string<=22 bounded_string_value_default4 'Hello\\'world!'
string<=22 bounded_string_value_default5 "Hello\\"world!"
"""
WIDE_STRINGS = """
wstring wstring_value
wstring wstring_value_default1 "Hello world!"
wstring wstring_value_default2 "Hellö wörld!"
wstring wstring_value_default3 "ハローワールド"
wstring[3] array_of_wstrings
wstring[<=3] bounded_sequence_of_wstrings
wstring[] unbounded_sequence_of_wstrings
"""


@pytest.mark.parametrize(
    ("name", "text", "expected"),  # as in ROS 2's package test_msgs
    [
        ("Strings", STRINGS, "eee55533636293ac7c94c62432eedb5777eb849847d2a17b4dcead8c4a20ab32"),
        ("WStrings", WIDE_STRINGS, "5a2c8ddb2054600023b9a180652f2ba895373217cad4b1f0fc1258c9e4424a79"),
    ],
)
def test_known_hashes_of_all_kinds_of_strings(name: str, text: str, expected: str) -> None:
    message, diagnostics = MessageName("test_msgs", name), Diagnostics()
    definition = parse_message(text, message, ROS2, "", diagnostics)
    diagnostics.raise_if_any()
    assert rihs01(message, {message: definition}) == f"RIHS01_{expected}"


# --- the rules of each -------------------------------------------------------------------------------------------


def test_an_md5_sum_knows_no_comments_and_blanks() -> None:
    assert md5_of("uint8 x\nfloat64[3]  y # metres\n") == md5_of("\ufeff# A message\r\n\r\nuint8\tx\r\nfloat64[3] y")


def test_an_md5_sum_has_constants_in_front() -> None:
    assert md5_of("uint8 x\nuint8 A=1\nuint8 y\nuint8 B=2") == md5_of("uint8 A=1\nuint8 B=2\nuint8 x\nuint8 y")
    assert md5_of("uint8 A=1\nuint8 B=2") != md5_of("uint8 B=2\nuint8 A=1")


@pytest.mark.parametrize(("one", "other"), [("1", "+1"), ("1", "01"), ("1", "2")])
def test_an_md5_sum_takes_a_value_as_it_is_written(one: str, other: str) -> None:
    assert md5_of(f"uint8 A={one}") == md5_of(f"uint8 A =  {one} # one")
    assert md5_of(f"uint8 A={one}") != md5_of(f"uint8 A={other}")


def test_an_md5_sum_takes_the_rest_of_a_strings_line() -> None:
    assert md5_of("string A=1") == md5_of("string A =  1  ") != md5_of("string A=1 # one")


def test_an_md5_sum_knows_a_nested_message_by_content_only() -> None:
    one = md5_of("Part[3] parts", Part="uint8 x")
    assert one == md5_of("Other parts", Other="uint8 x")
    assert one != md5_of("Part[3] parts", Part="uint8 y")
    assert md5_of("uint8[3] x") != md5_of("uint8[] x") != md5_of("uint8 x")


def test_a_hash_knows_neither_constants_nor_defaults() -> None:
    plain = rihs01_of("uint8 x\nstring<=4 s")
    assert plain == rihs01_of("uint8 x 3  # three\nuint8 A=4\nstring<=4 s 'abc'")


def test_a_hash_knows_nested_messages_by_name_in_any_order() -> None:
    assert rihs01_of("Part a\nOther b", Part="uint8 x", Other="uint8 x") == rihs01_of(
        "Part a\nOther b", Other="uint8 x", Part="uint8 x"
    )
    assert rihs01_of("Part a", Part="uint8 x") != rihs01_of("Other a", Other="uint8 x")
    assert rihs01_of("Part a", Part="uint8 x") != rihs01_of("Part a", Part="uint8 y")


@pytest.mark.parametrize("kind", ["uint8[]", "uint8[<=2]", "uint8[<=3]", "uint8[3]", "int8[3]", "string", "string<=3"])
def test_a_hash_knows_sizes_and_bounds(kind: str) -> None:
    assert rihs01_of(f"{kind} x") != rihs01_of("uint8[2] x")


def test_a_message_that_is_not_there() -> None:
    for sum_or_hash in (md5_of, rihs01_of):
        with pytest.raises(KeyError, match="Missing"):
            sum_or_hash("Missing m")


# --- rosbags -----------------------------------------------------------------------------------------------------


def rosbags_name(name: MessageName) -> str:
    return f"{name.package}/msg/{name.name}"


def rosbags_signature(store: Typestore, name: MessageName, ros: Middleware) -> str | None:
    """None for what holds a wide string: rosbags has none."""
    if ros is ROS1:
        return store.generate_msgdef(rosbags_name(name))[1]
    try:
        return store.hash_rihs01(rosbags_name(name))
    except KeyError:
        return None


def has_rosbags_wrong(definition: MessageDefinition) -> bool:
    """Whether rosbags is known to give what holds this message another signature."""
    if definition.ros is ROS1:  # it writes a constant's value anew
        return any(constant.text != str(constant.value) for constant in definition.constants)
    # It hashes a `char` as IDL's, which rosidl_adapter never makes of it; test_known_hashes has two real ones.
    words = {str(field.type).partition("[")[0].partition("<")[0] for field in definition.fields}
    return not words.isdisjoint({"char", "wstring"})


def different_from_rosbags(closures: dict[MessageName, Definitions], store: Typestore, ros: Middleware) -> list[str]:
    """The messages whose signature is rosbags' though it is known to be wrong, or is not though it should be."""
    return [
        str(name)
        for name, closure in closures.items()
        if (signature(name, closure) != rosbags_signature(store, name, ros))
        != any(has_rosbags_wrong(definition) for definition in closure.values())
    ]


@pytest.mark.parametrize(
    ("ros", "distribution"),
    [(ros, name) for ros in (ROS1, ROS2) for name in ros.distributions()],
    ids=str,
)
def test_every_message_of_a_distribution_has_the_signature_of_rosbags(ros: Middleware, distribution: str) -> None:
    library = MessageLibrary(ros, store=distribution)
    closures = {name: library.closure(name) for name in library.names()}
    store = typestore(Stores(f"ros{ros.number}_{distribution}"))
    assert different_from_rosbags(closures, store, ros) == []
    assert len(closures) > 130


# --- genmsg, and the corpus --------------------------------------------------------------------------------------


def genmsg_md5(texts: dict[MessageName, str]) -> Callable[[MessageName], str | None]:
    """The sum that genmsg gives one of these messages; None where it refuses it, or one that it holds."""
    loader = pytest.importorskip("genmsg.msg_loader")
    gentools = pytest.importorskip("genmsg.gentools")
    context = loader.MsgContext.create_default()
    specs = {}
    for name, text in texts.items():
        with contextlib.suppress(Exception):  # whatever it raises is a refusal
            specs[name] = loader.load_msg_from_string(context, text, str(name))

    def md5_sum(name: MessageName) -> str | None:
        with contextlib.suppress(Exception):
            return str(gentools.compute_md5(context, specs[name]))
        return None

    return md5_sum


_TYPES = ["uint8", "char", "byte", "bool", "float32", "string", "time", "duration", "Part", "my_msgs/Part", "Header"]
_VALUES = {
    "bool": ["True", "False", "0"],
    "float32": ["1", "1.50", "+1e3", "-.5", "nan"],
    "string": ["", " a # b ", "="],
}
_BLANKS = [" ", "  ", "   "]


def random_message(chance: random.Random) -> str:
    lines = []
    for number in range(chance.randrange(8)):
        kind, blank = chance.choice(_TYPES), chance.choice(_BLANKS)
        if chance.random() < 0.5 and kind in ("uint8", "char", "byte", *_VALUES):
            value = chance.choice(_VALUES.get(kind, ["1", "+1", "007", "12 # twelve"]))
            lines.append(f"{kind}{blank}C{number}{chance.choice(['=', ' =', ' = '])}{value}")
        else:
            size = "" if kind == "Header" else chance.choice(["", "", "[]", "[3]"])
            lines.append(f"{kind}{size}{blank}f{number}{chance.choice(['', ' ', ' # c'])}")
    return chance.choice(["\n", "\n\n", "\n# c\n"]).join(lines)


def test_random_messages_have_the_sums_of_genmsg() -> None:
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    chance = random.Random(seed)
    header = MessageName("std_msgs", "Header")
    for _ in range(300):
        mine, part = random_message(chance), "uint8 A= 01\nHeader header\nfloat64[2] xy"
        definitions = define(ROS1, Mine=mine, Part=part) | MessageLibrary(ROS1).closure(header)
        texts = {header: "uint32 seq\ntime stamp\nstring frame_id", MessageName("my_msgs", "Part"): part, MINE: mine}
        assert md5(MINE, definitions) == genmsg_md5(texts)(MINE), mine


class Corpus:
    """The messages of the corpus, and those of the distribution that they hold."""

    def __init__(self, ros: Middleware) -> None:
        self._library = MessageLibrary(ros, [Path(CORPUS, f"ros{ros.number}")])
        self.names = [name for name in self._library.names() if self._library.files([name])]
        # Messages whose parts are all known and right; each part is in the corpus or in the distribution.
        self.closures: dict[MessageName, Definitions] = {}
        for name in self.names:
            with contextlib.suppress(InputError):
                self.closures[name] = self._library.closure(name)
        store = DistributionStore(ros.number)
        parts = {part for closure in self.closures.values() for part in closure}
        self.texts = {part: store.text(part) for part in parts - set(self.names)}
        for name in self.names:
            self.texts[name] = self._library.content(name).decode()


@needs_corpus
def test_corpus_against_genmsg() -> None:
    corpus = Corpus(ROS1)
    reference = genmsg_md5(corpus.texts)
    different = [str(name) for name, closure in corpus.closures.items() if md5(name, closure) != reference(name)]
    refused = [str(name) for name in corpus.names if name not in corpus.closures and reference(name) is not None]
    print(f"ROS 1: {len(corpus.closures)} of {len(corpus.names)} messages compared with genmsg")
    assert (different, refused) == ([], [])
    assert corpus.closures


def rosbags_type(kind: FieldType) -> Any:
    """A type in rosbags' model."""
    if isinstance(kind, ArrayType):
        return Nodetype.ARRAY, (rosbags_type(kind.element), kind.length)
    if isinstance(kind, SequenceType):
        return Nodetype.SEQUENCE, (rosbags_type(kind.element), kind.bound or 0)
    if isinstance(kind, MessageType):
        return Nodetype.NAME, rosbags_name(kind.name)
    if isinstance(kind, StringType):
        return Nodetype.BASE, ("wstring" if kind.is_wide else "string", kind.bound or 0)
    if kind.name in ("time", "duration"):
        return Nodetype.NAME, f"builtin_interfaces/msg/{kind.name.capitalize()}"
    return Nodetype.BASE, (kind.name, 0)


def rosbags_store(definitions: Iterable[MessageDefinition]) -> Typestore:
    """A store of our reading of messages, since rosbags' own fails on many of the corpus."""
    store = get_typestore(Stores.EMPTY)
    for definition in definitions:
        constants: list[Any] = [
            (constant.name, str(constant.type), constant.value) for constant in definition.constants
        ]
        fields = [(field.name, rosbags_type(field.type)) for field in definition.fields]
        store.fielddefs[rosbags_name(definition.name)] = (constants, fields)
    return store


@needs_corpus
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_corpus_against_rosbags(ros: Middleware) -> None:
    corpus = Corpus(ros)
    closures = corpus.closures
    store = rosbags_store(definition for closure in closures.values() for definition in closure.values())
    assert different_from_rosbags(closures, store, ros) == []
    wrong = sum(any(has_rosbags_wrong(part) for part in closure.values()) for closure in closures.values())
    print(f"{ros.title}: {len(closures)} of {len(corpus.names)} messages compared with rosbags, wrong there: {wrong}")
    assert len(closures) > 10 * wrong
