"""Run FuseSoC for one build, with its whole output in the build's log."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from fusesoc_firm.builds.setup.libraries import has_library, open_libraries
from fusesoc_firm.builds.setup.outcome import Build, configuration
from fusesoc_firm.tools.library_path import library_root

_LIBRARY_CORE = "robot:firm:firm_system"


def run_logged(build: Build, stages: Sequence[str], options: Sequence[str], tell: Callable[[str], None]) -> int:
    """Run these stages of a build, all if empty, and call `tell` for each line; return FuseSoC's exit status.

    `options` follow the core's name.
    """
    build.log.parent.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("EDALIZE_LAUNCHER", shlex.join([sys.executable, "-m", "fusesoc_firm.cli", "tool"]))
    environment = os.environ | {"MAKEFLAGS": "--no-print-directory", "PYTHONUNBUFFERED": "1"}
    code = "from fusesoc_firm.builds.setup.libraries import main; main()"
    command = [sys.executable, "-c", code, "--monochrome", "run", *stages, f"--target={build.target}"]
    with (
        build.log.open("w", encoding="utf-8") as log,
        subprocess.Popen(
            [*command, build.core, *options],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="backslashreplace",
        ) as process,
    ):
        assert process.stdout
        for line in process.stdout:
            log.write(line)
            tell(line.rstrip())
    return process.returncode


def add_libraries(core: str, folder: Path | None) -> None:
    """Add our library and `folder` to FuseSoC's libraries, for this process and those that it starts, if missing."""
    fusesoc = open_libraries()
    known = {name.rpartition(":")[0] for name in fusesoc.get_cores()}
    places = [library_root()] if _LIBRARY_CORE not in known else []
    if folder and not has_library(fusesoc, folder) and core.rpartition(":")[0] not in known and core not in known:
        places.append(folder.resolve())
    if places:
        former = os.environ.get("FUSESOC_CORES")
        os.environ["FUSESOC_CORES"] = ":".join([*([former] if former else []), *map(str, places)])
        # A library that contains the builds must not provide their generated cores.
        root = Path(configuration().build_root)
        root.mkdir(parents=True, exist_ok=True)
        (root / "FUSESOC_IGNORE").touch()
