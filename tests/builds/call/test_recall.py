"""A repeated call is a hit at once, but never after a change of any fact that determined the result."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.builds.call import answer as answer_module
from fusesoc_firm.builds.call import recall
from fusesoc_firm.builds.call.answer import main
from fusesoc_firm.builds.call.recall import answer
from fusesoc_firm.builds.store.layout import CALL, ENTRY, read_note, write_json
from fusesoc_firm.builds.store.store import Key
from fusesoc_firm.tools import own_code
from fusesoc_firm.tools.own_code import PACKAGE

QUAT2EULER = Path(__file__).resolve().parents[3] / "specs" / "quat2euler"


class Calls:
    """A copy of an application with messages of its own, and calls of generators as FuseSoC makes them."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.monkeypatch = folder, monkeypatch
        self.project, self.store = folder / "project", folder / "store"
        shutil.copytree(QUAT2EULER, self.project)
        for package in ("first", "second"):
            (self.project / "msgs" / package).mkdir(parents=True)
        self.write("msgs/second/my_msgs/msg/Size.msg", "uint8 a\n")
        self.write("ros/share/my_msgs/msg/Other.msg", "uint8 a\n")
        self.write("msgs/first/my_msgs/msg/Unused.msg", "uint8 a\n")
        monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(self.store))
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(self.project / "ros"))

    def write(self, name: str, text: str) -> None:
        path = self.project / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def call(self, name: str, **parameters: object) -> list[str]:
        """Create and enter a folder for a call; return the generator's arguments."""
        work = self.folder / "work" / name
        work.mkdir(parents=True, exist_ok=True)
        self.monkeypatch.chdir(work)
        call = {"files_root": str(self.project), "vlnv": f"a:b:c-{name}:1", "parameters": parameters}
        (work / "call.yml").write_text(yaml.safe_dump(call))
        return ["call.yml"]

    def converter(self) -> list[str]:
        return self.call("size", message="my_msgs/Size", ros=2, paths=["msgs/first", "msgs/second"])

    def simulation(self, **more: object) -> list[str]:
        files = {"spec": "quat2euler.yaml", "stimuli": "stimuli.yaml", "model": "model.py"}
        return self.call("simulation", product="simulation", **files, **more)


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Calls:
    return Calls(tmp_path, monkeypatch)


def written() -> dict[str, bytes]:
    """The files in the current folder, except the call."""
    paths = [path for path in Path().rglob("*") if path.is_file() and path.name != "call.yml"]
    return {str(path): path.read_bytes() for path in sorted(paths)}


def clear() -> None:
    for name in written():
        Path(name).unlink()


