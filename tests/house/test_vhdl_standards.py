"""All VHDL is analysed and elaborated as VHDL-93 and as VHDL-2008 without an error or a warning, by each GHDL at hand:
ours, and what is generated."""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import replace
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.converter.pipeline import PIPELINES
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.netlist import ghdl2
from fusesoc_firm.text.diagnostics import InputError
from tests import corpus
from tests.hdl.ghdl import CORES, REPOSITORY, GhdlError, Library
from tests.seeds import seeded
from tests.system.simulated.systems import call, generate_system, write

SPECS = REPOSITORY / "specs"
STANDARDS = ("93", "08")
SEED = seeded(20241130)
# Of fixed and of variable size; with arrays of messages and of strings.
MESSAGES = ("geometry_msgs/Pose", "sensor_msgs/Image", "sensor_msgs/JointState", "diagnostic_msgs/DiagnosticArray")
# Of the corpus' messages, of each ROS.
SAMPLE = 15
STRICT = ("--warn-error",)

# Debian's ghdl starts one of the others. The variable FIRM_GHDLS adds programs.
GHDLS = list(filter(shutil.which, ("ghdl-mcode", "ghdl-llvm", "ghdl-gcc"))) or ["ghdl"]
GHDLS += filter(None, os.environ.get("FIRM_GHDLS", "").split(os.pathsep))

ENTITY = re.compile(r"^entity (\w+) is$(.*?)^end", re.MULTILINE | re.IGNORECASE | re.DOTALL)
GENERICS = re.compile(r"^  generic \((.*?)^  \);", re.MULTILINE | re.IGNORECASE | re.DOTALL)
COMMENT = re.compile("--.*")
# A bench needs its stimuli, a kernel its library in C++, and the ports of a top have bounds.
NO_TOP = ("cannot open file", "cannot load VHPIDIRECT shared library", "cannot find ./", "cannot be at the top")
LINKED = CORES / "sim" / "linker" / "libc.so.6"
UNIT = re.compile(r"^(?:entity|package) (\w+) is$", re.MULTILINE | re.IGNORECASE)
USED = re.compile(r"^\s*(?:use|\w+ : entity) (?:firm|work)\.(\w+)", re.MULTILINE | re.IGNORECASE)
# Instead of the synchroniser of robot:cdc:firm_cdc_sync.
SIMULATED_SYNC = CORES / "sim" / "rtl" / "firm_cdc_sync.vhd"


def in_order(files: Iterable[Path]) -> list[Path]:
    """Files with each unit after those that it uses."""
    texts = {file: file.read_text(encoding="utf-8") for file in sorted(files)}
    homes = {unit.lower(): file for file, text in texts.items() for unit in UNIT.findall(text)}
    used = {file: {homes.get(unit.lower(), file) for unit in USED.findall(text)} for file, text in texts.items()}
    return list(TopologicalSorter({file: others - {file} for file, others in used.items()}).static_order())


def elaborate_all(library: Library, files: Iterable[Path]) -> None:
    """Elaborate each entity that can be a top: each of its generics has a default."""
    for file in files:
        for name, head in ENTITY.findall(file.read_text(encoding="utf-8")):
            generics = GENERICS.search(COMMENT.sub("", head))
            if generics and not all(":=" in generic for generic in generics[1].split(";")):
                continue
            try:
                library.elaborate(name)
            except GhdlError as error:
                if not any(text in str(error) for text in NO_TOP):
                    raise


