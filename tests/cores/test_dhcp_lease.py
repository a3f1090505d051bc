"""The clock of a lease of DHCP: when it is to be renewed and rebound, and when it ends, against RFC 2131."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

SEED = seeded(20261127)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/package", "net/dhcp")
ENDLESS = (1 << 32) - 1


@dataclass(frozen=True)
class Lease:
    """A lease, in seconds: until its answer, those that are counted, and the times that its server tells."""

    before: int
    counted: int
    seconds: int
    renewal: int | None = None
    rebinding: int | None = None

    @property
    def row(self) -> str:
        told = [(int(time is not None), *(time or 0).to_bytes(4, "big")) for time in self._told]
        return " ".join(map(str, (self.before, self.counted, *sum(told, ())))) + "\n"

    @property
    def firsts(self) -> list[int]:
        """The first seconds of renewal, rebinding and end that are counted, or 0; half and seven eighths by default."""
        times = [
            self.seconds // 2 if self.renewal is None else self.renewal,
            self.seconds - self.seconds // 8 if self.rebinding is None else self.rebinding,
            self.seconds,
        ]
        first, last = self.before + 1, self.before + self.counted
        return [max(time, first) if time <= last else 0 for time in times]

    @property
    def _told(self) -> tuple[int | None, ...]:
        return self.seconds, self.renewal, self.rebinding


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("lease"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/dhcp", fileset="tb")])
    return library


def _check(library: Library, folder: Path, leases: list[Lease]) -> None:
    (folder / "leases.txt").write_text("".join(lease.row for lease in leases), encoding="ascii")
    result = library.run("firm_dhcp_lease_tb", {}, directory=folder)
    assert result.exit_code == 0, result.output
    rows = (folder / "ends.txt").read_text(encoding="ascii").splitlines()
    assert [[int(second) for second in row.split()] for row in rows] == [lease.firsts for lease in leases]


def _leases(count: int) -> list[Lease]:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    times = (None, 0, 1, 250, 256, 257, 300, 511, 512, 0x10100, ENDLESS)
    seconds = (0, 1, 7, 8, 255, 256, 257, 511, 512, 513, 0x200, 0x1FF00, ENDLESS)
    return [
        Lease(
            chance.randrange(100),
            chance.randrange(0, 700, 5),
            chance.choice((*seconds, chance.randrange(900))),
            chance.choice((None, *times, chance.randrange(900))),
            chance.choice((None, *times, chance.randrange(900))),
        )
        for _ in range(count)
    ]


def test_a_lease_is_renewed_and_ends_in_time(library: Library, tmp_path: Path) -> None:
    _check(library, tmp_path, _leases(60))


@pytest.mark.check
def test_seconds_of_most_of_a_day_are_counted(library: Library, tmp_path: Path) -> None:
    _check(library, tmp_path, [Lease(2, 66_000, 65_700, 65_536)])


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    assert library.latches("firm_dhcp_lease") == []
    library.replace_by_netlist("firm_dhcp_lease", {})
    library.analyse(core_files("net/dhcp", fileset="tb"))
    _check(library, tmp_path, _leases(6))
