"""The remote store: entries travel between machines, and no fault of a server gives a wrong result."""

from __future__ import annotations

import os
import random
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from fusesoc_firm.builds.store import layout, server
from fusesoc_firm.builds.store.remote import MODE, TIMEOUT, TOKEN, URL, Remote, action_result, digest_in, remote_store
from fusesoc_firm.builds.store.server import Server
from fusesoc_firm.builds.store.store import Entry, Files, Key, Store, default_store
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.digests import digest
from tests.processes import IGNORING_INTERRUPTS

Captured = pytest.CaptureFixture[str]
KEY = "ab" * 32
FILES = {"rtl/a.vhd": b"entity a\n", "top.core": b"CAPI=2:\n"}
SECRET = "a-token"
NGINX = shutil.which("nginx", path=f"{os.environ['PATH']}:/usr/sbin")
# A store in which people read and, with a token, CI writes, as docs/reference/store.md describes.
NGINX_PAGE = "docs/reference/store.md"


@contextmanager
def served(server: ThreadingHTTPServer) -> Iterator[str]:
    """Run a server within this context, and yield its URL."""
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@pytest.fixture
def url(tmp_path: Path) -> Iterator[str]:
    with served(Server(Store(tmp_path / "server", 2**30), "127.0.0.1", 0, SECRET)) as url:
        yield url


def machine(root: Path, url: str, token: str = "", timeout: float = 5) -> Store:
    """A machine's own store, in a new process, and the rights of a user."""
    store = default_store({"FUSESOC_FIRM_CACHE": str(root), URL: url, TOKEN: token})
    assert store.remote
    return replace(store, remote=replace(store.remote, timeout=timeout))


def obtain(store: Store, key: str = KEY, files: Files = FILES) -> Entry:
    return store.obtain(Key(key, {"core": key[:4]}), lambda: files)


def refuse() -> Files:
    raise AssertionError("built, although the remote store has it")


def stored(root: Path, suffix: str) -> list[Path]:
    return sorted(root.rglob(f"*{suffix}"))


def test_a_second_machine_builds_nothing(tmp_path: Path, url: str, capfd: Captured) -> None:
    assert obtain(machine(tmp_path / "ci", url, SECRET)) == Entry(FILES, False)
    second = machine(tmp_path / "second", url)
    assert second.obtain(Key(KEY), refuse) == Entry(FILES, True)
    # From here on, the entry is in the own store.
    assert replace(second, remote=None).obtain(Key(KEY), refuse) == Entry(FILES, True)
    (own,) = stored(tmp_path / "second", ".entry")
    assert layout.read_entry(str(tmp_path / "second"), str(own.relative_to(tmp_path / "second")))
    assert capfd.readouterr().err == ""


def test_only_ci_writes(tmp_path: Path, url: str, capfd: Captured) -> None:
    obtain(machine(tmp_path / "reader", url))
    assert not stored(tmp_path / "server", "*")
    assert capfd.readouterr().err == ""
    wrong = machine(tmp_path / "wrong", url, "another-token")
    for digit in "abc":
        assert obtain(wrong, digit * 64) == Entry(FILES, False)
    assert not stored(tmp_path / "server", "*")
    assert capfd.readouterr().err == f"warning: remote store {url}: 401 Unauthorized for a write\n"
    # A refused write does not keep the user from reading.
    obtain(machine(tmp_path / "ci", url, SECRET))
    assert wrong.obtain(Key(KEY), refuse) == Entry(FILES, True)


def test_large_entries_are_refused_with_a_reason(tmp_path: Path, url: str, capfd: Captured) -> None:
    wrong = machine(tmp_path / "wrong", url, "another-token")
    obtain(wrong, files={"x": random.Random(1).randbytes(2**23)})
    assert capfd.readouterr().err == f"warning: remote store {url}: 401 Unauthorized for a write\n"


def test_a_server_without_a_token_is_read_only(tmp_path: Path, capfd: Captured) -> None:
    with served(Server(Store(tmp_path / "server", 2**30), "127.0.0.1", 0)) as url:
        obtain(machine(tmp_path / "a", url, SECRET))
        assert capfd.readouterr().err == f"warning: remote store {url}: 403 Forbidden for a write\n"
    assert not stored(tmp_path / "server", "*")


