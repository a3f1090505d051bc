"""Which of our own files were used: what an edit makes anew, and what it leaves."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.store.own_code import PACKAGE, digests, used_code


def test_modules_templates_and_data_count_but_not_the_library(tmp_path: Path) -> None:
    def put(name: str, text: str) -> dict[str, str]:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return digests(tmp_path)

    found = [
        put("render.py", "a"),
        put("render.py", "b"),
        put("message/parser.py", "a"),
        put("templates/vhdl/a.mustache", "a"),
        put("templates/vhdl/a.mustache", "b"),
        put("scheduling/area.csv", "a"),
    ]
    assert len({str(each) for each in found}) == len(found)
    assert list(found[-1]) == ["message/parser.py", "render.py", "scheduling/area.csv", "templates/vhdl/a.mustache"]
    assert put("library/generators/x.py", "a") == found[-1]
    assert put("__pycache__/x.py", "a") == found[-1]
    assert put("notes.txt", "a") == found[-1]


def test_what_is_used_is_counted() -> None:
    used = used_code()
    assert "store/own_code.py" in used
    assert set(used) <= digests().keys()


class Project:
    """A copy of the package, and a core with two instances of the generator that runs in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.package = folder / "code" / "fusesoc_firm"
        left_out = shutil.ignore_patterns("demos", "library", "__pycache__")
        shutil.copytree(PACKAGE, self.package, ignore=left_out)
        (folder / "msgs" / "my_msgs" / "msg").mkdir(parents=True)
        self.message = folder / "msgs" / "my_msgs" / "msg" / "Size.msg"
        self.message.write_text("uint8 a\n")

    def origin(self, message: str) -> str:
        """Run the generator: whether what it wrote was `generated` or `from store`."""
        work = self.folder / "work"
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir()
        parameters = {"message": message, "ros": 2, "paths": ["msgs"]}
        call = {"files_root": str(self.folder), "vlnv": f"a:b:c-{message.rpartition('/')[2].lower()}:1"}
        (work / "call.yml").write_text(yaml.safe_dump(call | {"parameters": parameters}))
        script = "import sys; from fusesoc_firm.plugin.gapi import main; sys.exit(main('firm', sys.argv[1:]))"
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
        """Of a message of fixed size, of the user's, and of one of variable size."""
        return [self.origin(name) for name in ("geometry_msgs/Point", "my_msgs/Size", "std_msgs/String")]

    def edit(self, name: str) -> None:
        path = self.package / name
        sign = {".py": "#", ".mustache": "--"}[path.suffix]
        path.write_text(f"{path.read_text().rstrip()}\n{sign} edited\n")


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path)


def test_an_edit_makes_just_its_dependants_anew(project: Project) -> None:
    made, found = "generated", "from store"
    assert project.origins() == [made, made, made]
    assert project.origins() == [found, found, found]
    project.message.write_text("uint8 b\n")
    assert project.origins() == [found, made, found]
    project.edit("templates/vhdl/subscriber.vhd.mustache")
    assert project.origins() == [made, made, found]
    project.edit("node/bursts.py")
    assert project.origins() == [found, found, found]
    project.edit("naming.py")
    assert project.origins() == [made, made, made]
    project.message.write_text("uint8 a\n")
    assert project.origins() == [found, made, found]
