"""A run that the page starts and watches: what the server tells of it, and what it refuses."""

from __future__ import annotations

import asyncio
import io
import json
import math
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import replace
from itertools import count, pairwise
from pathlib import Path
from typing import Any
from urllib.parse import quote

import aiohttp
import pytest
from matplotlib import image as pictures

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.node.engine.watch import Control, Latency, Load, Seen, Waits, Watch
from fusesoc_firm.studio import page_run
from fusesoc_firm.studio.live import Live
from fusesoc_firm.studio.message import fields_of, picture_of, pose_of, words_of
from fusesoc_firm.studio.page_run import Run
from fusesoc_firm.studio.reports import Reports
from fusesoc_firm.studio.server import Studio
from tests.studio.played import HOSTILE, TYPES, WAITS, modelled, write_service, write_system
from tests.studio.served import load, served
from tests.studio.test_server import ask

News = dict[str, Any]


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    return write_system(tmp_path)


@pytest.fixture
def studio(spec: Path) -> Iterator[Studio]:
    with served(spec, modelled()) as studio:
        yield studio


def begin(studio: Studio, **wishes: object) -> None:
    body = {"file": "robot.yaml", "tool": "ghdl", **wishes}
    assert ask(studio, "POST", "api/run", body)[0] == 200


def control(studio: Studio, what: str) -> None:
    assert ask(studio, "POST", "api/control", {"do": what})[0] == 200


async def reports(address: str) -> AsyncIterator[News]:
    """Yield what a page gets, which confirms each report."""
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{address}api/watch") as socket:
        while True:
            yield dict(await socket.receive_json(timeout=600))
            await socket.send_str("1")


def until(studio: Studio, condition: Callable[[News], bool]) -> News:
    """Return the first state of a run that fulfils a condition, as a page knows it from all reports."""

    async def steps() -> News:
        known: News = {}
        async for report in reports(studio.address):
            if "run" in report and (report["run"] or {}).get("number") != (known.get("run") or {}).get("number"):
                known = {}
            known.setdefault("messages", []).extend(report.pop("messages", []))
            known |= report.pop("figures", {}) | report
            if condition({"last": -1, "counts": {}} | known):
                return known
        raise AssertionError("the server has ended")

    return asyncio.run(steps())


