"""The page watches a run: rates and latencies at the wires, the list of messages, one of them opened, and control."""

from __future__ import annotations

import asyncio
import json
import math
import shutil
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from fusesoc_firm.studio.page_run import Build
from tests.studio.browser import PROGRAM, Page, shared_browser
from tests.studio.played import HOSTILE, TYPES, WAITS, modelled, write_core, write_system
from tests.studio.served import served
from tests.studio.test_page import AXE, ROOM, saved, texts_of

pytestmark = [
    pytest.mark.check,
    pytest.mark.skipif(not PROGRAM, reason="Chromium is missing"),
    pytest.mark.skipif(not (ROOM / "static" / "index.html").exists(), reason="make studio builds the page"),
]
ARM = Path(__file__).resolve().parents[1] / "ros" / "arm"
ROWS = "document.querySelectorAll('.messages tbody tr')"
VIEW_BUTTONS = ".text > [role=group]"
# Each view, and what it shows while a run is watched.
VIEWS = {
    "bytes": "document.querySelectorAll('.bytes td').length > 5",
    "VHDL": "document.querySelector('.code .cm-content').textContent.includes('entity robot_system is')",
    "timeline": "document.querySelector('.grant') && document.querySelector('.lanes .wait')",
    "plots": "document.querySelector('.plot canvas') && document.querySelector('.plot').innerText.includes('cycles')",
    "status": "document.querySelector('.view').innerText.includes('no status block')",
    "evaluate": """document.querySelector('.view').innerText.includes("needs a 'period'")""",
    "file": "document.querySelector('.cm-content').textContent.includes('name: robot')",
}
STATE = "document.querySelector('.run output').textContent"


def button(text: str, inside: str) -> str:
    """The script that finds a button."""
    return f"[...document.querySelectorAll('{inside} button')].find(button => button.textContent === '{text}')"


async def press(page: Page, text: str, inside: str = ".run") -> None:
    """Use a button by the keyboard."""
    await page.until(f"!{button(text, inside)}.disabled && ({button(text, inside)}.focus(), true)")
    await page.press("Enter")


def watching(
    folder: Path,
    steps: Callable[[Page], Awaitable[None]],
    *options: str,
    spec: Path | None = None,
    hardware: Build | None = None,
) -> None:
    """Open the page of a system whose hardware is a model, with `options` unless it is another `hardware`."""

    async def all_steps(address: str) -> None:
        async with shared_browser().opened(address) as page:
            await page.until("document.querySelectorAll('.svelte-flow__node').length > 2")
            try:
                await steps(page)
            finally:
                await page.picture(folder / "page.png")
                print(f"the page at the end: {folder / 'page.png'}")
            assert page.trouble == []

    with served(spec or write_system(folder), hardware or modelled(*options)) as studio:
        asyncio.run(all_steps(studio.address))


def row_of(block: str) -> str:
    """The script that finds the first listed message of a block."""
    return f"[...{ROWS}].find(row => row.children[2].textContent === '{block}')"


async def open_message(page: Page, block: str) -> None:
    """Open a message of a block."""
    await page.until(f"({row_of(block)}.querySelector('button').click(), true)")


async def violations(page: Page) -> list[object]:
    """The rules of axe-core that the page violates, with the elements."""
    rows = "violations.map(rule => [rule.id, rule.nodes.map(node => [node.html, node.failureSummary])])"
    return list(await page.evaluate(f"axe.run().then(({{violations}}) => {rows})"))


