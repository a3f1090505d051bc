"""`firm cache`: the content of the store is shown, removed and checked."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.store.store import Key, default_store

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store with three entries of 10,000 bytes."""
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path))
    for digit in "abc":
        key = Key(digit * 64, {"generator": "firm", "core": f"a:b:{digit}:1"})
        default_store().obtain(key, lambda: {"x": bytes(10_000)})
    return tmp_path


def entries(root: Path) -> list[Path]:
    return sorted(root.rglob("*.entry"))


def test_show(root: Path, capsys: Captured) -> None:
    assert main(["cache", "show"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == [f"folder   {root}", "entries  3", "size     29.7 KiB of 1.0 GiB"]
    entries(root)[0].write_bytes(b"")
    assert main(["cache", "show", "--entries"]) == 0
    shown = capsys.readouterr().out.splitlines()[3:]
    assert all(re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d  ", line) for line in shown)
    assert sum("   9.9 KiB  firm  a:b:" in line for line in shown) == 2
    assert sum(line.endswith("   0 bytes  damaged") for line in shown) == 1
    assert len(shown) == 3


def test_show_of_no_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "none"))
    assert main(["cache", "show"]) == 0
    assert "entries  0\nsize     0 bytes of 1.0 GiB\n" in capsys.readouterr().out
    assert main(["cache", "clean"]) == 0
    assert main(["cache", "verify"]) == 0
    assert not (tmp_path / "none").exists()


def test_clean(root: Path, capsys: Captured) -> None:
    assert main(["cache", "clean", "--to", "25k"]) == 0
    assert len(entries(root)) == 2
    assert capsys.readouterr().out == f"9.9 KiB removed from {root}\n"
    assert main(["cache", "clean"]) == 0
    assert [*root.iterdir()] == []
    assert capsys.readouterr().out == f"19.8 KiB removed from {root}\n"


def test_clean_to_a_wrong_size() -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["cache", "clean", "--to", "some"])


def test_verify(root: Path, capsys: Captured) -> None:
    assert main(["cache", "verify"]) == 0
    assert capsys.readouterr().out == f"{root}: all entries are intact\n"
    damaged = entries(root)[1]
    damaged.write_bytes(damaged.read_bytes()[:-1] + b"x")
    assert main(["cache", "verify"]) == 1
    assert capsys.readouterr().err == f"error: 1 entry was damaged and removed:\n{damaged}\n"
    assert len(entries(root)) == 2
    assert main(["cache", "verify"]) == 0