def test_a_run_is_told_to_its_end(studio: Studio) -> None:
    assert until(studio, lambda _: True) == {"run": None, "messages": []}
    begin(studio)
    news = until(studio, lambda now: now["run"] and now["run"]["state"] == "ended")
    run = news["run"]
    assert (run["file"], run["isControlled"], run["clock"]) == ("robot.yaml", True, 1e8)
    assert (news["first"], news["last"], news["skipped"]) == (0, 5, 0)
    assert {name: count["messages"] for name, count in news["counts"].items()} == dict.fromkeys(
        ["point", "text", "image", "point_out", "text_out", "image_out"], 1
    )
    assert news["loads"]["point"] == {"waiting": 0, "capacity": 100, "dropped": 0, "refused": 0, "lost": 0}
    rows = {row[1]: row for row in news["messages"]}
    assert len(rows) == 6
    for name in "point", "text", "image":
        number, _, seconds, size, *others = rows[name]
        assert others[:3] == [None, None, None]
        answer = rows[f"{name}_out"]
        beats = -(-(size + 5) // 8)
        # The model of the hardware takes this long.
        assert answer[3:6] == [size, number, 2 * beats - 1 + 10]
        assert answer[2] >= seconds
        assert answer[6] > 0
    # The fields of the messages, as `firm sim` prints them.
    assert rows["point_out"][7] == ["x=1.5", "y=-2.0", "z=1e+300"]
    assert rows["text"][7] == [f"data={json.dumps(HOSTILE)}"]
    assert rows["image"][7][:2] == ["height=2", "width=3"] and rows["image"][7][-1].endswith("...")
    assert "sent" in run["text"]


def test_it_pauses_steps_and_ends(studio: Studio) -> None:
    begin(studio, isEndless=True, isPaused=True)
    until(studio, lambda now: now["run"] and now["run"]["state"] == "running")
    for number in range(1, 4):
        control(studio, "step")
        # A message and its response.
        expected = 2 * number - 1
        now = until(studio, lambda now: bool(now["last"] >= expected))  # noqa: B023
        assert (now["last"], now["run"]["isPaused"]) == (expected, True)
    control(studio, "resume")
    until(studio, lambda now: now["last"] > 20)
    control(studio, "pause")
    assert until(studio, lambda now: now["run"]["isPaused"])["run"]["state"] == "running"
    control(studio, "stop")
    ended = until(studio, lambda now: now["run"]["state"] == "ended")
    counts = {name: count["messages"] for name, count in ended["counts"].items()}
    assert counts["point"] == counts["point_out"]
    # The record stays.
    assert ask(studio, "GET", f"api/message?number={ended['last']}")[0] == 200


def test_messages_of_services_and_actions_are_played(tmp_path: Path) -> None:
    """As by `firm sim`, each converter gets its messages; the model answers with the bytes that it takes."""
    spec = write_system(tmp_path, [{"enable_request": {"data": True}}] * 3)
    write_service(spec)
    with served(spec, modelled()) as studio:
        begin(studio)
        news = until(studio, lambda now: now["run"] and now["run"]["state"] in ("ended", "failed"))
        assert news["run"]["state"] == "ended", news
        counts = {name: count["messages"] for name, count in news["counts"].items()}
        assert counts == {"enable_request": 3, "enable_response": 3}
        found = ask(studio, "GET", f"api/message?number={news['last']}")[2]
        assert (found["type"], found["fields"]) == ("demo_msgs/Enable_Response", [["success", "True", ""]])


def test_a_page_that_confirms_nothing_holds_nothing_up(studio: Studio) -> None:
    begin(studio, isEndless=True)

    async def steps() -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(f"{studio.address}api/watch") as socket:
            last = -1
            for _ in range(20):
                last = (await socket.receive_json(timeout=600)).get("last", last)
            while (await asyncio.to_thread(ask, studio, "GET", f"api/message?number={last + 500}"))[0] != 200:
                await asyncio.sleep(0.01)
            with pytest.raises(TimeoutError):
                await socket.receive(timeout=0.2)
            await socket.send_str("1")
            later = await socket.receive_json(timeout=600)
            assert len(later["messages"]) <= 20
            assert later["skipped"] == later["last"] - last - len(later["messages"])
            assert later["skipped"] >= 450
            assert [row[0] for row in later["messages"]] == [*range(later["messages"][0][0], later["last"] + 1)]

    asyncio.run(steps())
    control(studio, "stop")


def test_at_most_twenty_reports_a_second(studio: Studio) -> None:
    begin(studio, isEndless=True)

    async def steps() -> None:
        start, count = asyncio.get_running_loop().time(), 0
        async for _ in reports(studio.address):
            count += 1
            if count == 10:
                break
        # The first may come at any time, the others every 50 ms.
        assert asyncio.get_running_loop().time() - start >= 8 * 0.05

    asyncio.run(steps())
    control(studio, "stop")


def test_a_report_contains_only_what_is_new(studio: Studio) -> None:
    begin(studio, isPaused=True)
    until(studio, lambda now: now["run"] and now["run"]["state"] == "running")

    async def steps() -> None:
        is_stepped = False
        async for report in reports(studio.address):
            assert report
            assert ("run" in report) != is_stepped
            assert ("messages" in report) == ("last" in report)
            if not is_stepped:
                assert report.keys() == {"run", "figures"}
                await asyncio.to_thread(control, studio, "step")
                is_stepped = True
            # The last figures follow the last message, also of a run that is paused.
            if report.get("figures", {}).get("counts", {}).get("point_out", {}).get("messages") == 1:
                return

    asyncio.run(steps())
    control(studio, "stop")


def test_a_load_that_changes_without_a_message_is_reported(spec: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So it does when the hardware refuses the message of a step."""
    monkeypatch.setattr("fusesoc_firm.studio.reports.time.monotonic", count().__next__)
    run = Run(load(spec, spec.read_text(encoding="utf-8")), spec, "", Control())
    assert run.control
    run.control.pause()
    reports, loads = Reports(), {"point": Load(1, 100, 0, 0, 0)}
    run.watch.measure(lambda: loads)
    assert reports.next(run, 1, "robot.yaml", {})
    assert reports.next(run, 1, "robot.yaml", {}) is None
    loads["point"] = Load(0, 100, 0, 1, 0)
    report = reports.next(run, 1, "robot.yaml", {})
    assert report
    assert report["figures"]["loads"]["point"]["refused"] == 1
    assert reports.next(run, 1, "robot.yaml", {}) is None


def test_waits_are_counted_only_while_a_page_watches(studio: Studio) -> None:
    begin(studio, isEndless=True)
    # Messages pass, but nobody watches.
    while len((timeline := ask(studio, "GET", "api/timeline")[2])["grants"]) < 300:
        time.sleep(0.01)
    assert timeline["waits"] == []
    news = until(studio, lambda now: bool(now.get("waits") and now["waits"]["cycles"] > 5000))
    names = [*TYPES]
    own = [(name, f"{name}_out") for name in names]
    assert [tuple(wire) for wire in news["run"]["wires"]] == [
        ("the host", "from the host"),
        ("to the host", "the host"),
        *(("from the host", name) for name in names),
        *own,
        *((f"{name}_out", "to the host") for name in names),
    ]
    shares = [100 * count / news["waits"]["cycles"] for count in news["waits"]["counts"]]
    # The model rounds the cycles of each count down.
    assert all(expected - 5 < share <= expected for share, expected in zip(shares, WAITS, strict=True))
    control(studio, "stop")
    until(studio, lambda now: now["run"]["state"] == "ended")
    waits = ask(studio, "GET", "api/timeline")[2]["waits"]
    assert all(before["end"] <= after["first"] for before, after in pairwise(waits))
    assert all(item["end"] - item["first"] == item["cycles"] for item in waits)
    # A response has the counts that its cycles touch.
    row = ask(studio, "GET", "api/record?before=999999999")[2]["messages"][-1]
    found = ask(studio, "GET", f"api/message?number={row[0]}")[2]
    assert (found["waits"] is None) == (row[5] is None)


def test_a_run_is_watched_from_its_first_cycle(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    """However late the server hears that the run is ready."""
    take, begun = Live.take, threading.Event()

    def late(live: Live, run: Run) -> None:
        time.sleep(1)
        take(live, run)

    monkeypatch.setattr(Live, "take", late)

    def has_ended(now: News) -> bool:
        if not begun.is_set():
            begun.set()
            begin(studio)
        return bool(now.get("run") and now["run"]["state"] == "ended")

    first = next(row for row in until(studio, has_ended)["messages"] if row[5] is not None)
    assert ask(studio, "GET", f"api/message?number={first[0]}")[2]["waits"]["cycles"] > 0


def test_waits_of_a_message_are_those_of_its_cycles() -> None:
    watch = Watch()
    for cycle in (200, 300, 400):
        watch.waited(cycle - 100, cycle, [cycle, 1])
    response = Seen(5, "b", 0, b"", Latency(cycles=60), (240, 250))
    # Its cause began to come in at cycle 190.
    assert watch.waits_during(response, 10) == Waits(100, 300, 200, (500, 2))
    alone = replace(response, latency=Latency())
    assert watch.waits_during(replace(alone, cycles=(300, 310)), 10) == Waits(300, 400, 100, (400, 1))
    assert watch.waits_during(replace(alone, cycles=(900, 990)), 10) is None
    assert watch.waits_during(replace(alone, cycles=None), 10) is None


def test_the_record_goes_back(studio: Studio) -> None:
    begin(studio)
    until(studio, lambda now: now["run"] and now["run"]["state"] == "ended")
    rows = ask(studio, "GET", "api/record?before=4")[2]["messages"]
    assert [row[0] for row in rows] == [0, 1, 2, 3]
    assert ask(studio, "GET", "api/record?before=0")[2] == {"messages": []}


def test_messages_are_opened(studio: Studio) -> None:
    begin(studio)
    ended = until(studio, lambda now: now["run"] and now["run"]["state"] == "ended")
    numbers = {row[1]: row[0] for row in ended["messages"]}
    for name in "point", "point_out":
        found = ask(studio, "GET", f"api/message?number={numbers[name]}")[2]
        assert (found["type"], found["hasPicture"]) == ("geometry_msgs/Point", False)
        assert found["fields"] == [["x", "1.5", "m"], ["y", "-2.0", "m"], ["z", "1e+300", "m"]]
    found = ask(studio, "GET", f"api/message?number={numbers['text_out']}")[2]
    assert found["fields"] == [["data", HOSTILE, ""]]
    found = ask(studio, "GET", f"api/message?number={numbers['image_out']}")[2]
    assert found["hasPicture"]
    assert ["header.frame_id", HOSTILE, ""] in found["fields"]
    status, answer, _ = ask(studio, "GET", f"api/picture?number={numbers['text_out']}")
    assert status == 404
    status, answer, _ = ask(studio, "GET", f"api/picture?number={numbers['image_out']}")
    assert (status, answer.getheader("Content-Type")) == (200, "image/png")
    assert answer.getheader("X-Content-Type-Options") == "nosniff"


def test_a_run_that_cannot_begin_says_why(studio: Studio, spec: Path) -> None:
    begin(studio, tool="verilator")
    failed = until(studio, lambda now: now["run"] and now["run"]["state"] == "failed")
    assert "cannot build the simulator" in failed["run"]["text"]
    (spec.parent / "stimuli.yaml").write_text("- nobody: {x: 1}\n", encoding="utf-8")
    status, _, found = ask(studio, "POST", "api/run", {"file": "robot.yaml"})
    assert (status, "'nobody' is not a subscriber" in found["reason"]) == (409, True)
    (spec.parent / "robot.core").unlink()
    status, _, found = ask(studio, "POST", "api/run", {"file": "robot.yaml"})
    assert (status, "no core beside robot.yaml" in found["reason"]) == (409, True)


def test_a_run_waits_for_slow_hardware_until_it_is_stopped(spec: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_run, "_STOP_SECONDS", 0.1)
    with served(spec, modelled("--fault=hang", "--at=2")) as studio:
        begin(studio)
        until(studio, lambda now: now["last"] >= 3)
        # A run of hardware that reports rest would end in this silence; hung hardware never does.
        time.sleep(5 * page_run._SETTLE_SECONDS)
        assert until(studio, lambda _: True)["run"]["state"] == "running"
        control(studio, "stop")
        until(studio, lambda now: now["run"]["state"] == "ended")


def test_a_run_whose_queue_is_full_can_be_stopped(spec: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The player waits for room in a queue, and hung hardware takes no more messages."""
    monkeypatch.setattr(page_run, "_STOP_SECONDS", 0.1)
    with served(spec, modelled("--fault=hang", "--at=2")) as studio:
        begin(studio, isEndless=True)
        until(studio, lambda now: any(load["waiting"] == load["capacity"] for load in now.get("loads", {}).values()))
        control(studio, "stop")
        until(studio, lambda now: now["run"]["state"] == "ended")


def timers() -> list[threading.Timer]:
    return [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer)]


def test_the_limit_of_a_stop_ends_with_the_run(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_run, "_STOP_SECONDS", 600)
    others = timers()
    begin(studio, isEndless=True)
    until(studio, lambda now: now["run"] and now["last"] > 5)
    control(studio, "stop")
    control(studio, "stop")
    until(studio, lambda now: now["run"]["state"] == "ended")
    for timer in timers():
        if timer not in others:
            timer.join(60)
            assert not timer.is_alive()
    control(studio, "stop")
    assert timers() == others


@pytest.mark.parametrize("fault", ["exit", "kill", "garbage"])
def test_a_simulator_that_fails_ends_the_run(spec: Path, fault: str) -> None:
    with served(spec, modelled(f"--fault={fault}", "--at=3")) as studio:
        begin(studio, isEndless=True)
        failed = until(studio, lambda now: now["run"] and now["run"]["state"] == "failed")
        assert "the simulator" in failed["run"]["text"]
        # The next one begins anew.
        begin(studio)
        assert until(studio, lambda now: now["run"]["number"] == 2)["run"]["text"] is not None


def test_another_run_ends_the_first(studio: Studio) -> None:
    begin(studio, isEndless=True)
    until(studio, lambda now: now["run"] and now["last"] > 5)
    first = studio.live.run
    begin(studio)
    assert first
    first.wait()
    assert first.state == "ended"
    assert until(studio, lambda now: now["run"]["state"] == "ended")["run"]["number"] == 2


@pytest.mark.parametrize(
    "wishes",
    [
        {"tool": "sh -c true"},
        {"tool": ["ghdl"]},
        {"rate": -1},
        {"rate": float("nan")},
        {"rate": "10"},
        {"rate": 10**9},
        {"seed": 0},
        {"seed": None},
        {"stallPercent": 100},
        {"isEndless": "yes"},
        {"isPaused": 1},
    ],
    ids=str,
)
def test_wishes_that_are_none_are_refused(studio: Studio, wishes: dict[str, object]) -> None:
    assert ask(studio, "POST", "api/run", {"file": "robot.yaml", **wishes})[0] == 400
    assert ask(studio, "POST", "api/run", {"file": "../robot.yaml"})[0] == 404


def test_questions_about_nothing_are_refused(studio: Studio) -> None:
    for path in "record?before=1", "message?number=1", "picture?number=1":
        assert ask(studio, "GET", f"api/{path}")[0] == 404
    begin(studio)
    until(studio, lambda now: now["run"] and now["run"]["state"] == "ended")
    for number in "", "-1", "x", "1.0", "٣", "9" * 400:
        assert ask(studio, "GET", f"api/message?number={quote(number)}")[0] == 400
    assert ask(studio, "GET", "api/message?number=999")[0] == 404
    bodies: list[object] = [{}, {"do": "explode"}, {"do": ["stop"]}, []]
    for body in bodies:
        assert ask(studio, "POST", "api/control", body)[0] == 400


# --- messages --------------------------------------------------------------------------------------------------------


def frame(spec: Path, block: str) -> Any:
    system = load(spec, spec.read_text(encoding="utf-8")).system
    return next(item.frame for item in system.subscribers if item.block == block)


def image(encoding: str, values: list[int], **other: int) -> dict[str, object]:
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    fields = {"height": 1, "width": 2, "is_bigendian": 0, "step": len(values), **other}
    return {"header": header, "encoding": encoding, "data": bytes(values), **fields}


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (image("rgb8", [1, 2, 3, 4, 5, 6]), [[[1, 2, 3], [4, 5, 6]]]),
        (image("bgr8", [1, 2, 3, 4, 5, 6]), [[[3, 2, 1], [6, 5, 4]]]),
        (image("rgba8", [1, 2, 3, 9, 4, 5, 6, 9]), [[[1, 2, 3], [4, 5, 6]]]),
        (image("bgra8", [1, 2, 3, 9, 4, 5, 6, 9]), [[[3, 2, 1], [6, 5, 4]]]),
        (image("mono8", [7, 200]), [[7, 200]]),
        (image("bayer_rggb8", [7, 200]), [[7, 200]]),
        (image("mono16", [1, 2, 3, 4]), [[0x0201, 0x0403]]),
        (image("mono16", [1, 2, 3, 4], is_bigendian=1), [[0x0102, 0x0304]]),
        (image("mono8", [1, 2, 9, 3, 4], height=2, step=3), [[1, 2], [3, 4]]),
    ],
)
def test_pictures_are_what_their_encoding_says(spec: Path, message: dict[str, object], expected: object) -> None:
    """Matplotlib, by the library Pillow, reads the picture."""
    layout = frame(spec, "image")
    found = picture_of(layout, encode(layout, message))
    assert found
    read = pictures.imread(io.BytesIO(found[0]))
    scale = 65535 if "16" in str(message["encoding"]) else 255
    assert (read * scale).round().astype(int).tolist() == expected


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ({"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"w": -2}}, [1, 2, 3, 0, 0, 0, -1]),
        ({"position": {"x": 1, "y": 2, "z": 3}}, None),
        ({"position": {"x": math.nan}, "orientation": {"w": 1}}, None),
        ({"position": {"x": 1}, "orientation": {"w": math.inf}}, None),
    ],
)
def test_a_pose_has_finite_numbers_and_a_rotation(
    tmp_path: Path, message: dict[str, dict[str, float]], expected: object
) -> None:
    layout = frame(write_system(tmp_path, types={"pose": "geometry_msgs/Pose"}), "pose")
    zeros = {"position": dict.fromkeys("xyz", 0.0), "orientation": dict.fromkeys("xyzw", 0.0)}
    whole = {part: {**numbers, **message.get(part, {})} for part, numbers in zeros.items()}
    assert pose_of(layout, encode(layout, whole)) == expected
    assert pose_of(layout, b"") is None