def silent_port() -> socket.socket:
    """A server that accepts connections and never answers."""
    listening = socket.socket()
    listening.bind(("127.0.0.1", 0))
    listening.listen()
    return listening


def test_a_server_that_is_down_costs_one_warning(tmp_path: Path, capfd: Captured) -> None:
    with closing(silent_port()) as taken:
        url = f"http://127.0.0.1:{taken.getsockname()[1]}"
    for number in range(6):
        # Each is another process, with the same local store.
        store = machine(tmp_path, url, SECRET)
        assert obtain(store, f"{number}" * 64) == Entry(FILES, False)
    assert capfd.readouterr().err == f"warning: remote store {url}: Connection refused\n"
    assert store.remote
    assert store.remote.failures(0) == [f"warning: remote store {url}: Connection refused"]
    assert store.remote.failures(time.time() + 1) == []


def test_a_server_that_never_answers_costs_one_wait(tmp_path: Path, capfd: Captured) -> None:
    with closing(silent_port()) as listening:
        url = f"http://127.0.0.1:{listening.getsockname()[1]}"
        for number in range(6):
            assert obtain(machine(tmp_path, url, SECRET, timeout=0.1), f"{number}" * 64) == Entry(FILES, False)
    assert re.fullmatch(rf"warning: remote store {url}: no answer within 1?\d\.?\d* s\n", capfd.readouterr().err)


class Fake(ThreadingHTTPServer):
    """A server whose answers a test determines: the status and the bytes for a path."""

    daemon_threads = True

    def __init__(self, answer: Callable[[str], tuple[int, bytes]], *, pause: float = 0) -> None:
        self.answer, self.pause = answer, pause
        super().__init__(("127.0.0.1", 0), _FakeHandler)

    def handle_error(self, *_: object) -> None:
        """The client hangs up."""


class _FakeHandler(BaseHTTPRequestHandler):
    server: Fake

    def do_GET(self) -> None:
        status, data = self.server.answer(self.path)
        self.send_response(status)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        for place in range(0, len(data), 1 if self.server.pause else len(data)):
            self.wfile.write(data[place : place + 1] if self.server.pause else data)
            time.sleep(self.server.pause)

    def log_message(self, *_: object) -> None:
        pass


def test_a_server_that_sends_byte_after_byte_is_not_waited_for(tmp_path: Path, capfd: Captured) -> None:
    """The connection's own timeout starts again with every byte, so it never ends such an answer."""
    with served(Fake(lambda _: (200, bytes(10_000)), pause=0.05)) as url:
        assert obtain(machine(tmp_path, url, timeout=0.3)) == Entry(FILES, False)
    assert capfd.readouterr().err.startswith(f"warning: remote store {url}: no answer within 0.3 s")


def test_a_claimed_size_sets_no_waiting_time(tmp_path: Path, capfd: Captured) -> None:
    """A content of 512 MiB, of which a server sends a byte each 50 ms: without a bound, this lasts eight minutes."""
    with served(Fake(lambda _: (200, bytes(10_000)), pause=0.05)) as url:
        store = remote_store({URL: url, TIMEOUT: "0.3"}, str(tmp_path))
        assert store and store.content("0" * 64, 2**29) is None
    assert capfd.readouterr().err == f"warning: remote store {url}: no answer within 0.3 s\n"


def test_codes_of_a_server_do_not_reach_the_terminal(tmp_path: Path, capfd: Captured) -> None:
    with closing(silent_port()) as listening:

        def answer() -> None:
            connection, _ = listening.accept()
            with connection:
                connection.sendall(b"HTTP/1.1 500 \x1b]0;title\x07\x9b31m\r\nContent-Length: 0\r\n\r\n")

        thread = threading.Thread(target=answer)
        thread.start()
        url = f"http://127.0.0.1:{listening.getsockname()[1]}"
        assert obtain(machine(tmp_path, url)) == Entry(FILES, False)
        thread.join()
    assert capfd.readouterr().err == f"warning: remote store {url}: 500 \\x1b]0;title\\x07\\x9b31m\n"


