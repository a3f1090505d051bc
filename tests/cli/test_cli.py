"""The command `firm`, as a person calls it."""

from __future__ import annotations

import argparse
import io
import json
import os
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from fusesoc_firm import cli
from fusesoc_firm.cli import main
from fusesoc_firm.converter.stages import STAGES
from fusesoc_firm.tools.library_path import demos_root, library_root

ROOT = Path(__file__).resolve().parents[2]
SPEC = ROOT / "specs" / "quat2euler" / "quat2euler.yaml"

Captured = pytest.CaptureFixture[str]


def out(capsys: Captured, *arguments: str) -> str:
    assert main(arguments) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out


def error(capsys: Captured, *arguments: str) -> str:
    assert main(arguments) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    return captured.err


def test_path_is_the_library(capsys: Captured) -> None:
    assert Path(out(capsys, "path").strip()) == library_root()
    assert (library_root() / "generators" / "generators.core").is_file()
    demos = Path(out(capsys, "path", "--demos").strip())
    assert demos == demos_root()
    assert (demos / "obstacle" / "obstacle.core").is_file()


@pytest.mark.parametrize("option", [[], ["--demos"]])
def test_a_relative_path_leads_to_the_same_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured, option: list[str]
) -> None:
    absolute = Path(out(capsys, "path", *option).strip())
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "link").symlink_to("a/b")
    monkeypatch.chdir(tmp_path / "link")
    path = Path(out(capsys, "path", "--relative", *option).strip())
    assert not path.is_absolute()
    assert (tmp_path / "a" / "b" / path).resolve() == absolute.resolve()


@pytest.mark.parametrize(
    "command",
    [
        [],
        ["init"],
        ["check"],
        ["bitstream"],
        ["load"],
        ["sim"],
        ["help"],
        ["completion"],
        ["path"],
        ["message"],
        ["message", "list"],
        ["message", "show"],
        ["message", "verify"],
        ["system"],
        ["system", "new"],
        ["system", "check"],
        ["system", "show"],
        ["system", "skeleton"],
        ["system", "diagram"],
        ["system", "report"],
        ["system", "schema"],
        ["scheduler"],
        ["scheduler", "bench"],
        ["scheduler", "choose"],
        ["accelerator"],
        ["accelerator", "report"],
        ["accelerator", "explore"],
        ["replay"],
        ["live"],
        ["trace"],
        ["graph"],
        ["affected"],
        ["why"],
        ["lock"],
        ["cache"],
        ["cache", "show"],
        ["cache", "clean"],
        ["cache", "verify"],
    ],
    ids=" ".join,
)
def test_every_command_has_help_with_an_example(command: list[str], capsys: Captured) -> None:
    with pytest.raises(SystemExit, match="0"):
        main([*command, "--help"])
    text = capsys.readouterr().out
    assert text.startswith("usage: firm")
    assert not command or "example: " in text


def test_the_first_screen_has_the_commands_of_the_first_hour(capsys: Captured) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    text = capsys.readouterr().out
    first = [name for names in cli.GROUPS.values() for name in names]
    assert re.findall(r"^  (\w+)  ", text, re.MULTILINE) == first
    assert len(first) <= 10 and first[:3] == ["init", "check", "sim"]
    with pytest.raises(SystemExit, match="2"):
        main([])
    assert capsys.readouterr().err == text


