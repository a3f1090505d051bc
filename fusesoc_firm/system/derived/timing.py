"""The publishers' times that the scheduler needs, in cycles of `clk`.

A time in the specification is a number of cycles, or a number with a unit, which is converted to cycles with the
project's `clock`. The time to send a frame (called WCET in section 6.3.2 of the dissertation) follows from the frame's
size, if the size is known.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor
from typing import TYPE_CHECKING

from fusesoc_firm.frame.length import length_of
from fusesoc_firm.frame.model import LENGTH_BYTES
from fusesoc_firm.scheduling.policies import DEFAULT, POLICIES, Order
from fusesoc_firm.scheduling.tasks import Task
from fusesoc_firm.system.derived.groups import groups_of
from fusesoc_firm.system.derived.ids import ONE_BYTE
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, PublisherTimes, Scheduling
from fusesoc_firm.system.written.specification import AUTO_SCHEDULER, Block, Project
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.yaml_text import Text

if TYPE_CHECKING:
    from fusesoc_firm.scheduling.analysis import Bound, Channel

# A scheduler's times are a few bits wider than the longest deadline, to distinguish early from late (cores/sched).
_SPARE_TIME_BITS = 3
_FEWEST_TIME_BITS, _MOST_TIME_BITS = 8, 31
_LONGEST_TIME = 2 ** (_MOST_TIME_BITS - _SPARE_TIME_BITS) - 1

_SECONDS = {"ns": Fraction(1, 10**9), "us": Fraction(1, 10**6), "ms": Fraction(1, 1000), "s": Fraction(1)}
_HERTZ = {"Hz": 1, "kHz": 1000, "MHz": 10**6, "GHz": 10**9}
_QUANTITY = re.compile(r"(\d{1,20}(?:\.\d{1,20})?)\s*([A-Za-z]*)", re.ASCII)
# In Hz: the legal range of an FPGA's clock.
_SLOWEST, _FASTEST = 1, 10**10
# The scheduler's counters are limited to VHDL's largest integer.
_LONGEST_RUN = 2**31 - 1

# The hint for a publisher that lacks a time.
_PERIOD = "add 'period: <cycles, time or rate>', such as 'period: 100 Hz'"
_WCET = "add 'wcet: <cycles or time>', or '{}: <bytes of the longest payload>'"

# With ids of two bytes, `tree` chooses the policies.
_IN_GROUPS = "round_robin", ("publishers are in groups by period, so those with short periods have more turns",)

Rounding = Callable[[Fraction], int]


def seconds_of(time: str) -> Fraction | None:
    """Return a time with a unit, such as `500 ms`, in seconds, or None if the text is not a time with a unit."""
    found = _QUANTITY.fullmatch(time)
    return Fraction(found[1]) * _SECONDS[found[2]] if found and found[2] in _SECONDS else None


def scheduling_of(
    project: Project,
    clock: Fraction | None,
    blocks: Mapping[str, Block],
    publishers: Sequence[Converter],
    faults: Diagnostics,
) -> Scheduling:
    """Return the scheduler of a system with these publishers, whose `blocks` define the times; note faults.

    `clock` is the frequency of clk in Hz, or None.
    """
    reader = _Reader(clock, faults)
    times = tuple(reader.times(blocks[item.block], item, project) for item in publishers)
    policy, reasons = str(project.scheduler), tuple[str, ...]()
    groups = groups_of(project, publishers, faults)
    _check_shortest_run(project, faults)
    known = {item.block: found for item, found in zip(publishers, times, strict=True)}
    for name, members in [(group.policy, group.blocks) for group in groups] or [(policy, tuple(known))]:
        _check_complete(name, [(blocks[item], known[item]) for item in members if item in known], faults)
    if policy == AUTO_SCHEDULER and project.id_bytes > ONE_BYTE:
        policy, reasons = _IN_GROUPS
    elif policy == AUTO_SCHEDULER:
        policy, reasons = _chosen(project, publishers, times)
    is_preemptive = any(POLICIES[name].is_preemptive for name in (policy, *(group.policy for group in groups)))
    return Scheduling(policy, times, is_preemptive, project.shortest_run, _time_bits(times), reasons, groups)


def tasks_of(system: DerivedSystem) -> tuple[Task, ...]:
    """Return the publishers' tasks, in the order of the publishers' ids; raise `InputError` with all unknown times."""
    faults = Diagnostics()
    for publisher, times in zip(system.publishers, system.scheduling.times, strict=True):
        if times.period is None:
            hint = "add the minimum time between messages, such as 'period: 50 Hz' or 'period: 20000' (cycles)"
            faults.error(f"publisher '{publisher.block}' needs a 'period'", hint=hint)
        if times.transfer_time is None:
            hint = "add the number of cycles that the longest frame takes"
            message = f"publisher '{publisher.block}' needs a 'wcet', because its message has no size limit"
            faults.error(message, hint=hint)
    faults.raise_if_any()
    return _tasks(system.publishers, system.scheduling.times)


def channel_of(system: DerivedSystem) -> Channel:
    """Return the channel that the publishers share, for the analysis."""
    from fusesoc_firm.scheduling.analysis import Channel

    return Channel(system.width // 8, system.scheduling.shortest_run)


def bounds_of(system: DerivedSystem) -> tuple[Bound, ...]:
    """Return the bounds for each publisher under the system's scheduler, in the order of the publishers' ids.

    The result is empty unless all times of all publishers are known, and if publishers are in groups.
    """
    if system.tree or system.scheduling.groups:
        return ()
    tasks = _tasks(system.publishers, system.scheduling.times)
    if len(tasks) < len(system.publishers):
        return ()
    from fusesoc_firm.scheduling.analysis import analyse

    return analyse(system.scheduling.policy, tasks, channel_of(system), is_ordered=True).bounds


def responses_of(system: DerivedSystem) -> dict[str, int]:
    """Return the bounds on the cycles from a publisher's request to the last beat of its frame, as far as they exist.

    Policies that take turns, and a single publisher, need no periods.
    """
    known = {item.task.name: item.response for item in bounds_of(system) if item.response is not None}
    times = [item.transfer_time for item in system.scheduling.times]
    policy = system.scheduling.policy
    if known or system.tree or system.scheduling.groups or None in times:
        return known
    if POLICIES[policy].order is not Order.TURNS and len(times) > 1:
        return {}
    from fusesoc_firm.scheduling.analysis import overheads_of
    from fusesoc_firm.scheduling.response import taking_turns

    tasks = [Task(item.block, time, time, time) for item, time in zip(system.publishers, times, strict=True) if time]
    overheads = overheads_of(policy, len(tasks), system.scheduling.shortest_run)
    return {task.name: taking_turns(task, [other for other in tasks if other is not task], overheads) for task in tasks}


def _tasks(publishers: Iterable[Converter], times: Iterable[PublisherTimes]) -> tuple[Task, ...]:
    """Return the tasks of the publishers whose times are all known."""
    return tuple(
        Task(publisher.block, item.period, item.transfer_time, item.deadline or item.period)
        for publisher, item in zip(publishers, times, strict=True)
        if item.period and item.transfer_time
    )


def _chosen(
    project: Project, publishers: Sequence[Converter], times: Sequence[PublisherTimes]
) -> tuple[str, tuple[str, ...]]:
    """Return the smallest scheduler that meets all known deadlines, with the reasons for the choice."""
    # Imported here, since loading NumPy takes longer than generating most systems.
    from fusesoc_firm.scheduling.analysis import Channel, Criterion, choose

    tasks = _tasks(publishers, times)
    if len(tasks) < len(publishers) or project.shortest_run < 1:
        return DEFAULT, ()
    channel = Channel(project.width // 8, project.shortest_run)
    # Priorities follow the publishers' ids. The host knows these ids, so they must not change.
    choice = choose(tasks, Criterion.LUTS, channel, is_ordered=True)
    return choice.best.policy, choice.reasons


def frame_beats(payload_bytes: int, width: int, id_bytes: int = ONE_BYTE) -> int:
    """Return the number of beats in a frame on a stream of `width` bits."""
    return -(-(id_bytes + LENGTH_BYTES + payload_bytes) * 8 // width)


def _time_bits(times: Iterable[PublisherTimes]) -> int:
    """Return the scheduler's time width in bits, enough for any deadline plus a frame of each other publisher."""
    reach = max((item.deadline or 0 for item in times), default=0) + sum(item.transfer_time or 0 for item in times)
    return min(max(reach.bit_length() + _SPARE_TIME_BITS, _FEWEST_TIME_BITS), _MOST_TIME_BITS)


