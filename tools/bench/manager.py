"""LUTs and flip-flops of the Manager and of schedulers, with all numbers of channels of the dissertation's tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from fusesoc_firm.scheduling.area import MANAGER, MANAGER_PREEMPTIVE
from fusesoc_firm.scheduling.evaluation.combinations import COMBINATIONS, COMBINED_REQUESTERS
from fusesoc_firm.scheduling.evaluation.workloads import REQUESTERS
from fusesoc_firm.scheduling.policies import POLICIES
from tests.hdl.ghdl import Generic, Library, core_files
from tools.bench import schedulers
from tools.bench.area import WIDTHS, Bar, Row, Subject, of_core, tables_of
from tools.bench.designs import CORES
from tools.bench.tables import Table, Tell
from tools.bench.yosys import Yosys
from tools.dissertation.published import dissertation

# The sum of table 3.3, LUT/FF.
DISSERTATION = {
    2: "26/12",
    4: "44/13",
    8: "81/14",
    16: "157/15",
    32: "522/16",
    64: "722/17",
    128: "2400/18",
    256: "5438/19",
}
_MANAGER_BAR = Bar(1400, 64)
_SCHEDULER_BARS = {
    ("fixed_priority", 256): Bar(350, 12),
    ("fixed_priority_preemptive", 256): Bar(350, 12),
    ("lru", 8): Bar(80, 40),
    ("lru", 256): Bar(1800, 600),
    ("edf_resources", 256): Bar(2000, 650),
    ("edf_latency", 8): Bar(220, 160),
    ("edf_latency", 256): Bar(20000, 9000),
    ("lst", 8): Bar(350, 160),
    ("lst", 256): Bar(2000, 650),
}

_TREE_ENTITY = "manager_tree"
# Of the Manager of Managers: groups, each with as many publishers.
_TREE_SIDE = 32
TREE_PUBLISHERS = _TREE_SIDE**2
# The default of a system.
WATCHDOG = 2**20
TREES = {"without watchdog": 0, "with watchdog": WATCHDOG}
"""The limits in cycles of a Manager of Managers, by its name."""
# 10 LUT6 a channel.
_TREE_BAR = Bar(10 * TREE_PUBLISHERS)
# Of its status: subscribers, and as many publishers. 16 LUT6 and 12 FF for one of each, and 600 LUT6 and FF.
_STATUS_CHANNELS = 64
_STATUS_BAR = Bar(16 * _STATUS_CHANNELS + 600, 12 * _STATUS_CHANNELS + 600)
_TREE_CORES = (
    "axis/package",
    "axis/axis",
    "sched/package",
    *(f"sched/{core}" for core in ("queue", "engine", "fixed_priority", "round_robin", "lru")),
    *(f"sched/{core}" for core in ("edf_resources", "edf_latency", "lst", "by_policy")),
    "manager/manager",
    "manager/tree",
)

_MANAGER_TITLE, _SCHEDULERS_TITLE, _COMBINED_TITLE = "Manager without scheduler", "Schedulers", "Combined schedulers"
_TREE_TITLE = "Manager of Managers"
_NOTES = {
    _MANAGER_TITLE: f"""There are as many subscribers as publishers. {MANAGER_PREEMPTIVE} is the Manager for
        preemptive schedulers, which sends bursts. The dissertation's value is the sum in table 3.3.""",
    _SCHEDULERS_TITLE: f"""Times have {schedulers.TIME_BITS} bits; periods and transfer times are
        {schedulers.SHORTEST_TIME} to {schedulers.LONGEST_TIME} cycles. For a bar, LUTs as RAM count as LUTs. The
        dissertation's values are from table 4.1.""",
    _TREE_TITLE: f"""Round robin in and among {_TREE_SIDE} groups of {_TREE_SIDE} publishers, with all schedulers and
        one subscriber. For all bars, LUTs as RAM count as LUTs. The status is that of {_STATUS_CHANNELS} subscribers
        and {_STATUS_CHANNELS} publishers, all of which may report faults. Its bar is 600 LUT and 600 FF, and 16 LUT and
        12 FF for each pair of a subscriber and a publisher.""",
    _COMBINED_TITLE: """The times are the same as for the schedulers above. The dissertation's values are from
        table 4.5.""",
}


