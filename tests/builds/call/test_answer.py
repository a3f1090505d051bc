"""FuseSoC's calls: requests are read and checked, and cores are written whole, once, and identically every time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.builds.call.answer import main
from fusesoc_firm.builds.call.generators import GENERATORS, Generator
from fusesoc_firm.builds.call.parameters import Parameter
from fusesoc_firm.core.request import GeneratedCore, GeneratedFile, LoadedRequest, Request
from fusesoc_firm.text.diagnostics import fail

CORE = """\
CAPI=2:
name: me:robots:arm:1.0
generate:
  other:
    generator: echo
  system:
    generator: echo
    parameters:
{parameters}
"""


class Echo:
    """A generator that writes its input into a file, and counts its calls."""

    def __init__(self) -> None:
        self.calls = 0

    def load(self, request: Request) -> LoadedRequest:
        path = request.files_root / str(request.parameters["file"] or request.parameters["spec"])
        return LoadedRequest(request, [path], lambda: self.generate(request, path), list)

    def generate(self, request: Request, path: Path) -> GeneratedCore:
        self.calls += 1
        if not path.exists():
            fail(f"no file {path.name}")
        text = f"{path.read_text()} at {request.parameters['width']}"
        return GeneratedCore(
            "An echo",
            {
                "rtl/b.vhd": GeneratedFile(text, "vhdlSource-93", logical_name="echo"),
                "a.bin": GeneratedFile(b"\0\xff", "user", copyto="stimuli.bin", tags=("simulation",)),
            },
        )


class Bench:
    """A project folder, a working folder, and calls as FuseSoC makes them."""

    def __init__(self, folder: Path) -> None:
        self.echo = Echo()
        self.programs: list[str] = []
        self.project = folder / "project"
        self.work = folder / "work"
        self.project.mkdir()
        self.work.mkdir()
        (self.project / "spec.yaml").write_text("hello")

    def run(self, **parameters: object) -> int:
        lines = yaml.safe_dump(parameters).splitlines()
        (self.project / "arm.core").write_text(CORE.format(parameters="\n".join(f"      {line}" for line in lines)))
        for path in self.work.iterdir():
            if path.is_file():
                path.unlink()
        call = {"gapi": "1.0", "files_root": str(self.project), "vlnv": "me:robots:arm-system:1.0"}
        (self.work / "system_input.yml").write_text(yaml.safe_dump(call | {"parameters": parameters}))
        known = (
            Parameter("spec", "str", "a path", is_required=True),
            Parameter("width", "int", "bits", 8, choices=(8, 16)),
            Parameter("seed", "int", "a seed", 1, bounds=(1, 99)),
            Parameter("word", "str", "a word", rule=("lower case", str.islower)),
            Parameter("paths", "list", "folders"),
            Parameter("file", "str", "a file that says it all", replaces=("spec", "width")),
        )
        generator = Generator(known, self.echo.load, lambda _: self.programs)
        return main("echo", ["system_input.yml"], {"echo": generator})


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    bench = Bench(tmp_path)
    monkeypatch.chdir(bench.work)
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "store"))
    return bench


def test_a_core_is_written(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert bench.run(spec="spec.yaml", width=16) == 0
    assert (bench.work / "rtl" / "b.vhd").read_text() == "hello at 16"
    assert (bench.work / "a.bin").read_bytes() == b"\0\xff"
    text = (bench.work / "arm-system.core").read_text()
    assert text.startswith("CAPI=2:\n")
    assert yaml.safe_load(text.removeprefix("CAPI=2:\n")) == {
        "name": "me:robots:arm-system:1.0",
        "description": "An echo",
        "filesets": {
            "generated": {
                "files": [
                    {"rtl/b.vhd": {"file_type": "vhdlSource-93", "logical_name": "echo"}},
                    {"a.bin": {"file_type": "user", "copyto": "stimuli.bin", "tags": ["simulation"]}},
                ]
            }
        },
        "targets": {"default": {"filesets": ["generated"]}},
    }
    assert capsys.readouterr().out.startswith("echo: arm-system generated in ")


def test_nothing_is_generated_twice(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    bench.run(spec="spec.yaml")
    first = {path.name: path.read_bytes() for path in bench.work.glob("**/*") if path.is_file()}
    bench.run(spec="spec.yaml")
    assert {path.name: path.read_bytes() for path in bench.work.glob("**/*") if path.is_file()} == first
    assert bench.echo.calls == 1
    assert capsys.readouterr().out.splitlines()[1].startswith("echo: arm-system from store in ")


def test_a_changed_input_or_parameter_is_generated(bench: Bench) -> None:
    bench.run(spec="spec.yaml")
    (bench.project / "spec.yaml").write_text("changed")
    bench.run(spec="spec.yaml")
    assert (bench.work / "rtl" / "b.vhd").read_text() == "changed at 8"
    bench.run(spec="spec.yaml", width=16)
    assert (bench.work / "rtl" / "b.vhd").read_text() == "changed at 16"
    assert bench.echo.calls == 3


def test_a_copy_of_the_project_elsewhere_shares_what_is_stored(bench: Bench) -> None:
    bench.run(spec="spec.yaml")
    bench.project = bench.project.rename(bench.project.with_name("moved"))
    bench.run(spec="spec.yaml")
    assert bench.echo.calls == 1


def test_the_core_is_written_last(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []

    def note(path: str, content: bytes) -> bool:
        written.append(path)
        return True

    monkeypatch.setattr("fusesoc_firm.builds.call.fusesoc_run.write_if_changed", note)
    bench.run(spec="spec.yaml")
    bench.run(spec="spec.yaml")
    assert written == ["rtl/b.vhd", "a.bin", "arm-system.core"] * 2


def test_a_full_disk_is_a_fault_and_leaves_no_core(
    bench: Bench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[str] = []

    def fill(path: str, content: bytes) -> bool:
        if written:
            raise OSError(28, "No space left on device")
        written.append(path)
        return True

    monkeypatch.setattr("fusesoc_firm.builds.call.fusesoc_run.write_if_changed", fill)
    assert bench.run(spec="spec.yaml") == 1
    assert capsys.readouterr().err == f"error: cannot write {bench.work / 'a.bin'}: No space left on device\n"
    assert not list(bench.work.glob("*.core"))


def test_ctrl_c_leaves_no_core_and_is_not_remembered(
    bench: Bench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> GeneratedCore:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(bench.echo, "generate", interrupt)
        assert bench.run(spec="spec.yaml") == 130
    assert capsys.readouterr().err == "interrupted\n"
    assert not list(bench.work.glob("*.core"))
    assert bench.run(spec="spec.yaml") == 0
    assert bench.echo.calls == 1


def test_an_input_that_is_edited_while_it_is_read_is_read_again(bench: Bench) -> None:
    generate = bench.echo.generate

    def edit(request: Request, path: Path) -> GeneratedCore:
        path.write_text("edited")
        return generate(request, path)

    bench.echo.generate = edit  # type: ignore[method-assign]
    bench.run(spec="spec.yaml")
    (bench.project / "spec.yaml").write_text("hello")
    bench.echo.generate = generate  # type: ignore[method-assign]
    bench.run(spec="spec.yaml")
    assert (bench.work / "rtl" / "b.vhd").read_text() == "hello at 8"


def test_a_fault_of_the_input_is_printed_without_traceback(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert bench.run(spec="nothing.yaml") == 1
    assert capsys.readouterr().err == "error: no file nothing.yaml\n"
    assert not list(bench.work.glob("*.core"))
    # The file is checked again; the failure is not cached.
    (bench.project / "nothing.yaml").write_text("now")
    assert bench.run(spec="nothing.yaml") == 0


@pytest.mark.parametrize(
    ("parameters", "line", "message"),
    [
        ({"spce": "a", "spec": "b"}, 9, "9:7: error: unknown parameter 'spce'\n"),
        ({"spec": 3}, 9, "9:13: error: parameter 'spec' is 3, but must be a string\n"),
        ({"width": "8", "spec": "b"}, 10, "10:14: error: parameter 'width' is '8', but must be an integer\n"),
        ({"width": True, "spec": "b"}, 10, "10:14: error: parameter 'width' is True, but must be an integer\n"),
        ({"width": 12, "spec": "b"}, 10, "10:14: error: parameter 'width' is 12, but must be one of 8, 16\n"),
        ({"spec": "b", "word": "B"}, 10, "10:13: error: parameter 'word' is 'B', but must be lower case\n"),
        ({"seed": 0, "spec": "b"}, 9, "9:13: error: parameter 'seed' is 0, but must be 1 to 99\n"),
        ({"paths": "a", "spec": "b"}, 9, "9:14: error: parameter 'paths' is 'a', but must be a list of strings\n"),
        ({"paths": [1], "spec": "b"}, 10, "10:7: error: parameter 'paths' is [1], but must be a list of strings\n"),
        ({"width": 8}, 6, "6:3: error: parameter 'spec' is missing: a path\n"),
        ({"file": "a", "spec": "b"}, 10, "10:7: error: parameter 'spec' cannot be combined with 'file'\n"),
    ],
)
def test_a_fault_in_a_parameter_is_shown_in_the_core(
    bench: Bench, capsys: pytest.CaptureFixture[str], parameters: dict[str, object], line: int, message: str
) -> None:
    assert bench.run(**parameters) == 1
    core = bench.project / "arm.core"
    error = capsys.readouterr().err
    assert error.startswith(f"{core}:{message}")
    assert f"{line:5d} | {core.read_text().splitlines()[line - 1]}\n" in error


@pytest.mark.parametrize(
    ("override", "place", "message"),
    [
        ({"width": 9}, "width: 9", "parameter 'width' is 9, but must be one of 8, 16"),
        ({"widht": 8}, "widht: 8", "unknown parameter 'widht'"),
        ({"paths": [1]}, "paths: [1]", "parameter 'paths' is [1], but must be a list of strings"),
    ],
)
def test_a_fault_in_a_targets_override_is_shown_there(
    bench: Bench, capsys: pytest.CaptureFixture[str], override: dict[str, object], place: str, message: str
) -> None:
    assert bench.run(spec="spec.yaml", width=16, paths=["a"]) == 0
    core = bench.project / "arm.core"
    text = "targets:\n  one: {generate: [system]}\n  two: {generate: [other, {system: {width: 8, seed: 2}}]}\n"
    text += f"  three: {{generate: [system: {{{place}}}]}}\n"
    core.write_text(core.read_text().partition("targets:")[0] + text)
    call = yaml.safe_load((bench.work / "system_input.yml").read_text())
    call["parameters"] |= override
    (bench.work / "system_input.yml").write_text(yaml.safe_dump(call))
    known = (
        Parameter("spec", "str", "a path"),
        Parameter("width", "int", "bits", 8, choices=(8, 16)),
        Parameter("paths", "list", "folders"),
    )
    assert main("echo", ["system_input.yml"], {"echo": Generator(known, bench.echo.load)}) == 1
    column = text.splitlines()[3].index(place) + (1 if "unknown" in message else len(place.partition(" ")[0]) + 2)
    line = len(core.read_text().splitlines())
    assert capsys.readouterr().err.startswith(f"{core}:{line}:{column}: error: {message}")


def test_one_parameter_stands_in_for_others(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert bench.run(width=8) == 1
    assert capsys.readouterr().err.endswith("      = alternatively, set 'file'\n")
    assert bench.run(file="spec.yaml", width=16) == 1
    assert "parameter 'width' cannot be combined with 'file'" in capsys.readouterr().err
    assert bench.run(file="spec.yaml") == 0


def test_all_faults_come_at_once(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert bench.run(widht=8, seed=100) == 1
    error = capsys.readouterr().err
    assert "did you mean 'width'?" in error
    assert error.count(": error: ") == 3


@pytest.mark.parametrize("text", ["", "CAPI=2:\nname: [\n", "CAPI=2:\nname: me:robots:leg:1\n", "[]"])
def test_without_the_core_a_fault_has_no_place(bench: Bench, capsys: pytest.CaptureFixture[str], text: str) -> None:
    (bench.project / "arm.core").write_text(text)
    call: dict[str, Any] = {
        "files_root": str(bench.project),
        "vlnv": "me:robots:arm-system:1.0",
        "parameters": {"x": 1},
    }
    (bench.work / "call.yml").write_text(yaml.safe_dump(call))
    assert main("echo", ["call.yml"], {"echo": Generator((), bench.echo.load)}) == 1
    assert capsys.readouterr().err == "error: unknown parameter 'x'\n"


@pytest.mark.parametrize("arguments", [[], ["nothing.yml"], ["a", "b"]])
def test_a_call_that_is_not_fusesocs_says_so(
    bench: Bench, capsys: pytest.CaptureFixture[str], arguments: list[str]
) -> None:
    assert main("far", arguments) == 1
    assert capsys.readouterr().err.startswith("error: ")


@pytest.mark.parametrize("command", GENERATORS)
def test_the_usage_text_lists_just_the_parameters(command: str) -> None:
    cores = (Path(__file__).resolve().parents[3] / "generators").glob("*.core")
    generators = [yaml.safe_load(path.read_text()).get("generators", {}) for path in cores]
    (usage,) = (item[command]["usage"] for item in generators if command in item)
    listed = usage.partition("Parameters:\n")[2].splitlines()
    assert [line.strip() for line in listed] == [parameter.usage() for parameter in GENERATORS[command].parameters]


def test_a_program_that_is_missing_is_named_with_its_package(
    bench: Bench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    far = GENERATORS["far"].programs
    found = {
        simulator: far(Request("far", "a:b:c:1", tmp_path, {"product": "simulation", "simulator": simulator}))
        for simulator in ("ghdl", "icarus", "verilator", "nvc")
    }
    assert found == {
        "ghdl": ["ghdl"],
        "icarus": ["ghdl", "iverilog"],
        "verilator": ["ghdl", "verilator", "g++", "make"],
        # It has no package.
        "nvc": [],
    }
    assert far(Request("far", "a:b:c:1", tmp_path, {"product": "system", "simulator": "icarus"})) == []
    bench.programs = ["iverilog"]
    assert bench.run(spec="spec.yaml") == 0
    output = capsys.readouterr().out
    assert "echo: error: missing programs: iverilog" in output
    assert "apt-get install --no-install-recommends iverilog" in output
