"""Functions of accelerators in software: which are taken, without running them, and a first version of one."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.codec import decode
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.select import names_in_use
from fusesoc_firm.message import ROS1
from fusesoc_firm.system.scaffold.skeleton import missing_sources
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.text.diagnostics import InputError
from tests.seeds import seeded
from tests.system.systems import LIBRARIES, accelerator, converter, derived, instance, messages, specification

SEED = seeded(20240802)
PASSING = converter("in", "subscriber", "Point", "out") + converter("out", "publisher", "Point")


def fault(folder: Path, code: str, name: str = "mix", inputs: str = "Point Point") -> str:
    """What is said of an accelerator's source; empty if nothing is."""
    (folder / "node.py").write_text(code, encoding="utf-8")
    try:
        derived(folder, specification(PASSING, accelerator(name, inputs, "Point", "ROS-SW", "node.py")))
    except InputError as error:
        (message,) = messages(error)
        return message
    return ""


@pytest.mark.parametrize(
    "code",
    [
        "def mix(a, b): ...",
        "def mix(a, b, gain=1): ...",
        "def mix(a, b, /): ...",
        "def mix(*messages): ...",
        "def mix(a, *rest, gain=1): ...",
        "def mix(a, b=None, **more): ...",
        "mix = max",
        "mix: object = max",
        "from operator import add as mix",
        "import mix",
        "class mix:\n    def __init__(self, a, b): ...",
        "try:\n    from fast import mix\nexcept ImportError:\n    def mix(a): ...\nelse:\n    def mix(a, b): ...",
        "def mix(a): ...\ndef mix(a, b): ...",
        "raise SystemExit\ndef mix(a, b): ...",
    ],
)
def test_a_function_that_will_do(tmp_path: Path, code: str) -> None:
    assert fault(tmp_path, code) == ""


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("", "'node.py' has no function 'mix'"),
        ("def max(a, b): ...", "'node.py' has no function 'mix'"),
        ("class Mix:\n    def mix(self, a): ...", "'node.py' has no function 'mix'"),
        ("def outer():\n    def mix(a, b): ...", "'node.py' has no function 'mix'"),
        ("mix: object", "'node.py' has no function 'mix'"),
        ("def mix(): ...", "'mix' cannot be called with 2 messages"),
        ("def mix(a): ...", "'mix' cannot be called with 2 messages"),
        ("def mix(a, b, c): ...", "'mix' cannot be called with 2 messages"),
        ("def mix(a, b, *, c): ...", "'mix' cannot be called with 2 messages"),
        ("def mix(a, b): ...\ndef mix(a): ...", "'mix' cannot be called with 2 messages"),
        ("async def mix(a, b): ...", "'node.py' has no function 'mix'"),
        ("def mix(a, b)\n", "the file is not valid Python: expected ':'"),
        (
            "def mix(a, b):\n",
            "the file is not valid Python: expected an indented block after function definition on line 1",
        ),
        ("x = '\0'", "the file is not valid Python: source code string cannot contain null bytes"),
    ],
)
def test_a_function_that_will_not_do(tmp_path: Path, code: str, message: str) -> None:
    assert fault(tmp_path, code) == message


@pytest.mark.parametrize(
    ("name", "function"),
    [("mix", "mix"), ("left mix", "left_mix"), ("lambda", "lambda_function"), ("signal", "signal")],
)
def test_the_function_is_called_as_the_accelerator(tmp_path: Path, name: str, function: str) -> None:
    assert fault(tmp_path, f"def {function}(a, b): ...", name) == ""
    assert fault(tmp_path, "", name) == f"'node.py' has no function '{function}'"


def test_a_fault_stands_where_the_specification_is(tmp_path: Path) -> None:
    """The same name that the specification has for itself leads to its sources."""
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "node.py").write_text("\n\ndef mix(): ...\n", encoding="utf-8")
    text = specification(PASSING, accelerator("mix", "Point", "Point", "ROS-SW", "src/node.py"))
    with pytest.raises(InputError) as raised:
        derived(tmp_path, text)
    assert str(raised.value).startswith("src/node.py:3:1: error: 'mix' cannot be called with 1 message\n")


# --- the first version ------------------------------------------------------------------------------------------------


