"""Our own code determines the generated output: its edits are noticed, and no others."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.tools import own_code
from fusesoc_firm.tools.own_code import PACKAGE, digest, names, state


@pytest.mark.parametrize("told", [digest, state])
def test_modules_templates_and_data_count_but_not_the_library(tmp_path: Path, told: Callable[[Path], str]) -> None:
    def put(name: str, text: str) -> str:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return told(tmp_path)

    found = [
        put("render.py", "a"),
        put("render.py", "b"),
        put("message/parser.py", "a"),
        put("templates/vhdl/a.mustache", "a"),
        put("templates/vhdl/a.mustache", "b"),
        put("scheduling/area.csv", "a"),
    ]
    assert len(set(found)) == len(found)
    assert names(tmp_path) == ["message/parser.py", "render.py", "scheduling/area.csv", "templates/vhdl/a.mustache"]
    assert put("library/generators/x.py", "a") == found[-1]
    assert put("docs/x.csv", "a") == found[-1]
    assert put("__pycache__/x.py", "a") == found[-1]
    assert put("notes.txt", "a") == found[-1]
    (tmp_path / "render.py").unlink()
    assert told(tmp_path) != found[-1]


def aged(folder: Path) -> Path:
    """A module written long before this process started, and a link that an editor left next to it."""
    path = folder / "old.py"
    path.write_text("a")
    os.utime(path, ns=(10**18, 10**18))
    (folder / ".#old.py").symlink_to("me@here.1")
    return path


def test_an_edit_of_the_same_size_and_time_is_noticed(tmp_path: Path) -> None:
    """No program can set the time of a file's status change, and a new file counts by its content."""
    path = aged(tmp_path)
    before = digest(tmp_path), state(tmp_path)
    path.write_text("b")
    os.utime(path, ns=(10**18, 10**18))
    assert digest(tmp_path) != before[0]
    assert state(tmp_path) != before[1]


def test_what_is_old_is_not_read_for_its_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    content = own_code._content

    def note(path: str) -> str:
        read.append(path)
        return content(path)

    monkeypatch.setattr(own_code, "_content", note)
    path = aged(tmp_path)
    state(tmp_path)
    assert read == [str(path)]
    # As if this process started in an hour.
    monkeypatch.setattr(own_code, "_STARTED", time.time_ns() + 3600 * 10**9)
    state(tmp_path)
    assert read == [str(path)]


def test_a_process_that_watches_looks_again_after_it_has_opened_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "package"
    package.mkdir()
    path = aged(package)
    monkeypatch.setattr(own_code, "PACKAGE", package)
    monkeypatch.setattr(own_code, "_BELOW", f"{package}{os.sep}")
    monkeypatch.setattr(own_code, "_watch", own_code._Watch())
    # Another test of this process may have kept the state.
    monkeypatch.setattr(own_code, "_kept", [])
    own_code.watch()
    before = state(package)
    edited = tmp_path / "edited.py"
    edited.write_text("b")
    edited.replace(path)
    # Nothing that this process generates can depend on the edit.
    assert state(package) == before
    assert path.read_text() == "b"
    assert state(package) != before


def test_a_copy_has_the_same_digest(tmp_path: Path) -> None:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.py").write_text("a")
    assert digest(tmp_path / "one") == digest(tmp_path / "other")
    assert state(tmp_path / "one") != state(tmp_path / "other")


class Project:
    """A copy of the package, and a core with two instances of the generator in that copy."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.package = folder / "code" / "fusesoc_firm"
        left_out = shutil.ignore_patterns("demos", "library", "__pycache__")
        shutil.copytree(PACKAGE, self.package, ignore=left_out)
        (folder / "msgs" / "my_msgs" / "msg").mkdir(parents=True)
        self.message = folder / "msgs" / "my_msgs" / "msg" / "Size.msg"
        self.message.write_text("uint8 a\n")

    def origin(self, message: str) -> str:
        """Run the generator, and return the origin of its output: `generated` or `from store`."""
        work = self.folder / "work"
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir()
        parameters = {"message": message, "ros": 2, "paths": ["msgs"]}
        call = {"files_root": str(self.folder), "vlnv": f"a:b:c-{message.rpartition('/')[2].lower()}:1"}
        (work / "call.yml").write_text(yaml.safe_dump(call | {"parameters": parameters}))
        script = "import sys; from fusesoc_firm.builds.call.answer import main; sys.exit(main('firm', sys.argv[1:]))"
        done = subprocess.run(
            [sys.executable, "-c", script, "call.yml"],
            cwd=work,
            env=os.environ | {"PYTHONPATH": str(self.package.parent), "FUSESOC_FIRM_CACHE": str(self.folder / "store")},
            capture_output=True,
            text=True,
            check=True,
        )
        return "from store" if " from store in " in done.stdout else "generated"

    def origins(self) -> list[str]:
        """The origins for a message of fixed size, one of the user's, and one of variable size."""
        return [self.origin(name) for name in ("geometry_msgs/Point", "my_msgs/Size", "std_msgs/String")]

    def edit(self, name: str) -> None:
        path = self.package / name
        sign = {".py": "#", ".mustache": "--"}[path.suffix]
        path.write_text(f"{path.read_text().rstrip()}\n{sign} edited\n")


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path)


def test_an_edit_is_generated_anew_and_undone_without(project: Project) -> None:
    made, found = "generated", "from store"
    assert project.origins() == [made, made, made]
    assert project.origins() == [found, found, found]
    project.message.write_text("uint8 b\n")
    assert project.origins() == [found, made, found]
    template = project.package / "templates/vhdl/subscriber.vhd.mustache"
    text = template.read_text()
    project.edit("templates/vhdl/subscriber.vhd.mustache")
    assert project.origins() == [made, made, made]
    template.write_text(text)
    assert project.origins() == [found, found, found]
    project.message.write_text("uint8 a\n")
    assert project.origins() == [found, found, found]
