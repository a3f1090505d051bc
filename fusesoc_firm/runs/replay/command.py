"""The command `firm replay`: send a bag through a system, and print a summary."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable

from fusesoc_firm.accelerator.functions import Functions, importable_sources
from fusesoc_firm.message.bag_reader import Bag, Form, open_bag
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.runs.bags.writer import check_writable, form_of, write_bag
from fusesoc_firm.runs.replay.audience import Audience
from fusesoc_firm.runs.replay.errors import Errors
from fusesoc_firm.runs.replay.hardware_run import SystemRun, published
from fusesoc_firm.runs.replay.options import Settings, Source, Target
from fusesoc_firm.runs.replay.plan import Plan
from fusesoc_firm.runs.replay.player import Player
from fusesoc_firm.runs.replay.recorder import Recorder
from fusesoc_firm.runs.replay.summary import print_summary
from fusesoc_firm.system.derived.model import Topic
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import Diagnostics, fail
from fusesoc_firm.text.json_text import json_text


def replay(
    loaded: LoadedSystem,
    source: Source,
    target: Target,
    settings: Settings,
    start_simulator: Callable[[], Simulator],
) -> None:
    """Replay a bag and print a summary; `start_simulator` is called after all other checks.

    May raise `InputError`, also if messages were rejected; the responses to all other messages are then recorded.
    """
    _check_target(source, target)
    if settings.has_latency and loaded.system.clock is None:
        fail("cannot compute the latency in seconds: the specification has no 'clock'")
    with open_bag(source.path) as opened:
        plan = Plan.of(opened, source, loaded, settings.names)
        form = _form(target, opened)
        _check_speaks(published(loaded.system), target, form)
        for warning in plan.warnings:
            print(warning, file=sys.stderr)
        errors = Errors(source.path)
        with (
            importable_sources([type_.accelerator for type_ in loaded.system.software.types], loaded.folder),
            _started(start_simulator) as simulator,
            write_bag(target.path, form, list(plan.topics.values())) as written,
        ):
            functions = Functions.of(loaded.system.software, loaded.folder)
            run = SystemRun(loaded.system, simulator, functions, settings.quiet, settings.watch)
            clock = loaded.system.clock if settings.has_latency else None
            recorder = Recorder(written, plan.topics, clock, Audience(settings.watch, simulator, plan.bag.start))
            player = Player(plan, run, recorder, errors)
            player.play(settings.control)
        found = {"bag": str(target.path)} | player.summary()
        found |= {"warnings": [warning.data() for warning in plan.warnings], "errors": errors.count}
        found |= {"messages_with_errors": player.refused, "first_errors": errors.first, "cycles": simulator.cycle}
        if settings.is_json:
            print(json_text(found, 2))
        else:
            print_summary(found)
    if errors.count:
        words = "1 error" if errors.count == 1 else f"{errors.count} errors"
        fail(f"{words}; {player.refused} of {player.played.total()} messages had errors")


def _check_target(source: Source, target: Target) -> None:
    if source.path.exists() and target.path.exists() and source.path.samefile(target.path):
        fail(f"cannot write {target.path}: it is the bag to replay")
    check_writable(target.path, force=target.force)


def _form(target: Target, source: Bag) -> Form:
    """Return the format of the bag to write."""
    said = form_of(target.path)
    if target.form and said and target.form is not said:
        fail(f"cannot write {target.path}: --format is {target.form.value}, but the extension implies {said.value}")
    return target.form or said or source.form


def _check_speaks(topics: Iterable[Topic], target: Target, form: Form) -> None:
    """Raise `InputError` if the format of the bag cannot represent the messages that the system publishes."""
    faults = Diagnostics()
    for topic in topics:
        if topic.frame.ros != form.ros:
            message = f"'{topic.block}' uses {topic.frame.ros.title}, but {target.path} would be a {form.ros.title} bag"
            faults.error(message, hint="select another format with --format")
    faults.raise_if_any()


def _started(start_simulator: Callable[[], Simulator]) -> Simulator:
    try:
        return start_simulator()
    except TransportError as error:
        fail(str(error))
