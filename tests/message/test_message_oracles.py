"""Compares our parser with others: rosbags, genmsg (the reference for ROS 1) and rosidl_adapter (for ROS 2).

The comparisons with genmsg and rosidl_adapter run if these can be imported. For the comparison of whole corpora, the
environment variable CORPUS names a folder with `ros1/<package>/msg/*.msg` and `ros2/...`.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_types_from_msg

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import (
    ArrayType,
    DefaultValue,
    ElementType,
    FieldType,
    MessageName,
    MessageType,
    PrimitiveType,
    Scalar,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.parser import parse_message, parse_name
from fusesoc_firm.text.diagnostics import Diagnostics
from tests.typestores import typestore

CORPUS = os.environ.get("CORPUS", "")
needs_corpus = pytest.mark.skipif(not CORPUS, reason="CORPUS names no folder")

# The compared content: fields (name, type, default) and constants (name, type, value). None is a rejected text.
Content = tuple[list[tuple[str, FieldType, DefaultValue | None]], list[tuple[str, str, Scalar]]]


def content(definition: MessageDefinition) -> Content:
    return (
        [(field.name, field.type, field.default) for field in definition.fields],
        [(constant.name, str(constant.type), constant.value) for constant in definition.constants],
    )


def ours(text: str, name: MessageName, ros: Middleware) -> Content | None:
    diagnostics = Diagnostics()
    definition = parse_message(text, name, ros, "text", diagnostics)
    return None if diagnostics.found else content(definition)


# --- rosbags -----------------------------------------------------------------------------------------------------


def of_rosbags(kind: Any, ros: Middleware) -> FieldType:
    """A type in our model from rosbags' model, which treats ROS 1's `time` as a message and 0 as no bound."""
    tag, argument = kind
    if tag == Nodetype.ARRAY:
        return ArrayType(element_of_rosbags(argument[0], ros), argument[1])
    if tag == Nodetype.SEQUENCE:
        return SequenceType(element_of_rosbags(argument[0], ros), argument[1] or None)
    return element_of_rosbags(kind, ros)


def element_of_rosbags(kind: Any, ros: Middleware) -> ElementType:
    tag, argument = kind
    if tag == Nodetype.NAME:
        name = parse_name(argument)
        is_primitive = ros is ROS1 and name.package == "builtin_interfaces"
        return PrimitiveType(name.name.lower()) if is_primitive else MessageType(name)
    word, bound = argument
    return StringType(bound=bound or None) if word == "string" else PrimitiveType(word)


def content_of_rosbags(entry: Any, ros: Middleware) -> Content:
    constants, fields = entry
    # rosbags adds the member of an empty struct on ROS 2's wire, which is not in the definition.
    named = [(name, kind) for name, kind in fields if name != "structure_needs_at_least_one_member"]
    return [(name, of_rosbags(kind, ros), None) for name, kind in named], list(constants)


@pytest.mark.parametrize(
    ("ros", "distribution"),
    [(ros, name) for ros in (ROS1, ROS2) for name in ros.distributions()],
    ids=str,
)
def test_every_message_of_a_distribution_keeps_all_that_rosbags_knows(ros: Middleware, distribution: str) -> None:
    table = typestore(Stores(f"ros{ros.number}_{distribution}")).fielddefs
    library = MessageLibrary(ros, store=distribution)
    names = library.names()
    assert len(names) >= len(table) - 2 > 130  # without ROS 1's time and duration
    for name in names:
        assert content(library.get(name)) == content_of_rosbags(table[f"{name.package}/msg/{name.name}"], ros), name
        assert name in library.closure(name)


# --- the references ----------------------------------------------------------------------------------------------


def genmsg_content(text: str, name: MessageName) -> Content | None:
    """The content that genmsg reads, or None; it raises exceptions of many types."""
    loader = pytest.importorskip("genmsg.msg_loader")
    try:
        spec = loader.load_msg_from_string(loader.MsgContext.create_default(), text, str(name))
    except Exception:  # noqa: BLE001 - any exception is a rejection
        return None
    fields: Any = [(field.name, of_genmsg(field), None) for field in spec.parsed_fields()]
    return fields, [(constant.name, constant.type, constant.val) for constant in spec.constants]


def of_genmsg(field: Any) -> FieldType:
    word = field.base_type
    element: ElementType = MessageType(MessageName(*word.split("/", 1))) if "/" in word else PrimitiveType(word)
    element = StringType() if word == "string" else element
    if not field.is_array:
        return element
    return SequenceType(element) if field.array_len is None else ArrayType(element, field.array_len)


def rosidl_content(text: str, name: MessageName) -> Content | None:
    """The content that rosidl_adapter reads, or None; it prints, and raises exceptions of many types."""
    parser = pytest.importorskip("rosidl_adapter.parser")
    with contextlib.redirect_stderr(io.StringIO()):
        try:
            spec = parser.parse_message_string(name.package, name.name, text)
        except Exception:  # noqa: BLE001 - any exception is a rejection
            return None
    fields = [(field.name, of_rosidl(field.type), as_default(field.default_value)) for field in spec.fields]
    return fields, [(constant.name, constant.type, constant.value) for constant in spec.constants]


def as_default(value: Any) -> DefaultValue | None:
    return tuple(value) if isinstance(value, list) else value


def of_rosidl(kind: Any) -> FieldType:
    element: ElementType = PrimitiveType(kind.type)
    if kind.pkg_name:
        element = MessageType(MessageName(kind.pkg_name, kind.type))
    elif kind.type in ("time", "duration"):  # it parses these for compatibility, but cannot translate them
        element = MessageType(MessageName("builtin_interfaces", kind.type.capitalize()))
    elif kind.type in ("string", "wstring"):
        element = StringType(kind.type == "wstring", kind.string_upper_bound)
    if not kind.is_array:
        return element
    return ArrayType(element, kind.array_size) if kind.is_fixed_size_array() else SequenceType(element, kind.array_size)


Reference = Callable[[str, MessageName], Content | None]
NOT_IN_MSG = Path(__file__).parents[1] / "errors" / "msg" / "ros1" / "NotInMsg.msg"
REFERENCES = [pytest.param(ROS1, genmsg_content, id="genmsg"), pytest.param(ROS2, rosidl_content, id="rosidl_adapter")]

_TYPES = ["uint8", "int8", "byte", "char", "bool", "float32", "float64", "int64", "uint64", "string", "wstring"]
_TYPES += ["string<=3", "wstring<=2", "string<=0", "Foo", "pkg/Foo", "a/b/Foo", "time", "duration", "Header", "foo"]
# Features of other languages (`unsupported`): the references may read the words as messages, but reject other forms.
_TYPES += ["any", "map", "optional", "union", "typedef", "int8?", "map<int8,int8>", "@optional"]
_SIZES = ["", "", "", "", "", "[]", "[3]", "[0]", "[<=2]", "[-1]", "[<=0]", "[2][3]", "[x]", "["]
_FIELDS = ["x", "x9", "foo_bar", "a__b", "a_", "_a", "1a", "Foo", "a-b", ""]
_CONSTANTS = ["X", "X9_9", "FOO_BAR", "A__B", "A_", "_A", "1A", "Foo", "A-B", ""]
_NUMBERS = ["1", "-1", "0x10", "0b11", "0o7", "010", "1.5", "1_0", "256", "255", "-129", "128", "inf", "1e39"]
_NUMBERS += ["18446744073709551615", "18446744073709551616", "true", "True", "TRUE", "0", "False"]
_STRINGS = ["", '"a"', "abc", "'a", '"a"b"', "'it\\'s'", "#c", '"a#b"', '"a=b"', "''", "a b", "' a '"]
_ARRAYS = ["[]", "[ ]", "[1,2]", "[1, 2, 3]", "[1,]", "[true,false]", "[a]", "[\"a,b\",'c']", "['a]"]
_ARRAYS += ['["a" "b"]', '[a, "b"]', "['', \"b\"]", "[0x1F, 0, -1]", "[1.5,2,inf]"]
_VALUES = _NUMBERS + _STRINGS + _ARRAYS


def random_line(chance: random.Random) -> str:
    """A random declaration that is often valid or nearly so."""
    blank = chance.choice([" ", " ", " ", " ", "  ", " \t", "\t", ""])
    rest = chance.choice(_FIELDS)
    if (kind := chance.random()) < 0.4:
        rest = chance.choice(_CONSTANTS) + chance.choice(["=", " = ", "= ", " ="]) + chance.choice(_VALUES)
    elif kind < 0.7:
        rest += " " + chance.choice(_VALUES)
    indent = chance.choice(["", "", "", "", "", " "])
    return (
        indent + chance.choice(_TYPES) + chance.choice(_SIZES) + blank + rest + chance.choice(["", "", " # c", "# a=b"])
    )


def is_wider(line: str, ros: Middleware) -> bool:
    """Whether we deliberately accept a line that the reference rejects; docs/reference/messages.md lists these."""
    if ros is ROS1:
        return "\t" in line
    return line[0].isspace() or "[ ]" in line


def is_narrower(line: str, ros: Middleware) -> bool:
    """Whether we deliberately reject a line that the reference accepts; docs/reference/messages.md lists these."""
    code = line.partition("#")[0].strip()
    if "float32" in code and "1e39" in code:
        return True
    if ros is ROS2:
        return code.startswith(("time", "duration")) or '["a" "b"]' in code or "[1,]" in code
    # genmsg accepts any Python value for a bool, any text as a constant's name, and 2**64 for a uint64.
    declared, is_constant, value = code.partition("=")
    kind, _, name = declared.partition(" ")
    is_odd_constant = (
        kind == "bool" or re.fullmatch(r"[A-Za-z]\w*", name.strip()) is None or value.strip() == str(2**64)
    )
    return kind.startswith("a/b/Foo") or (is_constant == "=" and is_odd_constant)


@pytest.mark.parametrize(("ros", "reference"), REFERENCES)
def test_random_lines(ros: Middleware, reference: Reference) -> None:
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    chance = random.Random(seed)
    name = MessageName("my_msgs", "Mine")
    taken = 0
    for _ in range(8000):
        line = random_line(chance)
        mine, theirs = ours(line, name, ros), reference(line, name)
        if repr(mine) == repr(theirs):  # the text, since NaN is not equal to itself
            taken += mine is not None
        elif theirs is None:
            assert is_wider(line, ros), line
        elif mine is None:
            assert is_narrower(line, ros), line
        else:  # genmsg reads the type of an indented string constant as part of its name
            assert ros is ROS1, line
            assert line.lstrip().startswith("string") and line[0].isspace(), line
    assert taken > 200  # with fewer lines, the test would prove little


# --- the corpus --------------------------------------------------------------------------------------------------


def corpus(ros: Middleware) -> list[tuple[MessageName, str]]:
    paths = sorted(Path(CORPUS, f"ros{ros.number}").glob("*/msg/*.msg"))
    assert paths, "CORPUS has no ros1/<package>/msg/*.msg or ros2/..."
    return [(MessageName(path.parts[-3], path.stem), path.read_text(encoding="utf-8")) for path in paths]


@needs_corpus
@pytest.mark.parametrize(("ros", "reference"), REFERENCES)
def test_corpus_against_the_reference(ros: Middleware, reference: Reference) -> None:
    different, taken = [], 0
    for name, text in corpus(ros):
        mine = ours(text, name, ros)
        # ROS 2 has the feedback messages of actions, but rosidl_adapter rejects a file with such a name.
        asked = MessageName(name.package, name.name.removesuffix("_FeedbackMessage"))
        different += [str(name)] if mine != reference(text, asked) else []
        taken += mine is not None
    print(f"{ros.title}: {taken} definitions agree with the reference")
    assert different == []
    assert taken > 0


def rosbags_cannot_read(text: str, name: MessageName, ros: Middleware) -> bool:
    """Whether rosbags' parser is known to fail on a text, judged by our parser's result."""
    mine = ours(text, name, ros)
    if mine is None:
        return True
    types = [kind.element if isinstance(kind, ArrayType | SequenceType) else kind for _, kind, _ in mine[0]]
    has_mixed_case = any(constant != constant.upper() for constant, _, _ in mine[1])
    has_strings = any(kind in ("string", "wstring") for _, kind, _ in mine[1])  # quotes, comments, empty ones
    has_wide = any(isinstance(kind, StringType) and kind.is_wide for kind in types)
    # It expands these shorthands in both versions, and treats ROS 1's `time` as its `builtin_interfaces/Time`.
    is_short = re.search(r"^\s*(Header|time|duration)\b" if ros is ROS2 else "builtin_interfaces", text, re.MULTILINE)
    return has_mixed_case or has_strings or has_wide or is_short is not None or "\r" in text


@needs_corpus
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_corpus_against_rosbags(ros: Middleware) -> None:
    different, compared, excluded = [], 0, 0
    for name, text in corpus(ros):
        if rosbags_cannot_read(text, name, ros):
            excluded += 1
            continue
        compared += 1
        mine = ours(text, name, ros)
        assert mine is not None
        fields = [(field, kind, None) for field, kind, _ in mine[0]]  # rosbags drops default values
        full_name = f"{name.package}/msg/{name.name}"
        try:
            theirs = content_of_rosbags(get_types_from_msg(text, full_name)[full_name], ros)
        except TypesysError as error:
            different.append((str(name), str(error).splitlines()[-1]))
            continue
        different += [(str(name), "content")] if theirs != (fields, mine[1]) else []
    print(f"{ros.title}: {compared} definitions compared with rosbags, {excluded} left out")
    assert different == []
    assert compared > 10 * excluded


@pytest.mark.parametrize(("ros", "reference"), REFERENCES)
def test_what_msg_has_not_is_refused_by_the_reference_too(
    ros: Middleware, reference: Callable[[str, MessageName], Content | None]
) -> None:
    name = MessageName("my_msgs", "Sample")
    *lines, right = NOT_IN_MSG.read_text(encoding="utf-8").splitlines()
    assert reference(right, name) is not None
    assert [line for line in lines if reference(line, name) is not None or ours(line, name, ros) is not None] == []
