"""Which messages are meant, each layout once, and an entry for every message."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.runs.verify.campaign import Entry, Settings, run, select
from fusesoc_firm.runs.verify.task import Result, Task, Verdict
from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from fusesoc_firm.tools.workers import Workers


class Pretenders(Workers):
    """Workers that give back what a function says, in another order than they were asked."""

    def __init__(self, verdicts: Callable[[Task], Verdict]) -> None:
        self.verdicts = verdicts
        self.seen: list[str] = []

    def run(self, function: Any, tasks: Iterable[Any]) -> Iterator[tuple[Any, Any]]:
        for task in reversed(list(tasks)):
            self.seen.append(task.name.name)
            yield task, Result(self.verdicts(task), detail="told", seconds=2.0, files={"a": "b"})


def write(folder: Path, texts: dict[str, str]) -> MessageLibrary:
    (folder / "a_msgs" / "msg").mkdir(parents=True)
    for name, text in texts.items():
        (folder / "a_msgs" / "msg" / f"{name}.msg").write_text(text)
    return MessageLibrary(ROS1, [folder])


def entries(library: MessageLibrary, workers: Workers) -> dict[str, Entry]:
    found = list(run(library, select(library, ["a_msgs/*"], Diagnostics()), Settings(), workers))
    by_name = {entry.name.name: entry for entry in found}
    assert len(by_name) == len(found)
    return by_name


def test_a_layout_is_verified_once(tmp_path: Path) -> None:
    texts = {"A": "uint8 x\n", "B": "uint8 x\n", "C": "uint8 y\n", "D": "uint8 x # same\nint8 K=3\n", "E": "int8 x\n"}
    workers = Pretenders(lambda task: Verdict.FAIL if task.name.name == "A" else Verdict.PASS)
    found = entries(write(tmp_path, texts), workers)
    assert sorted(workers.seen) == ["A", "C", "E"]
    assert {name: str(entry.same_as) for name, entry in found.items() if entry.same_as} == dict.fromkeys(
        "BD", "a_msgs/A"
    )
    assert {name for name, entry in found.items() if entry.result.verdict is Verdict.FAIL} == {"A", "B", "D"}
    assert found["A"].result.seconds == 2.0 and found["B"].result.seconds == 0.0
    assert found["A"].result.files and not found["B"].result.files


def test_a_definition_that_is_none_is_refused_and_ends_nothing(tmp_path: Path) -> None:
    workers = Pretenders(lambda _: Verdict.PASS)
    found = entries(write(tmp_path, {"A": "uint8 x\nNowhere y\n", "B": "uint8 x\n"}), workers)
    assert workers.seen == ["B"]
    assert found["A"].result.verdict is Verdict.REFUSED
    assert found["A"].result.detail == "line 2: unknown message 'a_msgs/Nowhere'"
    assert found["A"].statistics is None


def test_all_names_are_meant_if_none_is_given() -> None:
    library = MessageLibrary(ROS2)
    assert select(library, [], Diagnostics()) == library.names()


def test_patterns_and_names(tmp_path: Path) -> None:
    (tmp_path / "a_msgs" / "srv").mkdir(parents=True)
    (tmp_path / "a_msgs" / "srv" / "Add.srv").write_text("int8 a\n---\nint8 b\n")
    library = MessageLibrary(ROS1, [tmp_path])
    service = ["a_msgs/AddRequest", "a_msgs/AddResponse"]

    def names(*patterns: str) -> list[str]:
        return [str(name) for name in select(library, patterns, Diagnostics())]

    assert names("a_msgs/*") == names("a_msgs/srv/*") == names("a_msgs/srv/Add") == names("a_msgs/Add") == service
    assert names("a_msgs/AddR?sponse", "std_msgs/Bool") == ["a_msgs/AddResponse", "std_msgs/Bool"]
    assert names("std_msgs/msg/Bool") == ["std_msgs/Bool"]


@pytest.mark.parametrize("pattern", ["geometry_msgs/Piont", "geometry_msgs/Piont*"])
def test_what_means_no_message_is_an_error_and_leaves_the_others(pattern: str) -> None:
    faults = Diagnostics()
    assert [str(name) for name in select(MessageLibrary(ROS1), [pattern, "std_msgs/Bool"], faults)] == ["std_msgs/Bool"]
    with pytest.raises(InputError, match=r"unknown message 'geometry_msgs/Piont'|no message matches"):
        faults.raise_if_any()
