"""The store: found or made, whole or not there, with any number of processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from fusesoc_firm import store as store_module
from fusesoc_firm.store import Store, default_root, folder_digest, store_key

KEY = "ab" + "0" * 62
FILES = {"rtl/a.vhd": b"entity a", "top.core": b"CAPI=2:\n"}


def build_never() -> dict[str, bytes]:
    raise AssertionError("built though the store has it")


def entry_folder(root: Path) -> Path:
    return root / "v1" / KEY[:2] / KEY


def test_what_was_made_is_found(tmp_path: Path) -> None:
    made = Store(tmp_path / "new").obtain(KEY, lambda: FILES)
    found = Store(tmp_path / "new").obtain(KEY, build_never)
    assert (made.files, made.is_from_store) == (FILES, False)
    assert (found.files, found.is_from_store) == (FILES, True)
    assert list(found.files) == list(FILES)


def truncate(folder: Path) -> None:
    (folder / "files" / "rtl" / "a.vhd").write_bytes(b"entity")


def alter(folder: Path) -> None:
    (folder / "files" / "top.core").write_bytes(b"CAPI=2;\n")


def remove_file(folder: Path) -> None:
    (folder / "files" / "top.core").unlink()


def remove_manifest(folder: Path) -> None:
    (folder / "manifest.json").unlink()


def spoil_manifest(folder: Path) -> None:
    (folder / "manifest.json").write_text('{"files": ["top.core"]}')


@pytest.mark.parametrize("damage", [truncate, alter, remove_file, remove_manifest, spoil_manifest])
def test_a_damaged_entry_is_made_again(tmp_path: Path, damage: Callable[[Path], None]) -> None:
    store = Store(tmp_path)
    store.obtain(KEY, lambda: FILES)
    damage(entry_folder(tmp_path))
    again = store.obtain(KEY, lambda: FILES)
    assert (again.files, again.is_from_store) == (FILES, False)
    assert store.obtain(KEY, build_never).files == FILES


def test_a_failing_build_keeps_nothing(tmp_path: Path) -> None:
    def fail() -> dict[str, bytes]:
        raise ValueError("bad specification")

    with pytest.raises(ValueError, match="bad specification"):
        Store(tmp_path).obtain(KEY, fail)
    assert not entry_folder(tmp_path).exists()
    assert not Store(tmp_path).obtain(KEY, lambda: FILES).is_from_store


def test_a_store_that_cannot_be_written_is_done_without(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # A file in the way, since the rights of a folder do not stop root.
    (tmp_path / "file").write_text("")
    root = tmp_path / "file" / "store"
    entry = Store(root).obtain(KEY, lambda: FILES)
    assert (entry.files, entry.is_from_store) == (FILES, False)
    assert capfd.readouterr().err == f"warning: nothing is kept in the store {root}: Not a directory\n"


def test_a_full_disk_is_done_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail(folder: Path, files: object) -> None:
        (folder / "partial").write_text("x")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store_module, "_write", fail)
    assert Store(tmp_path).obtain(KEY, lambda: FILES).files == FILES
    assert capfd.readouterr().err == f"warning: nothing is kept in the store {tmp_path}: No space left on device\n"
    assert [path.name for path in entry_folder(tmp_path).parent.iterdir()] == [f"{KEY}.lock"]


OBTAIN = """
import sys
from pathlib import Path
from fusesoc_firm.store import Store
root, log, key = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
def build():
    with log.open("a") as file:
        file.write("built\\n")
    return {f"{n}.vhd": bytes([n]) * 100_000 for n in range(20)}
print("ready", flush=True)
sys.stdin.readline()
files = Store(root).obtain(key, build).files
assert files == {f"{n}.vhd": bytes([n]) * 100_000 for n in range(20)}
"""


def start(script: str, *arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", script, *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(Path(store_module.__file__).parents[1])}
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)


def test_processes_at_once_build_once(tmp_path: Path) -> None:
    processes = [start(OBTAIN, tmp_path / "store", tmp_path / "log", KEY) for _ in range(6)]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in processes:
        process.communicate()
    assert [process.returncode for process in processes] == [0] * 6
    assert (tmp_path / "log").read_text() == "built\n"


HANG_IN_BUILD = """
import sys, time
from pathlib import Path
from fusesoc_firm.store import Store
def build():
    print("in the middle", flush=True)
    time.sleep(600)
Store(Path(sys.argv[1])).obtain(sys.argv[2], build)
"""
HANG_IN_WRITE = """
import sys, time
from pathlib import Path
from fusesoc_firm import store
def write(folder, files):
    (folder / "files").mkdir()
    (folder / "files" / "a.vhd").write_bytes(b"half")
    print("in the middle", flush=True)
    time.sleep(600)
store._write = write
store.Store(Path(sys.argv[1])).obtain(sys.argv[2], lambda: {"a.vhd": b"half and half"})
"""


@pytest.mark.parametrize("script", [HANG_IN_BUILD, HANG_IN_WRITE])
def test_a_killed_process_leaves_no_entry_and_no_lock(tmp_path: Path, script: str) -> None:
    process = start(script, tmp_path, KEY)
    assert process.stdout is not None
    assert process.stdout.readline() == "in the middle\n"
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert not entry_folder(tmp_path).exists()
    assert not Store(tmp_path).obtain(KEY, lambda: FILES).is_from_store
    assert Store(tmp_path).obtain(KEY, build_never).files == FILES


def test_the_key_covers_request_inputs_code_and_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    base = store_key({"width": 8}, {"a.yaml": b"1"})
    assert base == store_key({"width": 8}, {"a.yaml": b"1"})
    assert len(base) == 64
    others = [
        store_key({"width": 16}, {"a.yaml": b"1"}),
        store_key({"width": 8}, {"a.yaml": b"2"}),
        store_key({"width": 8}, {"b.yaml": b"1"}),
        store_key({"width": 8}, {"a.yaml": None}),
        store_key({"width": 8}, {}),
    ]
    with monkeypatch.context() as patch:
        patch.setattr(store_module, "package_digest", lambda: "other code")
        others.append(store_key({"width": 8}, {"a.yaml": b"1"}))
    with monkeypatch.context() as patch:
        patch.setattr(store_module, "version", lambda name: f"{name} 99")
        others.append(store_key({"width": 8}, {"a.yaml": b"1"}))
    assert len({base, *others}) == 8


def test_the_digest_covers_modules_and_templates_but_not_the_library(tmp_path: Path) -> None:
    def put(name: str, text: str) -> str:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return folder_digest(tmp_path)

    digests = [
        put("render.py", "a"),
        put("render.py", "b"),
        put("message/parser.py", "a"),
        put("templates/vhdl/a.mustache", "a"),
        put("templates/vhdl/a.mustache", "b"),
        put("templates/partials/p.mustache", "a"),
    ]
    assert len(set(digests)) == len(digests)
    assert put("library/generators/x.py", "a") == digests[-1]
    assert put("notes.txt", "a") == digests[-1]


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({"FUSESOC_FIRM_CACHE": "/a/b", "XDG_CACHE_HOME": "/x"}, Path("/a/b")),
        ({"XDG_CACHE_HOME": "/x"}, Path("/x/fusesoc_firm")),
        ({"FUSESOC_FIRM_CACHE": "", "XDG_CACHE_HOME": ""}, Path.home() / ".cache" / "fusesoc_firm"),
    ],
)
def test_where_the_store_lies(environment: dict[str, str], expected: Path) -> None:
    assert default_root(environment) == expected
