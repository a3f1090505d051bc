"""A new project from the page, as `firm init` creates it, in a subfolder of the open folder."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from aiohttp import web

from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.message.library import Libraries, libraries
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.studio.requests import Requests, body_of, in_json
from fusesoc_firm.studio.workspace import MOST_NAMES, Workspace, with_words
from fusesoc_firm.system.scaffold.project import LANGUAGES, Project, create

_ROS = (2, 1)


class Begin:
    """The requests of the form for a new project."""

    def __init__(self, workspace: Workspace) -> None:
        """Begin projects in a workspace."""
        self._workspace = workspace

    def requests(self) -> Requests:
        """Return the requests."""
        return {"GET choices": self._choices, "GET types": self._types, "POST init": self._init}

    async def _choices(self, _: web.Request) -> web.Response:
        """Return the legal answers of the form, the default of each first."""
        return in_json({"languages": [*LANGUAGES], "widths": [*WIDTHS], "ros": [*_ROS]})

    async def _types(self, request: web.Request) -> web.Response:
        """Search the messages of a ROS version for words."""
        ros = _one_of("ros", request.query.get("ros"), [*map(str, _ROS)])
        names = await self._workspace.in_turn(self._names, int(ros))
        return in_json({"messages": with_words(names, request.query.get("query", ""))[:MOST_NAMES]})

    async def _init(self, request: web.Request) -> web.Response:
        """Write a project, and return the name of its specification."""
        project = _project(await body_of(request))
        if self._workspace.is_single:
            raise web.HTTPNotFound(reason="only one specification is open; start 'firm studio' in a folder")
        await self._workspace.in_turn(self._create, project)
        return in_json({"file": f"{project.name}/{project.name}.yaml"})

    def _names(self, ros: int) -> list[str]:
        return [str(name) for name in self._libraries()[middleware_of(ros)].names()]

    def _create(self, project: Project) -> None:
        paths = self._workspace.tools.paths
        create(project, self._workspace.folder / project.name, self._libraries(), paths)

    def _libraries(self) -> Libraries:
        tools = self._workspace.tools
        return libraries(tools.paths, os.environ, tools.distro)


def _project(body: Mapping[str, Any]) -> Project:
    """Return the project that a request describes; raise 400 for answers that the form does not offer."""
    return Project(
        str(body.get("name", "")),
        str(body.get("in", "")),
        str(body.get("out", "")),
        _one_of("ros", body.get("ros", _ROS[0]), _ROS),
        _one_of("language", body.get("language", next(iter(LANGUAGES))), [*LANGUAGES]),
        _one_of("width", body.get("width", WIDTHS[0]), WIDTHS),
    )


def _one_of(name: str, value: Any, legal: Sequence[Any]) -> Any:
    found = next((item for item in legal if item == value and type(item) is type(value)), None)
    if found is None:
        raise web.HTTPBadRequest(reason=f"'{name}' is one of {', '.join(map(str, legal))}")
    return found