def test_help_describes_every_command(capsys: Captured) -> None:
    listed = re.findall(r"^  (\S+)  ", out(capsys, "help", "--all"), re.MULTILINE)
    assert sorted(listed) == sorted(cli._MODULES)
    for words in ([], ["sim"], ["system", "show"], ["run"]):
        with pytest.raises(SystemExit, match="0"):
            main(["help", *words])
        text = capsys.readouterr().out
        with pytest.raises(SystemExit, match="0"):
            main([*words, "--help"])
        assert capsys.readouterr().out == text


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["chek"], "did you mean 'firm check'?"),
        (["simulat"], "did you mean 'firm sim'?"),
        (["validate"], "did you mean 'firm check'?"),
        (["valdate"], "did you mean 'firm check'?"),
        (["synth"], "did you mean 'firm bitstream'?"),
        (["flash"], "did you mean 'firm load --flash'?"),
        (["boards"], "did you mean 'firm bitstream'?"),
        (["generate"], "did you mean 'firm init NAME' or 'firm system core SPEC'?"),
        (["serve"], "did you mean 'firm cache serve' or 'firm studio'?"),
        (["upgrade"], "did you mean 'firm system core SPEC'?"),
        (["run", "robot", "node", "--ros-args", "-r", "a:=b"], "'--ros-args' is an option of 'firm live', which"),
        (["deploy"], "did you mean 'firm load'?"),
        (["node"], "did you mean 'firm system node' or 'firm live'?"),
        (["waves"], "did you mean 'firm sim --waves'?"),
        (["VERIFY"], "did you mean 'firm message verify' or 'firm cache verify' or 'firm check'?"),
        (["skeleton", "robot.yaml"], "did you mean 'firm system skeleton'?"),
        (["frobnicate"], "start:\n  init "),
        (["waveform"], "did you mean 'firm sim --waves'?"),
        (["compare"], "did you mean 'firm sim' or 'firm message verify'?"),
        (["monitor"], "did you mean 'firm live --watch'?"),
        (["sim", "--tol", "ghdl"], "unrecognized arguments: --tol; did you mean '--tool'?"),
        (["sim", "--tool", "verilatr"], "invalid choice: 'verilatr'; did you mean 'verilator'?"),
        (["live", "--trce", "x"], "did you mean '--trace'?"),
        (["system", "chek"], "invalid choice: 'chek'; did you mean 'check'?"),
        (["message", "show", "a/B", "--ros", "3"], "invalid choice: '3'; legal here: 1, 2"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_misspelt_word_gets_its_nearest(words: list[str], hint: str, capsys: Captured) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(words)
    assert hint in capsys.readouterr().err


def test_other_names_are_the_same_commands() -> None:
    commands = cli.parser_of(cli._MODULES).commands()
    assert all(commands[alias] is commands[name] for alias, name in cli.ALIASES.items())


def test_a_command_is_declared_by_the_module_that_is_loaded_for_it() -> None:
    for module in dict.fromkeys(cli._MODULES.values()):
        commands = argparse.ArgumentParser().add_subparsers()
        getattr(import_module(f"fusesoc_firm.cli.{module}"), f"add_{module}")(commands)
        assert [*commands.choices] == [name for name, other in cli._MODULES.items() if other == module]


def test_a_command_loads_no_other_command() -> None:
    """All modules together take longer than a build that is recalled."""
    program = "import sys; from fusesoc_firm.cli import main; main(['path']); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    _, modules = done.stdout.splitlines()
    loaded = {name for name in modules.split() if name.startswith("fusesoc_firm.cli.")}
    assert loaded == {"fusesoc_firm.cli.path", "fusesoc_firm.cli.common"}
    assert not {"yaml", "numpy", "rosbags", "fusesoc"} & {*modules.split()}


@pytest.mark.parametrize(
    ("line", "words"),
    [("firm ini", ["init"]), ("firm sim --tool ver", ["verilator"]), ("firm run --tool ver", ["verilator"])],
)
def test_a_shell_completes(tmp_path: Path, line: str, words: list[str]) -> None:
    answer = tmp_path / "answer"
    environment = os.environ | {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
    }
    subprocess.run([sys.executable, "-m", "fusesoc_firm.cli"], env=environment, check=True)
    assert [word.strip() for word in answer.read_text().splitlines()] == words


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_code_of_a_shell(shell: str, capsys: Captured) -> None:
    assert "_ARGCOMPLETE" in out(capsys, "completion", shell)


@pytest.mark.parametrize("arguments", [[], ["massage"], ["message", "show"], ["message", "show", "a/B", "--ros", "3"]])
def test_a_wrong_command_line_ends_with_2(arguments: list[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments)


def test_the_tree_tells_type_bits_and_offset(capsys: Captured) -> None:
    lines = out(capsys, "message", "show", "geometry_msgs/Pose").splitlines()
    assert lines[0].split() == ["field", "type", "bits", "offset"]
    assert lines[1].split() == ["geometry_msgs/Pose", "ROS", "2", "480", "0"]
    assert lines[2].split() == ["position", "geometry_msgs/Point", "192", "4"]
    assert lines[-1].split() == ["w", "float64", "64", "52"]


def test_the_tree_of_a_message_of_variable_size_has_no_offsets(capsys: Captured) -> None:
    lines = out(capsys, "message", "show", "sensor_msgs/Image", "--ros", "1").splitlines()
    assert lines[1].split() == ["sensor_msgs/Image", "ROS", "1"]
    assert ["data", "uint8[]"] in [line.split() for line in lines]


def test_a_message_in_the_version_that_is_asked_for(capsys: Captured) -> None:
    assert "0020" in out(capsys, "message", "show", "geometry_msgs/Quaternion", "--ros", "1", "--stage", "vhdl")
    assert "0024" in out(capsys, "message", "show", "geometry_msgs/Quaternion", "--ros", "2", "--stage", "vhdl")


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_is_printed(stage: str, capsys: Captured) -> None:
    text = out(capsys, "message", "show", "geometry_msgs/Point", "--stage", stage)
    beginning = {
        "tree": "field",
        "message": "# geometry_msgs/Point (ROS 2)",
        "frame": "message: geometry_msgs/Point",
        "config": "package: geometry_msgs_point_pkg",
        "vhdl": "-- geometry_msgs_point_pkg: ",
    }
    assert text.startswith(beginning[stage])
    if stage in ("frame", "config"):
        assert all(isinstance(document, dict) for document in yaml.safe_load_all(text))


@pytest.mark.parametrize(
    ("ros", "signature"),
    [
        ("1", "4a842b65f413084dc2b10fb484ea7f17"),
        ("2", "RIHS01_6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881"),
    ],
)
def test_a_message_is_printed_with_its_signature(ros: str, signature: str, capsys: Captured) -> None:
    lines = out(capsys, "message", "show", "geometry_msgs/Point", "--ros", ros, "--stage", "message").splitlines()
    assert lines[:3] == [f"# geometry_msgs/Point (ROS {ros})", f"# signature: {signature}", ""]


def test_the_package_and_both_converters_are_printed(capsys: Captured) -> None:
    text = out(capsys, "message", "show", "geometry_msgs/Point", "--stage", "vhdl")
    assert text.count("\nend entity") == 2
    assert text.count("\nend package") == 1
    assert "entity geometry_msgs_point_to_axis is" in text


def test_messages_of_a_folder(tmp_path: Path, capsys: Captured) -> None:
    folder = tmp_path / "my_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Speed.msg").write_text("float32 metres_per_second\n")
    listed = out(capsys, "message", "list", "my_msgs/*", "--path", str(tmp_path))
    assert listed.split() == ["my_msgs/Speed", str(folder / "Speed.msg")]
    assert "metres_per_second" in out(capsys, "message", "show", "my_msgs/Speed", "--path", str(tmp_path))


@pytest.fixture
def interfaces(tmp_path: Path) -> Path:
    """A package with a service and an action."""
    for kind, text in (("srv", "bool data\n---\n"), ("action", "uint8 a\n---\nuint8 b\n---\nuint8 c\n")):
        folder = tmp_path / "my_msgs" / kind
        folder.mkdir(parents=True)
        (folder / f"Set.{kind}").write_text(text)
    return tmp_path


def test_services_and_actions_are_listed_with_their_messages(interfaces: Path, capsys: Captured) -> None:
    listed = out(capsys, "message", "list", "my_msgs/*", "--path", str(interfaces), "--ros", "1")
    package = interfaces / "my_msgs"
    service, action = str(package / "srv" / "Set.srv"), str(package / "action" / "Set.action")
    assert [tuple(line.split()) for line in listed.splitlines()] == [
        ("my_msgs/SetAction", action),
        ("my_msgs/SetActionFeedback", action),
        ("my_msgs/SetActionGoal", action),
        ("my_msgs/SetActionResult", action),
        ("my_msgs/SetFeedback", action),
        ("my_msgs/SetGoal", action),
        ("my_msgs/SetRequest", service),
        ("my_msgs/SetResponse", service),
        ("my_msgs/SetResult", action),
        ("my_msgs/action/Set", action),
        ("my_msgs/srv/Set", service),
    ]


@pytest.mark.parametrize("name", ["my_msgs/Set", "my_msgs/srv/Set"])
def test_a_service_is_printed_with_its_messages(name: str, interfaces: Path, capsys: Captured) -> None:
    arguments = ("message", "show", name, "--path", str(interfaces), "--ros", "1", "--stage")
    assert out(capsys, *arguments, "message") == (
        "# my_msgs/srv/Set (ROS 1)\n"
        "# signature: 8b94c1b53db61fb6aed406028ad6332a\n"
        "\n"
        "# my_msgs/SetRequest (ROS 1)\n"
        "# signature: 8b94c1b53db61fb6aed406028ad6332a\n"
        "\n"
        "bool data\n"
        "\n"
        "# my_msgs/SetResponse (ROS 1)\n"
        "# signature: d41d8cd98f00b204e9800998ecf8427e\n"
    )
    assert [tree.split()[4] for tree in out(capsys, *arguments, "tree").split("\n\n")] == [
        "my_msgs/SetRequest",
        "my_msgs/SetResponse",
    ]
    frames = list(yaml.safe_load_all(out(capsys, *arguments, "frame")))
    assert [frame["message"] for frame in frames] == ["my_msgs/SetRequest", "my_msgs/SetResponse"]
    assert len(list(yaml.safe_load_all(out(capsys, *arguments, "config")))) == 6


def test_an_action_is_printed_with_its_messages(interfaces: Path, capsys: Captured) -> None:
    text = out(capsys, "message", "show", "my_msgs/action/Set", "--path", str(interfaces), "--stage", "message")
    titles = [line for line in text.splitlines() if line.endswith("(ROS 2)")]
    assert titles[:2] == ["# my_msgs/action/Set (ROS 2)", "# my_msgs/Set_Goal (ROS 2)"]
    assert len(titles) == 11
    assert text.count("# signature: RIHS01_") == 11


def test_one_message_of_a_service_is_printed(interfaces: Path, capsys: Captured) -> None:
    for name in ("my_msgs/Set_Request", "my_msgs/srv/Set_Request"):
        text = out(capsys, "message", "show", name, "--path", str(interfaces), "--stage", "message")
        assert text.startswith("# my_msgs/Set_Request (ROS 2)\n")
        assert text.endswith("\n\nbool data\n")


def test_a_service_of_a_distribution_before_hashes_has_no_signature(
    interfaces: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)  # a newer ROS 2 would bring the events along
    arguments = ("message", "show", "my_msgs/srv/Set", "--path", str(interfaces), "--distro", "humble")
    assert out(capsys, *arguments, "--stage", "message").startswith("# my_msgs/srv/Set (ROS 2)\n\n# my_msgs/Set_Req")


def test_a_fault_in_a_message_is_shown_in_its_file(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "my_msgs").mkdir()
    (tmp_path / "my_msgs" / "Speed.msg").write_text("flaot32 speed\n")
    text = error(capsys, "message", "show", "my_msgs/Speed", "--path", str(tmp_path))
    assert text.startswith(f"{tmp_path}/my_msgs/Speed.msg:1:1: error: ")
    assert "float32" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["message", "show", "geometry_msgs/Quaterion"], "did you mean 'geometry_msgs/Quaternion'?"),
        (["message", "show", "Quaternion"], "Quaternion"),
        (
            ["message", "show", "sensor_msgs/Image", "--stage", "vhdl", "--width", "24"],
            "converters do not support 24-bit streams",
        ),
        (["message", "show", "geometry_msgs/Point", "--stage", "config", "--width", "9"], "9-bit"),
        (["message", "list", "--path", "no/such/folder"], "no/such/folder"),
        (["message", "list", "--distro", "jazy"], "did you mean 'jazzy'?"),
        (["system", "check", str(SPEC), "--distro", "jazy"], "did you mean 'jazzy'?"),
        (["system", "check", "no_such.yaml"], "cannot read no_such.yaml"),
    ],
)
def test_faults_are_told_without_a_traceback(arguments: list[str], message: str, capsys: Captured) -> None:
    assert message in error(capsys, *arguments)


