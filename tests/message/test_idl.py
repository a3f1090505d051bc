"""The syntax of `.idl` files: each rule, and random files of which rosidl and rosbags read the same messages."""

from __future__ import annotations

import json
import random
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import get_types_from_idl

from fusesoc_firm.frame.encoder import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.idl.names import declared_in
from fusesoc_firm.message.idl.parser import parse_idl
from fusesoc_firm.message.idl.printer import to_idl
from fusesoc_firm.message.joint import joint_text, signature_of_text
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MessageDefinition
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.text.diagnostics import Diagnostics
from tests.ros.cpp_nodes import ROS2 as WHEELS
from tests.seeds import seeded

JUDGE = Path(__file__).parent / "rosidl_judge.py"
NAME = MessageName("lab_msgs", "Tilt")


def parsed(text: str) -> tuple[dict[MessageName, MessageDefinition], list[str]]:
    """The messages in a text, and the places and faults."""
    faults = Diagnostics()
    found = parse_idl(text, "lab_msgs", ROS2, "f.idl", faults)
    return found, [f"{fault.source} {fault.message}; {fault.hint}" for fault in faults.found]


def message(text: str) -> MessageDefinition:
    found, faults = parsed(text)
    assert not faults
    return found[NAME]


def struct(members: str, before: str = "", constants: str = "") -> str:
    own = f"module Tilt_Constants {{ {constants} }};" if constants else ""
    return f"module lab_msgs {{ module msg {{ {before} {own} struct Tilt {{ {members} }}; }}; }};"


def fields(text: str) -> list[str]:
    return [f"{field.type} {field.name}" for field in message(text).fields]


# --- types ----------------------------------------------------------------------------------------------------------

TYPES = [
    ("short x, y;", ["int16 x", "int16 y"]),
    ("unsigned short a; long b; unsigned long c;", ["uint16 a", "int32 b", "uint32 c"]),
    ("long long a; unsigned long long b;", ["int64 a", "uint64 b"]),
    ("int8 a; uint8 b; int64 c; uint64 d;", ["int8 a", "uint8 b", "int64 c", "uint64 d"]),
    ("boolean a; octet b; char c; float d; double e;", ["bool a", "byte b", "char c", "float32 d", "float64 e"]),
    ("string a; string<3> b; wstring<2+1> c;", ["string a", "string<=3 b", "wstring<=3 c"]),
    ("sequence<long> a; sequence<string<3>, 4> b;", ["int32[] a", "string<=3[<=4] b"]),
    ("sequence<wstring<3>> a; sequence<@key long, (16 >> 2)> b;", ["wstring<=3[] a", "int32[<=4] b"]),
    ("double a[2*3], b; string<4> c[2];", ["float64[6] a", "float64 b", "string<=4[2] c"]),
    ("geometry_msgs::msg::Point a; ::std_msgs::msg::Header b;", ["geometry_msgs/Point a", "std_msgs/Header b"]),
    ("Other a; sequence<Other> b;", ["lab_msgs/Other a", "lab_msgs/Other[] b"]),
    (
        "long theId; long map; long sequence; long default;",
        ["int32 theId", "int32 map", "int32 sequence", "int32 default"],
    ),
]


@pytest.mark.parametrize(("members", "expected"), TYPES)
def test_types(members: str, expected: list[str]) -> None:
    assert fields(struct(members)) == expected


def test_typedefs_and_names_of_modules() -> None:
    before = (
        "typedef double D, Three[3]; typedef sequence<D, 2> Two; typedef Three Again; typedef Inner Alias;"
        "module sub { typedef long D; struct Deep { D d; }; };"
    )
    members = "D a; Three b; Two c; Again d; sequence<D> e; sub::D f; ::lab_msgs::msg::sub::Deep g; Alias h;"
    deep = parsed(struct(members, before))[0][MessageName("lab_msgs", "sub_Deep")]
    assert [str(field.type) for field in deep.fields] == ["int32"], "the innermost D"
    assert fields(struct(members, before)) == [
        "float64 a",
        "float64[3] b",
        "float64[<=2] c",
        "float64[3] d",
        "float64[] e",
        "int32 f",
        "lab_msgs/sub_Deep g",
        "lab_msgs/Inner h",
    ]


