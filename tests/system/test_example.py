"""`firm init --example`: projects that are copies of demo systems."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.system.scaffold.example import example_named, examples
from fusesoc_firm.tools.library_path import demos_root, library_root

Captured = pytest.CaptureFixture[str]


def test_every_demo_system_is_an_example() -> None:
    assert examples(demos_root()) == sorted(path.name for path in demos_root().iterdir() if path.is_dir())


@pytest.mark.one_in(4)
@pytest.mark.parametrize("example", examples(demos_root()))
def test_a_copy_is_a_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured, example: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "mine", "--example", example]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"next: cd mine && firm sim {example}.yaml"
    copied = {path.relative_to(tmp_path / "mine").as_posix() for path in (tmp_path / "mine").rglob("*.*")}
    # The model of an accelerator in Python is its function.
    demo = demos_root() / example
    model = "model.py" if (demo / "model.py").is_file() else f"python/{min((demo / 'python').glob('*.py')).name}"
    assert {f"{example}.core", f"{example}.yaml", model, "fusesoc.conf", ".gitignore"} <= copied
    assert not any(name.endswith((".md", ".pyc")) for name in copied)
    assert "[library.mine]" in (tmp_path / "mine" / "fusesoc.conf").read_text()
    assert not has_absolute_path(tmp_path / "mine")
    assert main(["system", "check", f"mine/{example}.yaml"]) == 0


def has_absolute_path(project: Path) -> bool:
    """Whether a file of a project names a folder of this machine."""
    texts = [path.read_text() for path in project.rglob("*") if path.is_file()]
    return any(str(place) in text for text in texts for place in (library_root(), project, Path.home()))


@pytest.mark.parametrize(
    ("words", "example"),
    [
        ("pid", "mobile_robot"),
        ("image", "image_pipeline"),
        ("Roll", "quat2euler"),
        ("q", "quat2euler"),
        ("height", "state_kalman"),
    ],
)
def test_a_word_may_name_an_example(words: str, example: str) -> None:
    assert example_named(words, demos_root()) == example


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--example", "quat2eular"], "did you mean 'quat2euler'"),
        (["--example", "radar"], "        mobile_robot: Four wheels of a skid-steer robot"),
        (["--example", "a"], "        sobel: "),
        (["--example", "m"], "unknown example 'm'"),
        (["--example", "."], "unknown example '.'"),
        (["--example", ""], "        sobel: "),
        (["--example", "sobel", "--in", "geometry_msgs/Point"], "an example has no --in"),
        (["--example", "sobel", "--width", "64"], "an example has no --width"),
        (["--example", "sobel", "--from-bag", "drive.bag"], "an example has no --from-bag"),
    ],
)
def test_nothing_else_can_be_chosen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", *arguments]) == 1
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
