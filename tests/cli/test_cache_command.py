"""`firm cache`: the content of the store is shown, removed and checked."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from fusesoc_firm.builds.step.results import FOLDER_NAME, Record, default_results
from fusesoc_firm.builds.store import layout
from fusesoc_firm.builds.store.store import Key, default_store, served_store
from fusesoc_firm.cli import main

Captured = pytest.CaptureFixture[str]
NO_RESULTS = ["results  0", "size     0 bytes of 10.0 GiB"]


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
    assert lines == [f"folder   {root}", "entries  3", "size     29.7 KiB of 1.0 GiB", *NO_RESULTS]
    entries(root)[0].write_bytes(b"")
    assert main(["cache", "show", "--entries"]) == 0
    shown = capsys.readouterr().out.splitlines()[5:]
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


def test_results_have_a_store_and_a_limit_of_their_own(root: Path, capsys: Captured) -> None:
    results, served = default_results(), served_store(0)
    name = results.keep_content(bytes(3_000))
    results.keep_record("d" * 64, Record((), {}, (), name, 1.0, {name: 3_000}))
    layout.write(str(served.root), layout.place("e" * 64, layout.ACTION), bytes(2_000))
    assert main(["cache", "show"]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == [
        "entries  3",
        "size     29.7 KiB of 1.0 GiB",
        "results  1",
        "size     3.2 KiB of 10.0 GiB",
        "served   2.0 KiB",
    ]
    assert main(["cache", "clean", "--to", "0", "--only", "cores"]) == 0
    assert not entries(root)
    assert results.record("d" * 64)
    (content,) = (root / FOLDER_NAME / "cas").glob("*/*")
    content.write_bytes(b"")
    stray = content.with_name("stray")
    os.mkfifo(stray)
    assert main(["cache", "verify"]) == 1
    assert sorted(capsys.readouterr().err.splitlines()[1:]) == sorted(map(str, (content, stray)))
    assert main(["cache", "clean", "--only", "results"]) == 0
    assert results.record("d" * 64) is None
    assert served.size()
    assert main(["cache", "clean"]) == 0
    assert not served.size()
