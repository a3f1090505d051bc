"""The page's view of a run: reports over a WebSocket, the record, single messages and their pictures.

The server sends reports unasked. The page confirms several displayed reports at once, since a request for each would
slow the run. A slow page receives fewer reports; the run never waits for it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from aiohttp import WSMsgType, web

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.node.engine.watch import Seen
from fusesoc_firm.node.transport.built_simulator import MOST_SEED, MOST_STALL_PERCENT
from fusesoc_firm.studio.foxglove import FOXGLOVE, PROTOCOLS, serve_foxglove
from fusesoc_firm.studio.message import fields_of, has_picture, has_pose, numbers_of, picture_of, pose_of
from fusesoc_firm.studio.page_run import Run, SimulatedRun, Wishes
from fusesoc_firm.studio.reports import Jobs, Reports, row
from fusesoc_firm.studio.requests import Requests, body_of, in_json, number_of
from fusesoc_firm.studio.units import unit_of
from fusesoc_firm.studio.workspace import Workspace
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, Topic
from fusesoc_firm.text.json_text import json_text
from fusesoc_firm.tools.simulators import fitting

# The time between two reports, and the largest number of unconfirmed reports.
_SECONDS, _MOST_AHEAD = 0.05, 20
# The number of messages in an answer about the record.
_MOST_ROWS = 200
# The number of bursts, of counts of waits, and of points in an answer.
_MOST_GRANTS, _MOST_WAITS, _MOST_POINTS = 500, 500, 500
# The number of beats in a wave.
_MOST_BEATS = 24
# The quantities of each message that can be plotted besides its own numbers.
LATENCY, BYTES = "latency", "bytes"
# The highest rate of messages a second that the page may ask for.
_MOST_RATE = 100_000
# The legal texts from a page: the number of reports displayed since its last confirmation.
_SHOWN = {str(count) for count in range(1, _MOST_AHEAD + 1)}
_CONTROLS = ("pause", "resume", "step", "stop")


class Live:
    """The current run, and the requests about it."""

    def __init__(self, workspace: Workspace, jobs: Callable[[], Jobs]) -> None:
        """Begin without a run; `jobs` returns the states of the builds."""
        self._workspace, self._jobs = workspace, jobs
        self._count = 0
        self._sockets: set[web.WebSocketResponse] = set()
        self._pages = 0
        self._file = ""
        self.run: Run | None = None

    def take(self, run: Run) -> None:
        """Watch another run; the previous one ends."""
        if self.run:
            self.run.stop()
        self.run = run
        run.watch.is_watched = lambda: self._pages > 0
        self._file = self._workspace.name(run.spec)
        self._count += 1

    def requests(self) -> Requests:
        """Return the requests."""
        return {
            "GET watch": self._watch,
            "GET record": self._record,
            "GET message": self._message,
            "GET picture": self._picture,
            "GET poses": self._poses,
            "GET wave": self._wave,
            "GET timeline": self._timeline,
            "GET status": self._status,
            "GET series": self._series,
            "POST run": self._run,
            "POST control": self._control,
            f"GET {FOXGLOVE}": self._foxglove,
        }

    async def close(self) -> None:
        """End the run that was started here, and all connections."""
        if self.run:
            self.run.stop()
            await asyncio.to_thread(self.run.wait)
        for socket in [*self._sockets]:
            await socket.close()

    # --- requests --------------------------------------------------------------------------------------------------

    async def _watch(self, request: web.Request) -> web.WebSocketResponse:
        """Send reports while the page confirms them by the number displayed."""
        # On loopback, compression costs more than it saves.
        socket = web.WebSocketResponse(heartbeat=20, max_msg_size=1024, compress=False)
        await socket.prepare(request)
        self._sockets.add(socket)
        self._pages += 1
        ahead = asyncio.Semaphore(_MOST_AHEAD)
        sender = asyncio.create_task(self._send(socket, ahead))
        try:
            async for message in socket:
                if message.type == WSMsgType.TEXT and message.data in _SHOWN:
                    for _ in range(int(message.data)):
                        ahead.release()
        finally:
            self._sockets.discard(socket)
            self._pages -= 1
            sender.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await sender
        return socket

    async def _foxglove(self, request: web.Request) -> web.WebSocketResponse:
        """Serve a program with Foxglove's protocol."""
        socket = web.WebSocketResponse(heartbeat=20, max_msg_size=2**16, protocols=PROTOCOLS)
        await socket.prepare(request)
        self._sockets.add(socket)
        try:
            await serve_foxglove(socket, lambda: self.run)
        finally:
            self._sockets.discard(socket)
        return socket

    async def _send(self, socket: web.WebSocketResponse, ahead: asyncio.Semaphore) -> None:
        """Send new reports, at most one per `_SECONDS`; `ahead` limits the unconfirmed ones."""
        reports, now = Reports(), asyncio.get_running_loop().time
        while True:
            await ahead.acquire()
            while (report := reports.next(self.run, self._count, self._file, self._jobs())) is None:
                await asyncio.sleep(_SECONDS)
            await socket.send_json(report, dumps=json_text)
            # Sleep until the next multiple of the period, so that delays do not accumulate.
            await asyncio.sleep(_SECONDS - now() % _SECONDS)

    async def _record(self, request: web.Request) -> web.Response:
        """Return the rows of the record before a message."""
        run = self._current()
        rows, topics = run.watch.before(number_of(request, "before"), _MOST_ROWS), run.topics
        return in_json({"messages": await asyncio.to_thread(lambda: [row(seen, topics) for seen in rows])})

    async def _message(self, request: web.Request) -> web.Response:
        """Return the fields of a message, and the waits while the hardware worked on it."""
        run, seen = self._seen(request)
        frame = run.topics[seen.block].frame
        found = await asyncio.to_thread(fields_of, frame, seen.payload)
        kinds = {"hasPicture": has_picture(frame), "hasPose": has_pose(frame)}
        waits = run.watch.waits_during(seen, _MOST_WAITS)
        found |= {"row": row(seen, run.topics), "type": str(frame.message), "waits": waits and vars(waits)}
        return in_json(kinds | found)

    async def _picture(self, request: web.Request) -> web.Response:
        """Return the picture in a message."""
        run, seen = self._seen(request)
        found = await asyncio.to_thread(picture_of, run.topics[seen.block].frame, seen.payload)
        if not found:
            raise web.HTTPNotFound(reason="this message has no picture that a browser shows")
        return web.Response(body=found[0], content_type=found[1])

    async def _poses(self, request: web.Request) -> web.Response:
        """Return the poses of a block's earlier messages, and last the pose in this message."""
        run, seen = self._seen(request)
        frame, messages = run.topics[seen.block].frame, run.watch.of(seen.block, _MOST_POINTS, seen.number)
        found = await asyncio.to_thread(lambda: [pose_of(frame, message.payload) for message in messages])
        # Without its own pose, the page would show an earlier pose for this message.
        return in_json({"poses": [pose for pose in found if pose] if found and found[-1] else []})

    async def _wave(self, request: web.Request) -> web.Response:
        """Return the beats of a message's frame on the stream of the system."""
        run, seen = self._seen(request)
        return in_json(wave(run.system, run.topics[seen.block], seen))

    async def _timeline(self, _: web.Request) -> web.Response:
        """Return the latest bursts of the hardware, and the waits of its wires from the first of them on."""
        watch = self._current().watch
        grants = watch.grants(_MOST_GRANTS)
        waits = watch.waits(_MOST_WAITS, grants[0].first if grants else 0)
        return in_json(
            {
                "grants": [(item.block, item.first, item.last) for item in grants],
                "waits": [vars(item) for item in waits],
            }
        )

    async def _status(self, _: web.Request) -> web.Response:
        """Return the counters of the hardware's status."""
        run = self._current()
        return in_json({"access": run.system.status and run.system.status.value, "counts": run.watch.status})

    async def _series(self, request: web.Request) -> web.Response:
        """Return the latest values of a number in a block's messages, and the names of its numbers."""
        run, block = self._current(), request.query.get("block", "")
        topic = run.topics.get(block)
        if not topic:
            raise web.HTTPNotFound(reason="there is no such block")
        seen = run.watch.of(block, _MOST_POINTS)
        return in_json(await asyncio.to_thread(series, topic.frame, seen, request.query.get("field", LATENCY)))

    async def _run(self, request: web.Request) -> web.Response:
        """Simulate the system of a file with the stimuli of its core; the previous run ends."""
        body, workspace = await body_of(request), self._workspace
        document, wishes = workspace.document(body.get("file")), _wishes(body)

        def prepared() -> SimulatedRun:
            return SimulatedRun(workspace.loaded(document), document.path, wishes, workspace.tools.build)

        run = await workspace.in_turn(prepared)
        self.take(run)
        run.begin()
        return in_json({})

    async def _control(self, request: web.Request) -> web.Response:
        """Pause the run, continue it, let one message pass, or end it."""
        run, body = self._current(), await body_of(request)
        wish = body.get("do")
        if wish not in _CONTROLS or not run.control:
            raise web.HTTPBadRequest(reason=f"legal for a run that the page controls: {', '.join(_CONTROLS)}")
        if wish == "stop":
            run.stop()
        else:
            getattr(run.control, wish)()
        return in_json({})

    # --- the run ---------------------------------------------------------------------------------------------------

    def _current(self) -> Run:
        if not self.run:
            raise web.HTTPNotFound(reason="nothing has run yet")
        return self.run

    def _seen(self, request: web.Request) -> tuple[Run, Seen]:
        run = self._current()
        seen = run.watch.find(number_of(request, "number"))
        if not seen:
            raise web.HTTPNotFound(reason="this message is not in the record any more")
        return run, seen


