"""The server of the page: what it answers, and what it refuses."""

from __future__ import annotations

import asyncio
import http.client
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import aiohttp
import pytest

from fusesoc_firm.studio.server import Studio
from tests.studio.served import served

TEXT = """\
project: {name: robot}
blocks:
  - {name: a, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: b}]}
  - {name: b, middleware: ROS2, mode: publisher, message: geometry_msgs/Point}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    inside = tmp_path / "robots"
    (inside / "arm").mkdir(parents=True)
    (inside / "arm" / "arm.yaml").write_text(TEXT, encoding="utf-8")
    (inside / "stimuli.yaml").write_text("- a: {x: 1}\n", encoding="utf-8")
    (tmp_path / "secret.yaml").write_text(TEXT.replace("robot", "hidden"), encoding="utf-8")
    (inside / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    for name in "build", ".venv", "node_modules":
        (inside / "arm" / name).mkdir()
        (inside / "arm" / name / "copy.yaml").write_text(TEXT, encoding="utf-8")
    return inside


@pytest.fixture
def studio(folder: Path) -> Iterator[Studio]:
    with served(folder) as studio:
        yield studio


def ask(
    studio: Studio, method: str, path: str, body: object = None, **headers: str
) -> tuple[int, http.client.HTTPResponse, Any]:
    """Send a request below the page's address, unless the path begins with a slash."""
    parts = urlsplit(studio.address)
    connection = http.client.HTTPConnection(str(parts.hostname), parts.port or 0, timeout=60)
    data = None if body is None else body if isinstance(body, bytes) else json.dumps(body)
    sent = {name.replace("_", "-"): value for name, value in headers.items()}
    if body is not None:
        sent.setdefault("Content-Type", "application/json")
    connection.request(method, path if path.startswith("/") else parts.path + path, data, sent)
    answer = connection.getresponse()
    text = answer.read()
    connection.close()
    is_json = (answer.getheader("Content-Type") or "").startswith("application/json")
    return answer.status, answer, json.loads(text) if is_json else text.decode(errors="replace")


def scene(studio: Studio, file: str = "arm/arm.yaml") -> dict[str, Any]:
    status, _, found = ask(studio, "GET", f"api/scene?file={quote(file)}")
    assert status == 200, found
    assert isinstance(found, dict)
    return found


def test_the_page_gets_what_it_shows(studio: Studio) -> None:
    assert ask(studio, "GET", "api/files")[2] == {"files": ["arm/arm.yaml"]}
    keys = ask(studio, "GET", "api/grammar")[2]
    assert [key["name"] for key in keys["Specification"]] == ["project", "paths", "accelerators", "blocks"]
    found = scene(studio)
    assert found["text"] == TEXT
    assert found["faults"] == []
    assert [block["name"] for block in found["specification"]["blocks"]] == ["a", "b"]
    assert found["derived"]["Converters"]["AXIS_to_msg"][0]["payloadBytes"] == 28
    messages = ask(studio, "GET", f"api/messages?file=arm/arm.yaml&query={quote('SENSOR imu')}")[2]
    assert messages == {"messages": ["sensor_msgs/Imu"], "count": 1}
    assert ask(studio, "GET", "api/sources?file=arm/arm.yaml")[2] == {"faults": []}


