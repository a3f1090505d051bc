"""The page's requests about specifications: scenes, search for messages, and edits of the files."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from itertools import islice
from typing import Any

from aiohttp import WSMsgType, web

from fusesoc_firm.studio.document import Document
from fusesoc_firm.studio.requests import Requests, body_of, in_json
from fusesoc_firm.studio.scene import content_of, grammar, outline, scene
from fusesoc_firm.studio.workspace import MOST_NAMES, Workspace, with_words
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.json_text import json_text

# The seconds between two checks of the opened files for changes.
_LOOK = 0.3
# The largest number of specifications in a list.
_MOST_FILES = 1000


class Editing:
    """The requests about the specifications of a workspace."""

    def __init__(self, workspace: Workspace) -> None:
        """Begin without an open document."""
        self._workspace = workspace
        self._listeners: set[web.WebSocketResponse] = set()

    def requests(self) -> Requests:
        """Return the requests."""
        return {
            "GET files": self._files,
            "GET grammar": self._grammar,
            "GET outline": self._outline,
            "GET scene": self._scene,
            "GET messages": self._messages,
            "GET sources": self._sources,
            "GET changes": self._changes,
            "POST check": self._check_text,
            **{f"POST {step}": self._step for step in ("edit", "write", "undo", "redo")},
        }

    # --- scenes ----------------------------------------------------------------------------------------------------

    async def _files(self, _: web.Request) -> web.Response:
        names = await asyncio.to_thread(lambda: [*islice(self._workspace.specifications(), _MOST_FILES)])
        return in_json({"files": names})

    async def _grammar(self, _: web.Request) -> web.Response:
        return in_json(grammar())

    async def _outline(self, _: web.Request) -> web.Response:
        """Return the written part of the first file's scene, without faults and derived facts."""
        name = await asyncio.to_thread(lambda: next(self._workspace.specifications(), None))
        if name is None:
            return in_json(None)
        document = self._workspace.document(name)
        document.follow()
        return in_json(self._written(document, document.text) | outline(document.text))

    async def _scene(self, request: web.Request) -> web.Response:
        """Return the scene of a file."""
        document = self._workspace.document(request.query.get("file", ""))
        document.follow()
        return await self._answer(document)

    async def _messages(self, request: web.Request) -> web.Response:
        """Search all messages for the words of a query."""
        document = self._workspace.document(request.query.get("file", ""))
        found = (content_of(document.text) or {}).get("paths") or []
        paths = [str(item) for item in found] if isinstance(found, list) else [str(found)]
        names = await self._workspace.in_turn(self._workspace.tools.names, document.path, paths)
        found = with_words(names, request.query.get("query", ""))
        return in_json({"messages": found[:MOST_NAMES], "count": len(found)})

    async def _sources(self, request: web.Request) -> web.Response:
        """Compare the accelerators' sources with their interfaces."""
        document = self._workspace.document(request.query.get("file", ""))
        return in_json({"faults": await self._workspace.in_turn(self._source_faults, document)})

    def _source_faults(self, document: Document) -> list[dict[str, Any]]:
        try:
            loaded = self._workspace.loaded(document)
        except InputError:
            # The scene reports these faults.
            return []
        try:
            diagnostics = self._workspace.tools.check(loaded, document.path)
        except InputError as error:
            diagnostics = error.shown()
        return [item.data() for item in diagnostics]

    async def _answer(self, document: Document, unsaved: str | None = None) -> web.Response:
        text, load = document.text if unsaved is None else unsaved, self._workspace.tools.load
        found = await self._workspace.in_turn(scene, text, str(document.path), lambda text: load(document.path, text))
        return in_json(self._written(document, text) | found)

    def _written(self, document: Document, text: str) -> dict[str, Any]:
        state = {"version": document.version, "canUndo": document.can_undo, "canRedo": document.can_redo}
        return {"file": self._workspace.name(document.path), "text": text, **state}

    # --- edits -----------------------------------------------------------------------------------------------------

    async def _check_text(self, request: web.Request) -> web.Response:
        """Return the scene of a text before it is saved."""
        body = await body_of(request)
        document = self._workspace.document(body.get("file"))
        return await self._answer(document, str(body.get("text", "")))

    async def _step(self, request: web.Request) -> web.Response:
        """Edit the file, and return its new scene."""
        body = await body_of(request)
        document, version = self._workspace.document(body.get("file")), str(body.get("version"))
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

    # --- changes by others -----------------------------------------------------------------------------------------

    async def _changes(self, request: web.Request) -> web.WebSocketResponse:
        """Report to the page each open file that another program has changed."""
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

    async def following(self, _: web.Application) -> Any:
        """Follow the opened files as long as the server runs."""
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
            for document in self._workspace.documents:
                with suppress(InputError):
                    if document.follow():
                        await self._tell({"changed": self._workspace.name(document.path)})

    async def _tell(self, event: dict[str, Any]) -> None:
        for socket in [*self._listeners]:
            with suppress(ConnectionError):
                await socket.send_json(event, dumps=json_text)
