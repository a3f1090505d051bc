"""Generator calls as FuseSoC's processes: many at once, killed, without disk space, with a damaged store.

In each case, a successful call has written exactly the files of an undisturbed first call; a failed one has not written
a `.core`, without which FuseSoC uses nothing.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.builds.store.layout import CALL, ENTRY
from fusesoc_firm.cli import main as firm
from fusesoc_firm.tools.own_code import PACKAGE
from tests.processes import IGNORING_INTERRUPTS

ROOT = PACKAGE.parent
COMMAND = ROOT / "generators" / "far_generator.py"
# It stops where a test wants to interfere.
HANG = """
import os, time
if os.environ.get("HANG"):
    print("in the middle", flush=True)
    time.sleep(600)
"""
# Root may read and write files regardless of their rights, unless it drops this capability.
UNPRIVILEGED = ["setpriv", "--bounding-set=-dac_override,-dac_read_search,-fowner"] if os.geteuid() == 0 else []
IS_NAMESPACE_ALLOWED = subprocess.run(["unshare", "-rmpu", "--fork", "true"], check=False).returncode == 0
needs_namespaces = pytest.mark.skipif(not IS_NAMESPACE_ALLOWED, reason="this user may not make namespaces")


@dataclass(frozen=True)
class Calls:
    """A simulation's generator call, to be answered in several folders, with one store."""

    folder: Path

    @property
    def store(self) -> Path:
        return self.folder / "store"

    def work(self, name: str) -> Path:
        """Create a folder with FuseSoC's call."""
        work = self.folder / name
        work.mkdir(exist_ok=True)
        files = {"spec": "quat2euler.yaml", "stimuli": "stimuli.yaml", "model": "model.py"}
        call = {
            "files_root": str(self.folder / "project"),
            "vlnv": "a:b:c-simulation:1",
            "parameters": {"product": "simulation", **files},
        }
        (work / "call.yml").write_text(yaml.safe_dump(call))
        return work

    def start(self, name: str, *around: str, environment: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
        base = {"PYTHONPATH": str(ROOT), "FUSESOC_FIRM_CACHE": str(self.store), "FUSESOC_FIRM_PYTHON": sys.executable}
        return subprocess.Popen(
            [*around, sys.executable, str(COMMAND), "call.yml"],
            cwd=self.work(name),
            env=os.environ | base | dict(environment or {}),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, name: str, *around: str, environment: Mapping[str, str] | None = None) -> tuple[int, str, str]:
        """Exit status, the word after the core's name ("generated" or "from") or all of stdout, and stderr."""
        process = self.start(name, *around, environment=environment)
        output, errors = process.communicate()
        words = output.split()
        return process.returncode, words[2] if len(words) > 2 else output, errors

    def written(self, name: str) -> dict[str, bytes]:
        paths = (path for path in sorted((self.folder / name).rglob("*")) if path.is_file())
        return {path.name: path.read_bytes() for path in paths if path.name != "call.yml"}

    def kept(self, suffix: str) -> list[Path]:
        return sorted(self.store.rglob(f"*{suffix}"))


def _calls(folder: Path) -> Calls:
    shutil.copytree(ROOT / "specs" / "quat2euler", folder / "project")
    model = folder / "project" / "model.py"
    model.write_text(model.read_text() + HANG)
    return Calls(folder)


@pytest.fixture
def calls(tmp_path: Path) -> Calls:
    return _calls(tmp_path)


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of an undisturbed call."""
    calls = _calls(tmp_path_factory.mktemp("undisturbed"))
    assert calls.run("work") == (0, "generated", "")
    return calls.written("work")


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_an_interrupted_call_leaves_nothing(
    calls: Calls, right: dict[str, bytes], number: signal.Signals, status: int
) -> None:
    # The parent process may ignore SIGINT.
    process = calls.start("work", *IGNORING_INTERRUPTS, environment={"HANG": "1"})
    assert process.stdout is not None
    assert process.stdout.readline() == "in the middle\n"
    process.send_signal(number)
    _, errors = process.communicate()
    assert process.returncode == status
    assert errors == ("interrupted\n" if number == signal.SIGINT else "")
    assert calls.written("work") == {}
    assert calls.kept(ENTRY) == calls.kept(CALL) == []
    assert calls.run("work") == (0, "generated", "")
    assert calls.written("work") == right


def test_a_call_that_is_killed_at_any_moment(calls: Calls, right: dict[str, bytes]) -> None:
    seed = random.randrange(10**6)
    print(f"seed {seed}")
    moments = random.Random(seed)
    for number in range(8):
        process = calls.start(f"killed{number % 3}")
        time.sleep(moments.uniform(0, 0.8))
        process.kill()
        process.communicate()
        found = calls.written(f"killed{number % 3}")
        assert "c-simulation.core" not in found or right.items() <= found.items()
        if number % 4 == 3:
            shutil.rmtree(calls.store, ignore_errors=True)
    status, _, errors = calls.run("killed0")
    assert (status, errors) == (0, "")
    assert right.items() <= calls.written("killed0").items()


@pytest.mark.one_in(3)
@pytest.mark.parametrize("count", [2, 8])
@pytest.mark.parametrize("is_one_folder", [False, True], ids=["own_folders", "one_folder"])
def test_calls_at_once(calls: Calls, right: dict[str, bytes], count: int, is_one_folder: bool) -> None:
    names = ["work" if is_one_folder else f"work{number}" for number in range(count)]
    processes = [calls.start(name) for name in names]
    outputs = [process.communicate() for process in processes]
    assert [process.returncode for process in processes] == [0] * count
    assert [errors for _, errors in outputs] == [""] * count
    assert sorted(output.split()[2] for output, _ in outputs) == ["from"] * (count - 1) + ["generated"]
    assert all(calls.written(name) == right for name in names)
    assert calls.run("after") == (0, "from", "")


def _truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


def _flipped(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) * 3 // 4] ^= 1
    path.write_bytes(data)


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


DAMAGE: dict[str, Callable[[Path], object]] = {
    "truncated": _truncated,
    "empty": lambda path: path.write_bytes(b""),
    "flipped": _flipped,
    "missing": lambda path: path.unlink(),
    "forbidden": lambda path: path.chmod(0),
}


@pytest.mark.one_in(3)
@pytest.mark.parametrize("suffix", [ENTRY, CALL])
@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_store(calls: Calls, right: dict[str, bytes], damage: Callable[[Path], object], suffix: str) -> None:
    calls.run("first")
    (path,) = calls.kept(suffix)
    damage(path)
    status, origin, errors = calls.run("second", *UNPRIVILEGED)
    assert (status, errors) == (0, "")
    # Without the call's note, its key still leads to the entry.
    assert origin == ("generated" if suffix == ENTRY else "from")
    assert calls.written("second") == right
    # The entry is repaired.
    assert calls.run("third", *UNPRIVILEGED) == (0, "from", "")
    assert calls.written("third") == right


def test_what_is_in_the_way_is_done_without(calls: Calls, right: dict[str, bytes]) -> None:
    calls.run("first")
    (path,) = calls.kept(ENTRY)
    _folder(path)
    status, origin, errors = calls.run("second")
    assert (status, origin) == (0, "generated")
    assert errors == f"warning: results cannot be cached in the store {calls.store}: Is a directory\n"
    assert calls.written("second") == right


def test_a_store_that_may_only_be_read(calls: Calls, right: dict[str, bytes]) -> None:
    calls.run("first")
    for path in (*calls.store.rglob("*"), calls.store):
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = {path: path.is_file() and path.read_bytes() for path in calls.store.rglob("*")}
    try:
        assert calls.run("second", *UNPRIVILEGED) == (0, "from", "")
        model = calls.folder / "project" / "model.py"
        model.write_text(model.read_text() + "\n")
        status, origin, errors = calls.run("third", *UNPRIVILEGED)
        # Users of a read-only store are not warned on every run.
        assert (status, origin, errors) == (0, "generated", "")
        show = [*UNPRIVILEGED, sys.executable, "-m", "fusesoc_firm.cli", "cache", "show"]
        environment = os.environ | {"PYTHONPATH": str(ROOT), "FUSESOC_FIRM_CACHE": str(calls.store)}
        shown = subprocess.run(show, env=environment, capture_output=True, text=True, check=True).stdout
        assert shown.splitlines()[-1] == "rights   read-only: new results are not cached"
        assert calls.written("second") == calls.written("third") == right
        assert {path: path.is_file() and path.read_bytes() for path in calls.store.rglob("*")} == before
    finally:
        for path in (calls.store, *calls.store.rglob("*")):
            path.chmod(0o755)


@pytest.mark.parametrize("is_stored", [False, True])
def test_no_file_may_be_large(calls: Calls, is_stored: bool) -> None:
    """The system stops writing in the middle of a file; a hit in the store does not help."""
    if is_stored:
        calls.run("first")
    status, _, errors = calls.run("work", "prlimit", "--fsize=2000")
    assert status == 1
    assert errors.endswith("File too large\n")
    assert f"error: cannot write {calls.folder / 'work'}" in errors
    assert "c-simulation.core" not in calls.written("work")
    assert all(len(content) < 2000 for content in calls.written("work").values())


@needs_namespaces
@pytest.mark.parametrize("full", ["store", "work"])
def test_a_full_disk(calls: Calls, right: dict[str, bytes], full: str) -> None:
    """A disk of four pages, too small for the files and for an entry."""
    (calls.folder / full).mkdir()
    call = calls.work("work") / "call.yml"
    place = calls.folder / full
    script = f"cp '{call}' /dev/shm/$$.yml; mount -t tmpfs -o size=16k none '{place}'; cd '{place.parent}/work'; "
    script += f"[ -f call.yml ] || cp /dev/shm/$$.yml call.yml; rm /dev/shm/$$.yml; \"$@\"; status=$?; ls '{place}' >&2"
    script += "; exit $status"
    status, origin, errors = calls.run("work", "unshare", "-rm", "sh", "-c", script, "sh")
    if full == "store":
        assert (status, origin) == (0, "generated")
        assert f"warning: results cannot be cached in the store {calls.store}: No space left on device\n" in errors
        assert calls.written("work") == right
    else:
        assert status == 1
        assert "No space left on device" in errors
        assert ".core" not in errors.partition("device\n")[2]


# Locks on another machine's folder may be refused, or have no effect.
NO_LOCKS = """
import fcntl
def flock(*_):
    {refusal}
fcntl.flock = flock
"""


@pytest.mark.one_in(2)
@needs_namespaces
@pytest.mark.parametrize("refusal", ["raise OSError(37, 'No locks available')", "return None"])
def test_machines_that_share_a_store(calls: Calls, right: dict[str, bytes], refusal: str) -> None:
    """Each has its own host name and processes with the same numbers; locks do not work between them."""
    site = calls.folder / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(NO_LOCKS.format(refusal=refusal))
    path = os.pathsep.join([str(site), str(ROOT)])
    for turn in range(2):
        shutil.rmtree(calls.store, ignore_errors=True)
        processes = []
        for machine in range(3):
            script = f'hostname machine{machine}; "$@"'
            around = ("unshare", "-rmpu", "--fork", "--mount-proc", "sh", "-c", script, "sh")
            # First each in a folder of its own, then all in a shared one.
            name = "shared" if turn else f"work{machine}"
            processes.append(calls.start(name, *around, environment={"PYTHONPATH": path}))
        outputs = [process.communicate() for process in processes]
        assert [(process.returncode, errors) for process, (_, errors) in zip(processes, outputs, strict=True)] == [
            (0, "")
        ] * 3
    for name in ("work0", "work1", "work2", "shared"):
        assert calls.written(name) == right
    # The texts of definitions are beside the results.
    legal = (ENTRY, CALL, ".json")
    assert not [path for path in calls.store.rglob("*") if path.is_file() and path.suffix not in legal]
    assert calls.run("after") == (0, "from", "")


def test_the_store_is_emptied_all_the_time(
    calls: Calls, right: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(calls.store))
    for turn in range(2):
        processes = [calls.start(f"work{number}") for number in range(3)]
        while any(process.poll() is None for process in processes):
            assert firm(["cache", "clean"] if turn % 2 else ["cache", "clean", "--to", "1"]) == 0
            time.sleep(0.01)
        assert [process.communicate()[1] for process in processes] == [""] * 3
        assert all(process.returncode == 0 for process in processes)
    assert all(calls.written(f"work{number}") == right for number in range(3))
