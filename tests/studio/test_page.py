"""The page in a browser: systems are drawn, edited by mouse and by keyboard, and their faults are shown."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
import yaml

import fusesoc_firm.studio
from tests.studio.browser import PROGRAM, Page, opened
from tests.studio.served import served

ROOM = Path(fusesoc_firm.studio.__file__).parent
SPECS = Path(__file__).parents[2] / "specs"
TEXT = """\
# A robot.
project: {name: robot, width: 32}

accelerators:
  - name: filter   # by hand
    type: VHDL
    sources: [filter.vhd]
    interface:
      input: [{middleware: ROS2, message: geometry_msgs/Point}]
      output: [{middleware: ROS2, message: geometry_msgs/Point}]

blocks:
  - name: a
    middleware: ROS2
    mode: subscriber
    message: geometry_msgs/Point
    outgoing:
      - name: f
  - name: f
    type: filter
    outgoing:
      - name: b
  - name: b
    middleware: ROS2
    mode: publisher
    message: geometry_msgs/Point
"""
AXE = ROOM / "page" / "node_modules" / "axe-core" / "axe.min.js"

pytestmark = [
    pytest.mark.check,
    pytest.mark.skipif(not PROGRAM, reason="Chromium is missing"),
    pytest.mark.skipif(not (ROOM / "static" / "index.html").exists(), reason="make studio builds the page"),
]


def block(name: str) -> str:
    """The selector of a block's node."""
    return f'.svelte-flow__node:is([aria-label$=" {name}"], [aria-label*=" {name}, "])'


def labelled(name: str) -> str:
    """The script that finds the input of a key."""
    label = f"[...document.querySelectorAll('aside label')].find(label => label.textContent === '{name}')"
    return f"document.getElementById({label}.htmlFor)"


def button(name: str) -> str:
    """The script that finds a button of the properties."""
    return f"[...document.querySelectorAll('aside button')].find(button => button.textContent === '{name}')"


def run(place: Path, folder: Path, steps: Callable[[Page], Awaitable[None]], *options: str) -> None:
    """Open the page of a place, and do the steps there; nothing may have gone wrong in the page."""

    async def all_steps(address: str) -> None:
        async with opened(address, folder / "profile", *options) as page:
            await page.until("document.querySelectorAll('.svelte-flow__node').length > 2")
            try:
                await steps(page)
            finally:
                await page.picture(folder / "page.png")
                print(f"the page at the end: {folder / 'page.png'}")
            assert page.trouble == []

    with served(place) as studio:
        asyncio.run(all_steps(studio.address))


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "robot.yaml"
    path.write_text(TEXT, encoding="utf-8")
    (tmp_path / "filter.vhd").touch()
    return path


async def written(path: Path, expected: str) -> None:
    """Wait for a content of the file."""
    for _ in range(300):
        if path.read_text(encoding="utf-8") == expected:
            return
        await asyncio.sleep(0.1)
    assert path.read_text(encoding="utf-8") == expected


@pytest.mark.parametrize("name", ["quat2euler", "mobile_robot", "image_pipeline_software", "multi_type"])
def test_shipped_systems_are_drawn(tmp_path: Path, name: str) -> None:
    (path,) = SPECS.glob(f"*/{name}.yaml")
    blocks = yaml.safe_load(path.read_text(encoding="utf-8"))["blocks"]
    ways = sum(len(item.get("outgoing", [])) + ("mode" in item) for item in blocks)

    async def steps(page: Page) -> None:
        # The two sides of the Manager, and a stream between it and each converter.
        await page.until(f"document.querySelectorAll('.svelte-flow__node').length === {len(blocks) + 2}")
        await page.until(f"document.querySelectorAll('.svelte-flow__edge').length === {ways}")
        boxes = await page.evaluate(
            "[...document.querySelectorAll('.svelte-flow__node')].map(n => n.getBoundingClientRect()).map(b => [b.left,"
            " b.top, b.right, b.bottom])"
        )
        for number, (left, top, right, bottom) in enumerate(boxes):
            for other in boxes[number + 1 :]:
                assert right <= other[0] or other[2] <= left or bottom <= other[1] or other[3] <= top

    run(path, tmp_path, steps)


def test_edits_by_mouse(robot: Path, tmp_path: Path) -> None:
    async def steps(page: Page) -> None:
        # A property.
        await page.click(block("b"))
        await page.until("document.querySelector('aside h2').textContent === 'publisher b'")
        await page.evaluate(f"{labelled('topic')}.focus()")
        await page.write("/out")
        await page.press("Enter")
        changed = TEXT.replace("geometry_msgs/Point\n", "geometry_msgs/Point\n    topic: /out\n")
        changed = TEXT[: TEXT.rindex("    message")] + changed[changed.rindex("    message") :]
        await written(robot, changed)
        await page.click("header button:nth-of-type(2)")
        await written(robot, TEXT)
        # A connection.
        await page.drag(f"{block('a')} .svelte-flow__handle-right", f"{block('b')} .svelte-flow__handle-left")
        more = TEXT.replace("      - name: f\n", "      - name: f\n      - name: b\n")
        await written(robot, more)
        await page.until("document.querySelectorAll('.svelte-flow__edge').length === 5")
        await page.evaluate("""document.querySelector('[aria-label="connection from a to b"]').focus()""")
        await page.press("Enter", "Backspace")
        await written(robot, TEXT)
        # A block, with what leads to it.
        await page.click(block("f"))
        await page.press("Backspace")
        left = yaml.safe_load(TEXT)["blocks"]
        await page.until("document.querySelectorAll('.svelte-flow__node').length === 4")
        found = yaml.safe_load(robot.read_text(encoding="utf-8"))["blocks"]
        assert found == [{key: value for key, value in left[0].items() if key != "outgoing"}, left[2]]

    run(robot, tmp_path, steps)