@pytest.mark.parametrize("command", ["firm", "far"])
def test_a_call_is_answered_as_it_was(calls: Calls, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = calls.converter() if command == "firm" else calls.simulation()
    assert not answer(command, arguments)
    assert main(command, arguments) == 0
    first = written()
    clear()
    capsys.readouterr()
    assert answer(command, arguments)
    assert written() == first
    assert capsys.readouterr().out.startswith(
        f"{command}: c-{'size' if command == 'firm' else 'simulation'} from store"
    )


def test_what_the_store_has_of_another_call_is_noted(calls: Calls) -> None:
    """A copy of a project elsewhere finds the entry first by its key, and then by its call."""
    main("firm", calls.converter())
    calls.project = calls.project.rename(calls.project.with_name("moved"))
    calls.monkeypatch.setenv("AMENT_PREFIX_PATH", str(calls.project / "ros"))
    arguments = calls.converter()
    assert not answer("firm", arguments)
    assert main("firm", arguments) == 0
    assert answer("firm", arguments)


@pytest.mark.parametrize(
    "name",
    [
        "msgs/second/my_msgs/msg/Size.msg",
        # It takes precedence over the other one.
        "msgs/first/my_msgs/msg/Size.msg",
        "msgs/second/my_msgs/package.xml",
        "ros/share/my_msgs/msg/New.msg",
    ],
)
def test_a_definition_is_looked_at_again(calls: Calls, name: str) -> None:
    arguments = calls.converter()
    main("firm", arguments)
    assert answer("firm", arguments)
    calls.write(name, "uint16 a\n")
    assert not answer("firm", arguments)


def test_a_folder_that_the_environment_names_may_come_later(calls: Calls) -> None:
    calls.monkeypatch.setenv("AMENT_PREFIX_PATH", str(calls.project / "later"))
    arguments = calls.call("vector", message="geometry_msgs/Vector3", ros=2)
    main("firm", arguments)
    assert answer("firm", arguments)
    calls.write("later/share/geometry_msgs/msg/Vector3.msg", "float64 x\n")
    assert not answer("firm", arguments)


def test_definitions_that_nobody_asked_for_do_not_count(calls: Calls) -> None:
    arguments = calls.converter()
    main("firm", arguments)
    calls.write("msgs/first/my_msgs/msg/Unused.msg", "uint16 a\n")
    assert answer("firm", arguments)


@pytest.mark.parametrize("name", ["quat2euler.yaml", "stimuli.yaml", "model.py", "rtl/quat2euler.vhd", "new.csv"])
def test_an_input_is_looked_at_again(calls: Calls, name: str) -> None:
    arguments = calls.simulation(files=["new.csv"])
    assert main("far", arguments) == 0
    assert answer("far", arguments)
    path = calls.project / name
    path.write_text((path.read_text() if path.exists() else "") + "\n")
    assert not answer("far", arguments)
    assert main("far", arguments) == 0
    assert answer("far", arguments)


def test_other_parameters_are_another_call(calls: Calls) -> None:
    main("far", calls.simulation())
    assert not answer("far", calls.simulation(seed=2))


def test_an_edit_of_our_own_code_counts(calls: Calls) -> None:
    arguments = calls.converter()
    main("firm", arguments)
    with calls.monkeypatch.context() as patch:
        patch.setattr(own_code, "state", lambda: "edited")
        assert not answer("firm", arguments)
    assert answer("firm", arguments)


def test_a_compiler_that_was_replaced_counts(calls: Calls, tmp_path: Path) -> None:
    arguments = calls.simulation()
    main("far", arguments)
    folder = tmp_path / "bin"
    folder.mkdir()
    calls.monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    assert answer("far", arguments)
    (folder / "g++").write_text("#!/bin/sh\n")
    (folder / "g++").chmod(0o755)
    assert not answer("far", arguments)


def test_what_cannot_be_run_is_said_on_every_run(calls: Calls, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = calls.simulation()
    with calls.monkeypatch.context() as patch:
        patch.setenv("PATH", "/nowhere")
        assert main("far", arguments) == 0
        assert "missing programs: ghdl" in capsys.readouterr().out
        assert not answer("far", arguments)


def _another_version(calls: Calls) -> None:
    folder = calls.folder / "packages"
    (folder / "rosbags-0.1.dist-info").mkdir(parents=True)
    calls.monkeypatch.setattr(sys, "path", [str(folder), *sys.path])


def _damaged(suffix: str) -> Callable[[Calls], None]:
    def damage(calls: Calls) -> None:
        (path,) = calls.store.rglob(f"*{suffix}")
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 4
        path.write_bytes(data)

    return damage


def _removed(suffix: str) -> Callable[[Calls], None]:
    return lambda calls: next(calls.store.rglob(f"*{suffix}")).unlink()


CHANGES: dict[str, Callable[[Calls], None]] = {
    "environment": lambda calls: calls.monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/x"),
    "folder of the environment": lambda calls: (calls.project / "ros/share/new").mkdir(),
    "package": _another_version,
    "python": lambda calls: calls.monkeypatch.setattr(sys, "version", "4.0"),
    "lock file": lambda calls: calls.monkeypatch.setenv(recall.LOCKED, "x.lock"),
    "other checkout": lambda calls: calls.monkeypatch.setattr(recall, "PACKAGE", Path("/elsewhere")),
    "damaged note": _damaged(CALL),
    "damaged entry": _damaged(ENTRY),
    "removed note": _removed(CALL),
    "removed entry": _removed(ENTRY),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_nothing_is_answered_that_may_be_another(calls: Calls, change: Callable[[Calls], None]) -> None:
    arguments = calls.converter()
    main("firm", arguments)
    assert answer("firm", arguments)
    change(calls)
    clear()
    assert not answer("firm", arguments)
    assert written() == {}


@pytest.mark.parametrize("is_stored", [False, True])
def test_what_is_edited_once_it_was_read_is_not_noted(calls: Calls, is_stored: bool) -> None:
    """The state in a note must be the one from which the key was computed."""
    arguments = calls.converter()
    if is_stored:
        main("firm", arguments)
        _removed(CALL)(calls)
    key_of = answer_module._key

    def edited(*arguments: Any) -> Key:
        # This is after the request was loaded.
        calls.write("msgs/second/my_msgs/msg/Size.msg", "uint16 a\n")
        return key_of(*arguments)

    with calls.monkeypatch.context() as patch:
        patch.setattr(answer_module, "_key", edited)
        assert main("firm", arguments) == 0
    assert not answer("firm", arguments)
    assert [*calls.store.rglob(f"*{CALL}")] == []
    # The result of the old definition must not be stored by the key of the new one, either.
    assert main("firm", arguments) == 0
    assert re.search(r"\ba +: out std_logic_vector\(15 downto 0\)", Path("axis_to_my_msgs_size.vhd").read_text())


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("file", "pipe"),
        ("file", "/dev/zero"),
        ("file", "a\0b"),
        ("folder", "\ud800"),
        ("program", "a\0b"),
        ("messages", "8"),
        ("messages", "[" * 100_000),
        ("messages", "[8, {}]"),
    ],
)
def test_facts_that_others_made_up_are_harmless(calls: Calls, kind: str, name: str) -> None:
    """A shared store may contain forged facts: none blocks the process, or ends in a traceback."""
    arguments = calls.converter()
    main("firm", arguments)
    os.mkfifo("pipe")
    (path,) = calls.store.rglob(f"*{CALL}")
    note = read_note(str(calls.store), str(path.relative_to(calls.store)))
    assert note
    note["facts"].append([kind, name, "some state"])
    write_json(str(calls.store), str(path.relative_to(calls.store)), note)
    assert not answer("firm", arguments)


@pytest.mark.parametrize("arguments", [[], ["nothing.yml"], ["a", "b"], ["."]])
def test_what_is_no_call_is_not_answered(calls: Calls, arguments: list[str]) -> None:
    calls.converter()
    assert not answer("firm", arguments)


def test_next_to_nothing_is_imported(calls: Calls) -> None:
    """Imports take time, so only those that a recall requires are allowed."""
    main("firm", calls.converter())
    script = (
        "import sys; before = {*sys.modules}; from fusesoc_firm.builds.call.recall import answer; "
        "print(answer('firm', ['call.yml'])); print(*sorted({*sys.modules} - before))"
    )
    environment = os.environ | {"PYTHONPATH": str(PACKAGE.parent)}
    # Like the generator's, its path begins with a folder of its own.
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment
    ).stdout.splitlines()
    imported = {name.partition(".")[0] for name in done[-1].split()}
    heavy = {"yaml", "chevron", "rosbags", "numpy", "dataclasses", "inspect", "subprocess", "shutil", "tempfile"}
    assert not imported & heavy
    assert "importlib.metadata" not in done[-1].split()


def test_a_call_is_recalled_whose_folder_is_searched_for_messages(calls: Calls) -> None:
    """As in a project that lists its root folder, which contains the builds."""
    calls.folder = calls.project / "build"
    arguments = calls.call("size", message="my_msgs/Size", ros=2, paths=["."])
    assert main("firm", arguments) == 0
    # FuseSoC empties the folder of a call.
    clear()
    assert answer("firm", arguments)
