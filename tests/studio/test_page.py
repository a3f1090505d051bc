"""The page in a browser: systems are drawn, edited by mouse and by keyboard, and their faults are shown."""

from __future__ import annotations

import asyncio
import json
import math
import re
import threading
import xml.etree.ElementTree as ET
from collections.abc import Awaitable, Callable
from itertools import count, permutations
from pathlib import Path

import pytest
import yaml
from matplotlib import image as pictures

import fusesoc_firm.studio
from fusesoc_firm.exploration.resources import Tell
from fusesoc_firm.studio import evaluation
from tests.studio.browser import PROGRAM, Page, shared_browser
from tests.studio.played import write_service
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


def view(name: str) -> str:
    """The script that finds the button of a view."""
    return f"[...document.querySelectorAll('.text > [role=group] button')].find(item => item.textContent === '{name}')"


def run(place: Path, folder: Path, steps: Callable[[Page], Awaitable[None]]) -> None:
    """Open the page of a place, and do the steps there; nothing may have gone wrong in the page."""

    async def all_steps(address: str) -> None:
        async with shared_browser().opened(address) as page:
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


def test_topics_within_the_fpga_are_drawn(tmp_path: Path) -> None:
    """A wire for each publisher and reader; converters whose messages stay have no stream to the Manager."""
    path = SPECS / "perception" / "perception.yaml"

    async def steps(page: Page) -> None:
        await page.until("document.querySelectorAll('.svelte-flow__edge.topic').length === 8")
        labels = await page.evaluate(
            "[...document.querySelectorAll('.svelte-flow__edge.topic')].map(edge => edge.ariaLabel).sort()"
        )
        assert labels[2:4] == [
            "topic /edges from edges_out to contrast_in",
            "topic /edges from edges_out to regions_in",
        ]
        # The image, the command and the speed.
        assert await page.evaluate("document.querySelectorAll('.svelte-flow__edge.stream').length") == 3
        for name, words in (("trust_in", "within the FPGA"), ("control_out", "id 0, ")):
            text = await page.evaluate(f"document.querySelector({json.dumps(block(name))}).textContent")
            assert words in text

    run(path, tmp_path, steps)


@pytest.mark.parametrize("path", ["arm/arm", "planner/planner", "camera/camera", "camera/asking"])
def test_a_loop_of_two_blocks_hides_no_wire(tmp_path: Path, path: str) -> None:
    """A block of an action or a service and its accelerator: no wire is below a block, or along another wire."""

    async def steps(page: Page) -> None:
        await page.until("document.querySelectorAll('.svelte-flow__edge').length > 3")
        wires, hidden = await page.evaluate(
            """(() => {
                 const boxes = [...document.querySelectorAll('.svelte-flow__node')].map(n => n.getBoundingClientRect());
                 const wires = [...document.querySelectorAll('.svelte-flow__edge-path')].map(path =>
                   Array.from({length: 101}, (_, part) => path.getPointAtLength(part / 100 * path.getTotalLength())
                     .matrixTransform(path.getScreenCTM())).map(({x, y}) => [x, y]));
                 const isIn = ([x, y], box) => box.left + 4 < x && x < box.right - 4 && box.top < y && y < box.bottom;
                 return [wires, wires.flat().filter(point => boxes.some(box => isIn(point, box)))];
               })()"""
        )
        assert hidden == []
        for one, other in permutations(wires, 2):
            shared = [(x, y) for x, y in one if any(math.dist((x, y), point) < 1 for point in other)]
            assert len(shared) < len(one) / 3

    run(SPECS.parent / "tests" / "ros" / f"{path}.yaml", tmp_path, steps)


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