@pytest.fixture(scope="module", params=GHDLS)
def ghdl(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module", params=STANDARDS)
def standard(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def firm(ghdl: str, standard: str, tmp_path_factory: pytest.TempPathFactory) -> Library:
    """All cores and their benches, analysed as the standard says; GHDL keeps a library for one standard only."""
    library = Library("firm", tmp_path_factory.mktemp(f"firm_{standard}"), standard, ghdl)
    library.analyse(in_order(set(CORES.rglob("*.vhd")) - {SIMULATED_SYNC}), *STRICT)
    shutil.copy(LINKED, library.directory)
    return library


def user_of(firm: Library, folder: Path) -> Library:
    """A library `work` in `folder`, which finds `firm`."""
    firm.copy_to(folder)
    shutil.copy(LINKED, folder)
    return replace(firm, name="work", directory=folder)


def test_cores(firm: Library, tmp_path: Path) -> None:
    elaborate_all(firm, CORES.rglob("*.vhd"))
    replace(firm, directory=tmp_path).analyse([SIMULATED_SYNC], *STRICT)


@pytest.mark.skipif(shutil.which("nvc") is None, reason="nvc is not installed")
@pytest.mark.parametrize("revision", ["1993", "2008"])
def test_cores_in_nvc(revision: str, tmp_path: Path) -> None:
    files = in_order(set(CORES.rglob("*.vhd")) - {SIMULATED_SYNC})
    command = ["nvc", f"--std={revision}", f"--work=firm:{tmp_path / 'firm'}", "-a", *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_a_port_with_bounds_other_than_its_actual_is_found(firm: Library, tmp_path: Path) -> None:
    """By GHDL 3 and later, and for constant bounds only in the elaboration."""
    path = tmp_path / "bounds.vhd"
    path.write_text(
        "entity part is generic (N : positive := 7); port (p : out natural range 0 to N); end entity;\n"
        "architecture rtl of part is begin p <= N; end architecture;\n"
        "entity whole is\nend entity;\n"
        "architecture rtl of whole is signal r : natural; begin\n"
        "  u : entity work.part port map (p => r);\nend architecture;\n"
    )
    library = user_of(firm, tmp_path)
    library.analyse([path], *STRICT)
    if ghdl2.has_faults(library.version):
        elaborate_all(library, [path])
        return
    with pytest.raises(GhdlError, match="range"):
        elaborate_all(library, [path])


def test_a_warning_is_a_fault(ghdl: str, standard: str, tmp_path: Path) -> None:
    path = tmp_path / "e.vhd"
    path.write_text(
        "entity e is generic (N : natural := 1); end e;\narchitecture a of e is\n"
        "  function f(n : natural) return natural is begin return n; end f;\nbegin\nend a;\n"
    )
    with pytest.raises(GhdlError, match=r'(?i)hides generic "n"'):
        Library("work", tmp_path, standard, ghdl).analyse([path], *STRICT)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("core", sorted(SPECS.glob("*/*.core")), ids=lambda path: path.stem)
def test_systems(firm: Library, core: Path, tmp_path: Path) -> None:
    """The accelerators and benches of the demo systems, and their generated systems with test benches."""
    sections = yaml.safe_load(core.read_text(encoding="utf-8").partition("\n")[2])
    given = sections["generate"]["simulation"]["parameters"]
    # A node in fabric is simulated with streams.
    for instance in sections["targets"]["sim"]["generate"]:
        given |= instance.get("simulation", {}) if isinstance(instance, dict) else {}
    spec, stimuli = (core.parent / given.pop(name) for name in ("spec", "stimuli"))
    # An accelerator in Python is its own model.
    model = core.parent / given.pop("model") if "model" in given else None
    # The simulators of accelerators in Verilog have their bench in Verilog, too.
    is_vhdl = given.get("simulator", "ghdl") == "ghdl"
    made = write(call(spec, stimuli, model, **given), tmp_path) if is_vhdl else generate_system(spec, tmp_path)
    names = {path.name for path in made}
    others = [path for path in spec.parent.rglob("*.vhd") if path.name not in names]
    work = user_of(firm, tmp_path)
    work.analyse([*made, *in_order(others)], *STRICT)
    elaborate_all(work, [*made, *others])


def analyse_converters(work: Library, library: MessageLibrary, names: list[MessageName], count: int) -> None:
    """Generate and analyse the converters of `count` messages, subscribers with each `pipeline`."""
    while count:
        name = names.pop()
        try:
            frame = frame_of(name, library.closure(name))
        except InputError as error:  # an illegal definition
            print(error)
            continue
        for width in (8, 64):
            # The pipelines' subscribers have the same name, so the last one analysed is kept.
            subscribers = (subscriber_files([frame], width, pipeline=pipeline) for pipeline in PIPELINES)
            for made in (*subscribers, publisher_files([frame], width)):
                for file, content in made.items():
                    (work.directory / file).write_text(str(content.content), encoding="ascii")
                files = [work.directory / file for file in made]
                work.analyse(files, *STRICT)
                elaborate_all(work, files)
        count -= 1


@pytest.mark.one_in(2)
@pytest.mark.parametrize("ros", [ROS1, ROS2], ids=["ros1", "ros2"])
def test_converters(firm: Library, ros: Middleware, tmp_path: Path) -> None:
    names = [parse_name(name) for name in MESSAGES]
    analyse_converters(user_of(firm, tmp_path), MessageLibrary(ros), names, len(names))


@pytest.mark.check
@pytest.mark.parametrize("ros", [ROS1, ROS2], ids=["ros1", "ros2"])
def test_converters_of_the_corpus(firm: Library, ros: Middleware, tmp_path: Path) -> None:
    library = MessageLibrary(ros, [corpus.definitions(f"ros{ros.number}", "can_msgs").parent])
    names = library.names()
    random.Random(SEED).shuffle(names)
    print(f"{SAMPLE} of {len(names)} messages, from seed {SEED}")
    analyse_converters(user_of(firm, tmp_path), library, names, SAMPLE)


MODERN_CORE = """\
CAPI=2:
name: user:top:modern:1
filesets:
  top:
    files: [modern.vhd]
    file_type: vhdlSource-2008
    depend: ["~robot:cdc:firm_cdc:0.2.0", "~robot:firm:generators:0.2.0"]
generate:
  pose: {generator: firm, position: prepend, parameters: {message: geometry_msgs/Pose, ros: 2}}
targets:
  sim:
    filesets: [top]
    generate: [pose]
    flow: sim
    flow_options: {tool: ghdl, analyze_options: [--std=08]}
    toplevel: modern
"""
MODERN = """\
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity modern is
end entity modern;

architecture simulation of modern is

  signal clk       : std_logic := '0';
  signal rst_n     : std_logic := '0';
  signal ends      : std_logic;
  signal not_ended : std_logic;

begin

  rst_n <= '1' after 12 ns;
  clk   <= not clk after 5 ns when not_ended else '0';

  u_reset : entity firm.firm_cdc_reset
    port map (clk => clk, rst_n => rst_n, synced_rst_n => ends);

  invert : process (all)
  begin
    not_ended <= not ends;
  end process invert;

  finish : process
  begin
    wait until ends = '1';
    report "PASS in " & to_string(now);
    wait;
  end process finish;

end architecture simulation;
"""


def test_a_project_in_vhdl_2008_uses_the_library(tmp_path: Path) -> None:
    (tmp_path / "modern.core").write_text(MODERN_CORE)
    (tmp_path / "modern.vhd").write_text(MODERN)
    fusesoc = shutil.which("fusesoc", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    assert fusesoc
    places = [f"--cores-root={folder}" for folder in (tmp_path, CORES, REPOSITORY / "generators")]
    command = [fusesoc, *places, "run", "--target=sim", "user:top:modern"]
    done = subprocess.run(command, cwd=tmp_path, text=True, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "PASS in " in done.stdout + done.stderr