def test_a_right_specification(capsys: Captured) -> None:
    text = out(capsys, "system", "check", str(SPEC))
    assert text == f"{SPEC}: quat2euler is valid: 1 subscriber, 1 accelerator, 1 publisher\n"


def test_software_is_counted_apart(capsys: Captured) -> None:
    spec = SPEC.parents[1] / "image_pipeline" / "image_pipeline_software.yaml"
    text = out(capsys, "system", "check", str(spec))
    assert text.endswith(": 2 subscribers, 2 accelerators, 2 publishers, 1 accelerator in software\n")


def test_messages_for_a_system_are_checked(tmp_path: Path, capsys: Captured) -> None:
    stimuli, wrong = SPEC.with_name("stimuli.yaml"), tmp_path / "wrong.yaml"
    assert "is valid" in out(capsys, "system", "check", str(SPEC), "--stimuli", str(stimuli))
    wrong.write_text("- nobody: {x: 1.0}\n", encoding="utf-8")
    text = error(capsys, "system", "check", str(SPEC), "--stimuli", str(stimuli), "--stimuli", str(wrong))
    assert f"{wrong}:1:3: error: 'nobody' is not a subscriber" in text


@pytest.mark.parametrize("distro", ["noetic", "humble"])
def test_a_distribution_of_either_version_serves_a_specification(distro: str, capsys: Captured) -> None:
    assert "is valid" in out(capsys, "system", "check", str(SPEC), "--distro", distro)


