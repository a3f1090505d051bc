"""Names that no file can have, and Ctrl-C while the command is imported: a message and no traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fusesoc_firm.cli import main

LONG = "n" * 300


@pytest.mark.parametrize(
    "words",
    [
        ["init", LONG, "--in", "geometry_msgs/Point", "--out", "geometry_msgs/Point"],
        ["message", "show", "geometry_msgs/Point", "--path", LONG],
        ["system", "check", f"{LONG}.yaml"],
        ["system", "new", f"{LONG}.yaml"],
        ["why", f"{LONG}:3"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_a_name_of_300_letters_is_reported(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 1
    error = capsys.readouterr().err
    assert "File name too long" in error and LONG in error
    assert not [*tmp_path.iterdir()]


# An import of the command's first module sends Ctrl-C, as a user would while modules are imported.
_INTERRUPT = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from fusesoc_firm.__main__ import main
sys.argv = ["firm", "system", "show", "x.yaml"]
sys.exit(main())
"""


@pytest.mark.parametrize("name", ["fusesoc_firm.cli", "fusesoc_firm.cli.system", "fusesoc_firm.system.system_core"])
def test_an_interrupt_within_an_import_leaves_no_traceback(name: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _INTERRUPT.format(name=name)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert done.stderr == "interrupted\n"
    assert done.returncode == 130
