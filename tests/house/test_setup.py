"""Set-up installs missing programs, repeats nothing, and gives instructions if it may not install."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

from fusesoc_firm.tools.open_flows import OPEN_FLOWS
from fusesoc_firm.tools.programs import PROGRAMS

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


class Machine:
    """A folder of programs, which is the set-up's whole PATH."""

    def __init__(self, folder: Path) -> None:
        self.programs = folder / "bin"
        self.log = folder / "log"
        self.programs.mkdir()

    def add(self, name: str, script: str = "") -> None:
        # Only new files: nothing is written through existing ones.
        with (self.programs / name).open("x") as file:
            file.write(f"#!/bin/bash\n{script}\n")
        (self.programs / name).chmod(0o755)

    def add_apt(self, *brings: str) -> None:
        """Add an apt-get that records its calls, and whose `install` adds programs."""
        copies = [f'[ "$1" = update ] || /bin/cp {self.programs}/id {self.programs}/{name}' for name in brings]
        self.add("apt-get", "\n".join([f'echo "$DEBIAN_FRONTEND $*" >> {self.log}', 'echo "apt talks"', *copies]))

    def install(self) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["/bin/bash", ROOT / ".ci" / "install-tools"],
            env={"PATH": str(self.programs)},
            text=True,
            capture_output=True,
            check=False,
        )


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    machine = Machine(tmp_path)
    # This Python has all requested packages: the script checks its exit status.
    machine.add("python3", "exit 0")
    return machine


def test_nothing_is_installed_where_all_is_there(machine: Machine) -> None:
    machine.add("ghdl")
    machine.add("g++")
    machine.add_apt()
    done = machine.install()
    assert (done.stdout, done.stderr, done.returncode) == ("python3\n", "", 0)
    assert not machine.log.exists()


def test_what_is_missing_is_installed(machine: Machine) -> None:
    machine.add("id", "echo 0")
    machine.add_apt("ghdl", "g++")
    done = machine.install()
    # stdout contains only the Python to use, for make.
    assert (done.stdout, done.returncode) == ("python3\n", 0), done.stderr
    assert machine.log.read_text() == (
        "noninteractive update -q\nnoninteractive install -q -y --no-install-recommends ghdl g++\n"
    )


def test_without_root_it_says_what_is_missing(machine: Machine) -> None:
    machine.add("g++")
    machine.add("id", "echo 1000")
    machine.add_apt("ghdl")
    done = machine.install()
    assert (done.stdout, done.returncode) == ("", 1)
    assert done.stderr.startswith("Missing: ghdl\nOnly root can install them.")
    assert "  apt-get install --no-install-recommends ghdl\n" in done.stderr
    assert not machine.log.exists()


def test_without_apt_it_says_what_is_missing(machine: Machine) -> None:
    done = machine.install()
    assert done.returncode == 1
    assert done.stderr.startswith("Missing: ghdl g++\napt-get, which installs them, is not")


def test_what_apt_did_not_bring_is_said(machine: Machine) -> None:
    machine.add("id", "echo 0")
    machine.add_apt("g++")
    done = machine.install()
    assert done.returncode == 1
    assert "Missing: ghdl\napt-get ran" in done.stderr


@pytest.mark.parametrize(
    ("printed", "reason"),
    [
        ("E: Unable to locate package ghdl", "This system's release has no package of this name."),
        ("E: Package 'ghdl' has no installation candidate", "This system's release has no package of this name."),
        ("W: Failed to fetch ARCHIVE  Temporary failure resolving 'ARCHIVE'", "The package archive cannot be reached."),
        ("E: Could not get lock /var/lib/dpkg/lock-frontend.", "Another program is installing packages."),
    ],
)
def test_why_apt_could_not_install_is_said(machine: Machine, printed: str, reason: str) -> None:
    machine.add("id", "echo 0")
    machine.add("g++")
    machine.add("apt-get", f'echo "{printed}" >&2; exit 100')
    done = machine.install()
    assert done.returncode == 1
    assert f"Missing: ghdl\n{reason}" in done.stderr
    assert done.stderr.splitlines()[0] == printed


