"""For all tests: their own store, this Python first on PATH, busy machines, ignored interrupts, a limit on waiting.

How long something takes says nothing on a busy machine, so no test is ended for the time it takes. But it fails when it
and all processes below it have waited for a minute (`waiting_limit`) without doing anything. Waiting for a processor,
which others have, counts as doing something.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from zlib import crc32

import psutil
import pytest
from hypothesis import settings

from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.tools.digests import default_root
from fusesoc_firm.tools.interrupts import accept_interrupts
from tests.recall import FRESH, STORE, store
from tests.seeds import ROUND
from tests.shared import SHARED

pytest_plugins = ["tests.reads", "tests.reached", "tests.sharing", "tests.time_report"]

# Lines of progress depend on the speed of the machine.
os.environ["FIRM_PROGRESS"] = "no"
settings.register_profile("untimed", deadline=None, derandomize=not os.environ.get(ROUND), database=None)
settings.load_profile("untimed")

# The part of a processor that polling takes, or clusters at rest. Work gets more, however busy a machine is.
_AT_REST = 0.06
# A Dask cluster that has nothing to do takes a seventh of a processor, unless it looks after itself less often.
_QUIET_DASK = {
    "WORKER__PROFILE__ENABLED": "False",
    "WORKER__MEMORY__MONITOR_INTERVAL": "10s",
    "SCHEDULER__WORK_STEALING_INTERVAL": "5s",
    "ADMIN__TICK__INTERVAL": "2s",
    "ADMIN__SYSTEM_MONITOR__INTERVAL": "10s",
    "ADMIN__SYSTEM_MONITOR__GIL__ENABLED": "False",
}
_LOOKS = 10
# Of a parameter with so many values, none is left to `thorough`.
_FEW = 8
# Rooms whose tests may leave no file or socket open: what is collected as garbage while it is open is a fault.
_CLOSED = tuple(Path(__file__).parent / room for room in ("runs/bags", "node", "runs/simulation"))
_OPEN = ("error::ResourceWarning", "error::pytest.PytestUnraisableExceptionWarning")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fresh", action="store_true", help="recall no result of a tool")
    parser.addini("waiting_limit", "seconds that a test may wait without doing anything", default="60")


def pytest_configure(config: pytest.Config) -> None:
    # What tests start inherits all this.
    accept_interrupts()
    # The processes that share the work of a run share its store and what they made, and no other run does.
    if not hasattr(config, "workerinput"):
        folder = tempfile.TemporaryDirectory(prefix="firm_tests_", ignore_cleanup_errors=True)
        config.add_cleanup(folder.cleanup)
        os.environ.setdefault(STORE, f"{default_root()}_tests")
        if config.getoption("--fresh"):
            os.environ |= {FRESH: "1", "CCACHE_RECACHE": "1"}
        if results := store():
            config.add_cleanup(results.shrink_if_needed)
        os.environ["FUSESOC_FIRM_CACHE"] = f"{folder.name}/store"
        os.environ[SHARED] = f"{folder.name}/shared"
        # Verilator compiles its library again for every program.
        if shutil.which("ccache"):
            os.environ |= {"OBJCACHE": "ccache", "CCACHE_DIR": f"{os.environ[STORE]}/ccache"}
            # Steps of builds whose use of files is observed would find it missing, then there.
            Path(os.environ["CCACHE_DIR"]).mkdir(parents=True, exist_ok=True)
        # FuseSoC looks up a generator's interpreter there.
        os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    os.environ.update({f"DASK_DISTRIBUTED__{name}": value for name, value in _QUIET_DASK.items()})


# Absent without pytest-xdist.
@pytest.hookimpl(optionalhook=True, tryfirst=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """One process more than processors: tests of nodes wait for a part of their time, in which another one works."""
    if config.option.numprocesses != "auto" or "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None
    return len(os.sched_getaffinity(0)) + 1


@pytest.fixture(autouse=True)
def _environment() -> Iterator[None]:
    """What a test does to the environment, as `firm sim` does to FuseSoC's libraries, ends with it."""
    former = dict(os.environ)
    yield
    os.environ.clear()
    os.environ.update(former)