def test_edits_reach_the_file_and_can_be_undone(studio: Studio, folder: Path) -> None:
    file = folder / "arm" / "arm.yaml"
    change = {"edit": "rename", "path": ["blocks", 1], "name": "c"}

    def step(name: str, version: str, **more: object) -> tuple[int, dict[str, Any]]:
        status, _, found = ask(studio, "POST", f"api/{name}", {"file": "arm/arm.yaml", "version": version, **more})
        return status, found

    first = scene(studio)
    assert (first["canUndo"], first["canRedo"]) == (False, False)
    status, second = step("edit", first["version"], change=change)
    assert status == 200
    assert file.read_text(encoding="utf-8") == second["text"] == TEXT.replace("name: b", "name: c")
    assert (second["canUndo"], second["canRedo"], second["faults"]) == (True, False, [])
    # An edit of a text that the file no longer has is refused.
    status, refused = step("edit", first["version"], change=change)
    assert (status, refused) == (409, {"reason": "the file has changed meanwhile"})
    status, third = step("undo", second["version"])
    assert (status, third["text"], third["canRedo"]) == (200, TEXT, True)
    status, fourth = step("redo", third["version"])
    assert (status, fourth["text"]) == (200, second["text"])
    status, refused = step("redo", fourth["version"])
    assert (status, refused) == (409, {"reason": "there is nothing to redo"})
    status, fifth = step("write", fourth["version"], text="project: {name: x}\nblocks: []\n")
    assert (status, fifth["text"]) == (200, file.read_text(encoding="utf-8"))
    # An empty system is not wrong yet.
    assert (fifth["faults"], fifth["derived"]) == ([], None)
    assert ask(studio, "GET", "api/sources?file=arm/arm.yaml")[2] == {"faults": []}


def test_faults_name_what_they_concern(studio: Studio) -> None:
    text = TEXT.replace("message: geometry_msgs/Point}", "message: geometry_msgs/Piont}") + "clocks: 1\n"
    _, _, found = ask(studio, "POST", "api/check", {"file": "arm/arm.yaml", "text": text})
    places = {(tuple(fault["path"]), fault["line"]) for fault in found["faults"]}
    assert places == {(("blocks", 1, "message"), 4), (("clocks",), 5)}
    assert found["derived"] is None
    # A text that becomes invalid at some place has no picture, but a fault there.
    _, _, found = ask(studio, "POST", "api/check", {"file": "arm/arm.yaml", "text": f"{TEXT}  - [\n"})
    assert found["specification"] is None
    assert {fault["line"] for fault in found["faults"]} == {5}
    assert scene(studio)["text"] == TEXT


def test_a_change_by_another_program_is_told(studio: Studio, folder: Path) -> None:
    async def changed() -> str:
        async with aiohttp.ClientSession() as session, session.ws_connect(f"{studio.address}api/changes") as socket:
            (folder / "arm" / "arm.yaml").write_text(TEXT + "# more\n", encoding="utf-8")
            return str((await socket.receive_json(timeout=60))["changed"])

    before = scene(studio)
    assert asyncio.run(changed()) == "arm/arm.yaml"
    after = scene(studio)
    assert after["text"].endswith("# more\n")
    assert after["version"] != before["version"]


def test_a_byte_order_mark_and_line_ends_stay(studio: Studio, folder: Path) -> None:
    file = folder / "arm" / "arm.yaml"
    file.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    change = {"edit": "set", "path": ["project"], "key": "width", "value": "64"}
    version = scene(studio)["version"]
    assert ask(studio, "POST", "api/edit", {"file": "arm/arm.yaml", "version": version, "change": change})[0] == 200
    expected = TEXT.replace("robot}", "robot, width: 64}").replace("\n", "\r\n")
    assert file.read_bytes() == b"\xef\xbb\xbf" + expected.encode()


FILES = [
    "../secret.yaml",
    "arm/../../secret.yaml",
    "link.yaml",
    "/etc/passwd",
    "arm/arm.yaml/../../../secret.yaml",
    "..%2fsecret.yaml",
    "arm\\..\\..\\secret.yaml",
    "arm/arm.yaml\0",
    "arm",
    "",
    ".",
    "arm/other.yaml",
    "arm/arm.core",
    "file:///etc/passwd",
    "http://localhost/arm.yaml",
    "x" * 5000 + ".yaml",
]


@pytest.mark.parametrize("name", FILES)
def test_no_other_file_is_read_or_written(studio: Studio, folder: Path, name: str) -> None:
    hidden = folder.parent / "secret.yaml"
    before = hidden.read_bytes()
    for path in "scene", "messages", "sources", "bytes", "generated", "schedulers", "resources", "boards":
        status, _, text = ask(studio, "GET", f"api/{path}?file={quote(name, safe='')}")
        assert status == 404
        assert "hidden" not in str(text)
    for path in "edit", "write", "undo", "redo", "check", "run", "bitstream", "load":
        status, _, text = ask(studio, "POST", f"api/{path}", {"file": name, "version": "", "text": "x"})
        assert status == 404, path
    assert hidden.read_bytes() == before