def test_a_run_is_watched_paused_and_read_backwards(tmp_path: Path) -> None:
    async def steps(page: Page) -> None:
        await page.evaluate("document.querySelector('.run details').open = true")
        await page.evaluate("[...document.querySelectorAll('.run [type=checkbox]')].at(-1).focus()")
        await page.press(" ")
        await press(page, "run")
        count = "Number(document.querySelector('.messages p')?.innerText.match(/(\\d+) messages/)?.[1])"
        await page.until(f"{STATE} === 'robot.yaml, simulation in ghdl: paused' && {count} === 0")
        await press(page, "one message")
        await page.until(f"{count} === 2")
        await press(page, "one message")
        await page.until(f"{count} === 4")
        await press(page, "continue")
        wires = "[...document.querySelectorAll('.wire')].map(wire => wire.textContent.trim())"
        # Those of the Manager; others show where messages wait.
        await page.until(f"{wires}.filter(words => words.includes('/s')).length === 6")
        # A frame of 5 beats in and out and a latency of 10 cycles at 100 MHz, as the model says.
        await page.until(f"{wires}.some(words => words.includes('190 ns'))")
        await page.until(f"{ROWS}.length > 10")
        await press(page, "pause")
        await page.until(f"{STATE} === 'robot.yaml, simulation in ghdl: paused'")
        # A response, and the messages before it.
        await page.until(f"({row_of('point_out')}.querySelector('button').focus(), true)")
        await page.press("Enter")
        title = "document.querySelector('.message h2')?.textContent"
        await page.until(f"{title}?.endsWith(': point_out, geometry_msgs/Point')")
        last = int(str(await page.evaluate(title)).split(":")[0])
        assert "19 cycles, 190 ns" in await page.evaluate("document.querySelector('.message').innerText")
        await press(page, "previous", ".message")
        await page.until(f"{title}.startsWith('{last - 1}:')")
        await press(page, "next", ".message")
        await page.until(f"{title}.startsWith('{last}:')")
        cause = "[...document.querySelectorAll('.message p button')].find(item => item.textContent.includes('cause'))"
        await page.evaluate(f"{cause}.focus()")
        await page.press("Enter")
        await page.until(f"{title}.endsWith(': point, geometry_msgs/Point')")
        await press(page, "continue")
        await page.until(f"{count} > {last} + 10")
        # The old messages stay until the new ones are there.
        fewest = f"new MutationObserver(() => (window.fewest = Math.min(window.fewest, {ROWS}.length)))"
        observe = "observe(document.querySelector('.messages tbody'), {childList: true})"
        await page.evaluate(f"window.fewest = {ROWS}.length, {fewest}.{observe}")
        await press(page, "newest", ".messages")
        await page.until(f"Number([...{ROWS}].at(-1).querySelector('button').textContent) > {last} + 10")
        assert await page.evaluate("window.fewest") > 0
        await press(page, "stop")
        await page.until(f"{STATE} === 'robot.yaml, simulation in ghdl: ended'")
        await page.until("document.querySelector('.messages pre').textContent.includes('received')")

    watching(tmp_path, steps)


def test_a_picture_is_shown_and_no_content_runs(tmp_path: Path) -> None:
    async def steps(page: Page) -> None:
        await press(page, "run")
        # An opened message holds the list.
        await page.until(f"{row_of('text_out')} && {row_of('image_out')}")
        await open_message(page, "text_out")
        await page.until(f"document.querySelector('.message dd')?.textContent === {json.dumps(HOSTILE)}")
        await open_message(page, "image_out")
        await page.until("document.querySelector('.message img')?.naturalWidth === 3")
        colours = """(image => {
            const canvas = document.createElement('canvas');
            [canvas.width, canvas.height] = [3, 2];
            const context = canvas.getContext('2d');
            context.drawImage(image, 0, 0);
            return [...context.getImageData(0, 0, 3, 2).data];
        })(document.querySelector('.message img'))"""
        pixels = await page.evaluate(colours)
        assert pixels == [255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 3, 2, 1, 255, 6, 5, 4, 255, 9, 8, 7, 255]
        assert await page.evaluate("window.broken") is None
        # The reason of a failure comes from a tool, which may print anything.
        await page.choose(".run select", "verilator")
        await page.evaluate("[...document.querySelectorAll('.run button')][0].click()")
        await page.until(f"document.querySelector('.messages pre')?.textContent.includes({json.dumps(HOSTILE)})")
        assert await page.evaluate("window.broken") is None

    watching(tmp_path, steps)


