"""`firm query`: questions about cores, targets and generated files."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.build_options import add_selectors, selectors_of
from fusesoc_firm.cli.common import command

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.query import Answer, Cores

_CORE_HELP = "a core's name in FuseSoC, or a pattern such as 'acme:m:*'"


def add_query(commands: Any) -> None:
    """Declare the command and its questions."""
    query = command(
        commands,
        "query",
        "answer questions about the cores in FuseSoC's libraries: dependencies, targets, generated files",
        "firm query rdeps robot:axis:firm_axis",
    )
    questions = query.add_subparsers(title="questions", metavar="QUESTION", required=True)
    deps = _add(questions, "deps", "list cores and all cores on which they depend", "robot:sys:quat2euler", _deps)
    _add_cores(deps)
    add_selectors(deps)
    rdeps = _add(questions, "rdeps", "list cores and all cores that depend on them", "robot:axis:firm_axis", _rdeps)
    _add_cores(rdeps)
    paths = _add(
        questions,
        "allpaths",
        "list the cores on all paths of dependencies between two cores",
        "robot:sys:quat2euler robot:axis:firm_axis",
        _allpaths,
    )
    paths.add_argument("start", metavar="FROM", help=_CORE_HELP)
    paths.add_argument("end", metavar="TO", help="a core on which the first depends, or a pattern")
    generated = _add(
        questions,
        "generated",
        "list the files that a target's generators write; missing files are generated into the store",
        "robot:sys:quat2euler --target sim",
        _generated,
    )
    generated.add_argument("core", metavar="CORE", help="a core's name in FuseSoC")
    generated.add_argument("--target", default="default", metavar="NAME", help="the core's target (default: default)")
    add_selectors(generated)
    text = "list the cores' targets and their kinds"
    targets = _add(questions, "targets", text, "'robot:sys:*' --kind sim", _targets)
    _add_cores(targets)
    targets.add_argument("--kind", default="*", help="only targets of this kind, such as sim or 'sim/*'")
    kinds = _add(questions, "kinds", "list the kinds of targets, and count them", "'robot:sys:*'", _kinds)
    _add_cores(kinds)


def _add(
    questions: Any, name: str, text: str, example: str, ask: Callable[[argparse.Namespace], Answer]
) -> argparse.ArgumentParser:
    def answer(arguments: argparse.Namespace) -> None:
        if text := getattr(ask(arguments), arguments.output)():
            print(text)

    parser = command(questions, name, text, f"firm query {name} {example}", answer)
    parser.add_argument(
        "--output", choices=("lines", "json", "dot"), default="lines", help="the form of the answer (default: lines)"
    )
    return parser


def _add_cores(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("cores", metavar="CORE", nargs="+", help=_CORE_HELP)


def _cores() -> Cores:
    from fusesoc_firm.builds.setup.cores import project_cores
    from fusesoc_firm.builds.setup.query import core_dependencies

    return core_dependencies(project_cores())


def _deps(arguments: argparse.Namespace) -> Answer:
    from fusesoc_firm.builds.setup.cores import dependencies

    cores, options = _cores(), selectors_of(arguments)
    if not (options.flags or options.mappings):
        return cores.deps(arguments.cores)
    used = [dependencies(name, options) for name in cores.named(arguments.cores)]
    return cores.among({core.vlnv for top, depends in used for core in (top, *depends)})


def _rdeps(arguments: argparse.Namespace) -> Answer:
    return _cores().rdeps(arguments.cores)


def _allpaths(arguments: argparse.Namespace) -> Answer:
    return _cores().allpaths(arguments.start, arguments.end)


def _generated(arguments: argparse.Namespace) -> Answer:
    from fusesoc_firm.builds.project import generated_files

    return generated_files(arguments.core, arguments.target, selectors_of(arguments))


def _targets(arguments: argparse.Namespace) -> Answer:
    from fusesoc_firm.builds.setup.query import targets

    return targets(arguments.cores, arguments.kind)


def _kinds(arguments: argparse.Namespace) -> Answer:
    from fusesoc_firm.builds.setup.query import kinds

    return kinds(arguments.cores)
