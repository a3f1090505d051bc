"""Build a simulator from a specification, with FuseSoC and Edalize's makefile.

    built = build_simulator(Path("robot.yaml"))
    with Simulator(built.command(seed=7), built.folder) as simulator:           # node/transport/simulator.py
        ...

The system's core is expected beside the specification. If it is missing, a core is written to the build folder. A
second call rebuilds only changed parts.
"""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusesoc_firm.core.core_reader import CoreFile, core_name, read_core
from fusesoc_firm.core.request import CoreFolders, no_core_folders
from fusesoc_firm.system.message_sources import core_of, load_beside
from fusesoc_firm.system.scaffold.core_file import CoreOptions, new_core
from fusesoc_firm.text.diagnostics import InputError, fail
from fusesoc_firm.text.file_lock import locked
from fusesoc_firm.text.files import write_if_changed
from fusesoc_firm.text.yaml_text import data_in
from fusesoc_firm.tools.digests import default_root
from fusesoc_firm.tools.library_path import library_root
from fusesoc_firm.tools.programs import missing, simulation_programs, ways
from fusesoc_firm.tools.simulators import Live, default_simulator, fitting

MOST_SEED, MOST_STALL_PERCENT = 2147483562, 99
"""The largest seed and percentage of stalls that a test bench accepts."""
_SHOWN_LINES = 20
_UNKNOWN_UNIT = re.compile(r'unit "(\w+)" not found in library "\w+"')


@dataclass(frozen=True)
class CoreSources:
    """The message sources and files of a core to write for a specification; an existing core takes precedence."""

    paths: Sequence[Path] = ()
    distro: str = ""
    depend: Sequence[str] = ()
    environment: Sequence[Path] = ()
    core_folders: CoreFolders = no_core_folders


@dataclass(frozen=True)
class BuiltSimulator:
    """A simulator, and the folder in which it must be started."""

    tool: str
    folder: Path
    words: tuple[str, ...] = field(repr=False)

    def command(self, *, seed: int = 1, stall_percent: int = 0) -> list[str]:
        """Return the command to run in `folder`; `seed` selects the `stall_percent` of cycles with stalls."""
        live = _live(self.tool)
        place = self.words.index(live.before) if live.before else len(self.words)
        parameters = [f"{live.parameter}SEED={seed}", f"{live.parameter}STALL_PERCENT={stall_percent}"]
        return [*self.words[:place], *parameters, *self.words[place:]]

    def script(self, *, seed: int = 1, stall_percent: int = 0) -> Path:
        """Write a program that starts the simulator from any folder, and return its path."""
        path = self.folder / f"run-simulator-seed{seed}-stall{stall_percent}"
        command = shlex.join(self.command(seed=seed, stall_percent=stall_percent))
        text = "#!/bin/sh\n# The simulated system at the end of a pipe: descriptors 3 and 4.\n"
        write_if_changed(path, f"{text}cd {shlex.quote(str(self.folder))} && exec {command}\n".encode())
        path.chmod(0o755)
        return path


def build_simulator(
    spec: Path,
    tool: str | None = None,
    *,
    build_root: Path | None = None,
    sources: CoreSources | None = None,
    target: str = "",
) -> BuiltSimulator:
    """Build a simulator of a specification's system, or rebuild the changed parts. May raise `InputError`.

    All systems and tools share `build_root`, by default a folder in the user's cache. `sources` applies only if no core
    beside the specification names the specification. `target` overrides the target of live simulations.
    """
    tool = tool or default_simulator(is_live=True)
    _live(tool)
    if not spec.is_file():
        fail(f"there is no specification '{spec}'")
    if absent := missing(dict.fromkeys([*simulation_programs(tool), "make"])):
        fail(f"missing programs: {', '.join(absent)}", hint="; ".join(ways(program) for program in absent))
    spec = spec.resolve()
    folder = _build_folder(spec, target or tool, build_root or Path(default_root()) / "simulators")
    target = target or ("live" if tool == default_simulator(is_live=True) else f"live_{tool}")
    with locked(folder):
        core = core_of(spec) or _write_core(spec, folder / "core", sources or CoreSources())
        work = folder / "work"
        is_new = not work.exists()
        try:
            _build(spec, core, (target, tool), work)
        except InputError:
            if is_new:
                raise
            # FuseSoC's list of libraries may refer to deleted files.
            shutil.rmtree(work)
            _build(spec, core, (target, tool), work)
        return BuiltSimulator(tool, work, tuple(_words(work, tool)))


def _write_core(spec: Path, folder: Path, sources: CoreSources) -> CoreFile:
    """Write a core for a specification without a core, and return it."""
    paths = [path.absolute() for path in sources.paths]
    loaded = load_beside(spec, paths, sources.distro or None, core_folders=sources.core_folders)
    system = loaded.system
    options = CoreOptions(
        name=f"robot:live:{system.name}:0",
        depend=[*sources.depend, *loaded.specification.message_cores],
        environment=[str(path.absolute()) for path in sources.environment],
        paths=list(map(str, paths)),
        distro=sources.distro,
    )
    core = folder / f"{_short_name(spec)}.core"
    write_if_changed(core, new_core(system, str(spec), options))
    return read_core(core)


