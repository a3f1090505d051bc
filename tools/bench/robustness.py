"""Random edits and damaged contents: the tests with their whole number of cases, one row for each."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass

from tests.hdl.ghdl import REPOSITORY
from tools.bench.tables import FAILED, MET, Tell

TITLE = "Edits and damaged contents"
COLUMNS = ("what", "cases", "seed", "bar", "result")
NOTE = """
    An edit adds a comment to a file of a library, or restores the file. Exactly the builds that received the file must
    run, and at the end all outputs must equal those of a full run with an empty store. A damaged content has a changed,
    missing or additional byte, is cut, or is swapped with another one, at the server of a remote store; none may be
    accepted. `FIRM_TESTS_FOREIGN` names a folder with clones of SERV and open-logic; without it, their rows are those
    of the last measurement.
    """
_SEED = re.compile(r"^seed (\d+)", re.MULTILINE)
_DAMAGED = "test_damaged_cut_and_swapped_blobs_are_not_accepted[all]"
_EDITED = "tests/house/test_random_edits.py::test_exactly_the_dependents_run"
_EXACT, _NONE = "exactly the dependents run", "none accepted"


@dataclass(frozen=True)
class Case:
    """A row: its title, the number of cases, the bar in words, and the test in pytest's words."""

    title: str
    count: int
    bar: str
    test: str


CASES = (
    Case("edits in our library", 70, _EXACT, f"{_EDITED}[ours-70]"),
    Case("edits in SERV", 65, _EXACT, f"{_EDITED}[serv-65]"),
    Case("edits in open-logic", 65, _EXACT, f"{_EDITED}[open_logic-65]"),
    Case("damaged generated cores", 10_000, _NONE, f"tests/builds/store/test_remote.py::{_DAMAGED}"),
    Case("damaged results of steps", 10_000, _NONE, f"tests/builds/step/test_remote_results.py::{_DAMAGED}"),
)


def row_keys() -> list[tuple[str, str]]:
    """The first cells of the rows."""
    return [(case.title, f"{case.count:,}") for case in CASES]


def rows(tell: Tell, pattern: str) -> dict[tuple[str, ...], tuple[str, ...]]:
    """Return the rows whose titles match, by their keys; a skipped test has none."""
    found: dict[tuple[str, ...], tuple[str, ...]] = {}
    for case, key in zip(CASES, row_keys(), strict=True):
        if not re.search(pattern, case.title):
            continue
        command = [sys.executable, "-m", "pytest", "-q", "-s", "-m", "", "-p", "no:cacheprovider", case.test]
        done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
        # A test that captures its output keeps the seed for a failure.
        seed = _SEED.search(done.stdout)
        if re.search(r"\b1 skipped", done.stdout):
            tell(f"{case.title}: skipped")
            continue
        result = MET if done.returncode == 0 else FAILED
        found[key] = (*key, seed[1] if seed else "", case.bar, result)
        tell(" ".join(found[key]) if result == MET else done.stdout[-3000:])
    return found