def test_an_enum_is_a_number_and_its_constants() -> None:
    before = "enum Mode { OFF, @value(4) ON, AUTO }; typedef Mode Alias; enum Unused { NEVER };"
    found = message(struct("Mode a; sequence<Alias> b; @default(value=Mode::ON) Mode c;", before, "const Mode M = ON;"))
    assert [str(field.type) for field in found.fields] == ["int32", "int32[]", "int32"]
    assert found.fields[2].default == 4
    assert [(item.name, item.value) for item in found.constants] == [("M", 4), ("OFF", 0), ("ON", 4), ("AUTO", 5)]


def test_equal_enumerators_of_two_enums_are_distinct() -> None:
    before = "module a { enum Mode { OFF }; }; module b { enum Mode { LOW, OFF }; }; module c { enum Mode { OFF }; };"
    found = message(struct("a::Mode a; b::Mode b; b::Mode c; c::Mode d;", before, "const long LOW = 7;"))
    expected = [("LOW", 7), ("OFF", 0), ("Mode_LOW", 0), ("Mode_OFF", 1), ("Mode_OFF_4", 0)]
    assert [(item.name, item.value) for item in found.constants] == expected
    assert _content(message(to_idl(found, {}))) == _content(found)


CONSTANTS = [
    ("long", "1 + 2 * 3", 7),
    ("long", "-(1 | 6 & 3 ^ 1)", -3),
    ("long", "-7 / 2 * 10 + -7 % 2", -31),
    ("uint8", "0x1F", 31),
    ("uint8", "017", 15),
    ("uint64", "~0 + 1 << 4 | 0xFFFFFFFFFFFFFFFF", 2**64 - 1),
    ("float", "1.5", 1.5),
    ("double", "1e3 / 4", 250.0),
    ("double", "7d", 7.0),
    ("boolean", "TRUE", True),
    ("char", "'a'", 97),
    ("char", r"'\x41'", 65),
    ("string", r'"a\"b" "\\\n\101"', 'a"b\\\nA'),
    ("wstring", r'L"\u2122"', "\u2122"),
    ("string", '""', ""),
    ("long", "FIRST", 5),
]


@pytest.mark.parametrize(("kind", "text", "value"), CONSTANTS)
def test_constants(kind: str, text: str, value: object) -> None:
    constants = message(struct("long a;", constants=f"const long FIRST = 5; const {kind} C = {text};")).constants
    assert [constant.name for constant in constants] == ["FIRST", "C"]
    assert (constants[1].value, type(constants[1].value)) == (value, type(value))


def test_only_the_own_module_has_a_messages_constants() -> None:
    before = "const long SIZE = 3; module Other_Constants { const long A = 1; };"
    found = message(struct("long a[SIZE]; string<OWN> b;", before, "const long OWN = 2;"))
    assert [str(field.type) for field in found.fields] == ["int32[3]", "string<=2"]
    assert [constant.name for constant in found.constants] == ["OWN"]


DEFAULTS = [
    ("@default(value=3) long a;", 3),
    ("@default(-1.5) double a;", -1.5),
    ("@default(value=TRUE) @key boolean a;", True),
    ('@unit(value="m") @default(value="x y") string a;', "x y"),
    ('@default (value="(1, 2)") long a[2];', (1, 2)),
    ("@default (value=\"['a', 'b']\") sequence<string> a;", ("a", "b")),
    ('@verbatim(language="comment", text="(" ")") @range(min=-1, max=(2)) @id(1) long a;', None),
    ("@optional(FALSE) long a;", None),
    ("@value (default=False) boolean a;", None),
]


@pytest.mark.parametrize(("member", "default"), DEFAULTS)
def test_annotations(member: str, default: object) -> None:
    assert message(struct(member)).fields[0].default == default