def pytest_make_parametrize_id(val: object) -> str | None:
    """A middleware is called by its number in the names of tests."""
    return str(val.number) if isinstance(val, Middleware) else None


# Before cases are left out by their markers.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: Iterable[pytest.Item]) -> None:
    cases: defaultdict[tuple[object, str], list[pytest.Item]] = defaultdict(list)
    for item in items:
        if _is_closed(item.path):
            for rule in _OPEN:
                item.add_marker(pytest.mark.filterwarnings(rule))
        if item.get_closest_marker("one_in"):
            cases[item.parent, item.name.partition("[")[0]].append(item)
    for test in cases.values():
        _share_out(test)


@cache
def _is_closed(path: Path) -> bool:
    return any(room in path.parents for room in _CLOSED)


def _share_out(cases: Sequence[pytest.Item]) -> None:
    """Mark the cases of a test that do not run with `make test`, by its marker `one_in`."""
    seen: set[tuple[str, str]] = set()
    left = []
    for number, item in enumerate(cases):
        every, others = next((*marker.args, 1)[:2] for marker in item.iter_markers("one_in"))
        # Spread over types and widths: these alternate in the order of the cases.
        if number % every and crc32(item.name.encode()) % others:
            left.append(item)
            continue
        if number % every:
            item.add_marker(pytest.mark.check)
        if not item.get_closest_marker("thorough"):
            seen |= _values(item)
    rare = _values_of_few(cases)
    for item in left:
        new = _values(item) & rare - seen
        item.add_marker(pytest.mark.check if new else pytest.mark.thorough)
        seen |= new


def _values(item: pytest.Item) -> set[tuple[str, str]]:
    """The parameters of a case, and their values."""
    return {(name, repr(value)) for name, value in item.callspec.params.items()} if hasattr(item, "callspec") else set()


def _values_of_few(cases: Iterable[pytest.Item]) -> set[tuple[str, str]]:
    """The values of those parameters that have few: each of them is worth a case."""
    values = set().union(*map(_values, cases))
    counts = Counter(name for name, _ in values)
    return {value for value in values if counts[value[0]] <= _FEW}


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    with _limited(item):
        return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    with _limited(item):
        return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    with _limited(item):
        return (yield)


@contextmanager
def _limited(item: pytest.Item) -> Iterator[None]:
    """Within it, the test fails when it has waited for too long; not one that takes minutes by its nature."""
    if item.get_closest_marker("thorough"):
        yield
        return
    limit = float(item.config.getini("waiting_limit"))
    activity = _Activity()
    # Moments of the last while, and how much had been done by then; most tests are over before the first.
    seen: deque[tuple[float, float]] = deque()
    looking = 0.0

    def look(*_: object) -> None:
        nonlocal looking
        begun, now, done = time.process_time(), time.monotonic(), activity.seconds() - looking
        looking += time.process_time() - begun
        if seen and now - seen[-1][0] > limit / 2:
            # The machine slept, or the test held the looks back.
            seen.clear()
        seen.append((now, done))
        if now - seen[0][0] >= limit:
            then, done_then = seen.popleft()
            if done - done_then < _AT_REST * (now - then):
                pytest.fail(f"neither the test nor a process below it has done anything for {limit:g} s")

    signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, limit / _LOOKS, limit / _LOOKS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


class _Activity:
    """How long a process and all below it have had a processor or have waited for one.

    What ends takes along how long it waited for a processor, so the last known number of each process is kept.
    """

    def __init__(self) -> None:
        self._this = psutil.Process()
        self._seconds: dict[psutil.Process, float] = {}

    def seconds(self) -> float:
        for process in (self._this, *self._this.children(recursive=True)):
            with suppress(psutil.Error):
                self._seconds[process] = sum(process.cpu_times()[:4]) + _seconds_in_queues(process.pid)
        return sum(self._seconds.values())


def _seconds_in_queues(pid: int) -> float:
    """Return how long the threads of a process have waited for a processor: the second number of Linux's schedstat."""
    nanoseconds = 0
    with suppress(OSError):  # the process has ended
        for thread in Path(f"/proc/{pid}/task").iterdir():
            with suppress(OSError):  # the thread has ended
                nanoseconds += int((thread / "schedstat").read_text().split()[1])
    return nanoseconds / 1e9