def test_the_streams_of_an_action_have_their_rates_and_waits(tmp_path: Path) -> None:
    """An action has two streams each way, which are one line of the picture each way."""
    folder = tmp_path / "arm"
    shutil.copytree(ARM, folder)
    spec = folder / "arm.yaml"
    write_core(spec)
    # On the wires of the host, to goals and cancellations, to and from the accelerator, and from feedback and results.
    # Cancellations wait longest, since the accelerator takes none; goals begin to wait before their converter.
    hardware = modelled(width=32, waits=(0, 0, 10, 30, 0, 20, 0, 0, 0, 60))

    async def steps(page: Page) -> None:
        await page.until("document.querySelector('.block.service').innerText.includes('server of actionlib/Test')")
        await page.until("document.querySelector('.block.service').innerText.includes('ids 0, 1, 0, 1')")
        await press(page, "run")
        taken, given = (
            f"""document.querySelector('[data-wire^="{begin}"]')?.textContent"""
            for begin in ("from the host>count_goal ", "count_feedback>to the host ")
        )
        await page.until(f"/goal: [\\d.]+\\/s\\ncancel: [\\d.]+\\/s\\nwaits (29|30) %\\nbegins here/.test({taken})")
        await page.until(f"/feedback: .*\\nresult: .*\\nwaits (59|60) %\\nbegins here/.test({given})")
        within = """[...document.querySelectorAll('[data-wire*="counting"]')].map(wire => wire.textContent.trim())"""
        await page.until(f"JSON.stringify({within}) === JSON.stringify(['waits 20 %\\nbegins here'])")

    watching(tmp_path, steps, spec=spec, hardware=hardware)


@pytest.mark.skipif(not AXE.exists(), reason="make studio installs axe-core")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_poses_are_drawn(tmp_path: Path, scheme: str) -> None:
    """A robot drives a quarter of a circle; at its end, its x axis points to where the world's y axis does."""
    steps_of = 8
    stimuli = []
    for number in range(steps_of + 1):
        angle = math.pi / 2 * number / steps_of
        place = {"x": math.sin(angle), "y": 1 - math.cos(angle), "z": 0.1 * number}
        pose = {"position": place, "orientation": {"z": 2 * math.sin(angle / 2), "w": 2 * math.cos(angle / 2)}}
        stimuli.append({"pose": {"pose": {"pose": pose}}})
    spec = write_system(tmp_path, stimuli, {"pose": "nav_msgs/Odometry"})

    async def steps(page: Page) -> None:
        await page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        await page.evaluate(AXE.read_text(encoding="utf-8") + ";0")
        await page.evaluate("document.querySelectorAll('.run [type=checkbox]')[0].click()")
        await press(page, "run")
        await page.until(f"{STATE}.endsWith('ended') && {ROWS}.length === {2 * (steps_of + 1)}")
        await page.until(f"([...{ROWS}].at(-1).querySelector('button').click(), true)")
        points = "document.querySelector('.pose polyline').points.length"
        await page.until(f"{points} === {steps_of + 1}")
        way = "(line => [line.x2.baseVal.value - line.x1.baseVal.value, line.y2.baseVal.value - line.y1.baseVal.value])"
        axis = f"{way}(document.querySelector('.pose line.{{}}.axis{{}}'))"
        for body, world, sign in (0, 1, 1), (1, 0, -1), (2, 2, 1):
            found = await page.evaluate(axis.format("body", body))
            assert found == pytest.approx([sign * part for part in await page.evaluate(axis.format("world", world))])
        assert await violations(page) == []
        # The keyboard turns the view. The first message has no earlier poses.
        before = await page.evaluate(axis.format("body", 0))
        await page.evaluate("document.querySelector('.pose input').focus()")
        await page.press("ArrowDown")
        await page.until(f"{axis.format('body', 0)}[0] !== {before[0]}")
        await open_message(page, "pose_out")
        await page.until(f"{points} === 1")

    watching(tmp_path, steps, spec=spec)


def test_a_full_queue_is_seen_at_its_wire(tmp_path: Path) -> None:
    """The model takes no frame after 20, so messages wait and are dropped."""

    async def steps(page: Page) -> None:
        await page.evaluate("document.querySelector('.run details').open = true")
        await page.evaluate("document.querySelector('.run input[type=number]').focus()")
        await page.evaluate("document.activeElement.select()")
        await page.write("5000")
        await press(page, "run")
        wires = "[...document.querySelectorAll('.wire')]"
        await page.until(f"{wires}.some(wire => wire.textContent.includes('100 of 100 wait'))")
        await page.until(f"{wires}.some(wire => wire.textContent.includes('dropped'))")
        await page.until("document.querySelector('.wire.crowded') !== null")

    watching(tmp_path, steps, "--fault=hang", "--at=20")


