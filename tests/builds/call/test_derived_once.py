"""A call is derived once: its specification is loaded once, and a library of messages is made once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.builds.call.answer import main, read_request
from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.builds.call.lock_file import _messages, lock_text
from fusesoc_firm.builds.call.recall import answer
from fusesoc_firm.builds.store.layout import CALL
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.node.interface.diagnostics import diagnostics_topic
from fusesoc_firm.system import system_core

SPECS = Path(__file__).resolve().parents[3] / "specs"
QUAT2EULER: dict[str, object] = {"spec": "quat2euler.yaml"}
CALLS: dict[str, tuple[str, dict[str, object]]] = {
    "system": ("far", QUAT2EULER),
    "simulation": (
        "far",
        {**QUAT2EULER, "product": "simulation", "stimuli": "stimuli.yaml", "model": "model.py", "simulator": "icarus"},
    ),
    "converters": ("firm", {"message": "geometry_msgs/Pose", "ros": 2}),
}


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """The number of calls of each function."""
    found: Counter[str] = Counter()
    # The topic /diagnostics has a library of its own, once in a process.
    for ros in (1, 2):
        diagnostics_topic(ros)

    def counted(what: str, done: Callable[..., Any], *arguments: Any, **more: Any) -> Any:
        found[what] += 1
        return done(*arguments, **more)

    for name in ("read_specification", "derive"):
        monkeypatch.setattr(system_core, name, partial(counted, name, getattr(system_core, name)))
    made = MessageLibrary.__init__

    def make(self: MessageLibrary, *arguments: Any, **more: Any) -> None:
        found["libraries"] += 1
        made(self, *arguments, **more)

    monkeypatch.setattr(MessageLibrary, "__init__", make)
    return found


@pytest.mark.parametrize("is_locked", [False, True])
@pytest.mark.parametrize("call", CALLS)
def test_a_call_is_derived_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, counts: Counter[str], call: str, is_locked: bool
) -> None:
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "store"))
    monkeypatch.chdir(tmp_path)
    command, parameters = CALLS[call]
    text = {"files_root": str(SPECS / "quat2euler"), "vlnv": "a:b:c-d:1", "parameters": parameters}
    Path("call.yml").write_text(yaml.safe_dump(text))
    if is_locked:
        request = read_request(command, Path("call.yml"), GENERATORS[command])
        messages = _messages(GENERATORS[command].load(request))
        Path("a.lock").write_text(lock_text({"messages": messages, "cores": {}, "tools": {}}))
        monkeypatch.setenv("FUSESOC_FIRM_LOCKED", str(Path("a.lock").absolute()))
        counts.clear()
    once = {"libraries": 1} | ({"read_specification": 1, "derive": 1} if command == "far" else {})
    # First generated, then found by its key.
    for _ in range(2):
        assert main(command, ["call.yml"]) == 0
        assert counts == once
        counts.clear()
        for note in (tmp_path / "store").rglob(f"*{CALL}"):
            note.unlink()
    if not is_locked:
        assert main(command, ["call.yml"]) == 0
        counts.clear()
        assert answer(command, ["call.yml"])
        assert not counts