def test_the_keyboard_alone_suffices(robot: Path, tmp_path: Path) -> None:
    """Tab leads to the blocks, the views and the properties; no script sets the focus, and no mouse is used."""

    async def steps(page: Page) -> None:
        async def go_to(condition: str) -> None:
            for _ in range(200):
                await page.press("Tab")
                if await page.evaluate(f"Boolean((element => {condition})(document.activeElement))"):
                    return
            raise AssertionError(f"Tab does not lead to what has {condition}")

        await page.until("document.querySelector('header output').textContent === 'no faults'")
        # A block is selected and gets a topic, which is taken back.
        await go_to("element.getAttribute('aria-label') === 'publisher b'")
        await page.press("Enter")
        await page.until("document.querySelector('aside h2').textContent === 'publisher b'")
        await go_to(f"element === {labelled('topic')}")
        await page.write("/out")
        await page.press("Enter")
        await page.until("document.querySelector('.block.publisher').textContent.includes('/out')")
        assert "topic: /out" in robot.read_text(encoding="utf-8")
        await go_to("element.textContent === 'undo'")
        await page.press("Enter")
        await written(robot, TEXT)
        # The views, and the list of generated files within one.
        await go_to("element.textContent === 'VHDL'")
        await page.press("Enter")
        await page.until("document.querySelector('.code select')?.options.length > 2")
        await go_to("element.matches('.code select')")
        await page.press("End")
        last = "document.querySelector('.code select')"
        await page.until(f"{last}.selectedIndex === {last}.options.length - 1")
        # A text that is typed, a fault in it, and the way from the fault to its line.
        await go_to("element.textContent === 'file'")
        await page.press("Enter")
        await page.until("document.querySelector('.cm-content') !== null")
        await go_to("element.matches('.cm-content')")
        await page.press("End", control=True)
        await page.press("Backspace", "Backspace")
        await page.until("document.querySelector('.faults li.error') !== null")
        # Tab is not a character of the text, so the keyboard can leave it.
        await go_to("element.closest('.faults li.error')")
        await page.press("Enter")
        await page.until("document.querySelector('.cm-activeLine').textContent.includes('geometry_msgs/Poi')")

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


async def down(page: Page, number: int) -> None:
    """Go one line down in the generated file, and wait for the reasons of the line with this number."""
    await page.press("ArrowDown")
    await page.until(f"document.querySelector('section[aria-label^=why] h2').textContent.includes('line {number} ')")


def test_a_generated_line_leads_to_its_line_in_the_file(robot: Path, tmp_path: Path) -> None:
    wanted = TEXT.splitlines().index("  - name: b")

    async def steps(page: Page) -> None:
        await page.click(block("b"))
        await page.evaluate(f"{view('VHDL')}.click()")
        line = "[...document.querySelectorAll('.code .cm-line')].find(line => line.textContent.startsWith('entity '))"
        await page.until(f"{line}.textContent === 'entity geometry_msgs_point_to_axis is'")
        await page.evaluate("document.querySelector('.code .cm-content').focus()")
        why = "document.querySelector('section[aria-label^=why]')"
        await down(page, 2)
        await down(page, 3)
        assert await page.evaluate(f"{why}.innerText.includes('publisher.vhd.mustache')")
        # The instance of the block in the top level.
        await page.choose(".code select", "robot_system.vhd")
        await page.until("document.querySelector('.code .cm-content').textContent.includes('entity robot_system is')")
        leads = f"[...{why}.querySelectorAll('button')].find(button => button.textContent === 'line {wanted + 1}')"
        for number in count(2):
            await down(page, number)
            if await page.evaluate(f"Boolean({leads}) && ({leads}.click(), true)"):
                break
        active = "document.querySelector('.text .cm-activeLine')?.textContent"
        await page.until(f"{active} === {json.dumps(TEXT.splitlines()[wanted])}")

    run(robot, tmp_path, steps)


def test_a_late_answer_replaces_no_newer_one(robot: Path, tmp_path: Path) -> None:
    """The top level, which is asked for first, arrives after another file."""

    async def steps(page: Page) -> None:
        await page.evaluate("""(fetched => {
            window.fetch = async (address, options) => {
                const answer = await fetched(address, options);
                if (!String(address).endsWith('name=robot_system.vhd')) return answer;
                await new Promise(release => (window.release = release));
                const content = await answer.json();
                answer.json = async () => (setTimeout(() => (window.isTaken = true)), content);
                return answer;
            };
        })(window.fetch)""")
        await page.evaluate(f"{view('VHDL')}.click()")
        await page.until("window.release")
        await page.choose(".code select", "geometry_msgs_point_to_axis.vhd")
        text = "document.querySelector('.code .cm-content').textContent"
        await page.until(f"{text}.includes('entity geometry_msgs_point_to_axis is')")
        await page.evaluate("window.release()")
        await page.until("window.isTaken")
        assert await page.evaluate(f"{text}.includes('entity geometry_msgs_point_to_axis is')")

    run(robot, tmp_path, steps)


def test_bounds_and_schedulers_are_compared(robot: Path, tmp_path: Path) -> None:
    robot.write_text(f"{TEXT}    period: 200\n", encoding="utf-8")

    async def steps(page: Page) -> None:
        await page.evaluate(f"{view('evaluate')}.click()")
        tables = "[...document.querySelectorAll('.view table')]"
        await page.until(f"{tables}[0].innerText.includes('200 cycles') && {tables}[1].rows.length === 8")
        await page.until("document.querySelector('.view tr.chosen td').textContent.startsWith('fixed_priority')")

    run(robot, tmp_path, steps)


