"""The user's model: what it may return, and how each of its faults is shown, never with a traceback."""

from __future__ import annotations

import re
import signal
import sys
from pathlib import Path

import pytest

from fusesoc_firm.accelerator import user_code
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.simulation.reference import Response, responses
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.text.diagnostics import InputError

POINT = parse_name("geometry_msgs/Point")
FRAME = frame_of(POINT, MessageLibrary(ROS1).closure(POINT))
PUBLISHERS = (Converter("left", FRAME, 0), Converter("right", FRAME, 1))


def stimuli(*values: float) -> list[Stimulus]:
    return [Stimulus(Converter("sub", FRAME, 0), b"", {"x": value, "y": 0.0, "z": 0.0}) for value in values]


def ask(folder: Path, text: str, *values: float) -> list[Response]:
    path = folder / "model.py"
    path.write_text(text, encoding="utf-8")
    return responses(path, stimuli(*(values or (1.0, 2.0))), PUBLISHERS)


def fault(folder: Path, text: str) -> str:
    with pytest.raises(InputError) as raised:
        ask(folder, text)
    return str(raised.value).replace(f"{folder}/", "")


def test_answers_come_in_order_with_their_cause(tmp_path: Path) -> None:
    text = (
        "def respond(block, m):\n    assert block == 'sub'\n    return [('right', m)] * int(m['x']) + [('left', m)]\n"
    )
    found = ask(tmp_path, text, 0.0, 2.0)
    assert [(item.publisher.block, item.cause) for item in found] == [
        ("left", 0),
        ("right", 1),
        ("right", 1),
        ("left", 1),
    ]
    assert found[1].payload == bytes(7) + b"\x40" + bytes(16)


@pytest.mark.parametrize(
    "text",
    [
        "def respond(block, m):\n    yield 'left', m\n",
        "def respond(block, m):\n    return (['left', m],)\n",
        "from types import MappingProxyType\n\ndef respond(block, m):\n    return [('left', MappingProxyType(m))]\n",
        "class Model:\n    def __call__(self, block, m):\n        return [('left', m)]\n\nrespond = Model()\n",
        # With text annotations, a dataclass looks its module up.
        (
            "from __future__ import annotations\nfrom dataclasses import dataclass\n\n@dataclass\nclass A:\n"
            "    n: int = 0\n\ndef respond(block, m):\n    return [('left', m)]\n"
        ),
    ],
)
def test_what_is_like_a_list_of_pairs_will_do(tmp_path: Path, text: str) -> None:
    assert len(ask(tmp_path, text)) == 2


def test_a_model_may_keep_state_and_change_what_it_gets(tmp_path: Path) -> None:
    text = (
        "SEEN = []\ndef respond(block, m):\n    SEEN.append(m['x'])\n    m['x'] = sum(SEEN)\n    return [('left', m)]\n"
    )
    path = tmp_path / "model.py"
    path.write_text(text)
    sent = stimuli(1.0, 2.0)
    assert [item.message["x"] for item in responses(path, sent, PUBLISHERS)] == [1.0, 3.0]
    assert [item.message["x"] for item in sent] == [1.0, 2.0]


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        ("m.xx", "did you mean 'x'?"),
        ("m['xx']", "did you mean 'x'?"),
        ("np.cos(m['x'])", "write 'import numpy as np' at the top of the file"),
        ("math.cos(m['x'])", "write 'import math' at the top of the file"),
        ("str(m['x'])", "legal here: numbers"),
    ],
)
def test_a_usual_mistake_has_a_cure(tmp_path: Path, value: str, hint: str) -> None:
    with pytest.raises(InputError) as caught:
        ask(tmp_path, f"def respond(block, m):\n    return [('left', {{'x': {value}}})]\n")
    (fault,) = caught.value.diagnostics
    assert fault.hint == hint
    assert fault.source
    assert fault.source.line == 2


def test_an_unusual_mistake_has_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"name 'gain_of_nothing' is not defined\n.*\n *[|] *\^$"):
        ask(tmp_path, "def respond(block, m):\n    return gain_of_nothing\n")


