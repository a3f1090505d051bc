"""Frames from the programs of a node's packets, against a model, which is compared with the reference's packets."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.fabric.packets import programs_of
from tests.fabric.programs import random_fields, run
from tests.fabric.test_node import node
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.seeds import seeded

SEED = seeded(20261127)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/builder")
PROGRAMS = programs_of(node())


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("builder"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/builder", fileset="tb")])
    return library


def _jobs(seed: int, longest: int) -> tuple[list[str], list[str]]:
    """Rows of all programs with random fields and payloads, and those of their frames."""
    print(f"seed {seed}")
    chance = random.Random(seed)
    jobs, frames = [], []
    for name, entry in PROGRAMS.entries.items():
        has_payload = name.startswith(("sample", "fragment"))
        for size in [0, 1, 2, 3, 4, chance.randrange(5, longest), longest] if has_payload else [0]:
            fields, payload = random_fields(chance), chance.randbytes(size)
            jobs.append(_row(entry, *fields.memory(), size, *payload))
            frame = run(PROGRAMS, name, fields, payload)
            frames.append(_row(len(frame), *frame))
    return jobs, frames


def _row(*numbers: int) -> str:
    return " ".join(map(str, numbers))


def _built(library: Library, folder: Path, jobs: list[str], **generics: Generic) -> list[str]:
    (folder / "programs.txt").write_text("".join(f"{word}\n" for word in PROGRAMS.words), encoding="ascii")
    (folder / "jobs.txt").write_text("".join(f"{job}\n" for job in jobs), encoding="ascii")
    result = library.run("firm_packet_builder_tb", generics, directory=folder)
    assert result.exit_code == 0, result.output
    return (folder / "built.txt").read_text(encoding="ascii").splitlines()


@pytest.mark.parametrize(("stall", "slow"), [(0, 0), (40, 0), (30, 30)])
def test_each_program_becomes_its_frame(library: Library, tmp_path: Path, stall: int, slow: int) -> None:
    """Without stalls, the bench checks that no frame has a pause, and how soon it begins."""
    jobs, frames = _jobs(SEED + stall + slow, 1408)
    assert _built(library, tmp_path, jobs, STALL_PERCENT=stall, SLOW_PERCENT=slow, SEED=SEED) == frames


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_packet_builder", {"ADDRESS_BITS": 12})
    library.analyse(core_files("net/builder", fileset="tb"))
    jobs, frames = _jobs(SEED, 40)
    assert _built(library, tmp_path, jobs, STALL_PERCENT=20) == frames


def test_it_has_no_latch(library: Library) -> None:
    assert library.latches("firm_packet_builder") == []


def test_it_has_no_combinational_loop(tmp_path: Path) -> None:
    assert loops("firm_packet_builder", tmp_path, core_files("net/builder"), []) == []


@pytest.mark.parametrize(
    ("generic", "value", "legal"),
    [
        ("ADDRESS_BITS", 3, "4 to 16"),
        ("ADDRESS_BITS", 17, "4 to 16"),
        ("BANK_BITS", 0, "1 to 8"),
        ("BANK_BITS", 9, "1 to 8"),
    ],
)
def test_a_bad_generic_is_reported(library: Library, generic: str, value: int, legal: str) -> None:
    result = library.run("firm_packet_builder", {generic: value})
    assert result.exit_code != 0
    assert f"firm_packet_builder: {generic} is {value}; legal: {legal}" in result.output
