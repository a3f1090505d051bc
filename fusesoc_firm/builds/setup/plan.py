"""The plan of builds: cores and targets in FuseSoC, with their build folders and generated cores."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.cores import calls_of, fetch, solved
from fusesoc_firm.builds.setup.flows import flow_of
from fusesoc_firm.builds.setup.libraries import ALL_CORES, check_files, core_hint, cores_here, open_libraries
from fusesoc_firm.builds.setup.outcome import Build, configuration
from fusesoc_firm.builds.setup.run_options import RunOptions
from fusesoc_firm.builds.setup.selection import Selection, is_pattern, matching
from fusesoc_firm.builds.step.bench import SIMULATORS
from fusesoc_firm.core.core_reader import core_name
from fusesoc_firm.core.request import GeneratorCall
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, closest

TESTS = ("sim", "test")
"""The beginnings of the names of tests."""
_COLONS_WITH_VERSION = 3


@dataclass(frozen=True)
class Plan:
    """A list of builds, and a FuseSoC instance with its libraries loaded.

    `solver` is the instance that finds dependencies: another one if mappings or a lock file apply, since FuseSoC
    accepts these only once, and each build applies them.
    """

    fusesoc: Any = field(repr=False)
    build_root: Path
    builds: tuple[Build, ...]
    options: RunOptions = field(default_factory=RunOptions)
    solver: Any = field(default=None, repr=False)

    def sound(self) -> tuple[Plan, dict[Build, InputError]]:
        """Return the plan of the builds with valid dependencies, files and generator calls, and the others' faults."""
        faults: dict[Build, InputError] = {}
        for build in self.builds:
            try:
                for core, flags in self._cores(build):
                    check_files(core, flags)
                    any(calls_of(core, flags))
            except InputError as error:
                faults[build] = error
        return replace(self, builds=tuple(build for build in self.builds if build not in faults)), faults

    def generator_calls(self) -> list[GeneratorCall]:
        """Return the generator calls of all builds, each once. Raise `InputError` if a dependency is missing."""
        found: dict[tuple[str, str, str], GeneratorCall] = {}
        for build in self.builds:
            for core, flags in self._cores(build):
                for call in calls_of(core, flags):
                    found[call.vlnv, call.files_root, repr(call.parameters)] = call
        return list(found.values())

    def fetch(self) -> None:
        """Download the sources of all cores with a provider."""
        for build in self.builds:
            for core, _ in self._cores(build):
                fetch(core)

    def _cores(self, build: Build) -> list[tuple[Any, Mapping[str, Any]]]:
        fusesoc = self.solver or self.fusesoc
        return solved(fusesoc, fusesoc.get_core(build.core), build.target, self.options.use_flags())


def make_plan(cores: Sequence[str], targets: Sequence[str], build_root: Path | None = None) -> Plan:
    """Return a plan of the builds of all targets of all cores, with FuseSoC's configuration for the current folder.

    Raise `InputError` with all unknown cores and targets.
    """
    return select_plan(Selection(tuple(cores), tuple(targets)), RunOptions(), build_root)


def select_plan(selection: Selection, options: RunOptions, build_root: Path | None = None) -> Plan:
    """Return a plan of the selected builds. Raise `InputError` with all faults of the selection."""
    fusesoc = _fusesoc(options, build_root)
    faults = Diagnostics()
    flags = options.use_flags()
    chosen = dict.fromkeys(
        (name, target)
        for core, targets in selection.parts()
        for name in _names(fusesoc, core, targets, faults)
        if selection.affected is None or name in selection.affected
        for target in _targets(fusesoc, name, targets, selection.is_where_present, faults)
    )
    builds = [
        Build(name, target, _work_root(fusesoc, name, known))
        for name, target in chosen
        if (known := _flags(fusesoc, name, target, flags, faults))
    ]
    faults.raise_if_any()
    return Plan(fusesoc, Path(fusesoc.config.build_root), tuple(builds), options, _solver(options, build_root))


def plan_tests(selection: Selection, options: RunOptions, build_root: Path | None = None) -> Plan:
    """Return a plan of the selected tests: targets that simulate and are named `sim*`, `test*` or as selected.

    Without names of cores, the plan contains the cores below the current folder; without targets, all tests. Raise
    `InputError` for unknown cores, and for named cores without these tests.
    """
    fusesoc = _fusesoc(options, build_root)
    faults = Diagnostics()
    builds: dict[Build, None] = {}
    for core, patterns in selection.parts() or [("", selection.targets)]:
        # Cores that are not named one by one need not have these tests.
        is_lenient = selection.is_where_present or not core or is_pattern(core)
        for name in _names(fusesoc, core, (), faults) if core else cores_here(fusesoc):
            if selection.affected is not None and name not in selection.affected:
                continue
            tests = _tests(fusesoc, name, options.use_flags(), patterns)
            chosen = _matching_tests(name, tests, patterns, Diagnostics() if is_lenient else faults)
            builds |= dict.fromkeys(Build(name, test, _work_root(fusesoc, name, tests[test])) for test in chosen)
    faults.raise_if_any()
    return Plan(fusesoc, Path(fusesoc.config.build_root), tuple(builds), options, _solver(options, build_root))


def _matching_tests(name: str, tests: Collection[str], patterns: Sequence[str], faults: Diagnostics) -> list[str]:
    """Return the tests of a core that match the patterns, or all; add a fault for each pattern without a test."""
    found = [(pattern, [test for test in tests if fnmatchcase(test, pattern)]) for pattern in patterns or ["*"]]
    for pattern, fitting in found:
        if not fitting:
            what = f"no test '{pattern}'" if patterns else "no tests"
            faults.error(f"{name} has {what}", hint=f"its tests: {', '.join(tests) or 'none'}")
    return [test for test in tests if any(test in fitting for _, fitting in found)]