@pytest.mark.parametrize(("version", "status"), [("1.0.0", 1), ("0.37", 1), ("2.0.0", 0), ("10.1", 0)])
def test_an_old_ghdl_is_refused(machine: Machine, version: str, status: int) -> None:
    machine.add("ghdl", f'echo "GHDL {version} (Ubuntu) [Dunoon edition]"')
    machine.add("g++")
    done = machine.install()
    assert done.returncode == status
    assert (f"GHDL {version} is too old: 2.0 or later is needed." in done.stderr) == bool(status)


def test_make_without_a_target_lists_them() -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(["make"], cwd=ROOT, env=environment, text=True, capture_output=True, check=True)
    listed = [line.split()[0] for line in done.stdout.splitlines()[1:]]
    assert listed == [
        "help",
        "sim",
        "test",
        "check",
        "ci",
        "docs",
        "pages",
        "studio",
        "kilted",
        "corpus",
        "bench",
        "bitstream",
        "matrix",
        "proofs",
        "dissertation",
        "policies",
        "constants",
        "fuzz",
        "fuzz-netlist",
        "mutants",
        "debian",
        "lint",
        "licences",
        "setup",
        "clean",
        "distclean",
    ]


@pytest.mark.parametrize(
    ("variables", "arguments"),
    [
        ([], "robot:sys:quat2euler"),
        (["SEED=7"], "robot:sys:quat2euler --seed 7"),
        (["SYSTEM=a:b:c", "SEED=7", "WAVES=1"], "a:b:c --seed 7 --waves"),
        (
            ["TARGET=sim_icarus", "SIM_OPTIONS=-gX=1 -gY=2"],
            'robot:sys:quat2euler --tool icarus --options="-gX=1 -gY=2"',
        ),
    ],
)
def test_make_sim_passes_its_variables_on(variables: list[str], arguments: str) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    command = ["make", "--dry-run", "sim", *variables]
    done = subprocess.run(command, cwd=ROOT, env=environment, text=True, capture_output=True, check=True)
    assert f" .venv/bin/firm sim {arguments} ." in f"{' '.join(done.stdout.split())} ."


@pytest.mark.parametrize("target", ["test", "check", "ci"])
def test_make_test_passes_its_variables_on(target: str) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    command = ["make", "--dry-run", target, "SINCE=HEAD~1", "FRESH=1", "PYTEST_OPTIONS=-x"]
    done = subprocess.run(command, cwd=ROOT, env=environment, text=True, capture_output=True, check=True)
    assert '.venv/bin/python -m pytest --since "HEAD~1" --fresh -x' in done.stdout


def make_corpus(corpus: Path) -> list[str]:
    """The commands of `make corpus`, line by line."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    command = ["make", "--dry-run", "corpus", f"CORPUS={corpus}", "VERIFY_OPTIONS=--width 64"]
    return subprocess.run(
        command, cwd=ROOT, env=environment, text=True, capture_output=True, check=True
    ).stdout.splitlines()


def test_make_corpus_verifies_both_versions(tmp_path: Path) -> None:
    for ros in ("ros1", "ros2"):
        (tmp_path / ros).mkdir()
    text = " ".join(" ".join(make_corpus(tmp_path)).replace("\\", "").split())
    expected = (
        f'firm message verify --ros $ros --path "{tmp_path}/ros$ros" --report build/corpus_ros$ros.json --width 64'
    )
    assert expected in text


def test_make_corpus_without_a_corpus_is_one_line(tmp_path: Path) -> None:
    (line,) = make_corpus(tmp_path)
    assert line.startswith(f"echo \"No corpus: '{tmp_path}' does not contain the folders ros1 and ros2")


class Checkout:
    """This checkout with an environment in which pip and FuseSoC only record their calls."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = folder / "venv"
        (self.environment / "bin").mkdir(parents=True)
        self.add("venv/bin/python", f'PYTHONPATH={ROOT} exec {sys.executable} "$@"')
        for name in ("pip", "fusesoc"):
            self.add(f"venv/bin/{name}", f'echo "$*" >> {folder}/{name}')
        for name in ("ghdl", "g++", "yosys"):
            self.add(name)
        (self.environment / ".installed").touch()

    def add(self, name: str, script: str = "") -> None:
        (self.folder / name).write_text(f"#!/bin/bash\n{script}\n")
        (self.folder / name).chmod(0o755)

    def make(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "FUSESOC"))}
        return subprocess.run(
            ["make", f"VENV={self.environment}", "SYSTEM=robot:sys:obstacle", *arguments],
            cwd=ROOT,
            env={**kept, "PATH": f"{self.folder}:{os.environ['PATH']}"},
            text=True,
            capture_output=True,
            timeout=60,
            check=False,
        )

    def calls(self, program: str) -> list[str]:
        """The recorded calls of a program."""
        noted = self.folder / program
        return noted.read_text().splitlines() if noted.exists() else []


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    return Checkout(tmp_path)


