"""The parameters of accelerators: their words, what the node refuses, and their place in generated files."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from fusesoc_firm.message.wire import INTEGER_AND_FLOAT
from fusesoc_firm.system.derived.model import Parameter
from fusesoc_firm.text.diagnostics import InputError
from tests.system.systems import derived

SYSTEM = """
project: {name: many, status: frames}
accelerators:
  - name: tuned
    type: VHDL
    sources: tuned.vhd
    interface:
      input: [{middleware: ROS2, message: std_msgs/Int32}]
      output: [{middleware: ROS2, message: std_msgs/Int32}]
    parameters: [PARAMETERS]
blocks:
  - {name: sub, middleware: ROS2, mode: subscriber, message: std_msgs/Int32, outgoing: [{name: one}]}
  - {name: one, type: tuned, outgoing: [{name: two}]}
  - {name: two, type: tuned, outgoing: [{name: pub}]}
  - {name: pub, middleware: ROS2, mode: publisher, message: std_msgs/Int32}
"""


def parameter(name: str, least: float, most: float) -> Parameter:
    return Parameter("gain", INTEGER_AND_FLOAT[name], least, least, most)


@pytest.mark.parametrize(
    ("type_", "value", "word"),
    [
        ("bool", True, 1),
        ("bool", False, 0),
        ("uint8", 100, 100),
        ("int8", -3, 0xFFFFFFFD),
        ("int16", -4, 0xFFFFFFFC),
        ("int32", -2, 0xFFFFFFFE),
        ("float32", 1, 0x3F800000),
        ("float32", -0.0, 0),
        ("float32", 0.1, 0x3DCCCCCD),
    ],
)
def test_a_value_has_a_word(type_: str, value: float, word: int) -> None:
    made = parameter(type_, 0 if type_ == "bool" else -100, 1 if type_ == "bool" else 100)
    assert made.word(value) == word
    rounded = struct.unpack("<f", struct.pack("<f", value))[0] if type_ == "float32" else value
    assert (made.value(word), type(made.value(word))) == (rounded, bool if type_ == "bool" else type(rounded))


@pytest.mark.parametrize(
    ("type_", "value", "reason"),
    [
        ("uint8", 101, "101 is outside of the range; legal: 0 to 100"),
        ("uint8", -1, "-1 is outside of the range; legal: 0 to 100"),
        ("uint8", 2**64, "18446744073709551616 is outside of the range; legal: 0 to 100"),
        ("uint8", 1.0, "1.0 is not a uint8; legal: 0 to 100"),
        ("uint8", True, "True is not a uint8; legal: 0 to 100"),
        ("uint8", "1", "'1' is not a uint8; legal: 0 to 100"),
        ("float32", True, "True is not a float32; legal: 0 to 100"),
        ("float32", float("nan"), "nan is outside of the range; legal: 0 to 100"),
        ("float32", 1e300, "1e+300 is outside of the range; legal: 0 to 100"),
        ("bool", 1, "1 is not a bool; legal: true, false"),
    ],
)
def test_a_value_that_is_refused(type_: str, value: float, reason: str) -> None:
    with pytest.raises(ValueError, match=f"^{reason.replace('+', '.')}$"):
        parameter(type_, 0, 100).word(value)


def test_parameters_are_numbered_by_blocks(tmp_path: Path) -> None:
    (tmp_path / "tuned.vhd").write_text("")
    text = SYSTEM.replace("PARAMETERS", "{name: a, type: bool, default: true}, {name: b, type: int8, default: 1}")
    names = [(item.number, item.name) for item in derived(tmp_path, text).parameters]
    assert names == [(0, "one.a"), (1, "one.b"), (2, "two.a"), (3, "two.b")]


def test_a_system_has_a_limit_of_parameters(tmp_path: Path) -> None:
    (tmp_path / "tuned.vhd").write_text("")
    texts = [
        SYSTEM.replace(
            "PARAMETERS", ", ".join(f"{{name: p{number}, type: bool, default: true}}" for number in range(count))
        )
        for count in (512, 513)
    ]
    assert len(derived(tmp_path, texts[0]).parameters) == 1024
    with pytest.raises(InputError, match="the blocks have 1026 parameters"):
        derived(tmp_path, texts[1])
