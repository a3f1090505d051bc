"""Each rule of the `.msg` grammar, in both versions; the expected results are those of genmsg and rosidl_adapter."""

from __future__ import annotations

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import (
    ArrayType,
    FieldType,
    InterfaceKind,
    MessageName,
    MessageType,
    PrimitiveType,
    Scalar,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.parser import (
    action_names,
    parse_full_name,
    parse_message,
    parse_name,
    parse_sections,
    service_names,
)
from fusesoc_firm.text.diagnostics import Diagnostics, InputError

NAME = MessageName("my_msgs", "Mine")
SERVICE = MessageName("my_msgs", "Add")


def parse(text: str, ros: Middleware) -> MessageDefinition:
    diagnostics = Diagnostics()
    definition = parse_message(text, NAME, ros, "Mine.msg", diagnostics)
    diagnostics.raise_if_any()
    return definition


def faults(text: str, ros: Middleware) -> list[str]:
    """Each fault as `line:column message`."""
    diagnostics = Diagnostics()
    parse_message(text, NAME, ros, "Mine.msg", diagnostics)
    return [f"{d.source.line}:{d.source.column} {d.message}" for d in diagnostics.found if d.source]


def primitive(name: str) -> PrimitiveType:
    return PrimitiveType(name)


def message(package: str, name: str) -> MessageType:
    return MessageType(MessageName(package, name))


BOTH = [ROS1, ROS2]


@pytest.mark.parametrize("ros", BOTH)
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("bool", primitive("bool")),
        ("byte", primitive("byte")),
        ("char", primitive("char")),
        ("uint64", primitive("uint64")),
        ("float32", primitive("float32")),
        ("string", StringType()),
        ("uint8[]", SequenceType(primitive("uint8"))),
        ("uint8[16]", ArrayType(primitive("uint8"), 16)),
        ("uint8[4294967295]", ArrayType(primitive("uint8"), 2**32 - 1)),
        ("string[2]", ArrayType(StringType(), 2)),
        ("Point", message("my_msgs", "Point")),
        ("Point[]", SequenceType(message("my_msgs", "Point"))),
        ("geometry_msgs/Point", message("geometry_msgs", "Point")),
        ("geometry_msgs/Point[3]", ArrayType(message("geometry_msgs", "Point"), 3)),
    ],
)
def test_types_of_both_versions(text: str, expected: FieldType, ros: Middleware) -> None:
    assert [field.type for field in parse(f"{text} x", ros).fields] == [expected]


@pytest.mark.parametrize(
    ("text", "ros", "expected"),
    [
        ("time", ROS1, primitive("time")),
        ("duration[]", ROS1, SequenceType(primitive("duration"))),
        ("Header", ROS1, message("std_msgs", "Header")),
        ("Header[]", ROS1, SequenceType(message("my_msgs", "Header"))),  # genmsg expands only the bare word
        ("lower", ROS1, message("my_msgs", "lower")),
        ("uint8[0]", ROS1, ArrayType(primitive("uint8"), 0)),
        ("wstring", ROS1, message("my_msgs", "wstring")),
        ("time", ROS2, message("builtin_interfaces", "Time")),
        ("duration[2]", ROS2, ArrayType(message("builtin_interfaces", "Duration"), 2)),
        ("Header", ROS2, message("my_msgs", "Header")),
        ("geometry_msgs/msg/Point", ROS2, message("geometry_msgs", "Point")),
        ("Fibonacci_FeedbackMessage", ROS2, message("my_msgs", "Fibonacci_FeedbackMessage")),
        ("wstring", ROS2, StringType(is_wide=True)),
        ("string<=10", ROS2, StringType(bound=10)),
        ("wstring<=4", ROS2, StringType(is_wide=True, bound=4)),
        ("uint8[<=5]", ROS2, SequenceType(primitive("uint8"), 5)),
        ("string<=5[<=10]", ROS2, SequenceType(StringType(bound=5), 10)),
        ("string<=5[3]", ROS2, ArrayType(StringType(bound=5), 3)),
    ],
)
def test_types_of_one_version(text: str, ros: Middleware, expected: FieldType) -> None:
    assert [field.type for field in parse(f"{text} x", ros).fields] == [expected]