def test_text_around_declarations_is_ignored() -> None:
    text = struct("long /* a; */ x; // long y;\r\n string z;")
    head = '\ufeff#ifndef A_\n#define A_\n#include "x.idl"\n#include <a/msg/B.idl> // b\n#pragma once\n'
    assert fields(f"{head}{text}\n#endif // A_\n") == ["int32 x", "string z"]
    assert fields(
        "@final module lab_msgs { module msg { struct Tilt; @topic @nested struct Tilt { long x; }; }; };"
    ) == ["int32 x"]


def test_a_message_without_fields_is_the_same_in_both_languages() -> None:
    found = message(struct("uint8 structure_needs_at_least_one_member;"))
    assert found.fields == ()
    assert signature(NAME, {NAME: found}).startswith("RIHS01_")
    assert "structure_needs_at_least_one_member" in to_idl(found, {})


def test_a_char_has_its_own_hash() -> None:
    hashes = [signature(NAME, {NAME: message(struct(f"{kind} a;"))}) for kind in ("char", "uint8", "octet")]
    assert len({*hashes}) == 3


# --- names ----------------------------------------------------------------------------------------------------------


def test_the_names_that_a_text_declares() -> None:
    text = (
        "struct A { long x; }; module m { struct B { long x; }; module n { struct C { long x; }; }; };"
        "module p { module msg { struct D; struct E { long module; }; };"
        "module srv { struct F_Request { long x; }; struct F_Response { long x; }; struct G_Request { long x; }; };"
        "module action { struct H_Goal { long x; }; struct H_Result { long x; }; struct H_Feedback { long x; }; }; };"
    )
    expected = [
        ("msg", "own/A"),
        ("msg", "m/B"),
        ("msg", "m/n_C"),
        ("msg", "p/E"),
        ("srv", "p/F"),
        ("msg", "p/G_Request"),
        ("action", "p/H"),
    ]
    expected_one = InterfaceKind.MESSAGE, NAME
    assert [(str(kind), str(name)) for kind, name in declared_in(text, "own", expected_one)] == expected
    for other in ("", "union Tilt switch (Mode) { case OFF: long a; }; enum Mode { OFF };", "/*"):
        assert declared_in(other, "own", expected_one) == [expected_one]
    assert declared_in("module m { enum Mode { OFF }; typedef long Size[3]; };", "own", expected_one) == []
    found, faults = parsed(text)
    assert not faults
    assert found[MessageName("p", "G_Request")].kind is InterfaceKind.SERVICE
    assert {str(name) for name in found} == {
        "lab_msgs/A",
        "m/B",
        "m/n_C",
        "p/E",
        "p/F_Request",
        "p/F_Response",
        "p/G_Request",
        "p/H_Goal",
        "p/H_Result",
        "p/H_Feedback",
    }


# --- faults ---------------------------------------------------------------------------------------------------------

