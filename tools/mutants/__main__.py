"""`make mutants`: puts faults into a copy of the sources, one after the other, and runs the tests that find them."""

from __future__ import annotations

import argparse
import itertools
import json
import os
import random
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from tests.hdl.ghdl import REPOSITORY
from tools.mutants.document import ERROR, FOUND, INVALID, MISSED, table, write
from tools.mutants.mutants import Mutant, as_json, mutants

# Files that git ignores, but that tests need: the page of firm studio, if it has been built.
_BUILT = "fusesoc_firm/studio/static"
_PYTEST = ("-x", "-q", "-m", "not thorough", "-p", "no:cacheprovider")
_VERDICTS = {0: MISSED, 1: FOUND}
# The limit of tests that wait for ever, which are no help.
_MOST_SECONDS = 600
_NO_END = -1
# A file that is changed twice within a second has the same time, and Python takes the old code. So each gets its own.
_TIMES = itertools.count(1_000_000_000)


def main() -> int:
    """The exit status is 1 if a mutant was missed or could not be tried."""
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__)
    parser.add_argument("patterns", nargs="*", help="parts of the paths of files with mutants (default: all)")
    parser.add_argument("--sample", type=int, metavar="N", help="try N of them, chosen at random")
    parser.add_argument("--seed", type=int, help="repeats a choice (default: a new one, which is printed)")
    parser.add_argument("--report", type=Path, help="write a JSON file with the result of each mutant")
    parser.add_argument("--figures", action="store_true", help="write docs/figures/mutants.md; only with all mutants")
    options = parser.parse_args()
    if options.figures and (options.patterns or options.sample):
        parser.error("--figures needs all mutants")
    chosen = mutants(options.patterns)
    if not chosen:
        parser.error(f"no mutant is in a file with {' or '.join(options.patterns)} in its path")
    if mistakes := [mistake for mutant in chosen for mistake in mutant.mistakes()]:
        sys.exit("\n".join(mistakes))
    if options.sample is not None:
        seed = random.SystemRandom().randrange(1 << 31) if options.seed is None else options.seed
        print(f"seed {seed}", flush=True)
        chosen = random.Random(seed).sample(chosen, min(options.sample, len(chosen)))
    with tempfile.TemporaryDirectory(prefix="firm_mutants_") as name:
        results = _results(chosen, Path(name))
    verdicts = {mutant: verdict for mutant, (verdict, _) in results.items()}
    print(f"\n{table(verdicts)}")
    if options.report:
        entries = [as_json(mutant, *result) for mutant, result in results.items()]
        options.report.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
    if options.figures:
        write(verdicts)
    return 0 if set(verdicts.values()) <= {FOUND} else 1


def _results(chosen: list[Mutant], root: Path) -> dict[Mutant, tuple[str, float]]:
    """The verdict and the seconds of each mutant, told as they come."""
    _copy_sources(root)
    good, results = {}, {}
    for tests in dict.fromkeys(mutant.tests for mutant in chosen):
        status, seconds, output = _timed(partial(_pytest, tests, root))
        good[tests] = status == 0
        print(f"without a fault: {tests}: {'passed' if status == 0 else output} in {seconds:.0f} s", flush=True)
    for number, mutant in enumerate(chosen, 1):
        verdict, seconds = INVALID, 0.0
        if good[mutant.tests]:
            status, seconds, output = _timed(partial(_tried, mutant, root))
            verdict = _VERDICTS.get(status, f"{ERROR}: {output}")
        print(f"{number}/{len(chosen)} {verdict} in {seconds:.0f} s: {mutant.name}", flush=True)
        results[mutant] = verdict.partition(":")[0], seconds
    return results


def _copy_sources(root: Path) -> None:
    """All files that git knows or would add, as they are now, and what is built of the page."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=REPOSITORY, text=True, capture_output=True, check=True).stdout.split("\0")
    for name in filter(None, listed):
        if os.path.lexists(REPOSITORY / name):
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(REPOSITORY / name, root / name, follow_symlinks=False)
    if (REPOSITORY / _BUILT).is_dir():
        shutil.copytree(REPOSITORY / _BUILT, root / _BUILT, symlinks=True, dirs_exist_ok=True)


def _tried(mutant: Mutant, root: Path) -> tuple[int, str]:
    before = mutant.apply(root)
    file = root / mutant.file
    os.utime(file, (next(_TIMES),) * 2)
    try:
        return _pytest(mutant.tests, root)
    finally:
        file.write_text(before, encoding="utf-8")
        os.utime(file, (next(_TIMES),) * 2)


def _pytest(tests: str, root: Path) -> tuple[int, str]:
    """The exit status of pytest, and the last lines of its output."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    command = [sys.executable, "-m", "pytest", *_PYTEST, *shlex.split(tests)]
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(root)}
    # In a file, since what a test leaves behind would hold a pipe open.
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as output:
        with subprocess.Popen(
            command, cwd=root, env=environment, stdout=output, stderr=subprocess.STDOUT, process_group=0
        ) as process:
            try:
                status = process.wait(_MOST_SECONDS)
            except subprocess.TimeoutExpired:
                return _NO_END, f"no end within {_MOST_SECONDS} s"
            finally:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
        output.seek(0)
        return status, "\n".join(output.read().splitlines()[-12:])


def _timed(run: Callable[[], tuple[int, str]]) -> tuple[int, float, str]:
    start = time.monotonic()
    status, output = run()
    return status, time.monotonic() - start, output


if __name__ == "__main__":
    sys.exit(main())
