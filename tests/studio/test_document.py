"""A specification that is open in the page while an editor saves it, too."""

from __future__ import annotations

import os
import random
import stat
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from fusesoc_firm.studio.document import Document
from fusesoc_firm.text import files
from fusesoc_firm.text.yaml_edit import EditError
from tests.seeds import seeded

SEED = seeded(20261129)
RACES = 500


def save_in_place(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def save_by_renaming(path: Path, text: str) -> None:
    new = path.with_suffix(".editor")
    new.write_text(text, encoding="utf-8")
    new.replace(path)


def save_with_the_old_time(path: Path, text: str) -> None:
    """As when two saves are within one tick of the clock of the file system."""
    before = path.stat()
    path.write_text(text, encoding="utf-8")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


SAVES = [save_in_place, save_by_renaming, save_with_the_old_time]


@pytest.mark.parametrize("save", SAVES)
def test_a_save_of_the_same_size_is_noticed(tmp_path: Path, save: Callable[[Path, str], None]) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("a: 1\n", encoding="utf-8")
    document = Document(path)
    version = document.version
    save(path, "a: 2\n")
    with pytest.raises(EditError, match="the file has changed meanwhile"):
        document.write(version, "a: 3\n")
    assert (document.text, path.read_text(encoding="utf-8")) == ("a: 2\n", "a: 2\n")


@pytest.mark.parametrize("save", SAVES[:2])
def test_a_save_between_check_and_write_is_kept(
    tmp_path: Path, save: Callable[[Path, str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("a: 1\n", encoding="utf-8")
    document = Document(path)
    exchange, saves = files._exchange, ["a: 2\n"]

    def exchange_late(one: str, other: str | os.PathLike[str]) -> None:
        if saves:
            save(path, saves.pop())
        exchange(one, other)

    monkeypatch.setattr(files, "_exchange", exchange_late)
    with pytest.raises(EditError, match="the file has changed meanwhile"):
        document.write(document.version, "a: 3\n")
    assert path.read_text(encoding="utf-8") == "a: 2\n"
    assert document.follow() and document.text == "a: 2\n"
    assert [item.name for item in tmp_path.iterdir()] == ["robot.yaml"]


def test_no_save_of_an_editor_is_lost(tmp_path: Path) -> None:
    """Whichever comes first, the editor's text is in the file at the end: the page's edit is of an older text."""
    chance = random.Random(SEED)
    print(f"seed {SEED}")
    path = tmp_path / "robot.yaml"
    path.write_text("a: 0\n", encoding="utf-8")
    document = Document(path)
    outcomes = {"written": 0, "refused": 0}

    def edit(start: threading.Barrier, turns: int, save: Callable[[Path, str], None], text: str) -> None:
        start.wait()
        for _ in range(turns):
            pass
        save(path, text)

    for number in range(RACES):
        document.follow()
        save, theirs, start = chance.choice(SAVES[:2]), f"a: {number} # the editor\n", threading.Barrier(2)
        spins = chance.randrange(3000), chance.randrange(3000)

        editor = threading.Thread(target=edit, args=[start, spins[0], save, theirs])
        editor.start()
        version = document.version
        start.wait()
        for _ in range(spins[1]):
            pass
        try:
            document.write(version, f"a: {number} # the page\n")
            outcomes["written"] += 1
        except EditError:
            outcomes["refused"] += 1
        editor.join()
        document.follow()
        assert path.read_text(encoding="utf-8") == theirs, number
    print(outcomes)
    assert all(outcomes.values()), "the races do not meet"


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o755])
def test_the_file_keeps_its_mode(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("a: 1\n", encoding="utf-8")
    path.chmod(mode)
    document = Document(path)
    document.write(document.version, "a: 2\n")
    assert stat.S_IMODE(path.stat().st_mode) == mode
    assert path.read_text(encoding="utf-8") == "a: 2\n"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_the_file_keeps_its_owner(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("a: 1\n", encoding="utf-8")
    os.chown(path, 65534, 65534)
    document = Document(path)
    document.write(document.version, "a: 2\n")
    assert (path.stat().st_uid, path.stat().st_gid) == (65534, 65534)