def test_a_model_leaves_nothing_beside_it(tmp_path: Path) -> None:
    before = sys.dont_write_bytecode
    ask(tmp_path, "def respond(block, m):\n    return []\n")
    assert [path.name for path in tmp_path.iterdir()] == ["model.py"]
    assert sys.dont_write_bytecode is before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "import math\n\n\ndef respond(block, m):\n    return [('left', {'x': math.sqrt(-m['x'])})]\n",
            (
                "model.py:5:28: error: the model raised ValueError for message 0 to 'sub': math domain error\n"
                "    5 |     return [('left', {'x': math.sqrt(-m['x'])})]\n      |                            ^"
            ),
        ),
        (
            "def respond(block, m):\n    yield 'left', m\n    raise KeyError\n",
            "model.py:3:5: error: the model raised KeyError for message 0 to 'sub'\n    3 |     raise KeyError\n",
        ),
        (
            "import sys\nsys.exit(0)\n",
            "model.py:2:1: error: the model raised SystemExit: 0\n    2 | sys.exit(0)\n      | ^",
        ),
        (
            "import no_such_package\n",
            (
                "model.py:1:1: error: the model raised ModuleNotFoundError: No module named 'no_such_package'\n"
                "    1 | import no_such_package\n      | ^"
            ),
        ),
        (
            "from any_arm_msgs.msg import Joint\n",
            (
                "model.py:1:1: error: the model raised ModuleNotFoundError: No module named 'any_arm_msgs'\n"
                "    1 | from any_arm_msgs.msg import Joint\n      | ^\n"
                "      = messages are dictionaries here, without ROS: remove the import"
            ),
        ),
        (
            "def respond(block, m)\n    return []\n",
            (
                "model.py:1:22: error: the model is not valid Python: expected ':'\n"
                "    1 | def respond(block, m)\n      |                      ^"
            ),
        ),
        (
            "def respond(block):\n    return []\n",
            (
                "model.py:1:1: error: the model raised TypeError for message 0 to 'sub': "
                "respond() takes 1 positional argument but 2 were given\n    1 | def respond(block):\n      | ^"
            ),
        ),
        (
            "x = 1\ndef respond(block, m):\n    pass\n",
            (
                "model.py:2:1: error: for message 0 to 'sub', 'respond' returned None, which is not a list\n"
                "    2 | def respond(block, m):\n      | ^\n"
                "      = 'respond' must return a list of (publisher, message), where the message is a mapping of fields"
            ),
        ),
        (
            "def respond(block, m):\n    return {'left': m}\n",
            "model.py:2:5: error: for message 0 to 'sub', 'respond' returned {'left': {",
        ),
        (
            "def respond(block, m):\n    return ['left']\n",
            "model.py:2:5: error: for message 0 to 'sub', 'respond' returned a list that contains 'left'",
        ),
        (
            "def respond(block, m):\n    return [('lift', m)]\n",
            (
                "model.py:2:14: error: for message 0 to 'sub', 'respond' returned a message for 'lift', "
                "which is not a publisher\n"
                "    2 |     return [('lift', m)]\n      |              ^\n      = did you mean 'left'?"
            ),
        ),
        (
            "def respond(block, m):\n    return [([], m)]\n",
            (
                "model.py:2:5: error: for message 0 to 'sub', 'respond' returned a message for [], "
                "which is not a publisher"
            ),
        ),
        (
            "def respond(block, m):\n    return [('left', 5)]\n",
            (
                "model.py:2:5: error: for message 0 to 'sub', 'respond' returned 5 for 'left', "
                "which is not a mapping of fields"
            ),
        ),
        (
            "def respond(block, m):\n    return [('left', {'x': 'one', 'y': 0, 'z': 0})]\n",
            (
                "model.py:2:23: error: for message 0 to 'sub', 'respond' returned an invalid message for 'left': "
                "'x' must be of type float64, not 'one'"
            ),
        ),
        (
            "def respond(block, m):\n    return [('left', {'é': m['é'] if 'é' in m else 0})]\n",
            (
                "model.py:2:23: error: for message 0 to 'sub', 'respond' returned an invalid message for 'left': "
                "geometry_msgs/Point has no field 'é'"
            ),
        ),
        (
            "def respond(block, m):\n    def inner(): return {'x': 'é'}\n    return [('left', inner())]\n",
            "model.py:3:5: error: for message 0 to 'sub', 'respond' returned an invalid message for 'left': 'x' must",
        ),
        (
            "def respond(block, m):\n    if m:\n        return 5\n    return []\n",
            "model.py:1:1: error: for message 0 to 'sub', 'respond' returned 5, which is not a list",
        ),
        (
            "def respond(block, m):\n    s = 'é'; yield 'left', {'x': s}\n",
            "model.py:2:29: error: for message 0 to 'sub', 'respond' returned an invalid message for 'left': 'x' must",
        ),
        (
            "respond = lambda block, m: [('left', {'x': []})]\n",
            "model.py:1:39: error: for message 0 to 'sub', 'respond' returned an invalid message for 'left': 'x' must",
        ),
        (
            "@lambda f: f\n@lambda f: f\ndef respond(block, m):\n    return [5]\n",
            "model.py:4:5: error: for message 0 to 'sub', 'respond' returned a list that contains 5",
        ),
        (
            "class Model:\n    def __call__(self, block, m):\n        return 5\n\nrespond = Model()\n",
            "model.py:3:9: error: for message 0 to 'sub', 'respond' returned 5, which is not a list",
        ),
        (
            "def answer(block, m):\n    return []\n",
            "model.py:1:1: error: model.py has no function 'respond(subscriber, message)'",
        ),
        ("respond = 5\n", "model.py:1:1: error: model.py has no function 'respond(subscriber, message)'"),
    ],
)
def test_a_fault_of_the_model_is_shown_in_the_model(tmp_path: Path, text: str, message: str) -> None:
    found = fault(tmp_path, text)
    assert found.startswith(message)
    assert "Traceback" not in found


