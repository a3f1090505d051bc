"""A shared store: nothing that other users put there harms its readers, or anything outside it."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import socket
import stat
import sys
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.builds.store.layout import ENTRY, LAYOUT, LOCK, read_entry, read_note
from fusesoc_firm.builds.store.store import Key, Store

REQUEST = "ab" + "0" * 62
FILES = {"rtl/a.vhd": b"entity a\n", "top.core": b"CAPI=2:\n"}
VICTIM = b"of somebody who knows nothing of it"
DEEP = b"[" * 100_000


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "store"


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A folder outside the store, with files that the store might take for its own."""
    folder = tmp_path / "victim"
    folder.mkdir()
    for name in ("file", f"old{ENTRY}", ".new-old"):
        (folder / name).write_bytes(VICTIM)
        os.utime(folder / name, (0, 0))
    return folder


def is_unharmed(victim: Path) -> bool:
    return {path.name: path.read_bytes() for path in victim.iterdir()} == dict.fromkeys(
        ("file", f"old{ENTRY}", ".new-old"), VICTIM
    )


def obtain(root: Path, limit: int = 2**30) -> bool:
    """Request the files; return whether they were in the store."""
    entry = Store(root, limit).obtain(Key(REQUEST), lambda: FILES)
    assert entry.files == FILES
    return entry.is_from_store


def kept(root: Path, suffix: str) -> Path:
    (path,) = root.rglob(f"*{suffix}")
    return path


def signed(data: bytes) -> bytes:
    """Data in the store's format."""
    return hashlib.sha256(data).hexdigest().encode() + b"\n" + data


def _socket(path: Path, _: Path) -> None:
    # Socket names must be short.
    with socket.socket(socket.AF_UNIX) as made:
        before = Path.cwd()
        os.chdir(path.parent)
        made.bind("s")
        Path("s").rename(path.name)
        os.chdir(before)


def _huge(path: Path, _: Path) -> None:
    path.touch()
    os.truncate(path, 2**40)


# Objects that may be found in place of a stored file.
OBSTACLES: dict[str, Callable[[Path, Path], object]] = {
    "link": lambda path, victim: path.symlink_to(victim / "file"),
    "link to nothing": lambda path, victim: path.symlink_to(victim / "new"),
    "link to a device": lambda path, _: path.symlink_to("/dev/zero"),
    "hard link": lambda path, victim: path.hardlink_to(victim / "file"),
    "pipe": lambda path, _: os.mkfifo(path),
    "socket": _socket,
    "folder": lambda path, _: path.mkdir(),
    "huge": _huge,
}


@pytest.mark.parametrize("suffix", [ENTRY, LOCK])
@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_what_is_no_file_of_the_store(root: Path, victim: Path, obstacle: str, suffix: str) -> None:
    """It is not waited for, followed or emptied; it is replaced, or removed by `firm cache verify`."""
    obtain(root)
    path = kept(root, ENTRY).with_suffix(suffix)
    path.unlink(missing_ok=True)
    OBSTACLES[obstacle](path, victim)
    assert obtain(root) == (suffix == LOCK)
    assert obtain(root) == (suffix == LOCK or obstacle != "folder")
    if suffix == LOCK:
        kept(root, ENTRY).unlink()
        assert not obtain(root)
    is_file = stat.S_ISREG(path.lstat().st_mode) if path.exists() or path.is_symlink() else True
    assert Store(root, 2**30).remove_damaged() == ([] if is_file else [path])
    obtain(root)
    assert obtain(root)
    assert is_unharmed(victim)


@pytest.mark.parametrize("name", [LAYOUT, f"{LAYOUT}/{REQUEST[:2]}"])
def test_a_link_in_place_of_a_folder_is_not_followed(root: Path, victim: Path, name: str) -> None:
    (root / name).parent.mkdir(parents=True)
    (root / name).symlink_to(victim)
    assert not obtain(root)
    assert not obtain(root, limit=0)
    store = Store(root, 0)
    store.shrink(0)
    assert store.remove_damaged() == [root / name]
    assert not obtain(root)
    assert obtain(root)
    assert is_unharmed(victim)


@pytest.mark.parametrize("name", ["v1", "v1/ab", LAYOUT, f"{LAYOUT}/ab"])
def test_clean_removes_a_link_and_not_what_it_leads_to(root: Path, victim: Path, name: str) -> None:
    (root / name).parent.mkdir(parents=True)
    (root / name).symlink_to(victim)
    Store(root, 0).clean()
    assert [*root.iterdir()] == []
    assert is_unharmed(victim)


def test_clean_of_folders_without_end(root: Path) -> None:
    folder = root / "v1"
    folder.mkdir(parents=True)
    handle = os.open(folder, os.O_RDONLY)
    for _ in range(3000):
        os.mkdir("a", dir_fd=handle)
        inner = os.open("a", os.O_RDONLY, dir_fd=handle)
        os.close(handle)
        handle = inner
    os.close(handle)
    try:
        with nullcontext() if sys.version_info >= (3, 13) else pytest.raises(OSError, match=r"[Tt]oo many"):
            Store(root, 0).clean()
        assert folder.exists() == (sys.version_info < (3, 13))
    finally:
        # The test's files are removed by an independent tool.
        assert shutil.which("rm") is None or os.spawnlp(os.P_WAIT, "rm", "rm", "-rf", str(root)) == 0


