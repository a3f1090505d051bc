"""A batch stores the same results, with the same dependencies, as FuseSoC's own calls."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.builds.call.batch import prepare
from fusesoc_firm.core.request import GeneratorCall
from fusesoc_firm.tools.library_path import library_root
from tests.hdl.ghdl import REPOSITORY

# Messages of variable and of fixed size, which use different templates.
MESSAGES = ("std_msgs/String", "geometry_msgs/Pose", "sensor_msgs/Image", "std_msgs/Byte")


def call(message: str, **parameters: object) -> GeneratorCall:
    name = message.replace("/", "_")
    return GeneratorCall("firm", f"me:x:core-{name}:1", str(REPOSITORY), {"message": message, "ros": 2, **parameters})


def keys(store: Path) -> list[str]:
    """The keys of all entries."""
    return sorted(path.stem for path in store.rglob("*.entry"))


def answer(item: GeneratorCall, folder: Path, environment: Mapping[str, str]) -> str:
    """The output of FuseSoC's call of the generator."""
    folder.mkdir()
    (folder / "call.yml").write_text(yaml.safe_dump({**vars(item), "gapi": "1.0"}))
    command = [sys.executable, str(REPOSITORY / "generators" / "firm_generator.py"), "call.yml"]
    done = subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, text=True)
    return done.stdout


def test_a_batch_does_what_the_calls_would(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = [call(message) for message in MESSAGES]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "FUSESOC_FIRM_CACHE": str(tmp_path / "alone")}
    for number, item in enumerate(calls):
        assert "generated" in answer(item, tmp_path / f"alone{number}", environment)

    # One process handles all calls.
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "together"))
    assert len(list(prepare(calls, 1))) == len(calls)
    assert keys(tmp_path / "together") == keys(tmp_path / "alone")

    environment["FUSESOC_FIRM_CACHE"] = str(tmp_path / "together")
    for number, item in enumerate(calls):
        assert "from store" in answer(item, tmp_path / f"together{number}", environment)
        for path in (tmp_path / f"alone{number}").glob("*.vhd"):
            assert path.read_bytes() == (tmp_path / f"together{number}" / path.name).read_bytes()


def test_what_cannot_be_made_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path))
    wrong = [call("no/Such"), call("std_msgs/Byte", widht=8), call("std_msgs/Int8", width=9)]
    others = [GeneratorCall("theirs", "me:x:y-z:1", "/", {}), call("std_msgs/Char", messages=["me:msgs:arm"])]
    assert len(list(prepare([*wrong, *others, call("std_msgs/Bool")], 1))) == 4
    assert len(keys(tmp_path)) == 1


def test_few_calls_are_left_to_fusesoc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path))
    assert list(prepare([call(message) for message in MESSAGES[:3]], 8)) == []
    assert not keys(tmp_path)


def test_fusesocs_calls_use_the_notes_of_a_batch(tmp_path: Path) -> None:
    instances = [f"i{number}: {{generator: firm, parameters: {{message: {name}, ros: 2, name: i{number}, width: 8}}}}"
                 for number, name in enumerate(MESSAGES)]  # fmt: skip
    lines = (
        "CAPI=2:",
        "name: me:x:core:1.0",
        'filesets: {base: {depend: ["robot:firm:generators"]}}',
        f"generate: {{{', '.join(instances)}}}",
        "targets:",
        "  default: {filesets: [base], generate: [i0, i1, i2, i3], toplevel: x,",
        "    flow: generic, flow_options: {tool: ghdl}}",
    )
    (tmp_path / "library").mkdir()
    (tmp_path / "library" / "core.core").write_text("\n".join(lines))
    conf = f"[library.firm]\nlocation = {library_root()}\n[library.x]\nlocation = library\n"
    (tmp_path / "fusesoc.conf").write_text(conf)
    variables = {"PYTHONPATH": str(REPOSITORY), "FUSESOC_FIRM_CACHE": str(tmp_path / "store")}
    command = [sys.executable, "-m", "fusesoc_firm.cli", "build", "--setup", "me:x:core", "--target", "default"]
    subprocess.run(command, cwd=tmp_path, env={**os.environ, **variables}, check=True, capture_output=True)
    # A call without a note of its own leaves a second one.
    assert len([*(tmp_path / "store").rglob("*.call")]) == len(MESSAGES)
