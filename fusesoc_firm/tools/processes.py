"""Processes of this machine, as its kernel describes them (proc_pid_stat(5))."""

from __future__ import annotations

from typing import NamedTuple

from fusesoc_firm.text.files import read_file


class Status(NamedTuple):
    """Its state, such as R or Z (zombie); the id of its group; its start time, in the system's units."""

    state: str
    group: str
    started: str


def process_status(process: int | str) -> Status | None:
    """Return the status of a process, or None if there is no such process."""
    text = (read_file(f"/proc/{process}/stat") or b"").decode(errors="replace")
    # The fields follow the name in parentheses, which may contain anything.
    fields = text.rpartition(")")[2].split()
    return Status(fields[0], fields[2], fields[19]) if fields else None


def start_time(process: int) -> str:
    """Return when a process started, in the system's units, or "" if there is no such process."""
    status = process_status(process)
    return status.started if status else ""