def first_version(folder: Path, taken: str, given: str) -> str:
    path = folder / "spec.yaml"
    types = accelerator("mix", taken, given, "ROS-SW", "node.py") + accelerator("hard", "Point", "Point")
    blocks = PASSING + "".join(
        converter(f"s{number}", "subscriber", name, "m") for number, name in enumerate(taken.split())
    )
    blocks += instance("m", "mix", *(f"p{number}" for number in range(len(given.split()))))
    blocks += "".join(converter(f"p{number}", "publisher", name) for number, name in enumerate(given.split()))
    path.write_text(specification(blocks, types), encoding="utf-8")
    loaded = load_system(path, LIBRARIES, needs_sources=False)
    texts = missing_sources(loaded.system, folder)
    (folder / "node.py").write_text(texts[folder / "node.py"], encoding="utf-8")
    # The analysis takes what it asks for.
    (folder / "acc.vhd").touch()
    load_system(path, LIBRARIES)
    assert folder / "node.py" not in missing_sources(loaded.system, folder)
    return texts[folder / "node.py"]


def test_a_first_version_has_the_fields(tmp_path: Path) -> None:
    text = first_version(tmp_path, "Point geometry_msgs/Polygon", "diagnostic_msgs/DiagnosticStatus Pose")
    assert (
        text
        == '''\
"""mix: geometry_msgs/Point, geometry_msgs/Polygon in, diagnostic_msgs/DiagnosticStatus, geometry_msgs/Pose out.

A first version: it copies equal fields, and sends defaults elsewhere. This file is yours; it is never regenerated.
"""


def mix(message0, message1):
    # message0: geometry_msgs/Point
    #     x  float64
    #     y  float64
    #     z  float64
    # message1: geometry_msgs/Polygon
    #     points      geometry_msgs/Point32[]
    #     points[].x  float32
    #     points[].y  float32
    #     points[].z  float32
    # answer0: diagnostic_msgs/DiagnosticStatus
    #     level           int8
    #     name            string
    #     message         string
    #     hardware_id     string
    #     values          diagnostic_msgs/KeyValue[]
    #     values[].key    string
    #     values[].value  string
    answer0 = {
        "level": 0,
        "name": "",
        "message": "",
        "hardware_id": "",
        "values": [],
    }
    # answer1: geometry_msgs/Pose
    #     position.x     float64
    #     position.y     float64
    #     position.z     float64
    #     orientation.x  float64
    #     orientation.y  float64
    #     orientation.z  float64
    #     orientation.w  float64
    answer1 = {
        "position": {"x": 0.0, "y": 0.0, "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0},
    }
    return answer0, answer1
'''
    )


def test_a_first_version_answers_with_the_message(tmp_path: Path) -> None:
    """For messages of all kinds: what it returns can be sent, and all values are those of none."""
    source = random.Random(SEED)
    print(f"seed {SEED}")
    known = [str(name) for name in LIBRARIES[ROS1].names() if str(name).partition("/")[0] != "std_msgs"]
    for number, name in enumerate(source.sample(known, 25)):
        folder = tmp_path / str(number)
        folder.mkdir()
        scope: dict[str, Any] = {}
        exec(compile(first_version(folder, "Point", name), name, "exec"), scope)
        answer = scope["mix"]({"x": 0.0, "y": 0.0, "z": 0.0})
        (type_,) = load_system(folder / "spec.yaml", LIBRARIES).system.software.types
        frame = type_.outputs[0].frame
        assert decode(frame, encode_used(frame, answer)) == answer, name
        assert {names[0] for names in names_in_use(frame)} == answer.keys(), name


def test_a_first_version_copies_equal_fields(tmp_path: Path) -> None:
    text = first_version(
        tmp_path, "Point geometry_msgs/PoseStamped", "geometry_msgs/PointStamped geometry_msgs/Vector3"
    )
    assert '"header": message1["header"],' in text
    assert '"point": {"x": 0.0, "y": 0.0, "z": 0.0},' in text
    assert '"x": message0["x"],' in text


def test_software_without_outputs_or_sources(tmp_path: Path) -> None:
    assert first_version(tmp_path, "Point", "").endswith("    #     z  float64\n    return None\n")
    types = accelerator("mix", "Point", "", "ROS-SW").replace("sources: [acc.vhd], ", "")
    blocks = PASSING + converter("s", "subscriber", "Point", "m") + instance("m", "mix")
    assert missing_sources(derived(tmp_path, specification(blocks, types)), tmp_path) == {}
