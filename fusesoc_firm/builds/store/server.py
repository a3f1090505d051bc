"""A server for remote stores, which `firm cache serve` runs; `remote` describes the protocol.

Everybody may read. Only clients with the server's token may write; without a token, the server is read-only. The data
are in a store, subject to its limit. Each item is stored with its SHA-256, and checked before it is sent.
"""

from __future__ import annotations

import hmac
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from errno import ENOSPC
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from shutil import copyfileobj
from typing import Any

from fusesoc_firm.builds.store import layout
from fusesoc_firm.builds.store.layout import ACTION, CONTENT, MOST_BYTES, MOST_PLAIN_BYTES, place
from fusesoc_firm.builds.store.store import Store

_PATH = re.compile(r"/(ac|cas)/([0-9a-f]{64})")
_IDLE_SECONDS = 30
_CHUNK_BYTES = 2**16
# The limits of all connections together, whose data are passed on in chunks.
_MOST_CONNECTIONS = 256
_MOST_PENDING_BYTES = 4 * MOST_BYTES


class Server(ThreadingHTTPServer):
    """A server for the remote stores of others; `serve_forever` runs it, with one thread for each connection."""

    daemon_threads = True
    request_queue_size = 128

    def __init__(self, store: Store, host: str, port: int, token: str = "") -> None:
        """Listen on a port, or on any free port for 0. May raise `OSError`."""
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self.store, self.token = store, token
        self._places = threading.BoundedSemaphore(_MOST_CONNECTIONS)
        self._pending, self._lock = 0, threading.Lock()
        super().__init__((host, port), _Handler)

    @property
    def url(self) -> str:
        """The URL for clients on this machine."""
        host, port = self.server_address[:2]
        name = str(host)
        return f"http://{f'[{name}]' if ':' in name else name}:{port}"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread, or close it if there are too many."""
        if self._places.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()

    @contextmanager
    def room_for(self, size: int) -> Iterator[None]:
        """Reserve room for data that are being received; raise `OSError` if all such data are too many."""
        with self._lock:
            if self._pending + size > _MOST_PENDING_BYTES:
                raise OSError(ENOSPC, "too many data are being received")
            self._pending += size
        try:
            yield
        finally:
            with self._lock:
                self._pending -= size

    def handle_error(self, *_: object) -> None:
        """Ignore a client that has closed its connection."""


class _Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"
    timeout = _IDLE_SECONDS

    def do_GET(self) -> None:
        """Send the data under a name."""
        name = self._name()
        with ExitStack() as stack:
            try:
                file, size = stack.enter_context(layout.opened(self._root, name))
            except OSError:
                self._answer(HTTPStatus.NOT_FOUND)
                return
            layout.mark_used(self._root, name)
            self._answer(HTTPStatus.OK, size)
            if self.command != "HEAD":
                copyfileobj(file, self.wfile, _CHUNK_BYTES)

    def do_HEAD(self) -> None:
        """Send the size of the data under a name."""
        self.do_GET()

    def do_PUT(self) -> None:
        """Store data under a name, if the client may write and the data are intact."""
        name = self._name()
        if refusal := self._refusal(name):
            self.close_connection = True
            self._answer(refusal)
            self._drain()
            return
        length = int(self.headers["Content-Length"])
        try:
            with self.server.room_for(length):
                layout.receive(self._root, name, self._parts(length))
            self.server.store.shrink_if_needed()
        except (TimeoutError, ConnectionError):
            raise
        except ValueError:
            self._answer(HTTPStatus.BAD_REQUEST)
        except OSError:
            # The rest of the data would be read as the next request.
            self.close_connection = True
            self._answer(HTTPStatus.INSUFFICIENT_STORAGE)
            self._drain()
        else:
            self._answer(HTTPStatus.CREATED)

    def log_message(self, *_: object) -> None:
        """Print nothing for each request."""

    @property
    def _root(self) -> str:
        return str(self.server.store.root)

    def _name(self) -> str:
        """Return the name in the store of the requested path, or an empty text for any other path."""
        found = _PATH.fullmatch(self.path)
        return place(found[2], ACTION if found[1] == "ac" else CONTENT) if found else ""

    def _refusal(self, name: str) -> HTTPStatus | None:
        """Return the status of a refused write, or None."""
        token = f"Bearer {self.server.token}".encode()
        given = self.headers.get("Authorization", "").encode(errors="replace")
        length = self.headers.get("Content-Length", "")
        if not name:
            return HTTPStatus.NOT_FOUND
        if not self.server.token:
            return HTTPStatus.FORBIDDEN
        if not hmac.compare_digest(given, token):
            return HTTPStatus.UNAUTHORIZED
        if not re.fullmatch(r"\d{1,12}", length, re.ASCII):
            return HTTPStatus.LENGTH_REQUIRED
        if int(length) > (MOST_BYTES if name.endswith(CONTENT) else MOST_PLAIN_BYTES):
            return HTTPStatus.REQUEST_ENTITY_TOO_LARGE
        return None

    def _parts(self, length: int) -> Iterator[bytes]:
        """Yield the data of a request in parts; raise `ValueError` if they are cut."""
        while length:
            part = self.rfile.read1(min(length, _CHUNK_BYTES))
            if not part:
                raise ValueError("the data are cut")
            length -= len(part)
            yield part

    def _drain(self) -> None:
        """Read the data of a refused write, since a client may read the answer only after it has sent them."""
        rest = MOST_PLAIN_BYTES
        while rest > 0 and (data := self.rfile.read1(min(rest, _CHUNK_BYTES))):
            rest -= len(data)

    def _answer(self, status: HTTPStatus, size: int = 0) -> None:
        self.send_response(status)
        if status == HTTPStatus.UNAUTHORIZED:
            self.send_header("WWW-Authenticate", "Bearer")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.send_header("Content-Length", str(size))
        self.end_headers()
