"""Steps that are stored and recalled, on steps in Python."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from fusesoc_firm.builds.step.action import TWICE, Action, after, execute, log_of, look_up
from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.environment import key_of, of_step
from fusesoc_firm.builds.step.results import FOLDER_NAME, Results
from fusesoc_firm.builds.step.trace import can_trace
from fusesoc_firm.builds.step.tree import tree_of

needs_strace = pytest.mark.skipif(not can_trace(), reason="strace is not installed or not permitted")
COPY = "open('out', 'w').write(open('in').read()); print('done')"


@pytest.fixture
def results(tmp_path: Path) -> Results:
    return Results(tmp_path / "store", 2**30)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "build"
    path.mkdir()
    (path / "in").write_text("content")
    return path


def action(code: str, folder: Path, twice: str = "0", **variables: str) -> Action:
    environment = {**os.environ, TWICE: twice, "PYTHONDONTWRITEBYTECODE": "1", **variables}
    return Action("step", ("-S", "-c", code), folder, tree_of(folder, Contents()), environment)


def run(asked: Action, results: Results) -> str:
    """Run a step, and return why it is not stored."""
    done = execute(asked, results, Contents(), asked.folder.with_name("log"))
    assert done.status == 0, asked.folder.with_name("log").read_text()
    return done.fault


@needs_strace
def test_a_result_is_recalled_with_its_outputs_and_its_log(folder: Path, results: Results) -> None:
    code = f"import os; os.mkdir('d'); os.symlink('in', 'd/link'); os.unlink('in2'); {COPY}; os.chmod('out', 0o755)"
    (folder / "in2").write_text("")
    asked = action(f"{code}; print(os.getcwd())", folder)
    assert look_up(asked, results, Contents()) is None
    assert run(asked, results) == ""
    record = look_up(asked, results, Contents())
    assert record
    assert record.removed == ("in2",)
    assert log_of(record, results, Path("/elsewhere")) == b"done\n/elsewhere\n"
    assert after(record, asked.inputs) == tree_of(folder, Contents())
    other = folder.with_name("other")
    assert results.restore(other, record)
    assert (other / "out").read_text() == "content"
    assert os.access(other / "out", os.X_OK)
    assert str((other / "d" / "link").readlink()) == "in"


@needs_strace
def test_another_content_another_command_and_another_variable_are_other_actions(folder: Path, results: Results) -> None:
    assert run(action(COPY, folder), results) == ""
    (folder / "out").unlink()
    assert look_up(action(COPY, folder), results, Contents())
    assert not look_up(action(f"{COPY};", folder), results, Contents())
    assert not look_up(action(COPY, folder, LICENSE="1"), results, Contents())
    assert look_up(action(COPY, folder, TERM="x", FUSESOC_FIRM_REMOTE="http://x", HOME="/"), results, Contents())
    (folder / "in").write_text("c0ntent")
    assert not look_up(action(COPY, folder), results, Contents())


@needs_strace
def test_a_failed_step_is_not_stored(folder: Path, results: Results) -> None:
    asked = action("open('out', 'w'); raise SystemExit(3)", folder)
    assert execute(asked, results, Contents(), folder.with_name("log")).status == 3
    assert look_up(asked, results, Contents()) is None


@needs_strace
@pytest.mark.parametrize(
    ("code", "fault"),
    [
        ("open('../other').read()", "it reads {0}/other, which is not an input of its core"),
        ("open('../new', 'w')", "it writes {0}/new, outside its folder"),
        ("import os; os.unlink('../other')", "it writes {0}/other, outside its folder"),
        ("import os; os.rename('in', '../new')", "it writes {0}/new, outside its folder"),
        ("import socket; socket.socket().connect_ex(('127.0.0.1', 9))", "it uses the network"),
    ],
)
def test_a_step_outside_its_folder_is_not_stored(code: str, fault: str, folder: Path, results: Results) -> None:
    folder.with_name("other").write_text("")
    asked = action(code, folder)
    assert run(asked, results) == fault.format(folder.parent)
    assert look_up(asked, results, Contents()) is None


@needs_strace
def test_declared_inputs_and_temporary_files_are_legal(folder: Path, results: Results) -> None:
    other = folder.with_name("other")
    other.write_text("1")
    code = f"import tempfile; tempfile.mkstemp()[1]; open('out', 'w').write(open({str(other)!r}).read())"
    plain = action(code, folder)
    asked = Action(plain.name, plain.arguments, folder, plain.inputs, plain.environment, (str(other),))
    assert run(asked, results) == ""
    assert look_up(asked, results, Contents())
    other.write_text("2")
    assert not look_up(asked, results, Contents())


@needs_strace
def test_another_tool_is_noticed(folder: Path, results: Results, tmp_path: Path) -> None:
    """A program that comes first on the path, and an edited file of a tool."""
    for name in ("first", "second"):
        (tmp_path / name / "bin").mkdir(parents=True)
    tool = tmp_path / "second" / "bin" / "tool"
    tool.write_text("#!/bin/sh\ncat $(dirname $0)/../data >out\n")
    tool.chmod(0o755)
    data = tmp_path / "second" / "data"
    data.write_text("1")
    search = f"{tmp_path}/first/bin:{tmp_path}/second/bin:{os.environ['PATH']}"
    asked = action("import os; os.system('tool')", folder, PATH=search)
    assert run(asked, results) == ""
    assert look_up(asked, results, Contents())
    data.write_text("2")
    assert not look_up(asked, results, Contents())
    data.write_text("1")
    assert look_up(asked, results, Contents())
    other = tmp_path / "first" / "bin" / "tool"
    other.write_text("#!/bin/sh\n")
    other.chmod(0o755)
    # The path's programs are found once in a process.
    code = (
        "import os, sys; from fusesoc_firm.builds.step.observed import state;"
        "from fusesoc_firm.builds.step.contents import *;"
        "print(state('program', 'tool', Contents(), sys.argv[1]) == sys.argv[2])"
    )
    record = results.record(asked.key())
    assert record
    (was,) = [fact[2] for fact in record.facts if fact[:2] == ("program", "tool")]
    assert os.popen(f"{sys.executable} -c \"{code}\" '{search}' {was}").read() == "False\n"


@needs_strace
def test_a_header_that_appears_is_noticed(folder: Path, results: Results) -> None:
    """A missing file that a step looked for may appear."""
    header = folder.with_name("x.h")
    asked = action(f"import os; os.path.exists({str(header)!r})", folder)
    assert run(asked, results) == ""
    assert look_up(asked, results, Contents())
    header.write_text("")
    assert not look_up(asked, results, Contents())


@needs_strace
def test_only_modules_count_in_a_folder_on_pythons_path(
    folder: Path, results: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python lists such a folder, such as a checkout, at the first import; other files in it decide nothing."""
    modules = tmp_path / "modules"
    modules.mkdir()
    monkeypatch.syspath_prepend(str(modules))
    asked = action("import importlib.util as util; util.find_spec('missing')", folder, PYTHONPATH=str(modules))
    assert run(asked, results) == ""
    for name in (".cache", "build-1"):
        (modules / name).mkdir()
    (modules / "notes.txt").write_text("")
    assert look_up(asked, results, Contents())
    (modules / "other.py").write_text("")
    assert not look_up(asked, results, Contents())


