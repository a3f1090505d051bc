"""Packages of constants: what a simulator and a netlist have against rosbags, genpy and values written by hand."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores

from fusesoc_firm.converter.sources import constants_sources
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from tests.frame import genpy_oracle
from tests.hdl.ghdl import Library, core_files
from tests.typestores import typestore

STORES = {ROS1: Stores.ROS1_NOETIC, ROS2: Stores.ROS2_JAZZY}

# Names that VHDL has for something else.
RENAMED = {"ERROR": "ERROR_VALUE"}

ODD = parse_name("odd_msgs/Odd")

AWKWARD_NUMBERS = """\
int8 I8=-128
uint8 U8=255
int16 I16=-2
uint16 U16=65535
int32 I32=-2147483648
uint32 U32=4294967295
int64 I64=-9223372036854775808
int64 MINUS=-1
uint64 U64=18446744073709551615
uint64 HIGH=4294967296
uint64 MIXED=81985529216486895
float32 F32=-0.1
float64 F64=1.0
float64 TINY=5e-324
float64 MINUS_ZERO=-0.0
byte BYTE=7
char CHAR=200
bool YES=1
bool NO=0
uint8 IN=1
uint8 SIGNATURE=2
"""
AWKWARD_TEXTS = {
    "SHORT": "abc",
    "SIX_BYTES": "abcdef",
    "QUOTES": 'a"b""c\'d',
    "CONTROL": "a\tb\x7fc\x01d\x1b",
    "LATIN": "äöü",
    "BEYOND_LATIN": "€\u20ac\U0001d11e x",
    "NONE_PRINTED": "\u00e9",
    "LONG": 'a long text with everything: " \t € ' * 8 + "end",
    "EMPTY": "",
}
AWKWARD = AWKWARD_NUMBERS + "".join(f"string {name}={text}\n" for name, text in AWKWARD_TEXTS.items())
# As the package must name them.
AWKWARD_RENAMED = {"IN": "IN_VALUE", "SIGNATURE": "SIGNATURE_2"}


@dataclass(frozen=True)
class Expected:
    """A constant's name in VHDL and its bits, the highest first."""

    name: str
    digits: str

    @property
    def bits(self) -> int:
        return 1 if len(self.digits) == 1 else 4 * len(self.digits)


def of_number(name: str, kind: str, value: float, ros: Middleware) -> Expected:
    """As NumPy sees it; a bool is one digit."""
    if kind == "bool":
        return Expected(name, str(int(value)))
    alias = {"byte": "int8" if ros is ROS1 else "uint8", "char": "uint8"}.get(kind, kind)
    return Expected(name, np.array(value, dtype=alias).tobytes()[::-1].hex())


def of_text(name: str, text: bytes) -> Iterator[Expected]:
    """The characters in their order, the length, and the bytes with the first one lowest."""
    yield Expected(f"string {name}", text.hex())
    yield Expected(f"{name}_LENGTH", f"{len(text):08x}")
    if text:
        yield Expected(f"{name}_BYTES", text[::-1].hex())


def expected_of(name: str, kind: str, value: Any, ros: Middleware) -> Iterator[Expected]:
    if kind == "string":
        yield from of_text(name, value.encode())
    else:
        yield of_number(name, kind, value, ros)


def bench_text(packages: Mapping[str, list[Expected]]) -> str:
    """A bench that prints the name and the digits of every constant."""
    lines = [
        f"    show{'_text' * item.name.startswith('string ')}"
        f'("{package}.{item.name}", work.{package}.{item.name.removeprefix("string ")});'
        for package, items in packages.items()
        for item in items
    ]
    return BENCH.replace("-- calls", "\n".join(lines))


BENCH = """\
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_sim_pkg.all;

entity constants_tb is
end entity;

architecture tb of constants_tb is
begin
  process
    procedure show(name : in string; value : in std_logic_vector) is
      alias bits : std_logic_vector(value'length-1 downto 0) is value;
      constant DIGITS : string(1 to 16) := "0123456789abcdef";
      variable text : string(1 to value'length/4);
    begin
      for k in text'range loop
        text(k) := DIGITS(1 + to_integer(unsigned(bits(value'length-4*k+3 downto value'length-4*k))));
      end loop;
      print(name & " " & text);
    end procedure;
    procedure show(name : in string; value : in std_logic) is
    begin
      print(name & " " & character'val(character'pos('0') + bit'pos(to_bit(value))));
    end procedure;
    procedure show_text(name : in string; value : in string) is
      variable bits : std_logic_vector(8*value'length-1 downto 0);
      variable low  : natural;
    begin
      assert value'low = 1 or value'length = 0 severity error;
      for k in value'range loop
        low := 8 * (value'length-k);
        bits(low+7 downto low) := std_logic_vector(to_unsigned(character'pos(value(k)), 8));
      end loop;
      show(name, bits);
    end procedure;
  begin
-- calls
    wait;
  end process;
end architecture;
"""