HEADERS = [
    {"Host": "evil.example"},
    {"Host": "localhost"},
    {"Host": "127.0.0.1"},
    {"Host": "127.0.0.1.evil.example:80"},
    {"Host": ""},
    {"Origin": "http://evil.example"},
    {"Origin": "null"},
    {"Origin": "https://127.0.0.1"},
    {"Origin": "http://127.0.0.1:1"},
    {"Origin": "file://"},
    {"Origin": "http://localhost.evil.example"},
]


@pytest.mark.parametrize("headers", HEADERS, ids=str)
@pytest.mark.parametrize(
    "path",
    [
        "",
        "api/files",
        "api/scene?file=arm/arm.yaml",
        "api/changes",
        "api/watch",
        "api/resources?file=arm/arm.yaml",
        "api/boards?file=arm/arm.yaml",
        "assets/index.js",
    ],
)
def test_other_pages_are_refused(studio: Studio, headers: dict[str, str], path: str) -> None:
    status, _, text = ask(studio, "GET", path, None, **headers)
    assert (status, text) == (403, "open the address that firm studio printed\n")


@pytest.mark.parametrize("headers", HEADERS, ids=str)
@pytest.mark.parametrize("path", ["edit", "run", "bitstream", "load", "cancel"])
def test_other_pages_begin_nothing(studio: Studio, headers: dict[str, str], path: str) -> None:
    body = {"file": "arm/arm.yaml", "board": "icebreaker"}
    assert ask(studio, "POST", f"api/{path}", body, **headers)[0] == 403


@pytest.mark.parametrize("secret", ["", "x", "é", "..", "../..", "%2e%2e", "a" * 32, "null"])
@pytest.mark.parametrize("path", ["/", "/api/files", "/api/scene?file=arm/arm.yaml"])
def test_a_request_without_the_secret_is_refused(studio: Studio, secret: str, path: str) -> None:
    assert ask(studio, "GET", f"/{quote(secret)}{path}")[0] == 403


@pytest.mark.parametrize(
    ("body", "kind", "status"),
    [
        (b"{", "application/json", 400),
        (b"[1]", "application/json", 400),
        (b"\xff\xfe", "application/json", 400),
        (b"[" * 100_000, "application/json", 400),
        (b'{"file": "arm/arm.yaml", "version": ' + b"9" * 5000 + b"}", "application/json", 400),
        (b'{"file": "arm/arm.yaml\\ud800"}', "application/json", 400),
        (b'{"file": "arm/arm.yaml", "text": "\\udc00"}', "application/json", 400),
        (b"{}", "text/plain", 415),
        (b"file=arm", "application/x-www-form-urlencoded", 415),
        (b" " * 5_000_000, "application/json", 413),
    ],
    ids=range(10),
)
def test_a_request_of_another_form_is_refused(studio: Studio, body: bytes, kind: str, status: int) -> None:
    assert ask(studio, "POST", "api/edit", body, Content_Type=kind)[0] == status
    assert scene(studio)["text"] == TEXT


@pytest.mark.parametrize("encoding", ["gzip", "deflate", "br", "zstd", "unknown"])
def test_a_body_that_is_not_compressed_as_it_says_is_refused(studio: Studio, encoding: str) -> None:
    assert ask(studio, "POST", "api/edit", b"not compressed", Content_Encoding=encoding)[0] == 400
    assert scene(studio)["text"] == TEXT