def test_the_derived_system_has_the_content_of_the_dissertations_listings(capsys: Captured) -> None:
    derived = yaml.safe_load(out(capsys, "system", "show", str(SPEC)))
    converters = derived["Converters"]
    # Listing 6.7.
    assert [item["nameMW"] for item in converters["AXIS_to_msg"]] == ["geometry_msgs/Quaternion"]
    assert [item["nameMW"] for item in converters["msg_to_AXIS"]] == ["geometry_msgs/Point"]
    # Listing 6.9.
    for field in "xyzw":
        connection = {
            "from": f"QuaternionToEuler_sub/{field}",
            "to": f"QuaternionToEulerConverter/in_{field}",
        }
        assert connection in derived["Connections"]
    assert len(derived["Connections"]) == len("xyzw") + len("xyz") + 2 * len(("segment_valid", "msg_ready"))


def test_a_reader_that_leaves_early_is_no_fault() -> None:
    command = [sys.executable, "-m", "fusesoc_firm.cli", "message", "list"]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, "PYTHONUNBUFFERED": "1"}
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == b""


def test_a_system_is_made_drawn_and_counted(capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec, picture = tmp_path / "robot.yaml", tmp_path / "robot.dot"
    point = "geometry_msgs/Point"
    answers = ["robot", *[""] * 9, "no", "sub", "", "ROS", "subscriber", point, *[""] * 5, "yes", "pub", "", "", "no"]
    answers += ["yes", "pub", "", "ROS", "publisher", point, *[""] * 7, "no", "no"]
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{answer}\n" for answer in answers)))
    assert f"{spec}: robot is valid: 1 subscriber" in out(capsys, "system", "new", str(spec))
    assert out(capsys, "system", "diagram", str(spec), "-o", str(picture)) == ""
    assert '"block sub" -> "block pub"' in picture.read_text(encoding="utf-8")
    assert out(capsys, "system", "diagram", str(spec), "--format", "dot") == picture.read_text(encoding="utf-8")
    assert "generated for each line written" in out(capsys, "system", "report", str(spec))


@pytest.mark.parametrize(("language", "source"), [("Verilog", "rtl/robot.v"), ("C++", "hls/robot.cpp")])
def test_a_language_may_have_its_usual_spelling(
    language: str, source: str, capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ("init", "robot", "--in", "std_msgs/Int8", "--out", "std_msgs/Int8", "--language", language)
    assert f"robot/{source}\n" in out(capsys, *words)


def test_init_extends_a_system(capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = tmp_path / "robot.yaml"
    ends = "middleware: ROS, message: geometry_msgs/Point"
    blocks = f"- {{name: sub, mode: subscriber, {ends}, topic: a, outgoing: [{{name: pub}}]}}\n"
    blocks += f"- {{name: pub, mode: publisher, {ends}, topic: b}}\n"
    spec.write_text(f"# Mine\nproject: {{name: robot}}\nblocks:\n{blocks}", encoding="utf-8")
    # No accelerator; a block without further outputs; no more blocks; then another sink of `sub`.
    answers = ["no", "yes", "more", "", "ROS", "publisher", "geometry_msgs/Point", *[""] * 7, "no", "no"]
    answers += ["sub", "yes", "more", "", "", "no", ""]
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{answer}\n" for answer in answers)))
    assert "1 subscriber, 0 accelerators, 2 publishers\n" in out(capsys, "init", "--extend", str(spec))
    assert spec.read_text(encoding="utf-8").startswith("# Mine\n")


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["turn", "--extend", "x.yaml"], "--extend asks for all parts, so NAME has no meaning"),
        (["--extend", "x.yaml", "--in", "std_msgs/Bool"], "--extend asks for all parts, so --in has no meaning"),
        (["--extend", "x.yaml"], "x.yaml does not exist"),
    ],
)
def test_init_extends_only_a_specification(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], fault: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert error(capsys, "init", *words).startswith(f"error: {fault}\n")


