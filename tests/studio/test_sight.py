"""What is seen of the page without a click: texts and handles are large enough, and nothing is cut or over another."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.studio.page_run import Run
from fusesoc_firm.studio.server import Studio
from tests.studio.browser import PROGRAM, Page, shared_browser
from tests.studio.played import modelled, write_system
from tests.studio.served import load, served
from tests.studio.test_page import ROOM, TEXT, block, view, written
from tests.studio.test_watching import ROWS, press, row_of

pytestmark = [
    pytest.mark.check,
    pytest.mark.skipif(not PROGRAM, reason="Chromium is missing"),
    pytest.mark.skipif(not (ROOM / "static" / "index.html").exists(), reason="make studio builds the page"),
]
WINDOWS = [(390, 844), (768, 1024), (1400, 900), (1920, 1080)]
# In pixels on the screen.
SMALLEST_TEXT, SMALLEST_HANDLE = 12, 16
MEASURE = f"{Path(__file__).with_name('measure.js').read_text(encoding='utf-8')}({SMALLEST_TEXT}, {SMALLEST_HANDLE})"
IN_VIEW = """(() => {
  const pane = document.querySelector('.picture').getBoundingClientRect();
  const node = document.querySelector('.svelte-flow__node:has(.subscriber)').getBoundingClientRect();
  return node.left >= pane.left && node.right <= pane.right && node.top >= pane.top && node.bottom <= pane.bottom;
})()"""

# The class of the header's verdict, and the verdict.
HEAD = (
    "(({ className, textContent }) => `${className}: ${textContent.trim()}`)(document.querySelector('header output'))"
)
# The ids of the wires in the colour of faults.
RED_WIRES = """(() => {
  const probe = document.body.appendChild(Object.assign(document.createElement("i"), { className: "bad" }));
  const { color } = getComputedStyle(probe);
  probe.remove();
  const wires = [...document.querySelectorAll(".svelte-flow__edge")];
  const isRed = (wire) => getComputedStyle(wire.querySelector("path")).stroke === color;
  return wires.filter(isRed).map((wire) => wire.dataset.id);
})()"""
# What is drawn in the colour of faults.
RED = """(() => {
  const probe = document.body.appendChild(Object.assign(document.createElement("i"), { className: "bad" }));
  const { color } = getComputedStyle(probe);
  probe.remove();
  const keys = ["color", "borderTopColor", "backgroundColor"];
  const isRed = (item) => item.checkVisibility() && keys.some((key) => getComputedStyle(item)[key] === color);
  return [...document.querySelectorAll("body *")].filter(isRed).map((item) => item.outerHTML);
})()"""


def system(chains: int, more: str = "") -> str:
    """The text of a system with a subscriber, an accelerator and a publisher in each chain."""
    text = TEXT[: TEXT.index("blocks:")] + "blocks:\n"
    common = "middleware: ROS2, message: geometry_msgs/Point"
    for number in range(chains):
        text += f"  - {{name: in_{number}, mode: subscriber, {common}, outgoing: [{{name: filter_{number}}}]}}\n"
        text += f"  - {{name: filter_{number}, type: filter, outgoing: [{{name: out_{number}}}]}}\n"
        text += f"  - {{name: out_{number}, mode: publisher, {common}}}\n"
    return text + more


IMU = """\
  - {name: imu, middleware: ROS2, mode: subscriber, message: sensor_msgs/Imu, outgoing: [{name: imu_out}]}
  - {name: imu_out, middleware: ROS2, mode: publisher, message: sensor_msgs/Imu}
