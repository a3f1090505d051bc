"""What a simulation's report says of a message."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.simulation.host_files import expected_text, stimulus_text
from fusesoc_firm.runs.simulation.reference import responses
from fusesoc_firm.runs.simulation.stimuli import read_stimuli
from fusesoc_firm.system.derived.model import Converter

_LIBRARY = MessageLibrary(ROS1)


def converter(block: str, message: str) -> Converter:
    name = parse_name(message)
    return Converter(block, frame_of(name, _LIBRARY.closure(name)), 0)


def labels(folder: Path, message: str, stimulus: str, model: str) -> list[str]:
    """What is said of a stimulus, and of a model's answer to it."""
    (folder / "stimuli.yaml").write_text(f"- sub: {stimulus}\n", encoding="utf-8")
    (folder / "model.py").write_text(f"def respond(_, message):\n    {model}\n", encoding="utf-8")
    sub, pub = converter("sub", message), converter("pub", message)
    sent = read_stimuli(folder / "stimuli.yaml", [sub])
    texts = stimulus_text(sent, [sub]), expected_text(responses(folder / "model.py", sent, [pub]), [pub])
    return [text.splitlines()[0] for text in texts]


@pytest.mark.parametrize("data", ["[7, 8]", "bytes([7, 8])", "(7, 8)", "bytearray([7, 8])", 'message["data"]'])
def test_data_is_shown_the_same_way_in_and_out(tmp_path: Path, data: str) -> None:
    """Whatever the model makes of it; and texts keep their blanks."""
    layout = "{dim: [{label: left  wheel, size: 1, stride: 2}], data_offset: 3}"
    model = f'return [("pub", {{"layout": message["layout"], "data": {data}}})]'
    said = labels(tmp_path, "std_msgs/UInt8MultiArray", f"{{layout: {layout}, data: [7, 8]}}", model)
    values = (
        'layout.dim[0].label="left  wheel" layout.dim[0].size=1 layout.dim[0].stride=2 layout.data_offset=3 data=[7,8]'
    )
    assert said == [
        f"> sub std_msgs/UInt8MultiArray {values}",
        f"< @0 pub std_msgs/UInt8MultiArray {values}",
    ]


def test_a_label_is_one_line_of_plain_text(tmp_path: Path) -> None:
    said = labels(tmp_path, "std_msgs/String", r'{data: "a\n\"b\" \u00e9"}', 'return [("pub", message)]')
    assert said == [r'> sub std_msgs/String data="a\n\"b\" ?"', r'< @0 pub std_msgs/String data="a\n\"b\" ?"']


def test_a_long_array_is_cut(tmp_path: Path) -> None:
    said, answered = labels(tmp_path, "std_msgs/String", f"{{data: {'a' * 999}}}", 'return [("pub", message)]')
    assert said.endswith("aaa...") and answered.endswith("aaa...") and len(said) < 200