def rows() -> dict[str, list[Row]]:
    """All rows, by the title of their table."""
    return {
        _MANAGER_TITLE: [*_managers()],
        _SCHEDULERS_TITLE: [*_schedulers()],
        _COMBINED_TITLE: [*_combined()],
        _TREE_TITLE: [*_trees()],
    }


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {title: [row.key for row in found] for title, found in rows().items()}


def measure(yosys: Yosys, tell: Tell) -> list[Table]:
    """Synthesise everything; `tell` hears of each design."""
    return tables_of(rows(), _NOTES, yosys, tell)


def label(design: str, channels: int) -> str:
    """Return the title of a row."""
    return f"{design}, N = {channels}"


def _managers() -> Iterator[Row]:
    """At the width of the dissertation's streams all numbers of channels, at others two."""
    for design, is_preemptive in ((MANAGER, False), (MANAGER_PREEMPTIVE, True)):
        for width in WIDTHS:
            is_theirs = width == WIDTHS[0]
            for channels in REQUESTERS if is_theirs else (2, 8):
                generics: dict[str, Generic] = {
                    "WIDTH": width,
                    "SUBSCRIBERS": channels,
                    "PUBLISHERS": channels,
                    "PREEMPTIVE": is_preemptive,
                }
                known = DISSERTATION[channels] if is_theirs and not is_preemptive else ""
                bar = _MANAGER_BAR if known and channels == 256 else None
                yield Row(label(design, channels), "", width, of_core("firm_manager", generics), known, bar)


def _schedulers() -> Iterator[Row]:
    for policy in POLICIES:
        known = {number: _lut_ff(area) for number, area in dissertation().area.get(policy, {}).items()}
        for channels in REQUESTERS:
            bar = _SCHEDULER_BARS.get((policy, channels))
            yield Row(label(policy, channels), "", None, _scheduler(policy, channels), known.get(channels, ""), bar)


def _scheduler(policy: str, channels: int) -> Callable[[Path], Subject]:
    return lambda folder: Subject(*schedulers.analysed(folder, policy, channels))


def _combined() -> Iterator[Row]:
    for name in COMBINATIONS:
        known = _lut_ff(dissertation().combined_area[name])
        yield Row(label(name, COMBINED_REQUESTERS), "", None, _combination(name), known)


def _combination(name: str) -> Callable[[Path], Subject]:
    return lambda folder: Subject(*schedulers.combined(folder, COMBINATIONS[name], COMBINED_REQUESTERS))


def _trees() -> Iterator[Row]:
    for name, watchdog in TREES.items():
        yield Row(label(f"round_robin, {name}", TREE_PUBLISHERS), "", None, tree(watchdog), bar=_TREE_BAR)
    channels: dict[str, Generic] = {"SUBSCRIBERS": _STATUS_CHANNELS, "PUBLISHERS": _STATUS_CHANNELS}
    counters = of_core("firm_status_tree_counters", channels, (*CORES, "sched/package", "status/status"))
    yield Row(label("its status", _STATUS_CHANNELS), "", None, counters, bar=_STATUS_BAR)


def tree(watchdog: int) -> Callable[[Path], Subject]:
    """Return the Manager of Managers with `TREE_PUBLISHERS`, and watchdogs with this limit in cycles, or none."""

    def make(folder: Path) -> Subject:
        library = Library("firm", folder)
        library.analyse([*core_files(*_TREE_CORES), Path(__file__).with_name(f"{_TREE_ENTITY}.vhd")])
        return Subject(library, _TREE_ENTITY, {"WIDTH": WIDTHS[0], "SIDE": _TREE_SIDE, "WATCHDOG": watchdog})

    return make


def _lut_ff(area: list[float]) -> str:
    return "/".join(f"{number:.0f}" for number in area)