def test_an_action_without_a_name_is_drawn(robot: Path, tmp_path: Path) -> None:
    robot.write_text(f"{TEXT}  - {{middleware: ROS1, mode: server, action: actionlib/Test}}\n", encoding="utf-8")

    async def steps(page: Page) -> None:
        await page.until("document.querySelectorAll('.svelte-flow__edge').length === 6")
        await page.until("document.querySelector('.block.service').innerText.includes('block 4')")

    run(robot, tmp_path, steps)


@pytest.mark.skipif(not AXE.exists(), reason="make studio installs axe-core")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_resources_are_shown_as_they_come(
    robot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    """The synthesis goes on while another view is shown; it ends when the user cancels it, and with the page."""
    robot.write_text(TEXT.replace("width: 32", "width: 32, clock: 100 MHz"), encoding="utf-8")
    goes_on, ended = threading.Event(), threading.Semaphore(0)

    def answer(mhz: float | None) -> dict[str, object]:
        common = {"ram": 2, "dsp": 0, "mhz": mhz}
        blocks = [{"name": "a", "lut": 60, "ff": 70, **common}, {"name": "f", "lut": 80, "ff": 90, **common}]
        return {"device": "a device", "blocks": blocks, "clocks": {"clk": mhz} if mhz else {}, "missing": ""}

    async def resources_of(_: Path, tell: Tell) -> dict[str, object]:
        try:
            await tell({"step": "places", **answer(None)})
            while not goes_on.is_set():
                await asyncio.sleep(0.05)
            goes_on.clear()
            return answer(90.0)
        finally:
            ended.release()

    monkeypatch.setattr(evaluation, "resources_of", resources_of)

    async def steps(page: Page) -> None:
        await page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        await page.evaluate(AXE.read_text(encoding="utf-8") + ";0")
        rows = "[...document.querySelectorAll('.resources tbody tr')].map(row => row.innerText.trim())"
        step = "document.querySelector('.view [role=status]').textContent"
        use = "[...document.querySelectorAll('.view button')].find(item => item.textContent === '{}').click()"
        await page.evaluate(f"{view('evaluate')}.click()")
        await page.until(f"({use.format('synthesise')}, true)")
        await page.until(f"{rows}.length === 3 && {rows}[0].startsWith('f\\t80\\t90\\t2') && {step}.includes('3 of 3')")
        await page.evaluate(f"{view('file')}.click()")
        await page.until("document.querySelector('.cm-content') !== null")
        await page.evaluate(f"{view('evaluate')}.click()")
        await page.until(f"{step}.includes('3 of 3')")
        goes_on.set()
        await page.until(f"{rows}[0].includes('90.0, less than 100') && {rows}[2].includes('clk 90.0')")
        await page.until(f"!{step}.trim()")
        violations = "violations.map(rule => [rule.id, rule.nodes.map(node => [node.html, node.failureSummary])])"
        assert await page.evaluate(f"axe.run().then(({{violations}}) => {violations})") == []
        robot.write_text(TEXT, encoding="utf-8")
        await page.until("document.querySelector('.view').innerText.includes('of an earlier text')")
        await page.until(f"({use.format('synthesise')}, true)")
        await page.until(f"{step}.includes('3 of 3')")
        await page.evaluate(use.format("cancel"))
        await page.until(f"{step}.includes('cancelled')")
        await page.evaluate(use.format("synthesise"))
        await page.until(f"{step}.includes('3 of 3')")

    run(robot, tmp_path, steps)
    # One ended by itself, one with 'cancel', and one with the browser.
    assert all(ended.acquire(timeout=60) for _ in range(3))


async def saved(page: Page, place: Path, name: str) -> tuple[ET.Element, Path]:
    """Save the picture in both forms: the root of the SVG, and the PNG."""
    allowed = {"behavior": "allow", "downloadPath": str(place), "browserContextId": page.context}
    await page.call("Browser.setDownloadBehavior", **allowed)
    for form in "SVG", "PNG":
        found = f"[...document.querySelectorAll('header button')].find(button => button.textContent === '{form}')"
        await page.evaluate(f"{found}.click()")
    svg, png = (place / f"{name}.{form}" for form in ("svg", "png"))
    for _ in range(300):
        # A file that the browser still writes has another ending.
        if svg.exists() and png.exists() and {*place.iterdir()} == {svg, png}:
            break
        await asyncio.sleep(0.1)
    return ET.fromstring(svg.read_text(encoding="utf-8")), png


def texts_of(svg: ET.Element) -> list[str]:
    return [item.text or "" for item in svg.iter("{http://www.w3.org/2000/svg}text")]


def test_the_picture_is_saved_as_svg_and_png(robot: Path, tmp_path: Path) -> None:
    """What is saved is well-formed, with every name as text, also a hostile one."""
    hostile = "<script>window.broken=1</script>&"
    robot.write_text(TEXT.replace("name: b\n", f"name: {json.dumps(hostile)}\n"), encoding="utf-8")

    async def steps(page: Page) -> None:
        root, png = await saved(page, tmp_path / "saved", "robot")
        assert {"a", "f", hostile, "filter (VHDL)", "from the host", "to the host"} <= {*texts_of(root)}
        assert not [*root.iter("{http://www.w3.org/2000/svg}script")]
        size = pictures.imread(png).shape
        assert (size[1], size[0]) == tuple(round(2 * float(root.get(name) or 0)) for name in ("width", "height"))

    run(robot, tmp_path, steps)


def test_the_picture_stays_readable_when_it_grows(robot: Path, tmp_path: Path) -> None:
    """Blocks without wires fill rows below the others: all are within the width, and the first ones in view."""

    async def steps(page: Page) -> None:
        lines = "".join(f"  - {{name: f{number}, type: filter}}\n" for number in range(12))
        robot.write_text(TEXT + lines, encoding="utf-8")
        boxes = "[...document.querySelectorAll('.svelte-flow__node')].map(node => node.getBoundingClientRect())"
        whole = "document.querySelector('.picture').getBoundingClientRect()"
        await page.until(f"{boxes}.length === 17")
        await page.until(f"{boxes}.every(box => box.left >= {whole}.left && box.right <= {whole}.right)")
        await page.until(f"{boxes}.slice(1, 4).every(box => box.top >= {whole}.top && box.bottom <= {whole}.bottom)")
        rows = f"new Set({boxes}.slice(5, -1).map(box => box.top)).size"
        assert 2 <= await page.evaluate(rows) <= 4

    run(robot, tmp_path, steps)


def test_the_file_is_beside_the_picture_in_a_wide_window(robot: Path, tmp_path: Path) -> None:
    """The divider between them is moved by keys and by the mouse; the blocks stay in the picture's width."""

    async def steps(page: Page) -> None:
        window = {"width": 1800, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
        await page.call("Emulation.setDeviceMetricsOverride", **window)
        picture, text = (f"document.querySelector('{name}').getBoundingClientRect()" for name in (".picture", ".text"))
        share = "Number(document.querySelector('.divider').ariaValueNow)"
        boxes = "[...document.querySelectorAll('.svelte-flow__node')].map(node => node.getBoundingClientRect())"
        is_whole = f"{boxes}.every(box => box.left >= {picture}.left && box.right <= {picture}.right)"
        is_beside = f"{picture}.right <= {text}.left && {picture}.top === {text}.top"
        await page.until(f"{is_beside} && {share} === 33 && {is_whole}")
        await page.evaluate("document.querySelector('.divider').focus()")
        await page.press("ArrowLeft")
        await page.until(f"{share} === 38")
        await page.press("Home", "ArrowLeft")
        await page.until(f"{share} === 80 && {text}.width > 3 * {picture}.width")
        await page.press("End", "ArrowRight")
        await page.until(f"{share} === 15 && {picture}.width > 3 * {text}.width && {is_whole}")
        await page.drag(".divider", ".block.accelerator")
        await page.until(f"{share} > 30 && {share} < 90 && {is_whole}")
        # The other views need the whole width, as the file does in a narrow window.
        is_below = f"{picture}.bottom <= {text}.top && {picture}.left === {text}.left && {is_whole}"
        await page.until(f"({view('messages')}.click(), true)")
        await page.until(f"{is_below} && document.querySelector('.messages') !== null")
        await page.until(f"({view('file')}.click(), true)")
        await page.until(is_beside)
        await page.call("Emulation.setDeviceMetricsOverride", **(window | {"width": 1000}))
        await page.until(is_below)

    run(robot, tmp_path, steps)


def test_a_service_has_both_streams(tmp_path: Path) -> None:
    spec = tmp_path / "robot.yaml"
    write_service(spec)

    async def steps(page: Page) -> None:
        await page.until("document.querySelector('header output').textContent === 'no faults'")
        await page.until("document.querySelectorAll('.svelte-flow__edge').length === 4")
        await page.until("document.querySelector('.block.service').innerText.includes('server of demo_msgs/Enable')")
        await page.until("document.querySelector('.block.service').innerText.includes('ids 0, 0')")
        await page.click(block("enable"))
        await page.until(f"{labelled('service')}.value === 'demo_msgs/Enable'")

    run(spec, tmp_path, steps)


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
