"""Random systems: what is generated for them is VHDL that GHDL takes as a whole."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.system.scaffold.skeleton import missing_sources
from fusesoc_firm.system.system_core import load_system
from tests.hdl.ghdl import Library, core_files
from tests.random_systems import random_system
from tests.seeds import seeded
from tests.system.simulated.systems import RUNTIME, generate_system

SEED = seeded(20241121)


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which GHDL has the cores that systems instantiate."""
    folder = tmp_path_factory.mktemp("runtime")
    Library("firm", folder).analyse(core_files(*RUNTIME))
    return folder


@pytest.mark.one_in(3)
@pytest.mark.parametrize("number", range(6))
def test_a_random_system_is_elaborated(number: int, runtime: Path, tmp_path: Path) -> None:
    """Accelerators are skeletons, which have all ports."""
    print(f"seed {SEED + number}")
    chance = random.Random(SEED + number)
    (tmp_path / "spec.yaml").write_text(random_system(chance, 4 + 2 * number, 3 + number).text, encoding="utf-8")
    libraries = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
    system = load_system(tmp_path / "spec.yaml", libraries, needs_sources=False).system
    for path, text in missing_sources(system, tmp_path).items():
        path.write_text(text, encoding="utf-8")
    files = generate_system(tmp_path / "spec.yaml", tmp_path / "core")
    work = Library(f"random_{number}", runtime)
    work.analyse(files)
    work.elaborate(system.entity)
