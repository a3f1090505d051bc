"""The Manager of Managers, with ids of two bytes, between the simulation host and one echo a channel."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.cores.schedulers import POLICY_CORES
from tests.hdl.frames import Frame, random_frames, traffic, write_expected, write_stimulus
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

SEED = seeded(20261123)
BENCH = "firm_manager_tree_tb"
ID_BYTES = 2
WIDTHS = (8, 16, 32, 64, 512)

# Cycles: three register slices, the part that removes the byte, the echo's FIFO and the schedulers' choices.
LONGEST_LATENCY = 12


@dataclass(frozen=True)
class Tree:
    """Generics of the bench."""

    subscribers: int
    publishers: int
    group_size: int
    policy: int = 0
    top: int = 0
    is_reversed: bool = False

    def __str__(self) -> str:
        return f"{self.subscribers}-{self.publishers}-by-{self.group_size}"

    def generics(self, width: int) -> dict[str, int | bool]:
        return {
            "WIDTH": width,
            "SUBSCRIBERS": self.subscribers,
            "PUBLISHERS": self.publishers,
            "GROUP_SIZE": self.group_size,
            "POLICY": self.policy,
            "TOP": self.top,
            "REVERSED": self.is_reversed,
        }


TREES = (
    Tree(1, 1, 1),
    Tree(2, 2, 1, policy=2, top=1),
    Tree(5, 5, 2, policy=1, is_reversed=True),
    Tree(16, 16, 4, top=2),
    Tree(7, 3, 2),
    Tree(300, 300, 20, is_reversed=True),
)


def tree_library(directory: Path) -> Library:
    library = Library("firm", directory)
    policies = (f"sched/{core}" for core in POLICY_CORES)
    library.analyse(
        core_files(
            "axis/package",
            "axis/axis",
            "sched/package",
            *policies,
            "sched/by_policy",
            "manager/manager",
            "manager/tree",
            "sim/checker",
            "sim/host",
            "sim/parts",
            "sim/echo",
        )
    )
    library.analyse(core_files("manager/tree", fileset="tb"))
    return library


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return tree_library(tmp_path_factory.mktemp("tree"))


def _write_files(directory: Path, frames: list[Frame], tree: Tree) -> int:
    """Files for these frames; the number of answers."""
    write_stimulus(directory / "stimulus.txt", (frame.to_bytes(ID_BYTES) for frame in frames))
    known = min(tree.subscribers, tree.publishers)
    answers = [(n, frame.to_bytes(ID_BYTES)) for n, frame in enumerate(frames) if frame.id < known]
    unknown = sum(frame.id >= tree.subscribers for frame in frames)
    write_expected(directory / "expected.txt", answers, unknown)
    return len(answers)


@pytest.mark.one_in(7, 5)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("tree", TREES, ids=str)
def test_every_frame_comes_back_under_stalls(library: Library, tmp_path: Path, tree: Tree, width: int) -> None:
    # Some of the ids are unknown: those above the highest one, and those whose upper byte alone is wrong.
    ids = [*range(tree.subscribers + 3), *(256 * high for high in (1, 7, 255) if 256 * high >= tree.subscribers)]
    answers = _write_files(tmp_path, random_frames(ids, 150, 5 * width // 8, SEED), tree)
    for host_stall, echo_stall in ((30, 60), (70, 10)):
        stalls = {"SEED": SEED, "STALL_PERCENT": host_stall, "ECHO_STALL_PERCENT": echo_stall}
        result = library.run(BENCH, {**tree.generics(width), **stalls}, directory=tmp_path)
        assert result.exit_code == 0, result.output
        assert result.output.splitlines()[-1] == f"PASS {answers}/{answers}"


@pytest.mark.parametrize("width", WIDTHS)
def test_no_cycle_is_lost_without_stalls(library: Library, tmp_path: Path, width: int) -> None:
    """The payloads' lengths cover each number of bytes in the last beat."""
    tree = Tree(16, 16, 4)
    frames = [Frame(n % 16, bytes(n % (2 * width // 8))) for n in range(max(120, width // 2))]
    _write_files(tmp_path, frames, tree)
    result = library.run(BENCH, tree.generics(width), directory=tmp_path)
    assert result.exit_code == 0, result.output
    beats = sum(frame.beats(width, ID_BYTES) for frame in frames)
    found = traffic(result.output)
    assert (found.beats_in, found.beats_out) == (beats, beats)
    assert found.cycles <= beats + LONGEST_LATENCY


@pytest.mark.thorough
def test_1024_publishers_saturate_the_channel_in_order(library: Library, tmp_path: Path) -> None:
    """Two frames of each publisher; the host compares each byte, and the order of each publisher's frames."""
    tree = Tree(1024, 1024, 32, is_reversed=True)
    frames = [Frame(n % 1024, bytes([n // 1024, n % 251])) for n in range(2 * 1024)]
    answers = _write_files(tmp_path, frames, tree)
    result = library.run(BENCH, {**tree.generics(8), "WATCHDOG": 40000}, directory=tmp_path, seconds=600)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == f"PASS {answers}/{answers}"
    found = traffic(result.output)
    assert found.cycles <= found.beats_out + LONGEST_LATENCY


def test_a_frame_that_ends_within_its_id_is_reported(library: Library, tmp_path: Path) -> None:
    whole = Frame(1, b"abc").to_bytes(ID_BYTES)
    tree = Tree(2, 2, 1)
    for width, short in ((8, [b"\x00", b"\x01\x00", b"\x09\x00"]), (16, [b"\x00", b"\x09\x00"]), (64, [b"\x00"])):
        frames = [frame for item in short for frame in (item, whole)]
        write_stimulus(tmp_path / "stimulus.txt", frames, id_bytes=ID_BYTES)
        answers = [(n, frame) for n, frame in enumerate(frames) if frame == whole]
        write_expected(tmp_path / "expected.txt", answers, id_errors=len(short))
        result = library.run(BENCH, {**tree.generics(width), "STALL_PERCENT": 30, "SEED": SEED}, directory=tmp_path)
        assert result.exit_code == 0, result.output


@pytest.mark.parametrize("width", [8, 16, 64])
def test_it_is_latch_free(library: Library, width: int) -> None:
    for entity in ("firm_axis_id_insert", "firm_axis_id_remove", "firm_manager_tree"):
        assert library.latches(entity, {"WIDTH": width}) == []


@pytest.mark.parametrize(
    ("generic", "value", "legal"),
    [
        ("WIDTH", 48, "8, 16, 32, 64, 128, 256, 512"),
        ("SUBSCRIBERS", 0, "1 to 65536"),
        ("SUBSCRIBERS", 65537, "1 to 65536"),
        ("PUBLISHERS", 0, "1 to 65536"),
        ("PUBLISHERS", 65537, "1 to 65536"),
    ],
)
def test_illegal_generics_are_named(library: Library, generic: str, value: int, legal: str) -> None:
    result = library.run("firm_manager_tree", {generic: value})
    assert result.exit_code != 0
    assert f" is {value}; legal: {legal}" in result.output


def test_groups_that_do_not_fit_are_named(library: Library) -> None:
    result = library.run("firm_manager_tree", {"PUBLISHERS": 3})
    assert result.exit_code != 0
    assert "the sizes of the groups add up to 2; legal: 3, the number of requesters" in result.output
