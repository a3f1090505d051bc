"""Ethernet frames at the pins of an MII, a GMII, an RGMII or an RMII: both directions, with unrelated clocks."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.cores.crossing_paths import Domains, unsynchronised
from tests.cores.ethernet import GAP_BYTES, LONGEST, PREAMBLE, Burst, on_line, random_bursts, verdict
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

SEED = seeded(20261126)
# The sides with a clock of their own.
ENTITIES: dict[str, tuple[str, ...]] = {
    "firm_mii": ("mii_rx", "mii_tx"),
    "firm_gmii": ("gmii_rx",),
    "firm_rgmii": ("rgmii_rx",),
    "firm_rmii": (),
}
CORES = (
    "axis/package",
    "axis/axis",
    "sim/sync",
    "cdc/cdc",
    "sim/checker",
    "sim/host",
    "sim/parts",
    "net/mac",
    "net/ddr",
    "net/mii",
)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    library = Library("firm", tmp_path_factory.mktemp("mii"))
    library.analyse([*core_files(*CORES), *core_files("net/mii", fileset="tb")])
    return library


def _nibbles(data: bytes) -> list[int]:
    return [nibble for byte in data for nibble in (byte & 15, byte >> 4)]


def _row(burst: Burst, cut: int = 0, extra: int = 0) -> str:
    """A burst as nibbles, without the first `cut` ones and with `extra` ones at the end."""
    nibbles = [*_nibbles(burst.data)[cut:], *[9] * extra]
    fault = 2 * burst.fault - cut if burst.fault >= 0 else -1
    return " ".join(map(str, (2 * burst.idle, fault, len(nibbles), *nibbles))) + "\n"


def _back(library: Library, folder: Path, rows: list[str], **generics: Generic) -> list[tuple[int, int, list[int]]]:
    """What the board sends: idle nibbles, the place of an error, and the nibbles, of each burst."""
    (folder / "nibbles.txt").write_text("".join(rows), encoding="ascii")
    result = library.run("firm_mii_tb", generics, directory=folder)
    assert result.exit_code == 0, result.output
    lines = (folder / "sent.txt").read_text(encoding="ascii").splitlines()
    bursts = [[*map(int, line.split())] for line in lines]
    return [(idle, fault, nibbles) for idle, fault, _, *nibbles in bursts]


@pytest.mark.parametrize(
    ("period", "phy_period"), [(8000, 40000), (39900, 40000), pytest.param(8000, 400000, marks=pytest.mark.check)]
)
def test_good_frames_come_back_and_no_others(library: Library, tmp_path: Path, period: int, phy_period: int) -> None:
    seed = SEED + period
    print(f"seed {seed}")
    random_ = random.Random(seed)
    # All idle bytes of the line are there, as behind a PHY.
    bursts = [Burst(burst.data, GAP_BYTES, burst.fault) for burst in random_bursts(60, 250, seed)]
    verdicts = [verdict(burst) for burst in bursts]
    rows = [_row(burst, extra=random_.randrange(2)) for burst in bursts]
    back = _back(library, tmp_path, rows, PERIOD_PS=period, PHY_PERIOD_PS=phy_period, SEED=seed)
    wanted = [item.frame for item in verdicts if item.pulse == "good"]
    assert [nibbles for _, _, nibbles in back] == [_nibbles(on_line(frame)) for frame in wanted]
    assert {fault for _, fault, _ in back} == {-1}
    assert min(idle for idle, _, _ in back[1:]) >= 2 * GAP_BYTES


@pytest.mark.one_in(3)
@pytest.mark.parametrize("pins", ["IS_GMII", "IS_RGMII"])
@pytest.mark.parametrize("period", [7990, 8000, 8010])
def test_good_frames_come_back_at_1_gbit(library: Library, tmp_path: Path, period: int, pins: str) -> None:
    """The clocks differ by some 0.2 %, more than any two of 125 MHz; the longest frames do not overrun the FIFO."""
    seed = SEED + period
    print(f"seed {seed}")
    bursts = [Burst(burst.data, GAP_BYTES, burst.fault) for burst in random_bursts(60, 250, seed)]
    bursts += [Burst(on_line(random.Random(seed).randbytes(LONGEST)))] * 3
    rows = [burst.row() for burst in bursts]
    back = _back(library, tmp_path, rows, PERIOD_PS=period, PHY_PERIOD_PS=8000, SEED=seed, **{pins: True})
    verdicts = map(verdict, bursts)
    assert [bytes(data) for _, _, data in back] == [on_line(item.frame) for item in verdicts if item.pulse == "good"]
    assert {fault for _, fault, _ in back} == {-1}
    assert min(idle for idle, _, _ in back[1:]) >= GAP_BYTES


def test_frames_of_a_slower_line_are_broken_at_an_rgmii(library: Library, tmp_path: Path) -> None:
    """At 100 Mbit/s, the PHY shows each nibble at both edges of its clock. A byte in each cycle still passes."""
    frames = [random.Random(number).randbytes(60 + number) for number in range(8)]
    slow = [bytes(17 * nibble for nibble in _nibbles(on_line(frame))) for frame in frames]
    rows = [Burst(line, GAP_BYTES).row() for line in (*slow, on_line(frames[0]))]
    back = _back(library, tmp_path, rows, PERIOD_PS=8000, PHY_PERIOD_PS=40000, IS_RGMII=True)
    assert [bytes(data) for _, _, data in back] == [on_line(frames[0])]


def _pairs(data: bytes) -> list[int]:
    return [byte >> place & 3 for byte in data for place in (0, 2, 4, 6)]


def _at_rmii(burst: Burst, chance: random.Random) -> str:
    """A burst as pairs of bits: carrier before the preamble, a cut preamble, and carrier that ends before the data."""
    cut = chance.randrange(20) if burst.data.startswith(PREAMBLE) else 0
    pairs = _pairs(burst.data)[cut:]
    if chance.random() < 0.5:
        # In each nibble after the end of the carrier, the first pair is not marked as valid.
        for place in range(len(pairs) - 2 * chance.randrange(1, 8), len(pairs), 2):
            pairs[place] += 256
    pairs = [0] * chance.randrange(8) + pairs
    return " ".join(map(str, (4 * burst.idle, -1, len(pairs), *pairs))) + "\n"


def test_good_frames_come_back_at_an_rmii(library: Library, tmp_path: Path) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    # An RMII has no error of its own, and all bursts have whole nibbles.
    bursts = [Burst(burst.data, GAP_BYTES) for burst in random_bursts(60, 250, SEED) if len(burst.data) > 30]
    verdicts = map(verdict, bursts)
    rows = [_at_rmii(burst, chance) for burst in bursts]
    back = _back(library, tmp_path, rows, PERIOD_PS=20000, IS_RMII=True)
    wanted = [item.frame for item in verdicts if item.pulse == "good"]
    assert len(wanted) > 20
    assert [pairs for _, _, pairs in back] == [_pairs(on_line(frame)) for frame in wanted]
    assert min(idle for idle, _, _ in back[1:]) >= 4 * GAP_BYTES


def test_a_preamble_may_have_any_number_of_nibbles(library: Library, tmp_path: Path) -> None:
    frames = [random.Random(number).randbytes(60 + number) for number in range(15)]
    rows = [_row(Burst(on_line(frame)), cut=cut) for cut, frame in enumerate(frames)]
    back = _back(library, tmp_path, rows, PHY_PERIOD_PS=40000)
    assert [nibbles for _, _, nibbles in back] == [_nibbles(on_line(frame)) for frame in frames]


def test_frames_follow_each_other_without_a_pause(library: Library, tmp_path: Path) -> None:
    """The gap on the line is that of the standard, though bytes cross between clocks."""
    rows = [_row(Burst(on_line(bytes([number]) * 60), 1)) for number in range(12)]
    back = _back(library, tmp_path, rows)
    assert [idle for idle, _, _ in back[1:]] == [2 * GAP_BYTES] * 11


def _hardware(folder: Path) -> Library:
    library = Library("firm", folder)
    library.analyse(core_files("axis/package", "axis/axis", "cdc/sync", "cdc/cdc", "net/ddr", "net/mii"))
    return library


@pytest.mark.parametrize("entity", ENTITIES)
def test_it_has_no_latch(tmp_path: Path, entity: str) -> None:
    assert _hardware(tmp_path).latches(entity) == []


@pytest.mark.check
@pytest.mark.parametrize("entity", [entity for entity, sides in ENTITIES.items() if sides])
def test_every_path_between_the_clocks_is_synchronised(tmp_path: Path, entity: str) -> None:
    verilog = _hardware(tmp_path).synthesise(entity, {}, "verilog")
    sides = ENTITIES[entity]
    clocks = {"clk": "system"} | {f"{side}_clk": side for side in sides}
    domains = Domains(clocks, lambda port: next(filter(port.startswith, sides), "system"))
    assert unsynchronised(verilog, entity, tmp_path, domains) == []
