"""`firm build`: many cores and targets at once, and one target many times at once."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from fusesoc import edalizer

from fusesoc_firm.tools.library_path import library_root
from tests.hdl.ghdl import REPOSITORY
from tests.processes import IGNORING_INTERRUPTS

CONFIGURATION = f"""\
[main]
ignored_dirs = build alone elsewhere
work_root = nowhere
[library.firm]
location = {library_root()}
[library.project]
location = .
"""
# A generator whose instances do what a test needs: print their environment, fail, or keep running.
ACTOR = """\
import os, subprocess, sys, time, yaml
call = yaml.safe_load(open(sys.argv[1]))
print("launcher is", os.environ.get("EDALIZE_LAUNCHER"))
act = call["parameters"]["act"]
if act == "fail":
    print(*(f"line {number}" for number in range(30)), "no such luck", sep="\\n", flush=True)
    sys.exit(1)
if act == "stay":
    child = subprocess.Popen(["sleep", "600"])
    open(os.path.join(call["files_root"], "processes"), "a").write(f"{os.getpid()} {child.pid}\\n")
    child.wait()
if act == "once":
    mark = os.path.join(call["files_root"], "mark")
    if not os.path.exists(mark):
        open(mark, "w").close()
        sys.exit("not yet")
open("made.core", "w").write(f"CAPI=2:\\nname: {call['vlnv']}\\ntargets: {{default: {{}}}}\\n")
"""
ACTOR_CORE = """\
CAPI=2:
name: me:project:actor:1.0
generators: {actor: {interpreter: python3, command: actor.py}}
targets: {default: {}}
"""
CORE = """\
CAPI=2:
name: me:project:NAME:1.0
filesets:
  base: {depend: ["me:project:actor", "robot:firm:generators", "mine ? (me:project:nothing)"]}
  bench: {files: [bench.vhd: {file_type: vhdlSource-93}]}
generate:
  good: {generator: actor, parameters: {act: nothing}}
  bad: {generator: actor, parameters: {act: fail}}
  long: {generator: actor, parameters: {act: stay}}
  once: {generator: actor, parameters: {act: once}}
  pose: {generator: firm, parameters: {message: geometry_msgs/Pose, ros: 2}, position: prepend}
  twist: {generator: firm, parameters: {message: geometry_msgs/Twist, ros: 2}, position: prepend}
targets:
  default: {filesets: [base]}
  good: {filesets: [base], generate: [good], toplevel: x, flow: generic, flow_options: {tool: ghdl}}
  bad: {filesets: [base], generate: [bad], toplevel: x, flow: generic, flow_options: {tool: ghdl}}
  long: {filesets: [base], generate: [long], toplevel: x, flow: generic, flow_options: {tool: ghdl}}
  once: {filesets: [base], generate: [once], toplevel: x, flow: generic, flow_options: {tool: ghdl}}
  old: {filesets: [base], generate: [good], toplevel: x, default_tool: ghdl}
  sim: {filesets: [base, bench], generate: [pose, twist], toplevel: bench, flow: sim, flow_options: {tool: ghdl}}
"""
BENCH = """\
entity bench is
end entity;

architecture simulation of bench is
  component axis_to_geometry_msgs_pose is
  end component;
begin
  process
  begin
    report "the bench has run";
    wait;
  end process;
