"""The serialisers that judge: that they agree with each other, and that a lie is noticed."""

from __future__ import annotations

import random

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.idl.parser import parse_idl
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.runs.verify import genpy_judge, judge, mcap_judge, rosbags_judge
from fusesoc_firm.runs.verify.definitions import NoJudgementError
from fusesoc_firm.runs.verify.stimuli import KINDS, Stimuli
from fusesoc_firm.text.diagnostics import Diagnostics
from tests.frame.samples import AWKWARD
from tests.runs.verify.messages import Definitions, own, standard

needs_genpy = pytest.mark.skipif(not genpy_judge.is_installed(), reason="no Python of this machine has genpy")
STANDARD = [
    "std_msgs/Empty",
    "std_msgs/Byte",
    "geometry_msgs/PoseArray",
    "sensor_msgs/JointState",
    "diagnostic_msgs/DiagnosticArray",
    "visualization_msgs/MarkerArray",
]
# What is called as a word of Python, lies in messages that hold nothing, and keeps time.
HARD = {
    "Nothing": "",
    "Word": "uint8 class\nNothing nothing\nuint8[] lambda\n",
    "Outer": "Word[] in\nWord is\nbyte b\nchar c\nbyte[] bs\nchar[3] cs\nNothing[] none\nbool[] flags\nstring[2] two\n",
}


def values(name: object, definitions: Definitions, seed: int = 1) -> list[dict[str, object]]:
    ros = next(iter(definitions.values())).ros
    stimuli = Stimuli(definitions, ros, random.Random(seed))
    return [stimuli.message(name, kind) for kind in KINDS]  # type: ignore[arg-type]


@needs_genpy
@pytest.mark.parametrize("name", STANDARD)
def test_genpy_and_rosbags_agree(name: str) -> None:
    message, definitions = standard(ROS1, name)
    drawn = values(message, definitions)
    assert genpy_judge.serialise(message, definitions, drawn) == rosbags_judge.serialise(message, definitions, drawn)


@needs_genpy
def test_they_agree_on_what_is_hard() -> None:
    message, definitions = own(ROS1, {**HARD, "Last": "Outer[] o\ntime[] t\nduration d\ntime s\n"})
    for seed in range(20):
        drawn = values(message, definitions, seed)
        assert genpy_judge.serialise(message, definitions, drawn) == rosbags_judge.serialise(
            message, definitions, drawn
        )


@needs_genpy
def test_ros1_is_judged_by_genpy() -> None:
    message, definitions = standard(ROS1, "std_msgs/Bool")
    found = judge.judge(message, definitions, [{"data": True}])
    assert (found.judge, found.payloads) == ("genpy", (b"\1",))


def test_rosbags_stands_in_for_genpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(genpy_judge, "is_installed", lambda: False)
    message, definitions = standard(ROS1, "std_msgs/Bool")
    assert judge.judge(message, definitions, [{"data": True}]).judge == "rosbags"


@pytest.mark.parametrize("name", STANDARD)
def test_ros2_is_judged_by_both(name: str) -> None:
    message, definitions = standard(ROS2, name)
    assert judge.judge(message, definitions, values(message, definitions)).judge == "rosbags, mcap-ros2-support"


def test_ros2_is_judged_by_both_on_what_is_hard() -> None:
    texts = {name: text for name, text in AWKWARD[ROS2].items() if "Words" not in name}
    for name, text in texts.items():
        others = {other.partition("/")[2]: each for other, each in texts.items() if other != name}
        message, definitions = own(ROS2, {**others, name.partition("/")[2]: text})
        judge.judge(message, definitions, values(message, definitions))
    message, definitions = own(ROS2, {**HARD, "Inner_Goal": "Outer o\n", "Last_FeedbackMessage": "Inner_Goal[<=2] g\n"})
    judge.judge(message, definitions, values(message, definitions))


def test_names_that_only_idl_allows_are_judged_by_both() -> None:
    text = "module lab { struct Outer { long theId; inner_part Part; }; struct inner_part { char C; }; };"
    definitions = parse_idl(text, "lab", ROS2, "lab.idl", Diagnostics())
    message = MessageName("lab", "Outer")
    assert judge.judge(message, definitions, values(message, definitions)).judge == "rosbags, mcap-ros2-support"


@pytest.mark.parametrize("at", [4, 8, 12, 13])
def test_a_wrong_byte_of_rosbags_is_noticed(at: int) -> None:
    message, definitions = own(ROS2, {"M": "int32 a\nstring s\nbool b\n"})
    value = {"a": 5, "s": "hi", "b": True}
    (payload,) = rosbags_judge.serialise(message, definitions, [value])
    mcap_judge.check(message, definitions, [value], [payload])
    hurt = bytearray(payload)
    hurt[at] ^= 1
    with pytest.raises(NoJudgementError, match=r"reads a different value|rejects the bytes"):
        mcap_judge.check(message, definitions, [value], [bytes(hurt)])


def test_a_negative_zero_is_none() -> None:
    message, definitions = own(ROS2, {"M": "float64[] a\n"})
    payloads = rosbags_judge.serialise(message, definitions, [{"a": [0.0, float("nan")]}])
    mcap_judge.check(message, definitions, [{"a": [0.0, float("nan")]}], payloads)
    with pytest.raises(NoJudgementError):
        mcap_judge.check(message, definitions, [{"a": [-0.0, float("nan")]}], payloads)


def test_a_message_of_another_definition_gets_another_type() -> None:
    """One process may judge messages of several libraries, in which a name means this and that."""
    for text, payload in (("uint8 a\n", "0001000005"), ("uint16 a\n", "000100000500"), ("uint8 a\n", "0001000005")):
        message, definitions = own(ROS2, {"M": text})
        assert rosbags_judge.serialise(message, definitions, [{"a": 5}]) == [bytes.fromhex(payload)]


def test_wstrings_are_judged_as_arrays_of_units() -> None:
    message, definitions = own(
        ROS2, {"In": "uint8 a\nwstring<=3 w\n", "M": "wstring s\nwstring[2] t\nIn[] u\nuint8 b\n"}
    )
    value = {"s": "a\ud83e", "t": ["", "é"], "u": [{"a": 1, "w": "語🤖"}], "b": 9}
    found = judge.judge(message, definitions, [value, *values(message, definitions)])
    texts_on_wire = "02000000 61000000 3ed80000 00000000 01000000 e9000000"
    elements_on_wire = "01000000 01 000000 03000000 9e8a0000 3ed80000 16dd0000"
    assert found.payloads[0] == bytes.fromhex(f"00010000 {texts_on_wire} {elements_on_wire} 09")
    assert found.judge == "rosbags, mcap-ros2-support"


@needs_genpy
def test_what_genpy_refuses_rosbags_judges() -> None:
    message, definitions = own(ROS1, {"M": "uint8 a\n"})
    with pytest.raises(NoJudgementError, match="KeyError: 'a'"):
        genpy_judge.serialise(message, definitions, [{}])
    # The server goes on.
    assert genpy_judge.serialise(message, definitions, [{"a": 3}]) == [b"\3"]