@pytest.mark.parametrize(
    "message",
    [
        image("yuv422", [1, 2, 3, 4]),
        image("", [1, 2]),
        image("mono8", [1]),
        image("mono8", [1, 2], width=0),
        image("mono8", [1, 2], step=1),
        image("mono8", [1, 2], height=2**32 - 1, width=2**32 - 1, step=2**32 - 1),
        image("rgb8", [1, 2, 3, 4, 5]),
    ],
)
def test_fields_that_are_no_picture_give_none(spec: Path, message: dict[str, object]) -> None:
    layout = frame(spec, "image")
    assert picture_of(layout, encode(layout, message)) is None


def test_only_pictures_without_scripts_are_shown(tmp_path: Path) -> None:
    text = "project: {name: r}\nblocks:\n"
    for name, mode in ("a", "subscriber, outgoing: [{name: b}]"), ("b", "publisher"):
        text += f"  - {{name: {name}, middleware: ROS2, message: sensor_msgs/CompressedImage, mode: {mode}}}\n"
    spec = tmp_path / "r.yaml"
    spec.write_text(text, encoding="utf-8")
    layout = frame(spec, "a")
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    png = b"\x89PNG\r\n\x1a\n" + bytes(9)
    for data, expected in (
        (png, (png, "image/png")),
        (b"\xff\xd8\xff\xe0", (b"\xff\xd8\xff\xe0", "image/jpeg")),
        (b"<svg xmlns='http://www.w3.org/2000/svg' onload='alert(1)'/>", None),
        (b"<html><script>alert(1)</script>", None),
        (b"", None),
    ):
        payload = encode(layout, {"header": header, "format": "png", "data": data})
        assert picture_of(layout, payload) == expected


