"""Random edits of libraries: exactly the builds that depend on an edited file run, with the results of a full run.

The steps of each library's targets are cached by `firm build --cached --build-only`. In each round, files get a comment
with a new number, or their first content again. The first builds tell which of the library's files each target
received, and these files decide what has to run. At the end, all steps run again with an empty store, for comparison.
"""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import subprocess
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.trace import can_trace
from fusesoc_firm.builds.step.tree import tree_of
from tests.hdl.ghdl import REPOSITORY
from tests.processes import program

pytestmark = pytest.mark.skipif(not can_trace(), reason="strace is not installed or not permitted")

FOREIGN = "FIRM_TESTS_FOREIGN"
"""The variable that names a folder with clones of SERV and open-logic: `serv` and `open-logic`."""
EDITS_IN_A_ROUND = 5
COMMENTS = {".vhd": "--", ".v": "//", ".mustache": "--", ".txt": "#"}
# A part of `fusesoc:utils`, which SERV's test bench uses.
VLOG_TB_UTILS = """\
CAPI=2:
name: fusesoc:utils:vlog_tb_utils:1.0
filesets: {rtl: {files: [vlog_tb_utils.v: {file_type: verilogSource}]}}
targets: {default: {filesets: [rtl]}}
"""
MADE = """\
CAPI=2:
name: acme:m:made:1.0
filesets: {base: {depend: ["robot:firm:generators"]}}
generate: {one: {generator: firm, parameters: {message: std_msgs/Bool, ros: 2, direction: subscriber, width: 32}}}
targets:
  sim: {filesets: [base], generate: [one], toplevel: axis_to_std_msgs_bool, default_tool: ghdl}
"""
TEMPLATE = "fusesoc_firm/templates/vhdl/subscriber.vhd.mustache"