@needs_strace
def test_all_names_count_in_another_folder_that_a_step_lists(folder: Path, results: Results, tmp_path: Path) -> None:
    listed = tmp_path / "listed"
    listed.mkdir()
    asked = action(f"import os; os.listdir({str(listed)!r})", folder)
    assert run(asked, results) == ""
    assert look_up(asked, results, Contents())
    (listed / "notes.txt").write_text("")
    assert not look_up(asked, results, Contents())


@needs_strace
def test_a_step_with_other_bytes_in_a_second_run_is_named_and_not_stored(folder: Path, results: Results) -> None:
    code = "import os; open('out', 'w').write('same'); open('noise', 'wb').write(os.urandom(8)); os.unlink('in')"
    asked = action(code, folder, twice="1")
    assert run(asked, results) == "a second run writes other bytes to noise"
    assert look_up(asked, results, Contents()) is None
    assert sorted(path.name for path in folder.iterdir()) == ["noise", "out"]
    assert [path.name for path in folder.parent.iterdir() if path.name.startswith("build")] == ["build"]


@needs_strace
def test_a_second_run_with_the_same_bytes_is_stored(folder: Path, results: Results) -> None:
    stamps = "import time; open('work-obj93.cf', 'w').write('at \"20261123065633.%03d\"' % (time.time_ns() % 1000))"
    asked = action(f"{COPY}; {stamps}", folder, twice="1")
    assert run(asked, results) == ""
    assert look_up(asked, results, Contents())


@needs_strace
def test_an_output_with_the_folders_path_is_recalled_only_there(folder: Path, results: Results) -> None:
    code = "import os; open('out', 'w').write(os.getcwd())"
    assert run(action(code, folder), results) == ""
    (folder / "out").unlink()
    assert look_up(action(code, folder), results, Contents())
    moved = folder.rename(folder.with_name("moved"))
    assert not look_up(action(code, moved), results, Contents())