def test_edits_by_keyboard(robot: Path, tmp_path: Path) -> None:
    """A second accelerator is added and connected, without a mouse."""

    async def steps(page: Page) -> None:
        await page.press("a")
        await page.until("document.activeElement?.id === 'add-words'")
        await page.write("filter")
        await page.until("document.querySelector('dialog li b')?.textContent === 'filter'")
        await page.press("Tab", "Enter")
        added = TEXT + "  - name: filter_1\n    type: filter\n"
        await written(robot, added)
        await page.until("document.querySelector('aside h2').textContent === 'accelerator filter_1'")
        await page.evaluate(f"{button('add to outgoing')}.focus()")
        await page.press("Enter")
        await written(robot, f'{added}    outgoing:\n      - name: "?"\n')
        await page.until("document.querySelector('.faults li.error')")
        await page.until("document.querySelector('aside summary').textContent === '?'")
        await page.evaluate("document.querySelector('aside details').open = true")
        await page.evaluate("document.querySelector('aside details input').focus()")
        await page.evaluate("document.activeElement.select()")
        await page.write("b")
        await page.press("Enter")
        await written(robot, f'{added}    outgoing:\n      - name: "b"\n')
        await page.until("document.querySelectorAll('.svelte-flow__edge').length === 5")
        for _ in range(3):
            await page.evaluate("document.activeElement.blur()")
            version = robot.read_text(encoding="utf-8")
            await page.press("z", control=True)
            await page.until("true")
            for _ in range(300):
                if robot.read_text(encoding="utf-8") != version:
                    break
                await asyncio.sleep(0.1)
        await written(robot, TEXT)

    run(robot, tmp_path, steps)


def test_faults_stand_at_their_blocks_while_typing(robot: Path, tmp_path: Path) -> None:
    async def steps(page: Page) -> None:
        await page.click(".cm-content")
        await page.press("End", control=True)
        await page.press("Backspace", "Backspace")
        await page.until(f"document.querySelector('{block('b')} .mark')?.textContent === '1'")
        await page.until("document.querySelector('.faults li.error').textContent.includes('Poin')")
        await page.until("document.querySelector('.cm-lintRange-error') !== null")
        await page.write("t")
        await page.until("document.querySelector('header output').textContent === 'no faults'")
        await written(robot, TEXT.rstrip())
        # The picture stays while the text is not YAML.
        await page.write("\n  - [")
        await page.until("document.querySelector('.faults li.error')?.textContent.includes('invalid YAML')")
        assert await page.evaluate("document.querySelectorAll('.svelte-flow__node').length") == 5
        assert robot.read_text(encoding="utf-8") == TEXT.rstrip()

    run(robot, tmp_path, steps)


def test_a_change_in_another_editor_appears(robot: Path, tmp_path: Path) -> None:
    async def steps(page: Page) -> None:
        robot.write_text(TEXT.replace("name: b\n", "name: other\n"), encoding="utf-8")
        await page.until(f"document.querySelector('{block('other')}') !== null")
        await page.until("document.querySelector('.cm-content').textContent.includes('name: other')")

    run(robot, tmp_path, steps)


@pytest.mark.parametrize(
    "name",
    [
        "<img src=x onerror=window.broken=1>",
        "<script>window.broken=1</script>",
        '"><svg onload=window.broken=1>',
        "javascript:window.broken=1",
        "{@html '<img src=x onerror=window.broken=1>'}",
        "' onmouseover='window.broken=1",
        "</textarea><script>window.broken=1</script>",
    ],
)
def test_nothing_of_a_specification_runs(robot: Path, tmp_path: Path, name: str) -> None:
    quoted = json.dumps(name)
    robot.write_text(TEXT.replace("name: b\n", f"name: {quoted}\n"), encoding="utf-8")

    async def steps(page: Page) -> None:
        titles = "[...document.querySelectorAll('.block strong')].map(title => title.textContent)"
        await page.until(f"{titles}.some(title => title.includes({quoted}))")
        await page.click(".svelte-flow__node:nth-of-type(4)")
        assert await page.evaluate("window.broken") is None

    run(robot, tmp_path, steps)


@pytest.mark.skipif(not AXE.exists(), reason="make studio installs axe-core")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_people_with_impairments_can_use_the_page(robot: Path, tmp_path: Path, scheme: str) -> None:
    """No rule of axe-core is violated: by the picture with a fault and a selected block, and by the dialog."""
    robot.write_text(TEXT.replace("name: b\n    middleware: ROS2", "name: b\n    middleware: ROS3"), encoding="utf-8")

    async def steps(page: Page) -> None:
        await page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        await page.evaluate(AXE.read_text(encoding="utf-8") + ";0")
        await page.click(block("b"))
        await page.until("document.querySelector('aside h2').textContent === 'publisher b'")
        for _ in range(2):
            violations = "violations.map(rule => [rule.id, rule.nodes.map(node => [node.html, node.failureSummary])])"
            found = await page.evaluate(f"axe.run().then(({{violations}}) => {violations})")
            assert found == [], json.dumps(found, indent=1)
            await page.click("header button")
            await page.until("document.querySelector('dialog li button') !== null")

    run(robot, tmp_path, steps)


def test_the_page_needs_no_other_server() -> None:
    """What is shipped names no address of another host that it would load."""
    for path in (ROOM / "static").rglob("*"):
        if path.suffix in {".html", ".css"}:
            assert not re.findall(r"(?:src|href|url)[=(]\s*[\"']?(?:https?:)?//", path.read_text(encoding="utf-8"))