def _build_folder(spec: Path, purpose: str, root: Path) -> Path:
    """Return a separate folder for each specification and purpose, whose name includes the specification's name."""
    digest = hashlib.sha256(str(spec).encode()).hexdigest()[:12]
    folder = root.absolute() / f"{_short_name(spec)}-{digest}-{purpose}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fail(f"cannot write {folder}: {error.strerror}")
    return folder


def _short_name(spec: Path) -> str:
    """Return a specification's file name without the characters that make and simulators reject in a path."""
    return re.sub(r"[^A-Za-z0-9_.+-]", "_", spec.stem).lstrip("-")[:60]


def _build(spec: Path, core: CoreFile, target_and_tool: tuple[str, str], work: Path) -> None:
    """Set up the target with FuseSoC, and run make."""
    targets, (target, tool) = core.section("targets"), target_and_tool
    if target not in targets:
        fail(f"{core.path} has no target '{target}'", hint=f"run 'firm system core {spec}' to add the target")
    made_with = core.replaced(target, "simulation").get("simulator", default_simulator())
    if made_with != tool:
        fail(f"target '{target}' of {core.path} is for {made_with}", hint=f"use --tool {made_with}")
    _run(spec, fusesoc_run(core, target, work, "--setup", "--build"), project_folder(spec))
    if step := _live(tool).made_by:
        _run(spec, ["make", step], work)


def fusesoc_run(core: CoreFile, target: str, work: Path, *stages: str) -> list[str]:
    """Return the FuseSoC command that runs stages of a core's target in the folder `work`."""
    command = [sys.executable, "-m", "fusesoc.main", "--cores-root", library_root(), "--cores-root", core.path.parent]
    command += ["run", *stages, f"--target={target}", "--work-root", work, core.data.get("name", "")]
    return list(map(str, command))


def project_folder(spec: Path) -> Path:
    """Return the specification's nearest parent folder that contains a `fusesoc.conf`, or the current folder."""
    return next((folder for folder in spec.parents if (folder / "fusesoc.conf").is_file()), Path.cwd())


def _run(spec: Path, command: Sequence[str], folder: Path) -> str:
    """Run a step of the build; return its output."""
    done = subprocess.run(
        command,
        cwd=folder,
        env={name: value for name, value in os.environ.items() if name != "EDALIZE_LAUNCHER"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    if done.returncode:
        _fail_for_units(spec, done.stdout)
        lines = [line for line in done.stdout.splitlines() if not line.startswith("INFO:")]
        shown = "\n".join(lines[-_SHOWN_LINES:])
        fail(f"cannot build the simulator for {spec}: {shlex.join(command)} in {folder} failed:\n{shown}")
    return done.stdout


def _fail_for_units(spec: Path, output: str) -> None:
    """Raise `InputError` if a build failed because the system's core does not depend on the cores of some units."""
    if units := dict.fromkeys(_UNKNOWN_UNIT.findall(output)):
        # The library consists of links, into which a recursive pattern does not lead.
        roots = [path.resolve() for path in library_root().iterdir()]
        files = [path for unit in units for root in roots for path in root.rglob(f"{unit}.vhd")]
        cores = {str(read_core(core).data.get("name", "")) for path in files for core in _cores_of(path)}
        options = " ".join(f"--depend {core_name(name)}" for name in sorted(cores)) or "--depend CORE for each"
        fail(
            f"the accelerators of {spec.name} use units of other cores: {', '.join(units)}",
            hint=f"write a core that depends on these: firm system core {spec.name} {options}",
        )


def _cores_of(path: Path) -> list[Path]:
    """Return the core files of the folder that contains a source, or of the nearest one above it."""
    return next(([*found] for folder in path.parents if (found := sorted(folder.glob("*.core")))), [])


def _flow(work: Path) -> Any:
    """Return FuseSoC's description of the build."""
    return data_in(next(work.glob("*.eda.yml")))


def _words(work: Path, tool: str) -> list[str]:
    """Return the command that starts the simulator in its folder."""
    if not (start := _live(tool).started_by):
        return [str(work / f"V{_flow(work)['toplevel']}")]
    steps = _run(work, ["make", "--file=Makefile", "--dry-run", "run"], work).split("\n")
    return shlex.split([line for line in steps if line.startswith(start)][-1])


def _live(tool: str) -> Live:
    """Return the tool's support for live simulation. Raise `InputError` without this support."""
    if tool not in (known := fitting(is_live=True)) or not (live := known[tool].live):
        fail(f"unknown simulator '{tool}' for live systems", hint=f"legal: {', '.join(known)}")
    return live
