"""What the text of a model shows without a run: its function, its imports and the literals in its answers."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.runs.simulation.model_text import check_model
from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from tests.runs.simulation.test_reference import PUBLISHERS

FRAMES = {item.block: item.frame for item in PUBLISHERS}
NAMES = ["left"]


def faults(folder: Path, text: str) -> str:
    path = folder / "model.py"
    path.write_text(text, encoding="utf-8")
    found = Diagnostics()
    check_model(path, FRAMES, NAMES, found)
    return "\n".join(map(str, found.found)).replace(f"{folder}/", "")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def respond(block, m)\n", "1:22: error: the model is not valid Python: expected ':'"),
        (
            "\ndef Respond(block, m): ...\n",
            "2:1: error: model.py has no function 'respond(",
        ),
        ("import math\n", "1:1: error: model.py has no function 'respond("),
        (
            "def respond(m):\n    return []\n",
            "1:1: error: 'respond' is called as 'respond(",
        ),
        ("import nowhere\n\ndef respond(*_):\n    return []\n", "1:1: error: the model imports 'nowhere'"),
        ("from no.where import x\n\ndef respond(*_):\n    return []\n", "1:1: error: the model imports 'no'"),
        (
            "def respond(block, m):\n    return [('lft', m)]\n",
            "2:14: error: 'respond' returns a message for",
        ),
        ("def respond(block, m):\n    yield 'lft', m\n", "2:11: error: 'respond' returns a message for"),
        ("def respond(block, m):\n    yield from [('lft', m)]\n", "2:18: error: 'respond'"),
        (
            "def respond(b, m):\n    return [(1, m) for _ in m]\n",
            "2:14: error: 'respond' returns a message for 1",
        ),
        (
            "def respond(b, m):\n    return [] if b else [('l', m)]\n",
            "2:27: error: 'respond'",
        ),
        # A column counts characters.
        ("def respond(b, m):\n    return [] if 'é' else [('l', m)]\n", "2:29: error: 'respond'"),
        (
            "def respond(b, m):\n    return {'left': m}\n",
            "2:12: error: 'respond' returns {'left': m}",
        ),
        ("def respond(b, m):\n    answer = [('left', m)]\n", "1:1: error: 'respond' returns nothing"),
        ("def respond(b, m):\n    return None\n", "2:12: error: 'respond' returns None"),
        (
            "def respond(b, m):\n    return 'left', m\n",
            "2:12: error: 'respond' returns one response, not a list",
        ),
        (
            "def respond(b, m):\n    return [('left', {'x': 1, 'v': 2})]\n",
            "2:13: error: 'respond' returns an invalid message for 'left': geometry_msgs/Point has",
        ),
        (
            "def respond(b, m):\n    answer = {'x': 1, 'v': 2}\n    return [('left', answer)]\n",
            "3:13: error: 'respond' returns an invalid message for 'left': geometry_msgs/Point has",
        ),
    ],
)
def test_a_fault_in_the_text_has_its_place(tmp_path: Path, text: str, message: str) -> None:
    found = faults(tmp_path, text)
    assert found.startswith(f"model.py:{message}")
    assert found.count("error: ") == 1


def test_one_response_becomes_a_list_of_one(tmp_path: Path) -> None:
    found = faults(tmp_path, "def respond(b, m):\n    return ('left', {'x': 1.0})\n")
    assert found.endswith("= write [('left', {'x': 1.0})]")


def test_a_hint_contains_only_names_that_a_user_wrote(tmp_path: Path) -> None:
    assert "= legal here: left" in faults(tmp_path, "def respond(b, m):\n    return [('sub', m)]\n")
    assert faults(tmp_path, "def respond(b, m):\n    return [('right', m)]\n") == ""


@pytest.mark.parametrize(
    "text",
    [
        "def respond(b, m):\n    raise NotImplementedError\n",
        "def respond(b, m):\n    answer = {'x': 1}\n    answer['y'] = answer['z']\n    return [('left', answer)]\n",
        "def respond(b, m):\n    answer = {'x': 1}\n    fill(answer)\n    return [('left', answer)]\n",
        "def respond(block, m):\n    return [('left', {**m, 'x': 1})]\n",
        "def respond(block, m):\n    def inner():\n        return {'x': 1}\n    return [(name(), inner())]\n",
        "import helper\n\nrespond = helper.respond\n",
        "from .here import respond\n",
        "try:\n    import nowhere\nexcept ImportError:\n    nowhere = None\n\ndef respond(*_):\n    return []\n",
        "import sys\nsys.path.append('x')\nimport nowhere\n\ndef respond(*_):\n    return []\n",
        "def respond(block, m=None, *rest):\n    answers = []\n    answers.append(('left', m))\n    return answers\n",
        "class respond:\n    def __new__(cls, *_):\n        return []\n",
    ],
)
def test_what_only_a_run_shows_is_accepted(tmp_path: Path, text: str) -> None:
    (tmp_path / "helper.py").touch()
    assert faults(tmp_path, text) == ""


def test_a_missing_model_gets_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "model.py").touch()
    with pytest.raises(InputError, match=r"there is no model at .*/modle\.py\n      = did you mean 'model\.py'\?"):
        check_model(tmp_path / "modle.py", FRAMES, NAMES, Diagnostics())
