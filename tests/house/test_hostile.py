"""A project in which every text is hostile: each target's own tool reads its output, and nothing is executed.

Text that no tool could receive safely, such as a part's name with brackets, is rejected at its place.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.cli import main
from fusesoc_firm.core.request import GeneratedCore, GeneratedFile, Request, as_files
from fusesoc_firm.node.transport.built_simulator import _build_folder
from fusesoc_firm.system.boards.board import read_board
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.open_flows import OPEN_FLOWS

CANARY = "hostile_canary"
# Printable, therefore legal; each has a special meaning in some language.
HOSTILE = (
    f"[exec touch {CANARY}]",
    f"$(touch {CANARY}) `touch {CANARY}`",
    f'"; quote; exec touch {CANARY}; "',
    f'")); system("touch {CANARY}"); //',
    "-- sign */ /* // # % ??/",
    "ends in \\",
    "} brace ] ) > ' \" \"\"\" ''' { [ (",
    "<b>&amp;\"'</b> ]]>",
    "a: b - [c] ? (d) #e",
    "\\N \\n \\x $x$ $$ ${HOME} {{x}} {{{y}}}",
    "für Ωmega ‼ 🤖",
    "synthesis translate_off",
    "null",
    "n" * 200,
)
DESCRIPTION = "für [exec touch hostile_canary] $(x) `y` \" ' { } -- # \\"
ODD_1 = """\
string A=quotes " and ' and \\ at the end \\
string B=R"msg( )msg" ??/ */ // -- # [exec touch hostile_canary] $(x) {{{x}}} %s
string C=\f form feed \v and \x85 and \u2028 für Ω 🤖
string EMPTY=
uint8 D=7
string text
uint8 x
"""
ODD_2 = """\
string A="quotes \\" and \\\\ ??/ [exec touch hostile_canary] für Ω 🤖"
string text "\\" [exec touch hostile_canary] \\ 🤖 ''' Ω"
float32 a inf
float64[2] b [nan, -inf]
bool c true
"""
COPY = """\
library ieee;
use ieee.std_logic_1164.all;
entity copy is
  port (clk, rst_n : in std_logic);
end entity;
"""
CPP = """\
#include <cstdint>
void gain(double x_in, double y_in, double z_in, double *x_out, double *y_out, double *z_out) {}
"""


def sides(message: str, ros: str = "ROS") -> dict[str, list[dict[str, str]]]:
    return {way: [{"middleware": ros, "message": message}] for way in ("input", "output")}


def chain(names: Sequence[str], message: str, type_: str = "", ros: str = "ROS", **keys: str) -> list[dict[str, Any]]:
    """A subscriber, a block of `type_` if given, and a publisher."""
    ends = {"middleware": ros, "message": message}
    blocks: list[dict[str, Any]] = [{"name": names[0], "mode": "subscriber", **ends}]
    if type_:
        blocks.append({"name": names[1], "type": type_, **keys})
    blocks.append({"name": names[-1], "mode": "publisher", **ends})
    for block, after in pairwise(blocks):
        block["outgoing"] = [{"name": after["name"]}]
    return blocks


@dataclass(frozen=True)
class Project:
    """The folder, and its specifications."""

    folder: Path
    ros_1: Path
    ros_2: Path

    def generated(self, generator: str = "far", **parameters: Any) -> dict[str, bytes]:
        """The files of a generator call; the given parameters replace defaults."""
        names = ("spec", "product", "board", "paths", "distro", "stimuli", "model", "environment", "files", "messages")
        defaults = dict.fromkeys(names) | {"product": "system", "simulator": "ghdl", "seed": 1, "stall_percent": 0}
        given = {**defaults, "paths": ["odd_msgs_1" if parameters["spec"] == self.ros_1.name else "odd_msgs_2"]}
        request = Request(generator, "me:sys:robot-made:0", self.folder, {**given, **parameters})
        return as_files(GENERATORS[generator].load(request).generate(), request)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("hostile")
    for number, text in ((1, ODD_1), (2, ODD_2)):
        (folder / f"odd_msgs_{number}/odd_msgs/msg").mkdir(parents=True)
        (folder / f"odd_msgs_{number}/odd_msgs/msg/Odd.msg").write_text(text, encoding="utf-8", newline="")
    (folder / "copy.vhd").write_text(COPY, encoding="ascii")
    (folder / "gain.cpp").write_text(CPP, encoding="ascii")
    names = iter(HOSTILE)
    kernel, wise = f"HLS {HOSTILE[0]}", f"SW {HOSTILE[2]}"
    copy = {"name": "copy", "type": "VHDL", "sources": "copy.vhd", "interface": sides("geometry_msgs/Point")}
    pins = [{"name": "lamp", "direction": "out"}]
    specification: dict[str, Any] = {
        "project": {
            "name": f"robot {HOSTILE[4]}",
            "fpgaPart": HOSTILE[0],
            "clock": "100 MHz",
            "clocks": [{"name": "fast", "frequency": "150 MHz"}],
            "width": 32,
            "scheduler": "edf_latency",
        },
        "accelerators": [
            {**copy, "pins": pins},
            {"name": kernel, "type": "HLS", "sources": "gain.cpp", "interface": sides("geometry_msgs/Point")},
            {"name": wise, "type": "ROS-SW", "sources": "think.py", "interface": sides("geometry_msgs/Vector3")},
        ],
        "blocks": [
            *chain([next(names) for _ in range(3)], "geometry_msgs/Point", "copy", clock="fast"),
            *chain([next(names) for _ in range(3)], "geometry_msgs/Point", kernel),
            *chain([next(names) for _ in range(3)], "geometry_msgs/Vector3", wise),
            *chain([next(names) for _ in range(2)], "odd_msgs/Odd"),
        ],
    }
    for block in specification["blocks"]:
        if block.get("mode") == "publisher":
            block["period"] = "1 ms"
            block["deadline"] = "100 us"
    ros_1, ros_2 = folder / f'robot\'s $(touch {CANARY}) """.yaml', folder / "second.yaml"
    ros_1.write_text(yaml.safe_dump(specification, allow_unicode=True, sort_keys=False), encoding="utf-8")
    odd = {"name": HOSTILE[1], "type": "ROS-SW", "sources": "odd.py", "interface": sides("odd_msgs/Odd", "ROS2")}
    last = [*names]
    specification = {
        "project": {"name": last[0]},
        "accelerators": [odd],
        "blocks": [
            *chain([last[1], last[2], HOSTILE[0]], "odd_msgs/Odd", HOSTILE[1], "ROS2"),
            *chain([HOSTILE[3], HOSTILE[5]], "odd_msgs/Odd", ros="ROS2"),
        ],
    }
    ros_2.write_text(yaml.safe_dump(specification, allow_unicode=True, sort_keys=False), encoding="utf-8")
    for path, number in ((ros_1, 1), (ros_2, 2)):
        assert main(["system", "skeleton", str(path), "--path", str(folder / f"odd_msgs_{number}")]) == 0
    board = {
        "description": DESCRIPTION,
        "clock": "100 MHz",
        "interconnect": "axi_stream",
        "part": "xc7z020clg400-1",
        "processor": "zynq7000",
    }
    (folder / "vivado.yaml").write_text(json.dumps({**board, "flow": "vivado"}), encoding="utf-8")
    quartus = {**board, "flow": "quartus", "device": "5CSEBA6U23I7", "deviceFamily": "Cyclone V"}
    (folder / "quartus.yaml").write_text(json.dumps(quartus), encoding="utf-8")
    return Project(folder, ros_1, ros_2)


def run(command: Sequence[str | Path], folder: Path) -> str:
    done = subprocess.run([*map(str, command)], cwd=folder, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    assert not [*folder.rglob(CANARY)]
    return done.stdout


def write(folder: Path, files: dict[str, bytes]) -> Path:
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def output(*arguments: str | Path) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as shown:
        assert main([*map(str, arguments)]) == 0
    return shown.getvalue()


def test_vhdl(project: Project, tmp_path: Path) -> None:
    """Systems, constants, a live test bench and its kernels, and an accelerator's skeleton, in GHDL."""
    found = []
    for path in (project.ros_1, project.ros_2):
        for product in ("system", "live"):
            found += [
                *write(tmp_path / path.stem / product, project.generated(spec=path.name, product=product)).rglob(
                    "*.vhd"
                )
            ]
    for path in found:
        assert path.read_bytes().isascii(), path
    # This parses each file, and reports faults without an exit status.
    done = subprocess.run(["ghdl", "-f", "--std=93", *found], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "") and "entity robot_sign_system" in done.stdout
    (constants,) = tmp_path.glob("second/system/odd_msgs_odd_pkg.vhd")
    assert "touch hostile_canary] f\" & character'val(195)" in constants.read_text()
    (system,) = tmp_path.glob("robot*/system/robot_*_system.vhd")
    text = system.read_text(encoding="ascii")
    assert "  -- ports of ends in \\\\.\n" in text
    assert '-- of "; quote; exec touch hostile_canary; "\n' in text and "-- crossing [exec touch" in text


SANDBOX = """\
# A script without commands but those of the language: each call of another one is printed, and gives 1.
interp create -safe box
foreach name {file source exec open puts error} { catch {interp eval box [list rename $name {}]} }
interp alias box unknown {} called
proc called args { puts $args; return 1 }
fconfigure stdin -encoding utf-8
interp eval box {proc source args {}}
interp eval box [read stdin]
"""


def tcl_calls(script: bytes, folder: Path) -> list[str]:
    """The commands that a script calls, with their arguments."""
    (folder / "sandbox.tcl").write_text(SANDBOX, encoding="ascii")
    done = subprocess.run(
        ["tclsh", "sandbox.tcl"], cwd=folder, input=script, capture_output=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr.decode()
    calls = done.stdout.decode().split("\n")[:-1]
    assert calls
    assert f"touch {CANARY}" not in done.stdout.decode() and not [
        call for call in calls if call.startswith(("exec", "$", "x"))
    ]
    return calls


@pytest.mark.skipif(not shutil.which("tclsh"), reason="tclsh is not installed")
def test_tcl(project: Project, tmp_path: Path) -> None:
    """The block design, the constraints and the checks for Vivado, and the script for Vitis HLS."""
    files = project.generated(spec=project.ros_1.name, board="vivado.yaml")
    scripts = {name: data for name, data in files.items() if name.endswith((".tcl", ".xdc"))}
    assert {name.rpartition(".")[2] for name in scripts} == {"tcl", "xdc"} and len(scripts) == 4
    calls = {name: tcl_calls(data, tmp_path) for name, data in scripts.items()}
    assert "set_part xc7z020clg400-1" in calls["gain.tcl"]
    assert any(
        data.startswith(b"# robot_") and b"f\\xfcr [exec touch" in data.split(b"\n")[0] for data in scripts.values()
    )


@pytest.mark.skipif(not shutil.which("tclsh"), reason="tclsh is not installed")
def test_constraints_of_quartus(project: Project, tmp_path: Path) -> None:
    # This system has no accelerators in C++.
    files = project.generated(spec=project.ros_2.name, board="quartus.yaml")
    (script,) = (data for name, data in files.items() if name.endswith(".sdc"))
    assert [call.split()[0] for call in tcl_calls(script, tmp_path)] == [
        "get_ports",
        "create_clock",
        "derive_clock_uncertainty",
        # The reset of clk.
        *("get_registers", "set_false_path", "get_pins", "set_false_path"),
    ]


@pytest.mark.parametrize("flow", OPEN_FLOWS)
def test_constraints_of_pins(project: Project, flow: str) -> None:
    """These formats have no stand-alone reader: check comment lines, and allow only words of the board file."""
    pins = [
        {"port": port, "site": site} for port, site in (("clk", "A1"), ("uart_rxd", "IOB 2/3"), ("uart_txd", "10,11"))
    ]
    board = {"description": DESCRIPTION, "flow": flow, "clock": "25 MHz", "interconnect": "uart", "pins": pins}
    board["device"] = "GW1N"
    (project.folder / f"{flow}.yaml").write_text(json.dumps(board), encoding="utf-8")
    files = project.generated(spec=project.ros_2.name, board=f"{flow}.yaml")
    form = OPEN_FLOWS[flow].constraints
    mark = "//" if form == "cst" else "#"
    comment, *rest = files[f"{flow}.{form}"].decode("ascii").split("\n")
    assert comment.startswith(f"{mark} f\\xfcr [exec touch hostile_canary] $(x) `y`")
    rest = [line for line in rest if not line.startswith(mark)]
    word = r'("?[A-Za-z0-9_ /,.=]+"?|\{[A-Za-z0-9_ /,.=]+\}|\[get_ports \{[a-z_]+\}\]|-[a-z]+)'
    assert rest and all(re.fullmatch(rf"[A-Za-z_]*( {word})*;?", line) for line in rest), rest


@pytest.mark.parametrize("which", ["ros_1", "ros_2"])
def test_cpp(project: Project, tmp_path: Path, which: str) -> None:
    """The node's table, compiled with replacement headers that print it."""
    path = getattr(project, which)
    files = {n: d for n, d in project.generated(spec=path.name).items() if n.startswith("node/")}
    node = write(tmp_path, files) / "node"
    (source,) = node.glob("src/*.cpp")
    stand_in = tmp_path / "stand_in/firm"
    stand_in.mkdir(parents=True)
    for name in ("ros1.hpp", "ros2.hpp"):
        (stand_in / name).write_text("namespace firm { struct Ros1; struct Ros2; }\n", encoding="ascii")
    (stand_in / "ros_node.hpp").write_text(STAND_IN, encoding="ascii")
    run(["g++", "-std=c++17", "-Wall", "-Werror", f"-I{stand_in.parent}", "-o", "table", source], tmp_path)
    shown = run([tmp_path / "table"], tmp_path)
    # Only ROS 1 requires definitions.
    told = [text.replace("=", " = ") for text in (*ODD_1.split("\n")[:2], ODD_1.split("\n")[2].replace("\f ", ""))]
    assert [text in re.sub(" +", " ", shown) for text in told] == [which == "ros_1"] * 3
    ET.fromstring((node / "package.xml").read_text(encoding="utf-8"))


STAND_IN = """\
#include <cstdio>
#include <optional>
#include <string>
#include <vector>
namespace firm {
struct Quality { bool is_reliable, is_transient_local; unsigned depth; };
struct Topic {
  std::optional<unsigned> id;
  std::string name, type, signature;
  Quality quality;
  bool is_numbered;
  std::string definition{};
};
struct Port { std::string topic; std::optional<unsigned> converter; };
struct Software { std::vector<Port> inputs, outputs; };
struct System {
  std::string name;
  unsigned width, subscriber_count, publisher_count;
  std::size_t queue_depth;
  std::string digest;
  bool has_status_registers;
  std::vector<Topic> subscribers, publishers;
  Topic diagnostics;
  std::vector<std::string> channels{};
  std::vector<std::vector<long>> contents{};
  Software software{};
};
template <class T>
int run(const System& system, int, char**) {
  for (auto& topic : system.subscribers) std::printf("%s\\n%s\\n", topic.name.c_str(), topic.definition.c_str());
  return 0;
}
}
"""


def test_python(project: Project, tmp_path: Path) -> None:
    """The node's table and the skeletons of software, which copy the message."""
    for path, number in ((project.ros_1, 1), (project.ros_2, 2)):
        folder = tmp_path / f"node_{number}"
        options = ("--language", "python", "--path", project.folder / f"odd_msgs_{number}", "-o", folder)
        assert main([*map(str, ("system", "node", path, *options))]) == 0
        (node,) = folder.glob("*.py")
        tree = ast.parse(node.read_text(encoding="utf-8"))
        # Only the table and its use are allowed.
        kinds = {type(statement).__name__ for statement in tree.body}
        assert kinds <= {"Expr", "ImportFrom", "Assign", "If"} and "Import" not in kinds
        constants = {value.value for value in ast.walk(tree) if isinstance(value, ast.Constant)}
        blocks = [block["name"] for block in yaml.safe_load(path.read_text(encoding="utf-8"))["blocks"]]
        assert {blocks[0], blocks[-1]} <= constants
        definition = "".join(str(text) for text in constants if "\v" in str(text))
        assert ("form feed \v and \x85 and \u2028 für Ω 🤖\n" in definition) is (number == 1)
    names: dict[str, Any] = {}
    exec(compile((project.folder / "odd.py").read_text(encoding="utf-8"), "odd.py", "exec"), names)
    (function,) = (value for name, value in names.items() if callable(value) and not name.startswith("__"))
    message = {name: object() for name in ("text", "a", "b", "c")}
    assert message.items() <= function(message).items()


def test_yaml(project: Project, tmp_path: Path) -> None:
    """A core written for a specification, and the YAML of generated cores for FuseSoC."""
    core = tmp_path / "robot.core"
    described = ("--description", DESCRIPTION, "--depend", "me:x:[a, b]", "--stimuli", "a: b # c.yaml")
    paths = ("--path", project.folder / "odd_msgs_1", "--environment", "in #1, [2].vhd")
    output("system", "core", project.ros_1, *described, *paths, "-o", core)
    for _ in range(2):
        content = yaml.safe_load(core.read_text(encoding="utf-8").removeprefix("CAPI=2:"))
        assert content["description"] == DESCRIPTION
        assert content["filesets"]["base"]["depend"][-1] == "me:x:[a, b]"
        parameters = content["generate"]["simulation"]["parameters"]
        assert parameters["stimuli"] == "a: b # c.yaml" and parameters["environment"] == ["in #1, [2].vhd"]
        assert Path(parameters["spec"]).name == project.ros_1.name
        # This rewrites its targets.
        output("system", "core", project.ros_1, *paths[:2], "-o", core)
    shown = yaml.safe_load(output("system", "show", project.ros_1, *paths[:2]))
    assert shown["System"]["fpgaPart"] == HOSTILE[0]


@pytest.mark.skipif(not shutil.which("dot"), reason="no dot; make test installs Graphviz")
def test_pictures(project: Project) -> None:
    """Each block has its unchanged name, and connections lead to it."""
    svg = ET.fromstring(output("system", "diagram", project.ros_1, "--path", project.folder / "odd_msgs_1"))
    shown = {(item.text or "").replace("\xa0", " ") for item in svg.iter("{http://www.w3.org/2000/svg}text")}
    blocks = [block["name"] for block in yaml.safe_load(project.ros_1.read_text(encoding="utf-8"))["blocks"]]
    assert {name for name in blocks if "&amp;" not in name} <= shown


def test_a_picture_of_a_trace(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from fusesoc_firm.node.engine.trace import COLUMNS
    from fusesoc_firm.node.engine.trace_picture import draw_trace

    rows = [",".join(COLUMNS)]
    for name in ("$\\bad{$", "$x$ \\alpha"):
        values = dict.fromkeys(COLUMNS, "1") | {"message": "0", "subscriber": name, "publisher": name}
        rows.append(",".join(values[column] for column in COLUMNS))
    (tmp_path / "t.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    draw_trace(tmp_path / "t.csv", tmp_path / "t.svg")
    assert ET.parse(tmp_path / "t.svg")


def test_a_report_counts(project: Project) -> None:
    assert "lines generated" in output("system", "report", project.ros_1, "--path", project.folder / "odd_msgs_1")


SYSTEM = """\
project: {{name: {name}, clock: {clock}}}
accelerators: []
blocks:
  - {{name: {block}, middleware: ROS, mode: subscriber, message: {message}, outgoing: [{{name: out}}]}}
  - {{name: out, middleware: ROS, mode: publisher, message: geometry_msgs/Point}}
"""
RIGHT = {"name": "robot", "clock": "1 MHz", "block": "in", "message": "geometry_msgs/Point"}
LEGAL = "legal: one line of at most 200 printable characters"
BOARD = {"flow": "vivado", "clock": "1 MHz", "interconnect": "axi_stream", "part": "x", "processor": "zynqmp"}


def faults(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> str:
    capsys.readouterr()
    assert main([*map(str, arguments)]) == 1
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("value", "fault"),
    [
        (r'"a\nend"', "contains the character U+000A"),
        (r'"\x1b[2J"', "contains the character U+001B"),
        (r'"\x0c"', "contains the character U+000C"),
        (r'"\N"', "contains the character U+0085"),
        (r'"\u2028"', "contains the character U+2028"),
        (r'"\u202e"', "contains the character U+202E"),
        (r'"\ud800"', "contains the character U+D800"),
        (r'"\0"', "contains the character U+0000"),
        ("x" * 201, "has 201 characters"),
        ("x" * 100_000, "has 100000 characters"),
    ],
)
@pytest.mark.parametrize(("key", "place"), [("name", "1:17"), ("block", "4:12"), ("message", "4:"), ("clock", "1:")])
def test_what_is_no_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], key: str, place: str, value: str, fault: str
) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(SYSTEM.format(**RIGHT | {key: value}), encoding="utf-8")
    shown = faults(capsys, "system", "check", path)
    assert f"robot.yaml:{place}" in shown and f" {fault}\n" in shown and LEGAL in shown
    assert shown.count("error:") == 1 and len(shown) < 2000 and "\x1b" not in shown and "Traceback" not in shown


BAD_SOURCES = "my mix|a'b|a\"b|a$b|a[b]|a{b}|a;b|a#b|a%b|a:b|-a|a=b|für|a\\b|~/a|dir/-a|a,b|a@b|a*|a//b".split("|")


@pytest.mark.parametrize("name", [*BAD_SOURCES, "x" * 250])
def test_a_source_that_tools_do_not_take(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    sources = ["good-1/../a_b+c.2.vhd", f"{name}.vhd"]
    type_ = {"name": "mix", "type": "VHDL", "sources": sources, "interface": sides("geometry_msgs/Point")}
    blocks = chain(["in", "mix_0", "out"], "geometry_msgs/Point", "mix")
    content = {"project": {"name": "r"}, "accelerators": [type_], "blocks": blocks}
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(content, allow_unicode=True, sort_keys=False), encoding="utf-8")
    shown = faults(capsys, "system", "skeleton", path)
    assert "error: 'sources' cannot be '" in shown and "letters, digits, '_', '.', '+' and '-'" in shown
    # The valid one is not named.
    assert shown.count("error:") == 1


@pytest.mark.parametrize("key", ["part", "boardPart", "device", "deviceFamily", "standard", "site"])
def test_a_part_is_a_word_of_tools(tmp_path: Path, key: str) -> None:
    for value in ("x [exec touch F]", "$x", 'a"b', "{a}", "a;b", "-a", "a\\", "é"):
        changed = {"pins": [{"port": "clk", "site": value}]} if key == "site" else {key: value}
        board = yaml.safe_dump({"description": "b", **BOARD, **changed}, allow_unicode=True)
        (tmp_path / "board.yaml").write_text(board, encoding="utf-8")
        with pytest.raises(InputError, match=rf"board.yaml:\d+:\d+: error: '{key}' cannot be '") as caught:
            read_board("board.yaml", tmp_path)
        assert "legal here: letters, digits, blanks and" in str(caught.value)


def test_a_description_of_a_board_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "board.yaml").write_text(json.dumps({"description": "a\nexec touch F", **BOARD}), encoding="utf-8")
    with pytest.raises(InputError, match=r"board.yaml:1:17: error: 'description' contains the character U\+000A"):
        read_board("board.yaml", tmp_path)


@pytest.mark.parametrize("text", ["uint8 {}\n", "{} a\n", "uint8 {}=1\n", "odd_msgs/{} a\n", "{}/Odd a\n"])
def test_names_in_messages_have_the_same_length(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str) -> None:
    folder = tmp_path / "odd_msgs/msg"
    folder.mkdir(parents=True)
    for length in (201, 100_000):
        (folder / "Odd.msg").write_text(text.format("A" * length), encoding="utf-8")
        shown = faults(capsys, "message", "show", "odd_msgs/Odd", "--ros", "1", "--path", tmp_path)
        assert len(shown) < 2000 and "Odd.msg:1:" in shown
    (folder / "Odd.msg").write_text(f"uint8 {'a' * 200}\nuint8 {'A' * 200}=1\n", encoding="utf-8")
    assert "a" * 200 in output("message", "show", "odd_msgs/Odd", "--ros", "1", "--path", tmp_path)


def test_a_description_for_a_core(project: Project, capsys: pytest.CaptureFixture[str]) -> None:
    for value in ("two\nlines", "x" * 201):
        options = ("--description", value, "--path", project.folder / "odd_msgs_1", "-o", project.folder / "no.core")
        assert "error: --description " in faults(capsys, "system", "core", project.ros_1, *options)
        assert not (project.folder / "no.core").exists()


def test_a_file_name_that_no_file_system_takes() -> None:
    request = Request("far", "me:x:y:0", Path(), {})
    for name, is_legal in (("a" * 255, True), ("a" * 256, False), ("b/" + "é" * 128, False), ("é" * 127 + "/c", True)):
        core = GeneratedCore("", {name: GeneratedFile("", "user")})
        with contextlib.nullcontext() if is_legal else pytest.raises(InputError, match="legal: at most 255"):
            as_files(core, request)


def test_a_simulator_is_built_in_a_folder_that_tools_take(tmp_path: Path) -> None:
    """The folder is named after the specification's file, which may have any name."""
    folder = _build_folder(tmp_path / f"-{HOSTILE[0]} für {'x' * 200}.yaml", "ghdl", tmp_path)
    assert re.fullmatch(r"_exec_touch_hostile_canary__f_r_x+-[0-9a-f]{12}-ghdl", folder.name) and len(folder.name) < 100
    assert folder.is_dir()