def test_a_bitstream_brings_only_what_its_board_needs(checkout: Checkout) -> None:
    done = checkout.make("bitstream", "BOARD=tangnano9k")
    assert done.returncode == 0, done.stderr
    assert checkout.calls("pip") == ["install --disable-pip-version-check --editable .[apicula]"]
    assert checkout.calls("fusesoc") == ["run --setup --build --target=tangnano9k robot:sys:obstacle"]
    checkout.make("bitstream", "BOARD=tangnano9k")
    assert len(checkout.calls("pip")) == 1


def test_why_pip_failed_is_shown(checkout: Checkout) -> None:
    checkout.add(
        "venv/bin/pip", 'for word; do [ "$word" != --quiet ] || exit 1; done; echo "The conflict is this"; exit 1'
    )
    done = checkout.make("bitstream", "BOARD=icebreaker")
    assert done.returncode
    assert "The conflict is this\n" in done.stderr
    assert checkout.calls("fusesoc") == []


def test_a_missing_network_is_said(checkout: Checkout) -> None:
    checkout.add("venv/bin/pip", 'echo "WARNING: Retrying (Retry(total=4)) after connection broken"; exit 1')
    done = checkout.make("bitstream", "BOARD=icebreaker")
    assert done.returncode
    assert "The package index cannot be reached. Run make again with a network," in done.stderr


@pytest.mark.parametrize(
    ("prefix", "configured", "offered"),
    [
        ("echo", "exit 1", 1),
        ("echo", "echo .git/hooks", 1),
        ("echo", "echo .ci/hooks", 0),
        ("exit 128", "exit 1", 0),  # not a repository
        ("echo vendor/", "exit 1", 0),  # a folder of another repository
    ],
)
def test_setup_offers_the_hook_and_changes_no_configuration(
    checkout: Checkout, prefix: str, configured: str, offered: int
) -> None:
    checkout.add("git", f'echo "$*" >> {checkout.folder}/git.log; [ $1 = config ] && {configured} || {prefix}')
    done = checkout.make("setup")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("enable the hook: git config core.hooksPath .ci/hooks\n") == offered
    assert set(checkout.calls("git.log")) <= {"rev-parse --show-prefix", "config core.hooksPath"}