def test_fields_have_units_and_times_in_words(tmp_path: Path) -> None:
    spec = write_system(tmp_path, (), {"imu": "sensor_msgs/Imu"})
    layout = frame(spec, "imu")

    still = {"x": 0.0, "y": 0.0, "z": 0.0}
    imu = {"orientation": still | {"w": 1.0}, "angular_velocity": still, "linear_acceleration": still | {"z": 9.5}}
    unknown = {f"{name}_covariance": [0.0] * 9 for name in imu}

    def shown(seconds: int) -> dict[str, str]:
        header = {"stamp": {"sec": seconds, "nanosec": 5}, "frame_id": ""}
        found = fields_of(layout, encode(layout, {"header": header, **imu, **unknown}))
        return {name: f"{text} {unit}".rstrip() for name, text, unit in found["fields"]}

    assert shown(12)["header.stamp"] == "12.000000005 s"
    assert shown(1_700_000_000)["header.stamp"] == "2023-11-14 22:13:20.000000005 UTC (1700000000.000000005 s)"
    assert shown(-1)["header.stamp"] == "-1 s + 5 ns"
    assert shown(0)["linear_acceleration.z"] == "9.5 m/s²"
    assert shown(0)["angular_velocity.x"] == "0.0 rad/s"
    assert shown(0)["linear_acceleration_covariance"] == "0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0"


def test_a_list_shows_the_fields_that_are_not_zero(spec: Path) -> None:
    layout = frame(spec, "image")
    payload = encode(
        layout, image("mono8", [5] * 100) | {"header": {"stamp": {"sec": 3, "nanosec": 0}, "frame_id": "c"}}
    )
    words = words_of(layout, payload)
    assert words[-1].endswith("...") and "is_bigendian=0" not in words
    assert len(" ".join(words)) <= 170
    assert words_of(layout, encode(layout, image("mono8", [5] * 5000))) == []
    assert words_of(layout, b"\0") == []


def test_large_messages_are_shortened(spec: Path) -> None:
    layout = frame(spec, "image")
    payload = encode(layout, image("mono8", [5] * 100_000))
    shown = {name: text for name, text, _ in fields_of(layout, payload)["fields"]}
    assert shown["data"].startswith("05 05")
    assert shown["data"].endswith("(100000 bytes)")
    assert len(json.dumps(shown)) < 1000
    text = frame(spec, "text")
    assert len(json.dumps(fields_of(text, encode(text, {"data": "x" * 10**6})))) < 1000
    broken = fields_of(text, b"\0")
    assert broken["fields"] == []
    assert broken["fault"]
