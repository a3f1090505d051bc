"""Groups of publishers, each with a separate scheduler: the combined schedulers of section 4.3.5."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.system.derived.ids import ONE_BYTE
from fusesoc_firm.system.derived.model import Converter, Group
from fusesoc_firm.system.written.specification import AUTO_SCHEDULER, Project
from fusesoc_firm.text.diagnostics import Diagnostics, nearest
from fusesoc_firm.text.yaml_text import Text


def groups_of(project: Project, publishers: Sequence[Converter], faults: Diagnostics) -> tuple[Group, ...]:
    """Return the groups of a system with these publishers; empty if the specification has no groups.

    Note faults: each publisher must be in one group, and groups must follow the order of the publishers' ids, since the
    hardware divides consecutive ids.
    """
    if not project.groups or not all(group.is_sound for group in project.groups):
        return ()
    if project.id_bytes > ONE_BYTE:
        place = project.place("groups")
        faults.error(
            f"'groups' is not possible with 'idBytes: {project.id_bytes}'",
            place,
            "leave out 'groups': these groups follow from the publishers' periods",
        )
    _check_scheduler(project, faults)
    _check_members(project, [publisher.block for publisher in publishers], faults)
    return tuple(Group(str(item.scheduler), tuple(map(str, item.publishers))) for item in project.groups)


def _check_scheduler(project: Project, faults: Diagnostics) -> None:
    """Note a policy that cannot choose among groups."""
    name = str(project.scheduler)
    if name == AUTO_SCHEDULER or POLICIES[name].has_deadlines:
        legal = ", ".join(name for name, policy in POLICIES.items() if not policy.has_deadlines)
        faults.error(
            f"scheduler '{name}' cannot select among groups, which have no deadlines",
            project.place("scheduler"),
            f"legal here: {legal}",
        )


def _check_members(project: Project, publishers: Sequence[str], faults: Diagnostics) -> None:
    """Note publishers that are unknown, in two groups, in no group, or out of the order of their ids."""
    members = list[Text](chain.from_iterable(group.publishers for group in project.groups))
    seen = set[str]()
    before = len(faults.found)
    for member in members:
        if member not in publishers:
            hint = nearest(member, publishers)
            faults.error(f"'groups' names '{member}', which is not a publisher of the hardware", member.source, hint)
        elif member in seen:
            faults.error(f"publisher '{member}' is in 'groups' twice", member.source)
        seen.add(str(member))
    for name in publishers:
        if name not in seen:
            faults.error(f"publisher '{name}' is in none of the 'groups'", project.place("groups"))
    if len(faults.found) == before and (moved := [a for a, b in zip(members, publishers, strict=True) if a != b]):
        faults.error(
            f"'groups' has '{moved[0]}' at another place than its id",
            moved[0].source,
            f"name the publishers in the order of their ids: {', '.join(publishers)}",
        )
