"""The store: hits and misses, atomic entries, any number of processes, and the size limit."""

from __future__ import annotations

import errno
import io
import os
import platform
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.builds.store import shared_files
from fusesoc_firm.builds.store import store as store_module
from fusesoc_firm.builds.store.layout import read_entry
from fusesoc_firm.builds.store.limited import parse_size
from fusesoc_firm.builds.store.store import (
    Entry,
    Files,
    Key,
    Store,
    default_store,
    request_digest,
)
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.digests import default_root

REQUEST = "ab" + "0" * 62
FILES = {"rtl/a.vhd": b"entity a\n", "top.core": b"CAPI=2:\n"}
LARGE = 2**30


def obtain(root: Path, files: Files = FILES, request: str = REQUEST, limit: int = LARGE) -> Entry:
    return Store(root, limit).obtain(Key(request, {"core": request}), lambda: files)


def find(root: Path, request: str = REQUEST) -> Files | None:
    """The files of a hit; nothing is written to the store."""
    return Store(root, LARGE)._find(Key(request))


def stored(root: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}


def test_what_was_made_is_found(tmp_path: Path) -> None:
    made = obtain(tmp_path / "new")
    found = obtain(tmp_path / "new", {"other": b"built though the store has it"})
    assert made == Entry(FILES, False)
    assert found == Entry(FILES, True)
    assert list(found.files) == list(FILES)
    assert sorted(path.suffix for path in stored(tmp_path)) == [".entry"]


def test_damage_at_any_place_is_found(tmp_path: Path) -> None:
    obtain(tmp_path)
    (path,) = stored(tmp_path)
    whole = path.read_bytes()
    damaged = [whole[:length] for length in range(len(whole))]
    damaged += [
        whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :]
        for place in range(len(whole))
        for bit in range(8)
    ]
    for data in [*damaged, whole + b"\0", b"[1]", b"{}", b"\xff"]:
        path.write_bytes(data)
        assert find(tmp_path) is None
    path.write_bytes(damaged[10])
    assert obtain(tmp_path) == Entry(FILES, False)
    assert find(tmp_path) == FILES


@pytest.mark.parametrize("error", [ValueError("bad specification"), KeyboardInterrupt()])
def test_a_build_that_ends_early_keeps_nothing(tmp_path: Path, error: BaseException) -> None:
    def fail() -> Files:
        raise error

    with pytest.raises(type(error)):
        Store(tmp_path, LARGE).obtain(Key(REQUEST), fail)
    assert stored(tmp_path) == {}
    assert obtain(tmp_path) == Entry(FILES, False)


def test_what_was_edited_while_it_was_read_is_not_kept(tmp_path: Path) -> None:
    assert Store(tmp_path, LARGE).obtain(Key(REQUEST), lambda: FILES, lambda: False) == Entry(FILES, False, False)
    assert stored(tmp_path) == {}


def test_a_store_that_cannot_be_written_is_done_without(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # A file blocks the way, since the rights of a folder do not stop root.
    (tmp_path / "file").write_text("")
    root = tmp_path / "file" / "store"
    assert obtain(root) == Entry(FILES, False)
    assert capfd.readouterr().err == f"warning: results cannot be cached in the store {root}: Not a directory\n"


def test_a_store_that_can_only_be_read_gives_what_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    obtain(tmp_path)
    before = stored(tmp_path)
    for function in ("mark_used", "open_lock", "remove", "write_whole"):
        monkeypatch.setattr(shared_files, function, refuse)
    assert obtain(tmp_path) == Entry(FILES, True)
    assert capfd.readouterr().err == ""
    assert obtain(tmp_path, request="cd" + "0" * 62) == Entry(FILES, False)
    assert (
        capfd.readouterr().err == f"warning: results cannot be cached in the store {tmp_path}: Read-only file system\n"
    )
    assert stored(tmp_path) == before


# The system stops the write in the middle of a file, as on a full disk.
FULL = """
import resource, sys
from pathlib import Path
from fusesoc_firm.builds.store.store import Key, Store
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
files = {"a.vhd": bytes(20_000)}
store = Store(Path(sys.argv[1]), 2**30)
assert store.obtain(Key(sys.argv[2]), lambda: files).files == files
"""


def test_a_full_disk_is_done_without(tmp_path: Path) -> None:
    command = [sys.executable, "-c", FULL, str(tmp_path), REQUEST]
    done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, check=True)
    assert done.stderr == f"warning: results cannot be cached in the store {tmp_path}: File too large\n"
    assert stored(tmp_path) == {}