# Members or declarations, the column of the fault in them, and a part of the message or the hint.
MEMBERS = [
    ("@optional long a;", 1, "optional fields are not supported in .idl files; ROS 2 sends every field"),
    ("map<long, long> a;", 1, "maps"),
    ("any a;", 1, "'any' types"),
    ("fixed<4, 2> a;", 1, "fixed-point numbers"),
    ("wchar a;", 1, "wide characters"),
    ("long double a;", 1, "numbers of 128 bits"),
    ("long a[2][3];", 10, "arrays of arrays"),
    ("sequence<sequence<long>> a;", 1, "arrays of arrays"),
    ("sequence<long> a[2];", 17, "arrays of arrays"),
    ("long a[0];", 8, "'0' is not a legal size; legal here: whole numbers from 1"),
    ("string<4294967296> a;", 8, "legal here: whole numbers from 1 to 4294967295"),
    ("long a[SIZE];", 8, "unknown constant 'SIZE'"),
    ("long a[1 << 64];", 10, "legal here: 0 to 63"),
    ("long a[1 / 0];", 10, "1 / 0 has no value"),
    ("long a[1.0 & 1];", 12, "'&' takes whole numbers"),
    ('long a[-"x"];', 8, "'-' takes a number"),
    ("long a; long a;", 14, "'a' is declared twice; the first declaration is in line 1"),
    ("long _a;", 6, "a name consists of letters"),
    ("long;", 5, "expected a name before ';'"),
    ("unsigned a;", 1, "'unsigned' is not a type"),
    ("@default(value=256) uint8 a;", 1, "'256' is not a value of uint8; legal here: 0 to 255"),
    ('@default(value="x") long a;', 1, "'x' is not a value of int32"),
    ("@default(value=1) string a;", 1, "'1' is not a value of string"),
    ("@default(value=1) Other a;", 1, "only fields of primitive types"),
    ('@default(value="(1, 2)") long a[3];', 1, "legal here: exactly 3 elements"),
    ('@default(value="(1, 2)") sequence<long, 1> a;', 1, "legal here: at most 1 elements"),
    ('@default(value="1") long a[3];', 1, 'write an array as "(1, 2, 3)"'),
    ("@default(value=true) boolean a;", 16, "legal here: TRUE and FALSE"),
    ("@default(value=089) long a;", 16, "octal"),
]
BASE = struct("@").partition("@")[0]


@pytest.mark.parametrize(("members", "column", "message"), MEMBERS)
def test_faults_of_members_have_their_place(members: str, column: int, message: str) -> None:
    found, (fault, *others) = parsed(struct(f"{members} long last;"))
    assert fault.startswith(f"f.idl:1:{len(BASE) + column} ")
    assert message in fault
    assert not others
    assert found[NAME].fields[-1].name == "last"


DECLARATIONS = [
    ("union U switch (long) { case 1: long a; };", 1, "unions"),
    ("struct A : B { long x; };", 10, "inherited fields"),
    ("struct A { };", 8, "struct 'A' has no members; write 'uint8 structure_needs_at_least_one_member;'"),
    ("enum E { A = 1, B };", 12, "write '@value(1) NAME'"),
    ("enum E { A, B, A };", 16, "'A' is declared twice"),
    ("enum E { @value(3000000000) A };", 10, "is not a value of int32"),
    ("bitmask B { A };", 1, "bitmasks"),
    ("bitset B { bitfield<3> a; };", 1, "bitsets"),
    ("interface I { long f(); };", 1, "interfaces"),
    ("@annotation A { long value; };", 1, "definitions of annotations"),
    ("native N;", 1, "native types"),
    ("const Other C = 1;", 7, "a constant cannot have the type 'Other'"),
    ("const string C = 1;", 18, "'1' is not a value of string"),
    ("const uint8 C = -1;", 17, "legal here: 0 to 255"),
    ('const string C = "\\0";', 18, "no encoding"),
    ("typedef long A; typedef short A;", 31, "'A' is declared twice"),
    ("long a;", 1, "'long' does not begin a declaration; legal here: module, struct, enum, const, typedef"),
    ("module empty long;", 14, "expected '{' before 'long'"),
]


@pytest.mark.parametrize(("declaration", "column", "message"), DECLARATIONS)
def test_faults_of_declarations_have_their_place(declaration: str, column: int, message: str) -> None:
    found, (fault, *others) = parsed(f"{declaration}\n{struct('long last;')}")
    assert fault.startswith(f"f.idl:1:{column} ")
    assert message in fault
    assert not others
    assert [field.name for field in found[NAME].fields] == ["last"]