def written(folder: Path, library: MessageLibrary, names: list[MessageName]) -> list[Path]:
    files = list(constants_sources([(name, library.closure(name)) for name in names]))
    for file in files:
        (folder / file.path).write_text(file.text, encoding="ascii")
    return [folder / file.path for file in files]


def analysed(folder: Path, files: list[Path]) -> Library:
    """The packages in a library, beside that of the project."""
    Library("firm", folder).analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
    work = Library("work", folder)
    work.analyse(files)
    return work


def assert_simulated(work: Library, packages: Mapping[str, list[Expected]]) -> None:
    bench = work.directory / "constants_tb.vhd"
    bench.write_text(bench_text(packages))
    work.analyse([bench])
    result = work.run("constants_tb")
    assert result.exit_code == 0, result.output
    wanted = [f"{package}.{item.name} {item.digits}" for package, items in packages.items() for item in items]
    assert [line.strip() for line in result.output.splitlines()] == [line.strip() for line in wanted]


def known_constants(table: Mapping[str, Any], long_name: str, seen: list[str]) -> Iterator[tuple[str, str, Any]]:
    """Name, type and value of the constants of a message and of those within it, as rosbags knows them."""
    if long_name in seen:
        return
    seen.append(long_name)
    constants, fields = table[long_name]
    for name, kind, value in constants:
        yield (name if len(seen) == 1 else f"{long_name.rpartition('/')[2]}_{name}").upper(), kind, value
    for _, kind in fields:
        inner = kind if kind[0] in (Nodetype.BASE, Nodetype.NAME) else kind[1][0]
        if inner[0] == Nodetype.NAME:
            yield from known_constants(table, inner[1], seen)


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_every_message_of_the_distributions(ros: Middleware, tmp_path: Path) -> None:
    """Each has a package; rosbags says which constants are in it and what they are."""
    library = MessageLibrary(ros)
    table = typestore(STORES[ros]).fielddefs
    files = written(tmp_path, library, library.names())
    packages: dict[str, list[Expected]] = {}
    for name in library.names():
        package = f"{name.package}_{name.name}_pkg".lower()
        packages[package] = []
        for constant, kind, value in known_constants(table, f"{name.package}/msg/{name.name}", []):
            packages[package] += expected_of(RENAMED.get(constant, constant), kind, value, ros)
    assert [path.stem for path in files] == list(packages)
    assert sum(map(len, packages.values())) > 300
    for path in files:
        assert path.read_text().count("  constant ") == 1 + len(packages[path.stem])
    assert_simulated(analysed(tmp_path, files), packages)


def numbers() -> Iterator[tuple[str, str, float]]:
    """Name, type and value of the awkward numbers."""
    for line in AWKWARD_NUMBERS.splitlines():
        kind, _, rest = line.partition(" ")
        name, _, text = rest.partition("=")
        yield name, kind, float(text) if kind.startswith("float") else int(text)


def awkward_expected() -> list[Expected]:
    found = [of_number(AWKWARD_RENAMED.get(name, name), kind, value, ROS1) for name, kind, value in numbers()]
    for name, text in AWKWARD_TEXTS.items():
        found += of_text(name, text.encode())
    return found


def odd_package(folder: Path, text: str, ros: Middleware) -> Library:
    """The analysed package `odd_msgs_odd_pkg` of a message with this text."""
    package = folder / "odd_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "msg" / "Odd.msg").write_bytes(text.encode())
    return analysed(folder, written(folder, MessageLibrary(ros, [package]), [ODD]))


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The package of the awkward constants."""
    return odd_package(tmp_path_factory.mktemp("odd"), AWKWARD, ROS1)


def test_awkward_constants(odd: Library) -> None:
    assert_simulated(odd, {"odd_msgs_odd_pkg": awkward_expected()})


@pytest.mark.skipif(not genpy_oracle.has_genpy, reason="genpy is not installed")
def test_genpy_has_these_awkward_constants() -> None:
    """So what the package is compared with is what ROS says."""
    message = genpy_oracle.dynamic.generate_dynamic("odd_msgs/Odd", AWKWARD)["odd_msgs/Odd"]
    assert {name: getattr(message, name) for name, _, _ in numbers()} == {name: value for name, _, value in numbers()}
    assert {name: getattr(message, name) for name in AWKWARD_TEXTS} == AWKWARD_TEXTS


def test_constants_of_ros_2(tmp_path: Path) -> None:
    text = """\
