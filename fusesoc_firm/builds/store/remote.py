"""A remote store over HTTP, in the layout of Bazel's remote caches, so that servers for those caches are suitable.

    GET, PUT  <URL>/ac/<key>           the SHA-256 and size of an entry
    GET, PUT  <URL>/cas/<SHA-256>      the key in a line, then the entry; or a content to which an entry refers

The value under `ac` is an `ActionResult` of the Remote Execution API, with one output file that is named after the key.
Both values contain the key, so an entry that is stored under the key of another entry is detected. The server is not
trusted to return intact data: the SHA-256, the size and the key must match. Servers and people with write access are
trusted, as in a shared folder.

A failure costs one warning. The failed kind of request is then omitted for a minute, by all processes that use the same
local store, since each generator call is a separate process.
"""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from urllib.parse import urlsplit

from fusesoc_firm.builds.store import layout, shared_files
from fusesoc_firm.builds.store.layout import MOST_BYTES, REMARK, place
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.terminal import safe
from fusesoc_firm.tools.digests import digest, digest_of

TYPE_CHECKING = False
if TYPE_CHECKING:
    from http.client import HTTPConnection
    from socket import socket
    from threading import Timer

URL, TOKEN, MODE, TIMEOUT = (f"FUSESOC_FIRM_REMOTE{name}" for name in ("", "_TOKEN", "_MODE", "_TIMEOUT"))
"""The environment variables of the remote store."""

_DEFAULT_TIMEOUT = "5"
# Large transfers may take longer than the timeout, at this rate.
_LEAST_BYTES_PER_SECOND = 2**20
_MOST_RESULT_BYTES = 2**16
_PART_BYTES = 2**16
_SILENT_SECONDS = 60
_READ, _WRITE, _DAMAGE = "read", "write", "damage"
_OK, _NOT_FOUND, _REDIRECTED = 200, 404, 300
# The tags of Protocol Buffers: field 1 or 2 of a message with a length, and field 2 with a number.
_FIRST, _SECOND, _SIZE = b"\x0a", b"\x12", b"\x10"
_DIGITS = 64
_TAIL = re.compile(rb"\x10([\x80-\xff]{0,8}[\x00-\x7f])")


class _FailedError(Exception):
    """The server or the network failed."""