def test_what_is_doubtful_is_told_and_goes_on(capsys: Captured, tmp_path: Path) -> None:
    """`warning` goes to the standard error, so that the standard output is unchanged."""
    spec = tmp_path / "robot.yaml"
    ends = ", middleware: ROS, message: geometry_msgs/Point, topic: "
    spec.write_text(
        f"project: {{name: robot}}\nblocks:\n- {{name: sub, mode: subscriber{ends}point, outgoing: [{{name: pub}}]}}\n"
        f"- {{name: pub, mode: publisher{ends}/point}}\n",
        encoding="utf-8",
    )
    for command in ("check", "show"):
        assert main(["system", command, str(spec)]) == 0
        captured = capsys.readouterr()
        assert f"{spec}:4:86: warning: 'pub' publishes on topic /point, to which 'sub' subscribes\n" in captured.err
        assert captured.out and "warning" not in captured.out


# The first bytes of a file of each format.
BEGINS = {"svg": b"<?xml", "png": b"\x89PNG\r\n", "pdf": b"%PDF-", "dot": b"digraph"}


@pytest.mark.skipif(not shutil.which("dot"), reason="no dot; make test installs Graphviz")
@pytest.mark.parametrize(
    ("command", "endings"),
    [(["system", "diagram", str(SPEC)], [*BEGINS]), (["graph", "robot:sys:quat2euler"], ["png"])],
    ids=["diagram", "graph"],
)
def test_a_picture_is_what_its_name_says(
    command: list[str], endings: list[str], capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    for ending in endings:
        path = tmp_path / f"picture.{ending}"
        assert out(capsys, *command, "-o", str(path)) == ""
        assert path.read_bytes().lstrip(b"/ \n").startswith(BEGINS[ending]), ending
    message = error(capsys, *command, "--format", "dot", "-o", str(tmp_path / "picture.svg"))
    assert "does not match the format dot" in message


@pytest.mark.parametrize(
    ("command", "name", "legal"),
    [
        (["system", "diagram", str(SPEC), "-o"], "x.jpg", ".svg, .png, .pdf, .dot"),
        (["graph", "robot:sys:quat2euler", "-o"], "x", ".svg, .png, .pdf, .dot"),
        (["system", "core", str(SPEC), "-o"], "x.txt", ".core"),
        (["trace", str(SPEC), "-o"], "x.gif", ".pdf, .png, .svg"),
        (["scheduler", "bench", "--csv"], "x.png", ".csv"),
        (["message", "verify", "std_msgs/Empty", "--report"], "x.html", ".json"),
    ],
)
def test_where_nothing_can_be_written_is_told_before_the_work(
    command: list[str], name: str, legal: str, capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name with another ending, a folder that is missing, and one in the file's place."""
    monkeypatch.chdir(tmp_path)
    message = error(capsys, *command, name)
    assert message == (f"error: cannot write {name}: unknown file extension\n      = legal extensions: {legal}\n")
    good = f"x{legal.split(',', maxsplit=1)[0]}"
    assert error(capsys, *command, f"none/{good}") == f"error: cannot write none/{good}: there is no folder none\n"
    (tmp_path / good).mkdir()
    assert error(capsys, *command, good) == f"error: cannot write {good}: the path is a folder\n"
    assert [path.name for path in tmp_path.iterdir()] == [good]


def test_a_specification_without_a_folder_is_told_before_the_questions(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    spec = tmp_path / "none" / "robot.yaml"
    assert (
        error(capsys, "system", "new", str(spec)) == f"error: cannot write {spec}: there is no folder {spec.parent}\n"
    )


def test_the_schema_is_json(capsys: Captured) -> None:
    assert json.loads(out(capsys, "system", "schema"))["title"] == "System specification of fusesoc_firm"


def test_steps_of_a_node_in_cpp_need_its_system(capsys: Captured, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    steps, picture = tmp_path / "steps.csv", tmp_path / "ways.svg"
    steps.write_text(
        "wall_ns,event,converter,message,bytes,first_cycle,last_cycle\n"
        "1,received,0,0,32,,\n2,sent,0,0,32,,\n3,burst,0,0,29,,\n4,published,0,0,24,,\n"
    )
    assert "add the system's specification with --system SPEC" in error(capsys, "trace", str(steps))
    ways = tmp_path / "steps-ways.csv"
    assert out(capsys, "trace", str(steps), "--system", str(SPEC), "-o", str(picture)) == f"{ways}\n{picture}\n"
    assert "0,QuaternionToEuler_sub,QuaternionToEuler_pub,32,24,0,0,1,2,3," in ways.read_text(encoding="utf-8")
    assert picture.is_file()