@dataclass
class Library:
    """A copy of a library: the builds' names, the folders with the files to edit, and the variables of commands."""

    folder: Path
    builds: tuple[str, ...]
    edited: tuple[Path, ...]
    generated: dict[Path, frozenset[str]] = field(default_factory=dict)

    def run(self, *options: str, root: str = "build", store: str = "store") -> dict[str, list[str]]:
        """Run all builds; return the states of the steps of each build."""
        events = self.folder / "events"
        own = {
            "PYTHONPATH": f"{self.folder / 'code'}:{REPOSITORY}",
            "FUSESOC_FIRM_CACHE": str(self.folder / store),
            "FUSESOC_FIRM_ACTIONS_TWICE": "0",
        }
        command = [program("firm"), "build", *self.builds, "--cached", "--build-only"]
        done = subprocess.run(
            [*command, "--build-root", root, "--events", str(events), *options],
            cwd=self.folder,
            env={**os.environ, **own},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        lines = [json.loads(line) for line in events.read_text().splitlines()]
        return {
            f"{line['core']} {line['target']}": [step["state"] for step in line["steps"]]
            for line in lines
            if line["event"] == "end"
        }

    def outputs(self, root: str = "build") -> dict[str, dict[str, str]]:
        """Return the identities of all files of each build, without the folder's path in GHDL's libraries."""
        return {
            str(place.relative_to(self.folder / root)): {
                path: item.identity or item.digest
                for path, item in tree_of(place, Contents()).items()
                if not path.endswith(".cf")
            }
            for place in (self.folder / root).glob("*/*/")
        }

    def dependents(self) -> dict[Path, frozenset[str]]:
        """Return the names of the builds that received each file."""
        files = [path for place in self.edited for path in sorted(place.rglob("*")) if path.suffix in COMMENTS]
        contents: dict[tuple[str, bytes], set[str]] = {}
        for work in (self.folder / "build").glob("*/*/"):
            for path in (work / "src").rglob("*"):
                if path.is_file():
                    contents.setdefault((path.name, path.read_bytes()), set()).add(f"{work.parent.name}/{work.name}")
        found = {path: (path.name, path.read_bytes()) for path in files}
        # Copies of one file cannot be told apart.
        count = Counter(found.values())
        return {
            path: frozenset(contents[content])
            for path, content in found.items()
            if content in contents and count[content] == 1
        } | self.generated


def conf(folder: Path, **libraries: Path) -> None:
    text = "".join(f"[library.{name}]\nlocation = {place}\n" for name, place in libraries.items())
    (folder / "fusesoc.conf").write_text(f"[main]\nignored_dirs = build again\n{text}")


def ours(folder: Path) -> Library:
    """Our cores' test benches, and a generated converter; templates are those of a copy of the package."""
    code = folder / "code"
    for name in ("fusesoc_firm", "cores", "generators", "edalize"):
        shutil.copytree(REPOSITORY / name, code / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "made").mkdir()
    (folder / "made" / "made.core").write_text(MADE)
    conf(folder, firm=code / "fusesoc_firm" / "library", made=folder / "made")
    builds = ("robot:axis:*@sim", "robot:cdc:*@sim", "robot:sim:*@sim", "acme:m:made@sim", "--where-present")
    return Library(folder, builds, (code / "cores",), {code / TEMPLATE: frozenset({"acme_m_made_1.0/sim-ghdl"})})


def serv(folder: Path) -> Library:
    """SERV's linted cores, and its test bench for Icarus Verilog."""
    shutil.copytree(foreign("serv"), folder / "serv", ignore=shutil.ignore_patterns(".git"))
    (folder / "utils").mkdir()
    (folder / "utils" / "utils.core").write_text(VLOG_TB_UTILS)
    (folder / "utils" / "vlog_tb_utils.v").write_text("module vlog_tb_utils;\nendmodule\n")
    conf(folder, serv=folder / "serv", utils=folder / "utils")
    own = "award-winning:serv"
    return Library(folder, (f"{own}:serv*@lint", f"{own}:servant@sim"), (folder / "serv", folder / "utils"))


def open_logic(folder: Path) -> Library:
    """Entities of open-logic, each in a core with the files that it needs."""
    shutil.copytree(foreign("open-logic") / "src" / "base" / "vhdl", folder / "olo")
    files = {path.stem: path.read_text() for path in sorted((folder / "olo").glob("*.vhd"))}
    uses = {
        name: [other for other in files if other != name and re.search(rf"\bwork\.{other}\b", text)]
        for name, text in files.items()
    }
    entities = [name for name in files if "_pkg_" not in name][::3]
    for entity in entities:
        needed = dict.fromkeys([entity])
        while more := [other for name in needed for other in uses[name] if other not in needed]:
            needed |= dict.fromkeys(more)
        listed = ", ".join(f"{name}.vhd" for name in reversed(needed))
        (folder / "olo" / f"{entity}.core").write_text(
            f"CAPI=2:\nname: olo:base:{entity}:1.0\n"
            f"filesets: {{rtl: {{files: [{listed}], file_type: vhdlSource-2008}}}}\n"
            f"targets: {{sim: {{filesets: [rtl], toplevel: {entity}, default_tool: ghdl}}}}\n"
        )
    conf(folder, olo=folder / "olo")
    return Library(folder, ("olo:base:*@sim",), (folder / "olo",))


def foreign(name: str) -> Path:
    """Return the folder of a foreign library, or skip the test."""
    if FOREIGN not in os.environ:
        pytest.skip(f"{FOREIGN} does not name a folder with clones of SERV and open-logic")
    return Path(os.environ[FOREIGN]) / name


@pytest.mark.thorough
@pytest.mark.parametrize(("make", "edits"), [(ours, 70), (serv, 65), (open_logic, 65)])
def test_exactly_the_dependents_run(make: object, edits: int, tmp_path: Path) -> None:
    assert callable(make)
    library = make(tmp_path)
    seed = random.randrange(2**32)
    chance = random.Random(seed)
    names = {name: place(library, name) for name in library.run()}
    dependents = library.dependents()
    first = {path: path.read_text() for path in dependents}
    print(f"seed {seed}: {len(names)} builds, {len(dependents)} files")

    def state(build: str) -> tuple[str, ...]:
        return tuple(path.read_text() for path, builds in dependents.items() if build in builds)

    known = {(build, state(build)) for build in names.values()}
    number = ran = 0
    while number < edits:
        for path in chance.sample(sorted(dependents), min(EDITS_IN_A_ROUND, edits - number)):
            number += 1
            comment = f"\n{COMMENTS[path.suffix]} edit {number}\n"
            path.write_text(first[path] if chance.random() < 0.25 else f"{path.read_text()}{comment}")
        expected = {name: (build, state(build)) in known for name, build in names.items()}
        states = library.run()
        assert {name: set(steps) == {"cached"} for name, steps in states.items()} == expected, f"seed {seed}"
        ran += sum(not is_known for is_known in expected.values())
        known |= {(build, state(build)) for build in names.values()}
    print(f"{number} edits: {ran} builds ran, as expected")
    again = library.run("--rerun", root="again", store="empty")
    assert again.keys() == names.keys()
    assert library.outputs("again") == library.outputs()


def place(library: Library, build: str) -> str:
    """Return the folder of a build, such as acme_m_made_1.0/sim-ghdl."""
    core, target = build.split(" ")
    root = library.folder / "build"
    above = root / core.replace(":", "_")
    (found,) = (path for path in above.iterdir() if path.is_dir() and path.name.split("-")[0] == target)
    return str(found.relative_to(root))
