"""Which tests a change can reach: `pytest --since REV` runs those alone, and `make test SINCE=REV`.

A module reaches those that import it, anywhere in them; other files reach the tests that were seen to read them
(tests/reads.py). Processes that tests start are any part of the package. If this says too little about a changed file,
or if the file is part of how tests run, all tests run.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

import pytest

from tests import reads

ROOT = Path(__file__).resolve().parents[1]
# The variable with the files of tests that run, as JSON; the processes of a run inherit it.
_CHOSEN = "FIRM_TESTS_CHOSEN"
_ROOMS = ("fusesoc_firm", "tests", "tools", "edalize", "generators")
_TEST = re.compile(r"tests/(\w+/)*test_\w+\.py")
_ALWAYS = re.compile(
    r"tests/(\w+/)*conftest\.py|tests/(reached|reads|recall|shared|sharing|time_report)\.py|pyproject\.toml|\.ci/.*"
)
# What a process that a test starts imports.
_STARTED = ("fusesoc_firm.cli", "fusesoc_firm.builds")
# Read by the tests of pages alone.
_PAGES = re.compile(r"docs/.*|[^/]*\.md|.*/README\.md")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--since", metavar="REV", help="run only tests that a change since this commit can reach")


# After conftest.py has said where what tests read is kept.
@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    revision = config.getoption("--since")
    if revision and not hasattr(config, "workerinput"):
        chosen = chosen_tests(changed_since(revision), modules(), reads.known())
        os.environ[_CHOSEN] = json.dumps(None if chosen is None else sorted(chosen))


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    chosen: list[str] | None = json.loads(os.environ.get(_CHOSEN, "null"))
    name = collection_path.relative_to(ROOT).as_posix() if collection_path.is_relative_to(ROOT) else ""
    return True if chosen is not None and _TEST.fullmatch(name) and name not in chosen else None


def changed_since(revision: str) -> set[str]:
    """The paths of files that differ from a commit, and of new ones."""
    return {*_git("diff", "--name-only", "-z", revision), *_git("ls-files", "-z", "--others", "--exclude-standard")}


def _git(*words: str) -> list[str]:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise pytest.UsageError(done.stderr.strip())
    return [name for name in done.stdout.split("\0") if name]


def modules() -> dict[str, str]:
    """The texts of all modules by their paths."""
    names = _git("ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", "*.py")
    return {name: (ROOT / name).read_text(encoding="latin-1") for name in names if (ROOT / name).is_file()}


def chosen_tests(
    changed: Iterable[str], texts: Mapping[str, str], known: Mapping[str, Iterable[str]]
) -> set[str] | None:
    """The files of tests that changes can reach, or None for all.

    `texts` are all modules, and `known` what the tests of a file were seen to read.
    """
    importers = _importers(texts)
    started = {name for name, paths in known.items() if reads.EVERYTHING in paths}
    chosen: set[str] = set()
    for name in changed:
        if _ALWAYS.fullmatch(name):
            return None
        if name.endswith(".py"):
            reached = _reached(name, importers)
            if any(f"{module.replace('.', '/')}/__init__.py" in reached for module in _STARTED):
                reached |= started
            found = set(filter(_TEST.fullmatch, reached)) | _readers(name, known)
        else:
            found = _readers(name, known) | (set() if _PAGES.fullmatch(name) else started)
            # Of what no test was seen to do, nothing is known.
            found |= {test for test in texts if _TEST.fullmatch(test) and test not in known}
        if not found:
            return None
        chosen |= found
    return chosen


def _readers(name: str, known: Mapping[str, Iterable[str]]) -> set[str]:
    """The tests that read a file, or list its folder."""
    places = {name, str(PurePosixPath(name).parent)}
    return {test for test, paths in known.items() if not places.isdisjoint(paths)}


def _reached(name: str, importers: Mapping[str, set[str]]) -> set[str]:
    found: set[str] = set()
    left = [name]
    while left:
        if (name := left.pop()) not in found:
            found.add(name)
            left += importers.get(name, ())
    return found


def _importers(texts: Mapping[str, str]) -> Mapping[str, set[str]]:
    """The modules that import a module, by its path."""
    found: defaultdict[str, set[str]] = defaultdict(set)
    for name, text in texts.items():
        for module in _imported(name, text):
            found[module].add(name)
    return found


def _imported(name: str, text: str) -> Iterator[str]:
    """The paths of what a module imports, also within functions, and of the packages of that."""
    try:
        nodes = [*ast.walk(ast.parse(text))]
    except SyntaxError:  # an input of a test
        return
    for node in nodes:
        found: list[str] = []
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = PurePosixPath(name).parts[: -node.level] if node.level else ()
            module = ".".join([*above, *filter(None, [node.module])])
            found = [module, *(f"{module}.{alias.name}" for alias in node.names)]
        for parts in (module.split(".") for module in found):
            if parts[0] in _ROOMS:
                yield f"{'/'.join(parts)}.py"
                yield from (f"{'/'.join(parts[:end])}/__init__.py" for end in range(1, len(parts) + 1))