@pytest.mark.parametrize(
    ("line", "ros", "fault"),
    [
        ("uint8", ROS1, "1:1 'uint8' is not followed by a name"),
        ("uint8=3", ROS1, "1:1 'uint8=3' is not followed by a name"),
        ("uint8 =3", ROS1, "1:7 the constant name is missing"),
        ("uint8 []  data", ROS1, "1:7 unexpected blank before '['"),
        ("uint8 [] data", ROS2, "1:7 unexpected blank before '['"),
        ("uint8[2][3] x", ROS1, "1:1 multi-dimensional arrays are not supported in .msg files"),
        ("uint8[ x", ROS2, "1:1 'uint8[' is not a type"),
        ("uint8[-1] x", ROS1, "1:7 '-1' is not a legal size"),
        ("uint8[0] x", ROS2, "1:7 '0' is not a legal size"),
        ("uint8[n] x", ROS2, "1:7 'n' is not a legal size"),
        ("uint8[4294967296] x", ROS1, "1:7 '4294967296' is not a legal size"),
        ("uint8[<=0] x", ROS2, "1:9 '0' is not a legal size"),
        ("uint8[<=-2] x", ROS2, "1:9 '-2' is not a legal size"),
        ("string<=0 x", ROS2, "1:9 '0' is not a legal size"),
        ("string<= x", ROS2, "1:9 '' is not a legal size"),
        ("string<=10 x", ROS1, "1:7 ROS 1 does not support bounds such as '<=10'"),
        ("uint8[<=3] x", ROS1, "1:7 ROS 1 does not support bounds such as '<=3'"),
        ("uint9 x", ROS2, "1:1 unknown type 'uint9'"),
        ("lower x", ROS2, "1:1 unknown type 'lower'"),
        ("pkg__a/Point x", ROS2, "1:1 unknown type 'pkg__a/Point'"),
        ("a/msg/Point x", ROS1, "1:1 unknown type 'a/msg/Point'"),
        ("a/b/Point x", ROS2, "1:1 unknown type 'a/b/Point'"),
        ("uint8 1x", ROS1, "1:7 '1x' is not a legal field name in ROS 1"),
        ("uint8 x-y", ROS1, "1:7 'x-y' is not a legal field name in ROS 1"),
        ("uint8 größe", ROS1, "1:7 'größe' is not a legal field name in ROS 1"),
        ("uint8 camelCase", ROS2, "1:7 'camelCase' is not a legal field name in ROS 2"),
        ("uint8 a__b", ROS2, "1:7 'a__b' is not a legal field name in ROS 2"),
        ("uint8 a_", ROS2, "1:7 'a_' is not a legal field name in ROS 2"),
        ("uint8 _a", ROS2, "1:7 '_a' is not a legal field name in ROS 2"),
        ("uint8 Foo = 1", ROS2, "1:7 'Foo' is not a legal constant name in ROS 2"),
        ("uint8 A_ = 1", ROS2, "1:7 'A_' is not a legal constant name in ROS 2"),
        ("uint8 x 5", ROS1, "1:9 unexpected '5' after field 'x'"),
        ("uint8 x more garbage", ROS2, "1:9 'more garbage' is not a value of uint8"),
        ('string s "a=b"', ROS2, "1:8 's \"a' is not a legal constant name in ROS 2"),
        ("time T=1", ROS1, "1:1 a constant cannot have the type 'time'"),
        ("time T=1", ROS2, "1:1 a constant cannot have the type 'time'"),
        ("wstring T=1", ROS1, "1:1 a constant cannot have the type 'wstring'"),
        ("uint8[] T=1", ROS2, "1:1 a constant cannot have the type 'uint8[]'"),
        ("string<=5 T=1", ROS2, "1:1 a constant cannot have the type 'string<=5'"),
        ("Point P=1", ROS2, "1:1 a constant cannot have the type 'Point'"),
    ],
)
def test_faults(line: str, ros: Middleware, fault: str) -> None:
    assert faults(line, ros) == [fault]


