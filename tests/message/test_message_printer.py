"""The canonical text of a message, which reads back as the same message."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.dialect import Dialect
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import (
    ArrayType,
    Constant,
    DefaultValue,
    ElementType,
    Field,
    FieldType,
    MessageName,
    MessageType,
    PrimitiveType,
    Scalar,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.parser import dialect_of, parse_message
from fusesoc_firm.message.printer import to_text
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef

NOWHERE = SourceRef("", 0, 0)
NAME = MessageName("my_msgs", "Mine")


def parse(text: str, ros: Middleware) -> MessageDefinition:
    diagnostics = Diagnostics()
    definition = parse_message(text, NAME, ros, "Mine.msg", diagnostics)
    diagnostics.raise_if_any()
    return definition


def without_places(definition: MessageDefinition) -> MessageDefinition:
    """The definition without sources, and without a constant's spelling if it does not matter."""
    fields = tuple(replace(field, source=NOWHERE) for field in definition.fields)
    constants = tuple(
        replace(c, source=NOWHERE, text=c.text if definition.ros is ROS1 else "") for c in definition.constants
    )
    return replace(definition, fields=fields, constants=constants, source=NOWHERE)


def test_ros1_text() -> None:
    text = "Header header\nstring S=a # b\nuint8 LONGER=1\nbool B=False\nPoint[]   p\nuint8[3] xyz # lost"
    assert to_text(parse(text, ROS1)) == (
        "# my_msgs/Mine (ROS 1)\n"
        "\n"
        "string S      = a # b\n"
        "uint8  LONGER = 1\n"
        "bool   B      = False\n"
        "\n"
        "std_msgs/Header header\n"
        "my_msgs/Point[] p\n"
        "uint8[3]        xyz\n"
    )


def test_a_value_of_ros1_stays_as_it_was_written() -> None:
    text = "float32 A= +1.50 # one and a half\nint8 B=-07\nbool C=1"
    assert to_text(parse(text, ROS1)).splitlines()[2:] == [
        "float32 A = +1.50",
        "int8    B = -07",
        "bool    C = 1",
    ]


def test_ros2_text() -> None:
    text = "string<=5[<=2] names ['a', b]\nbool ok true\nint32 x\nstring NAME='say \"no\"'\nwstring w 'w'"
    assert to_text(parse(text, ROS2)) == (
        "# my_msgs/Mine (ROS 2)\n"
        "\n"
        'string NAME = "say \\"no\\""\n'
        "\n"
        'string<=5[<=2] names ["a", "b"]\n'
        "bool           ok    true\n"
        "int32          x\n"
        'wstring        w     "w"\n'
    )


def test_an_empty_message_has_only_its_header() -> None:
    assert to_text(parse("", ROS1)) == "# my_msgs/Mine (ROS 1)\n"


def test_a_signature_stands_in_the_header() -> None:
    text = to_text(parse("uint8 x", ROS2), "RIHS01_12")
    assert text == "# my_msgs/Mine (ROS 2)\n# signature: RIHS01_12\n\nuint8 x\n"


SIZES = st.integers(1, 2**32 - 1)


def texts(dialect: Dialect, largest: int | None) -> st.SearchStrategy[str]:
    """Strings that the version can express: one line, in ROS 2 without `#`, and in its defaults without `=`."""
    forbidden = "" if dialect.title == ROS1.title else "#="
    characters = st.characters(codec="utf-8", exclude_categories=("Cs", "Cc", "Zl", "Zp"), exclude_characters=forbidden)
    text = st.text(characters, max_size=min(12, largest) if largest else 12)
    return text.map(str.strip) if dialect.title == ROS1.title else text


def values(kind: PrimitiveType | StringType, dialect: Dialect) -> st.SearchStrategy[Scalar]:
    if isinstance(kind, StringType):
        return texts(dialect, kind.bound)
    if kind.name == "bool":
        return st.booleans()
    if kind.name in dialect.integer_ranges:
        return st.integers(*dialect.integer_ranges[kind.name])
    return st.floats(allow_nan=False, width=32 if kind.name == "float32" else 64)


def elements(dialect: Dialect) -> st.SearchStrategy[ElementType]:
    primitives = st.sampled_from(sorted(dialect.primitives)).map(PrimitiveType)
    bounds = st.none() | SIZES if dialect.has_bounds else st.none()
    wide = st.booleans() if "wstring" in dialect.strings else st.just(False)
    messages = st.builds(
        MessageName,
        st.from_regex(dialect.package_name.pattern, fullmatch=True).filter(dialect.package_name.accepts),
        st.just("Point"),
    )
    return primitives | st.builds(StringType, wide, bounds) | messages.map(MessageType)


def field_types(dialect: Dialect) -> st.SearchStrategy[FieldType]:
    element = elements(dialect)
    bounds = st.none() | SIZES if dialect.has_bounds else st.none()
    return (
        element
        | st.builds(ArrayType, element, st.integers(dialect.smallest_array, 4))
        | st.builds(SequenceType, element, bounds)
    )


def is_array_element(value: Scalar) -> bool:
    """Whether an array can contain the value: within an array, a string that ends in a backslash cannot be quoted."""
    if not isinstance(value, str) or not value.endswith("\\"):
        return True
    return value == value.strip() and value[0] not in "\"'" and "," not in value


@st.composite
def defaults(draw: st.DrawFn, kind: FieldType, dialect: Dialect) -> DefaultValue | None:
    element = kind.element if isinstance(kind, ArrayType | SequenceType) else kind
    if not dialect.has_defaults or isinstance(element, MessageType) or draw(st.booleans()):
        return None
    if not isinstance(kind, ArrayType | SequenceType):
        return draw(values(element, dialect))
    smallest, largest = (kind.length, kind.length) if isinstance(kind, ArrayType) else (0, min(4, kind.bound or 4))
    fitting = values(element, dialect).filter(is_array_element)
    return tuple(draw(st.lists(fitting, min_size=smallest, max_size=largest)))


@st.composite
def definitions(draw: st.DrawFn) -> MessageDefinition:
    ros = draw(st.sampled_from([ROS1, ROS2]))
    dialect = dialect_of(ros)
    names = st.lists(
        st.from_regex(dialect.field_name.pattern, fullmatch=True).filter(dialect.field_name.accepts),
        max_size=6,
        unique=True,
    )
    fields = []
    for name in draw(names):
        kind = draw(field_types(dialect))
        fields.append(Field(name, kind, NOWHERE, draw(defaults(kind, dialect))))
    constants = []
    constant_names = st.lists(
        st.from_regex(dialect.constant_name.pattern, fullmatch=True).filter(dialect.constant_name.accepts),
        max_size=4,
        unique=True,
    )
    for name in draw(constant_names):
        kinds = sorted(dialect.builtin_types - dialect.opaque_primitives)
        word = draw(st.sampled_from(kinds))
        constant_type = StringType(word == "wstring") if word in dialect.strings else PrimitiveType(word)
        if name not in {field.name for field in fields}:
            value = draw(values(constant_type, dialect))
            written = str(value) if ros is ROS1 else ""
            constants.append(Constant(name, constant_type, value, written, NOWHERE))
    return MessageDefinition(NAME, ros, tuple(fields), tuple(constants), NOWHERE)


@pytest.mark.parametrize("examples", [50, pytest.param(300, marks=pytest.mark.check)])
def test_text_reads_back(examples: int) -> None:
    @settings(deadline=None, max_examples=examples, print_blob=True)
    @given(definitions())
    def reads_back(definition: MessageDefinition) -> None:
        assert without_places(parse(to_text(definition), definition.ros)) == definition

    reads_back()
