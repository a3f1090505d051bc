"""Messages that converters do not support are rejected with all offending fields, at their definitions."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.converter.configuration import publisher_configuration, subscriber_configuration
from fusesoc_firm.converter.limits import check_fixed_size
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.text.diagnostics import InputError

TEXTS = {
    "Main": "uint8 a\nstring<=3 b\nPart[2] c\nPart[] d\nstring[2] e\nPart f\n",
    "Part": "float64 x\nuint8[] y\n",
}


@pytest.fixture
def frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Frame:
    monkeypatch.chdir(tmp_path)
    folder = Path("my_msgs")
    folder.mkdir()
    for stem, text in TEXTS.items():
        (folder / f"{stem}.msg").write_text(text)
    name = MessageName("my_msgs", "Main")
    return frame_of(name, MessageLibrary(ROS2, [folder]).closure(name))


def test_every_field_of_variable_size_is_named_once_at_its_place(frame: Frame) -> None:
    with pytest.raises(InputError) as caught:
        check_fixed_size(frame)
    assert [(str(fault.source), fault.message) for fault in caught.value.diagnostics] == [
        ("my_msgs/Main.msg:2:1", "field 'b' of type 'string<=3' has no fixed size"),
        ("my_msgs/Main.msg:4:1", "field 'd' of type 'my_msgs/Part[]' has no fixed size"),
        ("my_msgs/Main.msg:5:1", "field 'e' of type 'string[2]' has no fixed size"),
        ("my_msgs/Part.msg:2:1", "field 'c.y' of type 'uint8[]' has no fixed size"),
        ("my_msgs/Part.msg:2:1", "field 'f.y' of type 'uint8[]' has no fixed size"),
    ]


def test_neither_converter_is_made(frame: Frame) -> None:
    for configuration in (subscriber_configuration, publisher_configuration):
        with pytest.raises(InputError, match="'b' of type 'string<=3' has no fixed size"):
            configuration(frame, 8)