@pytest.mark.parametrize(
    ("line", "ros", "value"),
    [
        ("uint8 Foo = 1", ROS1, 1),
        ("byte B=-128", ROS1, -128),
        ("char C=255", ROS1, 255),
        ("byte B=255", ROS2, 255),
        ("char C=255", ROS2, 255),
        ("int64 I=-9223372036854775808", ROS1, -(2**63)),
        ("uint64 U=18446744073709551615", ROS2, 2**64 - 1),
        ("int32 I=010", ROS1, 10),
        ("int32 I=010", ROS2, 10),
        ("int32 I=0x10", ROS2, 16),
        ("int32 I=-0x10", ROS2, -16),
        ("int32 I=0o10", ROS2, 8),
        ("int32 I=0b10", ROS2, 2),
        ("float32 F=-1.5e3", ROS1, -1500.0),
        ("float64 F=inf", ROS2, float("inf")),
        ("float64 F=3 # three", ROS2, 3.0),
        ("bool B=True", ROS1, True),
        ("bool B=0", ROS1, False),
        ("bool B=true", ROS2, True),
        ("bool B=FALSE", ROS2, False),
        ("bool B=1", ROS2, True),
        ("string S=  a 'b' \"c\" # d = e  ", ROS1, "a 'b' \"c\" # d = e"),
        ("string S=#d", ROS1, "#d"),
        ("string S=", ROS1, ""),
        ('string S="quoted"', ROS1, '"quoted"'),
        ("string S=plain text # comment", ROS2, "plain text"),
        ('string S="a # b"', ROS2, '"a'),  # `#` begins a comment even within quotes, so the string is not quoted
        ("string S=' a '", ROS2, " a "),
        ('string S="say \\"no\\""', ROS2, 'say "no"'),
        ("string S='it\\'s'", ROS2, "it's"),
        ("string S=it's", ROS2, "it's"),
        ("string S='a\\n'", ROS2, "a\\n"),
        ("string S=a=b", ROS2, "a=b"),
        ("string S=", ROS2, ""),
        ("wstring S='w'", ROS2, "w"),
    ],
)
def test_constants(line: str, ros: Middleware, value: Scalar) -> None:
    definition = parse(line, ros)
    assert [constant.value for constant in definition.constants] == [value]
    assert type(definition.constants[0].value) is type(value)
    assert definition.fields == ()


@pytest.mark.parametrize(
    ("line", "ros", "text"),
    [
        ("uint8 A= +07 # seven", ROS1, "+07"),
        ("string A=  'a # b' ", ROS1, "'a # b'"),
        ("uint8 A=0x1F", ROS2, "0x1F"),
        ("string A = 'a' # b", ROS2, "'a'"),
    ],
)
def test_a_constant_keeps_how_it_is_written(line: str, ros: Middleware, text: str) -> None:
    assert [constant.text for constant in parse(line, ros).constants] == [text]


@pytest.mark.parametrize(
    ("line", "ros"),
    [
        ("uint8 A=256", ROS1),
        ("uint8 A=-1", ROS2),
        ("int8 A=128", ROS1),
        ("int16 A=-32769", ROS2),
        ("byte A=128", ROS1),
        ("byte A=-1", ROS2),
        ("char A=-1", ROS1),
        ("uint64 A=18446744073709551616", ROS1),
        ("int64 A=9223372036854775808", ROS1),
        ("uint8 A=0x10", ROS1),
        ("uint8 A=1.0", ROS2),
        ("uint8 A=", ROS2),
        ("uint8 A=1=2", ROS1),
        ("float32 A=1e39", ROS2),
        ("float32 A=1,5", ROS1),
        ("bool A=true", ROS1),
        ("bool A=yes", ROS2),
        ("string A='it's'", ROS2),
    ],
)
def test_values_out_of_range(line: str, ros: Middleware) -> None:
    (fault,) = faults(line, ros)
    assert fault.startswith(f"1:{line.index('=') + 2} ")
    assert "value of" in fault