def wave(system: DerivedSystem, topic: Topic, seen: Seen) -> dict[str, Any]:
    """Return the frame of a message in beats: the bytes of the first beats, the number of beats, and their cycles.

    A message of software has no frame, and therefore no beats.
    """
    if not isinstance(topic, Converter):
        return {"beats": [], "count": 0, "cycles": None}
    frame, size = pack_frame(topic.id, seen.payload, system.id_bytes), system.width // 8
    beats = [frame[at : at + size].hex(" ") for at in range(0, min(len(frame), size * _MOST_BEATS), size)]
    return {"beats": beats, "count": -(-len(frame) // size), "cycles": seen.cycles}


def series(frame: Frame, messages: Sequence[Seen], field: str) -> dict[str, Any]:
    """Return the value of a field in messages: points of seconds and value, its unit, and the names of all fields.

    The value is None if the message lacks this number.
    """
    fields = [LATENCY, BYTES, *(numbers_of(frame, messages[-1].payload) if messages else ())]
    unit = "bytes" if field == BYTES else unit_of(str(frame.message), field)
    points = [(seen.time_ns / 1e9, _value(frame, seen, field)) for seen in messages]
    return {"fields": fields, "unit": unit, "points": points}


def _value(frame: Frame, seen: Seen, field: str) -> float | None:
    if field == BYTES:
        return len(seen.payload)
    if field == LATENCY:
        return seen.latency.wall_ns if seen.latency.cycles is None else seen.latency.cycles
    return numbers_of(frame, seen.payload).get(field)


def _wishes(body: Mapping[str, Any]) -> Wishes:
    """Return a request's options of a simulation; raise 400 for an invalid request."""
    tools = [*fitting(is_live=True)]
    tool, rate = body.get("tool", tools[0]), body.get("rate", 0)
    is_endless, is_paused = body.get("isEndless", False), body.get("isPaused", False)
    seed, stall_percent = body.get("seed", 1), body.get("stallPercent", 0)
    bounds = {"rate": (rate, 0, _MOST_RATE), "seed": (seed, 1, MOST_SEED)}
    bounds["stallPercent"] = (stall_percent, 0, MOST_STALL_PERCENT)
    for name, (value, least, most) in bounds.items():
        if not isinstance(value, int) or not least <= value <= most:
            raise web.HTTPBadRequest(reason=f"'{name}' is a whole number of {least} to {most}")
    if tool not in tools or not isinstance(is_endless, bool) or not isinstance(is_paused, bool):
        raise web.HTTPBadRequest(reason=f"the simulators are {', '.join(tools)}")
    return Wishes(tool, rate, is_endless, is_paused, seed, stall_percent)
