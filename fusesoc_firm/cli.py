"""The door for people: the command `firm`."""

from __future__ import annotations

import argparse
import fnmatch
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from fusesoc_firm import __version__
from fusesoc_firm.diagnostics import InputError, fail
from fusesoc_firm.library_path import library_root

if TYPE_CHECKING:
    from fusesoc_firm.message.derived import Interface
    from fusesoc_firm.message.library import MessageLibrary
    from fusesoc_firm.message.model import MessageDefinition, MessageName
    from fusesoc_firm.system.generator import LoadedSystem

STAGES = ("tree", "message", "frame", "config", "vhdl")

Handler = Callable[[argparse.Namespace], None]


def main(argv: Sequence[str] | None = None) -> int:
    """Run `firm`; the exit status is 1 for faults, 2 for a wrong command line, 130 for Ctrl-C."""
    arguments = _parser().parse_args(argv)
    try:
        arguments.handler(arguments)
        sys.stdout.flush()
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # Whoever read the output (`| head`) has seen enough. Nothing may be flushed into the closed pipe at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="firm", description="ROS messages and robot systems as FPGA hardware.")
    parser.add_argument("--version", action="version", version=f"firm {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _command(
        commands,
        "path",
        "print the folder of the FuseSoC library",
        'fusesoc library add firm "$(firm path)"',
        _print_path,
    )
    _add_message(commands)
    _add_system(commands)
    _add_scheduler(commands)
    return parser


def _command(
    commands: Any, name: str, text: str, example: str, handler: Handler | None = None
) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=f"example: {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    if handler:
        parser.set_defaults(handler=handler)
    return parser


def _add_message(commands: Any) -> None:
    message = _command(commands, "message", "look at message definitions", "firm message show geometry_msgs/Pose")
    actions = message.add_subparsers(title="actions", metavar="ACTION", required=True)
    listing = _command(
        actions,
        "list",
        "list the known messages, services and actions",
        "firm message list 'sensor_msgs/*'",
        _list_messages,
    )
    listing.add_argument("pattern", nargs="?", default="*", help="only names like this one, with * and ?")
    show = _command(
        actions,
        "show",
        "print a message, or those of a service or action, in any stage of the way to hardware",
        "firm message show geometry_msgs/Quaternion --ros 1 --stage vhdl",
        _show_message,
    )
    show.add_argument("type", metavar="TYPE", help="its type, such as geometry_msgs/Quaternion")
    show.add_argument("--stage", choices=STAGES, default="tree", help="what to print (default: tree)")
    show.add_argument("--width", type=int, default=8, metavar="BITS", help="bits of the stream (default: 8)")
    verify = _command(
        actions,
        "verify",
        "check converters of messages in simulation, against other serialisers",
        "firm message verify 'geometry_msgs/*' --ros 1 --report geometry.json",
        _verify_messages,
    )
    for parser in (listing, show, verify):
        _add_definitions(parser)
    _add_verification(verify)


def _add_verification(verify: argparse.ArgumentParser) -> None:
    verify.add_argument("types", metavar="TYPE", nargs="*", help="a type, or several with * and ? (default: all known)")
    verify.add_argument("--stimuli", type=_positive, default=3, metavar="N", help="values of each message (default: 3)")
    verify.add_argument("--width", type=int, default=8, metavar="BITS", help="bits of the stream (default: 8)")
    verify.add_argument("--seed", type=int, default=1, metavar="N", help="all randomness follows from it (default: 1)")
    verify.add_argument("--jobs", type=_positive, metavar="N", help="messages at once (default: one a core)")
    verify.add_argument("--cluster", metavar="ADDRESS", help="do it on the Dask cluster of this scheduler instead")
    verify.add_argument("--report", type=Path, metavar="F.json", help="write a report, and F.html beside it")
    verify.add_argument("--keep", type=Path, metavar="DIR", help="keep the work folder of each message that fails")


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} is less than 1")
    return number


