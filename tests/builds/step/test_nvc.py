"""Edalize's tool `nvc`: the commands of a build, and a design of two libraries in nvc itself, where it is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.builds.step.flow import backend

FILES = {
    "part.vhd": "entity part is end part;\narchitecture a of part is begin end a;\n",
    "top.vhd": (
        'library lib;\nentity top is generic (N : integer := 1; T : string := "-"); end top;\n'
        "architecture a of top is\nbegin\n  u : entity lib.part;\n  process begin\n"
        '    report "N is " & integer\'image(N) & T; wait;\n  end process;\nend a;\n'
    ),
}
needs_nvc = pytest.mark.skipif(shutil.which("nvc") is None, reason="nvc is not installed")


def build(folder: Path, *, options: dict[str, Any] | None = None, **parameters: Any) -> Any:
    """The build of the two files in Edalize."""
    for name, text in FILES.items():
        (folder / name).write_text(text)
    listed = [{"name": name, "file_type": "vhdlSource-93"} for name in FILES]
    listed[0]["logical_name"] = "lib"
    edam = {
        "name": "two",
        "toplevel": "top",
        "files": listed,
        "parameters": {
            name: {"datatype": "int", "paramtype": "vlogparam", "default": value} for name, value in parameters.items()
        },
        "flow_options": {"tool": "nvc", **(options or {})},
    }
    made = backend("flow", "sim", edam, str(folder))
    made.configure()
    return made


def commands(folder: Path, target: str) -> list[str]:
    """What make would run."""
    # Make may run the tests, too.
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("EDALIZE", "MAKE", "MFLAGS"))}
    done = subprocess.run(["make", "-n", target], cwd=folder, env=kept, capture_output=True, text=True, check=True)
    return done.stdout.replace("\\\n", "").strip().splitlines()


def test_each_library_is_analysed_and_the_top_is_run(tmp_path: Path) -> None:
    build(tmp_path, options={"sim_options": ["-gT=x --stop-time=1us"], "analyze_options": ["--relaxed"]}, N=7)
    begin = "nvc --std=1993 -M 1g -L."
    assert [line.strip() for line in commands(tmp_path, "run")] == [
        f"{begin} --work=lib:lib -a --relaxed part.vhd",
        f"{begin} --work=work:work -a --relaxed top.vhd",
        f"{begin} --work=work:work -e --no-save --jit top -gN=7 -gT=x -r --stop-time=1us",
    ]


def test_another_file_or_option_analyses_again(tmp_path: Path) -> None:
    build(tmp_path)
    for library in ("lib", "work"):
        (tmp_path / library).mkdir()
        (tmp_path / library / "_index").touch()
    assert len(commands(tmp_path, "run")) == 1
    build(tmp_path, options={"analyze_options": ["--relaxed"]})
    assert len(commands(tmp_path, "run")) == 3


@pytest.mark.parametrize(("kind", "revision"), [("87", "1993"), ("2008", "2008"), ("2019", "2019")])
def test_the_newest_standard_counts(kind: str, revision: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(FILES, "new.vhd", "entity new_one is end new_one;\n")
    build(tmp_path)
    edam = {
        "name": "two",
        "toplevel": "top",
        "files": [
            {"name": "top.vhd", "file_type": "vhdlSource"},
            {"name": "new.vhd", "file_type": f"vhdlSource-{kind}"},
        ],
        "flow_options": {"tool": "nvc"},
    }
    backend("flow", "sim", edam, str(tmp_path)).configure()
    assert all(f"--std={revision} " in line for line in commands(tmp_path, "run"))


@needs_nvc
def test_it_runs(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    made = build(tmp_path, options={"sim_options": ["-gT=!"]}, N=7)
    made.build()
    made.run()
    said = capfd.readouterr()
    assert "N is 7!" in said.out + said.err
