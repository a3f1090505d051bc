"""Results of actions in a remote store: they travel between machines, and no fault of a server gives a wrong result."""

from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.builds.step.action import after, execute, log_of, look_up
from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.results import Results
from fusesoc_firm.builds.step.trace import can_trace
from fusesoc_firm.builds.step.tree import tree_of
from fusesoc_firm.builds.store.layout import ACTION, CONTENT
from fusesoc_firm.builds.store.remote import Remote, remote_store
from fusesoc_firm.builds.store.server import Server
from fusesoc_firm.builds.store.store import Store
from tests.builds.step.test_action import action
from tests.builds.store.test_remote import SECRET, Fake, served

Captured = pytest.CaptureFixture[str]
pytestmark = pytest.mark.skipif(not can_trace(), reason="strace is not installed or not permitted")
CODE = "open('out', 'wb').write(bytes(range(256)) * 99); open('empty', 'w'); print('done')"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "build"
    path.mkdir()
    (path / "in").write_text("content")
    return path


@pytest.fixture
def url(tmp_path: Path) -> Iterator[str]:
    with served(Server(Store(tmp_path / "server", 2**30), "127.0.0.1", 0, SECRET)) as url:
        yield url


def machine(root: Path, url: str, token: str = "") -> Results:
    """A machine's own store in a new process."""
    remote = remote_store({"FUSESOC_FIRM_REMOTE": url, "FUSESOC_FIRM_REMOTE_TOKEN": token}, str(root))
    assert remote
    return Results(root, 2**30, replace(remote))


def run(folder: Path, results: Results) -> None:
    done = execute(action(CODE, folder), results, Contents(), folder.with_name("log"))
    assert (done.status, done.fault) == (0, "")
    for name in ("out", "empty"):
        (folder / name).unlink()


def is_recalled(folder: Path, results: Results) -> bool:
    """Look a step up and restore its outputs, which are right or missing."""
    asked = action(CODE, folder)
    if (record := look_up(asked, results, Contents())) is None:
        return False
    other = folder.with_name("other")
    shutil.rmtree(other, ignore_errors=True)
    other.mkdir()
    (other / "in").write_text("content")
    if log_of(record, results, other) is None or not results.restore(other, record):
        return False
    assert log_of(record, results, other) == b"done\n"
    assert (other / "out").read_bytes() == bytes(range(256)) * 99
    assert tree_of(other, Contents()) == after(record, asked.inputs)
    return True


def test_a_second_machine_runs_nothing(folder: Path, tmp_path: Path, url: str, capfd: Captured) -> None:
    run(folder, machine(tmp_path / "ci", url, SECRET))
    second = machine(tmp_path / "second", url)
    assert is_recalled(folder, second)
    # From here on, the result is in the own store.
    assert is_recalled(folder, replace(second, remote=None))
    assert not second.remove_damaged()
    assert capfd.readouterr().err == ""


def test_only_ci_writes(folder: Path, tmp_path: Path, url: str, capfd: Captured) -> None:
    run(folder, machine(tmp_path / "reader", url))
    assert capfd.readouterr().err == ""
    run(folder, machine(tmp_path / "wrong", url, "another-token"))
    assert capfd.readouterr().err == f"warning: remote store {url}: 401 Unauthorized for a write\n"
    assert not Store(tmp_path / "server", 2**30).size()


def test_a_result_that_is_not_valid_here_is_not_kept(folder: Path, tmp_path: Path, url: str) -> None:
    """The other machine has another file where the step looked for one; this machine's own result remains."""
    header = folder.with_name("x.h")
    asked = action(f"import os; os.path.exists({str(header)!r})", folder)
    ci, second = machine(tmp_path / "ci", url, SECRET), machine(tmp_path / "second", url)
    assert not execute(asked, ci, Contents(), folder.with_name("log")).fault
    header.write_text("")
    assert look_up(asked, second, Contents()) is None
    assert second.record(asked.key()) is None
    assert not execute(asked, second, Contents(), folder.with_name("log")).fault
    assert look_up(asked, second, Contents()) is not None


def test_missing_contents_on_the_server_are_a_miss(folder: Path, tmp_path: Path, url: str) -> None:
    run(folder, machine(tmp_path / "ci", url, SECRET))
    contents = [*(tmp_path / "server").rglob(f"*{CONTENT}")]
    # The record is an entry, with its description.
    assert len(contents) == 4
    for path in contents:
        data = path.read_bytes()
        path.unlink()
        assert not is_recalled(folder, machine(tmp_path / path.name, url))
        path.write_bytes(data)
    assert is_recalled(folder, machine(tmp_path / "second", url))


@pytest.mark.parametrize(
    "count", [pytest.param(100, id="sample"), pytest.param(10_000, id="all", marks=pytest.mark.thorough)]
)
def test_damaged_cut_and_swapped_blobs_are_not_accepted(
    folder: Path, tmp_path: Path, url: str, capfd: Captured, count: int
) -> None:
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    random_ = random.Random(seed)
    run(folder, machine(tmp_path / "ci", url, SECRET))
    blobs = {
        f"/{'ac' if path.suffix == ACTION else 'cas'}/{path.stem}": path.read_bytes().partition(b"\n")[2]
        for path in (tmp_path / "server").rglob("*.*")
    }
    assert len(blobs) == 5
    now = blobs
    with served(Fake(lambda path: (200, now[path]) if path in now else (404, b""))) as other:
        for number in range(count):
            now = {**blobs, (name := random_.choice([*blobs])): damaged(random_, blobs, name)}
            # A remark of a failure would hide the next one. `is_recalled` compares the outputs.
            results = Results(tmp_path / str(number), 2**30, Remote(other, str(tmp_path / str(number))))
            is_same = now[name] == blobs[name] or (name.startswith("/ac") and now[name].startswith(blobs[name]))
            assert is_recalled(folder, results) == is_same, f"{name} in fault {number} of seed {seed}"
            results.clean()
    assert "is damaged and ignored" in capfd.readouterr().err


def damaged(random_: random.Random, blobs: dict[str, bytes], name: str) -> bytes:
    """A blob with a changed, missing or additional byte, cut, or swapped with another one."""
    data = blobs[name]
    place = random_.randrange(len(data) + 1)
    changes = [
        data[:place] + bytes([random_.randrange(256)]) + data[place:],
        data[:place],
        data[:place] + data[place + 1 :],
        blobs[random_.choice([*blobs])],
        random_.randbytes(len(data)),
    ]
    if place < len(data):
        changes.append(data[:place] + bytes([data[place] ^ 1 << random_.randrange(8)]) + data[place + 1 :])
    return random_.choice(changes)
