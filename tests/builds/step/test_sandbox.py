"""Steps in a sandbox: what exists there, and what is said where there is none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.builds.step import sandbox
from fusesoc_firm.builds.step.action import execute, look_up
from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.results import Results
from fusesoc_firm.builds.step.sandbox import can_sandbox, check_sandbox
from fusesoc_firm.builds.step.trace import can_trace
from fusesoc_firm.text.diagnostics import InputError
from tests.builds.step.test_action import COPY, action, folder, results

__all__ = ["folder", "results"]

needs_sandbox = pytest.mark.skipif(not can_sandbox() or not can_trace(), reason="bwrap or strace cannot be used here")


@needs_sandbox
@pytest.mark.parametrize(
    ("code", "status"),
    [
        (COPY, 0),
        ("import tempfile; tempfile.mkstemp()", 0),
        ("import subprocess; subprocess.run(['sh', '-c', 'cat /dev/null | grep -c x; ghdl --version'])", 0),
        ("open('../other')", 1),
        ("open('/usr/new', 'w')", 1),
        ("import socket; socket.create_connection(('127.0.0.1', {port}))", 1),
    ],
)
def test_only_inputs_and_tools_exist(code: str, status: int, folder: Path, results: Results) -> None:
    import socket

    folder.with_name("other").write_text("")
    with socket.create_server(("127.0.0.1", 0)) as server:
        asked = action(code.replace("{port}", str(server.getsockname()[1])), folder)
        assert execute(asked, results, Contents(), folder.with_name("outside")).status == 0 or "/usr/new" in code
        folder.joinpath("out").unlink(missing_ok=True)
        log = folder.with_name("log")
        done = execute(replace(asked, is_sandboxed=True), results, Contents(), log)
    assert (done.status, done.fault) == (status, ""), log.read_text()


@needs_sandbox
def test_what_is_written_elsewhere_is_lost(folder: Path, results: Results) -> None:
    """/tmp can be written, since some tools have no other place for temporary files."""
    asked = replace(action("open('/tmp/new-firm', 'w'); open('../new', 'w')", folder), is_sandboxed=True)
    done = execute(asked, results, Contents(), folder.with_name("log"))
    assert (done.status, "outside its folder" in done.fault) in ((0, True), (1, False))
    assert not folder.with_name("new").exists()
    assert not Path("/tmp/new-firm").exists()


@needs_sandbox
def test_a_result_outside_is_not_one_of_a_sandbox(folder: Path, results: Results) -> None:
    """Since a step outside may have found a file that does not exist in the sandbox."""
    asked = action("import os; print(os.path.exists('../other')); open('out', 'w')", folder)
    folder.with_name("other").write_text("")
    assert execute(asked, results, Contents(), folder.with_name("log")).fault == ""
    folder.joinpath("out").unlink()
    inside = replace(asked, is_sandboxed=True)
    assert look_up(inside, results, Contents()) is None
    assert execute(inside, results, Contents(), folder.with_name("log")).fault == ""
    assert look_up(inside, results, Contents())
    assert folder.with_name("log").read_text() == "True\nFalse\n"


@needs_sandbox
def test_declared_inputs_exist(folder: Path, results: Results) -> None:
    other = folder.with_name("other")
    other.write_text("1")
    asked = replace(action(f"open({str(other)!r}).read()", folder), declared=(str(other),), is_sandboxed=True)
    done = execute(asked, results, Contents(), folder.with_name("log"))
    assert (done.status, done.fault) == (0, "")


def test_a_machine_without_a_sandbox_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    sandbox._obstacle.cache_clear()
    with pytest.raises(InputError, match=r"'bwrap' is not installed[^$]*apt install bubblewrap"):
        check_sandbox()
    program = tmp_path / "bwrap"
    program.write_text("#!/bin/sh\necho 'bwrap: No permissions to create new namespace' >&2; exit 1\n")
    program.chmod(0o755)
    sandbox._obstacle.cache_clear()
    with pytest.raises(InputError, match="not available here: bwrap: No permissions to create new namespace"):
        check_sandbox()
    sandbox._obstacle.cache_clear()