byte BYTE=200
uint8 HEX=0x1F
bool YES=true
float64 NOT_A_NUMBER=nan
float32 LARGE=-inf
string NAME="a # b"
wstring WIDE=h\N{MUSICAL SYMBOL G CLEF}\N{EURO SIGN}
wstring EMPTY=""
"""
    wide = "h\N{MUSICAL SYMBOL G CLEF}\N{EURO SIGN}"
    work = odd_package(tmp_path, text, ROS2)
    expected = [
        Expected("BYTE", "c8"),
        Expected("HEX", "1f"),
        Expected("YES", "1"),
        of_number("NOT_A_NUMBER", "float64", math.nan, ROS2),
        of_number("LARGE", "float32", -math.inf, ROS2),
        *of_text("NAME", b'"a'),
        Expected("string WIDE", wide.encode().hex()),
        Expected("WIDE_LENGTH", "00000004"),
        # Four units of UTF-16, of which a clef takes two; the first one lowest.
        Expected("WIDE_BYTES", "000020ac0000dd1e0000d83400000068"),
        Expected("string EMPTY", ""),
        Expected("EMPTY_LENGTH", "00000000"),
    ]
    assert_simulated(work, {"odd_msgs_odd_pkg": expected})


def test_messages_within_that_share_names_and_one_that_comes_twice(tmp_path: Path) -> None:
    texts = {"one_msgs/Mode": "uint8 ON=1\nuint8 on\n", "two_msgs/Mode": "uint8 ON=2\nuint8 on\n"}
    texts["odd_msgs/Odd"] = "uint8 MODE_ON=3\none_msgs/Mode[] a\ntwo_msgs/Mode[2] b\none_msgs/Mode c\n"
    for name, text in texts.items():
        package, _, message = name.partition("/")
        (tmp_path / package / "msg").mkdir(parents=True)
        (tmp_path / package / "msg" / f"{message}.msg").write_text(text)
    files = written(tmp_path, MessageLibrary(ROS1, [tmp_path]), [ODD])
    expected = [Expected("MODE_ON", "03"), Expected("MODE_ON_2", "01"), Expected("MODE_ON_3", "02")]
    assert files[0].read_text().count("  constant ") == 1 + len(expected)
    assert_simulated(analysed(tmp_path, files), {"odd_msgs_odd_pkg": expected})


def test_a_clash_by_case_and_one_with_a_part_of_a_text(tmp_path: Path) -> None:
    work = odd_package(tmp_path, "uint8 Mode=1\nuint8 MODE=2\nuint8 NAME_BYTES=3\nstring NAME=x\n", ROS1)
    expected = [
        Expected("MODE", "01"),
        Expected("MODE_2", "02"),
        Expected("NAME_BYTES", "03"),
        Expected("string NAME", "78"),
        Expected("NAME_LENGTH", "00000001"),
        Expected("NAME_BYTES_2", "78"),
    ]
    assert_simulated(work, {"odd_msgs_odd_pkg": expected})


def test_a_package_that_is_used_as_a_whole_hides_nothing(odd: Library) -> None:
    """`severity error` is the case that real messages would break: many have a constant ERROR."""
    file = odd.directory / "whole.vhd"
    names = "ERROR WARNING NOTE FAILURE TRUE STRING INTEGER STD_LOGIC_VECTOR UNSIGNED MIN NS RESIZE NUL".split()
    text = "".join(f"uint8 {name}={number}\n" for number, name in enumerate(names))
    whole = odd_package(odd.directory / "whole", text, ROS1)
    file.write_text(WHOLE)
    whole.analyse([file])
    result = whole.run("whole")
    assert result.exit_code == 0, result.output


WHOLE = """\
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use work.odd_msgs_odd_pkg.all;

entity whole is
end entity;