def test_nothing_of_a_file_runs_in_the_page(studio: Studio) -> None:
    """The browser is told to run our scripts alone."""
    _, answer, _ = ask(studio, "GET", "api/files")
    policy = dict(part.strip().split(" ", 1) for part in str(answer.getheader("Content-Security-Policy")).split(";"))
    assert policy["default-src"] == policy["base-uri"] == policy["frame-ancestors"] == "'none'"
    assert policy["script-src"] == policy["connect-src"] == "'self'"
    assert answer.getheader("X-Content-Type-Options") == "nosniff"
    assert answer.getheader("Referrer-Policy") == "no-referrer"


def test_the_first_scene_is_named_by_the_page(studio: Studio, folder: Path) -> None:
    _, answer, _ = ask(studio, "GET", "")
    assert answer.getheader("Link") == "<api/outline>; rel=preload; as=fetch; crossorigin"
    files = ask(studio, "GET", "api/files")[2]["files"]
    outline, whole = ask(studio, "GET", "api/outline")[2], scene(studio)
    assert outline["file"] == files[0] == "arm/arm.yaml"
    assert outline == whole | {"faults": [], "derived": None}
    assert whole["derived"]
    (folder / "arm" / "arm.yaml").unlink()
    assert ask(studio, "GET", "api/outline")[2] is None


HOSTILE = {
    "cycle": "project: {name: a}\nblocks: &b [*b]\n",
    "cycle_top": "a: &a [*a]\nproject: {name: a}\nblocks: []\n",
    "nan": "project: {name: a, width: .nan}\nblocks: [-.inf]\n",
    "keys": "project: {name: a, 2026-01-01: b, .nan: c, 1: d}\nblocks: []\n",
    "tags": "project: {name: !!binary YQ==}\nblocks: !!set {a, b}\n",
    "surrogate": 'project: {name: "\\ud800"}\nblocks: []\n',
    "digits": f"project: {{name: a, width: 0x{'f' * 50_000}}}\nblocks: []\n",
    "base_60": f"project: {{name: a, width: 1{':1' * 2000}}}\nblocks: []\n",
    "deep": f"project: {{name: a}}\nblocks: {'[' * 100_000}\n",
    "control": "project: {name: a}\nblocks: []\n" + "\0" * 300_000,
    "open": "project: {name: a}\nblocks: [" + "x, " * 40_000,
    "laughs": "project: {name: a}\na0: &a0 [x]\n"
    + "".join(f"a{n}: &a{n} [{f'*a{n - 1}, ' * 9}]\n" for n in range(1, 12))
    + "blocks: *a11\n",
}


def test_hostile_files_do_not_hide_the_others(studio: Studio, folder: Path) -> None:
    """All files are listed, each has a scene of valid JSON with its faults, and the others have all their facts."""
    for number in range(len(HOSTILE), 200):
        (folder / f"more{number}.yaml").write_text([*HOSTILE.values()][number % 6], encoding="utf-8")
    for name, text in HOSTILE.items():
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    files = ask(studio, "GET", "api/files")[2]["files"]
    assert len(files) == 201 and {"arm/arm.yaml", *(f"{name}.yaml" for name in HOSTILE)} <= {*files}
    assert ask(studio, "GET", "api/outline")[0] == 200
    for name in HOSTILE:
        found = scene(studio, f"{name}.yaml")
        assert found["derived"] is None and found["faults"]
    whole = scene(studio)
    assert whole["derived"] and not whole["faults"]


def test_more_faults_than_can_be_read_are_counted(studio: Studio, folder: Path) -> None:
    (folder / "many.yaml").write_text("project: {name: a}\nblocks:\n" + "  - x\n" * 300, encoding="utf-8")
    faults = scene(studio, "many.yaml")["faults"]
    assert len(faults) == 201
    assert faults[-1]["message"].startswith("and ")


def test_one_specification_can_be_served_alone(folder: Path) -> None:
    (folder / "arm" / "other.yaml").write_text(TEXT, encoding="utf-8")
    with served(folder / "arm" / "arm.yaml") as studio:
        assert ask(studio, "GET", "api/files")[2] == {"files": ["arm.yaml"]}
        assert scene(studio, "arm.yaml")["text"] == TEXT
        assert ask(studio, "GET", "api/scene?file=other.yaml")[0] == 404
