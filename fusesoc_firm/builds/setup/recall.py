"""Recall builds without FuseSoC's setup: the inputs of a plan and of each setup are noted, and compared next time.

A note of a plan contains the cores and folders of FuseSoC's libraries, and the builds that were found. A note of a
build adds the files that its setup read, the facts about calls of our generators, and the content of the folder after
the setup. If all of this is unchanged, the steps of the build are looked up directly.

A setup that starts a program, such as another generator, is not noted, since the files that a program reads are
unknown. In this case, FuseSoC sets the build up as usual, and its steps are looked up afterwards.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.step import environment
from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.observed import states
from fusesoc_firm.builds.step.results import Results
from fusesoc_firm.builds.step.tree import Item, Tree
from fusesoc_firm.builds.store.packages import version
from fusesoc_firm.tools import own_code
from fusesoc_firm.tools.digests import digest_of
from fusesoc_firm.tools.facts import Fact, StateOf, hold, state
from fusesoc_firm.tools.library_path import demos_root, library_root
from fusesoc_firm.tools.own_code import PACKAGE
from fusesoc_firm.tools.reads import Reads, noted

_KINDS = frozenset({"file", "part", "folder", "code", "program"})
_STARTS = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork")
_PACKAGE_FOLDERS = ("site-packages", "dist-packages")


@dataclass
class Observed:
    """The facts about a plan or a setup; `is_whole` is False if a program was started or a call is not noted."""

    reads: Reads
    calls: list[Fact] = field(default_factory=list)
    is_whole: bool = True

    def facts(self, build_root: Path) -> list[Fact]:
        """Return the facts, except those about the folder of the builds."""
        below = f"{build_root}{os.sep}"
        found = [fact for fact in self.reads.facts() if not f"{fact[1]}{os.sep}".startswith(below)]
        return [*found, *self.calls]


_observed: list[Observed] = []


@contextmanager
def observed() -> Iterator[Observed]:
    """Observe what FuseSoC reads within this context."""
    _install_hook()
    apart = [path for path in sys.path if os.path.basename(path) in _PACKAGE_FOLDERS]  # noqa: PTH119
    libraries = (str(library_root()), str(demos_root()))
    found = Observed(Reads(apart=[*Reads().apart, *apart], kept=libraries, python_path=()))
    _observed.append(found)
    try:
        with noted(found.reads):
            yield found
    finally:
        _observed.remove(found)


@contextmanager
def unobserved() -> Iterator[None]:
    """Within this context, ignore started programs, whose use of files is known from another source."""
    apart, _observed[:] = [*_observed], []
    try:
        yield
    finally:
        _observed[:] = apart


def note_call(found: Iterable[Fact] | None) -> None:
    """Add the facts about a call of a generator; None if they are unknown."""
    for item in _observed:
        if found is None:
            item.is_whole = False
        else:
            item.calls += found
            item.is_whole = item.is_whole and all(fact[0] in _KINDS for fact in item.calls)


@dataclass
class Recall:
    """The notes of one command: `words` are all its options that select or change builds."""

    results: Results
    contents: Contents
    words: Sequence[object]
    build_root: Path
    # The builds of a command are looked up before any of them runs, so each fact is looked up once for all.
    state_of: StateOf = field(init=False)
    _state: StateOf = field(init=False)

    def __post_init__(self) -> None:
        self.state_of = states(self.contents, os.environ.get("PATH", os.defpath))
        digest = self.contents.digest
        self._state = cache(lambda kind, name: digest(name) if kind == "file" else state(kind, name))

    def builds(self) -> tuple[list[Build], str] | None:
        """Return the builds of the same command in the same state of the libraries, and the digest of this state."""
        note = self.results.note(self._key("plan", ""))
        try:
            if not isinstance(note, dict) or not hold(note["facts"], self._state):
                return None
            return [Build(core, target, Path(root)) for core, target, root in note["builds"]], digest_of(note["facts"])
        except (LookupError, TypeError, ValueError):
            return None

    def keep_builds(self, builds: Sequence[Build], found: Observed) -> str:
        """Note the builds of a command; return the digest of the state of the libraries, empty if it is unknown."""
        listed = found.facts(self.build_root)
        if not found.is_whole:
            return ""
        rows = [[build.core, build.target, str(build.work_root)] for build in builds]
        self.results.keep_note(self._key("plan", ""), {"facts": listed, "builds": rows})
        return digest_of(listed)

    def setup(self, build: Build, scan: str) -> tuple[tuple[str, str], dict[str, Item]] | None:
        """Return a build's flow or tool, and the content of its folder after the setup, if the setup is unchanged."""
        note = self.results.note(self._key(str(build), scan))
        try:
            if not isinstance(note, dict) or not hold(note["facts"], self._state):
                return None
            api, name = note["backend"]
            return (api, name), {path: Item(*item) for path, item in note["tree"].items()}
        except (LookupError, TypeError, ValueError, AttributeError):
            return None

    def keep_setup(self, build: Build, scan: str, found: Observed, backend: tuple[str, str], tree: Tree) -> None:
        """Note a build's setup, if everything that it read is known."""
        if not scan or not found.is_whole:
            return
        items = {path: [item.kind, item.digest, item.identity] for path, item in tree.items()}
        note = {"facts": found.facts(self.build_root), "backend": backend, "tree": items}
        self.results.keep_note(self._key(str(build), scan), note)

    def _key(self, name: str, scan: str) -> str:
        # A build's setup depends on fewer words, but a command is usually repeated as a whole.
        return digest_of([name, scan, str(self.build_root), str(Path.cwd()), self.words, _session()])


@cache
def _session() -> str:
    """Return the digest of everything else on which plans and setups depend."""
    packages = {name: version(name) for name in ("edalize", "fusesoc", "fusesoc-firm", "pyyaml")}
    return digest_of(
        {
            "packages": packages,
            "python": [sys.executable, *sys.version_info[:3]],
            "machine": platform.machine(),
            "environment": environment.of_step(os.environ),
            "package": str(PACKAGE),
            "own": own_code.state(),
        }
    )


@cache
def _install_hook() -> None:
    """Install the hook once; it remains installed until the process ends."""
    sys.addaudithook(_hook)


def _hook(event: str, _: tuple[object, ...]) -> None:
    if _observed and event in _STARTS:
        for item in _observed:
            item.is_whole = False
