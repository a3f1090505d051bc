"""Compile functions of one message, run them on the same messages in GHDL, and run the Python itself.

units = [Unit("gain", "def gain(m):\n    return {'a': m.a * 2.0}\n")]
for unit, answers in simulated(units, messages, tmp_path).items(): ...
"""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import chevron

from fusesoc_firm.accelerator.hardware_numbers import plain, silent, typed
from fusesoc_firm.accelerator.user_code import Numbers, load_compiled
from fusesoc_firm.compiler.binding import bound
from fusesoc_firm.compiler.interface import side_of
from fusesoc_firm.compiler.kinds import kind_named
from fusesoc_firm.compiler.program import Program, Task, compile_function
from fusesoc_firm.compiler.schedule import Schedule, scheduled
from fusesoc_firm.compiler.source import Source
from fusesoc_firm.compiler.writer import TEMPLATE, Writer
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.codec import decode
from fusesoc_firm.frame.defaults import encode_answer
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived.sides import SidePort, side_ports
from fusesoc_firm.text.render import render
from tests.frame.oracle import parsed
from tests.hdl.ghdl import Generic, Library, core_files

MESSAGE = """
float64 a
float64 b
float32 c
float32 d
int32 i
int32 j
uint8 k
int64 n
bool p
bool q
float64[3] v
int16[4] w
"""
CORES = ("axis/package", "acc/float/float", "acc/fixed/fixed", "acc/python/python")
_TEMPLATE = Path(__file__).parent / "compiled_bench.vhd.mustache"
_HANDSHAKE = ("segment_valid", "msg_valid", "msg_ready")


def message_frame(text: str = MESSAGE) -> Frame:
    texts = {"test_msgs/Numbers": text, "test_msgs/Place": "float32 x\nfloat32 y\n"}
    return frame_of(parse_name("test_msgs/Numbers"), parsed(texts, ROS2))


FRAME = message_frame()


@dataclass(frozen=True)
class Unit:
    """A function under test: its name, its source, and the keys of its accelerator."""

    name: str
    text: str
    numbers: str = ""
    limits: Mapping[str, int] = field(default_factory=dict, hash=False)

    def program(self, frame: Frame = FRAME) -> Program:
        source = Source(f"{self.name}.py", self.text)
        return compile_function(
            Task(source, self.name, [side_of("in_", frame)], [side_of("out_", frame)], kind_named(self.numbers))
        )

    def schedule(self) -> Schedule:
        return scheduled(self.program(), self.limits)

    def vhdl(self) -> str:
        ports = [
            {
                "name": f"{prefix}{port.name}",
                "direction": "out" if port.is_output else "in",
                "type": vhdl_type(port.width),
                "comment": port.comment,
            }
            for prefix, port in _ports(FRAME)
        ]
        return render(TEMPLATE, Writer(bound(self.schedule())).configuration(self.name, ports, 8))

    def expected(self, messages: Sequence[Mapping[str, Any]], folder: Path) -> list[dict[str, Any] | None]:
        """The answers of the function itself."""
        path = folder / f"{self.name}.py"
        path.write_text(self.text, encoding="utf-8")
        function = load_compiled(path, self.name, self.name, ("m", ""), Numbers(self.numbers))
        found: list[dict[str, Any] | None] = []
        for message in messages:
            with silent():
                answer = function.call(typed(FRAME, message, self.numbers))
            found.append(None if answer is None else decode(FRAME, encode_answer(FRAME, plain(FRAME, answer))))
        return found


def _ports(frame: Frame) -> list[tuple[str, SidePort]]:
    taken = [("in_", port) for port in side_ports(frame, 8, gives=False, has_valid=True)]
    return taken + [("out_", port) for port in side_ports(frame, 8, gives=True, has_valid=False)]


def placed_bits(prefix: str) -> tuple[list[dict[str, str]], int]:
    """The bits of each field in a vector, and their number."""
    found, low = [], 0
    for side, port in _ports(FRAME):
        if side == prefix and port.name not in _HANDSHAKE:
            width = port.width or 1
            bits = f"({low})" if port.width is None else f"({low + width - 1} downto {low})"
            verilog = f"[{low}]" if port.width is None else f"[{low + width - 1}:{low}]"
            found.append({"port": f"{prefix}{port.name}", "bits": bits, "verilog": verilog})
            low += width
    return found, low


def bits_of_message(message: Mapping[str, Any]) -> str:
    """The fields of a message as bits, the first one in the lowest."""
    text = ""
    for leaf in side_of("in_", FRAME).leaves:
        values = message[leaf.path[0].name]
        for value in values if leaf.is_array else [values]:
            text = _number_bits(value, leaf.kind.name, leaf.kind.bits) + text
    return text


def _number_bits(value: Any, name: str, bits: int) -> str:
    if name.startswith("float"):
        value = int.from_bytes(struct.pack(">d" if bits == 64 else ">f", value), "big")
    return format(int(value) % (1 << bits), f"0{bits}b")


