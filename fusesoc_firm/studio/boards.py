"""The page's builds for a board: `firm bitstream` and `firm load`, one at a time, in the project's folder.

A build belongs to the server, as a run does: it continues if the page is closed. Its progress is a part of the reports
(`reports.py`).
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from aiohttp import web

from fusesoc_firm.builds.setup.bitstream import programs_of, remedy
from fusesoc_firm.core.core_reader import CoreFile
from fusesoc_firm.node.transport.built_simulator import project_folder
from fusesoc_firm.studio.requests import Requests, body_of, in_json
from fusesoc_firm.studio.workspace import Workspace
from fusesoc_firm.system.boards.board import Board
from fusesoc_firm.system.message_sources import core_of
from fusesoc_firm.system.scaffold.board_targets import boards_of, fits
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.tools.programs import missing
from fusesoc_firm.tools.sessions import run

BITSTREAM, LOAD = "bitstream", "load"
_RUNNING, _FAILED, _CANCELLED = "running", "failed", "cancelled"
# Without -P, modules in the project's folder would replace those of Python.
_FIRM = (sys.executable, "-P", "-m", "fusesoc_firm.cli")
# The number of last lines that are shown if a command ends without a result.
_SHOWN_LINES = 20


class Boards:
    """The boards of the specifications of a workspace, and the latest bitstream and its loading.

    `jobs` has their states by kind: file and the version of its text, board, folder, the start in seconds since 1970,
    `state`, and what the command has printed last.
    """

    def __init__(self, workspace: Workspace) -> None:
        """Begin without a build."""
        self._workspace = workspace
        self._work: asyncio.Task[None] | None = None
        self.jobs: Mapping[str, Mapping[str, Any]] = {}

    def requests(self) -> Requests:
        """Return the requests."""
        return {
            "GET boards": self._boards,
            "POST bitstream": self._bitstream,
            "POST load": self._load,
            "POST cancel": self._cancel,
        }

    async def close(self) -> None:
        """End the build."""
        if self._work:
            self._work.cancel()
            with suppress(asyncio.CancelledError):
                await self._work

    async def _boards(self, request: web.Request) -> web.Response:
        """Return the boards that the system of a file fits, and how each is built for."""
        document, workspace = self._workspace.document(request.query.get("file", "")), self._workspace

        def found() -> list[dict[str, Any]]:
            return offers(document.path, workspace.loaded(document))

        return in_json({"boards": await workspace.in_turn(found)})

    async def _bitstream(self, request: web.Request) -> web.Response:
        """Begin to build for a board."""
        body = await body_of(request)
        return await self._begin(BITSTREAM, body, [])

    async def _load(self, request: web.Request) -> web.Response:
        """Begin to load the bitstream onto its board."""
        body = await body_of(request)
        return await self._begin(LOAD, body, ["--flash"] if body.get("flash") is True else [])

    async def _cancel(self, _: web.Request) -> web.Response:
        """End the build."""
        await self.close()
        return in_json({})

    async def _begin(self, kind: str, body: Mapping[str, Any], options: list[str]) -> web.Response:
        document, board = self._workspace.document(body.get("file")), body.get("board")
        spec = document.path
        boards = await asyncio.to_thread(boards_of, _core(spec))
        if not isinstance(board, str) or board not in boards:
            raise web.HTTPBadRequest(reason=f"the boards are {', '.join(boards)}")
        if self._work and not self._work.done():
            fail("a build is running", hint="wait for its end, or cancel it")
        folder = project_folder(spec)
        name = self._workspace.name(spec)
        job = {"file": name, "version": document.version, "board": board, "folder": str(folder)}
        begun = {kind: job | {"state": _RUNNING, "start": time.time()}}
        # A new bitstream has not been loaded yet.
        self.jobs = begun if kind == BITSTREAM else {**self.jobs, **begun}
        command = [kind, _words(spec, folder), "--board", board, "--json", *options]
        self._work = asyncio.create_task(self._run(kind, command, folder))
        return in_json({})

    async def _run(self, kind: str, command: list[str], folder: Path) -> None:
        """Run a command of `firm`, whose lines change the state of the job of a kind."""
        others: deque[str] = deque(maxlen=_SHOWN_LINES)

        def take(line: str) -> None:
            if news := _news(line):
                self._change(kind, news)
            else:
                others.append(line)

        try:
            end = f"ended with status {await run([*_FIRM, *command], folder, take)}"
        except asyncio.CancelledError:
            self._change(kind, {"state": _CANCELLED})
            raise
        except OSError as error:
            end = f"cannot start in {folder}: {error.strerror}"
        if self.jobs[kind]["state"] == _RUNNING:
            fault = {"severity": "error", "message": f"firm {kind} {end}"}
            self._change(kind, {"state": _FAILED, "faults": [fault], "output": [*others]})

    def _change(self, kind: str, news: Mapping[str, Any]) -> None:
        self.jobs = {**self.jobs, kind: {**self.jobs[kind], **news}}


def _news(line: str) -> dict[str, Any] | None:
    """Return the mapping in a line of JSON, or None for any other line."""
    with suppress(ValueError, RecursionError):
        found = json.loads(line)
        return found if isinstance(found, dict) else None
    return None


def offers(spec: Path, loaded: LoadedSystem) -> list[dict[str, Any]]:
    """Return the boards that a system fits: those with a bitstream first. May raise `InputError`.

    `isProject` marks a board that needs its maker's tools: `command` sets up their project. `missing` are the commands
    that install missing programs; `loader` tells whether the bitstream can be loaded from here.
    """
    core = _core(spec)
    fitting = {name: board for name, board in boards_of(core).items() if fits(loaded, board)}
    if not fitting:
        fail(f"{core.path.name} has no board that the system fits", hint=f"firm system core {spec.name} adds those")
    found = [_offer(name, board, core, spec) for name, board in fitting.items()]
    return sorted(found, key=lambda offer: (offer["isProject"], offer["name"]))


def _offer(name: str, board: Board, core: CoreFile, spec: Path) -> dict[str, Any]:
    flow, programs = str(board.flow), programs_of(str(board.flow))
    absent = missing(programs)
    is_project = not programs or (not board.is_linked and bool(absent))
    target = f"fusesoc run --setup --target={name} {core.data.get('name', '')}"
    build = f"firm bitstream {_words(spec, project_folder(spec))} --board {name}"
    return {
        "name": name,
        "description": str(board.description),
        "isProject": is_project,
        "command": target if is_project else build,
        "folder": str(project_folder(spec)),
        "missing": remedy(flow, absent) if absent and not is_project else "",
        "loader": board.loader is not None,
    }


def _core(spec: Path) -> CoreFile:
    core = core_of(spec)
    if not core:
        fail(f"no core beside {spec.name} generates this system", hint=f"write it: firm system core {spec.name}")
    return core


def _words(spec: Path, folder: Path) -> str:
    """Return a specification's path for a command in a folder; no option begins like it."""
    path = os.path.relpath(spec, folder)
    return f"./{path}" if path.startswith("-") else path
