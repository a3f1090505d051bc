"""The main job of a new user: `fusesoc run --target=sim robot:sys:quat2euler`, and its guarantees."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import pytest

from fusesoc_firm import __version__
from fusesoc_firm.tools import manifest
from tests.processes import program

ROOT = Path(__file__).resolve().parents[2]
FUSESOC = Path(program("fusesoc"))
CORES = ("quat2euler", "quat2euler_hls")
# Tests of one core share a store and a build folder, so one worker must run them.
shared = [pytest.param(core, marks=pytest.mark.xdist_group(f"main_job_{core}")) for core in CORES]


def run(
    core: str,
    build_root: Path,
    *options: str,
    project: Path = ROOT,
    is_activated: bool = True,
    environment: Mapping[str, str] = MappingProxyType({}),
    target: str = "sim",
) -> subprocess.CompletedProcess[str]:
    """Run FuseSoC in the folder of `project`, with the store next to `build_root`."""
    variables = {
        # The package of this checkout, even if another is installed.
        "PYTHONPATH": str(project),
        "PATH": f"{FUSESOC.parent}:/usr/bin:/bin" if is_activated else "/usr/bin:/bin",
        "HOME": str(build_root.parent),
        "LANG": "C.UTF-8",
        "FUSESOC_FIRM_CACHE": str(build_root.parent / "store"),
        **{name: os.environ[name] for name in ("OBJCACHE", "CCACHE_DIR") if name in os.environ},
        **environment,
    }
    command = ["fusesoc" if is_activated else str(FUSESOC), "run", f"--build-root={build_root}", f"--target={target}"]
    return subprocess.run(
        # env looks up the command on the PATH of the child.
        ["/usr/bin/env", *command, f"robot:sys:{core}", *options],
        cwd=project,
        env=variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def has_passed(done: subprocess.CompletedProcess[str]) -> bool:
    print(done.stdout)
    return done.returncode == 0 and "PASS 100/100" in done.stdout.splitlines()


@pytest.mark.check
@pytest.mark.parametrize(
    ("name", "messages"),
    [
        ("image_pipeline_software", 14),
        ("sobel", 7),
        ("resize", 13),
        ("multi_type", 19),
        ("robotic_arm_franka", 3),
        ("complementary_filter", 11),
        ("joint_pid", 9),
        ("scan_sectors", 18),
        ("inverse_kinematics", 8),
        ("cloud_occupancy", 5),
        ("state_kalman", 12),
        ("perception", 20),
        ("quat2euler_python", 16),
    ],
)
def test_every_other_application_passes(tmp_path: Path, name: str, messages: int) -> None:
    done = run(name, tmp_path / "build")
    print(done.stdout)
    assert done.returncode == 0
    assert f"PASS {messages}/{messages}" in done.stdout.splitlines()


def work_folder(build_root: Path, core: str) -> Path:
    return build_root / f"robot_sys_{core}_{__version__}" / "sim"


@pytest.fixture(scope="module")
def build_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("main_job") / "build"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of the files for the main job, which tests may change."""
    return copy_project(tmp_path / "project")


def copy_project(destination: Path) -> Path:
    ignored = shutil.ignore_patterns("__pycache__", "demos", "library", "node_modules")
    for folder in ("fusesoc_firm", "cores", "generators", "specs"):
        shutil.copytree(ROOT / folder, destination / folder, ignore=ignored)
    shutil.copy(ROOT / "fusesoc.conf", destination)
    return destination


@pytest.mark.one_in(2)
@pytest.mark.parametrize("core", shared)
def test_it_passes_and_a_second_time_comes_out_of_the_store(core: str, build_root: Path) -> None:
    assert has_passed(run(core, build_root))
    second = run(core, build_root)
    assert has_passed(second)
    for instance in ("system", "simulation"):
        assert f"far: {core}-{instance} from store in " in second.stdout


