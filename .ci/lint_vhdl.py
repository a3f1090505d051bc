"""Check the style of VHDL: cores, specs, and a sample of everything that is generated.

    python lint_vhdl.py [FILE...]

The style is in .ci/vsg.yaml; .ci/vsg_generated.yaml adds the departures for generated text. Each violation is printed
as `file:line: rule: remedy`; the exit code is 1 if there is one. Files given as arguments are checked instead, as
hand-written ones. A file that passed is not checked again until it, the style or vsg changes.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from os import cpu_count
from pathlib import Path

import yaml

from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.converter.pipeline import PIPELINES
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.noc.hardware import TEMPLATE, exchange_configuration
from fusesoc_firm.noc.network import Flow, Network, mesh
from fusesoc_firm.runs.verify.loop import loop_text
from fusesoc_firm.system.hardware.registers import registers_configuration
from fusesoc_firm.system.hardware.status import REGISTERS_TEMPLATE, status_map
from fusesoc_firm.text.render import render
from fusesoc_firm.tools.digests import default_root

ROOT = Path(__file__).resolve().parents[1]
VSG = Path(sys.executable).with_name("vsg")
WORK = ROOT / "build" / "vhdl_lint"
# Verdicts are kept like the results of tests (tests/recall.py).
PASSED = Path(os.environ.get("FIRM_TEST_STORE") or f"{default_root()}_tests") / "vhdl_style"
KEPT = 2000  # verdicts: several times the files of a run
SAMPLES = WORK / "samples"
GOLDEN = ROOT / "tests" / "converter" / "golden"
TEMPLATES = ROOT / "fusesoc_firm" / "templates"
HAND_WRITTEN = (ROOT / ".ci" / "vsg.yaml",)
GENERATED = (*HAND_WRITTEN, ROOT / ".ci" / "vsg_generated.yaml")

# In the report, an unreadable file looks like a file without violations.
UNREADABLE = re.compile(r"^Error while processing (.+?): *\nError: (.*) @ Line (\d+)", re.MULTILINE)

# Generator calls: a core, an entry of its section `generate`, and other parameters for it. Together with `GOLDEN`
# they use every template (`unused_templates`).
CALLS: Sequence[tuple[str, str, Mapping[str, object]]] = (
    ("quat2euler/quat2euler", "system", {"board": "ulx3s"}),
    ("quat2euler/quat2euler", "simulation", {"product": "live"}),
    ("quat2euler/quat2euler_hls", "system", {}),
    ("quat2euler/quat2euler_hls", "simulation", {}),
    ("quat2euler/quat2euler_ethernet", "system", {"board": "ecp5_versa"}),
    ("quat2euler/quat2euler_ethernet", "system", {"board": "ulx3s_lan8720"}),
    ("quat2euler/quat2euler_ethernet", "simulation", {"product": "network"}),
    ("mobile_robot/mobile_robot", "simulation", {"simulator": "icarus"}),
    ("image_pipeline/image_pipeline", "system", {"board": "zynq7000"}),
    ("multi_type/multi_type_verilog", "system", {}),
)


def generate(call: tuple[str, str, Mapping[str, object]]) -> None:
    """Call a generator of a core in specs as FuseSoC does."""
    core, name, changes = call
    call_generator(ROOT / "specs" / f"{core}.core", name, changes)


def call_generator(path: Path, name: str, changes: Mapping[str, object]) -> None:
    """Call a generator of a core as FuseSoC does, in a folder of `SAMPLES`."""
    entry = yaml.safe_load(path.read_text(encoding="utf-8").partition("\n")[2])["generate"][name]
    folder = SAMPLES / "-".join([path.stem, name, *map(str, changes.values())])
    folder.mkdir(parents=True)
    request = {
        "gapi": "1.0",
        "files_root": str(path.parent),
        "vlnv": f"robot:sys:{folder.name}:1",
        "parameters": entry["parameters"] | changes,
    }
    (folder / "call.yml").write_text(yaml.safe_dump(request), encoding="utf-8")
    run(sys.executable, ROOT / "generators" / f"{entry['generator']}_generator.py", "call.yml", cwd=folder)


def write_skeletons() -> None:
    """Write first versions of accelerators."""
    folder = SAMPLES / "skeletons"
    folder.mkdir(parents=True)
    shutil.copy(ROOT / "specs" / "multi_type" / "multi_type.yaml", folder)
    run(sys.executable, "-m", "fusesoc_firm.cli", "system", "skeleton", "multi_type.yaml", cwd=folder)


# New projects with units around the accelerator that are not in specs: their options and generators.
PROJECTS = {
    "streams": (
        ["--in", "sensor_msgs/Range", "--out", "std_msgs/String", "--language", "hls", "--width", "64"],
        ("system", "simulation"),
    ),
    "part": (["--in", "geometry_msgs/PoseStamped", "--include", "pose.position.z", "--width", "64"], ("system",)),
}


def write_projects() -> None:
    """Write the systems of new projects."""
    for project, (options, generators) in PROJECTS.items():
        folder = SAMPLES / "projects" / project
        folder.parent.mkdir(parents=True, exist_ok=True)
        run(sys.executable, "-m", "fusesoc_firm.cli", "init", folder.name, *options, cwd=folder.parent)
        for name in generators:
            call_generator(folder / f"{project}.core", name, {})


# Messages with converters of variable size, with their widths: arrays of text, arrays of messages.
VARIABLE = {"sensor_msgs/JointState": 8, "diagnostic_msgs/DiagnosticArray": 64}


def write_converters() -> None:
    """Write converters of variable size: subscribers with each number of register stages, publishers of each kind."""
    library = MessageLibrary(ROS2)
    for message, width in VARIABLE.items():
        frames = [frame_of(parse_name(message), library.closure(parse_name(message)))]
        made = {pipeline: subscriber_files(frames, width, pipeline=pipeline) for pipeline in PIPELINES}
        for variant, files in {**made, "publishers": publisher_files(frames, width)}.items():
            folder = SAMPLES / f"{variant}_{width}"
            folder.mkdir(parents=True)
            for name, file in files.items():
                (folder / name).write_text(str(file.content), encoding="ascii")


def write_loop() -> None:
    """Write the bench of `firm message verify`."""
    name = parse_name("sensor_msgs/LaserScan")
    text = loop_text(frame_of(name, MessageLibrary(ROS2).closure(name)), 64)
    SAMPLES.mkdir(parents=True, exist_ok=True)
    (SAMPLES / "loop.vhd").write_text(text, encoding="ascii")


def write_registers() -> None:
    """Write the registers of a system's status, also of one with a Manager of Managers."""
    for name, bits in (("registers", 16), ("many_registers", 20)):
        configuration = registers_configuration(status_map("robot_status", 2, 1), ["0" * 8] * 3, bits)
        (SAMPLES / f"{name}.vhd").write_text(render(REGISTERS_TEMPLATE, configuration), encoding="ascii")