"""
TEXTS = {"empty": "project: {name: robot}\n", "five": system(1, IMU), "sixty": system(20)}


def seen(
    place: Path,
    folder: Path,
    size: tuple[int, int],
    steps: Callable[[Page], Awaitable[None]],
    prepare: Callable[[Studio], None] = lambda _: None,
) -> None:
    """Open the page of a place in a window, and do the steps there."""

    async def all_steps(address: str) -> None:
        async with shared_browser().opened(address) as page:
            width, height = size
            window = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            await page.call("Emulation.setDeviceMetricsOverride", **window)
            await page.call("Page.navigate", url=address)
            try:
                await steps(page)
            finally:
                await page.picture(folder / "page.png")
                print(f"the page at the end: {folder / 'page.png'}")
            assert page.trouble == []

    with served(place, modelled()) as studio:
        prepare(studio)
        asyncio.run(all_steps(studio.address))


async def measure(page: Page) -> None:
    """What is seen keeps the limits, once it has come to rest."""
    found: dict[str, list[str]] = {}
    for _ in range(20):
        found = await page.evaluate(MEASURE)
        if not any(found.values()):
            return
        await asyncio.sleep(0.2)
    raise AssertionError(json.dumps(found, indent=1))


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    (tmp_path / "filter.vhd").touch()
    return tmp_path / "robot.yaml"


@pytest.mark.parametrize("size", WINDOWS, ids=str)
@pytest.mark.parametrize("name", [*TEXTS])
def test_a_system_is_readable(robot: Path, tmp_path: Path, name: str, size: tuple[int, int]) -> None:
    robot.write_text(TEXTS[name], encoding="utf-8")
    count = TEXTS[name].count("  - {name") + 2

    async def steps(page: Page) -> None:
        await page.until(f"document.querySelectorAll('.svelte-flow__node').length === {count}")
        await page.until("document.querySelector('header output').textContent !== 'checking'")
        if name != "empty":
            await page.until(IN_VIEW)
        await measure(page)
        assert await page.evaluate(RED) == []

    seen(robot, tmp_path, size, steps)


@pytest.mark.parametrize("size", WINDOWS, ids=str)
def test_a_new_project_is_readable(tmp_path: Path, size: tuple[int, int]) -> None:
    folder = tmp_path / "new"
    folder.mkdir()

    async def steps(page: Page) -> None:
        await page.until("document.activeElement?.id === 'begin-name'")
        await measure(page)

    seen(folder, tmp_path, size, steps)


@pytest.mark.parametrize("size", WINDOWS, ids=str)
def test_a_run_is_readable(tmp_path: Path, size: tuple[int, int]) -> None:
    """Also with the words at all wires; a healthy system shows no red."""

    async def steps(page: Page) -> None:
        await press(page, "run")
        await page.until(f"{ROWS}.length > 5")
        await page.until("document.querySelectorAll('.block .value.known').length >= 4")
        await page.until("document.querySelectorAll('path.stuck, path.idle').length === 0")
        await measure(page)
        assert await page.evaluate(RED) == []

    seen(write_system(tmp_path), tmp_path, size, steps)


async def touch(page: Page, start: str, end: str) -> None:
    """Drag one finger from one element to another."""
    (x, y), (to_x, to_y) = await page.place(start), await page.place(end)
    await page.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    for part in range(1, 11):
        point = {"x": x + (to_x - x) * part / 10, "y": y + (to_y - y) * part / 10}
        await page.call("Input.dispatchTouchEvent", type="touchMove", touchPoints=[point])
    await page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])


@pytest.mark.parametrize("way", ["mouse", "touch", "keys"])
def test_blocks_are_connected_at_the_default_zoom(robot: Path, tmp_path: Path, way: str) -> None:
    robot.write_text(TEXT, encoding="utf-8")
    ends = (f"{block('a')} .svelte-flow__handle-right", f"{block('b')} .svelte-flow__handle-left")

    async def steps(page: Page) -> None:
        await page.until("document.querySelector('header output').textContent === 'no faults'")
        if way == "mouse":
            await page.drag(*ends)
        elif way == "touch":
            await touch(page, *ends)
        else:
            await page.evaluate(f"document.querySelector({json.dumps(block('a'))}).focus()")
            await page.press("Enter")
            await page.until("document.querySelector('aside h2').textContent === 'subscriber a'")
            await page.evaluate("document.querySelector('.connect select').focus()")
            await page.press("b")
        await written(robot, TEXT.replace("      - name: f\n", "      - name: f\n      - name: b\n"))

    seen(robot, tmp_path, (1400, 900), steps)


def test_a_block_and_its_line_lead_to_each_other(robot: Path, tmp_path: Path) -> None:
    robot.write_text(TEXT, encoding="utf-8")

    async def steps(page: Page) -> None:
        await page.until("document.querySelector('header output').textContent === 'no faults'")
        await page.until("document.querySelector('.cm-content') !== null")
        await page.click(f"{block('b')} strong")
        await page.until("document.querySelector('.cm-activeLine').textContent.includes('name: b')")
        for line, title in ("type: filter", "accelerator f"), ("name: a", "subscriber a"):
            lines = "[...document.querySelectorAll('.cm-line')]"
            find = f"{lines}.find(item => item.textContent.includes('{line}') && !item.textContent.includes('#'))"
            await page.evaluate(f"{find}.id = 'wanted'")
            await page.click("#wanted")
            await page.evaluate("document.getElementById('wanted')?.removeAttribute('id')")
            await page.until(f"document.querySelector('aside h2').textContent === '{title}'")
            await page.until(f"document.querySelector({json.dumps(block(title.split()[1]))}).matches('.selected')")

    seen(robot, tmp_path, (1400, 1000), steps)


@pytest.mark.parametrize(
    ("period", "verdict", "head"),
    [
        ("20 ms", "all messages meet their deadlines; the messages need 0 % of the channel's time", "good: no faults"),
        ("50 ns", (late := "overloaded: the messages need 180 % of the channel's time; late: b"), f"warn: {late}"),
    ],
)
def test_an_evaluation_adds_the_times_that_it_needs(
    robot: Path, tmp_path: Path, period: str, verdict: str, head: str
) -> None:
    """The header has the verdict, too: an overloaded system is not called faultless."""
    robot.write_text(TEXT.replace("width: 32", "width: 32, clock: 100 MHz"), encoding="utf-8")

    async def steps(page: Page) -> None:
        await page.until("document.querySelector('header output').textContent === 'no faults'")
        await page.until(f"({view('evaluate')}.click(), true)")
        await page.until("document.querySelector('.gaps label')?.textContent.includes(\"b needs a 'period'\")")
        await page.evaluate("document.querySelector('.gaps input').focus()")
        await page.write(period)
        await page.press("Enter")
        await page.until("document.querySelector('.view').innerText.includes('Schedulers for this system')")
        assert yaml.safe_load(robot.read_text(encoding="utf-8"))["blocks"][2]["period"] == period
        await page.until(f"document.querySelector('.verdict').textContent === {json.dumps(verdict)}")
        await page.until(f"{HEAD} === {json.dumps(head)}")
        await measure(page)
        # The header needs no open view, and a system with faults is not called overloaded.
        await page.until(f"({view('evaluate')}.click(), true)")
        robot.write_text(robot.read_text(encoding="utf-8").replace("type: filter", "type: filtr"), encoding="utf-8")
        await page.until(f"{HEAD}.startsWith('bad: ')")
        robot.write_text(robot.read_text(encoding="utf-8").replace("type: filtr", "type: filter"), encoding="utf-8")
        await page.until(f"{HEAD} === {json.dumps(head)}")

    seen(robot, tmp_path, (1400, 900), steps)


def test_the_wire_of_a_fault_has_its_colour(robot: Path, tmp_path: Path) -> None:
    robot.write_text(TEXT, encoding="utf-8")

    async def steps(page: Page) -> None:
        await page.until(f"{HEAD} === 'good: no faults'")
        assert await page.evaluate(RED_WIRES) == []
        robot.write_text("Vector3".join(TEXT.rsplit("Point", 1)), encoding="utf-8")
        await page.until(f"{HEAD} === 'bad: 1 fault'")
        await page.until(f"JSON.stringify({RED_WIRES}) === JSON.stringify(['way:1:0'])")

    seen(robot, tmp_path, (1400, 900), steps)


def test_a_selected_block_shows_its_last_message_and_a_plot(tmp_path: Path) -> None:
    async def steps(page: Page) -> None:
        await press(page, "run")
        await page.click(f"{block('point_out')} strong")
        now = "document.querySelector('.now')"
        await page.until(f"{now}.innerText.includes('1e+300 m') && {now}.innerText.includes('19 cycles, 190 ns')")
        await page.until(f"{now}.querySelector('canvas') && {now}.innerText.includes('now 1.5 m')")
        # The list shows the fields as `firm sim` prints them, and the block what passed it last.
        await page.until(f"{row_of('point_out')}.innerText.includes('x=1.5 y=-2.0 z=1e+300')")
        value = f"document.querySelector({json.dumps(block('point_out') + ' .value')})"
        assert await page.evaluate(f"{value}.textContent") == "x=1.5 y=-2.0 z=1e+300"
        await page.until("document.querySelectorAll('path.flows').length > 4")
        still = [{"name": "prefers-reduced-motion", "value": "reduce"}]
        moving = "[...document.querySelectorAll('path.flows')].some(item => item.getAnimations().length)"
        assert await page.evaluate(moving)
        await page.call("Emulation.setEmulatedMedia", features=still)
        await page.until(f"!({moving})")

    seen(write_system(tmp_path), tmp_path, (1400, 1000), steps)


def test_a_new_project_shows_five_settings(robot: Path, tmp_path: Path) -> None:
    robot.write_text(TEXTS["empty"], encoding="utf-8")

    async def steps(page: Page) -> None:
        fields = "[...document.querySelectorAll('aside .field')].filter(item => item.checkVisibility()).length"
        await page.until(f"{fields} === 5")
        await page.click("aside .more summary")
        await page.until(f"{fields} > 10")
        await page.click(".invitation button")
        await page.until("document.activeElement?.id === 'add-words'")

    seen(robot, tmp_path, (1400, 900), steps)


def test_a_live_run_offers_its_views(tmp_path: Path) -> None:
    """A run of `firm live` cannot be paused, and no simulation takes its place."""
    spec = write_system(tmp_path)
    run = Run(load(spec, spec.read_text(encoding="utf-8")), spec, "a node")

    async def steps(page: Page) -> None:
        buttons = "[...document.querySelectorAll('.run button')].map(item => item.textContent)"
        await page.until(f"JSON.stringify({buttons}) === JSON.stringify(['messages', 'plots', 'status'])")
        await press(page, "status")
        await page.until("document.querySelector('.view').innerText.includes('no status block')")
        run.end()
        await page.until(f"{buttons}.includes('run')")

    seen(spec, tmp_path, (1400, 900), steps, lambda studio: studio.live.take(run))
