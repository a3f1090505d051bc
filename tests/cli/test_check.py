"""What `firm check` and `firm sim` say, before anything is built, about mistakes in the files of a project."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from fusesoc_firm.builds.setup.libraries import check_locations
from fusesoc_firm.cli import main
from fusesoc_firm.cli.check import check_all
from fusesoc_firm.node.transport.built_simulator import _fail_for_units
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.text.diagnostics import InputError
from tests.cli.tilt import begin_tilt

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> Path:
    """A project in the current folder."""
    return begin_tilt(tmp_path, monkeypatch, capsys)


def edit(file: str, old: str, new: str) -> None:
    path = Path(file)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def faults(capsys: Captured, *words: str) -> str:
    assert main(words) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err


def test_a_sound_project_is_valid(capsys: Captured) -> None:
    for words in (["check"], ["check", "tilt.yaml"], ["check", "../tilt"], ["system", "check"]):
        assert main(words) == 0
        out = capsys.readouterr()
        assert out.out.endswith("tilt.yaml: tilt is valid: 1 subscriber, 1 accelerator, 1 publisher\n")
        assert out.err == ""


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (
            "model.py",
            "def respond(",
            "def response(",
            "model.py:4:1: error: model.py has no function 'respond(subscriber, message)'",
        ),
        ("model.py", '"pub"', '"pubb"', "model.py:11:14: error: 'respond' returns a message for 'pubb'"),
        ("model.py", '"z": ', '"w": ', "model.py:11:13: error: 'respond' returns an invalid message for 'pub'"),
        ("model.py", "def ", "import nowhere\n\ndef ", "model.py:4:1: error: the model imports"),
        ("stimuli.yaml", "sub", "sbu", "stimuli.yaml:1:3: error: 'sbu' is not a subscriber"),
        ("stimuli.yaml", "x:", "xx:", "stimuli.yaml:1:9: error: a geometry_msgs/Point has no field 'xx'"),
        ("tilt.core", "stimuli.yaml", "stimli.yaml", "tilt.core:19:61: error: the stimuli stimli.yaml do not exist"),
        ("tilt.core", "model.py", "modle.py", "tilt.core:19:82: error: there is no model at modle.py"),
        ("tilt.core", "product: simulation", "produkt: simulation", "tilt.core:19:31: error: unknown parameter"),
        ("tilt.core", "tilt.yaml", "tlit.yaml", "tilt.core:16:32: error: there is no specification tlit.yaml"),
        ("tilt.core", "CAPI=2:\n", "", "tilt.core:1:1: error: the first line of a core must be 'CAPI=2:'"),
        ("tilt.core", "filesets:\n", "filset:\n", "tilt.core:6:1: error: a core has no key 'filset'"),
        ("tilt.core", "    depend:\n", "    depends:\n", "tilt.core:8:5: error: 'filesets.base' has no key 'depends'"),
        ("tilt.core", "targets:\n", "targets: []\nx:\n", "tilt.core:"),
        ("tilt.core", "name: robot:sys:tilt:0.1.0\n", "", "tilt.core:1:1: error: a core needs the key 'name'"),
        ("tilt.core", "robot:sys:tilt:0.1.0", "robot:sys:ti lt:0.1.0", "tilt.core:3:7: error: Illegal character"),
        ("tilt.core", "[system, simulation]", "[system, simulatoin]", "tilt.core:"),
        ("tilt.core", "filesets: [base]", "filesets: [bse]", "tilt.core:"),
        ("tilt.core", "robot:acc:firm_float", "robot:acc:firm_flaot", "tilt.core:10:9: error: unknown core"),
        (
            "tilt.core",
            "      - robot:acc:firm_float\n",
            "      - robot:acc:firm_float\n    files: [pins.txt: {file_type: user}]\n",
            "tilt.core:11:13: error: there is no file pins.txt",
        ),
        ("tilt.core", "toplevel: tilt_system_tb", "toplevel: tilt_sytem_tb", "tilt.core:27:15: error: no target has"),
        ("tilt.core", "      - robot:firm:firm_system\n", "", "tilt.core:13:16: error: no core of this build has"),
        ("tilt.yaml", "project:\n", "project:\n  paths: [msgs]\n", "tilt.yaml:3:3: error: 'project' has no key"),
        ("tilt.yaml", "  name: tilt", "  name:tilt", "tilt.yaml:3:3: error: 'project' must be a mapping"),
        ("tilt.yaml", "rtl/tilt.vhd", "rtl/", "tilt.yaml:7:14: error: 'sources' must be a file, not the folder"),
        ("model.py", '[("pub", answer)]', "answer", "model.py:11:12: error: 'respond' returns {'x': message['x'],"),
        ("model.py", "return ", "", "model.py:4:1: error: 'respond' returns nothing"),
    ],
    ids=lambda text: re.sub(r"\W+", " ", text)[:20],
)
def test_a_mistake_is_reported_with_its_place(file: str, old: str, new: str, message: str, capsys: Captured) -> None:
    edit(file, old, new)
    found = faults(capsys, "check")
    assert found.startswith(message)
    assert found.count("error: ") == 1


def test_a_simulation_begins_with_the_same_check(capsys: Captured) -> None:
    edit("model.py", "def respond(", "def response(")
    edit("stimuli.yaml", "x:", "xx:")
    found = faults(capsys, "check")
    assert re.findall(r"^(\S+): error: ", found, re.MULTILINE) == ["model.py:4:1", "stimuli.yaml:1:9"]
    assert faults(capsys, "sim") == found
    with pytest.raises(SystemExit, match="1"):
        main(["check", "--json"])
    diagnostics = json.loads(capsys.readouterr().out)["diagnostics"]
    assert [(item["file"], item["line"]) for item in diagnostics] == [("model.py", 4), ("stimuli.yaml", 1)]
    assert not [*Path().glob("build/*/sim.log")]


def test_a_check_reads_python_and_a_simulation_runs_it(capsys: Captured) -> None:
    edit("model.py", "    answer = ", "    print(message)\n    answer = ")
    edit("model.py", 'message["z"]', 'message["zz"]')
    assert main(["check", "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {"valid": True, "diagnostics": []}
    assert captured.err == ""
    found = faults(capsys, "sim")
    assert "model.py:10:14: error: the model raised KeyError for message 0 to 'sub': 'zz'" in found
    assert found.count("{'x': ") == 1


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("filesets:\n", "filset:\n", "did you mean 'filesets'?"),
        ("robot:acc:firm_float", "robot:acc:firm_flaot", "did you mean 'robot:acc:firm_float'?"),
        ("spec: tilt.yaml", "spec: tlit.yaml", "did you mean 'tilt.yaml'?"),
        ("generate: [system, simulation],", "generate: [sytem, simulation],", "did you mean 'system'?"),
        ("      - robot:firm:firm_system\n", "", "add 'robot:firm:firm_system' to 'depend' of a fileset"),
        ("toplevel: tilt_system_tb", "toplevel: tilt_sytem_tb", "did you mean 'tilt_system_tb'?"),
    ],
)
def test_a_fault_in_the_core_ends_every_command_with_its_cure(old: str, new: str, hint: str, capsys: Captured) -> None:
    """FuseSoC ignores such a file, and then knows no core of its name."""
    edit("tilt.core", old, new)
    for words in (["check"], ["sim"], ["bitstream", "--board", "icebreaker"]):
        assert hint in faults(capsys, *words)


@pytest.mark.parametrize(
    ("file", "old", "new", "hint"),
    [
        ("tilt.yaml", "project:\n", "project:\n  paths: [msgs]\n", "it is a key of the top level"),
        ("tilt.core", "depend:\n      - robot:firm:firm_system\n      -", "depend:", "write [robot:acc:firm_float]"),
        ("tilt.yaml", "project:\n", "project:\n  sources: x\n", "it is a key of an item of 'accelerators'"),
        ("tilt.yaml", "  name: tilt", "  name:tilt", "write a blank after the colon: 'name: tilt'"),
        ("tilt.yaml", "rtl/tilt.vhd", "rtl", "it is a folder; its files: tilt.vhd"),
        ("stimuli.yaml", "{x: 0.5, y: 1.0, z: 1.5}", "[0.5, 1.0, 1.5]", "write {x: 0.5, y: 1.0, z: 1.5}"),
        ("stimuli.yaml", "x: 0.5", "x: 0,5", "a decimal number has a point: 0.5"),
        ("stimuli.yaml", "x: 0.5", "x: [0.5] * 3", "YAML does not calculate: write the values themselves"),
        ("stimuli.yaml", "x: 0.5", "x: 1/2", "legal here: numbers such as 1, -0.5, 1e-3, .inf, .nan; YAML does not"),
    ],
)
def test_a_mistake_has_its_cure(file: str, old: str, new: str, hint: str, capsys: Captured) -> None:
    edit(file, old, new)
    assert f"      = {hint}" in faults(capsys, "check")


def test_a_fileset_without_a_target_is_a_warning(capsys: Captured) -> None:
    edit("tilt.core", "generate:\n", "  mine:\n    files: [rtl/tilt.vhd]\n\ngenerate:\n")
    assert main(["check"]) == 0
    assert capsys.readouterr().err.startswith("tilt.core:12:3: warning: no target uses the fileset 'mine'\n")


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["check", "tilt.yml"], "did you mean 'tilt.yaml'?"),
        (["check", "tlit.yaml"], "did you mean 'tilt.yaml'?"),
        (["why", "tilt.vhd:3"], "did you mean 'rtl/tilt.vhd'?"),
        (["graph", "robot:sys:tlit"], "did you mean 'robot:sys:tilt'? 'fusesoc core list' lists all cores"),
        (["graph", "abcde"], "cores here: robot:sys:tilt; 'fusesoc core list' lists all cores"),
        (["message", "list", "geomtry_msgs"], "did you mean 'geometry_msgs/*'?"),
        (["message", "list", "geometry_msgs/Pont"], "did you mean 'geometry_msgs/Point'?"),
    ],
)
def test_a_misspelt_argument_has_its_nearest(words: list[str], hint: str, capsys: Captured) -> None:
    assert f"      = {hint}\n" in faults(capsys, *words)


def test_stimuli_that_are_missing_are_not_taken_for_the_specification(capsys: Captured) -> None:
    Path("stimuli.yaml").rename("stimul.yaml")
    assert "did you mean 'stimul.yaml'?" in faults(capsys, "check")
    Path("stimul.yaml").unlink()
    assert "= legal here: a bag, or a YAML file with a list of messages" in faults(capsys, "check")


def test_a_specification_in_another_folder_is_found(capsys: Captured) -> None:
    Path("specs").mkdir()
    Path("tilt.yaml").rename("specs/tilt.yaml")
    assert "= did you mean 'specs/tilt.yaml'?" in faults(capsys, "check")


@pytest.mark.parametrize("words", [["check", "rtl/tilt.vhd"], ["check", "tilt.core"], ["system", "show", "model.py"]])
def test_a_file_of_another_kind_is_not_a_specification(words: list[str], capsys: Captured) -> None:
    found = faults(capsys, *words)
    assert found.startswith(f"error: {words[-1]} is not a specification\n")
    assert ("= name tilt.yaml" in found) == ("rtl" not in words[-1])


def test_a_source_is_not_simulated(capsys: Captured) -> None:
    assert faults(capsys, "sim", "rtl/tilt.vhd") == (
        "error: rtl/tilt.vhd is neither a specification (.yaml) nor a core (.core)\n"
        "      = omit it, or name one of these\n"
    )


def test_only_the_first_of_many_messages_are_answered(capsys: Captured) -> None:
    Path("stimuli.yaml").write_text("- sub: {x: 0.0}\n" * 101)
    edit("model.py", "    answer = ", "    print(message)\n    answer = ")
    spec = Path("tilt.yaml")
    check_all(load_beside(spec), spec, may_run=True)
    assert capsys.readouterr().err.count("{'x': ") == 100


def test_the_functions_of_software_are_read(capsys: Captured) -> None:
    edit("tilt.yaml", "type: VHDL\n    sources: rtl/tilt.vhd", "type: ROS-SW\n    sources: tilt.py")
    Path("tilt.py").write_text("def tlit(message):\n    return message\n")
    found = faults(capsys, "check")
    assert "error: 'tilt.py' has no function 'tilt'" in found
    assert "= rename 'tlit' to 'tilt'; expected: def tilt(message)" in found


def test_a_specification_without_a_core_is_checked_alone(capsys: Captured) -> None:
    Path("tilt.core").unlink()
    Path("stimuli.yaml").unlink()
    assert main(["check"]) == 0
    assert "tilt is valid" in capsys.readouterr().out


def test_a_renamed_specification_is_found_in_the_core(capsys: Captured) -> None:
    Path("tilt.yaml").rename("tilts.yaml")
    found = faults(capsys, "check")
    assert found.startswith("tilt.core:16:32: error: there is no specification tilt.yaml\n")
    assert "= did you mean 'tilts.yaml'?" in found
    for words in (["check", "tilts.yaml"], ["sim"], ["sim", "tilts.yaml"]):
        assert faults(capsys, *words) == found


def test_a_library_on_another_machine_is_found_in_the_configuration(capsys: Captured) -> None:
    path = Path("fusesoc.conf")
    text = re.sub(r"(?<=location = ).+", "/other/library", path.read_text(encoding="utf-8"), count=1)
    path.write_text(text, encoding="utf-8")
    line = text[: text.index("/other")].count("\n") + 1
    for words in (["check"], ["sim"], ["build", "robot:sys:tilt", "--target", "sim"]):
        assert faults(capsys, *words).startswith(
            f"fusesoc.conf:{line}:12: error: library 'firm' is in /other/library, which does not exist"
        )
    path.write_text(f"{text}sync-uri = x\n".replace("/other/library", "."), encoding="utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace("location = .\nsync", "location = none\nsync"))
    check_locations()


def test_a_link_to_the_library_is_renewed_in_a_copy(capsys: Captured) -> None:
    link = Path(".firm/library")
    link.unlink()
    link.symlink_to("/other/library")
    assert main(["check"]) == 0
    assert capsys.readouterr().err == ""


def test_a_missing_port_has_no_consequences(capsys: Captured) -> None:
    edit("rtl/tilt.vhd", "    in_x  ", "    -- in_x  ")
    edit("rtl/tilt.vhd", "out_y <= in_y", "out_y <= in_x")
    edit("rtl/tilt.vhd", "out_z <= in_z", "out_z <= in_w")
    found = faults(capsys, "check")
    assert re.findall(r"error: (.*)", found) == [
        "entity 'tilt' has no port 'in_x' for geometry_msgs/Point.x",
        'no declaration for "in_w"',
    ]


def test_the_folder_above_a_project_names_the_way(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir("..")
    assert faults(capsys, "check") == (
        "error: which system? This folder has no specification of a system\n"
        "      = name a specification, or run 'cd tilt'\n"
    )
    monkeypatch.chdir("tilt/rtl")
    assert "or run 'cd ..'" in faults(capsys, "check")
    monkeypatch.chdir("../..")
    assert faults(capsys, "check", "tilt/tlt.yaml") == (
        "error: cannot read tilt/tlt.yaml: No such file or directory\n      = did you mean 'tilt.yaml'?\n"
    )


def test_a_renamed_specification_without_a_core_names_the_cores_to_depend_on() -> None:
    output = 'a.vhd:7:9: unit "firm_cordic_vectoring" not found in library "firm"\nb.vhd:2:9: unit "mine" not found in'
    with pytest.raises(InputError) as raised:
        _fail_for_units(Path("tilts.yaml"), f'{output} library "firm"\n')
    assert str(raised.value) == (
        "error: the accelerators of tilts.yaml use units of other cores: firm_cordic_vectoring, mine\n"
        "      = write a core that depends on these: firm system core tilts.yaml --depend robot:acc:firm_cordic"
    )
    _fail_for_units(Path("tilts.yaml"), "another fault")