def _add_system(commands: Any) -> None:
    system = _command(commands, "system", "look at system specifications", "firm system check robot.yaml")
    actions = system.add_subparsers(title="actions", metavar="ACTION", required=True)
    new = _command(
        actions,
        "new",
        "ask for a specification and write it, or extend one that is there",
        "firm system new robot.yaml",
        _new_system,
    )
    check = _command(
        actions, "check", "report all faults of a specification", "firm system check robot.yaml", _check_system
    )
    show = _command(
        actions, "show", "print the system derived from a specification", "firm system show robot.yaml", _show_system
    )
    skeletons = _command(
        actions,
        "skeleton",
        "write a first version of each accelerator that has no source",
        "firm system skeleton robot.yaml",
        _write_skeletons,
    )
    draw = _command(
        actions,
        "diagram",
        "draw a system: blocks, messages, widths and ids",
        "firm system diagram robot.yaml -o robot.svg",
        _draw_system,
    )
    draw.add_argument("-o", "--output", type=Path, metavar="F.svg", help="where to write it (default: print it)")
    draw.add_argument("--format", choices=("svg", "dot"), default="svg", help="of the picture (default: svg)")
    report = _command(
        actions,
        "report",
        "count the lines that are written and those that are generated of them",
        "firm system report robot.yaml",
        _report_system,
    )
    for parser in (new, check, show, skeletons, draw, report):
        parser.add_argument("spec", metavar="SPEC", type=Path, help="the system's YAML specification")
        _add_sources(parser)
    _command(
        actions,
        "schema",
        "print the grammar of specifications as a JSON Schema, for editors",
        "firm system schema > specification.schema.json",
        _print_schema,
    )


def _add_scheduler(commands: Any) -> None:
    scheduler = _command(commands, "scheduler", "evaluate and choose schedulers", "firm scheduler choose robot.yaml")
    actions = scheduler.add_subparsers(title="actions", metavar="ACTION", required=True)
    bench = _command(
        actions,
        "bench",
        "evaluate the schedulers by cycle-exact models, as the dissertation's section 4.3 does",
        "firm scheduler bench --dataset all --output evaluation",
        _bench_schedulers,
    )
    lists = "names with commas between (default: %(default)s)"
    bench.add_argument("--dataset", default="large", metavar="NAMES", help=f"large, cc1 to cc4, or all; {lists}")
    bench.add_argument("--policies", default="all", metavar="NAMES", help=f"schedulers; {lists}")
    bench.add_argument("--requesters", metavar="N,N", help="numbers of accelerators (default: 2,4,8,16,32,64,128,256)")
    bench.add_argument("--sets", type=_positive, metavar="N", help="sets of each data set (default: its own)")
    bench.add_argument("--cycles", type=_positive, metavar="N", help="cycles of each simulation (default: its own)")
    bench.add_argument("--seed", type=int, default=1, metavar="N", help="all randomness follows from it (default: 1)")
    bench.add_argument(
        "--distribution", choices=("normal", "uniform"), default="normal", help="how times spread (default: normal)"
    )
    bench.add_argument("--jobs", type=_positive, metavar="N", help="simulations at once (default: one a core)")
    bench.add_argument("--cluster", metavar="ADDRESS", help="do it on the Dask cluster of this scheduler instead")
    bench.add_argument(
        "--output", type=Path, metavar="DIR", help="write a report, every table and figure into a folder"
    )
    bench.add_argument("--csv", type=Path, metavar="F.csv", help="write all metrics of all simulations into one table")
    choose = _command(
        actions,
        "choose",
        "find the best scheduler for a specification, and the buffers it needs",
        "firm scheduler choose robot.yaml --criterion lateness",
        _choose_scheduler,
    )
    choose.add_argument("spec", metavar="SPEC", type=Path, help="the system's YAML specification")
    choose.add_argument(
        "--criterion",
        choices=("luts", "lateness", "finish"),
        default="luts",
        help="fewest LUTs with all deadlines held, smallest worst lateness, or fewest LUTs with nobody starving "
        "(default: luts)",
    )
    choose.add_argument("--format", choices=("text", "yaml", "json"), default="text", help="default: text")
    _add_sources(choose)