@pytest.mark.parametrize(
    ("line", "default"),
    [
        ("int32 x 5", 5),
        ("int32 x   -0x1F # hex", -31),
        ("bool x true", True),
        ("float64 x 1e-3", 0.001),
        ("string x hello world", "hello world"),
        ('string x "hello"', "hello"),
        ("string x ''", ""),
        ("string<=3 x 'abc'", "abc"),
        ("int32[] x []", ()),
        ("int32[] x [1, -2,3]", (1, -2, 3)),
        ("int32[2] x [1, 2]", (1, 2)),
        ("int32[<=3] x [1]", (1,)),
        ("bool[] x [true, 0]", (True, False)),
        ("string[] x [\"a, b\", 'c', d e]", ("a, b", "c", "d e")),
        ('string[] x ["a \\"b\\""]', ('a "b"',)),
    ],
)
def test_defaults(line: str, default: Scalar | tuple[Scalar, ...]) -> None:
    assert [field.default for field in parse(line, ROS2).fields] == [default]


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("int32 x five", "1:9 'five' is not a value of int32"),
        ("string<=3 x 'abcd'", "1:13 ''abcd'' is not a value of string<=3"),
        ("int32[] x 1", "1:11 '1' is not a value of int32[]"),
        ("int32[] x [1", "1:11 '[1' is not a value of int32[]"),
        ("int32[2] x [1]", "1:12 a default value with 1 elements does not fit int32[2]"),
        ("int32[<=2] x [1,2,3]", "1:14 a default value with 3 elements does not fit int32[<=2]"),
        ("uint8[] x [1, 256]", "1:15 '256' is not a value of uint8"),
        ("int32[] x [1,]", "1:14 element 2 of the array is empty or has no closing quote"),
        ('string[] x ["a" "b"]', "1:13 element 1 of the array is empty or has no closing quote"),
        ('string[] x ["a\\", "b"]', "1:13 element 1 of the array is empty or has no closing quote"),
        ("string[] x ['a', 'b]", "1:18 element 2 of the array is empty or has no closing quote"),
        ("string<=2[] x ['abc']", "1:16 ''abc'' is not a value of string<=2"),
        ("Point x 1", "1:9 a field of type my_msgs/Point cannot have a default value"),
        ("Point[] x []", "1:11 a field of type my_msgs/Point[] cannot have a default value"),
    ],
)
def test_faulty_defaults(line: str, fault: str) -> None:
    assert faults(line, ROS2) == [fault]


@pytest.mark.parametrize("ros", BOTH)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_blanks_and_comments(end: str, ros: Middleware) -> None:
    lines = ["\ufeff# first", "", "   ", "uint8 A=1# one", "\tuint8\t \tx # the = sign", "  # = indented", "int8 y", ""]
    definition = parse(end.join(lines), ros)
    assert [(c.name, c.source.line) for c in definition.constants] == [("A", 4)]
    assert [(f.name, f.source.line, f.source.column) for f in definition.fields] == [("x", 5, 2), ("y", 7, 1)]


def test_a_byte_order_mark_moves_no_column() -> None:
    assert parse("\ufeffuint8 x", ROS2).fields[0].source.column == 1


@pytest.mark.parametrize("ros", BOTH)
def test_a_form_feed_in_a_comment_ends_no_line(ros: Middleware) -> None:
    assert parse("# a\x0cb\u2028c\nuint8 x", ros).fields[0].source.line == 2


def test_a_field_points_at_its_type() -> None:
    source = parse("\n  geometry_msgs/Point[] points  # here", ROS1).fields[0].source
    assert (source.file, source.line, source.column, source.width) == ("Mine.msg", 2, 3, len("geometry_msgs/Point[]"))
    assert source.text == "  geometry_msgs/Point[] points  # here"


@pytest.mark.parametrize("ros", BOTH)
@pytest.mark.parametrize(
    ("text", "place"),
    [("uint8 x\n\nint8 x", "3:6"), ("uint8 A=1\nuint8 A=1", "2:7")],
)
def test_duplicate_names(text: str, place: str, ros: Middleware) -> None:
    name = text.rsplit(maxsplit=1)[-1].partition("=")[0]
    assert faults(text, ros) == [f"{place} '{name}' is declared twice"]


