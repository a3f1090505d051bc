"""Processes of this machine, as its kernel describes them (proc_pid_stat(5))."""

from __future__ import annotations

from typing import NamedTuple

from fusesoc_firm.text.files import read_file


class Status(NamedTuple):
    """A process's state, such as R or Z (zombie), its group's id, and its start time in the system's units."""

    state: str
    group: str
    started: str


def process_status(process: int | str) -> Status | None:
    """Return the status of a process, or None if the process does not exist."""
    text = (read_file(f"/proc/{process}/stat") or b"").decode(errors="replace")
    # The fields follow the name in parentheses, which may contain anything.
    fields = text.rpartition(")")[2].split()
    return Status(fields[0], fields[2], fields[19]) if fields else None


def start_time(process: int) -> str:
    """Return the start time of a process in the system's units, or "" if the process does not exist."""
    status = process_status(process)
    return status.started if status else ""
