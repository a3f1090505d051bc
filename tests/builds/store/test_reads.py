"""The record of files that are read."""

from __future__ import annotations

import py_compile
import subprocess
import sys
from pathlib import Path

from fusesoc_firm.accelerator.user_code import load_function
from fusesoc_firm.tools.own_code import PACKAGE
from fusesoc_firm.tools.reads import Reads, noted

# A separate process, in which Python's paths have not been requested yet. Since Python 3.13, `sysconfig` opens files
# for this; here it does so in every version.
PROGRAM = """
import sys
import sysconfig
from fusesoc_firm.tools.reads import Reads, noted

asked = sysconfig.get_paths

def get_paths(*arguments, **options):
    open(sys.argv[1]).close()
    return asked(*arguments, **options)

sysconfig.get_paths = get_paths
reads = Reads()
with noted(reads):
    open(sys.argv[2]).close()
print(*reads.files)
"""


def test_what_noting_itself_reads_does_not_call_it_again(tmp_path: Path) -> None:
    files = [tmp_path / "of_python", tmp_path / "of_the_user"]
    for file in files:
        file.touch()
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *files],
        env={"PYTHONPATH": str(PACKAGE.parent)},
        text=True,
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert (done.stdout, done.stderr) == (f"{files[1]}\n", "")


def test_compiled_code_stands_for_its_source(tmp_path: Path) -> None:
    """Another program of the user may have imported the module before."""
    model = tmp_path / "model.py"
    model.write_text("def respond(): ...\n")
    py_compile.compile(str(model))
    assert (tmp_path / "__pycache__").is_dir()
    reads = Reads()
    with noted(reads):
        load_function(model, "respond", "the model", "", "")
    assert [*reads.files] == [str(model)]