def test_a_constant_and_a_field_of_one_name_clash() -> None:
    assert faults("uint8 x=1\nuint8 x", ROS1) == ["2:7 'x' is declared twice"]


def test_all_faults_are_found_and_the_rest_is_kept() -> None:
    text = "uint9[0] Bad\nuint8 good\nuint8 A=300\nstring\nfloat64 also_good 1.0"
    assert len(faults(text, ROS2)) == 5
    definition = parse_message(text, NAME, ROS2, "Mine.msg", Diagnostics())
    assert [field.name for field in definition.fields] == ["good", "also_good"]
    assert definition.constants == ()


def test_the_names_of_package_and_message_are_checked() -> None:
    diagnostics = Diagnostics()
    parse_message("", MessageName("My_msgs", "mine"), ROS2, "mine.msg", diagnostics)
    assert [str(d).splitlines()[0] for d in diagnostics.found] == [
        "mine.msg:1:1: error: 'My_msgs' is not a legal package name in ROS 2",
        "mine.msg:1:1: error: 'mine' is not a legal message name in ROS 2",
    ]


@pytest.mark.parametrize("text", ["geometry_msgs/Point", "geometry_msgs/msg/Point", " geometry_msgs/Point "])
def test_parse_name(text: str) -> None:
    assert parse_name(text) == MessageName("geometry_msgs", "Point")


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("my_msgs/Add", None),
        ("my_msgs/msg/Add", InterfaceKind.MESSAGE),
        ("my_msgs/srv/Add", InterfaceKind.SERVICE),
        ("my_msgs/action/Add", InterfaceKind.ACTION),
    ],
)
def test_a_full_name_has_a_kind(text: str, kind: InterfaceKind | None) -> None:
    assert parse_full_name(text) == (kind, SERVICE)
    assert parse_name(text) == SERVICE


@pytest.mark.parametrize("text", ["", "Point", "a/b/Point", "a/", "/Point", "a/Po-int", "a/idl/Point", "1a/Point"])
def test_parse_name_refuses(text: str) -> None:
    with pytest.raises(InputError, match="is not a message name"):
        parse_name(text)


def test_a_service_is_two_definitions_with_their_own_lines() -> None:
    diagnostics = Diagnostics()
    names = service_names(SERVICE, ROS2)
    request, response = parse_sections("int64 a\n---\nint64 a", names, ROS2, "Add.srv", diagnostics)
    assert not diagnostics.found
    assert (str(request.name), str(response.name)) == ("my_msgs/Add_Request", "my_msgs/Add_Response")
    assert (request.fields[0].source.line, response.fields[0].source.line) == (1, 3)


def test_an_action_is_three_definitions() -> None:
    diagnostics = Diagnostics()
    names = action_names(SERVICE, ROS1)
    goal, result, feedback = parse_sections("int64 a\n---\n---\nint64 c", names, ROS1, "Add.action", diagnostics)
    assert not diagnostics.found
    assert [str(part.name) for part in (goal, result, feedback)] == [
        "my_msgs/AddGoal",
        "my_msgs/AddResult",
        "my_msgs/AddFeedback",
    ]
    assert [len(part.fields) for part in (goal, result, feedback)] == [1, 0, 1]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("int64 a", "Add.srv:1:1: error: the file has 1 of the 2 expected sections"),
        ("---\nint64 a\n---\n", "Add.srv:3:1: error: the file has more than the 2 expected sections"),
    ],
)
def test_a_wrong_number_of_sections(text: str, fault: str) -> None:
    diagnostics = Diagnostics()
    parse_sections(text, service_names(SERVICE, ROS2), ROS2, "Add.srv", diagnostics)
    assert [str(d).splitlines()[0] for d in diagnostics.found] == [fault]


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_a_size_of_thousands_of_digits_is_a_fault_like_any_other(ros: Middleware) -> None:
    digits = "9" * 5000
    assert faults(f"uint8[{digits}] x", ros) == [f"1:7 '{digits}' is not a legal size"]
