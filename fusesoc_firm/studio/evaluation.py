"""The synthesis that the page requests: one at a time, in the background, while the page is connected."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Any

from aiohttp import web

from fusesoc_firm.exploration.resources import resources_of
from fusesoc_firm.studio.document import Document
from fusesoc_firm.studio.requests import Requests
from fusesoc_firm.studio.workspace import Workspace
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.json_text import json_text


class Evaluation:
    """The request about the resources of a system's blocks."""

    def __init__(self, workspace: Workspace) -> None:
        """Evaluate the specifications of a workspace."""
        self._workspace = workspace
        self._turn = asyncio.Lock()
        self._sockets: set[web.WebSocketResponse] = set()

    def requests(self) -> Requests:
        """Return the requests."""
        return {"GET resources": self._resources}

    async def close(self) -> None:
        """End the synthesis."""
        for socket in [*self._sockets]:
            await socket.close()

    async def _resources(self, request: web.Request) -> web.WebSocketResponse:
        """Synthesise the system of a file, and report steps and resources; the synthesis ends with the connection."""
        document = self._workspace.document(request.query.get("file", ""))
        socket = web.WebSocketResponse(heartbeat=20, max_msg_size=1024)
        await socket.prepare(request)
        self._sockets.add(socket)
        work = asyncio.create_task(self._synthesise(document, socket))
        try:
            async for _ in socket:
                pass
        finally:
            self._sockets.discard(socket)
            work.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await work
        return socket

    async def _synthesise(self, document: Document, socket: web.WebSocketResponse) -> None:
        async def tell(news: dict[str, Any]) -> None:
            await socket.send_json(news, dumps=json_text)

        async with self._turn:
            try:
                loaded = await self._workspace.in_turn(self._workspace.loaded, document)
                found = await resources_of(document.path, tell)
                await tell({"step": "done", "wanted": wanted(loaded.system)} | found)
            except InputError as error:
                await tell({"step": "failed", "reason": str(error).removeprefix("error: ")})
            except Exception as error:
                # Without an answer, the page would wait forever.
                await tell({"step": "failed", "reason": f"the synthesis failed: {type(error).__name__}: {error}"})
                raise


def wanted(system: DerivedSystem) -> dict[str, float]:
    """Return the clocks of a system in MHz: clk under "", and a block with a different clock under its name."""
    clocks = {block.block: system.clock_of(block.block) for block in system.accelerators}
    found = {name: float(clock.frequency) / 1e6 for name, clock in clocks.items() if clock}
    return found if system.clock is None else {"": float(system.clock) / 1e6} | found
