"""A studio for a folder, which runs in a thread of the test."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fusesoc_firm.core.request import no_core_folders
from fusesoc_firm.node.transport.built_simulator import build_simulator
from fusesoc_firm.studio.page_run import Build
from fusesoc_firm.studio.server import Studio
from fusesoc_firm.studio.workspace import Tools
from fusesoc_firm.system.message_sources import MessageSources, known_names, load_beside
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.system.written.specification import Draft
from fusesoc_firm.text.diagnostics import Diagnostic


def load(spec: Path, text: str) -> LoadedSystem:
    return load_beside(Draft(spec, text), needs_sources=False)


def no_check(_: LoadedSystem, __: Path) -> Sequence[Diagnostic]:
    return ()


def names(spec: Path, own: Sequence[str]) -> Sequence[str]:
    return known_names(spec, own, MessageSources(), no_core_folders)


@contextmanager
def served(place: Path, build: Build = build_simulator) -> Iterator[Studio]:
    """The studio, with its address."""
    studio = Studio(place, Tools(load, no_check, names, build))
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name="studio")
    thread.start()
    try:
        runner = asyncio.run_coroutine_threadsafe(studio.start(), loop).result(60)
        yield studio
        asyncio.run_coroutine_threadsafe(runner.cleanup(), loop).result(60)
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