OBTAIN = """
import sys
from pathlib import Path
from fusesoc_firm.builds.store.store import Key, Store
root, log, request = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
FILES = {f"{n}.vhd": bytes([n]) * 100_000 for n in range(20)}
def build():
    with log.open("a") as file:
        file.write("built\\n")
    return FILES
print("ready", flush=True)
sys.stdin.readline()
assert Store(root, 2**30).obtain(Key(request), build).files == FILES
"""
# Without locks, as on some network file systems.
OBTAIN_WITHOUT_LOCKS = (
    """
import fcntl
def flock(*_):
    raise OSError(37, "No locks available")
fcntl.flock = flock
"""
    + OBTAIN
)

ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(store_module.__file__).parents[1])}


def start(script: str, *arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", script, *map(str, arguments)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT)


def wait_for(process: subprocess.Popen[str], line: str) -> None:
    assert process.stdout is not None
    assert process.stdout.readline() == f"{line}\n"


@pytest.mark.parametrize("script", [OBTAIN, OBTAIN_WITHOUT_LOCKS], ids=["locks", "no_locks"])
def test_processes_at_once(tmp_path: Path, script: str) -> None:
    processes = [start(script, tmp_path / "store", tmp_path / "log", REQUEST) for _ in range(4)]
    for process in processes:
        wait_for(process, "ready")
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in processes:
        process.communicate()
    assert [process.returncode for process in processes] == [0] * 4
    built = (tmp_path / "log").read_text().count("built\n")
    assert built == 1 if script == OBTAIN else 1 <= built <= 4
    assert find(tmp_path / "store") == {f"{n}.vhd": bytes([n]) * 100_000 for n in range(20)}
    assert sorted(path.suffix for path in stored(tmp_path / "store")) == [".entry"]


HANG_IN_BUILD = """
import sys
from pathlib import Path
from fusesoc_firm.builds.store.store import Key, Store
def build():
    print("in the middle", flush=True)
    sys.stdin.read()
Store(Path(sys.argv[1]), 2**30).obtain(Key(sys.argv[2]), build)
"""
HANG_BEFORE_RENAME = """
import os, sys
from pathlib import Path
from fusesoc_firm.builds.store.store import Key, Store
def replace(*_, **__):
    print("in the middle", flush=True)
    sys.stdin.read()
os.replace = replace
Store(Path(sys.argv[1]), 2**30).obtain(Key(sys.argv[2]), lambda: {"a.vhd": b"whole"})
"""


@pytest.mark.parametrize("script", [HANG_IN_BUILD, HANG_BEFORE_RENAME], ids=["build", "write"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_process_that_ends_in_the_middle_leaves_no_entry_and_no_lock(
    tmp_path: Path, script: str, number: signal.Signals
) -> None:
    process = start(script, tmp_path, REQUEST)
    wait_for(process, "in the middle")
    process.send_signal(number)
    process.communicate()
    assert not any(path.suffix == ".entry" for path in stored(tmp_path))
    assert obtain(tmp_path) == Entry(FILES, False)
    assert find(tmp_path) == FILES


def test_one_that_is_stopped_is_not_waited_for_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    process = start(HANG_IN_BUILD, tmp_path, REQUEST)
    wait_for(process, "in the middle")
    process.send_signal(signal.SIGSTOP)
    monkeypatch.setattr(store_module, "_LONGEST_WAIT_SECONDS", 0.2)
    begin = time.monotonic()
    # The files that the other process requested.
    made = Store(tmp_path, LARGE).obtain(Key(REQUEST), lambda: FILES)
    assert time.monotonic() - begin >= 0.2
    assert made == Entry(FILES, False)
    assert find(tmp_path) == FILES
    # Only the other process may remove its lock.
    assert len([*tmp_path.rglob("*.lock")]) == 1
    process.kill()
    process.communicate()


class Gone(io.FileIO):
    """A file that was removed on another machine after it was opened and before it was read."""

    def read(self, _: int | None = None) -> bytes:
        raise OSError(errno.ESTALE, "Stale file handle")


def test_what_is_gone_while_it_is_read_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    obtain(tmp_path)
    real = open

    def open_stale(file: int | str, mode: str, **how: Any) -> object:
        return Gone(file, **how) if isinstance(file, int) and mode == "rb" else real(file, mode, **how)

    with monkeypatch.context() as patch:
        patch.setattr("builtins.open", open_stale)
        assert obtain(tmp_path) == Entry(FILES, False)
    assert find(tmp_path) == FILES


FILL = """
import itertools, sys
from pathlib import Path
from fusesoc_firm.builds.store.store import Key, Store
store = Store(Path(sys.argv[1]), int(sys.argv[2]))
print("running", flush=True)
for number in itertools.count():
    digit = number % 7
    files = {"a.vhd": bytes([digit]) * 50_000, "b.vhd": bytes([digit]) * 70_000}
    found = store.obtain(Key(f"{digit:064x}"), lambda: files).files
    if found != files:
        print("wrong", flush=True)
"""


def test_kills_at_any_moment(tmp_path: Path) -> None:
    """The store is so small that entries come and go all the time."""
    seed = random.randrange(10**6)
    print(f"seed {seed}")
    moments = random.Random(seed)
    for _ in range(8):
        process = start(FILL, tmp_path, 400_000)
        wait_for(process, "running")
        time.sleep(moments.uniform(0, 0.05))
        process.kill()
        assert process.communicate()[0] == ""
        for entry in Store(tmp_path, LARGE).entries():
            assert read_entry(str(tmp_path), entry.name) is not None


def test_readers_while_entries_are_removed(tmp_path: Path) -> None:
    processes = [start(FILL, tmp_path, 400_000) for _ in range(3)]
    for process in processes:
        wait_for(process, "running")
    time.sleep(0.5)
    for process in processes:
        process.kill()
    assert [process.communicate()[0] for process in processes] == [""] * 3


def age(root: Path, request: str, seconds: float) -> None:
    """Set the last use of a request's entry to long ago."""
    entry = next(
        root / file.name
        for file in Store(root, LARGE).entries()
        if (found := read_entry(str(root), file.name)) and found[0]["core"] == request
    )
    os.utime(entry, (time.time() - seconds,) * 2)


def test_what_was_not_used_for_longest_goes_first(tmp_path: Path) -> None:
    a, b, c, d = (f"{digit}" * 64 for digit in "abcd")
    for request in (a, b, c):
        obtain(tmp_path, {"x": bytes(10_000)}, request)
    for request, seconds in ((a, 300), (b, 200), (c, 100)):
        age(tmp_path, request, seconds)
    # A use makes the oldest entry the newest.
    assert find(tmp_path, a) is not None
    obtain(tmp_path, {"x": bytes(10_000)}, d, limit=35_000)
    assert [request for request in (a, b, c, d) if find(tmp_path, request) is not None] == [a, d]
    total = sum(len(data) for data in stored(tmp_path).values())
    assert total <= 0.8 * 35_000


def test_within_the_limit_nothing_goes(tmp_path: Path) -> None:
    requests = [f"{digit}" * 64 for digit in "abcd"]
    for request in requests:
        obtain(tmp_path, {"x": bytes(10_000)}, request, limit=45_000)
    assert all(find(tmp_path, request) is not None for request in requests)


def test_a_process_that_writes_much_looks_through_the_store_at_times(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[int] = []
    monkeypatch.setattr(Store, "shrink_if_needed", lambda store: looks.append(store.limit))
    for number in range(20):
        obtain(tmp_path, {"x": bytes(10_000)}, f"request {number}", limit=64 * 50_000)
    # After the first entry, and after 5 further ones each.
    assert len(looks) in (4, 5)


def test_a_limit_of_nothing_keeps_nothing(tmp_path: Path) -> None:
    assert obtain(tmp_path, limit=0) == Entry(FILES, False)
    assert stored(tmp_path) == {}


def test_what_a_killed_process_left_is_removed_after_an_hour(tmp_path: Path) -> None:
    obtain(tmp_path)
    folder = next(tmp_path.rglob("*.entry")).parent
    old, new = folder / ".new-old", folder / ".new-new"
    old.write_bytes(b"half")
    new.write_bytes(b"half")
    os.utime(old, (time.time() - 3700,) * 2)
    Store(tmp_path, LARGE).shrink_if_needed()
    assert not old.exists()
    assert new.exists()


def test_clean_removes_all_of_it_and_nothing_else(tmp_path: Path) -> None:
    former = tmp_path / "v1" / "ab" / REQUEST / "files"
    former.mkdir(parents=True)
    (former / "a.vhd").write_bytes(bytes(100))
    (tmp_path / "notes.txt").write_text("the user's")
    obtain(tmp_path)
    size = sum(len(data) for data in stored(tmp_path).values())
    assert Store(tmp_path, LARGE).clean() == size - len("the user's")
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_files_have_the_rights_that_others_of_the_user_have(tmp_path: Path) -> None:
    """In a folder for several people, each can read the files of the others."""
    mask = os.umask(0o022)
    try:
        obtain(tmp_path)
    finally:
        os.umask(mask)
    assert {path.stat().st_mode & 0o777 for path in stored(tmp_path)} == {0o644}


def test_the_request_covers_inputs_names_and_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    base = request_digest({"width": 8}, {"a.yaml": b"1"}, "aa")
    assert base == request_digest({"width": 8}, {"a.yaml": b"1"}, "aa")
    assert len(base) == 64
    others = [
        request_digest({"width": 16}, {"a.yaml": b"1"}, "aa"),
        request_digest({"width": 8}, {"a.yaml": b"2"}, "aa"),
        request_digest({"width": 8}, {"b.yaml": b"1"}, "aa"),
        request_digest({"width": 8}, {"a.yaml": None}, "aa"),
        request_digest({"width": 8}, {}, "aa"),
        request_digest({"width": 8}, {"a.yaml": b"1"}, "bb"),
    ]
    with monkeypatch.context() as patch:
        patch.setattr(store_module, "version", lambda name: f"{name} 99")
        others.append(request_digest({"width": 8}, {"a.yaml": b"1"}, "aa"))
    with monkeypatch.context() as patch:
        patch.setattr(platform, "machine", lambda: "abacus")
        others.append(request_digest({"width": 8}, {"a.yaml": b"1"}, "aa"))
    assert len({base, *others}) == 9


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("0", 0),
        ("77", 77),
        ("3k", 3072),
        (" 2M", 2**21),
        ("1G", 2**30),
        ("1T", 2**40),
        ("G", None),
        ("-1", None),
        ("1.5G", None),
    ],
)
def test_sizes(text: str, size: int | None) -> None:
    assert parse_size(text) == size


def test_a_limit_that_is_no_size_is_a_fault() -> None:
    with pytest.raises(InputError, match="FUSESOC_FIRM_CACHE_SIZE is 'lots', which is not a size"):
        default_store({"FUSESOC_FIRM_CACHE_SIZE": "lots"})
    assert default_store({"FUSESOC_FIRM_CACHE_SIZE": "5M"}).limit == 5 * 2**20
    assert default_store({}).limit == 2**30


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({"FUSESOC_FIRM_CACHE": "/a/b", "XDG_CACHE_HOME": "/x"}, Path("/a/b")),
        ({"XDG_CACHE_HOME": "/x"}, Path("/x/fusesoc_firm")),
        ({"FUSESOC_FIRM_CACHE": "", "XDG_CACHE_HOME": ""}, Path.home() / ".cache" / "fusesoc_firm"),
    ],
)
def test_where_the_store_lies(environment: dict[str, str], expected: Path) -> None:
    assert default_root(environment) == str(expected)