end architecture;
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project of two cores, next to a store of its own."""
    folder = tmp_path / "project"
    folder.mkdir()
    texts = {
        "fusesoc.conf": CONFIGURATION,
        "actor.py": ACTOR,
        "actor.core": ACTOR_CORE,
        "bench.vhd": BENCH,
        **{f"{name}.core": CORE.replace("NAME", name) for name in ("one", "two")},
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    return folder


def start(project: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    """Start `firm build`, which must react to SIGINT even if its parent ignores it."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("FUSESOC", "EDALIZE"))}
    return subprocess.Popen(
        [*IGNORING_INTERRUPTS, sys.executable, "-m", "fusesoc_firm.cli", "build", *arguments],
        cwd=project,
        env={**kept, "PYTHONPATH": str(REPOSITORY), "FUSESOC_FIRM_CACHE": str(project.parent / "store"), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def build(project: Path, *arguments: str, **environment: str) -> tuple[int, list[str], list[str]]:
    """Exit status, and lines of standard output and error."""
    running = start(project, *arguments, **environment)
    out, err = running.communicate()
    print(out, err)
    return running.returncode, out.splitlines(), err.splitlines()


def place(project: Path, core: str, target: str) -> Path:
    return project / "build" / f"me_project_{core}_1.0" / target


def wait_until(is_so: Callable[[], object]) -> None:
    while not is_so():
        time.sleep(0.05)


def test_every_target_of_every_core_has_its_place(project: Path) -> None:
    status, out, _ = build(project, "me:project:one", "two", "--target", "good", "old", "--setup", "--jobs", "2")
    assert status == 0
    rows = [line.split() for line in out[:-1]]
    assert rows[0] == ["core", "target", "result", "seconds", "log"]
    # In the order of the request, regardless of which was done first.
    expected = [("one", "good"), ("one", "old-ghdl"), ("two", "good"), ("two", "old-ghdl")]
    for row, (core, folder) in zip(rows[1:], expected, strict=True):
        target = folder.partition("-")[0]
        log = f"build/me_project_{core}_1.0/{folder}.log"
        assert row[:3] + row[4:] == [f"me:project:{core}:1.0", target, "ok", log]
        assert f"INFO: Generating me:project:{core}-good:1.0" in (project / log).read_text().splitlines()
        assert (place(project, core, folder) / f"me_project_{core}_1.0.eda.yml").is_file()
    assert re.fullmatch(r"4 builds in \d+\.\d s: 4 ok", out[-1])
    # A work root in FuseSoC's configuration would be shared by all builds.
    assert not (project / "nowhere").exists()
    assert not list((project / "build").rglob("*.lock*"))


def test_one_that_fails_leaves_the_others_alone(project: Path) -> None:
    status, out, err = build(project, "one", "--target", "bad", "good", "--setup", "--build-root", "elsewhere")
    assert status == 1
    assert err[-1] == "error: 1 of 2 builds failed"
    log = "elsewhere/me_project_one_1.0/bad.log"
    assert out[0] == f"me:project:one:1.0 bad failed; the last lines of {log}"
    assert "    no such luck" in out
    assert "    line 29" in out and "    line 5" not in out
    results = {(words := line.split())[1]: words[2:3] + words[4:] for line in out[-3:-1]}
    assert results == {"bad": ["failed", log], "good": ["ok", "elsewhere/me_project_one_1.0/good.log"]}


def test_what_there_is_not_is_said_before_anything_is_built(project: Path) -> None:
    status, out, err = build(project, "one", "three", "me:project:two", "--target", "good", "fast", "default")
    assert (status, out) == (1, [])
    said = "\n".join(err)
    assert "error: unknown core 'three'" in said
    for core in ("one", "two"):
        assert f"error: me:project:{core}:1.0 has no target 'fast'" in said
        assert f"error: target 'default' of me:project:{core}:1.0 cannot be built" in said
    assert not (project / "build").exists()


def test_programs_are_started_by_firm_tool_unless_the_user_says_otherwise(project: Path) -> None:
    log = place(project, "one", "good.log")
    assert build(project, "one", "--target", "good", "--setup")[0] == 0
    assert f"launcher is {sys.executable} -m fusesoc_firm.cli tool" in log.read_text().splitlines()
    assert build(project, "one", "--target", "good", "--setup", EDALIZE_LAUNCHER="mine")[0] == 0
    assert "launcher is mine" in log.read_text().splitlines()


def contents(folder: Path) -> dict[str, bytes]:
    """All files of FuseSoC and generators, except GHDL's library, which has dates, and files that name the run."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.suffix not in (".cf", ".o", ".run"))
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.mark.check
def test_eight_runs_of_one_target_at_once(project: Path, tmp_path: Path) -> None:
    alone = ("one", "--target", "sim", "--build-root", "alone")
    assert build(project, *alone)[0] == 0
    runs = [start(project, "one", "--target", "sim", FUSESOC_FIRM_CACHE=str(tmp_path / "new")) for _ in range(8)]
    outputs = [run.communicate() for run in runs]
    assert [run.returncode for run in runs] == [0] * 8, outputs
    waited = [err for _, err in outputs if "me:project:one:1.0 sim: waiting for process " in err]
    assert 1 <= len(waited) < 8
    assert "the bench has run" in place(project, "one", "sim.log").read_text()
    built = contents(place(project, "one", "sim"))
    assert any(name.endswith("axis_to_geometry_msgs_pose.vhd") for name in built)
    assert built == contents(project / "alone" / "me_project_one_1.0" / "sim")


def processes(project: Path) -> list[int]:
    """The process ids of the instances that keep running."""
    path = project / "processes"
    return [int(word) for word in path.read_text().split()] if path.is_file() else []


def is_running(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.fixture
def staying(project: Path) -> subprocess.Popen[str]:
    """Two builds in progress that do not end by themselves."""
    running = start(project, "one", "two", "--target", "long", "--setup", "--jobs", "2")
    wait_until(lambda: len(processes(project)) == 4)
    assert all(map(is_running, processes(project)))
    return running


def test_ctrl_c_ends_all(project: Path, staying: subprocess.Popen[str]) -> None:
    staying.send_signal(signal.SIGINT)
    assert staying.communicate() == ("", "interrupted\n")
    assert staying.returncode == 130
    wait_until(lambda: not any(map(is_running, processes(project))))
    assert not list((project / "build").rglob("*.lock*"))


def test_killed_it_leaves_nothing_behind_that_hinders(project: Path, staying: subprocess.Popen[str]) -> None:
    staying.kill()
    staying.communicate()
    wait_until(lambda: not any(map(is_running, processes(project))))
    # The same place, with the lock of a process that has ended.
    (lock,) = (project / "build" / "me_project_one_1.0").glob("*.lock")
    core = project / "one.core"
    core.write_text(core.read_text().replace("act: stay", "act: nothing"))
    assert build(project, "one", "--target", "long", "--setup")[0] == 0
    assert not lock.exists()


def results(out: list[str]) -> dict[str, str]:
    """The result of each build in the table."""
    rows = [line.split() for line in out if line.startswith("me:project:")]
    return {f"{row[0].split(':')[2]} {row[1]}": row[2] for row in rows if len(row) in (4, 5)}


def test_patterns_and_targets_of_one_core(project: Path) -> None:
    status, out, _ = build(project, "me:project:*", "--target", "goo*", "old", "--where-present", "--setup")
    assert (status, results(out)) == (0, dict.fromkeys(["one good", "one old", "two good", "two old"], "ok"))
    status, out, _ = build(project, "one@good", "tw?", "--target", "old", "--setup")
    assert (status, results(out)) == (0, dict.fromkeys(["one good", "two old"], "ok"))
    # Without --where-present, every core must have every target.
    status, out, err = build(project, "me:project:*", "me:none:*", "--target", "good", "x*", "--setup")
    assert (status, out) == (1, [])
    assert "error: no core matches 'me:none:*'" in err
    assert "error: me:project:actor:1.0 has no target 'good'" in err
    assert "error: no target of me:project:one:1.0 matches 'x*'" in err
    assert build(project, "one")[2][0] == "error: no target of one is selected"
    assert build(project, "--target", "good")[2][0] == "error: no core is selected"


def test_only_affected_cores(project: Path) -> None:
    def git(*words: str) -> None:
        command = ["git", "-c", "user.name=me", "-c", "user.email=me", *words]
        subprocess.run(command, cwd=project, check=True, capture_output=True)

    git("init")
    git("add", ".")
    git("commit", "-m", "all")
    options = ("--affected-since", "HEAD", "--target", "good", "--setup")
    status, out, _ = build(project, *options)
    assert (status, results(out)) == (0, {})
    (project / "two.core").write_text(f"{(project / 'two.core').read_text()}# edited\n")
    status, out, _ = build(project, *options)
    assert (status, results(out)) == (0, {"two good": "ok"})
    status, out, _ = build(project, "one", *options)
    assert (status, results(out)) == (0, {})


def test_reports_for_programs(project: Path) -> None:
    reports = ("--events", "events.jsonl", "--junit", "junit.xml")
    status, _, _ = build(project, "one@good,bad,once", "--retries", "1", "--jobs", "1", "--setup", *reports)
    assert status == 1
    events = [json.loads(line) for line in (project / "events.jsonl").read_text().splitlines()]
    assert [event["event"] for event in events[:2]] == ["plan", "start"]
    assert events[0]["builds"][1] == {
        "core": "me:project:one:1.0",
        "target": "bad",
        "log": str(place(project, "one", "bad.log")),
    }
    starts = [(event["target"], event["number"]) for event in events if event["event"] == "start"]
    assert sorted(starts) == [("bad", 1), ("bad", 2), ("good", 1), ("once", 1), ("once", 2)]
    ends = {event["target"]: (event["result"], event["tries"]) for event in events if event["event"] == "end"}
    assert ends == {"good": ("ok", 1), "bad": ("failed", 2), "once": ("flaky", 2)}
    assert {**events[-1], "time": 0} == {
        "event": "summary",
        "time": 0,
        "builds": 3,
        "ok": 1,
        "flaky": 1,
        "failed": 1,
        "skipped": 0,
    }
    (suite,) = ET.parse(project / "junit.xml").getroot()
    assert [suite.get(name) for name in ("tests", "failures", "skipped")] == ["3", "1", "0"]
    cases = {case.get("name"): [child.tag for child in case] for case in suite}
    assert cases == {"good": [], "bad": ["failure"], "once": ["system-out"]}
    (failure,) = suite.iter("failure")
    assert "no such luck" in str(failure.text)


def test_flaky_builds_are_reported(project: Path) -> None:
    status, out, _ = build(project, "one", "--target", "once", "--retries", "2", "--setup")
    assert (status, results(out)) == (0, {"one once": "flaky"})
    assert out[0].startswith("me:project:one:1.0 once failed in try 1; the last lines of ")
    assert re.fullmatch(r"1 builds in \d+\.\d s: 1 flaky", out[-1])


def test_the_first_failure_ends_all(project: Path) -> None:
    status, out, err = build(project, "one@bad,long", "two@good", "--fail-fast", "--jobs", "2", "--setup")
    assert status == 1
    assert err[-1] == "error: 1 of 3 builds failed"
    found = results(out)
    assert found.pop("one bad") == "failed"
    assert out[-2].split()[2] in ("skipped", "ok")
    assert "1 failed" in out[-1] and "skipped" in out[-1]
    assert not any(map(is_running, processes(project)))


def test_a_time_limit(project: Path) -> None:
    status, out, _ = build(project, "one", "--target", "long", "--timeout", "2", "--setup")
    assert (status, results(out)) == (1, {"one long": "failed"})
    assert "    ended at the time limit of 2 s" in out
    assert not any(map(is_running, processes(project)))


def test_the_options_of_fusesoc_run(project: Path) -> None:
    """Flags, tools and the backend's arguments reach FuseSoC."""
    status, out, err = build(project, "one", "--target", "good", "--setup", "--flag=mine")
    assert (status, err) == (1, ["error: 1 of 1 builds failed"])
    assert "    one.core:4:64: error: unknown core 'me:project:nothing'" in out
    status, out, _ = build(project, "one", "--target", "old", "--setup", "--tool", "icarus", "--flag=-mine")
    assert (status, results(out)) == (0, {"one old": "ok"})
    assert (place(project, "one", "old-icarus") / "me_project_one_1.0.eda.yml").is_file()
    options = ("one", "--target", "sim", "--build-only", "--backend=--ghdl_unknown=5")
    status, _, _ = build(project, *options)
    assert status == 1
    assert "unrecognized arguments: --ghdl_unknown=5" in place(project, "one", "sim.log").read_text()


def test_mappings_and_a_lock_file(project: Path) -> None:
    """Both apply to the search for dependencies, too."""
    (project / "other.core").write_text("CAPI=2:\nname: me:project:other:1.0\ntargets: {default: {}}\n")
    core = project / "one.core"
    core.write_text(core.read_text().replace("mine ? (me:project:nothing)", "me:project:nothing"))
    (project / "map.core").write_text(
        "CAPI=2:\nname: me:project:map:1.0\nmapping: {me:project:nothing: me:project:other}\n"
    )
    options = ("one", "--target", "good", "--setup")
    assert build(project, *options)[0] == 1
    status, out, _ = build(project, *options, "--mapping", "me:project:map:1.0")
    assert (status, results(out)) == (0, {"one good": "ok"})
    (project / "f.lock").write_text("cores: [{name: 'me:project:actor:1.0'}]\nlockfile_version: 1\n")
    status, out, _ = build(project, *options, "--mapping", "me:project:map:1.0", "--lockfile", "f.lock")
    assert (status, results(out)) == (0, {"one good": "ok"})
    assert build(project, *options, "--lockfile", "none.lock")[2][0] == "error: there is no lock file none.lock"


@pytest.fixture
def calls(tmp_path: Path) -> Path:
    """A folder with a `python3` that records in `calls` the script with which it is started."""
    folder = tmp_path / "bin"
    folder.mkdir()
    python = folder / "python3"
    python.write_text(f'#!/bin/sh\nbasename "$1" >> {folder}/calls\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    (folder / "calls").touch()
    return folder / "calls"


def test_what_the_store_has_is_answered_in_the_process_of_fusesoc(project: Path, calls: Path) -> None:
    arguments = ("one", "--target", "sim", "good", "--setup")
    path = f"{calls.parent}:{os.environ['PATH']}"
    log = place(project, "one", "sim.log")
    for made in ("generated", "from store"):
        assert build(project, *arguments, PATH=path)[0] == 0
        lines = [line for line in log.read_text().splitlines() if line.startswith("firm: ")]
        assert [line.rpartition(" in ")[0] for line in lines] == [
            f"firm: one-{name} {made}" for name in ("pose", "twist")
        ]
        # The actor is not one of our generators.
        expected = ["actor.py"] + ["firm_generator.py"] * (2 if made == "generated" else 0)
        assert sorted(calls.read_text().split()) == expected
        calls.write_text("")
    # Another Python is to answer.
    assert build(project, *arguments, PATH=path, FUSESOC_FIRM_PYTHON=str(calls.parent / "python3"))[0] == 0
    assert calls.read_text().split().count("firm_generator.py") >= 2
    assert hasattr(edalizer, "Launcher") and hasattr(edalizer, "Core2Parser")


UPSTREAM = REPOSITORY / "docs" / "upstream" / "fusesoc-generators.patch"
SEAM = """\
from fusesoc import edalizer, utils
from fusesoc.capi2 import coreparser
from fusesoc_firm.builds.setup.process import save_time
save_time(lambda line, start: print("asked", *line) or start())
assert edalizer.Launcher is utils.Launcher and edalizer.Core2Parser is coreparser.Core2Parser
edalizer.Ttptttg.launcher("echo", ["started"], cwd=".").run()
"""


@pytest.mark.skipif(not shutil.which("patch"), reason="patch is not installed")
def test_fusesoc_with_our_change_needs_no_replaced_names(project: Path, calls: Path, tmp_path: Path) -> None:
    """The change that we propose to FuseSoC applies to the installed release, and gives `firm build` its seam."""
    package = Path(edalizer.__file__).parent
    shutil.copytree(package, tmp_path / "changed" / "fusesoc", ignore=shutil.ignore_patterns("__pycache__"))
    subprocess.run(["patch", "-p1", "-i", UPSTREAM], cwd=tmp_path / "changed", check=True, capture_output=True)
    paths = {"PYTHONPATH": f"{tmp_path / 'changed'}:{REPOSITORY}"}
    done = subprocess.run(
        [sys.executable, "-c", SEAM], env={**os.environ, **paths}, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["asked", "echo", "started", "started"]
    arguments = ("one", "--target", "sim", "good", "--setup")
    for _ in range(2):
        calls.write_text("")
        status, *_ = build(project, *arguments, PATH=f"{calls.parent}:{os.environ['PATH']}", **paths)
        assert status == 0
    assert calls.read_text().split() == ["actor.py"]


def test_many_instances_are_generated_before_fusesoc_asks(project: Path, calls: Path) -> None:
    core = project / "one.core"
    more = [
        f"  m{bits}: {{generator: firm, parameters: {{message: std_msgs/Byte, ros: 1, width: {bits}, name: m{bits}}}}}"
        for bits in (8, 16, 32, 64, 128)
    ]
    text = core.read_text().replace("targets:\n", "\n".join([*more, "targets:\n"]), 1)
    core.write_text(text.replace("generate: [pose, twist]", "generate: [pose, twist, m8, m16, m32, m64, m128]"))
    assert build(project, "one", "--target", "sim", "--setup", PATH=f"{calls.parent}:{os.environ['PATH']}")[0] == 0
    assert calls.read_text() == ""
    log = place(project, "one", "sim.log").read_text()
    assert len(re.findall(r"^firm: one-\w+ from store", log, re.MULTILINE)) == 7


@pytest.fixture
def cluster() -> Iterator[str]:
    distributed: Any = pytest.importorskip("distributed", reason="no distributed; make test installs it")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0"
    ) as machines:
        yield machines.scheduler_address


@pytest.mark.check
@pytest.mark.xdist_group("dask")
def test_on_a_cluster(project: Path, cluster: str) -> None:
    status, out, err = build(
        project, "one", "two", "--target", "good", "bad", "--setup", "--cluster", cluster, EDALIZE_LAUNCHER="mine"
    )
    assert status == 1
    assert err[-1] == "error: 2 of 4 builds failed"
    rows = [line.split() for line in out if " build/me_project_" in line and "ends with" not in line]
    results = [(row[0].split(":")[2], row[1], row[2]) for row in rows if not row[0].startswith("    ")]
    for core in ("one", "two"):
        assert (core, "good", "ok") in results and (core, "bad", "failed") in results
        assert "launcher is mine" in place(project, core, "good.log").read_text().splitlines()
    assert sum("no such luck" in line for line in out) == 2
    assert not list((project / "build").glob(".firm_build*"))


@pytest.mark.check
@pytest.mark.xdist_group("dask")
def test_ctrl_c_ends_what_runs_on_a_cluster(project: Path, cluster: str) -> None:
    running = start(project, "one", "two", "--target", "long", "--setup", "--cluster", cluster)
    wait_until(lambda: len(processes(project)) == 4)
    running.send_signal(signal.SIGINT)
    _, err = running.communicate()
    assert (running.returncode, err.splitlines()[-1]) == (130, "interrupted")
    wait_until(lambda: not any(map(is_running, processes(project))))