@pytest.mark.parametrize(
    ("status", "warning"), [(404, ""), (500, "500 Internal Server Error"), (302, "302 Found"), (204, "204 No Content")]
)
def test_other_answers(tmp_path: Path, capfd: Captured, status: int, warning: str) -> None:
    with served(Fake(lambda _: (status, b""))) as url:
        for number in range(3):
            assert obtain(machine(tmp_path, url), f"{number}" * 64) == Entry(FILES, False)
    assert capfd.readouterr().err == (warning and f"warning: remote store {url}: {warning}\n")


def test_what_is_not_http_is_a_warning(tmp_path: Path, capfd: Captured) -> None:
    with closing(silent_port()) as listening:

        def greet() -> None:
            connection, _ = listening.accept()
            with connection:
                connection.sendall(b"SSH-2.0-OpenSSH\r\n")

        thread = threading.Thread(target=greet)
        thread.start()
        url = f"http://127.0.0.1:{listening.getsockname()[1]}"
        assert obtain(machine(tmp_path, url)) == Entry(FILES, False)
        thread.join()
    assert capfd.readouterr().err == f"warning: remote store {url}: SSH-2.0-OpenSSH\n"


def damaged(random_: random.Random, blobs: dict[str, bytes], key: str) -> dict[str, bytes]:
    """The server's blobs after one fault in what belongs to a key: damaged, cut, longer, or another blob."""
    result = dict(blobs)
    found = digest_in(blobs[f"/ac/{key}"], key)
    assert found
    name = random_.choice([f"/ac/{key}", f"/cas/{found[0]}"])
    data = blobs[name]
    others = [path for path in blobs if path != name and path[:3] == name[:3]]
    place = random_.randrange(len(data))
    changes = [
        data[:place] + bytes([data[place] ^ 1 << random_.randrange(8)]) + data[place + 1 :],
        data[:place],
        data[:place] + random_.randbytes(random_.randrange(1, 9)) + data[place:],
        data[:place] + data[place + 1 :],
        blobs[random_.choice(others)],
        random_.randbytes(len(data)),
    ]
    result[name] = random_.choice(changes)
    return result


@pytest.mark.parametrize(
    "count", [pytest.param(500, id="sample"), pytest.param(10_000, id="all", marks=pytest.mark.thorough)]
)
def test_damaged_cut_and_swapped_blobs_are_not_accepted(tmp_path: Path, capfd: Captured, count: int) -> None:
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    random_ = random.Random(seed)
    blobs: dict[str, bytes] = {}
    for digit in "0123456789":
        key = digit * 64
        whole = f"{key}\n".encode() + layout.entry_data({"core": digit}, {"x.vhd": random_.randbytes(100)})
        blobs[f"/cas/{digest(whole)}"] = whole
        blobs[f"/ac/{key}"] = action_result(key, digest(whole), len(whole))
    now = blobs

    def answer(path: str) -> tuple[int, bytes]:
        return (200, now[path]) if path in now else (404, b"")

    with served(Fake(answer)) as url:
        for number in range(count):
            key = random_.choice("0123456789") * 64
            # Whatever a server returns is a miss; a remark of a failure would hide the next one.
            remote = Remote(url, str(tmp_path / str(number % 100)))
            now = damaged(random_, blobs, key)
            found = remote.entry(key)
            intact = blobs == now or _appended(blobs, now, key)
            assert found is None or (intact and layout.entry_in(found)), f"{key} in fault {number} of seed {seed}"
            shutil.rmtree(remote.root, ignore_errors=True)
        now = blobs
        assert all(Remote(url, str(tmp_path)).entry(digit * 64) for digit in "0123456789")
    assert "is damaged and ignored" in capfd.readouterr().err


def _appended(blobs: dict[str, bytes], now: dict[str, bytes], key: str) -> bool:
    """Whether only fields were appended to the description of the entry, which is legal."""
    return now[f"/ac/{key}"].startswith(blobs[f"/ac/{key}"]) and {**now, f"/ac/{key}": blobs[f"/ac/{key}"]} == blobs


