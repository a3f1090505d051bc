"""The server of the page: only on loopback, at an address with a secret, for the files of one folder.

Another page in the same browser does not know the secret. Its requests are refused, like all from other hosts and
origins; this also prevents attacks by names that resolve to loopback (DNS rebinding).
"""

from __future__ import annotations

import hmac
import secrets
from pathlib import Path

from aiohttp import web

from fusesoc_firm.studio.begin import Begin
from fusesoc_firm.studio.boards import Boards
from fusesoc_firm.studio.editing import Editing
from fusesoc_firm.studio.evaluation import Evaluation
from fusesoc_firm.studio.foxglove import FOXGLOVE
from fusesoc_firm.studio.live import Live
from fusesoc_firm.studio.page_files import PAGE, remedy
from fusesoc_firm.studio.requests import Handler, in_json
from fusesoc_firm.studio.views import Views
from fusesoc_firm.studio.workspace import Tools, Workspace
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.yaml_edit import EditError
from fusesoc_firm.text.yaml_text import SMALL

HOST = "127.0.0.1"
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


class Studio:
    """The page's server for a folder of specifications, or for one specification."""

    def __init__(self, place: Path, tools: Tools) -> None:
        """Serve a file or folder with the tools of the command line."""
        workspace = Workspace(place, tools)
        self._editing, self._evaluation, self._boards = Editing(workspace), Evaluation(workspace), Boards(workspace)
        self.live = Live(workspace, lambda: self._boards.jobs)
        views, begin = Views(workspace), Begin(workspace)
        self._parts = (self._editing, self.live, views, self._evaluation, self._boards, begin)
        self._own_hosts: set[str] = set()
        self.secret = secrets.token_urlsafe(24)

    async def start(self, port: int = 0) -> web.AppRunner:
        """Start the server on a port of loopback (0: any free one); `address` is known afterwards."""
        app = web.Application(middlewares=[self._guard], client_max_size=2 * SMALL.bytes)
        under = f"/{self.secret}"
        app.router.add_get(f"{under}/", self._page)
        for words, handler in (item for part in self._parts for item in part.requests().items()):
            method, name = words.split()
            app.router.add_route(method, f"{under}/api/{name}", handler)
        if (PAGE / "assets").is_dir():
            app.router.add_static(f"{under}/assets", PAGE / "assets")
        app.cleanup_ctx.append(self._editing.following)
        app.on_shutdown.append(self._close)
        runner = web.AppRunner(app, access_log=None)
        await runner.setup()
        site = web.TCPSite(runner, HOST, port)
        await site.start()
        number = runner.addresses[0][1]
        self._own_hosts = {f"{name}:{number}" for name in (HOST, "localhost")}
        self.address = f"http://{HOST}:{number}{under}/"
        self.foxglove = f"ws://{HOST}:{number}{under}/api/{FOXGLOVE}"
        return runner

    async def _close(self, _: web.Application) -> None:
        """End everything that the page has started."""
        for part in (self.live, self._evaluation, self._boards):
            await part.close()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse requests that our own page would not send, and convert faults to answers."""
        origin = request.headers.get("Origin")
        is_own = request.headers.get("Host", "") in self._own_hosts
        # Foxglove's page is from another server; like every program, it needs the secret.
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
            answer = in_json({"reason": str(error)}, status=409)
        except web.HTTPException as error:
            answer = web.Response(status=error.status, text=f"{error.reason}\n")
        if not answer.prepared:
            answer.headers.update(_HEADERS)
        return answer

    async def _page(self, _: web.Request) -> web.Response:
        try:
            text = (PAGE / "index.html").read_text(encoding="utf-8")
        except OSError:
            text = f"The page is not built: {remedy()}.\n"
        # The browser requests the first picture's data at once, before the page's program starts.
        headers = {"Link": "<api/outline>; rel=preload; as=fetch; crossorigin"}
        return web.Response(text=text, content_type="text/html", headers=headers)