def _add_definitions(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--ros", type=int, choices=(1, 2), default=2, help="the ROS version (default: 2)")
    _add_sources(parser)


def _add_sources(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--path",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="a folder with message definitions; may be given more than once",
    )
    parser.add_argument("--distro", metavar="NAME", help="the distribution whose standard messages are meant")


def _print_path(_: argparse.Namespace) -> None:
    print(library_root())


def _library(arguments: argparse.Namespace, ros: int) -> MessageLibrary:
    from fusesoc_firm.message.library import MessageLibrary
    from fusesoc_firm.message.model import RosVersion

    return MessageLibrary(RosVersion(ros), arguments.path, environment=os.environ, store=arguments.distro)


def _list_messages(arguments: argparse.Namespace) -> None:
    library = _library(arguments, arguments.ros)
    origins = {str(name): library.origin(name) for name in library.names()}
    origins |= {str(interface): str(file) for interface, file in library.interfaces().items()}
    names = sorted(name for name in origins if fnmatch.fnmatchcase(name, arguments.pattern))
    width = max((len(name) for name in names), default=0)
    for name in names:
        print(f"{name:{width}}  {origins[name]}")


def _show_message(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.message.parser import parse_full_name

    library = _library(arguments, arguments.ros)
    kind, name = parse_full_name(arguments.type)
    interface = library.interface(name, kind)
    names = interface.messages if interface else (name,)
    definitions = library.joint_closure(names)
    texts = [_stage(arguments.stage, each, definitions, arguments.width) for each in names]
    if interface and arguments.stage == "message":
        texts.insert(0, _title(interface, definitions))
    separator = "\n---\n" if arguments.stage in ("frame", "config") else "\n\n"
    print(separator.join(text.rstrip("\n") for text in texts))


def _verify_messages(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.verify.campaign import Settings
    from fusesoc_firm.verify.command import Places, verify_messages

    command = ["firm", "message", "verify", "--ros", str(arguments.ros)]
    command += [word for path in arguments.path for word in ("--path", str(path))]
    command += ["--distro", arguments.distro] if arguments.distro else []
    command += ["--width", str(arguments.width), "--stimuli", str(arguments.stimuli), "--seed", str(arguments.seed)]
    verify_messages(
        _library(arguments, arguments.ros),
        arguments.types,
        Settings(arguments.width, arguments.stimuli, arguments.seed, keeps_files=arguments.keep is not None),
        Places(arguments.jobs, arguments.cluster, arguments.report, arguments.keep, command),
    )


def _title(interface: Interface, definitions: dict[MessageName, MessageDefinition]) -> str:
    """What stands above the messages of a service or an action."""
    from fusesoc_firm.message.signature import signature

    title = f"# {interface} ({interface.ros.title})"
    if not interface.has_signature:
        return title
    return f"{title}\n# signature: {signature(interface.name, definitions, interface.kind)}"


def _stage(stage: str, name: MessageName, definitions: dict[MessageName, MessageDefinition], width: int) -> str:
    """The text of a message in one of `STAGES`."""
    from fusesoc_firm.frame import tree
    from fusesoc_firm.frame.description import description
    from fusesoc_firm.frame.layout import frame_of
    from fusesoc_firm.message.printer import to_text
    from fusesoc_firm.message.signature import signature

    if stage == "message":
        return to_text(definitions[name], signature(name, definitions))
    frame = frame_of(name, definitions)
    if stage == "tree":
        return tree.text(tree.rows(name, definitions, frame))
    return _yaml(description(frame)) if stage == "frame" else _converters(stage, frame, definitions, width)


def _converters(stage: str, frame: Any, definitions: dict[MessageName, MessageDefinition], width: int) -> str:
    """Configuration or VHDL of the message's package and of both converters."""
    from fusesoc_firm.converter import constants
    from fusesoc_firm.converter.sources import ConverterSource, publisher_source, subscriber_source
    from fusesoc_firm.render import render

    package = constants.constants_package(frame.message)
    configuration = constants.constants_configuration(frame.message, definitions, package)
    made = (
        ConverterSource(constants.CONSTANTS_TEMPLATE, configuration),
        subscriber_source(frame, width),
        publisher_source(frame, width),
    )
    if stage == "config":
        return "---\n".join(_yaml(source.configuration) for source in made)
    return "\n".join(render(source.template, source.configuration) for source in made)


def _check_system(arguments: argparse.Namespace) -> None:
    system = _load(arguments).system
    counts = [
        (len(system.subscribers), "subscriber"),
        (len(system.accelerators), "accelerator"),
        (len(system.publishers), "publisher"),
    ]
    words = ", ".join(f"{count} {word}{'' if count == 1 else 's'}" for count, word in counts)
    print(f"{arguments.spec}: {system.name} is right: {words}")


def _show_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.show import derived_description

    print(_yaml(derived_description(_load(arguments).system)), end="")


def _new_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.prompts import asker
    from fusesoc_firm.system.wizard import extend_specification

    if arguments.spec.exists():
        _check_system(arguments)
    extend_specification(arguments.spec, asker(), lambda: _message_names(arguments))
    _check_system(arguments)


def _message_names(arguments: argparse.Namespace) -> list[str]:
    return sorted({str(name) for ros in (1, 2) for name in _library(arguments, ros).names()})


def _write_skeletons(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.skeleton import missing_sources

    loaded = _load(arguments, needs_sources=False)
    texts = missing_sources(loaded.system, loaded.folder)
    for path, text in texts.items():
        _write(path, text)
        print(path)
    if not texts:
        print("every accelerator has a source")


def _draw_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.diagram import diagram

    picture = diagram(_load(arguments).system, arguments.format)
    if arguments.output:
        _write(arguments.output, picture)
    else:
        print(picture, end="")


def _report_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.report import report

    print(report(arguments.spec, _load(arguments)), end="")


def _print_schema(_: argparse.Namespace) -> None:
    from fusesoc_firm.system.specification import Specification
    from fusesoc_firm.yaml_schema import json_schema

    print(json.dumps(json_schema(Specification, "System specification of fusesoc_firm"), indent=2))


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")


def _bench_schedulers(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.scheduling.bench import Places, Selection, bench, names_of, numbers_of
    from fusesoc_firm.scheduling.evaluation import Settings
    from fusesoc_firm.scheduling.models import POLICIES
    from fusesoc_firm.scheduling.workloads import DATA_SETS, REQUESTERS, Distribution

    def names(text: str, legal: Sequence[str], what: str) -> tuple[str, ...]:
        return tuple(legal) if text == "all" else names_of(text, legal, what)

    selection = Selection(
        names(arguments.dataset, list(DATA_SETS), "data set"),
        names(arguments.policies, list(POLICIES), "policy"),
        numbers_of(arguments.requesters) if arguments.requesters else REQUESTERS,
        Settings(arguments.seed, arguments.sets, arguments.cycles, Distribution(arguments.distribution)),
    )
    bench(selection, Places(arguments.jobs, arguments.cluster, arguments.output, arguments.csv))


def _choose_scheduler(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.scheduling.analysis import Criterion, choose
    from fusesoc_firm.scheduling.choice import show
    from fusesoc_firm.system.timing import channel_of, tasks_of

    system = _load(arguments).system
    choice = choose(tasks_of(system), Criterion(arguments.criterion), channel_of(system))
    print(show(choice, arguments.format), end="")


def _load(arguments: argparse.Namespace, *, needs_sources: bool = True) -> LoadedSystem:
    from fusesoc_firm.message.library import libraries
    from fusesoc_firm.system.generator import load_system

    known = libraries(arguments.path, os.environ, arguments.distro)
    return load_system(arguments.spec, known, needs_sources=needs_sources)


def _yaml(data: dict[str, Any]) -> str:
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120)


if __name__ == "__main__":
    sys.exit(main())
