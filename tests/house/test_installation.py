"""Another project adds the library and calls the generators, from a wheel and a checkout, with nothing activated."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from fusesoc_firm import __version__

ROOT = Path(__file__).resolve().parents[2]
ROBOT = Path(__file__).parent / "data" / "robot"
# One worker runs them all, so that each kind is installed once.
pytestmark = [pytest.mark.check, pytest.mark.xdist_group("installation")]


PROJECT_CORE = """\
CAPI=2:
name: me:proj:robot:1.0
filesets:
  base:
    depend: ["robot:firm:generators"]
generate:
  pose:
    generator: firm
    parameters:
      message: geometry_msgs/Quaternion
      {ros}
    position: prepend
targets:
  default:
    filesets: [base]
    generate: [pose]
    toplevel: axis_to_geometry_msgs_quaternion
    flow: generic
    flow_options: {{tool: ghdl}}
"""
# A core as left behind by a build.
LEFT_BEHIND = "CAPI=2:\nname: robot:sys:left-behind:0\ntargets: {default: {}}\n"


@dataclass(frozen=True)
class Installation:
    """An environment with the package, and the source folder that it was installed from."""

    environment: Path
    source: Path

    def python(self, *arguments: str) -> str:
        return self._run(self.environment / "bin" / "python3", *arguments, cwd=self.environment).stdout.strip()

    def fusesoc(self, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
        return self._run(self.environment / "bin" / "fusesoc", *arguments, cwd=cwd, check=False)

    def firm(self, *arguments: str, cwd: Path | None = None) -> str:
        return self._run(self.environment / "bin" / "firm", *arguments, cwd=cwd or self.environment).stdout.strip()

    def library(self, *options: str, cwd: Path | None = None) -> Path:
        return Path(self.firm("path", *options, cwd=cwd))

    def _run(self, *command: str | Path, cwd: Path, check: bool = True) -> subprocess.CompletedProcess[str]:
        home = self.environment.parent / "home"
        # Nothing is activated: `python3` is the system's, without our package.
        environment = {"PATH": "/usr/bin:/bin", "HOME": str(home), "LANG": "C.UTF-8"}
        return subprocess.run(command, cwd=cwd, env=environment, text=True, capture_output=True, check=check)


def copy_source(destination: Path) -> None:
    ignored = shutil.ignore_patterns(".git", ".venv", "*.egg-info", "__pycache__", ".*_cache", ".hypothesis")
    shutil.copytree(ROOT, destination, symlinks=True, ignore=ignored)
    # A checkout in use, with builds and an environment that contain cores.
    for folder in ("build/robot_sys_x_0/sim/generator_cache/y", "build/lib/fusesoc_firm"):
        (destination / folder).mkdir(parents=True)
        (destination / folder / "left-behind.core").write_text(LEFT_BEHIND)


def pip(*arguments: str | Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *map(str, arguments)]
    done = subprocess.run(command, env=environment, text=True, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def lend_packages(environment: Path) -> None:
    """Let an environment import the packages of the tests' environment, so that nothing is downloaded."""
    (site_packages,) = environment.glob("lib/python3*/site-packages")
    (site_packages / "lent.pth").write_text(sysconfig.get_path("purelib") + "\n")
    script = environment / "bin" / "fusesoc"
    script.write_text(f"#!{environment}/bin/python3\nimport sys\nfrom fusesoc.main import main\nsys.exit(main())\n")
    script.chmod(0o755)