@pytest.mark.one_in(2)
@pytest.mark.parametrize("core", shared)
def test_it_passes_without_an_activated_environment(core: str, build_root: Path) -> None:
    (work_folder(build_root, core) / manifest.FILE).unlink(missing_ok=True)
    assert has_passed(run(core, build_root, is_activated=False))
    assert {"ghdl", "fusesoc", "edalize", "fusesoc-firm"} <= manifest.read(work_folder(build_root, core)).keys()


@pytest.mark.check
@pytest.mark.parametrize("core", shared)
def test_another_seed_and_waves_on_request(core: str, build_root: Path) -> None:
    waves = work_folder(build_root, core) / "waves.ghw"
    first = run(core, build_root)
    assert "seed 1, stalls 25 %" in first.stdout
    assert not waves.exists()
    other = run(core, build_root, "--sim_options=-gSEED=7 --wave=waves.ghw")
    assert has_passed(other)
    assert "seed 7, stalls 25 %, 8 bits; to repeat: -gSEED=7 -gSTALL_PERCENT=25" in other.stdout
    assert waves.stat().st_size > 10_000
    waves.unlink()


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("core", "source", "right", "wrong"),
    [
        ("quat2euler", "rtl/quat2euler.vhd", "<= out_x_r;", "<= not out_x_r;"),
        ("quat2euler_hls", "QuaternionToEuler.cpp", "wrap(alpha - beta)", "wrap(beta - alpha)"),
    ],
)
def test_a_broken_accelerator_fails(project: Path, core: str, source: str, right: str, wrong: str) -> None:
    path = project / "specs" / "quat2euler" / source
    text = path.read_text(encoding="utf-8")
    assert right in text
    path.write_text(text.replace(right, wrong), encoding="utf-8")
    done = run(core, project.parent / "build", project=project)
    assert done.returncode != 0
    assert any(line.startswith("FAIL ") for line in done.stdout.splitlines())
    assert "PASS" not in done.stdout


def test_a_bad_specification_ends_the_run_with_its_place(project: Path) -> None:
    path = project / "specs" / "quat2euler" / "quat2euler.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace("mode: publisher", "mode: sink"), encoding="utf-8")
    done = run("quat2euler", project.parent / "build", project=project)
    assert done.returncode != 0
    assert (
        f"{path}:31:11: error: 'mode' cannot be 'sink'\n   31 |     mode: sink\n      |           ^~~~" in done.stdout
    )
    assert "Traceback" not in done.stdout


def generated_files(build_root: Path) -> dict[str, bytes]:
    """All generated files by core and path, except FuseSoC's calls, which contain paths, and names of runs."""
    found = {}
    for path in build_root.rglob("generator_cache/*/**/*"):
        if path.is_file() and not path.name.endswith(("_input.yml", ".run")):
            core, *parts = path.parts[path.parts.index("generator_cache") + 1 :]
            found["/".join([core.rpartition("-")[0], *parts])] = path.read_bytes()
    return found


@pytest.mark.check
@pytest.mark.parametrize("core", CORES)
def test_two_clean_builds_are_the_same_to_the_byte(core: str, tmp_path: Path) -> None:
    builds = []
    for name, environment in (
        ("one", {"TZ": "UTC", "LANG": "C", "PYTHONHASHSEED": "1"}),
        (
            "another/deeper/folder",
            {"TZ": "Asia/Kathmandu", "LANG": "C.UTF-8", "PYTHONHASHSEED": "2", "USER": "somebody"},
        ),
    ):
        project = copy_project(tmp_path / name / "project")
        done = run(core, tmp_path / name / "build", project=project, environment=environment)
        assert has_passed(done)
        assert "from store" not in done.stdout
        builds.append(generated_files(tmp_path / name / "build"))
    names = {name.rpartition("/")[2] for name in builds[0]}
    assert {"stimulus.txt", "expected.txt", f"{core}-system.core", f"{core}-simulation.core"} <= names
    assert ("libQuaternionToEuler.so" in names) is (core == "quat2euler_hls")
    assert builds[0] == builds[1]


def test_the_environment_of_these_tests_is_the_checkout() -> None:
    script = "import fusesoc_firm; print(fusesoc_firm.__file__)"
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", script], env=variables, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).is_relative_to(ROOT)