def test_a_description_of_another_entry_is_not_accepted(tmp_path: Path) -> None:
    """The description names the right key, and the SHA-256 and size of the intact entry of another key."""
    whole = f"{'c' * 64}\n".encode() + layout.entry_data({}, FILES)
    sha256 = digest(whole)
    answers = {f"/cas/{sha256}": whole}
    answers |= {f"/ac/{key}": action_result(key, sha256, len(whole)) for key in (KEY, "c" * 64)}
    with served(Fake(lambda path: (200, answers[path]))) as url:
        assert Remote(url, str(tmp_path)).entry("c" * 64) == layout.entry_data({}, FILES)
        assert Remote(url, str(tmp_path)).entry(KEY) is None


def test_an_entry_of_another_form_is_not_accepted(tmp_path: Path, url: str, capfd: Captured) -> None:
    """Its digests are right, but a file's name leads out of the folder."""
    evil = layout.entry_data({}, {"../x": b""})
    remote = machine(tmp_path / "ci", url, SECRET).remote
    assert remote
    remote.put_entry(KEY, evil)
    assert obtain(machine(tmp_path / "a", url)) == Entry(FILES, False)
    assert capfd.readouterr().err == f"warning: remote store {url}: the entry {KEY} is damaged and ignored\n"


def test_a_damaged_entry_is_replaced_by_ci(tmp_path: Path, url: str, capfd: Captured) -> None:
    obtain(machine(tmp_path / "ci", url, SECRET))
    (blob,) = stored(tmp_path / "server", ".cas")
    blob.write_bytes(blob.read_bytes()[:-1])
    # The server does not send what differs from its SHA-256.
    assert obtain(machine(tmp_path / "a", url, SECRET)) == Entry(FILES, False)
    assert machine(tmp_path / "b", url).obtain(Key(KEY), refuse) == Entry(FILES, True)
    assert capfd.readouterr().err == ""


def test_the_description_is_that_of_the_remote_execution_api() -> None:
    """Compared once with the bytes of Google's Protocol Buffers."""
    expected = "128a010a40" + b"ab".hex() * 32 + "12460a40" + b"cd".hex() * 32 + "10c0c407"
    result = action_result("ab" * 32, "cd" * 32, 123_456)
    assert result.hex() == expected
    for size in (0, 1, 127, 128, 2**14, 2**30):
        assert digest_in(action_result(KEY, "cd" * 32, size), KEY) == ("cd" * 32, size)
    # Servers append execution metadata.
    assert digest_in(result + b"\x4a\x06\x0a\x04host", "ab" * 32) == ("cd" * 32, 123_456)
    assert digest_in(result, "cd" * 32) is None
    assert digest_in(action_result(KEY, "cd" * 32, 2**30 + 1), KEY) is None
    assert digest_in(b"", KEY) is None


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        (URL, "ftp://host", f"error: {URL} is 'ftp://host'"),
        (URL, "http://", f"error: {URL} is 'http://'"),
        (URL, "http://host:x", f"error: {URL} is 'http://host:x'"),
        (URL, "http://me:word@host", f"error: {URL} is 'http://me:word@host'"),
        (URL, "http://host/a b", f"error: {URL} is 'http://host/a b'"),
        (URL, "http://host/?a", f"error: {URL} is 'http://host/?a'"),
        (TOKEN, "a\nb", f"error: {TOKEN} contains a blank or a character that is not printable ASCII"),
        (MODE, "rw", f"error: {MODE} is 'rw'\n      = legal: read, write; default: write if {TOKEN} is set"),
        (TIMEOUT, "soon", f"error: {TIMEOUT} is 'soon'\n      = legal: a positive number of seconds below 10000"),
        (TIMEOUT, "0", f"error: {TIMEOUT} is '0'"),
    ],
)
def test_illegal_variables(name: str, value: str, error: str) -> None:
    with pytest.raises(InputError) as found:
        default_store({URL: "http://host", name: value})
    assert str(found.value).startswith(error)


@pytest.mark.parametrize(
    ("token", "mode", "is_writable"),
    [("", "", False), ("x", "", True), ("x", "read", False), ("", "write", True)],
)
def test_rights(token: str, mode: str, is_writable: bool) -> None:
    remote = default_store({URL: "https://host/cache", TOKEN: token, MODE: mode}).remote
    assert remote
    assert remote.is_writable == is_writable
    assert "x" not in repr(remote).replace("https", "")


