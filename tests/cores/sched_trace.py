"""What a scheduler's ports did in every cycle, as `firm_sched_trace_tb` writes it, and its comparison with a model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fusesoc_firm.scheduling.models import Generics, Scheduler
from fusesoc_firm.scheduling.models.base import Bools, Ints

_HEAD = ("requesters", "cycles", "time_bits", "shortest_run", "periods", "transfer_times", "deadlines", "sizes")
_UNCHANGED = "."


@dataclass(frozen=True)
class Trace:
    """S segments, each with C cycles after a reset, of a scheduler with N requesters. All arrays are (S, C)."""

    head: dict[str, list[int]]
    packed_request: NDArray[np.uint8]  # (S, C, bytes), requester 0 in the lowest bit of the last byte
    beat: Bools
    last: Bools
    grant_valid: Bools
    grant_select: Ints

    @property
    def requesters(self) -> int:
        return self.head["requesters"][0]

    @property
    def segments(self) -> int:
        return len(self.beat)

    @property
    def cycles(self) -> int:
        """C."""
        return int(self.beat.shape[1])

    @property
    def generics(self) -> Generics:
        """The scheduler's, the same for each segment."""

        def times(name: str) -> Ints:
            return np.tile(np.array(self.head[name], np.int64), (self.segments, 1))

        is_implicit = self.head["deadlines"] == [0]
        return Generics(
            times("periods"),
            times("transfer_times"),
            None if is_implicit else times("deadlines"),
            self.head["shortest_run"][0],
            self.head["time_bits"][0],
        )

    def request(self, cycle: int) -> Bools:
        """The requests in a cycle, (S, N)."""
        bits = np.unpackbits(self.packed_request[:, cycle, ::-1], axis=1, bitorder="little", count=self.requesters)
        return bits.astype(np.bool_)


def read_trace(path: Path) -> Trace:
    """The trace in a file; raises `ValueError` if it breaks off."""
    lines = path.read_text(encoding="ascii").splitlines()
    head = {}
    for name, line in zip(_HEAD, lines, strict=False):
        found, *numbers = line.split()
        if found != name:
            raise ValueError(f"{path}: '{found}' where '{name}' should be")
        head[name] = [int(number) for number in numbers]
    cycles = head["cycles"][0]
    body = lines[len(_HEAD) :]
    if not body or len(body) % cycles:
        raise ValueError(f"{path}: {len(body)} cycles; segments have {cycles}")
    width = (head["requesters"][0] + 7) // 8
    nobody = bytes(width)
    requests, flags, selects = [], [], []
    for place, line in enumerate(body):
        request, flag, select = line.split()
        if place % cycles == 0:
            asked = nobody
        if request != _UNCHANGED:
            asked = bytes.fromhex(request.zfill(2 * width))
        requests.append(asked)
        flags.append(int(flag))
        selects.append(int(select))
    shape = (-1, cycles)
    flag_array = np.array(flags).reshape(shape)
    return Trace(
        head,
        np.frombuffer(b"".join(requests), np.uint8).reshape(*flag_array.shape, width),
        (flag_array & 4) > 0,
        (flag_array & 2) > 0,
        (flag_array & 1) > 0,
        np.array(selects, np.int64).reshape(shape),
    )


def first_difference(trace: Trace, scheduler: Scheduler) -> str:
    """Where `scheduler`, a batch of as many as there are segments, grants otherwise; empty if it never does."""
    for cycle in range(trace.cycles):
        valid, select = trace.grant_valid[:, cycle], trace.grant_select[:, cycle]
        differs = (scheduler.grant_valid != valid) | (valid & (scheduler.grant_select != select))
        if differs.any():
            segment = int(differs.argmax())
            expected = int(scheduler.grant_select[segment]) if scheduler.grant_valid[segment] else "nobody"
            found = int(select[segment]) if valid[segment] else "nobody"
            return f"segment {segment}, cycle {cycle}: granted {found}, the model grants {expected}"
        scheduler.step(trace.request(cycle), trace.beat[:, cycle], trace.last[:, cycle])
    return ""


class _Tasks:
    """Track, cycle by cycle, the requester between the first and the last beat of a task."""

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self._segments = np.arange(trace.segments)
        self.begun: Bools = np.zeros((trace.segments, trace.requesters), np.bool_)  # (S, N)

    def follow(self, cycle: int) -> None:
        beat, last = self._trace.beat[:, cycle], self._trace.last[:, cycle]
        granted = self._trace.grant_select[:, cycle]
        self.begun[self._segments[beat], granted[beat]] = ~last[beat]

    def of_granted(self, cycle: int) -> Bools:
        """Whether the requester that has the grant in `cycle` is, (S,)."""
        return self.begun[self._segments, self._trace.grant_select[:, cycle]]


def interruptions(trace: Trace) -> int:
    """How often the grant leaves a requester whose task is not over."""
    tasks, found = _Tasks(trace), 0
    for cycle in range(trace.cycles - 1):
        tasks.follow(cycle)
        left = trace.grant_select[:, cycle + 1] != trace.grant_select[:, cycle]
        found += int((tasks.of_granted(cycle) & left).sum())
    return found


def idle_grants(trace: Trace) -> int:
    """In how many cycles one has the grant who is in no task and shows none, while another has asked for two cycles."""
    tasks, found = _Tasks(trace), 0
    segments = np.arange(trace.segments)
    for cycle in range(1, trace.cycles):
        before = trace.request(cycle - 1)
        taken = trace.beat[:, cycle - 1]
        before[segments[taken], trace.grant_select[taken, cycle - 1]] = False
        tasks.follow(cycle - 1)
        is_idle = ~trace.request(cycle)[segments, trace.grant_select[:, cycle]] & ~tasks.of_granted(cycle)
        found += int((is_idle & before.any(axis=1)).sum())
    return found


def most_overtaken(trace: Trace) -> int:
    """How many tasks of others are completed at most while a requester asks in vain for its own task's first beat."""
    tasks, most = _Tasks(trace), 0
    overtaken = np.zeros((trace.segments, trace.requesters), np.int64)
    for cycle in range(trace.cycles):
        is_waiting = trace.request(cycle) & ~tasks.begun
        completed = trace.beat[:, cycle] & trace.last[:, cycle]
        overtaken = np.where(is_waiting, overtaken + completed[:, np.newaxis], 0)
        # A task of a single beat begins where it is completed: its own requester does not wait.
        overtaken[np.arange(trace.segments), trace.grant_select[:, cycle]] *= ~trace.beat[:, cycle]
        most = max(most, int(overtaken.max()))
        tasks.follow(cycle)
    return most