def test_idle_wires_differ_from_stuck_ones(tmp_path: Path) -> None:
    """The model takes no frame after 20. The point waits in all cycles, and nothing leaves the hardware."""

    async def steps(page: Page) -> None:
        await press(page, "run")
        await page.until("document.querySelectorAll('path.stuck.first').length === 1")
        await page.until(f"{words_at('point', 'point_out')}.trim() === 'stuck\\nwaits 100 %\\nbegins here'")
        idle = "[...document.querySelectorAll('.svelte-flow__edge:has(path.idle)')].map(wire => wire.dataset.id).sort()"
        await page.until(f"JSON.stringify({idle}) === JSON.stringify(['out:1', 'out:3', 'out:5'])")
        await press(page, "pause")
        await page.until("document.querySelectorAll('path.stuck, path.idle').length === 0")

    hardware = modelled("--fault=hang", "--at=20", waits=(0, 0, 0, 0, 0, 100, 0, 0, 0, 0, 0))
    watching(tmp_path, steps, hardware=hardware)


def words_at(source: str, sink: str) -> str:
    """The script that finds the words at a wire."""
    return f"""document.querySelector('[data-wire="{source}>{sink}"]')?.textContent"""


def test_wires_show_where_messages_wait_and_where_that_begins(tmp_path: Path) -> None:
    async def steps(page: Page) -> None:
        await press(page, "run")
        names = [*TYPES]
        ways = [("from the host", name) for name in names] + [(name, f"{name}_out") for name in names]
        ways += [(f"{name}_out", "to the host") for name in names]
        for way, percent in zip(ways, WAITS[2:], strict=True):
            share = f"Number({words_at(*way)}?.match(/waits (\\d+) %/)?.[1] ?? 0)"
            # The model rounds down.
            await page.until(f"{share} <= {percent} && {share} > {percent} - 5")
        for way in (("point_out", "to the host"), ("text", "text_out")):
            await page.until(f"{words_at(*way)}.includes('begins here')")
        await page.until(f"!{words_at('point', 'point_out')}.includes('begins')")
        await page.until("document.querySelectorAll('path.waits.first').length === 2")
        await page.picture(tmp_path / "waits.png")
        svg, _ = await saved(page, tmp_path / "saved", "robot")
        assert texts_of(svg).count("begins here") == 2
        shares = [int(text.split()[1]) for text in texts_of(svg) if text.startswith("waits ")]
        assert all(any(percent - 5 < share <= percent for share in shares) for percent in (50, 60))
        # An opened response shows the counts of its cycles.
        await open_message(page, "point_out")
        await page.until("document.querySelector('.message').innerText.includes('where messages waited in the cycles')")
        await page.until(f"{words_at('point_out', 'to the host')}.includes('waits')")
        await page.picture(tmp_path / "past.png")
        await press(page, "newest", ".messages")
        await page.until("!document.querySelector('.message').innerText.includes('where messages waited')")
        await press(page, "timeline", VIEW_BUTTONS)
        await page.until("document.querySelector('.view').innerText.includes('point_out → to the host')")
        await page.picture(tmp_path / "timeline.png")

    watching(tmp_path, steps)


@pytest.mark.skipif(not AXE.exists(), reason="make studio installs axe-core")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_people_with_impairments_can_watch(tmp_path: Path, scheme: str) -> None:
    async def steps(page: Page) -> None:
        await page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        await page.evaluate(AXE.read_text(encoding="utf-8") + ";0")
        await press(page, "run")
        await open_message(page, "image_out")
        await page.until("document.querySelector('.message img')?.naturalWidth === 3")
        await page.evaluate("document.querySelector('.message details').open = true")
        # The frame of an image has 137 bytes, 8 in a beat.
        await page.until("document.querySelector('.message details').innerText.includes('18 beats')")
        await page.until("document.querySelectorAll('.wavedrom svg text').length > 18")
        assert await violations(page) == []
        for view, shown in VIEWS.items():
            await press(page, view, VIEW_BUTTONS)
            await page.until(shown)
            assert await violations(page) == []

    watching(tmp_path, steps)
