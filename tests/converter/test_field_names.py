"""A field may have the name of anything in a converter's VHDL."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS2
from tests.frame.test_layout import layout
from tests.hdl.ghdl import Library, core_files

# Legal in ROS 2.
_NAME = re.compile(r"[a-z](?:_?[a-z0-9])*")


def converters(frame: Frame, width: int, prefix: str = "") -> dict[str, str]:
    """The texts of both converters by their paths."""
    files = {**subscriber_files([frame], width, prefix), **publisher_files([frame], width, prefix)}
    return {path: str(file.content) for path, file in files.items()}


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("fields", ["float64[20] d", "uint8[] d\nstring s", "uint8 d"])
def test_every_word_of_a_converter_can_be_the_name_of_a_field(tmp_path: Path, fields: str, width: int) -> None:
    code = re.sub("--.*", "", "".join(converters(layout(ROS2, fields), width).values()))
    words = sorted(word for word in {*re.findall(r"\w+", code.lower())} - {"d", "s"} if _NAME.fullmatch(word))
    assert len(words) > 50
    paths = []
    for number, word in enumerate(words):
        for name, text in converters(layout(ROS2, f"{fields}\nuint8 {word}"), width, f"n{number}").items():
            paths.append(tmp_path / name)
            paths[-1].write_text(text, encoding="utf-8")
    Library("firm", tmp_path).analyse(core_files("axis/package", "axis/axis"))
    Library("converters", tmp_path).analyse(paths)
    Library("converters", tmp_path).make()