class _Limit:
    """The time that a transfer may take, after which `stop` is called in another thread."""

    def __init__(self, seconds: float, stop: Callable[[], None]) -> None:
        self.seconds = seconds
        self._stop = stop
        self._started = time.monotonic()
        self._timer: Timer | None = None

    @property
    def is_over(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() >= self._started + self.seconds

    def extend(self, size: int) -> None:
        """Add the time for this number of bytes."""
        self.seconds += size / _LEAST_BYTES_PER_SECOND

    def start(self) -> None:
        """Begin, or continue, to wait until the time is over."""
        from threading import Timer

        if self.is_over:
            self._stop()
            return
        self._timer = Timer(self._started + self.seconds - time.monotonic(), self.start)
        self._timer.daemon = True
        self._timer.start()

    def cancel(self) -> None:
        """Wait no longer. The timer that may have begun meanwhile shuts a closed connection."""
        if self._timer:
            self._timer.cancel()


@dataclass(frozen=True)
class Remote:
    """A remote store.

    `timeout` is in seconds, and 1 s is added for each MiB that is sent or has come. `root` is the local store, which
    keeps the times of failures.
    """

    url: str
    root: str
    token: str = field(default="", repr=False)
    is_writable: bool = False
    timeout: float = float(_DEFAULT_TIMEOUT)
    _told: set[str] = field(default_factory=set, init=False, repr=False, compare=False)

    def entry(self, key: str) -> bytes | None:
        """Return the entry of a key, or None if it is missing or damaged, or if the server fails."""
        try:
            if self._is_omitted(_READ) or (result := self._get(f"ac/{key}", _MOST_RESULT_BYTES)) is None:
                return None
            found = digest_in(result, key)
            data = found and self._get(f"cas/{found[0]}", found[1])
        except _FailedError as error:
            self._tell(_READ, str(error))
            return None
        if found is not None and data is None:
            # Servers may remove an entry and its description independently.
            return None
        head = f"{key}\n".encode()
        if not found or not data or (digest(data), len(data)) != found or not data.startswith(head):
            self.tell_damage(key)
            return None
        return data[len(head) :]

    def put_entry(self, key: str, data: bytes) -> bool:
        """Write an entry to the server, if this user may write; return whether it is written. Failures are reported."""
        whole = f"{key}\n".encode() + data
        return self._is_put(f"cas/{digest(whole)}", whole) and self._is_put(
            f"ac/{key}", action_result(key, digest(whole), len(whole))
        )

    def content(self, sha256: str, size: int) -> bytes | None:
        """Return the content with this SHA-256 and size, or None as for `entry`."""
        if size > MOST_BYTES or self._is_omitted(_READ):
            return None
        try:
            data = self._get(f"cas/{sha256}", size)
        except _FailedError as error:
            self._tell(_READ, str(error))
            return None
        if data is not None and (digest(data), len(data)) != (sha256, size):
            self._tell(_DAMAGE, f"the content {sha256} is damaged and ignored")
            return None
        return data

    def put_contents(self, contents: Iterable[bytes | None]) -> bool:
        """Write contents to the server, if this user may write; return False if one is missing or cannot be written.

        Failures are reported.
        """
        return all(data is not None and self._is_put(f"cas/{digest(data)}", data) for data in contents)

    def tell_damage(self, key: str) -> None:
        """Report that the server returned damaged data for a key."""
        self._tell(_DAMAGE, f"the entry {key} is damaged and ignored")

    def failures(self, since: float) -> list[str]:
        """Return the warnings of other processes since a time in seconds since the epoch."""
        return [
            self._warning(text.decode(errors="replace"))
            for kind in sorted({_READ, _WRITE, _DAMAGE} - self._told)
            if self._time(kind) >= since and (text := layout.read(self.root, self._mark(kind)))
        ]

    def _is_omitted(self, kind: str) -> bool:
        return kind in self._told or 0 <= time.time() - self._time(kind) < _SILENT_SECONDS

    def _time(self, kind: str) -> float:
        status = shared_files.state(self.root, self._mark(kind))
        return status.st_mtime if status else 0.0

    def _mark(self, kind: str) -> str:
        return place(digest_of([self.url, kind]), REMARK)

    def _tell(self, kind: str, reason: str) -> None:
        """Warn, unless a process has done so in the last minute."""
        if self._is_omitted(kind):
            return
        print(self._warning(reason), file=sys.stderr, flush=True)
        self._told.add(kind)
        with suppress(OSError):
            layout.write(self.root, self._mark(kind), reason.encode(errors="replace"))

    def _warning(self, reason: str) -> str:
        return safe(f"warning: remote store {self.url}: {reason}")

    def _get(self, name: str, size: int) -> bytes | None:
        """Return the data under a name, which are at most one byte longer than `size`, or None if they are missing."""
        with self._connected(0) as (connection, limit):
            connection.request("GET", self._path(name), headers=self._headers())
            response = connection.getresponse()
            if response.status == _NOT_FOUND:
                return None
            if response.status != _OK:
                raise _FailedError(f"{response.status} {response.reason}")
            data = bytearray()
            # Only data that have come give time for more, since the server may claim any size.
            while len(data) <= size and (part := response.read(min(size + 1 - len(data), _PART_BYTES))):
                data += part
                limit.extend(len(part))
            if response.length and len(data) <= size:
                raise ConnectionError("the answer is cut")
            return bytes(data)

    def _is_put(self, name: str, data: bytes) -> bool:
        """Write data to the server, if this user may write; return whether that succeeded, and report a failure."""
        if not self.is_writable or len(data) > MOST_BYTES or self._is_omitted(_READ) or self._is_omitted(_WRITE):
            return False
        try:
            self._put(name, data)
        except _FailedError as error:
            self._tell(_WRITE, str(error))
            return False
        return True

    def _put(self, name: str, data: bytes) -> None:
        with self._connected(len(data)) as (connection, _):
            # A server may refuse the request before it has read all data.
            with suppress(BrokenPipeError, ConnectionResetError):
                connection.request("PUT", self._path(name), data, self._headers())
            response = connection.getresponse()
            if not _OK <= response.status < _REDIRECTED:
                raise _FailedError(f"{response.status} {response.reason} for a write")

    def _path(self, name: str) -> str:
        return f"{urlsplit(self.url).path.rstrip('/')}/{name}"

    def _headers(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.token}"} if self.token else {}

    @contextmanager
    def _connected(self, size: int) -> Iterator[tuple[HTTPConnection, _Limit]]:
        """Yield a connection, and the limit of its time: at first that for a transfer of `size` bytes."""
        from http.client import HTTPConnection, HTTPException, HTTPSConnection

        parts = urlsplit(self.url)
        kind = HTTPSConnection if parts.scheme == "https" else HTTPConnection
        connection = kind(parts.hostname or "", parts.port, timeout=self.timeout)
        # The connection's own timeout starts again with every byte.
        held: list[socket] = []
        limit = _Limit(self.timeout, lambda: _shut(connection.sock, *held))
        limit.extend(size)
        limit.start()
        try:
            connection.connect()
            # A connection forgets its socket when the answer begins.
            held.append(connection.sock)
            yield connection, limit
        except (OSError, HTTPException) as error:
            is_late = isinstance(error, TimeoutError) or limit.is_over
            raise _FailedError(f"no answer within {limit.seconds:.3g} s" if is_late else _reason(error)) from None
        finally:
            limit.cancel()
            connection.close()


def remote_store(environment: Mapping[str, str], root: str) -> Remote | None:
    """Return the remote store that the environment variables select, or None; `root` is the local store.

    A process gets the same object for the same variables, so that it warns once. Raise `InputError` for illegal values.
    """
    url, token, mode = (environment.get(name, "") for name in (URL, TOKEN, MODE))
    return _remote(url, token, mode, environment.get(TIMEOUT) or _DEFAULT_TIMEOUT, root) if url else None


@lru_cache
def _remote(url: str, token: str, mode: str, timeout: str, root: str) -> Remote:
    if not _is_url(url):
        fail(f"{URL} is '{url}'", hint="legal: http://HOST[:PORT][/PATH] or https://HOST[:PORT][/PATH]")
    if not token.isascii() or not token.isprintable() or " " in token:
        fail(f"{TOKEN} contains a blank or a character that is not printable ASCII")
    if mode not in ("", _READ, _WRITE):
        fail(f"{MODE} is '{mode}'", hint=f"legal: {_READ}, {_WRITE}; default: {_WRITE} if {TOKEN} is set")
    if not re.fullmatch(r"\d{1,4}(\.\d+)?", timeout) or not float(timeout):
        fail(f"{TIMEOUT} is '{timeout}'", hint="legal: a positive number of seconds below 10000")
    return Remote(url, root, token, mode == _WRITE or bool(token and not mode), float(timeout))


def action_result(key: str, sha256: str, size: int) -> bytes:
    """Return Bazel's `ActionResult` with one output file, which is named `key`, as Protocol Buffers."""
    described = _FIRST + bytes([_DIGITS]) + sha256.encode() + _SIZE + _number(size)
    file = _FIRST + bytes([_DIGITS]) + key.encode() + _SECOND + bytes([len(described)]) + described
    return _SECOND + _number(len(file)) + file


def digest_in(result: bytes, key: str) -> tuple[str, int] | None:
    """Return the SHA-256 and size in an `ActionResult` with an output file that is named `key`, else None.

    Servers may add further fields at the end.
    """
    before = result.find(key.encode()) + _DIGITS + 4
    sha256, tail = result[before : before + _DIGITS], _TAIL.match(result, before + _DIGITS)
    if not re.fullmatch(rb"[0-9a-f]{64}", sha256) or tail is None:
        return None
    size = sum((digit & 0x7F) << 7 * number for number, digit in enumerate(tail[1]))
    found = sha256.decode(), size
    return found if size <= MOST_BYTES and result.startswith(action_result(key, *found)) else None


def _number(number: int) -> bytes:
    """Return a number in the variable length of Protocol Buffers: seven bits in each byte, the lowest first."""
    low, rest = number & 0x7F, number >> 7
    return bytes([low | 0x80]) + _number(rest) if rest else bytes([low])


def _is_url(url: str) -> bool:
    try:
        parts = urlsplit(url)
        is_plain = not (parts.query or parts.fragment or "@" in parts.netloc) and parts.port != 0
    except ValueError:
        return False
    return (
        parts.scheme in ("http", "https")
        and bool(parts.hostname)
        and is_plain
        and re.fullmatch(r"[!-~]+", url) is not None
    )


def _shut(*sockets: socket | None) -> None:
    from socket import SHUT_RDWR

    for item in filter(None, sockets):
        with suppress(OSError):
            item.shutdown(SHUT_RDWR)


def _reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())
