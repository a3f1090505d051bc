"""`firm studio`: open a page in the browser that draws, edits, checks and runs systems, or watches a run."""

from __future__ import annotations

import argparse
import signal
import sys
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from fusesoc_firm.cli.common import add_sources, check_sources, command, core_folders
from fusesoc_firm.cli.progress import Progress
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    import threading

    from fusesoc_firm.node.engine.watch import Control
    from fusesoc_firm.studio.page_run import Run
    from fusesoc_firm.studio.server import Studio
    from fusesoc_firm.system.system_core import LoadedSystem


def add_studio(commands: Any) -> None:
    """Declare the command."""
    studio = command(
        commands,
        "studio",
        "draw, edit, check and run systems in the browser; the files stay the truth",
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


def add_watch(parser: argparse.ArgumentParser) -> None:
    """Add the option of commands whose run the page can show, for `watched`."""
    parser.add_argument("--watch", action="store_true", help="open a page in the browser that shows the messages")
    parser.add_argument("--no-browser", action="store_true", help="with --watch, only print the page's address")


@contextmanager
def watched(
    arguments: argparse.Namespace,
    loaded: LoadedSystem,
    title: str,
    control: Control | None = None,
    *,
    stays: bool = False,
) -> Iterator[Run | None]:
    """Within the context, serve the page of a run if the arguments request it.

    `control` pauses the run. If the page `stays`, the context ends with Ctrl-C, after the run.
    """
    if not arguments.watch:
        yield None
        return
    _require_aiohttp()
    import threading

    from fusesoc_firm.studio.page_run import Run

    run = Run(loaded, arguments.spec, title, control)
    studio = _studio(arguments, arguments.spec)
    studio.live.take(run)
    begins, ends = threading.Event(), threading.Event()
    server = threading.Thread(target=_serve_beside, args=(studio, begins, ends), name="studio")
    server.start()
    begins.wait()
    _show(studio, arguments, sys.stderr)
    try:
        yield run
        run.end()
        if stays:
            print("the page stays until Ctrl-C", file=sys.stderr, flush=True)
            with suppress(KeyboardInterrupt):
                signal.pause()
    finally:
        ends.set()
        server.join()


def _serve_beside(studio: Studio, begins: threading.Event, ends: threading.Event) -> None:
    """Serve a page in a thread, from `begins` to `ends`."""
    import asyncio

    async def serve() -> None:
        runner = await studio.start()
        begins.set()
        await asyncio.to_thread(ends.wait)
        await runner.cleanup()

    try:
        asyncio.run(serve())
    finally:
        begins.set()


def _open(arguments: argparse.Namespace) -> None:
    import asyncio

    with ExitStack() as start:
        progress = start.enter_context(Progress("starting the page's server"))
        _require_aiohttp()
        if not arguments.place.exists():
            fail(f"there is no file or folder {arguments.place}")
        from fusesoc_firm.studio.page_files import build_page

        build_page(progress.say)
        studio = _studio(arguments, arguments.place)

        async def serve() -> None:
            try:
                runner = await studio.start(arguments.port)
            except OSError as error:
                fail(f"port {arguments.port} cannot be used: {error.strerror}")
            start.close()
            _show(studio, arguments, sys.stdout)
            try:
                await asyncio.Event().wait()
            finally:
                await runner.cleanup()

        asyncio.run(serve())


def _require_aiohttp() -> None:
    try:
        import aiohttp  # noqa: F401
    except ModuleNotFoundError:
        fail("the page requires the Python package aiohttp", hint="pip install 'fusesoc-firm[studio]'")


def _show(studio: Studio, arguments: argparse.Namespace, to: TextIO) -> None:
    """Print the page's address, and open it."""
    from fusesoc_firm.studio.page_files import say_if_missing

    say_if_missing(lambda text: print(text, file=sys.stderr, flush=True))
    print(f"{studio.address}\nfor Foxglove: {studio.foxglove}\nCtrl-C ends it", file=to, flush=True)
    if not arguments.no_browser:
        webbrowser.open(studio.address)


def _studio(arguments: argparse.Namespace, place: Path) -> Studio:
    """Return the server of a place with the command's message sources."""
    from fusesoc_firm.node.transport.built_simulator import BuiltSimulator, CoreSources, build_simulator
    from fusesoc_firm.studio.server import Studio
    from fusesoc_firm.studio.workspace import Tools
    from fusesoc_firm.system.message_sources import known_names, load_beside, sources_of
    from fusesoc_firm.system.written.specification import Draft

    paths, distro = arguments.path, arguments.distro

    def load(spec: Path, text: str) -> LoadedSystem:
        return load_beside(Draft(spec, text), paths, distro, needs_sources=False, core_folders=core_folders)

    def names(spec: Path, own: Sequence[str]) -> list[str]:
        return known_names(spec, own, sources_of(spec, paths, distro, core_folders), core_folders)

    def build(spec: Path, tool: str) -> BuiltSimulator:
        return build_simulator(spec, tool, sources=CoreSources(paths, distro or "", core_folders=core_folders))

    return Studio(place, Tools(load, check_sources, names, build, paths, distro))
