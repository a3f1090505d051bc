"""The page's views of an open system on request: bytes of frames, generated VHDL, schedulers, and ways of topics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from aiohttp import web

from fusesoc_firm.builds.call.why import Reason, names_of, reasons
from fusesoc_firm.exploration.fabrics import fabrics, fabrics_data
from fusesoc_firm.scheduling.analysis import choose
from fusesoc_firm.scheduling.choice import as_data
from fusesoc_firm.studio.byte_map import byte_map
from fusesoc_firm.studio.requests import Requests, in_json
from fusesoc_firm.studio.workspace import Workspace
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.system.derived.timing import channel_of, tasks_of
from fusesoc_firm.system.system_core import LoadedSystem, artifacts
from fusesoc_firm.system.views.inner_topics import ways_of_topics
from fusesoc_firm.text.diagnostics import InputError, SourceRef
from fusesoc_firm.text.render import Rendering


class Views:
    """The requests about data derived from a specification."""

    def __init__(self, workspace: Workspace) -> None:
        """Show the specifications of a workspace."""
        self._workspace = workspace

    def requests(self) -> Requests:
        """Return the requests."""
        return {
            "GET bytes": self._bytes,
            "GET generated": self._generated,
            "GET schedulers": self._schedulers,
            "GET fabrics": self._fabrics,
        }

    async def _bytes(self, request: web.Request) -> web.Response:
        """Return the frame's layout of each converter."""
        loaded = await self._loaded(request)
        return in_json(layouts(loaded))

    async def _generated(self, request: web.Request) -> web.Response:
        """Return the names of the generated files, and one of them (by default the top level) with its origins."""
        loaded = await self._loaded(request)
        return in_json(await self._workspace.in_turn(generated, loaded, request.query.get("name", "")))

    async def _schedulers(self, request: web.Request) -> web.Response:
        """Return the analysis of all schedulers for the system, or what it lacks: times, or a change of this moment."""
        try:
            loaded = await self._loaded(request)
            return in_json(await self._workspace.in_turn(schedulers, loaded))
        except InputError as error:
            return in_json({"missing": str(error)})

    async def _fabrics(self, request: web.Request) -> web.Response:
        """Return the ways of the topics within the FPGA, what each would cost, and the map of the exchange."""
        loaded = await self._loaded(request)
        return in_json(await self._workspace.in_turn(ways, loaded))

    async def _loaded(self, request: web.Request) -> LoadedSystem:
        document = self._workspace.document(request.query.get("file", ""))
        return await self._workspace.in_turn(self._workspace.loaded, document)


def layouts(loaded: LoadedSystem) -> dict[str, Any]:
    """Return the stream's width in bytes, and the parts of each converter's frame, by block."""
    system = loaded.system
    converters: Sequence[Converter] = [*system.subscribers, *system.publishers]
    parts = {item.block: [asdict(part) for part in byte_map(item.frame, system.id_bytes)] for item in converters}
    return {"width": system.width // 8, "blocks": parts}


def generated(loaded: LoadedSystem, name: str) -> dict[str, Any]:
    """Return the names of all generated files, and the lines of the file `name` with their origins.

    An unknown name selects the top level.
    """
    found = {item.path: item for item in artifacts(loaded)}
    chosen = found.get(name) or found[f"{loaded.system.entity}.vhd"]
    rendering = Rendering(chosen.template, chosen.configuration)
    names = names_of(loaded.specification, loaded.messages())
    lines = [_line(reason) for reason in reasons(rendering, names)]
    return {"names": [*found], "name": chosen.path, "lines": lines}


def schedulers(loaded: LoadedSystem) -> dict[str, Any]:
    """Return the schedulers compared for a system, the best first. May raise `InputError` for unknown times."""
    system = loaded.system
    choice = as_data(choose(tasks_of(system), channel=channel_of(system)))
    return {
        "chosen": system.scheduling.policy,
        "clock": None if system.clock is None else float(system.clock),
        **choice,
    }


def ways(loaded: LoadedSystem) -> dict[str, Any]:
    """Return the ways of the topics within the FPGA as `firm fabric show` prints them; `topics` are lines of text."""
    return fabrics_data(loaded, fabrics(loaded)) | {"topics": ways_of_topics(loaded.system)}


def _line(reason: Reason) -> dict[str, Any]:
    line = reason.line
    return {
        "text": line.text,
        "template": f"{line.template}:{line.line}",
        "specification": [place.line for place in reason.specification],
        "messages": [_place(place) for place in reason.messages],
    }


def _place(place: SourceRef) -> str:
    return f"{place.file}:{place.line}"