@pytest.mark.parametrize(
    ("text", "place", "when"),
    [
        ("def respond(block, m):\n    while True:\n        pass\n", "2|3", " for message 0 to 'sub'"),
        ("import time\n\ndef respond(block, m):\n    time.sleep(9e6)\n", "4", " for message 0 to 'sub'"),
        ("def respond(block, m):\n    while True:\n        yield 'left', m\n", "2|3", " for message 0 to 'sub'"),
        (
            "def respond(block, m):\n while True:\n  try:\n   m['w']\n  except Exception:\n   pass\n",
            "[2-6]",
            " for message 0 to 'sub'",
        ),
        ("while True:\n    pass\n", "1|2", ""),
    ],
)
def test_a_model_that_never_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, place: str, when: str
) -> None:
    # Loading the file takes a part of the limit.
    monkeypatch.setattr(user_code, "TIME_LIMIT", 1.0)
    before = signal.getsignal(signal.SIGALRM), signal.getitimer(signal.ITIMER_REAL)[0] > 0
    found = fault(tmp_path, text)
    assert re.match(rf"model\.py:({place}):\d+: error: the model has not ended after 1 s{when}\n", found), found
    assert (signal.getsignal(signal.SIGALRM), signal.getitimer(signal.ITIMER_REAL)[0] > 0) == before


def test_the_limit_is_that_of_a_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limits: list[float] = []

    def set_timer(_: int, seconds: float, again: float = 0.0) -> tuple[float, float]:
        limits.append(seconds)
        return 0.0, 0.0

    monkeypatch.setattr(signal, "setitimer", set_timer)
    ask(tmp_path, "def respond(block, m):\n    return []\n", 1.0, 2.0, 3.0)
    assert limits.count(60.0) == 1 + 3


def test_an_answer_may_omit_fields(tmp_path: Path) -> None:
    (found, _) = ask(tmp_path, "def respond(block, m):\n    return [('left', {'y': 1})]\n")
    assert found.message == {"x": 0.0, "y": 1.0, "z": 0.0}


def test_a_fault_below_the_model_is_shown_where_the_model_calls(tmp_path: Path) -> None:
    text = "import json\n\ndef respond(block, m):\n    return json.loads('{')\n"
    assert fault(tmp_path, text).startswith("model.py:4:12: error: the model raised JSONDecodeError for message 0")


@pytest.mark.parametrize("name", ["nowhere.py", "model.txt"])
def test_a_model_that_is_not_there(tmp_path: Path, name: str) -> None:
    (tmp_path / "model.txt").write_text("def respond(block, m): return []\n")
    message = rf"error: there is no model at .*{name}\n.*'respond\(subscriber, message\)'; 'respond' must return a list"
    with pytest.raises(InputError, match=message):
        responses(tmp_path / name, stimuli(1.0), PUBLISHERS)