def clock_frequency(project: Project, faults: Diagnostics) -> Fraction | None:
    """Return the clock's frequency in Hz, or None if it is missing or faulty; note the fault."""
    return None if project.clock is None else frequency("clock", project.clock, faults)


def frequency(key: str, text: Text, faults: Diagnostics) -> Fraction | None:
    """Return the value of `key` as a frequency in Hz; if it is not a frequency, note the fault and return None."""
    found = _QUANTITY.fullmatch(text)
    hertz = Fraction(found[1]) * _HERTZ[found[2]] if found and found[2] in _HERTZ else Fraction(0)
    if not _SLOWEST <= hertz <= _FASTEST:
        hint = "legal here: frequencies from 1 Hz to 10 GHz, such as 100 MHz or 12.5 MHz"
        faults.error(f"'{key}' cannot be '{text}'", text.source, hint)
        return None
    return hertz


def _check_shortest_run(project: Project, faults: Diagnostics) -> None:
    if not 1 <= project.shortest_run <= _LONGEST_RUN:
        place = project.place("shortest_run")
        faults.error(f"'shortestRun' cannot be {project.shortest_run}", place, f"legal here: 1 to {_LONGEST_RUN} beats")


def _check_complete(policy: str, publishers: Iterable[tuple[Block, PublisherTimes]], faults: Diagnostics) -> None:
    """Note every time that a policy requires and one of its publishers lacks."""
    is_auto = policy == AUTO_SCHEDULER
    has_deadlines = not is_auto and POLICIES[policy].has_deadlines
    has_transfer_times = is_auto or POLICIES[policy].has_transfer_times
    for block, item in publishers:
        # Faults in unreadable blocks are already noted.
        if is_auto and item.period is None and block.period is None:
            faults.error(f"scheduler '{policy}' needs the 'period' of '{block.name}'", block.name.source, _PERIOD)
        if has_deadlines and item.deadline is None and block.period is None and block.deadline is None:
            message = f"scheduler '{policy}' needs a 'period' or a 'deadline' for '{block.name}'"
            faults.error(message, block.name.source, _PERIOD)
        if has_transfer_times and item.transfer_time is None and block.wcet is None:
            message = f"scheduler '{policy}' needs the 'wcet' of '{block.name}', whose message has no size limit"
            # The key 'maxLength' of a service or an action limits the messages to the hardware.
            faults.error(message, block.name.source, _WCET.format("buffer" if block.service_block else "maxLength"))


