"""The server of the page: on loopback alone, under an address with a secret, for the files of one folder.

Another page in the same browser knows neither the secret nor may it send requests here: hosts and origins other than
our own are refused, which also ends attacks by names that lead to loopback (DNS rebinding).
"""

from __future__ import annotations

import asyncio
import hmac
import json
import os
import secrets
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

from aiohttp import WSMsgType, web

from fusesoc_firm.simulation.simulator import MOST_SEED, MOST_STALL_PERCENT
from fusesoc_firm.studio.document import Document
from fusesoc_firm.studio.foxglove import FOXGLOVE
from fusesoc_firm.studio.live import Live
from fusesoc_firm.studio.run import Build, SimulatedRun, Wishes
from fusesoc_firm.studio.scene import content_of, grammar, scene
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import Diagnostic, InputError
from fusesoc_firm.text.files import is_file
from fusesoc_firm.text.yaml_edit import EditError
from fusesoc_firm.text.yaml_text import SMALL
from fusesoc_firm.tools.simulators import fitting

HOST = "127.0.0.1"
_PAGE = Path(__file__).parent / "static"
# The names that a specification may end with, and folders in which nobody writes one.
_SUFFIXES = (".yaml", ".yml")
_NO_SOURCES = ("build", "node_modules")
# The seconds between two looks at the opened files.
_LOOK = 0.3
# The largest number of messages in an answer to a search, and of specifications in a list.
_MOST_NAMES, _MOST_FILES = 50, 1000
# The highest rate of messages a second that the page may ask for.
_MOST_RATE = 100_000
# Everything comes from this server; nothing that a file contains can run.
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; font-src 'self';"
    " connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}

Load = Callable[[Path, str], LoadedSystem]
"""Derives the system of a text in the place of a specification. May raise `InputError`."""
Check = Callable[[LoadedSystem, Path], Sequence[Diagnostic]]
"""Compares a system's accelerators with their sources and returns the warnings. May raise `InputError`."""
Names = Callable[[Path, Sequence[str]], Sequence[str]]
"""Returns the names of all messages for a specification with these `paths`. May raise `InputError`."""


