"""The tree of a Manager of Managers: groups of publishers, and the policies of its schedulers.

The groups follow from the publishers' periods. In a group of n among g groups, round robin serves at most n*g-1 frames
of other publishers first, so publishers with short periods are in small groups.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isqrt

from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.system.derived.ids import ONE_BYTE, TWO_BYTES
from fusesoc_firm.system.derived.model import Link, PublisherTimes, Scheduling, Tree
from fusesoc_firm.system.written.specification import AUTO_SCHEDULER, Project
from fusesoc_firm.text.diagnostics import Diagnostics

# The hardware's maximum number of groups, and of publishers in a group.
_MOST = 256
_TURNS, _PRIORITY = "round_robin", "fixed_priority"


def tree_of(project: Project, scheduling: Scheduling, link: Link | None, faults: Diagnostics) -> Tree | None:
    """Return the tree of a system whose ids have two bytes, or None; note faults."""
    if project.id_bytes == ONE_BYTE:
        return None
    if scheduling.is_preemptive:
        whole = ", ".join(name for name, policy in POLICIES.items() if not policy.is_preemptive)
        faults.error(
            f"scheduler '{scheduling.policy}' is not possible with 'idBytes: {TWO_BYTES}'",
            project.scheduler.source,
            f"legal here: schedulers that send whole frames: {whole}, {AUTO_SCHEDULER}",
        )
    if link:
        faults.error(
            f"interconnect '{link.kind.value}' is not possible with 'idBytes: {TWO_BYTES}'",
            project.interconnect.source,
            "use 'axi_stream'",
        )
    groups = groups_by_period(scheduling.times)
    if project.scheduler != AUTO_SCHEDULER:
        return Tree(groups, scheduling.policy, scheduling.policy)
    return Tree(groups, _TURNS, _TURNS if _meets_periods(groups, scheduling.times) else _PRIORITY)


def groups_by_period(times: Sequence[PublisherTimes]) -> tuple[tuple[int, ...], ...]:
    """Return the ids of each group's publishers: by period if all periods are known, else in order of ids."""
    count = len(times)
    periods = [item.period for item in times if item.period]
    longest = max((item.transfer_time or 0 for item in times), default=0)
    if len(periods) < count or not longest:
        side = isqrt(count - 1) + 1
        return _cut(range(count), [side] * -(-count // side))
    order = sorted(range(count), key=lambda number: (times[number].period or 0, number))
    return _cut(order, _sizes(sorted(periods), longest))


def _cut(order: Sequence[int], sizes: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    starts = [sum(sizes[:place]) for place in range(len(sizes))]
    return tuple(tuple(order[start : start + size]) for start, size in zip(starts, sizes, strict=True))


def _sizes(periods: Sequence[int], longest: int) -> list[int]:
    """Return the sizes of the fewest groups that meet all periods, or else of equal groups.

    `periods` are in cycles, in ascending order. A turn serves a frame of `longest` cycles from each group.
    """
    side = isqrt(len(periods) - 1) + 1
    for groups in range(side, min(_MOST, len(periods)) + 1):
        sizes, first = list[int](), 0
        while first < len(periods):
            sizes.append(max(1, min(periods[first] // (groups * longest), 2 * side, _MOST, len(periods) - first)))
            first += sizes[-1]
        if len(sizes) <= groups:
            return sizes
    return [side] * -(-len(periods) // side)


def _meets_periods(groups: Sequence[Sequence[int]], times: Sequence[PublisherTimes]) -> bool:
    """Return whether round robin in all schedulers lets each publisher send once in its period."""
    turn = sum(max(times[number].transfer_time or 0 for number in group) for group in groups)
    return all(len(group) * turn <= (times[number].period or 0) for group in groups for number in group)