def _message(bits: str) -> dict[str, Any]:
    message: dict[str, Any] = {}
    for leaf in side_of("out_", FRAME).leaves:
        values = []
        for _ in range(leaf.count):
            bits, word = bits[: -leaf.kind.bits], bits[-leaf.kind.bits :]
            values.append(_value(word, leaf.kind.name, leaf.kind.bits))
        message[leaf.path[0].name] = values if leaf.is_array else values[0]
    return message


def _value(word: str, name: str, bits: int) -> Any:
    if "X" in word:
        return word
    number = int(word, 2)
    if name.startswith("float"):
        return struct.unpack(">d" if bits == 64 else ">f", number.to_bytes(bits // 8, "big"))[0]
    if name == "bool":
        return bool(number)
    return number - (1 << bits) if not name.startswith("u") and number >> (bits - 1) else number


def simulated(
    units: Sequence[Unit], messages: Sequence[Mapping[str, Any]], folder: Path, seed: int = 1
) -> dict[Unit, list[dict[str, Any] | None]]:
    """The answers of the hardware of all units to all messages."""
    firm, work = Library("firm", folder), Library("work", folder)
    firm.analyse(core_files("acc/cordic/cordic", *CORES))
    for unit in units:
        (folder / f"{unit.name}.vhd").write_text(unit.vhdl(), encoding="utf-8")
    (inputs, in_bits), (outputs, out_bits) = placed_bits("in_"), placed_bits("out_")
    bench = chevron.render(
        _TEMPLATE.read_text(encoding="utf-8"),
        {
            "in_bits": in_bits,
            "out_bits": out_bits,
            "count": len(units),
            "units": [{"name": unit.name, "number": number} for number, unit in enumerate(units)],
            "inputs": inputs,
            "outputs": outputs,
        },
    )
    (folder / "compiled_bench.vhd").write_text(bench, encoding="utf-8")
    work.analyse([*(folder / f"{unit.name}.vhd" for unit in units), folder / "compiled_bench.vhd"])
    (folder / "vectors.txt").write_text("".join(f"{bits_of_message(message)}\n" for message in messages))
    print(f"seed {seed}")
    generics: dict[str, Generic] = {"VECTORS": str(folder / "vectors.txt"), "RESULTS": f"{folder}/", "SEED": seed}
    found = work.run("compiled_bench", generics, seconds=600)
    assert found.exit_code == 0, found.output
    return {unit: answers_of(folder / f"{unit.name}.txt") for unit in units}


def answers_of(path: Path) -> list[dict[str, Any] | None]:
    """The answers that a bench wrote, None where none was sent."""
    return [None if line == "-" else _message(line) for line in path.read_text().split()]


_SPECIAL = (0.0, -0.0, math.inf, -math.inf, math.nan, 1.0, -1.0, 0.5, 3.0)
_TINY = {"float64": (5e-324, -1e-310, 2.2e-308, 1.7e308), "float32": (1e-45, -1e-40, 1.2e-38, 3.3e38)}


def random_messages(source: random.Random, count: int) -> list[dict[str, Any]]:
    """Messages with ordinary, special and subnormal numbers."""
    return [{leaf.path[0].name: _random(leaf, source) for leaf in side_of("in_", FRAME).leaves} for _ in range(count)]


def _random(leaf: Any, source: random.Random) -> Any:
    values = [random_number(leaf.kind.name, leaf.kind.limits, source) for _ in range(leaf.count)]
    return values if leaf.is_array else values[0]


def random_number(name: str, limits: tuple[int, int], source: random.Random) -> Any:
    """An ordinary, special or subnormal number of a type; an integer is within the limits."""
    if name == "bool":
        return source.random() < 0.5
    if name.startswith("float"):
        draw = source.random()
        value = (
            source.choice(_SPECIAL)
            if draw < 0.2
            else source.choice(_TINY[name])
            if draw < 0.3
            else source.uniform(-10, 10)
            if draw < 0.8
            else source.uniform(-1, 1) * 10.0 ** source.uniform(-30, 30)
        )
        return struct.unpack("f", struct.pack("f", value))[0] if name == "float32" else value
    return (
        source.choice([0, 1, *limits])
        if source.random() < 0.2
        else source.randint(*(limits if source.random() < 0.5 else (max(limits[0], -9), 9)))
    )


def differences(unit: Unit, messages: Sequence[Any], wanted: Sequence[Any], found: Sequence[Any]) -> list[str]:
    """What the hardware answers differently."""
    assert len(found) == len(messages)
    return [
        f"{unit.name}, message {number}: {name} is {other[name] if other else None}, not {one[name] if one else None};"
        f" {message}\n{unit.text}"
        for number, (message, one, other) in enumerate(zip(messages, wanted, found, strict=True))
        for name in (FRAME.names if (one is None) == (other is None) else ["a"])
        if (one is None) != (other is None)
        or (one is not None and other is not None and _differ(one[name], other[name]))
    ]


def _differ(one: Any, other: Any) -> bool:
    if isinstance(one, list):
        return any(_differ(*pair) for pair in zip(one, other, strict=True))
    if isinstance(one, float) and isinstance(other, float):
        return struct.pack(">d", one) != struct.pack(">d", other)
    return bool(one != other)