@pytest.fixture(scope="module", params=["wheel", "editable"])
def installation(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """The package installed in a fresh environment."""
    folder = tmp_path_factory.mktemp(request.param)
    made = Installation(folder / "environment", folder / "source")
    copy_source(made.source)
    venv.create(made.environment, symlinks=True)
    into = (
        "--python",
        made.environment / "bin" / "python3",
        "install",
        "--no-deps",
        "--no-index",
        "--ignore-installed",
    )
    if request.param == "wheel":
        pip("wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, made.source)
        pip(*into, *folder.glob("*.whl"))
        lend_packages(made.environment)
    else:
        lend_packages(made.environment)
        pip(*into, "--no-build-isolation", "--editable", made.source)
    return made


@pytest.fixture
def project(installation: Installation, tmp_path: Path) -> Path:
    """Another project, which has added the library as in docs/how-to/add-the-library.md."""
    (tmp_path / "robot").mkdir()
    (tmp_path / "fusesoc.conf").write_text("")
    for name, location in (("firm", installation.library()), ("own", tmp_path / "robot")):
        done = installation.fusesoc("library", "add", name, str(location), cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    return tmp_path


def files_below(library: Path, *rooms: str) -> set[str]:
    paths = [path for room in rooms for path in (library / room).rglob("*")]
    files = {path.relative_to(library).as_posix() for path in paths if path.is_file()}
    return {name for name in files if "__pycache__" not in name}


def test_the_library_is_installed_whole(installation: Installation) -> None:
    library = installation.library()
    assert library.is_relative_to(installation.environment) or library.is_relative_to(installation.source)
    rooms = ("cores", "generators")
    assert "generators/generators.core" in files_below(library, *rooms)
    assert files_below(library, *rooms) == files_below(installation.source, *rooms)
    assert {path.name for path in library.iterdir()} == {*rooms}
    demos = installation.library("--demos")
    assert files_below(demos, "") == files_below(installation.source / "specs", "")
    assert "obstacle/obstacle.core" in files_below(demos, "")


def test_the_description_names_pages_that_are_installed(installation: Installation) -> None:
    """Its links work wherever it is shown: all lead to the web."""
    text = installation.python(
        "-c", "from importlib.metadata import metadata as m; print(m('fusesoc-firm').get_payload())"
    )
    assert re.findall(r"\]\((?!https?:)[^)]*\)", text) == []
    docs = Path(installation.firm("path", "--docs"))
    named = re.findall(r"`docs/([\w/-]+\.md)`", text)
    assert "index.md" in named
    assert [page for page in named if not (docs / page).is_file()] == []


def test_another_project_sees_each_core_once(installation: Installation, project: Path) -> None:
    done = installation.fusesoc("core", "list", cwd=project)
    assert f"robot:firm:generators:{__version__}" in done.stdout
    assert "left-behind" not in done.stdout
    assert "Replacing" not in done.stderr
    assert "Parse error" not in done.stderr
    # Only its own cores, and those that it may use.
    assert "robot:sys:" not in done.stdout
    shown = installation.fusesoc("gen", "show", "far", cwd=project)
    assert "spec (str): " in shown.stdout


def test_a_project_that_is_committed_has_relative_libraries(installation: Installation, tmp_path: Path) -> None:
    libraries = {"firm": [], "firm_demos": ["--demos"]}
    sections = {name: installation.library("--relative", *options, cwd=tmp_path) for name, options in libraries.items()}
    assert not any(location.is_absolute() for location in sections.values())
    (tmp_path / "fusesoc.conf").write_text(
        "".join(f"[library.{name}]\nlocation = {location}\n" for name, location in sections.items())
    )
    done = installation.fusesoc("core", "list", cwd=tmp_path)
    assert f"robot:firm:generators:{__version__}" in done.stdout
    assert f"robot:sys:obstacle:{__version__}" in done.stdout
    assert "Replacing" not in done.stderr


def test_an_environment_in_a_library_has_no_cores(installation: Installation, tmp_path: Path) -> None:
    libraries = {"own": installation.environment, "firm": installation.library()}
    (tmp_path / "fusesoc.conf").write_text(
        "".join(f"[library.{name}]\nlocation = {location}\n" for name, location in libraries.items())
    )
    done = installation.fusesoc("core", "list", cwd=tmp_path)
    assert f"robot:firm:generators:{__version__}" in done.stdout
    assert "Replacing" not in done.stderr
    assert "robot:sys:" not in done.stdout


def test_a_whole_checkout_can_be_the_library(installation: Installation, tmp_path: Path) -> None:
    (tmp_path / "fusesoc.conf").write_text(f"[library.firm]\nlocation = {installation.source}\n")
    done = installation.fusesoc("core", "list", cwd=tmp_path)
    assert f"robot:firm:generators:{__version__}" in done.stdout
    assert "left-behind" not in done.stdout
    assert "Replacing" not in done.stderr


def test_the_checkout_itself_is_a_project(installation: Installation) -> None:
    done = installation.fusesoc("core", "list", cwd=installation.source)
    assert f"robot:firm:generators:{__version__}" in done.stdout
    assert "left-behind" not in done.stdout
    assert "Replacing" not in done.stderr


def test_a_fault_in_another_projects_core_is_shown_there(installation: Installation, project: Path) -> None:
    core = project / "robot" / "robot.core"
    core.write_text(PROJECT_CORE.format(ros="ros: 3"))
    done = installation.fusesoc("run", "--setup", "me:proj:robot", cwd=project)
    assert done.returncode == 1
    assert f"{core}:11:12: error: parameter 'ros' is 3, but must be one of 1, 2\n" in done.stderr
    assert "Traceback" not in done.stderr


def test_another_projects_core_calls_a_generator(installation: Installation, project: Path) -> None:
    (project / "robot" / "robot.core").write_text(PROJECT_CORE.format(ros="ros: 1"))
    done = installation.fusesoc("run", "--setup", "me:proj:robot", cwd=project)
    assert done.returncode == 0, done.stderr
    (description,) = project.glob("build/me_proj_robot_1.0/default/*.eda.yml")
    files = {Path(file["name"]).name: file for file in yaml.safe_load(description.read_text())["files"]}
    for name in ("axis_to_geometry_msgs_quaternion.vhd", "geometry_msgs_quaternion_to_axis.vhd"):
        assert files[name]["file_type"] == "vhdlSource-93"
        assert files[name]["core"] == "me:proj:robot-pose:1.0"
    # A converter brings only its own dependencies: no Manager, no schedulers, no links, no launcher.
    assert {file["core"] for file in files.values()} == {
        "me:proj:robot-pose:1.0",
        f"robot:axis:firm_axis:{__version__}",
        f"robot:axis:firm_axis_package:{__version__}",
    }


@pytest.mark.skipif(shutil.which("verilator") is None, reason="Verilator is not installed")
def test_another_projects_core_becomes_a_netlist(installation: Installation, project: Path) -> None:
    """Edalize finds and runs the tool `ghdlsynth` in the environment of this package."""
    text = PROJECT_CORE.format(ros="ros: 1").replace("flow: generic", "flow: lint")
    text = text.replace("{tool: ghdl}", "{tool: verilator, frontends: [ghdlsynth]}")
    (project / "robot" / "robot.core").write_text(text)
    done = installation.fusesoc("run", "me:proj:robot", cwd=project)
    assert done.returncode == 0, done.stdout + done.stderr
    (netlist,) = project.glob("build/me_proj_robot_1.0/default/*_netlist.v")
    assert "module axis_to_geometry_msgs_quaternion\n" in netlist.read_text()


def test_another_projects_core_simulates_converters_of_a_message_and_of_a_configuration(
    installation: Installation, project: Path
) -> None:
    """The method of listing 5.1: `robot/grip.yaml` names the interfaces, `robot/loop_tb.vhd` instantiates them."""
    shutil.copytree(ROBOT, project / "robot", dirs_exist_ok=True)
    done = installation.fusesoc("run", "me:robots:loop", cwd=project)
    assert done.returncode == 0, done.stdout + done.stderr
    # The MD5 sum of geometry_msgs/Twist matches ROS 1's.
    assert "PASS 9f195f881246fdfa2798d1d3eebca84a RIHS01_" in done.stdout
    (description,) = project.glob("build/me_robots_loop_1.0/default/*.eda.yml")
    files = [Path(file["name"]).name for file in yaml.safe_load(description.read_text())["files"]]
    assert (
        files.index("demo_msgs_grip_pkg.vhd") < files.index("axis_to_demo_msgs_grip.vhd") < files.index("AXIS2Left.vhd")
    )
    again = installation.fusesoc("run", "me:robots:loop", cwd=project)
    assert again.stdout.count(" from store in ") == 2


def test_a_fault_in_another_projects_configuration_is_shown_there(installation: Installation, project: Path) -> None:
    shutil.copytree(ROBOT, project / "robot", dirs_exist_ok=True)
    path = project / "robot" / "grip.yaml"
    path.write_text(path.read_text().replace("subscribers:", "subscriber:"))
    done = installation.fusesoc("run", "me:robots:loop", cwd=project)
    assert done.returncode == 1
    assert f"{path}:10:5: error: an item of 'messages' has no key 'subscriber'\n" in done.stderr
    assert "did you mean 'subscribers'?" in done.stderr
    assert "Traceback" not in done.stderr
