"""The access to the status registers of a system: the keys `status` and `timeStamps` of the specification."""

from __future__ import annotations

from fusesoc_firm.system.derived.ids import ONE_BYTE
from fusesoc_firm.system.derived.model import Link, StatusAccess
from fusesoc_firm.system.written.specification import ADDED, NO_STATUS, STATUS_AXI_LITE, STATUS_FRAMES, Project
from fusesoc_firm.text.diagnostics import Diagnostics

# Frames with the highest id carry accesses in both directions, so no converter has this id.
STATUS_ID = 255
TREE_CHANNELS = 4096
"""The maximum number of channels that the registers of a system with ids of two bytes cover."""


def status_id(id_bytes: int) -> int:
    """Return the id of the frames that access the status: the highest one."""
    return int(256**id_bytes - 1)


def status_of(
    project: Project, link: Link | None, subscribers: int, publishers: int, faults: Diagnostics
) -> StatusAccess | None:
    """Return the access to the status, or None without a status; note faults.

    The numbers count the system's converters.
    """
    if project.status == NO_STATUS:
        return None
    access = StatusAccess(project.status)
    if access is StatusAccess.AXI_LITE and link:
        faults.error(
            f"interconnect '{link.kind.value}' has no port for AXI4-Lite",
            project.status.source,
            f"use 'status: {STATUS_FRAMES}'",
        )
    if project.id_bytes > ONE_BYTE:
        _check_channels(project, subscribers + publishers, faults)
    elif access is StatusAccess.FRAMES:
        _check_id(project, max(subscribers, publishers), faults)
    return access


def has_time_stamps(project: Project, faults: Diagnostics) -> bool:
    """Return whether the status has time stamps; note a fault if there is no status."""
    is_wanted = project.time_stamps == ADDED
    if is_wanted and project.status == NO_STATUS:
        faults.error(
            f"'timeStamps: {ADDED}' needs a status, which holds the time stamps",
            project.time_stamps.source,
            f"add 'status: {STATUS_FRAMES}' or 'status: {STATUS_AXI_LITE}'",
        )
    return is_wanted


def _check_channels(project: Project, channels: int, faults: Diagnostics) -> None:
    if channels > TREE_CHANNELS:
        faults.error(
            f"'status: {project.status}' has no registers for {channels} subscribers and publishers",
            project.status.source,
            f"at most {TREE_CHANNELS} together are possible with it",
        )


def _check_id(project: Project, converters: int, faults: Diagnostics) -> None:
    if converters > STATUS_ID:
        faults.error(
            f"'status: {STATUS_FRAMES}' needs the id {STATUS_ID}, which a converter has",
            project.status.source,
            f"at most {STATUS_ID} subscribers and {STATUS_ID} publishers are possible with it",
        )
