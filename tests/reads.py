"""Which files of the project the tests of each file read, as noted in the store of what lasts, for `--since`.

A process notes what it opens and which folders it lists. What another process reads is not seen: of tools, the inputs
are opened here, too (tests/recall.py); any other process may read everything.
"""

from __future__ import annotations

import json
import os
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.core.core_reader import read_core_once
from fusesoc_firm.scheduling.area import measured
from fusesoc_firm.text import render
from fusesoc_firm.text.reserved import declared_names
from tests.hdl.ghdl import core_description
from tests.recall import STORE
from tools.dissertation.published import dissertation

ROOT = Path(__file__).resolve().parents[1]
EVERYTHING = "*"
"""In place of a path: whatever a process reads that is none of the tools."""
_ROOT = f"{ROOT}{os.sep}"
_TOOLS = frozenset("ghdl ghdl-mcode iverilog vvp verilator yosys gcc g++ prlimit git pkg-config ruff mypy".split())
# What reads a file of the project once in a process; each file of tests shall be seen to read it.
_READERS = (declared_names, read_core_once, measured, dissertation, render._parse, core_description)

_noted: defaultdict[str, set[str]] = defaultdict(set)
_current: list[str] = []


def pytest_configure() -> None:
    sys.addaudithook(_hook)


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if not _current:
        return
    if event in ("open", "os.listdir", "os.scandir"):
        if isinstance(arguments[0], str | bytes | os.PathLike):
            _note(os.fsdecode(arguments[0]))
    elif event == "subprocess.Popen":
        words = arguments[1] if isinstance(arguments[1], list | tuple) else [arguments[0]]
        names = [Path(os.fsdecode(word)).name for word in words]
        if names and names[names[0] == "prlimit" and 3] not in _TOOLS:
            _noted[_current[-1]].add(EVERYTHING)


def _note(path: str) -> None:
    path = os.path.realpath(path)
    if path.startswith(_ROOT) and not path.endswith((".py", ".pyc")):
        _noted[_current[-1]].add(path.removeprefix(_ROOT))


def _is_of_project(path: str) -> bool:
    """Whether a noted path is one: others are relative to a folder that is not known here."""
    return path == EVERYTHING or (not path.startswith((".venv/", ".git/", "build/")) and (ROOT / path).exists())


def _begin(path: Path) -> None:
    # Tests of the tests are elsewhere.
    name = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else EVERYTHING
    if _current != [name]:
        for reader in _READERS:
            reader.cache_clear()
        _current[:] = [name]


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    if not isinstance(collector, pytest.Module):
        return (yield)
    _begin(collector.path)
    try:
        return (yield)
    finally:
        _current.clear()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    _begin(item.path)
    return (yield)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    _current.clear()
    found = {name: sorted(filter(_is_of_project, paths)) for name, paths in _noted.items()}
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["reads"] = found
    else:
        _keep(found)


# Absent without pytest-xdist.
@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    for name, paths in (getattr(node, "workeroutput", None) or {}).get("reads", {}).items():
        _noted[name].update(paths)


def known() -> Mapping[str, list[str]]:
    """What the tests of a file have read, by its path; empty if that is not known."""
    try:
        found: dict[str, list[str]] = json.loads(_file().read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found


def _keep(new: Mapping[str, list[str]]) -> None:
    """Add what was read to what is known: a run of some tests reads less than one of all."""
    before = known()
    merged = {name: sorted({*before.get(name, ()), *new.get(name, ())}) for name in sorted({*before, *new})}
    _file().parent.mkdir(parents=True, exist_ok=True)
    _file().write_text(json.dumps(merged), encoding="utf-8")


def _file() -> Path:
    return Path(os.environ[STORE]) / "reads.json"
