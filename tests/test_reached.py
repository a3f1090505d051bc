"""Which tests a change can reach, and how tests are shared out."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.reached import ROOT, chosen_tests
from tests.reads import EVERYTHING
from tests.recall import STORE
from tests.sharing import unit_of

MODULES = {
    "fusesoc_firm/cli/__init__.py": "def main():\n    from fusesoc_firm.one import part\n",
    "fusesoc_firm/one/__init__.py": "",
    "fusesoc_firm/one/part.py": "import os\n",
    "fusesoc_firm/two/__init__.py": "",
    "fusesoc_firm/two/user.py": "from fusesoc_firm.one.part import name\n",
    "fusesoc_firm/two/alone.py": "from . import user\n",
    "tests/helpers.py": "from fusesoc_firm.two import alone\n",
    "tests/one/test_part.py": "from fusesoc_firm.one import part\n",
    "tests/two/test_alone.py": "from tests.helpers import x\n",
    "tests/two/test_command.py": "from tests.processes import program\n",
    "tests/data/broken.py": "def (",
    "tests/three/test_bench.py": "from tools.bench import area\n",
    "tools/bench/area.py": "import os\n",
}
KNOWN = {
    "tests/one/test_part.py": ["cores/a/a.vhd", "specs"],
    "tests/two/test_alone.py": ["fusesoc_firm/templates/x.mustache"],
    "tests/two/test_command.py": [EVERYTHING],
    "tests/three/test_bench.py": ["tools/bench/harness.v"],
}
PART, ALONE, COMMAND, BENCH = KNOWN


@pytest.mark.parametrize(
    ("changed", "chosen"),
    [
        ("fusesoc_firm/one/part.py", {PART, ALONE, COMMAND}),
        ("fusesoc_firm/two/user.py", {ALONE}),
        ("fusesoc_firm/one/__init__.py", {PART, ALONE, COMMAND}),
        ("tests/helpers.py", {ALONE}),
        (PART, {PART}),
        ("tools/bench/area.py", {BENCH}),
        ("tools/bench/harness.v", {BENCH, COMMAND}),
        ("cores/a/a.vhd", {PART, COMMAND}),
        ("specs/new.yaml", {PART, COMMAND}),
        ("fusesoc_firm/templates/x.mustache", {ALONE, COMMAND}),
        ("cores/b/b.vhd", {COMMAND}),
        # What nothing reads or imports, and how tests run.
        ("docs/page.md", None),
        ("fusesoc_firm/two/new.py", None),
        ("tests/conftest.py", None),
        ("pyproject.toml", None),
    ],
)
def test_a_change_reaches_what_imports_or_reads_it(changed: str, chosen: set[str] | None) -> None:
    assert chosen_tests([changed], MODULES, KNOWN) == chosen


def test_changes_reach_what_each_of_them_does() -> None:
    assert chosen_tests(["fusesoc_firm/two/user.py", "cores/a/a.vhd"], MODULES, KNOWN) == {PART, ALONE, COMMAND}
    assert chosen_tests(["fusesoc_firm/two/user.py", "pyproject.toml"], MODULES, KNOWN) is None
    assert chosen_tests([], MODULES, KNOWN) == set()


def test_what_no_test_was_seen_to_do_may_read_everything() -> None:
    known = {name: paths for name, paths in KNOWN.items() if name != ALONE}
    assert chosen_tests(["cores/a/a.vhd"], MODULES, known) == {PART, ALONE, COMMAND}
    assert chosen_tests(["fusesoc_firm/two/user.py"], MODULES, known) == {ALONE}


@pytest.mark.parametrize(
    ("test", "unit"),
    [
        ("tests/a/test_b.py::test_c", "tests/a/test_b.py"),
        ("tests/a/test_b.py::test_c[x@y-1]", "tests/a/test_b.py"),
        ("tests/a/test_b.py::test_c[x]@group", "group"),
        ("tests/a/test_b.py::test_c@group", "group"),
    ],
)
def test_what_runs_in_one_process(test: str, unit: str) -> None:
    assert unit_of(test) == unit


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no clone")
def test_a_run_of_what_a_change_reaches_finds_its_store(tmp_path: Path) -> None:
    """Without a folder in the environment, it is that of the user's cache."""
    environment = {name: value for name, value in os.environ.items() if name != STORE and "PYTEST" not in name}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--collect-only", "-q", "--since", "HEAD", __file__],
        cwd=ROOT,
        env={**environment, "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    # A clone without changes has nothing to run.
    assert done.returncode in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED), done.stdout + done.stderr