TEXTS = [
    ("long $a;", "1:6", "unexpected character '$'"),
    ("/* a", "1:1", "the comment has no end '*/'"),
    ('const string A = "x\n', "1:18", "the string has no closing quote"),
    ("\n#if A\n", "2:1", "legal here: #include, #pragma, and an include guard"),
    ("#define A 1\n", "1:1", "legal here: #include"),
    ("module a {\n", "2:1", "expected '}' before the end of the file"),
    ("struct A { long a", "1:18", "expected ';' before the end of the file"),
    ("@verbatim(a", "1:12", "expected ')' before the end of the file"),
    ("};", "1:1", "unexpected '}'"),
    ("struct A { long a; }; struct A { long b; };", "1:30", "'A' is declared twice"),
    (
        "module m { struct a_b { long a; }; module a { struct b { long a; }; }; };",
        "1:54",
        "another struct defines the message 'm/a_b'",
    ),
]


@pytest.mark.parametrize(("text", "place", "message"), TEXTS)
def test_faults_of_texts(text: str, place: str, message: str) -> None:
    _, faults = parsed(text)
    assert faults[0].startswith(f"f.idl:{place} ")
    assert message in faults[0]


BOMBS = [
    "".join(f"module m{number} {{ enum E {{ A }}; }};" for number in range(4000))
    + f"struct S {{ {' '.join(f'm{number}::E a{number};' for number in range(4000))} any x; }};",
    "module m {" * 5000 + "};" * 5000,
    f"const long A = {'(' * 50000}1;",
    f"const long A = {'-' * 100000}'a';",
    f"const long A = {'1<<60*' * 20000}1;",
    f"const long A = {'9' * 100000};",
    f"struct A {{ {'sequence<' * 20000}long{'>' * 20000} a; }};",
    f'struct A {{ @default(value="{"(" * 100000}") long a[2]; }};',
    f"struct A {{ {'@a(' * 50000} long a; }};",
    f"struct {'A' * 100000} {{ long a; }};",
    "/*" * 100000,
    "{" * 200000,
    "@" * 200000,
    'const string A = "' + '\\"' * 100000,
    "enum E { "
    + ",".join(f"e{number}" for number in range(9000))
    + " };"
    + "".join(f"struct s{number} {{ E x; }};" for number in range(8000)),
    "module p { module srv {" + "".join(f"struct s{number}_Request {{ long x; }};" for number in range(6000)),
    "".join(f"struct a{number} {{ long long x; }};\n" for number in range(9000)) + "const long a;",
    "struct A { long " + ",".join(f"a{number}" for number in range(40000)) + "; }",
]


@pytest.mark.parametrize("text", BOMBS, ids=range(len(BOMBS)))
def test_hostile_texts_are_refused_at_once(text: str) -> None:
    assert parsed(text)[1]
    declared_in(text, "lab_msgs", (InterfaceKind.MESSAGE, NAME))


# --- others read the same -------------------------------------------------------------------------------------------

WORDS = ("boolean octet char float double short long int8 uint8 int16 uint16 int32 uint32 int64 uint64").split()
WORDS += [
    "unsigned~short",
    "unsigned~long",
    "long~long",
    "unsigned~long~long",
    "string",
    "wstring",
    "string<7>",
    "wstring<9>",
]
BLANKS = (" ", "  ", "\n", " /* long a; */ ", " // }\n", "\t")