def write_exchange() -> None:
    """Write an exchange in which some endpoints send or receive nothing."""
    topology = mesh(3, 2)
    network = Network(topology, topology.slots, (Flow(0, (2,)), Flow(0, (4,)), Flow(3, (0,))))
    (SAMPLES / "exchange.vhd").write_text(render(TEMPLATE, exchange_configuration("exchange", network, 8)))


# A node of ROS 1 in the sockets of a chip.
CHIP = """\
project:
  name: chip
  clock: 12 MHz
  interconnect: w5500
  network: {mac: "02:00:00:00:00:01", address: 10.0.0.2, master: 10.0.0.1}
blocks:
  - {name: pose, middleware: ROS, mode: subscriber, message: geometry_msgs/Pose, outgoing: [{name: copy}]}
  - {name: copy, middleware: ROS, mode: publisher, message: geometry_msgs/Pose}
"""


def write_chip() -> None:
    """Write a system in the sockets of a chip, on its board and in simulation."""
    folder = SAMPLES / "chips" / "chip"
    folder.mkdir(parents=True)
    (folder / "chip.yaml").write_text(CHIP, encoding="utf-8")
    run(sys.executable, "-m", "fusesoc_firm.cli", "system", "core", "chip.yaml", cwd=folder)
    for name, changes in (("system", {"board": "icebreaker_w5500"}), ("simulation", {"product": "network"})):
        call_generator(folder / "chip.core", name, changes)


def run(*command: str | Path, cwd: Path) -> None:
    """Run a program. Ends this one, with its output, if it fails."""
    done = subprocess.run(command, cwd=cwd, text=True, capture_output=True, check=False)
    if done.returncode:
        sys.exit(f"{done.stdout}{done.stderr}error: {' '.join(map(str, command))} failed in {cwd}")


