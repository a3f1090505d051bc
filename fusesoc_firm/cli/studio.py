"""`firm studio`: open a page in the browser that draws, edits and checks systems."""

from __future__ import annotations

import argparse
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_sources, check_sources, command, core_folders
from fusesoc_firm.text.diagnostics import fail


def add_studio(commands: Any) -> None:
    """Declare the command."""
    studio = command(
        commands,
        "studio",
        "draw, edit and check systems in the browser; the files stay the truth",
        "firm studio robot.yaml",
        _open,
    )
    studio.add_argument(
        "place",
        nargs="?",
        type=Path,
        default=Path(),
        metavar="PLACE",
        help="a specification, or a folder with specifications (default: the current folder)",
    )
    studio.add_argument("--port", type=int, default=0, metavar="N", help="the port on loopback (default: a free one)")
    studio.add_argument("--no-browser", action="store_true", help="only print the page's address")
    add_sources(studio)


def _open(arguments: argparse.Namespace) -> None:
    try:
        import aiohttp  # noqa: F401
    except ModuleNotFoundError:
        fail("firm studio requires the Python package aiohttp", hint="pip install 'fusesoc-firm[studio]'")
    import asyncio

    from fusesoc_firm.studio.server import Studio
    from fusesoc_firm.system.message_sources import known_names, load_beside, sources_of
    from fusesoc_firm.system.system_core import LoadedSystem
    from fusesoc_firm.system.written.specification import Draft

    if not arguments.place.exists():
        fail(f"there is no file or folder {arguments.place}")
    paths, distro = arguments.path, arguments.distro

    def load(spec: Path, text: str) -> LoadedSystem:
        return load_beside(Draft(spec, text), paths, distro, needs_sources=False, core_folders=core_folders)

    def names(spec: Path, own: Sequence[str]) -> list[str]:
        return known_names(spec, own, sources_of(spec, paths, distro, core_folders), core_folders)

    async def serve() -> None:
        studio = Studio(arguments.place, load, check_sources, names)
        try:
            runner = await studio.start(arguments.port)
        except OSError as error:
            fail(f"port {arguments.port} cannot be used: {error.strerror}")
        print(f"{studio.address}\nCtrl-C ends it", flush=True)
        if not arguments.no_browser:
            webbrowser.open(studio.address)
        try:
            await asyncio.Event().wait()
        finally:
            await runner.cleanup()

    asyncio.run(serve())