class Author:
    """Writes random files with one message, in the part of IDL that rosidl and rosbags have in common."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._typedefs: list[str] = []
        self._count = 0

    def text(self) -> str:
        typedefs = " ".join(self._typedef() for _ in range(self._random.randrange(4)))
        members = " ".join(self._member() for _ in range(self._random.randrange(1, 9)))
        constants = " ".join(self._constant() for _ in range(self._random.randrange(3)))
        words = struct(members, typedefs, constants).split(" ")
        # rosbags takes only a blank within a type.
        return "".join(f"{word.replace('~', ' ')}{self._random.choice(BLANKS)}" for word in words)

    def _name(self) -> str:
        self._count += 1
        return self._random.choice(("a", "theName", "x_y", "Z9")) + str(self._count)

    def _typedef(self) -> str:
        name = self._name()
        shape = self._random.choice(
            ("typedef {0} {1};", "typedef {0} {1}[3];", "typedef sequence<{0}> {1};", "typedef sequence<{0},5> {1};")
        )
        declared = shape.format(self._random.choice(WORDS), name)
        self._typedefs.append(name)
        return declared

    def _member(self) -> str:
        kind = self._random.choice([*WORDS, "geometry_msgs::msg::Point"])
        shapes = [
            "{0} {1};",
            "{0} {1}[4];",
            "sequence<{0}> {1};",
            "sequence<{0},6> {1};",
            "@key {0} {1};",
            "{0} {1} , {2};",
        ]
        if self._typedefs and self._random.random() < 0.3:
            kind, shapes = self._random.choice(self._typedefs), ["{0} {1};"]
        if kind in ("short", "int32", "float", "double"):
            shapes.append("@default (value=" + self._random.choice(("3", "-4")) + ") {0} {1};")
        return self._random.choice(shapes).format(kind, self._name(), self._name())

    def _constant(self) -> str:
        kind, value = self._random.choice(
            (("long", "-5"), ("uint8", "7"), ("double", "1.5"), ("boolean", "TRUE"), ("string", '"ab"'))
        )
        return f"const {kind} {self._name().upper()} = {value};"


def of_rosbags(kind: Any) -> str:
    """A type of rosbags as a `.msg` file spells it."""
    node, argument = kind
    match int(node):
        case 1:
            return f"{argument[0]}<={argument[1]}" if argument[1] else str(argument[0])
        case 2:
            return "/".join(argument.split("/")[::2])
        case 3:
            return f"{of_rosbags(argument[0])}[{argument[1]}]"
    return f"{of_rosbags(argument[0])}[{f'<={argument[1]}' if argument[1] else ''}]"


def judged(texts: Sequence[str]) -> list[list[dict[str, Any]]]:
    """What rosidl reads in texts."""
    command = [str(WHEELS / "bin/python"), str(JUDGE)]
    done = subprocess.run(command, input=json.dumps(texts), capture_output=True, text=True, check=True)
    read: list[list[dict[str, Any]]] = json.loads(done.stdout)
    return read


RANDOM = [Author(seeded(number)).text() for number in range(60)]


def test_rosbags_reads_the_same() -> None:
    # rosbags has neither bounds of wide strings nor sequences of strings with bounds.
    texts = [text for text in RANDOM if "wstring<" not in text and "<string<" not in text]
    assert len(texts) > 20
    for text in texts:
        ((_, (constants, members)),) = get_types_from_idl(text).items()
        found = message(text)
        assert [(field.name, str(field.type)) for field in found.fields] == [
            (name, of_rosbags(kind)) for name, kind in members
        ], text
        assert [(item.name, item.value) for item in found.constants] == [
            (name, value) for name, _, value in constants
        ], text


@pytest.mark.skipif(not WHEELS.is_dir(), reason="ROS 2 is not installed in .venv/ros2")
def test_rosidl_reads_the_same() -> None:
    for text, (expected,) in zip(RANDOM, judged(RANDOM), strict=True):
        found = message(text)
        assert expected["name"] == found.full_name
        # rosidl takes the bound of a wide string for that of the sequence, also in the hash.
        types = {field.name: str(field.type).replace("wstring<=9[]", "wstring<=9[<=9]") for field in found.fields}
        assert [[field.name, types[field.name], field.default] for field in found.fields] == expected["fields"], text
        assert [[item.name, item.value] for item in found.constants] == expected["constants"], text
        if expected["hash"]:
            assert signature(NAME, {NAME: found}) == expected["hash"], text


@pytest.mark.skipif(not WHEELS.is_dir(), reason="ROS 2 is not installed in .venv/ros2")
def test_the_idl_files_of_ros_2_define_what_its_msg_files_define(tmp_path: Path) -> None:
    """rosidl generated each `.idl` file, and the hashes beside it, from a `.msg`, `.srv` or `.action` file."""
    for path in WHEELS.glob("share/*/*/*.idl"):
        copy = tmp_path / path.relative_to(WHEELS / "share")
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    library, others = MessageLibrary(ROS2, [tmp_path]), MessageLibrary(ROS2, [WHEELS / "share"])
    names = [name for name in library.names() if library.origin(name).startswith(str(tmp_path))]
    assert len(names) > 100
    for name in names:
        assert not others.origin(name).endswith(".idl")
        assert _content(library.get(name)) == _content(others.get(name))
    compared = 0
    for path in WHEELS.glob("share/*/*/*.json"):
        for item in json.loads(path.read_text(encoding="utf-8")).get("type_hashes", ()):
            package, kind, name = item["type_name"].split("/")
            interface = library.interface(MessageName(package, name), InterfaceKind(kind)) if kind != "msg" else None
            if interface or MessageName(package, name) in names:
                messages = interface.messages if interface else (MessageName(package, name),)
                found = signature(
                    MessageName(package, name),
                    library.joint_closure(messages),
                    InterfaceKind(kind if interface else "msg"),
                )
                assert found == item["hash_string"], item["type_name"]
                compared += 1
    assert compared > 200


def _content(definition: MessageDefinition) -> list[tuple[str, str, object]]:
    """The fields and constants; rosidl_adapter writes `char` as uint8."""
    declared = [(field.name, str(field.type), field.default) for field in definition.fields]
    declared += [(constant.name, str(constant.type), constant.value) for constant in definition.constants]
    return [(name, kind.replace("char", "uint8"), value) for name, kind, value in declared]


def test_cyclone_dds_writes_the_same_bytes() -> None:
    """An enumerator has four bytes, and a character has one."""
    dds, types = pytest.importorskip("cyclonedds.idl"), pytest.importorskip("cyclonedds.idl.types")
    mode = dds.make_idl_enum("Mode", "lab.Mode", {"OFF": 0, "ON": 5})
    inner = dds.make_idl_struct("Inner", "lab.Inner", {"letter": types.char, "mode": mode, "raw": types.byte})
    members = {
        "on": bool,
        "gains": types.array[types.float64, 2],
        "some": types.sequence[inner, 2],
        "name": types.bounded_str[9],
        "id": types.int64,
    }
    tilt = dds.make_idl_struct("Tilt", "lab.Tilt", members)
    found = [inner(letter="A", mode=mode.ON, raw=2), inner(letter="B", mode=mode.OFF, raw=3)]
    written = tilt(on=True, gains=[1.0, 2.0], some=found, name="hi", id=7).serialize(use_version_2=False)
    definitions, faults = parsed(
        struct(
            "boolean on; double gains[2]; sequence<Inner, 2> some; string<9> name; long long id;",
            "enum Mode { OFF, @value(5) ON }; struct Inner { char letter; Mode mode; octet raw; };",
        )
    )
    assert not faults
    some = [{"letter": 65, "mode": 5, "raw": 2}, {"letter": 66, "mode": 0, "raw": 3}]
    value = {"on": True, "gains": [1.0, 2.0], "some": some, "name": "hi", "id": 7}
    assert encode(frame_of(NAME, definitions), value) == written


# --- printing -------------------------------------------------------------------------------------------------------


def test_a_printed_message_reads_back() -> None:
    odd = struct(
        '@default(value="(1.5, -2.0)") double a[2]; @default(value="x\\n\\"\\\\") string b; char c; wstring<3> d;',
        constants="const double A = 1e999; const char B = 'q'; const wstring C = \"\u2122\\t\";",
    )
    for text in [odd, *RANDOM]:
        found = message(text)
        printed = message(to_idl(found, {MessageName("geometry_msgs", "Point"): found}))
        assert _content(printed) == _content(found)
        assert [field.type for field in printed.fields] == [field.type for field in found.fields]


def test_every_message_reads_back_from_a_bags_text() -> None:
    library = MessageLibrary(ROS2)
    for name in library.names():
        definitions = library.closure(name)
        as_idl = {each: replace(definition, is_idl=True) for each, definition in definitions.items()}
        assert signature_of_text(name, joint_text(name, as_idl), ROS2) == signature(name, definitions), name