class Pythons:
    """Interpreters on the PATH of install-ros2, whose environments have wheels or not."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = folder / "ros2"

    def add(self, name: str, pip: str) -> None:
        """Add an interpreter, or uv, and the script that is the pip of its environments."""
        program = self.folder / name
        program.write_text(
            f"#!/bin/bash\necho {name} >> {self.folder}/log\nmkdir -p {self.environment}/bin\n"
            f"printf '#!/bin/bash\\n%s\\n' {shlex.quote(pip)} > {self.environment}/bin/pip\n"
            f"printf '#!/bin/bash\\n' > {self.environment}/bin/python\nchmod +x {self.environment}/bin/*\n"
        )
        program.chmod(0o755)

    def install(self) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [ROOT / ".ci" / "install-ros2", self.environment, "requirements.txt"],
            env={"PATH": f"{self.folder}:/usr/bin:/bin", "PYTHON": "own"},
            text=True,
            capture_output=True,
            check=False,
        )

    @property
    def tried(self) -> list[str]:
        return (self.folder / "log").read_text().split()


NO_WHEELS = "echo 'ERROR: No matching distribution found for ros-rclpy==7.1.6'; exit 1"


def test_ros2_is_installed_for_the_first_python_with_wheels(tmp_path: Path) -> None:
    pythons = Pythons(tmp_path)
    for name, pip in (("own", NO_WHEELS), ("python3.12", NO_WHEELS), ("python3.11", "exit 0"), ("uv", "exit 0")):
        pythons.add(name, pip)
    assert pythons.install().returncode == 0
    assert pythons.tried == ["own", "python3.12", "python3.11"]


def test_ros2_is_installed_with_uv_if_no_python_has_wheels(tmp_path: Path) -> None:
    pythons = Pythons(tmp_path)
    for name in ("own", *(f"python3.{minor}" for minor in range(11, 15))):
        pythons.add(name, NO_WHEELS)
    pythons.add("uv", "exit 0")
    assert pythons.install().returncode == 0
    assert pythons.tried[-1] == "uv"


@pytest.mark.parametrize(
    ("pip", "tried"), [(NO_WHEELS, 6), (f"echo 'WARNING: Retrying (Retry(total=4))'; {NO_WHEELS}", 1), ("exit 1", 1)]
)
def test_why_ros2_is_missing_is_one_line(tmp_path: Path, pip: str, tried: int) -> None:
    pythons = Pythons(tmp_path)
    for name in ("own", *(f"python3.{minor}" for minor in range(11, 15)), "uv"):
        pythons.add(name, pip)
    done = pythons.install()
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("The wheels of ROS 2 could not be installed: ")
    assert len(pythons.tried) == tried


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("sim TARGET=sim_vcs", ["has no target 'sim_vcs'", "its targets: default, sim, sim_icarus, sim_verilator,"]),
        ("sim TARGET=lint", ["target 'lint' of", "its targets with such a flow: sim, sim_icarus, sim_verilator,"]),
        ("sim SYSTEM=robot:sys:no", ["unknown core 'robot:sys:no'", "cores with sim: ", "robot:sys:quat2euler:"]),
        ("bitstream BOARD=iceberg", ["has no target 'iceberg'", "icebreaker, kr260, quartus, step_mxo2, tangnano9k"]),
    ],
)
def test_what_is_unknown_is_refused_before_anything_is_installed(
    checkout: Checkout, arguments: str, said: list[str]
) -> None:
    done = checkout.make(*arguments.split())
    assert done.returncode
    assert [text for text in said if text not in done.stderr] == []
    assert checkout.calls("pip") + checkout.calls("fusesoc") == []


def test_each_family_of_boards_has_an_extra_that_can_be_installed() -> None:
    boards = [yaml.safe_load(path.read_text(encoding="utf-8")) for path in ROOT.glob("fusesoc_firm/boards/*.yaml")]
    extras = {name: {Requirement(item).name for item in items} for name, items in extras_of_project().items()}
    assert {board["flow"] for board in boards} - {"quartus", "vivado"} == OPEN_FLOWS.keys()
    for name, flow in OPEN_FLOWS.items():
        assert extras[name] == {PROGRAMS[program].pypi for program in (flow.synthesis, flow.layout)} - {""}
    # nextpnr for Gowin requires a certain version of it; a limit of ours could only conflict.
    assert not any("apycula" in name.lower() for names in extras.values() for name in names)


def extras_of_project() -> dict[str, list[str]]:
    extras: dict[str, list[str]] = PROJECT["optional-dependencies"]
    return extras


@pytest.mark.parametrize(
    ("package", "version"),
    [
        # Cores in this version have no `get_data`.
        ("fusesoc", "2.4.6"),
        # The tool ghdl of this version ends in a NameError.
        ("edalize", "0.6.5"),
        # These versions append changes to a tool's configuration, so a second build has both.
        ("edalize", "0.6.6"),
        ("edalize", "0.6.7"),
    ],
)
def test_a_version_that_does_not_work_is_not_accepted(package: str, version: str) -> None:
    (accepted,) = (found for item in PROJECT["dependencies"] if (found := Requirement(item)).name == package)
    assert version not in accepted.specifier


def test_tests_find_this_python_first_and_an_empty_store() -> None:
    assert shutil.which("python3") == str(Path(sys.executable).with_name("python3"))
    store = Path(os.environ["FUSESOC_FIRM_CACHE"])
    assert store.is_relative_to(tempfile.gettempdir())