def _fusesoc(options: RunOptions, build_root: Path | None) -> Any:
    """Return a FuseSoC instance with its libraries, with FuseSoC's configuration for the current folder."""
    config = configuration()
    options.configure(config)
    # All builds would share a single work root.
    config.args_work_root = None
    config.args_build_root = str(Path(build_root or config.build_root).absolute())
    return open_libraries(config)


def _solver(options: RunOptions, build_root: Path | None) -> Any:
    """Return a FuseSoC instance to which mappings and a lock file apply, or None without these."""
    if not options.mappings and not options.lock_file:
        return None
    fusesoc = _fusesoc(options, build_root)
    options.apply(fusesoc)
    return fusesoc


def _names(fusesoc: Any, core: str, targets: Sequence[str], faults: Diagnostics) -> list[str]:
    """Return the full names of the cores that match a name or pattern; without a version, the newest of each."""
    if not is_pattern(core):
        return [name for name in [_full_name(fusesoc, core, targets, faults)] if name]
    if not (found := matching(sorted(fusesoc.get_cores()), core)):
        faults.error(f"no core matches '{core}'", hint=ALL_CORES)
    has_version = core.count(":") == _COLONS_WITH_VERSION
    families = dict.fromkeys(name if has_version else name.rpartition(":")[0] for name in found)
    return [str(fusesoc.get_core(family).name) for family in families]


def _targets(
    fusesoc: Any, name: str, patterns: Sequence[str], is_where_present: bool, faults: Diagnostics
) -> list[str]:
    """Return the targets of a core that match the patterns; targets without wildcards are checked later."""
    known = [
        target
        for target in fusesoc.get_core(name).get_data({}).targets
        if _flags(fusesoc, name, target, {}, Diagnostics())
    ]
    found: list[str] = []
    for pattern in patterns:
        fitting = [target for target in known if fnmatchcase(target, pattern)]
        if not fitting and is_pattern(pattern) and not is_where_present:
            faults.error(f"no target of {name} matches '{pattern}'", hint=f"its targets: {', '.join(known) or 'none'}")
        found += fitting or ([] if is_where_present or is_pattern(pattern) else [pattern])
    return found


def _work_root(fusesoc: Any, name: str, flags: Mapping[str, Any]) -> Path:
    return Path(fusesoc.get_work_root(fusesoc.get_core(name), flags))


def _tests(fusesoc: Any, name: str, further: Mapping[str, Any], selected: Collection[str]) -> dict[str, dict[str, Any]]:
    """Return the tests of a core with their flags; `selected` are names of targets that need not be called tests."""
    core = fusesoc.get_core(name)
    found: dict[str, dict[str, Any]] = {}
    for target in core.get_data({}).targets:
        if target.startswith(TESTS) or target in selected:
            flags = {**core.get_flags(target), "target": target, **further}
            flow = flow_of(core, flags)
            if flow and (flow.name in SIMULATORS if flow.is_tool else flow.name == "sim"):
                found[target] = flags
    return found


def _full_name(fusesoc: Any, core: str, targets: Sequence[str], faults: Diagnostics) -> str | None:
    """Return the full name of a core, or None if it is unknown; as in `fusesoc run`, vendor and library are optional.

    For an unknown core, add a fault that lists the cores with all these targets.
    """
    from fusesoc.coremanager import DependencyError

    known = [name for name in fusesoc.get_cores() if name.split(":")[2].lower() == core.lower()]
    families = sorted({name.rpartition(":")[0] for name in known})
    if len(families) > 1:
        faults.error(f"'{core}' is ambiguous: {' or '.join(families)}")
        return None
    try:
        return str(fusesoc.get_core(families[0] if families else core).name)
    except (DependencyError, SyntaxError):
        cores = fusesoc.get_cores()
        if versions := [name.rpartition(":")[2] for name in cores if core_name(name) == core.rpartition(":")[0]]:
            faults.error(f"unknown version of core '{core}'", hint=f"known versions: {', '.join(versions)}")
            return None
        all_fitting = [name for name, item in cores.items() if {*targets} <= item.get_data({}).targets.keys()]
        fitting = [name for name in all_fitting if name in cores_here(fusesoc)] or all_fitting
        listed = f"cores with {' and '.join(targets)}: {', '.join(sorted(fitting))}" if targets and fitting else ""
        hint = core_hint(fusesoc, core)
        faults.error(f"unknown core '{core}'", hint=hint.replace(ALL_CORES, listed) if listed else hint)
        return None


def _flags(
    fusesoc: Any, name: str, target: str, further: Mapping[str, Any], faults: Diagnostics
) -> dict[str, Any] | None:
    """Return the flags of a target and `further` ones; if the target cannot be built, add a fault and return None."""
    core = fusesoc.get_core(name)
    known = core.get_data({}).targets
    if target not in known:
        near = closest(target, known)
        meant = f"did you mean '{near}'? " if near else ""
        faults.error(f"{name} has no target '{target}'", hint=f"{meant}its targets: {', '.join(known) or 'none'}")
        return None
    flags = {**core.get_flags(target), "target": target, **further}
    if not core.get_flow(flags) and "tool" not in flags:
        faults.error(
            f"target '{target}' of {name} cannot be built", hint="the target has neither 'flow' nor 'default_tool'"
        )
        return None
    return flags