def request(url: str, method: str, path: str, data: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    connection = HTTPConnection(url.removeprefix("http://"))
    with closing(connection):
        connection.request(method, path, data, {name.replace("_", "-"): value for name, value in headers.items()})
        answer = connection.getresponse()
        return answer.status, answer.read()


def test_the_server_checks_what_it_gets(tmp_path: Path, url: str) -> None:
    blob = b"anything"
    place, known = f"/cas/{digest(blob)}", {"Authorization": f"Bearer {SECRET}"}
    assert request(url, "GET", place) == (404, b"")
    assert request(url, "PUT", place, blob)[0] == 401
    assert request(url, "PUT", place, b"other", **known)[0] == 400
    for path in ("/", "/ac/../../x", f"/ac/{'A' * 64}", f"{place}/", "/ac/" + "a" * 63):
        assert request(url, "PUT", path, blob, **known)[0] == 404
        assert request(url, "GET", path)[0] == 404
    assert request(url, "PUT", place, None, **known, Transfer_Encoding="chunked")[0] == 411
    assert request(url, "PUT", place, blob, **known, Content_Length=str(2**35))[0] == 413
    assert not [path for path in stored(tmp_path / "server", "*") if path.is_file()]
    assert request(url, "PUT", place, blob, **known)[0] == 201
    assert request(url, "GET", place) == (200, blob)
    assert request(url, "HEAD", place) == (200, b"")
    assert request(url, "POST", place)[0] == 501
    # What was swapped or damaged on the server's disk.
    (file,) = stored(tmp_path / "server", ".cas")
    shutil.copy(file, file.with_name(f"{file.name[:2]}{'0' * 62}.cas"))
    assert request(url, "GET", f"/cas/{file.name[:2]}{'0' * 62}")[0] == 404
    assert len(Store(tmp_path / "server", 2**30).remove_damaged()) == 1
    assert Store(tmp_path / "server", 2**30).size() == file.stat().st_size


def test_all_data_in_transit_are_bounded(tmp_path: Path, url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    blob = b"anything"
    place, known = f"/cas/{digest(blob)}", {"Authorization": f"Bearer {SECRET}"}
    monkeypatch.setattr(server, "_MOST_PENDING_BYTES", len(blob) - 1)
    assert request(url, "PUT", place, blob, **known)[0] == 507
    monkeypatch.setattr(server, "_MOST_PENDING_BYTES", len(blob))
    for _ in range(2):
        assert request(url, "PUT", place, blob, **known)[0] == 201
    assert request(url, "GET", place) == (200, blob)


def test_the_server_passes_large_data_on_in_parts(tmp_path: Path, url: str) -> None:
    """Its memory is a chunk for each connection."""
    blob = bytes(32 * 2**20)
    place, known = f"/cas/{digest(blob)}", {"Authorization": f"Bearer {SECRET}"}
    tracemalloc.start()
    try:
        assert request(url, "PUT", place, blob, **known)[0] == 201
        assert tracemalloc.get_traced_memory()[1] < len(blob)
        tracemalloc.reset_peak()
        assert request(url, "HEAD", place) == (200, b"")
        assert tracemalloc.get_traced_memory()[1] < 4 * 2**20
    finally:
        tracemalloc.stop()


def test_the_server_keeps_its_limit(tmp_path: Path) -> None:
    with served(Server(Store(tmp_path / "server", 50_000), "127.0.0.1", 0, SECRET)) as url:
        for number in range(10):
            obtain(
                machine(tmp_path / "ci", url, SECRET), f"{number}" * 64, {"x": random.Random(number).randbytes(9_000)}
            )
    assert 20_000 < Store(tmp_path / "server", 50_000).size() <= 50_000


def test_many_clients_at_once(tmp_path: Path, url: str) -> None:
    def work(number: int) -> None:
        for digit in random.Random(number).sample("0123456789", 10):
            files = {"x": digit.encode() * 50_000}
            results.append(obtain(machine(tmp_path / f"m{number}", url, SECRET), digit * 64, files).files == files)

    results: list[bool] = []
    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [True] * 80


def test_the_command(tmp_path: Path, capfd: Captured) -> None:
    environment = os.environ | {"FUSESOC_FIRM_CACHE": str(tmp_path / "server"), TOKEN: SECRET}
    command = [*IGNORING_INTERRUPTS, sys.executable, "-m", "fusesoc_firm.cli", "cache", "serve", "--port", "0"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        line = process.stdout.readline()
        try:
            found = re.fullmatch(r"(http://127\.0\.0\.1:\d+) serves (.*); clients with the token may write\n", line)
            assert found
            assert found[2] == str(tmp_path / "server" / "served")
            obtain(machine(tmp_path / "ci", found[1], SECRET))
            assert machine(tmp_path / "a", found[1]).obtain(Key(KEY), refuse) == Entry(FILES, True)
            taken = [*command[:-1], found[1].rpartition(":")[2]]
            again = subprocess.run(taken, env=environment, capture_output=True, check=False)
            assert again.returncode == 1
            assert b"error: cannot listen on 127.0.0.1 port " in again.stderr
        finally:
            process.send_signal(2)
        assert process.wait() == 130


@pytest.mark.skipif(NGINX is None, reason="needs nginx (apt-get install --no-install-recommends nginx)")
def test_nginx_is_a_server(tmp_path: Path, capfd: Captured) -> None:
    """With the configuration in the documentation."""
    text = Path(NGINX_PAGE).read_text(encoding="utf-8")
    (server,) = re.findall(r"```nginx\n(.*?)```", text, re.DOTALL)
    with closing(silent_port()) as free:
        port = free.getsockname()[1]
    for old, new in (("443 ssl", f"127.0.0.1:{port}"), ("/srv/firm", str(tmp_path / "blobs")), ("TOKEN", SECRET)):
        assert old in server
        server = server.replace(old, new)
    server = re.sub(r"^ *ssl_.*\n", "", server, flags=re.MULTILINE)
    temporary = "".join(
        f"{name}_temp_path {tmp_path}/{name};\n" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    configuration = (
        f"daemon off; pid {tmp_path}/pid; error_log stderr; user {_user()};\nevents {{}}\nhttp {{\naccess_log off;\n"
    )
    (tmp_path / "conf").write_text(f"{configuration}{temporary}{server}}}\n")
    (tmp_path / "blobs").mkdir()
    with subprocess.Popen([str(NGINX), "-c", tmp_path / "conf", "-e", "stderr"], stderr=subprocess.PIPE) as process:
        try:
            url = f"http://127.0.0.1:{port}/cache"
            while process.poll() is None and not _answers(port):
                time.sleep(0.05)
            large = {"x": random.Random(1).randbytes(3 * 2**20)}
            assert obtain(machine(tmp_path / "ci", url, SECRET), files=large) == Entry(large, False)
            assert machine(tmp_path / "a", url).obtain(Key(KEY), refuse) == Entry(large, True)
            assert obtain(machine(tmp_path / "a", url), "c" * 64) == Entry(FILES, False)
            # Writes again, and writes without the right token.
            remote = machine(tmp_path / "ci", url, SECRET).remote
            assert remote
            remote.put_entry(KEY, layout.entry_data({"core": KEY[:4]}, large))
            assert capfd.readouterr().err == ""
            obtain(machine(tmp_path / "b", url, "another-token"), "d" * 64)
            assert capfd.readouterr().err == f"warning: remote store {url}: 403 Forbidden for a write\n"
            assert not machine(tmp_path / "c", url).remote.entry("d" * 64)  # type: ignore[union-attr]
            # Damage on its disk.
            (blob,) = (path for path in (tmp_path / "blobs" / "cache" / "cas").iterdir() if path.stat().st_size > 2**20)
            blob.write_bytes(blob.read_bytes()[:-1])
            assert obtain(machine(tmp_path / "d", url), files=large) == Entry(large, False)
            assert capfd.readouterr().err == f"warning: remote store {url}: the entry {KEY} is damaged and ignored\n"
        finally:
            process.terminate()


def _user() -> str:
    return subprocess.run(["id", "-un"], capture_output=True, text=True, check=True).stdout.strip()


def _answers(port: int) -> bool:
    with closing(socket.socket()) as connection:
        return connection.connect_ex(("127.0.0.1", port)) == 0
