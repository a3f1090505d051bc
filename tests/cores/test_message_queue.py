"""The queue of messages alone: the order of the messages, its places, and the messages that it drops."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.hdl.ghdl import Library, core_files

BENCH = "firm_message_queue_tb"
COUNTS = [1, 2, 3, 5, 16]
DROPS = ["", "NEWEST", "OLDEST"]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("queue"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])
    return library


def _generics(messages: int, drop: str) -> dict[str, int | str]:
    return {"MESSAGES": messages, **({f"DROP_{drop}": "true"} if drop else {})}


@pytest.mark.one_in(9)
@pytest.mark.parametrize("messages", COUNTS)
@pytest.mark.parametrize("drop", DROPS)
@pytest.mark.parametrize(("seed", "stall", "sink"), [(1, 30, 60), (2, 0, 30), (3, 70, 20), (4, 40, 100)])
def test_random_sides(library: Library, messages: int, drop: str, seed: int, stall: int, sink: int) -> None:
    if messages == 1 and drop == "OLDEST":
        return
    print(f"seed {seed}, stalls {stall} %, the sink takes in {sink} %")
    result = library.run(
        BENCH, _generics(messages, drop) | {"SEED": seed, "STALL_PERCENT": stall, "SINK_PERCENT": sink}
    )
    assert result.exit_code == 0, result.output
    dropped = re.search(r"PASS \d+ messages taken, (\d+) dropped", result.output)
    assert dropped, result.output
    assert drop or dropped[1] == "0"


@pytest.mark.parametrize("messages", COUNTS[1:])
@pytest.mark.parametrize("drop", DROPS)
def test_a_message_a_cycle(library: Library, messages: int, drop: str) -> None:
    result = library.run(BENCH, _generics(messages, drop))
    assert result.exit_code == 0, result.output
    assert "PASS 1999 messages taken, 0 dropped" in result.output


@pytest.mark.parametrize("drop", DROPS)
def test_a_sink_that_never_takes(library: Library, drop: str) -> None:
    result = library.run(BENCH, _generics(3, drop) | {"SINK_PERCENT": 0})
    assert result.exit_code == 0, result.output
    assert f"PASS 0 messages taken, {1997 if drop else 0} dropped, 3 in the queue" in result.output


@pytest.mark.parametrize(("messages", "drop"), [(1, ""), (2, "OLDEST"), (5, ""), (5, "NEWEST"), (5, "OLDEST")])
def test_the_netlist_does_the_same(tmp_path: Path, messages: int, drop: str) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_message_queue", _generics(messages, drop) | {"FIELD_BITS": 16})
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])
    result = library.run(BENCH, _generics(messages, drop) | {"SEED": 5, "STALL_PERCENT": 30, "SINK_PERCENT": 50})
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(("messages", "drop"), [(1, ""), (2, ""), (5, "NEWEST"), (256, "OLDEST")])
def test_there_is_no_latch(library: Library, messages: int, drop: str) -> None:
    assert library.latches("firm_message_queue", _generics(messages, drop) | {"FIELD_BITS": 192}) == []


@pytest.mark.parametrize(
    ("generics", "fault"),
    [
        ({"FIELD_BITS": 0}, "FIELD_BITS is 0; legal: 1 or more"),
        ({"MESSAGES": 0}, "MESSAGES is 0; legal: 1 or more"),
        ({"MESSAGES": 1, "DROP_OLDEST": "true"}, "MESSAGES is 1 with DROP_OLDEST; legal: 2 or more"),
        ({"DROP_NEWEST": "true", "DROP_OLDEST": "true"}, "DROP_NEWEST and DROP_OLDEST are both true; legal: one"),
    ],
)
def test_an_illegal_generic_is_named(library: Library, generics: dict[str, int | str], fault: str) -> None:
    result = library.run("firm_message_queue", generics)
    assert result.exit_code != 0
    assert f"firm_message_queue: {fault}" in result.output
