"""`firm check`: report the faults of a system before anything is built, as `firm sim` does first."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import (
    add_json,
    add_sources,
    add_spec,
    check_sources,
    command,
    core_folders,
    load,
    print_json,
    print_warnings,
)
from fusesoc_firm.cli.progress import Progress
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics, InputError
from fusesoc_firm.text.outputs import shown

if TYPE_CHECKING:
    from fusesoc_firm.system.system_core import LoadedSystem


# The target that simulates a system by default.
_SIMULATION = "sim"


def add_check(commands: Any) -> None:
    """Declare the command, which is also an action of `firm system`."""
    check = command(
        commands,
        "check",
        "report all faults in a specification, its accelerators, stimuli, model and core",
        "firm check robot.yaml",
        _check,
    )
    add_spec(check)
    add_sources(check)
    check.add_argument(
        "--stimuli",
        type=Path,
        metavar="F",
        action="append",
        default=[],
        help="check also that the system accepts all messages in a YAML file or bag; may be repeated",
    )
    add_json(check)


def _check(arguments: argparse.Namespace) -> None:
    with Progress("checking", is_shown=not arguments.json):
        if arguments.json:
            _check_as_json(arguments)
        else:
            check_system(arguments, arguments.stimuli)


def _check_as_json(arguments: argparse.Namespace) -> None:
    """Print whether a specification is valid, and all faults and warnings; exit with 1 if it is not valid."""
    faults: Sequence[Diagnostic] = ()
    warnings: Sequence[Diagnostic] = ()
    try:
        loaded = load(arguments)
        warnings = loaded.warnings
        warnings += check_all(loaded, arguments.spec, arguments.stimuli)
    except InputError as error:
        faults = error.diagnostics
    print_json({"valid": not faults, "diagnostics": [item.data() for item in (*faults, *warnings)]})
    if faults:
        sys.exit(1)


def check_core_file(core: Path, simulation: str = _SIMULATION, *, may_run: bool = False) -> LoadedSystem | None:
    """Check the system of a core's file, and return it, or None for a core of another kind; print the warnings.

    `simulation` and `may_run` have the meaning as for `check_all`. May raise `InputError`.
    """
    from fusesoc_firm.system.message_sources import check_specs_of, load_beside, spec_of

    spec = spec_of(core)
    if not spec:
        return None
    spec = Path(shown(spec))
    check_specs_of(spec.parent)
    loaded = load_beside(spec, core_folders=core_folders)
    print_warnings(check_all(loaded, spec, simulation=simulation, may_run=may_run))
    return loaded


def check_system(arguments: argparse.Namespace, stimuli: Iterable[Path] = (), *, with_core: bool = True) -> None:
    """Check the system `arguments.spec`, with further stimuli, and print a summary. May raise `InputError`."""
    from fusesoc_firm.fabric.ethernet import ethernet_node, fragment_bytes, history_bytes
    from fusesoc_firm.fabric.ros1 import memory_of
    from fusesoc_firm.system.views.inner_topics import ways_of_topics
    from fusesoc_firm.system.views.show import counts, default_lengths

    loaded = load(arguments)
    print_warnings(check_all(loaded, arguments.spec, stimuli, simulation=_SIMULATION if with_core else None))
    system = loaded.system
    memory = memory_of(system, loaded.libraries)
    node = ethernet_node(system, loaded.libraries)
    print(f"{arguments.spec}: {system.name} is valid: {counts(system)}")
    for line in (*ways_of_topics(system), *default_lengths(system)):
        print(line)
    if memory:
        print(f"the node needs {len(memory)} bytes of memory for its program and texts")
    if node:
        print(f"the node needs {history_bytes(system, node)} bytes of memory for the last messages of its publishers")
    if node and (size := fragment_bytes(system, node)):
        print(f"the node needs {size} bytes of memory for messages in several packets")


def check_all(
    loaded: LoadedSystem,
    spec: Path,
    stimuli: Iterable[Path] = (),
    *,
    simulation: str | None = _SIMULATION,
    may_run: bool = False,
) -> tuple[Diagnostic, ...]:
    """Check a loaded system, the core beside its specification, and what its simulation reads; return the warnings.

    `simulation` is the core's target of the simulation, or None to check no core. Nothing is built, and the user's
    Python code is only read unless it `may_run`. Raise `InputError` with the faults of all parts.
    """
    from fusesoc_firm.builds.check import check_core, check_toplevels
    from fusesoc_firm.builds.setup.core_schema import check_loadable
    from fusesoc_firm.fabric.ethernet import ethernet_node
    from fusesoc_firm.fabric.ros1 import memory_of
    from fusesoc_firm.runs.simulation.software_run import system_stimuli
    from fusesoc_firm.system.message_sources import check_specs_of, core_of
    from fusesoc_firm.system.scaffold.core_file import toplevels

    core = core_of(spec) if simulation else None
    if core:
        check_loadable(Path(shown(core.path)))
    faults = Diagnostics()
    warnings: tuple[Diagnostic, ...] = ()
    with faults.noting():
        warnings = check_sources(loaded, spec)
    for path in stimuli:
        with faults.noting():
            system_stimuli(path, loaded)
    with faults.noting():
        memory_of(loaded.system, loaded.libraries)
        ethernet_node(loaded.system, loaded.libraries)
    # What the user's model prints is not part of the answer.
    with faults.noting(), redirect_stdout(sys.stderr):
        if core and simulation:
            check_toplevels(core, toplevels(loaded.system), faults)
            warnings += check_core(core, simulation, may_run=may_run)
        elif simulation:
            check_specs_of(spec.parent)
    faults.raise_if_any()
    return warnings