ABOUT = {"core": "a", "generator": "firm"}


def header(*files: object, about: object = ABOUT) -> bytes:
    return json.dumps({"about": about, "files": files}).encode()


# Each is followed by a content of eight bytes.
FORGED: dict[str, bytes] = {
    "outside": header(["../../x", 8]),
    "outside later": header(["a/../../x", 8]),
    "absolute": header(["/tmp/x", 8]),
    "no name": header(["", 8]),
    "the folder": header([".", 8]),
    "empty part": header(["a//b", 8]),
    "ends with a slash": header(["a/", 8]),
    "NUL": header(["a\0b", 8]),
    "surrogate": header(["\ud800", 8]),
    "long": header(["a" * 300, 8]),
    "deep path": header(["a/" * 4000 + "a", 8]),
    "a file and a folder": header(["a", 4], ["a/b", 4]),
    "twice": header(["a", 4], ["a", 4]),
    "too short": header(["a", 7]),
    "too long": header(["a", 9]),
    "negative": header(["a", 16], ["b", -8]),
    "true": header(["a", True], ["b", 7]),
    "a text": header(["a", "8"]),
    "a fraction": header(["a", 8.0]),
    "digits without end": b'{"about": {}, "files": [["a", ' + b"8" * 10_000 + b"]]}",
    "no pair": header(["a", 8, 8]),
    "a number": header(8),
    "no list": b'{"about": {}, "files": 8}',
    "no files": b'{"about": {}}',
    "no mapping": b"[8]",
    "nothing": b"",
    "no JSON": b"{",
    "no text": b"\xff",
    "deep": DEEP,
    "about a list": header(["a", 8], about=[]),
    "about a number": header(["a", 8], about={"core": 8}),
    "about that moves the cursor": header(["a", 8], about={"core": "\x1b[2J"}),
}


@pytest.mark.parametrize("forged", FORGED.values(), ids=FORGED)
def test_an_entry_of_another_form_is_damaged(root: Path, tmp_path: Path, forged: bytes) -> None:
    obtain(root)
    path = kept(root, ENTRY)
    path.write_bytes(signed(forged + b"\n" + bytes(8)))
    assert read_entry(str(root), str(path.relative_to(root))) is None
    assert not obtain(root)
    assert obtain(root)
    path.write_bytes(signed(forged + b"\n" + bytes(8)))
    assert Store(root, 2**30).remove_damaged() == [path]
    assert [*tmp_path.iterdir()] == [root]


NOTE: Mapping[str, object] = {
    "key": REQUEST,
    "facts": [["code", "", None]],
    "name": "a",
    "core": "a:b:c:1",
    "marks": "",
}


@pytest.mark.parametrize(
    "change",
    [
        {"key": "../../../../etc/passwd"},
        {"key": REQUEST[:-1] + "/"},
        {"key": 8},
        {"facts": 8},
        {"facts": [8]},
        {"facts": [["file", "a"]]},
        {"facts": [["file", 8, None]]},
        {"name": "\x1b[2J"},
        {"core": 8},
        {"marks": None},
    ],
)
def test_a_note_of_another_form_is_damaged(root: Path, change: Mapping[str, object]) -> None:
    root.mkdir()
    name = "note.call"
    (root / name).write_bytes(signed(json.dumps(NOTE).encode()))
    assert read_note(str(root), name) == NOTE
    (root / name).write_bytes(signed(json.dumps({**NOTE, **change}).encode()))
    assert read_note(str(root), name) is None


def test_a_store_that_is_emptied_while_it_is_written_is_written_again(
    root: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    obtain(root)
    Store(root, 0).clean()
    real, moments = os.replace, iter([True, True])

    def replace(*paths: Any, **folders: Any) -> None:
        if next(moments, False):
            Store(root, 0).clean()
        real(*paths, **folders)

    monkeypatch.setattr(os, "replace", replace)
    assert not obtain(root)
    assert capfd.readouterr().err == ""
    assert kept(root, ENTRY).exists()
    assert next(moments, None) is None


def test_what_is_made_in_a_folder_for_a_group_is_for_it(root: Path) -> None:
    """As in a shared repository of Git: group and rights are those of the folder, whatever the umask."""
    group = os.getgid() + 54321 if os.geteuid() == 0 else os.getgroups()[-1]
    root.mkdir()
    os.chown(root, -1, group)
    root.chmod(0o2770)
    mask = os.umask(0o077)
    try:
        obtain(root)
    finally:
        os.umask(mask)
    made = [*root.rglob("*")]
    assert len(made) >= 3
    for path in made:
        assert path.stat().st_gid == group
        assert stat.S_IMODE(path.stat().st_mode) == (0o2770 if path.is_dir() else 0o660)


def test_a_folder_that_only_its_owner_may_write_to_stays_so(root: Path) -> None:
    root.mkdir(mode=0o755)
    mask = os.umask(0o022)
    try:
        obtain(root)
    finally:
        os.umask(mask)
    assert {stat.S_IMODE(path.stat().st_mode) for path in root.rglob("*")} == {0o755, 0o644}