def samples() -> list[Path]:
    """Generate the samples. Their paths, without copies of users' sources."""
    shutil.rmtree(SAMPLES, ignore_errors=True)
    with ThreadPoolExecutor(cpu_count()) as pool:
        list(pool.map(generate, CALLS))
    write_skeletons()
    write_projects()
    write_converters()
    write_loop()
    write_registers()
    write_exchange()
    write_chip()
    made = [*SAMPLES.glob("*.vhd"), *SAMPLES.glob("*/*.vhd"), *SAMPLES.glob("skeletons/rtl/*.vhd")]
    return sorted([*made, *GOLDEN.glob("*.vhd")])


def unused_templates(paths: Iterable[Path]) -> list[Path]:
    """The VHDL templates without a unique line in any of these files."""
    lines = {path: _lines(path) for path in sorted(TEMPLATES.glob("*/*.vhd.mustache"))}
    found = set().union(*map(_lines, paths))
    others = {path: set().union(*(lines[other] for other in lines if other != path)) for path in lines}
    return [path for path in lines if not (lines[path] - others[path]) & found]


def _lines(path: Path) -> set[str]:
    return {line for line in path.read_text(encoding="utf-8").splitlines() if "{{" not in line}


def hand_written() -> list[Path]:
    """The VHDL of cores and specs."""
    return sorted({*(ROOT / "cores").rglob("*.vhd"), *(ROOT / "specs").rglob("*.vhd")})


def violations(paths: Sequence[Path], style: Sequence[Path]) -> list[str]:
    """The violations that vsg finds in these files, sorted. Files that passed before are not checked."""
    passed = PASSED.read_text(encoding="utf-8").split() if PASSED.exists() else []
    digests = {path: digest(path, style) for path in paths}
    waiting = {value: path for path, value in digests.items() if value not in passed}
    found = check([*waiting.values()], style) if waiting else {}
    faulty = {digests[path] for path in found}
    clean = [value for value in digests.values() if value not in faulty]
    PASSED.parent.mkdir(parents=True, exist_ok=True)
    PASSED.write_text("\n".join(list(dict.fromkeys(clean + passed))[:KEPT]), encoding="utf-8")
    return [line for path in sorted(found) for line in found[path]]


def digest(path: Path, style: Sequence[Path]) -> str:
    """The hash of everything that the verdict on a file depends on."""
    parts = [metadata.version("vsg").encode(), *(item.read_bytes() for item in style), path.read_bytes()]
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


def check(paths: Sequence[Path], style: Sequence[Path]) -> dict[Path, list[str]]:
    """The violations in each file with violations. Ends the program if vsg fails otherwise."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, "report.json")
        command = [str(VSG), "--all_phases", "--jobs", str(cpu_count()), "--output_format", "summary"]
        command += ["--json", str(report), "--configuration", *map(str, style), "--filename", *map(str, paths)]
        done = subprocess.run(command, text=True, capture_output=True, check=False)
        listed = json.loads(report.read_text(encoding="utf-8"))["files"] if report.exists() else []
    output = done.stdout + done.stderr
    found = {
        Path(file["file_path"]): [
            f"{shown(Path(file['file_path']))}:{item['linenumber']}: {item['rule']}: {item['solution']}"
            for item in file["violations"]
        ]
        for file in listed
        if file["violations"]
    }
    found |= {Path(path): [f"{shown(Path(path))}:{line}: {fault}"] for path, fault, line in UNREADABLE.findall(output)}
    if not listed or (done.returncode and not found):
        sys.exit(f"{output}error: {VSG.name} failed")
    return found


def shown(path: Path) -> Path:
    """A path as it is printed."""
    return path.relative_to(ROOT) if path.is_relative_to(ROOT) else path


def main(arguments: Sequence[str]) -> int:
    """Check files, or everything. The exit code."""
    if arguments:
        paths = [Path(argument).resolve() for argument in arguments]
        if missing := [str(path) for path in paths if not path.is_file()]:
            sys.exit(f"error: not a file: {', '.join(missing)}")
        found = violations(paths, HAND_WRITTEN)
    else:
        made = samples()
        found = violations(hand_written(), HAND_WRITTEN) + violations(made, GENERATED)
        found += [
            f"{path.relative_to(ROOT)}:1: no sample uses this file; add a sample in {__file__}"
            for path in unused_templates(made)
        ]
    print(*found, sep="\n", end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
