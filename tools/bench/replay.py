"""`firm replay` with whole bags: ten thousand quaternions in Verilator, and every message of a distribution in GHDL."""

from __future__ import annotations

import contextlib
import io
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from fusesoc_firm.message.library import libraries
from fusesoc_firm.node.transport.built_simulator import CoreSources, build_simulator
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.runs.replay.command import replay
from fusesoc_firm.runs.replay.options import Settings, Source, Target
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.text.diagnostics import InputError
from tests.applications.applications import SPECS
from tests.applications.quaternions import quaternion_bag, worst_error
from tests.converter.simulated.pass_through import QUIET, received, systems_of_all
from tools.bench.tables import FAILED, MET, MISSED, Table, Tell

TITLE = "Bags replayed"
QUATERNIONS = 10_000
LARGEST_ERROR = 1e-9
# Values of each message: empty, typical and extreme ones, and ones of single elements.
VALUES = 4
DISTRIBUTIONS = ("noetic", "humble")

_ANGLES = f"{QUATERNIONS:,} quaternions to angles"
_COLUMNS = ("bag", "simulator", "messages", "build, s", "replay, s", "found", "bar", "result")
_NOTE = """
    The angles are compared, modulo a turn, with results from Python's math. The other bags contain messages of the
    distribution's types, which rosbags has serialised. The system for each of these bags forwards messages of 18 types.
    The recorded messages must have the same bytes, including padding, the same stamps and the same order. Seconds are
    wall-clock time, with any other load on the machine.
    """


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cell of every row, by table."""
    return {TITLE: [(_ANGLES,), *((_every(name),) for name in DISTRIBUTIONS)]}


def measure(seed: int, tell: Tell) -> list[Table]:
    """Replay all; `tell` hears of each."""
    measurements: dict[str, Callable[[Path], tuple[str, ...]]] = {_ANGLES: partial(_angles, seed)}
    measurements |= {_every(name): partial(_pass_through, name, seed) for name in DISTRIBUTIONS}
    rows = []
    for title, measurement in measurements.items():
        with tempfile.TemporaryDirectory() as folder:
            try:
                cells = measurement(Path(folder))
            except InputError as error:
                tell(f"{title}: {error}")
                cells = (*[""] * (len(_COLUMNS) - 2), FAILED)
        rows.append((title, *cells))
        tell(f"{title}: {cells[-1]}")
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def _every(distribution: str) -> str:
    return f"every message of {distribution}"


def _angles(seed: int, folder: Path) -> tuple[str, ...]:
    spec = SPECS / "quat2euler" / "quat2euler.yaml"
    source, target = quaternion_bag(folder / "in.bag", QUATERNIONS, seed), folder / "out.bag"
    times = _replay(spec, "verilator", "", source, target, 1000)
    found = worst_error(source, target)
    result = MET if found < LARGEST_ERROR else MISSED
    return "Verilator", f"{QUATERNIONS:,}", *_shown(times), f"{found:.2g} rad", f"< {LARGEST_ERROR:g} rad", result


def _pass_through(distribution: str, seed: int, folder: Path) -> tuple[str, ...]:
    systems = systems_of_all(distribution, VALUES, seed)
    count = same = 0
    times = (0.0, 0.0)
    for number, system in enumerate(systems):
        place = folder / str(number)
        place.mkdir()
        source, sent = system.bag(place)
        target = place / ("out.bag" if source.suffix == ".bag" else "out")
        spent = _replay(system.specification(place), "ghdl", distribution, source, target, QUIET)
        times = (times[0] + spent[0], times[1] + spent[1])
        count += len(sent)
        same += sum(one == other for one, other in zip(sent, received(target), strict=False))
    found = f"{same:,} the same, of {sum(len(system.names) for system in systems)} types"
    return "GHDL", f"{count:,}", *_shown(times), found, "all", MET if same == count else MISSED


def _replay(spec: Path, tool: str, distribution: str, source: Path, target: Path, quiet: int) -> tuple[float, float]:
    """Build and replay; the seconds of both. Raises `InputError`."""
    begun = time.monotonic()
    built = build_simulator(spec, tool, build_root=target.parent / "build", sources=CoreSources(distro=distribution))
    is_built = time.monotonic()
    loaded = load_system(spec, libraries((), None, distribution or None))
    with contextlib.redirect_stdout(io.StringIO()):
        settings = Settings({}, quiet)
        replay(loaded, Source(source), Target(target), settings, lambda: Simulator(built.command(), built.folder))
    return is_built - begun, time.monotonic() - is_built


def _shown(times: tuple[float, float]) -> tuple[str, str]:
    return f"{times[0]:.0f}", f"{times[1]:.0f}"
