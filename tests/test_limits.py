"""What test runs promise: what tests start listens to SIGINT, none waits for ever, and groups stay together."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import IGNORING_INTERRUPTS

REPOSITORY = Path(__file__).resolve().parents[1]
WAITING = """
import subprocess, sys, threading
import pytest

@pytest.fixture
def slow_fixture():
    threading.Event().wait()

def test_process():
    child = subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"], stdin=subprocess.PIPE)
    child.wait()

def test_thread():
    threading.Event().wait()

def test_fixture(slow_fixture):
    pass

def test_work():
    code = "import time\\nwhile time.process_time() < 3: pass"
    subprocess.run([sys.executable, "-c", code], check=True)

def test_work_of_processes_that_end():
    for _ in range(6):
        code = "import time\\nwhile time.process_time() < 0.5: pass"
        subprocess.run([sys.executable, "-c", code], check=True)

def test_default():
    import signal
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    code = "import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    assert subprocess.check_output([sys.executable, "-c", code]) == b"True\\n"

@pytest.mark.thorough
def test_thorough():
    import time
    time.sleep(4)
"""


@pytest.mark.check
def test_a_run_that_inherits_an_ignored_interrupt(tmp_path: Path) -> None:
    (tmp_path / "test_waiting.py").write_text(WAITING)
    (tmp_path / "pytest.ini").write_text("[pytest]\nwaiting_limit = 2\nmarkers = thorough\n")
    options = ["-p", "tests.conftest", "-p", "no:cacheprovider", "-p", "no:xdist", "-rA", "--tb=line"]
    done = subprocess.run(
        [*IGNORING_INTERRUPTS, sys.executable, "-m", "pytest", *options],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    print(done.stdout, done.stderr)
    results = {
        line.split("::")[1].split()[0]: line.split()[0] for line in done.stdout.splitlines() if "::test_" in line
    }
    assert results == {
        "test_process": "FAILED",
        "test_thread": "FAILED",
        "test_fixture": "ERROR",
        "test_work": "PASSED",
        "test_work_of_processes_that_end": "PASSED",
        "test_default": "PASSED",
        "test_thorough": "PASSED",
    }
    assert "neither the test nor a process below it has done anything for 2 s" in done.stdout


PROCESSORS = len(os.sched_getaffinity(0))


@pytest.mark.parametrize(("asked", "processes"), [({}, PROCESSORS + 1), ({"PYTEST_XDIST_AUTO_NUM_WORKERS": "1"}, 1)])
def test_a_run_has_a_process_more_than_processors_and_tells_its_time(
    asked: dict[str, str], processes: int, tmp_path: Path
) -> None:
    """Unless the variable of pytest-xdist asks for another number."""
    (tmp_path / "test_passing.py").write_text("def test_passing():\n    pass\n")
    options = ["-p", "tests.conftest", "-p", "no:cacheprovider", "-n", "auto"]
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = thorough\n")
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_XDIST_AUTO_NUM_WORKERS"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options],
        cwd=tmp_path,
        env={**environment, **asked, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=True,
    )
    expected = (
        rf"^\d+ s by the clock; processes: {processes}, which had tests for \d+% of it; "
        rf"processors: {PROCESSORS}, which worked for \d+% of it$"
    )
    assert re.search(expected, done.stdout, re.MULTILINE), done.stdout


def test_no_value_of_a_short_parametrisation_is_left_out(tmp_path: Path) -> None:
    """`one_in(40, 40)` leaves out most of 80 cases, but of the parameters only values of the long one."""
    source = """
import pytest

@pytest.mark.one_in(40, 40)
@pytest.mark.parametrize("long", range(10))
@pytest.mark.parametrize("short", range(8))
def test_case(short, long):
    pass
"""
    (tmp_path / "test_swept.py").write_text(source)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n  check\n  thorough\n  one_in(n, m)\n")
    options = ["-p", "tests.conftest", "-p", "no:cacheprovider", "-p", "no:xdist", "--collect-only", "-q"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, "-m", "not thorough"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=True,
    )
    found = re.findall(r"test_case\[(\d)-(\d)\]", done.stdout)
    assert {short for short, _ in found} == set("01234567"), done.stdout
    assert len({long for _, long in found}) < 10, done.stdout
    assert len(found) < 16, done.stdout


def test_a_group_of_tests_stays_in_one_process(tmp_path: Path) -> None:
    """What a module makes for a version of ROS, such as nodes in C++, is made once."""
    source = """
import os
import pytest

VERSIONS = [pytest.param(version, marks=pytest.mark.xdist_group(f"version_{version}")) for version in (1, 2)]

@pytest.fixture(scope="module", params=VERSIONS)
def version(request):
    return request.param

@pytest.mark.parametrize("number", range(4))
def test_process(version, number):
    print(f"<{version} in {os.getpid()}>")
"""
    (tmp_path / "test_grouped.py").write_text(source)
    options = ["-p", "no:cacheprovider", "-n", "2", "--dist", "loadgroup", "-rP"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    found = set(re.findall(r"<(\d) in (\d+)>", done.stdout))
    assert sorted(version for version, _ in found) == ["1", "2"], done.stdout