@dataclass(frozen=True)
class _Reader:
    """A reader of times; `clock` is the frequency of clk in Hz, or None."""

    clock: Fraction | None
    faults: Diagnostics

    def times(self, block: Block, publisher: Converter, project: Project) -> PublisherTimes:
        """Return a publisher's times.

        Periods and deadlines are rounded down, frame times up, so that rounding hides no late frame.
        """
        period = self._cycles(block.period, "period", floor)
        transfer_time = self._cycles(block.wcet, "wcet", ceil)
        if block.wcet is None:
            transfer_time = _beats_at_most(publisher, project)
        deadline = self._cycles(block.deadline, "deadline", floor) if block.deadline else period
        return PublisherTimes(period, transfer_time, deadline)

    def _cycles(self, time: Text | None, key: str, rounded: Rounding) -> int | None:
        """Return a time in cycles, or None if it is missing or faulty; note the fault."""
        if time is None:
            return None
        found = _QUANTITY.fullmatch(time)
        units = (*_SECONDS, *_HERTZ) if key == "period" else tuple(_SECONDS)
        if not found or found[2] not in ("", *units) or (not found[2] and "." in found[1]):
            hint = f"legal here: a number of cycles, or a number with one of the units {', '.join(units)}"
            self.faults.error(f"'{key}' cannot be '{time}'", time.source, hint)
            return None
        number, unit = Fraction(found[1]), found[2]
        if unit and self.clock is None:
            message = f"'{key}' is '{time}', but the clock's frequency is missing"
            self.faults.error(message, time.source, "add 'clock' to 'project', such as 'clock: 100 MHz'")
            return None
        cycles = number if not unit else self._of_unit(number, unit)
        if not 1 <= cycles <= _LONGEST_TIME:
            message = f"'{key}' is {floor(cycles)} cycles"
            self.faults.error(message, time.source, f"legal here: 1 to {_LONGEST_TIME} cycles")
            return None
        return rounded(cycles)

    def _of_unit(self, number: Fraction, unit: str) -> Fraction:
        assert self.clock is not None
        if unit in _SECONDS:
            return number * _SECONDS[unit] * self.clock
        return self.clock / (number * _HERTZ[unit]) if number else Fraction(0)


def _beats_at_most(publisher: Converter, project: Project) -> int | None:
    """Return the number of beats in a publisher's longest frame, or None if its size is unbounded.

    The default of `maxLength` is no bound: it is far above the size of most messages.
    """
    given = None if publisher.has_default_length else publisher.max_length
    limits = (publisher.buffer or None, given, length_of(publisher.frame).maximum)
    known = [limit for limit in limits if limit is not None]
    return frame_beats(min(known), project.width, project.id_bytes) if known else None
