"""The linters are the authority on style and types; their configuration is in pyproject.toml and .ci/vsg.yaml."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]


needs_vsg = pytest.mark.skipif(not importlib.util.find_spec("vsg"), reason="vsg is installed by make lint")
LINTERS = [
    pytest.param(["-m", "ruff", "check", "--no-cache", "."], id="ruff"),
    pytest.param(["-m", "mypy"], id="mypy", marks=pytest.mark.check),
    pytest.param([".ci/lint_vhdl.py"], id="vsg", marks=[pytest.mark.check, needs_vsg]),
]


@pytest.mark.parametrize("linter", LINTERS)
def test_lint(linter: list[str]) -> None:
    done = subprocess.run([sys.executable, *linter], cwd=ROOT, text=True, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture
def lint_vhdl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The check of VHDL, with a record of its own of the files that passed."""
    found = importlib.util.spec_from_file_location("lint_vhdl", ROOT / ".ci" / "lint_vhdl.py")
    assert found and found.loader
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    monkeypatch.setattr(module, "WORK", tmp_path)
    monkeypatch.setattr(module, "PASSED", tmp_path / "passed")
    return module


PACKAGE = """package limits_pkg is

  constant {name} : natural := 7;

end package limits_pkg;
"""


@pytest.mark.check
@needs_vsg
def test_a_fault_of_style_is_reported_with_its_line(
    lint_vhdl: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "limits_pkg.vhd"
    path.write_text(PACKAGE.format(name="highest"))
    assert lint_vhdl.main([str(path)]) == 1
    assert capsys.readouterr().out == f'{path}:3: constant_004: Change "highest" to "HIGHEST"\n'


@pytest.mark.check
@needs_vsg
def test_a_file_that_vsg_cannot_read_is_a_fault(
    lint_vhdl: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "limits_pkg.vhd"
    path.write_text(PACKAGE.format(name="HIGHEST").replace(":=", ";;"))
    assert lint_vhdl.main([str(path)]) == 1
    assert capsys.readouterr().out.startswith(f"{path}:3: Unexpected token")


@pytest.mark.check
@needs_vsg
def test_a_file_that_passed_is_checked_again_only_after_a_change(
    lint_vhdl: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "limits_pkg.vhd"
    path.write_text(PACKAGE.format(name="HIGHEST"))
    assert lint_vhdl.main([str(path)]) == 0
    monkeypatch.setattr(lint_vhdl, "check", lambda paths, style: {path: ["checked"] for path in paths})
    assert lint_vhdl.main([str(path)]) == 0
    path.write_text(PACKAGE.format(name="LOWEST"))
    assert lint_vhdl.main([str(path)]) == 1


def test_a_template_without_a_sample_is_found(lint_vhdl: ModuleType) -> None:
    unused = {path.name for path in lint_vhdl.unused_templates(sorted(lint_vhdl.GOLDEN.glob("*.vhd")))}
    assert "system.vhd.mustache" in unused
    assert not unused & {"constants.vhd.mustache", "interface.vhd.mustache", "subscriber.vhd.mustache"}