class Studio:
    """The page's server for a folder of specifications, or for one specification."""

    def __init__(self, place: Path, load: Load, check: Check, names: Names, build: Build) -> None:
        """Serve a file or folder; `load`, `check`, `names` and `build` are what the command line uses."""
        self._place = place.resolve()
        self._folder = self._place if self._place.is_dir() else self._place.parent
        self._load, self._check, self._names, self._build = load, check, names, build
        self.live = Live(self._name)
        self._documents: dict[str, Document] = {}
        self._listeners: set[web.WebSocketResponse] = set()
        # Derivations share caches, so one runs at a time.
        self._turn = asyncio.Lock()
        self._own_hosts: set[str] = set()
        self.secret = secrets.token_urlsafe(24)

    async def start(self, port: int = 0) -> web.AppRunner:
        """Start the server on a port of loopback (0: any free one); `address` is known afterwards."""
        app = web.Application(middlewares=[self._guard], client_max_size=2 * SMALL.bytes)
        under = f"/{self.secret}"
        app.add_routes(
            [
                web.get(f"{under}/", self._page),
                web.get(f"{under}/api/files", self._files),
                web.get(f"{under}/api/grammar", self._grammar),
                web.get(f"{under}/api/scene", self._scene),
                web.get(f"{under}/api/messages", self._messages),
                web.get(f"{under}/api/sources", self._sources),
                web.get(f"{under}/api/changes", self._changes),
                web.post(f"{under}/api/check", self._check_text),
                web.post(f"{under}/api/run", self._run),
                *self.live.routes(f"{under}/api"),
                *(web.post(f"{under}/api/{step}", self._step) for step in ("edit", "write", "undo", "redo")),
            ]
        )
        if (_PAGE / "assets").is_dir():
            app.router.add_static(f"{under}/assets", _PAGE / "assets")
        app.cleanup_ctx.append(self._following)
        app.on_shutdown.append(lambda _: self.live.close())
        runner = web.AppRunner(app, access_log=None)
        await runner.setup()
        site = web.TCPSite(runner, HOST, port)
        await site.start()
        number = runner.addresses[0][1]
        self._own_hosts = {f"{name}:{number}" for name in (HOST, "localhost")}
        self.address = f"http://{HOST}:{number}{under}/"
        self.foxglove = f"ws://{HOST}:{number}{under}/api/{FOXGLOVE}"
        return runner

    # --- requests --------------------------------------------------------------------------------------------------

    @web.middleware
    async def _guard(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Refuse requests that our own page would not send, and turn faults into answers."""
        origin = request.headers.get("Origin")
        is_own = request.headers.get("Host", "") in self._own_hosts
        # Foxglove's page comes from another server; like every program, it needs the secret.
        is_foxglove = request.path.endswith(f"/api/{FOXGLOVE}")
        is_own = is_own and (is_foxglove or origin is None or origin.removeprefix("http://") in self._own_hosts)
        secret = request.path.split("/")[1] if "/" in request.path else ""
        if not is_own or not hmac.compare_digest(secret.encode(), self.secret.encode()):
            return web.Response(status=403, text="open the address that firm studio printed\n", headers=_HEADERS)
        if request.method == "POST" and request.content_type != "application/json":
            return web.Response(status=415, text="requests are in JSON\n", headers=_HEADERS)
        try:
            answer = await handler(request)
        except (EditError, InputError) as error:
            answer = _json({"reason": str(error)}, status=409)
        except web.HTTPException as error:
            answer = web.Response(status=error.status, text=f"{error.reason}\n")
        if not answer.prepared:
            answer.headers.update(_HEADERS)
        return answer

    async def _page(self, _: web.Request) -> web.Response:
        try:
            text = (_PAGE / "index.html").read_text(encoding="utf-8")
        except OSError:
            text = "The page is not built; 'make studio' builds it.\n"
        # The browser requests the first picture's data at once, not when the page's program has begun.
        headers = {"Link": "<api/scene>; rel=preload; as=fetch; crossorigin"}
        return web.Response(text=text, content_type="text/html", headers=headers)

    async def _files(self, _: web.Request) -> web.Response:
        return _json({"files": await asyncio.to_thread(lambda: [*islice(self._specifications(), _MOST_FILES)])})

    async def _grammar(self, _: web.Request) -> web.Response:
        return _json(grammar())

    async def _scene(self, request: web.Request) -> web.Response:
        """Return the scene of a file, or of the first one if none is named."""
        name = request.query.get("file")
        if name is None:
            name = await asyncio.to_thread(lambda: next(self._specifications(), None))
            if name is None:
                return _json(None)
        document = self._document(name)
        document.follow()
        return await self._answer(document)

    async def _messages(self, request: web.Request) -> web.Response:
        """Search all messages for the words of a query."""
        document = self._document(request.query.get("file", ""))
        words = request.query.get("query", "").lower().split()
        found = (content_of(document.text) or {}).get("paths") or []
        paths = [str(item) for item in found] if isinstance(found, list) else [str(found)]
        async with self._turn:
            names = await asyncio.to_thread(self._names, document.path, paths)
        found = [name for name in names if all(word in name.lower() for word in words)]
        return _json({"messages": found[:_MOST_NAMES], "count": len(found)})

    async def _sources(self, request: web.Request) -> web.Response:
        """Compare the accelerators' sources with their interfaces."""
        document = self._document(request.query.get("file", ""))
        async with self._turn:
            return _json({"faults": await asyncio.to_thread(self._source_faults, document)})

    async def _check_text(self, request: web.Request) -> web.Response:
        """Return the scene of a text that is not in the file yet."""
        body = await _body(request)
        document = self._document(body.get("file"))
        return await self._answer(document, str(body.get("text", "")))

    async def _step(self, request: web.Request) -> web.Response:
        """Edit the file, and return its new scene."""
        body = await _body(request)
        document, version = self._document(body.get("file")), str(body.get("version"))
        match request.path.rsplit("/", 1)[-1]:
            case "edit":
                edit = body.get("change")
                document.edit(version, edit if isinstance(edit, dict) else {})
            case "write":
                document.write(version, str(body.get("text", "")))
            case "undo":
                document.undo(version)
            case _:
                document.redo(version)
        return await self._answer(document)

    async def _run(self, request: web.Request) -> web.Response:
        """Simulate the system of a file with the stimuli of its core; the run before ends."""
        body = await _body(request)
        document, wishes = self._document(body.get("file")), _wishes(body)
        async with self._turn:
            loaded = await asyncio.to_thread(self._load, document.path, document.text)
            run = await asyncio.to_thread(SimulatedRun, loaded, document.path, wishes, self._build)
        self.live.take(run)
        return _json({})

    async def _answer(self, document: Document, unsaved: str | None = None) -> web.Response:
        text, file = document.text if unsaved is None else unsaved, str(document.path)
        async with self._turn:
            found = await asyncio.to_thread(scene, text, file, lambda text: self._load(document.path, text))
        state = {"version": document.version, "canUndo": document.can_undo, "canRedo": document.can_redo}
        return _json({"file": self._name(document.path), "text": text, **state, **found})

    def _source_faults(self, document: Document) -> list[dict[str, Any]]:
        try:
            diagnostics = self._check(self._load(document.path, document.text), document.path)
        except InputError as error:
            diagnostics = error.diagnostics
        return [item.data() for item in diagnostics]

    # --- files -----------------------------------------------------------------------------------------------------

    def _specifications(self) -> Iterator[str]:
        """Yield the names of all specifications, relative to the folder."""
        if not self._place.is_dir():
            yield self._name(self._place)
            return
        for place, folders, names in os.walk(self._folder):
            folders[:] = sorted(name for name in folders if name not in _NO_SOURCES and not name.startswith("."))
            for path in (Path(place, name) for name in sorted(names)):
                if path.suffix in _SUFFIXES and self._is_inside(path) and _is_specification(path):
                    yield self._name(path)

    def _document(self, name: object) -> Document:
        """Return the open document with a name; raise 404 for files outside the folder and for other files."""
        path = self._folder / str(name)
        if (
            not name
            or "\0" in str(name)
            or path.suffix not in _SUFFIXES
            or not self._is_inside(path)
            or not is_file(path)
        ):
            raise web.HTTPNotFound(reason="there is no such specification")
        if not self._place.is_dir() and path.resolve() != self._place:
            raise web.HTTPNotFound(reason="only one specification is open")
        path = path.resolve()
        return self._documents.setdefault(str(path), Document(path))

    def _is_inside(self, path: Path) -> bool:
        return path.resolve().is_relative_to(self._folder)

    def _name(self, path: Path) -> str:
        return path.relative_to(self._folder).as_posix()

    # --- changes by others -----------------------------------------------------------------------------------------

    async def _changes(self, request: web.Request) -> web.WebSocketResponse:
        """Tell the page which open file another program has changed."""
        socket = web.WebSocketResponse(heartbeat=20, max_msg_size=1024)
        await socket.prepare(request)
        self._listeners.add(socket)
        try:
            async for message in socket:
                if message.type == WSMsgType.ERROR:
                    break
        finally:
            self._listeners.discard(socket)
        return socket

    async def _following(self, _: web.Application) -> Any:
        task = asyncio.create_task(self._follow())
        yield
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        for socket in [*self._listeners]:
            await socket.close()

    async def _follow(self) -> None:
        while True:
            await asyncio.sleep(_LOOK)
            for document in [*self._documents.values()]:
                with suppress(InputError):
                    if document.follow():
                        await self._tell({"changed": self._name(document.path)})

    async def _tell(self, event: dict[str, Any]) -> None:
        for socket in [*self._listeners]:
            with suppress(ConnectionError):
                await socket.send_json(event)


async def _body(request: web.Request) -> dict[str, Any]:
    try:
        body = await request.json()
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError):
        body = None
    if not isinstance(body, dict):
        raise web.HTTPBadRequest(reason="the request is not a mapping in JSON")
    return body


def _wishes(body: Mapping[str, Any]) -> Wishes:
    """Return what a request asks of a simulation; raise 400 for anything else."""
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


def _json(data: object, status: int = 200) -> web.Response:
    # YAML has values, such as dates, that JSON has not.
    return web.json_response(data, status=status, dumps=lambda value: json.dumps(value, default=str))


def _text(path: Path) -> str:
    with suppress(OSError, UnicodeDecodeError):
        if path.stat().st_size <= SMALL.bytes:
            return path.read_text(encoding="utf-8")
    return ""


def _is_specification(path: Path) -> bool:
    return {"project", "blocks"} <= (content_of(_text(path)) or {}).keys()