@needs_strace
@pytest.mark.parametrize(
    "change",
    [
        {"facts": [["file", "x"]]},
        {"outputs": [["../out", "file", "0" * 64, ""]]},
        {"outputs": [["/out", "file", "0" * 64, ""]]},
        {"outputs": [["out", "device", "0" * 64, ""]]},
        {"outputs": [["out", "file", "../../x", ""]]},
        {"outputs": [["out", "link", "/home", ""], ["out/x", "file", "0" * 64, ""]]},
        {"removed": ["../in"]},
        {"log": "x"},
        {"seconds": "1"},
        {"place": 1},
        {"outputs": 5},
    ],
)
def test_a_hostile_record_counts_as_missing(folder: Path, results: Results, change: Mapping[str, object]) -> None:
    from fusesoc_firm.tools.digests import digest

    asked = action(COPY, folder)
    assert run(asked, results) == ""
    (path,) = (results.root / FOLDER_NAME / "ac").glob("*/*")
    data = json.loads(path.read_bytes().partition(b"\n")[2])
    text = json.dumps({**data, **change}).encode()
    path.write_bytes(digest(text).encode() + b"\n" + text)
    assert results.record(asked.key()) is None


@needs_strace
def test_damaged_and_removed_contents_are_not_restored(folder: Path, results: Results) -> None:
    asked = action(COPY, folder)
    assert run(asked, results) == ""
    record = results.record(asked.key())
    assert record
    place = results.root / FOLDER_NAME / "cas"
    (blob,) = place.glob(f"*/{record.outputs['out'].digest}")
    blob.write_text("damaged")
    assert not results.restore(folder.with_name("other"), record)
    blob.unlink()
    assert not results.restore(folder.with_name("other"), record)
    (path,) = (results.root / FOLDER_NAME / "ac").glob("*/*")
    path.write_bytes(path.read_bytes()[:-1])
    assert results.record(asked.key()) is None


def test_the_store_shrinks_to_its_limit(tmp_path: Path) -> None:
    results = Results(tmp_path, 5000)
    names = [results.keep_content(bytes([number]) * 1000) for number in range(10)]
    for age, name in enumerate(names):
        (path,) = tmp_path.glob(f"**/{name}")
        os.utime(path, (10**9 + age, 10**9 + age))
    results.shrink_if_needed()
    assert results.size() == 4000
    assert [results.content(name) is not None for name in names] == [False] * 6 + [True] * 4


def test_without_strace_a_step_runs_and_is_not_stored(
    folder: Path, results: Results, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fusesoc_firm.builds.step.action.can_trace", lambda: False)
    asked = action(COPY, folder)
    assert "'strace' is not installed" in run(asked, results)
    assert (folder / "out").read_text() == "content"
    assert look_up(asked, results, Contents()) is None


def test_digests_are_kept_while_a_file_is_unchanged(tmp_path: Path) -> None:
    path, kept = tmp_path / "file", tmp_path / "kept.json"
    path.write_text("one")
    os.utime(path, (10**9, 10**9))
    contents = Contents(kept)
    first = contents.digest(str(path))
    contents.save()
    # Its status changed a moment ago, so it is not kept.
    assert not kept.exists()
    data = {str(path): ["0" * 64, *_mark(path)]}
    kept.write_text(json.dumps(data))
    assert Contents(kept).digest(str(path)) == "0" * 64
    path.write_text("two")
    assert Contents(kept).digest(str(path)) not in ("0" * 64, first)
    kept.write_text("[1")
    assert Contents(kept).digest(str(path))
    assert Contents(kept).digest(str(tmp_path)) is None


def _mark(path: Path) -> list[int]:
    status = path.stat()
    return [status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns]


def test_what_steps_receive_of_the_environment() -> None:
    session = {"TERM": "x", "SSH_AGENT": "1", "FUSESOC_FIRM_REMOTE_TOKEN": "secret", "GITHUB_RUN_ID": "7"}
    given = {"LC_ALL": "C", "PATH": "/bin", "HOME": "/home/me"}
    assert of_step({**session, **given}) == given
    assert key_of({**session, **given}) == {"LC_ALL": "C"}


@pytest.mark.parametrize(
    "line",
    [
        # Yosys 0.23 and 0.52.
        "End of script. Logfile hash: {0}, CPU: user {1}s system 0.05s, MEM: 60.50 MB peak",
        "Time spent: 2{0}% 38x opt_clean (1 sec), 13% 44x opt_expr (0 sec), ...",
        "ABC: Total runtime =     {1} sec",
        "ABC: elapse: {1} seconds, total: {1} seconds",
    ],
)
def test_times_in_the_log_of_yosys_do_not_count(tmp_path: Path, line: str) -> None:
    log = tmp_path / "yosys.log"
    identities = []
    for digit, seconds in ((1, 0.73), (2, 0.87)):
        log.write_text(f"Checking module m...\n{line.format(digit, seconds)}\nEnd.\n")
        identities.append(tree_of(tmp_path, Contents())["yosys.log"].identity)
    assert identities[0] == identities[1]
    log.write_text(f"Checking module n...\n{line.format(1, 0.73)}\nEnd.\n")
    assert tree_of(tmp_path, Contents())["yosys.log"].identity != identities[0]