architecture tb of whole is
  signal bits : std_logic_vector(7 downto 0) := ERROR_VALUE;
begin
  process
    variable number : integer;
    constant TEXT : string := "x" & NUL;
  begin
    wait for 1 ns;
    assert true and to_integer(resize(unsigned(bits), 9)) = 0 severity error;
    assert TEXT'length = 2 severity failure;
    wait;
  end process;
end architecture;
"""


def matcher(items: list[Expected]) -> str:
    """An entity that tells which constants a value is equal to, one bit each."""
    lines = []
    for index, item in enumerate(items):
        if item.bits == 1:
            lines.append(f"  found({index}) <= '1' when value(0) = {item.name} else '0';")
        else:
            bits = f"value({item.bits - 1} downto 0)"
            lines.append(f"  found({index}) <= '1' when is_equal({bits}, {item.name}) else '0';")
    width = max(item.bits for item in items)
    return MATCHER.format(value_high=width - 1, found_high=len(items) - 1, lines="\n".join(lines))


MATCHER = """\
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_message_pkg.all;
use work.odd_msgs_odd_pkg.all;

entity matcher is
  port (
    value : in  std_logic_vector({value_high} downto 0);
    found : out std_logic_vector({found_high} downto 0)
  );
end entity;

architecture rtl of matcher is
begin
{lines}
end architecture;
"""


def matches(value: int, items: list[Expected]) -> str:
    """What the matcher must find, as a text of bits with the last constant first."""
    found = [
        value % 2 == int(item.digits) if item.bits == 1 else value % 2**item.bits == int(item.digits, 16)
        for item in items
    ]
    return "".join("01"[is_found] for is_found in reversed(found))


@pytest.fixture
def compared(odd: Library) -> list[Expected]:
    """Every awkward constant but the strings, of which a circuit sees the bytes only."""
    items = [item for item in awkward_expected() if not item.name.startswith("string ") and item.bits <= 128]
    file = odd.directory / "matcher.vhd"
    file.write_text(matcher(items))
    odd.analyse([file])
    return items


def test_constants_survive_synthesis_to_vhdl(odd: Library, compared: list[Expected]) -> None:
    width = max(item.bits for item in compared)
    values = [int(item.digits, 16) for item in compared]
    checks = "\n".join(
        f'    value <= "{value:0{width}b}"; wait for 1 ns;\n'
        f'    assert found = "{matches(value, compared)}" report "{item.name}" severity failure;'
        for item, value in zip(compared, values, strict=True)
    )
    bench = odd.directory / "matcher_tb.vhd"
    bench.write_text(
        "library ieee;\nuse ieee.std_logic_1164.all;\nentity matcher_tb is\nend entity;\n"
        "architecture tb of matcher_tb is\n"
        f"  signal value : std_logic_vector({width - 1} downto 0);\n"
        f"  signal found : std_logic_vector({len(compared) - 1} downto 0);\n"
        "begin\n  u_matcher : entity work.matcher port map (value, found);\n"
        f"  process\n  begin\n{checks}\n    wait;\n  end process;\nend architecture;\n"
    )
    for is_netlist in (False, True):
        if is_netlist:
            odd.replace_by_netlist("matcher")
        odd.analyse([bench])
        result = odd.run("matcher_tb")
        assert result.exit_code == 0, result.output


@pytest.mark.skipif(not shutil.which("iverilog"), reason="iverilog is not installed")
def test_constants_survive_synthesis_to_verilog(odd: Library, compared: list[Expected], tmp_path: Path) -> None:
    width = max(item.bits for item in compared)
    values = [int(item.digits, 16) for item in compared]
    shown = "\n".join(f'    value = {width}\'h{value:x}; #1 $display("%b", found);' for value in values)
    (tmp_path / "matcher.v").write_text(odd.synthesise("matcher", language="verilog"))
    (tmp_path / "tb.v").write_text(
        f"module tb;\n  reg [{width - 1}:0] value;\n  wire [{len(compared) - 1}:0] found;\n"
        f"  matcher u_matcher (.value(value), .found(found));\n  initial begin\n{shown}\n  end\nendmodule\n"
    )
    subprocess.run(["iverilog", "-o", "tb", "matcher.v", "tb.v"], cwd=tmp_path, check=True, capture_output=True)
    done = subprocess.run(["vvp", "tb"], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert done.stdout.split() == [matches(value, compared) for value in values]
