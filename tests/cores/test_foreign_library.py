"""GHDL with LLVM or GCC links the library that VHPIDIRECT names as a file of the build folder: a core brings it."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.hdl.ghdl import CORES, core_description

USED = re.compile(r'"VHPIDIRECT (\S+) \w+"')
LINKED = CORES / "sim" / "linker" / "libc.so.6"


@pytest.mark.parametrize("core", sorted(CORES.glob("*/*.core")), ids=lambda path: path.stem)
def test_a_core_brings_the_libraries_that_it_names(core: Path) -> None:
    described = core_description(core)
    # A fileset may depend on a flag: "target_sim? (simulated)".
    names = [name for text in described["targets"]["default"]["filesets"] for name in re.findall(r"\w+\b(?!\?)", text)]
    filesets = [described["filesets"][name].get("files", []) for name in names]
    files = [file for fileset in filesets for file in fileset]
    sources = [core.parent / file for file in files if isinstance(file, str) and file.endswith(".vhd")]
    named = {library for source in sources for library in USED.findall(source.read_text(encoding="utf-8"))}
    brought = {places["copyto"] for file in files if isinstance(file, dict) for places in file.values()}
    assert named == brought
    if core.stem == "pipe":
        assert named == {LINKED.name}


@pytest.mark.skipif(not shutil.which("g++"), reason="g++ is not installed")
def test_the_file_refers_the_linker_to_the_c_library(tmp_path: Path) -> None:
    shutil.copy(LINKED, tmp_path)
    (tmp_path / "main.cpp").write_text('#include <cstdio>\nint main() { puts("flushed"); return fflush(nullptr); }\n')
    subprocess.run(["g++", "-nodefaultlibs", "main.cpp", LINKED.name, "-o", "main"], cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout == "flushed\n"
